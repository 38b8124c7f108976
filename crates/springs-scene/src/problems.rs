//! What can be wrong with a scene, all of it at once.

use crate::{Scene, StepControl};
use std::fmt;

/// A place in a scene: `nodes[2].mass`, `gravity`, `simulation.step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// A field of the scene itself.
    Scene(&'static str),
    /// A field of the simulation settings.
    Simulation(&'static str),
    /// A field of a node, or the whole node.
    Node(usize, Option<&'static str>),
    /// A field of a spring, or the whole spring.
    Spring(usize, Option<&'static str>),
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (list, index, field) = match *self {
            Self::Scene(field) => return f.write_str(field),
            Self::Simulation(field) => return write!(f, "simulation.{field}"),
            Self::Node(index, field) => ("nodes", index, field),
            Self::Spring(index, field) => ("springs", index, field),
        };
        write!(f, "{list}[{index}]")?;
        field.map_or(Ok(()), |field| write!(f, ".{field}"))
    }
}

/// Something that keeps a scene from being simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// A number is infinite or not a number.
    #[error("{}must be a finite number, but is {value}", subject(path))]
    NotFinite {
        /// Where.
        path: Path,
        /// The number.
        value: f64,
    },
    /// A number must not be negative.
    #[error("{}must not be negative, but is {value}", subject(path))]
    Negative {
        /// Where.
        path: Path,
        /// The number.
        value: f64,
    },
    /// A number must be greater than zero.
    #[error("{}must be greater than zero, but is {value}", subject(path))]
    NotPositive {
        /// Where.
        path: Path,
        /// The number.
        value: f64,
    },
    /// A spring refers to a node that is not there.
    #[error("spring {spring} joins node {node}, but {}", available(*nodes))]
    NoSuchNode {
        /// The spring.
        spring: usize,
        /// The node it asks for.
        node: usize,
        /// How many nodes there are.
        nodes: usize,
    },
    /// Both ends of a spring are the same node.
    #[error("spring {spring} joins node {node} to itself")]
    Loop {
        /// The spring.
        spring: usize,
        /// The node.
        node: usize,
    },
    /// A free node without mass and without a spring that could hold it.
    #[error("node {node} is free but has no mass, and no spring holds it")]
    Unheld {
        /// The node.
        node: usize,
    },
    /// The scene has more nodes or springs than can be numbered.
    #[error("the scene has {count} {what}, more than the {} possible", u32::MAX)]
    TooMany {
        /// `nodes` or `springs`.
        what: &'static str,
        /// How many there are.
        count: usize,
    },
}

impl Problem {
    /// Where it is.
    pub fn path(&self) -> Path {
        match *self {
            Self::NotFinite { path, .. }
            | Self::Negative { path, .. }
            | Self::NotPositive { path, .. } => path,
            Self::NoSuchNode { spring, .. } | Self::Loop { spring, .. } => {
                Path::Spring(spring, Some("nodes"))
            }
            Self::Unheld { node } => Path::Node(node, None),
            Self::TooMany { what, .. } => Path::Scene(what),
        }
    }

    /// What to do about it, where that is not plain from the message.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::NoSuchNode { .. } => Some("nodes are counted from 0"),
            Self::Loop { .. } => Some("join it to another node, or remove it"),
            Self::Unheld { .. } => Some(
                "give it a mass, give mass or stiffness to a spring at it, or write fixed: true",
            ),
            _ => None,
        }
    }
}

/// "the stiffness of spring 3 ".
fn subject(path: &Path) -> String {
    match *path {
        Path::Scene(field) => format!("{field} "),
        Path::Simulation(field) => format!("the simulation's {field} "),
        Path::Node(index, field) => of("node", index, field),
        Path::Spring(index, field) => of("spring", index, field),
    }
}

fn of(what: &str, index: usize, field: Option<&str>) -> String {
    match field {
        Some(field) => format!("the {} of {what} {index} ", field.replace('_', " ")),
        None => format!("{what} {index} "),
    }
}

fn available(nodes: usize) -> String {
    match nodes {
        0 => "the scene has no nodes".to_owned(),
        1 => "the scene has only node 0".to_owned(),
        _ => format!("the scene has only nodes 0 to {}", nodes - 1),
    }
}

