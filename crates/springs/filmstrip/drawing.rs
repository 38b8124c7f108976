//! The picture: panels, axes, legend.

use super::Panel;
use super::marks::{Marks, draw_marks, draw_marks_legend};
use super::strains::{Strains, colour, colour_of, strain};
use super::view::View;
use crate::drawing::{Area, Drawn, FINE, at, fine};
use nalgebra::Vector3;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use springs_scene::{Scene, printable};

/// Size of the drawing in a panel, in pixels.
pub(super) const WIDTH: f64 = 300.0;
pub(super) const HEIGHT: f64 = 260.0;
pub(super) const MARGIN: f64 = 16.0;
const TITLE: f64 = 58.0;
const FOOTER: f64 = 72.0;
/// Room for the scale, in pixels.
const SCALE: f64 = 140.0;
/// In a shorter bar of colours there is no room for three labels, in pixels.
const NARROW: f64 = 200.0;
/// More springs than this in a panel cannot be told apart.
const MOST_SPRINGS: usize = 20_000;

pub(super) const DARK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub(super) const GREY: RGBColor = RGBColor(0x55, 0x55, 0x55);
const PALE: RGBColor = RGBColor(0xfa, 0xfa, 0xfa);
const FRAME: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);

/// Draws the panels with the springs of `scene`, coloured by strain, its supports and loads,
/// and what is left of broken springs.
///
/// All panels share view, scale and colours. The view is along the direction
/// in which nothing extends, if there is one, and slanted otherwise, with
/// gravity pointing down. Loads are those of the scene at the time of each panel.
///
/// # Panics
///
/// If a panel does not have the nodes of the scene, or breaks a spring that is not there.
pub fn filmstrip(scene: &Scene, panels: &[Panel]) -> String {
    for panel in panels {
        assert_eq!(panel.positions.len(), scene.nodes.len(), "the same nodes");
    }
    let n = panels.len().max(1) as f64;
    let width = n * WIDTH + (n + 1.0) * MARGIN;
    let height = TITLE + HEIGHT + FOOTER;
    fine((width as u32, height as u32), |root| {
        let view = View::of(scene, panels);
        let strains = Strains::of(scene, panels);
        let marks = Marks::of(scene, panels);
        let name = printable(&scene.name);
        write(root, &name, [MARGIN, 28.0], (18.0, DARK), HPos::Left)?;
        for (index, panel) in panels.iter().enumerate() {
            let corner = [MARGIN + index as f64 * (WIDTH + MARGIN), TITLE];
            let time = format!("t = {} s", round(panel.time));
            write(root, &time, [corner[0], 48.0], (13.0, GREY), HPos::Left)?;
            let frame = Rectangle::new(box_of(corner, [WIDTH, HEIGHT]), PALE.filled());
            root.draw(&frame)?;
            let frame = Rectangle::new(box_of(corner, [WIDTH, HEIGHT]), FRAME.stroke_width(FINE));
            root.draw(&frame)?;
            let place = Place {
                scene,
                panel,
                view: &view,
                corner,
            };
            draw_springs(root, &place, strains.range)?;
            draw_marks(root, &place, &marks)?;
        }
        draw_axes(root, &view)?;
        draw_legend(root, &view, &strains, width)?;
        draw_marks_legend(root, &marks, TITLE + HEIGHT + 66.0)?;
        if scene.gravity != Vector3::zeros() {
            let place = [width - MARGIN, TITLE + HEIGHT + 66.0];
            write(root, "gravity ↓", place, (12.0, GREY), HPos::Right)?;
        }
        Ok(())
    })
}

/// A panel, and where it is in the picture.
pub(super) struct Place<'a> {
    pub(super) scene: &'a Scene,
    pub(super) panel: &'a Panel,
    pub(super) view: &'a View,
    corner: [f64; 2],
}

impl Place<'_> {
    /// Where a point of the scene is in the picture, in pixels.
    pub(super) fn project(&self, point: &Vector3<f64>) -> [f64; 2] {
        let [x, y] = self.view.project(point);
        [self.corner[0] + x, self.corner[1] + y]
    }
}

pub(super) fn box_of([left, top]: [f64; 2], [width, height]: [f64; 2]) -> [(i32, i32); 2] {
    [at(left, top), at(left + width, top + height)]
}

/// A line of `width` pixels through points in pixels.
pub(super) fn line(
    root: &Area<'_>,
    points: &[[f64; 2]],
    (width, colour): (f64, RGBColor),
) -> Drawn {
    let points: Vec<_> = points.iter().map(|[x, y]| at(*x, *y)).collect();
    let width = (width * f64::from(FINE)).round() as u32;
    root.draw(&PathElement::new(points, colour.stroke_width(width)))
}

