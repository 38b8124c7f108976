//! Supports, masses, loads and broken springs.

use super::Panel;
use super::drawing::{DARK, GREY, MARGIN, Place, box_of, line, round, write};
use crate::drawing::{Area, Drawn, FINE, at};
use nalgebra::Vector3;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use springs_scene::Scene;
use std::collections::BTreeMap;

const LOAD: RGBColor = RGBColor(0, 140, 100);
const BROKEN: RGBColor = RGBColor(150, 60, 180);
/// Width and height of a support, and diameter of a mass, in pixels.
const SUPPORT: f64 = 6.0;
const MASS: f64 = 7.0;
/// Length of the arrow of the largest force, and of its head, in pixels.
const ARROW: f64 = 34.0;
const HEAD: f64 = 5.0;
/// More arrows in a panel hide what they act on.
const MOST_ARROWS: usize = 200;
/// What is left of a broken spring at each end, as a part of its length.
const STUB: f64 = 0.3;

/// What is marked, over all panels.
pub(super) struct Marks {
    has_fixed: bool,
    has_guided: bool,
    has_broken: bool,
    /// Largest sum of the loads on a node in a panel, in N.
    largest_load: f64,
}

impl Marks {
    pub(super) fn of(scene: &Scene, panels: &[Panel]) -> Self {
        let forces = panels.iter().flat_map(|panel| loads(scene, panel.time));
        let sizes = forces.map(|(_, force)| force.norm());
        Self {
            has_fixed: scene.nodes.iter().any(|node| node.fixed),
            has_guided: scene.nodes.iter().any(|node| node.guide.is_some()),
            has_broken: panels.iter().any(|panel| !panel.broken.is_empty()),
            largest_load: sizes.fold(0.0, f64::max),
        }
    }
}

/// The sum of the loads on each loaded free node at a time in s, in N.
fn loads(scene: &Scene, time: f64) -> BTreeMap<usize, Vector3<f64>> {
    let mut sums = BTreeMap::new();
    for load in &scene.loads {
        let force = load.force * load.over_time.factor(time);
        for &node in load.nodes.iter().filter(|&&node| !scene.nodes[node].fixed) {
            *sums.entry(node).or_insert_with(Vector3::zeros) += force;
        }
    }
    sums
}

/// Draws them over the springs of a panel.
pub(super) fn draw_marks(root: &Area<'_>, place: &Place<'_>, marks: &Marks) -> Drawn {
    let Place { scene, panel, .. } = *place;
    for &index in &panel.broken {
        let spring = &scene.springs[index];
        let [a, b] = spring.nodes.map(|node| panel.positions[node]);
        // Ends that have flown apart are joined by nothing.
        let stub = (0.5 * spring.rest_length / (b - a).norm()).min(STUB);
        for (end, other) in [(a, b), (b, a)] {
            let tip = end + (other - end) * stub;
            let ends = [end, tip].map(|point| place.project(&point));
            line(root, &ends, (1.5, BROKEN))?;
        }
    }
    for (node, position) in scene.nodes.iter().zip(&panel.positions) {
        let middle = place.project(position);
        if node.fixed || node.guide.is_some() {
            draw_support(root, middle, node.fixed)?;
        } else if node.mass > 0.0 {
            let radius = (0.5 * MASS * f64::from(FINE)) as u32;
            root.draw(&Circle::new(
                at(middle[0], middle[1]),
                radius,
                DARK.filled(),
            ))?;
        }
    }
    let forces = loads(scene, panel.time);
    let stride = forces.len().div_ceil(MOST_ARROWS).max(1);
    for (node, force) in forces.into_iter().step_by(stride) {
        let start = place.project(&panel.positions[node]);
        let along = force * (ARROW / marks.largest_load);
        let (right, up) = (place.view.right.dot(&along), place.view.up.dot(&along));
        draw_arrow(root, start, [right, -up])?;
    }
    Ok(())
}

