//! The picture: panels, axes, legend.

use super::Panel;
use super::strains::{Strains, colour, colour_of, strain};
use super::view::View;
use nalgebra::Vector3;
use springs_scene::{Scene, printable};
use std::fmt::Write as _;

/// Size of the drawing in a panel, in pixels.
pub(super) const WIDTH: f64 = 300.0;
pub(super) const HEIGHT: f64 = 260.0;
const MARGIN: f64 = 16.0;
const TITLE: f64 = 58.0;
const FOOTER: f64 = 72.0;
/// More springs than this in a panel cannot be told apart.
const MOST_SPRINGS: usize = 20_000;

/// Draws the panels with the springs of `scene`, coloured by strain.
///
/// All panels share view, scale and colours. The view is along the direction
/// in which nothing extends, if there is one, and slanted otherwise, with
/// gravity pointing down.
///
/// # Panics
///
/// If a panel does not have the nodes of the scene.
pub fn filmstrip(scene: &Scene, panels: &[Panel]) -> String {
    for panel in panels {
        assert_eq!(panel.positions.len(), scene.nodes.len(), "the same nodes");
    }
    let view = View::of(scene, panels);
    let strains = Strains::of(scene, panels);
    let n = panels.len().max(1) as f64;
    let width = n * WIDTH + (n + 1.0) * MARGIN;
    let height = TITLE + HEIGHT + FOOTER;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{MARGIN}\" y=\"28\" font-size=\"18\" fill=\"#222\">{}</text>\n",
        escape(&printable(&scene.name))
    );
    for (index, panel) in panels.iter().enumerate() {
        let left = MARGIN + index as f64 * (WIDTH + MARGIN);
        draw_panel(&mut svg, scene, panel, &view, strains.range, left);
    }
    draw_axes(&mut svg, &view);
    draw_legend(&mut svg, &view, &strains, width);
    if scene.gravity != Vector3::zeros() {
        let top = TITLE + HEIGHT + 66.0;
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{top}\" font-size=\"12\" fill=\"#555\" \
             text-anchor=\"end\">gravity ↓</text>",
            width - MARGIN
        )
        .expect("writing to a string");
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw_panel(svg: &mut String, scene: &Scene, panel: &Panel, view: &View, range: f64, left: f64) {
    let line = |svg: &mut String, text: std::fmt::Arguments<'_>| {
        writeln!(svg, "{text}").expect("writing to a string");
    };
    line(
        svg,
        format_args!(
            "<text x=\"{left}\" y=\"48\" font-size=\"13\" fill=\"#555\">t = {} s</text>\n\
             <g transform=\"translate({left} {TITLE})\">\n\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fafafa\" stroke=\"#ddd\"/>",
            round(panel.time)
        ),
    );
    for (node, position) in scene.nodes.iter().zip(&panel.positions) {
        let [x, y] = view.project(position);
        if node.fixed {
            line(
                svg,
                format_args!(
                    "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"5\" height=\"5\" fill=\"#222\"/>",
                    x - 2.5,
                    y - 2.5
                ),
            );
        } else if node.mass > 0.0 {
            line(
                svg,
                format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"#222\"/>"),
            );
        }
    }
    let stride = scene.springs.len().div_ceil(MOST_SPRINGS).max(1);
    let mut drawn: Vec<(f64, usize)> = (0..scene.springs.len())
        .step_by(stride)
        .map(|index| {
            let [a, b] = scene.springs[index].nodes.map(|node| panel.positions[node]);
            (view.toward.dot(&(a + b)), index)
        })
        .collect();
    drawn.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let stroke = match scene.springs.len() {
        0..200 => 2.0,
        200..2000 => 1.2,
        _ => 0.7,
    };
    line(
        svg,
        format_args!("<g fill=\"none\" stroke-width=\"{stroke}\" stroke-linecap=\"round\">"),
    );
    // Neighbours in depth that share a colour share a path.
    let colour_at = |index: usize| {
        let spring = &scene.springs[index];
        colour_of(strain(spring, &panel.positions), range)
    };
    for run in drawn.chunk_by(|a, b| colour_at(a.1) == colour_at(b.1)) {
        let mut path = String::new();
        for &(_, index) in run {
            let ends = scene.springs[index].nodes.map(|node| panel.positions[node]);
            let [[x0, y0], [x1, y1]] = ends.map(|end| view.project(&end));
            write!(path, "M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}").expect("writing to a string");
        }
        let colour = colour(colour_at(run[0].1));
        line(
            svg,
            format_args!("<path stroke=\"{colour}\" d=\"{path}\"/>"),
        );
    }
    svg.push_str("</g>\n");
    svg.push_str("</g>\n");
}