impl Scene {
    /// Everything that keeps the scene from being simulated, in the order of
    /// the scene; empty if nothing does.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = Problems(Vec::new());
        problems.count("nodes", self.nodes.len());
        problems.count("springs", self.springs.len());
        for &component in &self.gravity {
            problems.finite(Path::Scene("gravity"), component);
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let path = |field| Path::Node(index, Some(field));
            problems.all_finite(path("position"), node.position.as_slice());
            problems.all_finite(path("velocity"), node.velocity.as_slice());
            problems.not_negative(path("mass"), node.mass);
        }
        let mut held = vec![false; self.nodes.len()];
        for (index, spring) in self.springs.iter().enumerate() {
            let path = |field| Path::Spring(index, Some(field));
            if problems.joins_two_nodes(index, spring.nodes, self.nodes.len()) {
                let holds = spring.stiffness > 0.0 || spring.mass > 0.0;
                for node in spring.nodes {
                    held[node] |= holds;
                }
            }
            problems.not_negative(path("stiffness"), spring.stiffness);
            problems.not_negative(path("rest_length"), spring.rest_length);
            problems.not_negative(path("mass"), spring.mass);
            problems.not_negative(path("damping"), spring.damping);
        }
        for (index, node) in self.nodes.iter().enumerate() {
            if !node.fixed && node.mass == 0.0 && !held[index] {
                problems.0.push(Problem::Unheld { node: index });
            }
        }
        match self.settings.step {
            StepControl::Auto => {}
            StepControl::Fixed(step) => problems.positive(Path::Simulation("step"), step),
            StepControl::Tolerance(tolerance) => {
                problems.positive(Path::Simulation("tolerance"), tolerance);
            }
        }
        if let Some(sleep) = self.settings.sleep {
            problems.positive(Path::Simulation("sleep"), sleep);
        }
        problems.not_negative(Path::Simulation("duration"), self.settings.duration);
        problems.0
    }
}

struct Problems(Vec<Problem>);

impl Problems {
    fn count(&mut self, what: &'static str, count: usize) {
        if u32::try_from(count).is_err() {
            self.0.push(Problem::TooMany { what, count });
        }
    }

    /// Whether it is.
    fn finite(&mut self, path: Path, value: f64) -> bool {
        if !value.is_finite() {
            self.0.push(Problem::NotFinite { path, value });
        }
        value.is_finite()
    }

    fn all_finite(&mut self, path: Path, values: &[f64]) {
        for &value in values {
            if !self.finite(path, value) {
                return;
            }
        }
    }

    fn not_negative(&mut self, path: Path, value: f64) {
        if self.finite(path, value) && value < 0.0 {
            self.0.push(Problem::Negative { path, value });
        }
    }

    fn positive(&mut self, path: Path, value: f64) {
        if self.finite(path, value) && value <= 0.0 {
            self.0.push(Problem::NotPositive { path, value });
        }
    }

    /// Whether the two nodes exist and differ.
    fn joins_two_nodes(&mut self, spring: usize, ends: [usize; 2], nodes: usize) -> bool {
        if let Some(&node) = ends.iter().find(|&&node| node >= nodes) {
            self.0.push(Problem::NoSuchNode {
                spring,
                node,
                nodes,
            });
            return false;
        }
        if ends[0] == ends[1] {
            let node = ends[0];
            self.0.push(Problem::Loop { spring, node });
            return false;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Node, Spring, Vector3};

    fn lines(scene: &Scene) -> Vec<String> {
        let line = |problem: &Problem| format!("{}: {problem}", problem.path());
        scene.problems().iter().map(line).collect()
    }

    #[test]
    fn a_sound_scene_has_none() {
        assert!(Scene::default().problems().is_empty());
    }

    #[test]
    fn all_are_listed_in_order() {
        let mut scene = Scene {
            gravity: Vector3::new(0.0, f64::INFINITY, 0.0),
            ..Scene::default()
        };
        scene.add_node(Node::fixed(Vector3::zeros()));
        scene.add_node(Node {
            mass: -1.0,
            velocity: Vector3::new(f64::NAN, 0.0, 0.0),
            ..Node::at(Vector3::x())
        });
        scene.add_node(Node::at(Vector3::y()));
        let spring = Spring {
            nodes: [0, 7],
            stiffness: -2.0,
            rest_length: -0.5,
            mass: 0.0,
            damping: f64::NAN,
        };
        scene.springs.push(spring);
        scene.springs.push(Spring {
            nodes: [1, 1],
            ..spring
        });
        scene.settings.step = StepControl::Fixed(0.0);
        scene.settings.duration = -1.0;
        let expected = [
            "gravity: gravity must be a finite number, but is inf",
            "nodes[1].velocity: the velocity of node 1 must be a finite number, but is NaN",
            "nodes[1].mass: the mass of node 1 must not be negative, but is -1",
            "springs[0].nodes: spring 0 joins node 7, but the scene has only nodes 0 to 2",
            "springs[0].stiffness: the stiffness of spring 0 must not be negative, but is -2",
            "springs[0].rest_length: the rest length of spring 0 must not be negative, but is -0.5",
            "springs[0].damping: the damping of spring 0 must be a finite number, but is NaN",
            "springs[1].nodes: spring 1 joins node 1 to itself",
            "springs[1].stiffness: the stiffness of spring 1 must not be negative, but is -2",
            "springs[1].rest_length: the rest length of spring 1 must not be negative, but is -0.5",
            "springs[1].damping: the damping of spring 1 must be a finite number, but is NaN",
            "nodes[2]: node 2 is free but has no mass, and no spring holds it",
            "simulation.step: the simulation's step must be greater than zero, but is 0",
            "simulation.duration: the simulation's duration must not be negative, but is -1",
        ];
        assert_eq!(lines(&scene), expected);
    }
}