fn draw_support(root: &Area<'_>, [x, y]: [f64; 2], is_fixed: bool) -> Drawn {
    let corners = box_of([x - 0.5 * SUPPORT, y - 0.5 * SUPPORT], [SUPPORT, SUPPORT]);
    if is_fixed {
        root.draw(&Rectangle::new(corners, DARK.filled()))
    } else {
        root.draw(&Rectangle::new(corners, WHITE.filled()))?;
        root.draw(&Rectangle::new(corners, DARK.stroke_width(FINE)))
    }
}

/// An arrow from a point, both in pixels; none where it would be too short to see.
fn draw_arrow(root: &Area<'_>, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> Drawn {
    let length = dx.hypot(dy);
    if length <= 1.0 || length.is_nan() {
        return Ok(());
    }
    let tip = [x + dx, y + dy];
    line(root, &[[x, y], tip], (1.5, LOAD))?;
    let (u, v) = (dx / length, dy / length);
    let head = HEAD.min(0.6 * length);
    let wing = |side: f64| {
        [
            tip[0] - head * (u + side * 0.5 * v),
            tip[1] - head * (v - side * 0.5 * u),
        ]
    };
    line(root, &[wing(1.0), tip, wing(-1.0)], (1.5, LOAD))
}

/// What the marks mean, in a row above `base`, in pixels.
pub(super) fn draw_marks_legend(root: &Area<'_>, marks: &Marks, base: f64) -> Drawn {
    let middle = base - 4.0;
    let mut x = MARGIN;
    let mut tell = |text: &str, symbol: &dyn Fn(f64) -> Drawn| {
        symbol(x)?;
        write(root, text, [x + 22.0, base], (12.0, GREY), HPos::Left)?;
        x += 40.0 + 6.5 * text.chars().count() as f64;
        Ok(())
    };
    if marks.has_fixed {
        tell("fixed", &|x| draw_support(root, [x + 8.0, middle], true))?;
    }
    if marks.has_guided {
        let text = "held in part";
        tell(text, &|x| draw_support(root, [x + 8.0, middle], false))?;
    }
    if marks.largest_load > 0.0 {
        let text = format!("load, {} N at most", round(marks.largest_load));
        tell(&text, &|x| draw_arrow(root, [x, middle], [16.0, 0.0]))?;
    }
    if marks.has_broken {
        tell("broken", &|x| {
            line(root, &[[x, middle], [x + 5.0, middle]], (1.5, BROKEN))?;
            line(
                root,
                &[[x + 11.0, middle], [x + 16.0, middle]],
                (1.5, BROKEN),
            )
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filmstrip::filmstrip;
    use springs_scene::{Guide, Load, Node, OverTime};

    #[test]
    fn marks_are_drawn_and_explained_where_they_occur() {
        let mut scene = Scene::default();
        scene.add_node(Node::fixed(Vector3::zeros()));
        scene.add_node(Node::at(Vector3::x()));
        scene.add_node(Node {
            guide: Some(Guide::Held([true, false, false])),
            ..Node::at(Vector3::new(2.0, 0.0, 1.0))
        });
        scene.add_spring(0, 1, 1.0);
        scene.add_spring(1, 2, 1.0);
        let panel = |time: f64, broken: &[usize]| Panel {
            time,
            positions: scene.nodes.iter().map(|node| node.position).collect(),
            broken: broken.to_vec(),
        };
        let panels = [panel(0.0, &[]), panel(1.0, &[1])];
        let plain = filmstrip(&scene, &panels[..1]);
        assert!(plain.contains(">fixed<") && plain.contains(">held in part<"));
        assert!(!plain.contains("load") && !plain.contains("broken"));
        scene.loads.push(Load {
            name: String::new(),
            nodes: vec![0, 1],
            force: Vector3::new(0.0, 0.0, -3.0),
            over_time: OverTime::Ramp { from: 0.0, to: 2.0 },
        });
        let picture = filmstrip(&scene, &panels);
        assert!(picture.contains("load, 1.5 N at most") && picture.contains(">broken<"));
        // Two stubs in the second panel, and two in the legend.
        let colour = "stroke=\"#963cb4\"";
        let paths = picture.lines().filter(|line| line.contains(colour));
        let moves: usize = paths.map(|path| path.matches('M').count()).sum();
        assert_eq!(moves, 4, "{picture}");
    }
}