/// Length of an axis that lies in the picture, in pixels.
const AXIS: f64 = 22.0;

/// The directions of x, y and z, in a corner of the first panel.
fn draw_axes(svg: &mut String, view: &View) {
    let (x, y) = (MARGIN + AXIS + 14.0, TITLE + HEIGHT - AXIS - 14.0);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    for (axis, name) in axes.into_iter().zip(["x", "y", "z"]) {
        let (right, up) = (view.right.dot(&axis), view.up.dot(&axis));
        let length = right.hypot(up);
        // One that points at the viewer cannot be seen.
        if length < 0.2 {
            continue;
        }
        let tip = [x + AXIS * right, y - AXIS * up];
        let beyond = [tip[0] + 8.0 * right / length, tip[1] - 8.0 * up / length];
        writeln!(
            svg,
            "<path stroke=\"#555\" d=\"M{x:.1} {y:.1}L{:.1} {:.1}\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" fill=\"#555\" \
             text-anchor=\"middle\" dominant-baseline=\"central\">{name}</text>",
            tip[0], tip[1], beyond[0], beyond[1]
        )
        .expect("writing to a string");
    }
}

fn draw_legend(svg: &mut String, view: &View, strains: &Strains, width: f64) {
    let top = TITLE + HEIGHT + 22.0;
    let (bar, cell) = (width.min(300.0) - 2.0 * MARGIN, 12.0);
    // Only what occurs: a spring cannot lose more than its length, and a net
    // under tension has none in compression.
    let colours = strains.colours();
    let part = bar / colours.clone().count() as f64;
    for (place, index) in colours.enumerate() {
        writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{top}\" width=\"{:.1}\" height=\"{cell}\" fill=\"{}\"/>",
            MARGIN + part * place as f64,
            part + 0.5,
            colour(index)
        )
        .expect("writing to a string");
    }
    let mut label = |x: f64, anchor: &str, text: &str| {
        writeln!(
            svg,
            "<text x=\"{x}\" y=\"{}\" font-size=\"12\" fill=\"#555\" \
             text-anchor=\"{anchor}\">{text}</text>",
            top + 28.0
        )
        .expect("writing to a string");
    };
    let [low, high] = strains.labels();
    label(MARGIN, "start", &low);
    label(MARGIN + 0.5 * bar, "middle", "strain");
    label(MARGIN + bar, "end", &high);
    let scale_bar = nice_below(80.0 / view.scale[0]);
    let pixels = scale_bar * view.scale[0];
    let end = width - MARGIN;
    let heights = match view.vertical_exaggeration() {
        factor if factor > 1.0 => format!(", heights ×{factor}"),
        _ => String::new(),
    };
    label(end, "end", &format!("{} m{heights}", round(scale_bar)));
    writeln!(
        svg,
        "<path stroke=\"#222\" stroke-width=\"2\" d=\"M{:.1} {y:.1}H{end:.1}\"/>",
        end - pixels,
        y = top + 0.5 * cell
    )
    .expect("writing to a string");
}

/// The largest of 1, 2, 5, 10, … that is not above `value`.
fn nice_below(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let digit = [5.0, 2.0, 1.0]
        .into_iter()
        .find(|digit| digit * power <= value);
    digit.unwrap_or(1.0) * power
}