/// Text on a base line, its letters so many pixels high.
pub(super) fn write(
    root: &Area<'_>,
    text: &str,
    [x, base]: [f64; 2],
    (size, colour): (f64, RGBColor),
    along: HPos,
) -> Drawn {
    write_at(
        root,
        text,
        [x, base + 0.26 * size],
        (size, colour),
        Pos::new(along, VPos::Bottom),
    )
}

fn write_at(
    root: &Area<'_>,
    text: &str,
    [x, y]: [f64; 2],
    (size, colour): (f64, RGBColor),
    anchor: Pos,
) -> Drawn {
    // Plotters means the height of a line.
    let line = 1.24 * size * f64::from(FINE);
    let style = TextStyle::from(("sans-serif", line).into_font()).color(&colour);
    root.draw(&Text::new(text.to_owned(), at(x, y), style.pos(anchor)))
}

fn draw_springs(root: &Area<'_>, place: &Place<'_>, range: f64) -> Drawn {
    let Place {
        scene, panel, view, ..
    } = *place;
    let mut is_broken = vec![false; scene.springs.len()];
    for &spring in &panel.broken {
        is_broken[spring] = true;
    }
    let stride = scene.springs.len().div_ceil(MOST_SPRINGS).max(1);
    let mut drawn: Vec<(f64, usize)> = (0..scene.springs.len())
        .step_by(stride)
        .filter(|&index| !is_broken[index])
        .map(|index| {
            let [a, b] = scene.springs[index].nodes.map(|node| panel.positions[node]);
            (view.toward.dot(&(a + b)), index)
        })
        .collect();
    drawn.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let width = match scene.springs.len() {
        0..200 => 2.0,
        200..2000 => 1.2,
        _ => 0.7,
    };
    for (_, index) in drawn {
        let spring = &scene.springs[index];
        let colour = colour(colour_of(strain(spring, &panel.positions), range));
        let ends = spring
            .nodes
            .map(|node| place.project(&panel.positions[node]));
        line(root, &ends, (width, colour))?;
    }
    Ok(())
}

/// Length of an axis that lies in the picture, in pixels.
const AXIS: f64 = 22.0;

/// The directions of x, y and z, in a corner of the first panel.
fn draw_axes(root: &Area<'_>, view: &View) -> Drawn {
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
        line(root, &[[x, y], tip], (1.0, GREY))?;
        let middle = Pos::new(HPos::Center, VPos::Center);
        write_at(root, name, beyond, (11.0, GREY), middle)?;
    }
    Ok(())
}

fn draw_legend(root: &Area<'_>, view: &View, strains: &Strains, width: f64) -> Drawn {
    let top = TITLE + HEIGHT + 22.0;
    // Beside the bar of colours stands that of the scale.
    let (bar, cell) = ((width - 2.0 * MARGIN - SCALE).min(268.0), 12.0);
    // Only what occurs: a spring cannot lose more than its length, and a net
    // under tension has none in compression.
    let colours = strains.colours();
    let n = colours.clone().count() as f64;
    for (k, index) in colours.enumerate() {
        let left = MARGIN + bar * k as f64 / n;
        let corners = box_of([left, top], [bar / n + 0.5, cell]);
        root.draw(&Rectangle::new(corners, colour(index).filled()))?;
    }
    let label =
        |x: f64, along: HPos, text: &str| write(root, text, [x, top + 28.0], (12.0, GREY), along);
    let [low, high] = strains.labels();
    if bar < NARROW {
        label(MARGIN, HPos::Left, &format!("strain {low}"))?;
    } else {
        label(MARGIN, HPos::Left, &low)?;
        label(MARGIN + 0.5 * bar, HPos::Center, "strain")?;
    }
    label(MARGIN + bar, HPos::Right, &high)?;
    let scale_bar = nice_below(80.0 / view.scale[0]);
    let pixels = scale_bar * view.scale[0];
    let end = width - MARGIN;
    let heights = match view.vertical_exaggeration() {
        factor if factor > 1.0 => format!(", heights ×{factor}"),
        _ => String::new(),
    };
    label(
        end,
        HPos::Right,
        &format!("{} m{heights}", round(scale_bar)),
    )?;
    let y = top + 0.5 * cell;
    line(root, &[[end - pixels, y], [end, y]], (2.0, DARK))
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
        assert_eq!(colour(0), RGBColor(0x14, 0x50, 0xaa));
        assert_eq!(colour(COLOURS / 2), RGBColor(0xbe, 0xbe, 0xbe));
        assert_eq!(colour(COLOURS - 1), RGBColor(0xbe, 0x19, 0x28));
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
            broken: Vec::new(),
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
            broken: Vec::new(),
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
                broken: Vec::new(),
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