/// Three significant digits.
pub(super) fn round(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    let text = format!("{value:.*}", digits.clamp(0, 12) as usize);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Text as the content of an XML element.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::super::strains::COLOURS;
    use super::*;
    use springs_scene::Node;

    #[test]
    fn numbers_are_rounded_for_people() {
        let texts = [0.0, 1.0, 0.5, 12.345, 1234.5, 0.001_234_5].map(round);
        assert_eq!(texts, ["0", "1", "0.5", "12.3", "1234", "0.00123"]);
        assert_eq!([7.0, 20.0, 0.03].map(nice_below), [5.0, 20.0, 0.02]);
    }

    #[test]
    fn colours_run_from_blue_over_grey_to_red() {
        assert_eq!(colour(0), "#1450aa");
        assert_eq!(colour(COLOURS / 2), "#bebebe");
        assert_eq!(colour(COLOURS - 1), "#be1928");
        assert_eq!(colour_of(Some(-0.2), 0.2), 0);
        assert_eq!(colour_of(None, 0.2), COLOURS / 2);
    }

    #[test]
    fn gravity_points_down_and_flat_scenes_are_seen_face_on() {
        let mut scene = Scene {
            name: "a < b".to_owned(),
            gravity: Vector3::new(0.0, 0.0, -9.81),
            ..Scene::default()
        };
        for (x, z) in [(0.0, 0.0), (1.0, 0.0), (1.0, -1.0)] {
            scene.add_node(Node::at(Vector3::new(x, 0.0, z)));
        }
        scene.add_spring(0, 1, 1.0);
        let panel = Panel {
            time: 0.0,
            positions: scene.nodes.iter().map(|node| node.position).collect(),
        };
        let view = View::of(&scene, std::slice::from_ref(&panel));
        assert!((view.up - Vector3::z()).norm() < 1e-12);
        assert!((view.right - Vector3::x()).norm() < 1e-12);
        let svg = filmstrip(&scene, &[panel.clone(), panel]);
        assert!(svg.contains("a &lt; b"));
        assert_eq!(svg.matches("<path stroke=\"#bebebe\"").count(), 2);
    }

    #[test]
    fn an_empty_scene_gives_a_picture() {
        let panel = Panel {
            time: 0.0,
            positions: Vec::new(),
        };
        assert!(filmstrip(&Scene::default(), &[panel]).ends_with("</svg>\n"));
    }

    #[test]
    fn the_legend_shows_the_strains_that_occur() {
        let mut scene = Scene::default();
        let stretched = |strains: &[f64]| {
            let mut scene = Scene::default();
            for (k, strain) in strains.iter().enumerate() {
                let a = scene.add_node(Node::at(Vector3::zeros()));
                let b = scene.add_node(Node::at(Vector3::x() * (1.0 + strain)));
                let spring = scene.add_spring(a, b, 1.0);
                scene.springs[spring].rest_length = 1.0;
                assert_eq!(spring, k);
            }
            let panel = Panel {
                time: 0.0,
                positions: scene.nodes.iter().map(|node| node.position).collect(),
            };
            Strains::of(&scene, &[panel])
        };
        // A net under tension has no blue.
        let net = stretched(&[0.1, 0.25]);
        assert_eq!(*net.colours().start(), COLOURS / 2);
        assert_eq!(net.labels(), ["0 %", "≥ +10 %"]);
        // Nothing is shortened by more than all of its length.
        let cord = stretched(&[2.0, 2.0, 2.0, -0.5]);
        assert_eq!(cord.labels(), ["−50 %", "+200 %"]);
        assert!(*cord.colours().start() > 0);
        scene.gravity.z = -1.0;
        let picture = filmstrip(&scene, &[]);
        assert!(picture.contains("gravity ↓") && picture.contains(">z</text>"));
    }
}
