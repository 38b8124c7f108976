//! What can be wrong with a scene, all of it at once.

use crate::{
    Guide, LawFault, Load, Node, OverTime, PrescribedMotion, RunOptions, Scene, Spring, SpringLaw,
    StepControl,
};
use nalgebra::Vector3;
use std::fmt;

/// A place in a scene: `nodes[2].mass`, `gravity`, `simulation.step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// A field of the scene itself.
    Scene(&'static str),
    /// A field of the simulation settings.
    Simulation(&'static str),
    /// A field of the damping of all springs and nodes.
    Damping(&'static str),
    /// A field of a node, or the whole node.
    Node(usize, Option<&'static str>),
    /// A field of a spring, or the whole spring.
    Spring(usize, Option<&'static str>),
    /// A field of a load, or the whole load.
    Load(usize, Option<&'static str>),
    /// A field of a motion, or the whole motion.
    Motion(usize, Option<&'static str>),
    /// A law of springs.
    Law(usize),
    /// A field of a material of a scene file, or the whole material.
    Material(usize, Option<&'static str>),
    /// A group of nodes of a scene file.
    Group(usize),
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (list, index, field) = match *self {
            Self::Scene(field) => return f.write_str(field),
            Self::Simulation(field) => return write!(f, "simulation.{field}"),
            Self::Damping(field) => return write!(f, "damping.{field}"),
            Self::Node(index, field) => ("nodes", index, field),
            Self::Spring(index, field) => ("springs", index, field),
            Self::Load(index, field) => ("loads", index, field),
            Self::Motion(index, field) => ("motions", index, field),
            Self::Law(index) => ("laws", index, None),
            Self::Material(index, field) => ("materials", index, field),
            Self::Group(index) => ("groups", index, None),
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
    /// A fixed node moves to where its coordinates cannot be computed with.
    #[error("node {node} is fixed and moves to {value:?} m, which is too large to compute with")]
    MovesTooFar {
        /// The node.
        node: usize,
        /// A coordinate at the end, in m.
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
    /// A node follows a motion that is not there.
    #[error("node {node} follows motion {motion}, but the scene has {motions} of them")]
    NoSuchMotion {
        /// The node.
        node: usize,
        /// The motion it asks for.
        motion: usize,
        /// How many there are.
        motions: usize,
    },
    /// A node follows a motion but is not fixed.
    #[error("node {node} follows a motion, but is not fixed")]
    MovesFreely {
        /// The node.
        node: usize,
    },
    /// The times of a motion are not in order.
    #[error(
        "the times of motion {motion} are not in order: {before:?} s stands before {after:?} s"
    )]
    MotionNotInOrder {
        /// The motion.
        motion: usize,
        /// The first of two times, in s.
        before: f64,
        /// The second, in s.
        after: f64,
    },
    /// A motion has no points.
    #[error("the table of motion {motion} has no points")]
    EmptyMotion {
        /// The motion.
        motion: usize,
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
    /// A spring has a law that is not there.
    #[error("spring {spring} has law {law}, but the scene has {laws} of them")]
    NoSuchLaw {
        /// The spring.
        spring: usize,
        /// The law it asks for.
        law: usize,
        /// How many there are.
        laws: usize,
    },
    /// Something is wrong with a law.
    #[error("{fault}")]
    Law {
        /// The law.
        law: usize,
        /// What is wrong.
        fault: LawFault,
    },
    /// A law in strain needs a length to refer to.
    #[error("spring {spring} has a law in strain, so its rest length must be greater than zero")]
    NoStrain {
        /// The spring.
        spring: usize,
    },
    /// A spring has another stiffness than its law.
    #[error(
        "the stiffness of spring {spring} is {stiffness:?} N/m, but its law gives tensions by \
         itself and has {own:?} N/m at rest"
    )]
    OtherStiffness {
        /// The spring.
        spring: usize,
        /// Its K, in N/m.
        stiffness: f64,
        /// That of its law, in N/m.
        own: f64,
    },
    /// A load acts on a node that is not there.
    #[error("load {load} acts on node {node}, but {}", available(*nodes))]
    NoSuchLoaded {
        /// The load.
        load: usize,
        /// The node it asks for.
        node: usize,
        /// How many nodes there are.
        nodes: usize,
    },
    /// A ramp ends before it begins, or the times of a table are not in order.
    #[error("the times of load {load} are not in order: {before:?} s stands before {after:?} s")]
    NotInOrder {
        /// The load.
        load: usize,
        /// The first of two times, in s.
        before: f64,
        /// The second, in s.
        after: f64,
    },
    /// A table has no points.
    #[error("the table of load {load} has no points")]
    EmptyTable {
        /// The load.
        load: usize,
    },
    /// Both ends of a spring are the same node.
    #[error("spring {spring} joins node {node} to itself")]
    Loop {
        /// The spring.
        spring: usize,
        /// The node.
        node: usize,
    },
    /// A node is fixed and guided at once.
    #[error("node {node} is fixed or held, and slides at the same time")]
    FixedAndGuided {
        /// The node.
        node: usize,
    },
    /// A guide holds nothing or everything, or has no direction.
    #[error("{}", no_guide(*node, guide))]
    NoGuide {
        /// The node.
        node: usize,
        /// What it is.
        guide: Guide,
    },
    /// A guided node starts with a velocity across its guide.
    #[error(
        "the velocity of node {node} must be one that its support lets it have, but it has \
         {across:?} m/s across it"
    )]
    MovesAcross {
        /// The node.
        node: usize,
        /// The part of the velocity across the guide, in m/s.
        across: f64,
    },
    /// A free node without mass and without a spring that could hold it.
    #[error("node {node} is free but has no mass, and no spring holds it")]
    Unheld {
        /// The node.
        node: usize,
    },
    /// A node is so far from the others that distances overflow.
    #[error("node {node} is too far from the others: the size of the scene is not a finite number")]
    TooFar {
        /// The node.
        node: usize,
    },
    /// A free node is so light that 1/m overflows.
    #[error("the mass of node {node} is too small: 1/m is not a finite number for {mass:e} kg")]
    TooLight {
        /// The node.
        node: usize,
        /// Its mass with that of its springs, in kg.
        mass: f64,
    },
    /// The kinetic energy at the start overflows.
    #[error("the velocity of node {node} is too large: its kinetic energy is not a finite number")]
    TooFast {
        /// The node.
        node: usize,
    },
    /// The elastic energy at the start overflows.
    #[error("spring {spring} is too stiff for its length: its energy is not a finite number")]
    TooStrained {
        /// The spring.
        spring: usize,
    },
    /// The step is so short that its square is zero in double precision.
    #[error(
        "the simulation's step must not be shorter than {SHORTEST_STEP:e} s, but is {step:e} s"
    )]
    TooShort {
        /// The step, in s.
        step: f64,
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

/// Of velocities across a guide, which many steps have added up.
const ROUNDING: f64 = 1e-9;

/// Of a stiffness that is said twice.
const SAME_STIFFNESS: f64 = 1e-6;

/// Steps are not shorter than this, in s.
const SHORTEST_STEP: f64 = 1e-150;

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
            Self::NoSuchLoaded { load, .. } => Path::Load(load, Some("nodes")),
            Self::NotInOrder { load, .. } | Self::EmptyTable { load } => {
                Path::Load(load, Some("over_time"))
            }
            Self::MovesTooFar { node, .. } => Path::Node(node, Some("velocity")),
            Self::Unheld { node } => Path::Node(node, None),
            Self::FixedAndGuided { node }
            | Self::NoGuide {
                node,
                guide: Guide::Along(_),
            } => Path::Node(node, Some("slides")),
            Self::NoGuide {
                node,
                guide: Guide::Held(_),
            } => Path::Node(node, Some("fixed")),
            Self::NoSuchMotion { node, .. } | Self::MovesFreely { node } => {
                Path::Node(node, Some("motion"))
            }
            Self::MotionNotInOrder { motion, .. } | Self::EmptyMotion { motion } => {
                Path::Motion(motion, None)
            }
            Self::MovesAcross { node, .. } => Path::Node(node, Some("velocity")),
            Self::TooFar { node } => Path::Node(node, Some("position")),
            Self::TooLight { node, .. } => Path::Node(node, Some("mass")),
            Self::TooFast { node } => Path::Node(node, Some("velocity")),
            Self::TooStrained { spring } | Self::OtherStiffness { spring, .. } => {
                Path::Spring(spring, Some("stiffness"))
            }
            Self::NoSuchLaw { spring, .. } => Path::Spring(spring, Some("law")),
            Self::Law { law, .. } => Path::Law(law),
            Self::NoStrain { spring } => Path::Spring(spring, Some("rest_length")),
            Self::TooShort { .. } => Path::Simulation("step"),
            Self::TooMany { what, .. } => Path::Scene(what),
        }
    }

    /// What to do about it, where that is not plain from the message.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::NoSuchNode { .. } | Self::NoSuchLoaded { .. } => Some("nodes are counted from 0"),
            Self::NoSuchMotion { .. } => Some("motions are counted from 0"),
            Self::NoSuchLaw { .. } => Some("laws are counted from 0"),
            Self::Law { fault, .. } => fault.advice(),
            Self::OtherStiffness { .. } => Some("leave the stiffness out"),
            Self::MovesFreely { .. } => Some("write fixed: true, or leave the motion out"),
            Self::EmptyMotion { .. } => Some("give it a point (time, (x, y, z)), or leave it out"),
            Self::MotionNotInOrder { .. } | Self::NotInOrder { .. } => {
                Some("each time must be later than the one before")
            }
            Self::EmptyTable { .. } => Some("give it a point (time, factor), or leave it out"),
            Self::FixedAndGuided { .. } => Some("leave out one of fixed and slides"),
            Self::NoGuide {
                guide: Guide::Along(_),
                ..
            } => Some("give it the direction along which the node may move"),
            Self::NoGuide {
                guide: Guide::Held(_),
                ..
            } => Some("write one or two of the axes x, y and z, or true for all"),
            Self::Loop { .. } => Some("join it to another node, or remove it"),
            Self::Unheld { .. } => Some(
                "give it a mass, give mass or stiffness to a spring at it, or write fixed: true",
            ),
            _ => None,
        }
    }
}

fn no_guide(node: usize, guide: &Guide) -> String {
    match guide {
        Guide::Held(_) => format!("node {node} must be held along one axis or two"),
        Guide::Along(_) => format!("the direction in which node {node} slides must not be zero"),
    }
}

/// "the stiffness of spring 3 ".
fn subject(path: &Path) -> String {
    match *path {
        Path::Scene(field) => format!("{field} "),
        Path::Simulation(field) => format!("the simulation's {field} "),
        Path::Damping(field) => format!("the {field} part of the damping "),
        Path::Node(index, field) => of("node", index, field),
        Path::Spring(index, field) => of("spring", index, field),
        Path::Load(index, field) => of("load", index, field),
        Path::Motion(index, field) => of("motion", index, field),
        Path::Law(index) => of("law", index, None),
        Path::Material(index, field) => of("material", index, field),
        Path::Group(index) => of("group", index, None),
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

impl RunOptions {
    /// What keeps a scene from being run with them; empty if nothing does.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = Problems(Vec::new());
        if let Some(sleep) = self.sleep {
            problems.positive(Path::Simulation("sleep"), sleep);
        }
        problems.0
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
            if let Some(drag) = node.drag {
                problems.not_negative(path("drag"), drag);
            }
            if let Some(motion) = node.motion {
                problems.follows(index, node, motion, self.motions.len());
            }
            if let Some(guide) = node.guide {
                problems.guide(index, node, guide);
            }
        }
        if problems.0.is_empty() && !self.size().is_finite() {
            // What else is wrong may only come of it.
            problems
                .0
                .extend(self.furthest().map(|node| Problem::TooFar { node }));
            return problems.0;
        }
        let mut held = vec![false; self.nodes.len()];
        for (index, spring) in self.springs.iter().enumerate() {
            let path = |field| Path::Spring(index, Some(field));
            if problems.joins_two_nodes(index, spring.nodes, self.nodes.len()) {
                let holds = spring.is_elastic() || spring.mass > 0.0;
                for node in spring.nodes {
                    held[node] |= holds;
                }
            }
            problems.not_negative(path("stiffness"), spring.stiffness);
            problems.not_negative(path("rest_length"), spring.rest_length);
            problems.not_negative(path("mass"), spring.mass);
            problems.not_negative(path("damping"), spring.damping);
            if let Some(law) = spring.law {
                problems.has_law(index, spring, law, &self.laws);
            }
        }
        for (law, fault) in self.laws.iter().map(SpringLaw::fault).enumerate() {
            let problem = fault.map(|fault| Problem::Law { law, fault });
            problems.0.extend(problem);
        }
        for (index, node) in self.nodes.iter().enumerate() {
            if !node.fixed && node.mass == 0.0 && !held[index] {
                problems.0.push(Problem::Unheld { node: index });
            }
        }
        for (index, motion) in self.motions.iter().enumerate() {
            problems.motion(index, &motion.motion);
        }
        problems.not_negative(Path::Scene("drag"), self.drag);
        problems.not_negative(Path::Damping("mass"), self.damping.mass);
        problems.not_negative(Path::Damping("stiffness"), self.damping.stiffness);
        for (index, load) in self.loads.iter().enumerate() {
            problems.load(index, load, self.nodes.len());
        }
        match self.settings.step {
            StepControl::Auto => {}
            StepControl::Fixed(step) => {
                problems.positive(Path::Simulation("step"), step);
                if step > 0.0 && step < SHORTEST_STEP {
                    problems.0.push(Problem::TooShort { step });
                }
            }
            StepControl::Tolerance(tolerance) => {
                problems.positive(Path::Simulation("tolerance"), tolerance);
            }
        }
        problems.not_negative(Path::Simulation("duration"), self.settings.duration);
        if problems.0.is_empty() {
            problems.0.extend(self.overflow());
        }
        problems.0
    }

    /// The node with the largest coordinate.
    fn furthest(&self) -> Option<usize> {
        let size = |&node: &usize| self.nodes[node].position.amax();
        (0..self.nodes.len()).max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// The first quantity that overflows in a scene whose numbers are finite.
    fn overflow(&self) -> Option<Problem> {
        let mut energy = 0.0;
        for (node, mass) in self.node_masses().into_iter().enumerate() {
            let Node {
                fixed, velocity, ..
            } = self.nodes[node];
            if !fixed && mass > 0.0 && !mass.recip().is_finite() {
                return Some(Problem::TooLight { node, mass });
            }
            energy += 0.5 * mass * velocity.norm_squared();
            if !energy.is_finite() {
                return Some(Problem::TooFast { node });
            }
        }
        for (node, anchor) in self.nodes.iter().enumerate().filter(|(_, node)| node.fixed) {
            let duration = self.settings.duration;
            let moved = self.displacement(node, duration);
            let moved = moved.map_or(Vector3::zeros(), |moved| moved.displacement);
            let end = anchor.position + anchor.velocity * duration + moved;
            let is_far = |value: &&f64| !(**value * **value).is_finite();
            if let Some(&value) = end.iter().find(is_far) {
                return Some(Problem::MovesTooFar { node, value });
            }
        }
        for (index, spring) in self.springs.iter().enumerate() {
            let [a, b] = spring.nodes;
            let change = self.nodes[a].distance(&self.nodes[b]) - spring.rest_length;
            energy += 0.5 * spring.stiffness * change * change;
            if !energy.is_finite() {
                return Some(Problem::TooStrained { spring: index });
            }
        }
        None
    }
}

struct Problems(Vec<Problem>);

impl Problems {
    fn count(&mut self, what: &'static str, count: usize) {
        if u32::try_from(count).is_err() {
            self.0.push(Problem::TooMany { what, count });
        }
    }

    fn guide(&mut self, index: usize, node: &Node, guide: Guide) {
        if node.fixed {
            return self.0.push(Problem::FixedAndGuided { node: index });
        }
        let is_guide = match guide {
            Guide::Held(axes) => axes.contains(&true) && axes.contains(&false),
            Guide::Along(direction) => {
                let path = Path::Node(index, Some("slides"));
                self.all_finite(path, direction.as_slice());
                direction.amax() > 0.0
            }
        };
        if !is_guide {
            return self.0.push(Problem::NoGuide { node: index, guide });
        }
        let across = (node.velocity - guide.free_part(&node.velocity)).norm();
        if across > ROUNDING * node.velocity.norm() {
            self.0.push(Problem::MovesAcross {
                node: index,
                across,
            });
        }
    }

    fn follows(&mut self, index: usize, node: &Node, motion: usize, motions: usize) {
        if motion >= motions {
            self.0.push(Problem::NoSuchMotion {
                node: index,
                motion,
                motions,
            });
        } else if !node.fixed {
            self.0.push(Problem::MovesFreely { node: index });
        }
    }

    fn has_law(&mut self, index: usize, spring: &Spring, law: usize, laws: &[SpringLaw]) {
        let Some(found) = laws.get(law) else {
            return self.0.push(Problem::NoSuchLaw {
                spring: index,
                law,
                laws: laws.len(),
            });
        };
        let Spring {
            stiffness,
            rest_length,
            ..
        } = *spring;
        if !found.needs_rest_length() || found.fault().is_some() {
            return;
        }
        if rest_length == 0.0 {
            return self.0.push(Problem::NoStrain { spring: index });
        }
        let own = found.own_axial_stiffness();
        if let Some(own) = own.map(|own| own / rest_length)
            && (stiffness - own).abs() > SAME_STIFFNESS * own
        {
            self.0.push(Problem::OtherStiffness {
                spring: index,
                stiffness,
                own,
            });
        }
    }

    fn motion(&mut self, index: usize, motion: &PrescribedMotion) {
        let path = Path::Motion(index, None);
        match motion {
            PrescribedMotion::Sine {
                amplitude,
                frequency,
                phase,
            } => {
                self.all_finite(path, amplitude.as_slice());
                self.all_finite(path, &[*frequency, *phase]);
            }
            PrescribedMotion::Table(points) => {
                if points.is_empty() {
                    self.0.push(Problem::EmptyMotion { motion: index });
                }
                for (time, at) in points.iter() {
                    self.all_finite(path, &[*time, at.x, at.y, at.z]);
                }
                let falls = |pair: &&[(f64, _)]| pair[0].0 >= pair[1].0;
                let found = points.windows(2).find(falls);
                self.0.extend(found.map(|pair| Problem::MotionNotInOrder {
                    motion: index,
                    before: pair[0].0,
                    after: pair[1].0,
                }));
            }
        }
    }

    fn load(&mut self, index: usize, load: &Load, n_nodes: usize) {
        let missing = load.nodes.iter().find(|&&node| node >= n_nodes);
        self.0.extend(missing.map(|&node| Problem::NoSuchLoaded {
            load: index,
            node,
            nodes: n_nodes,
        }));
        self.all_finite(Path::Load(index, Some("force")), load.force.as_slice());
        let path = Path::Load(index, Some("over_time"));
        let times: Vec<f64> = match &load.over_time {
            OverTime::Constant => return,
            OverTime::Sine { frequency, phase } => {
                return self.all_finite(path, &[*frequency, *phase]);
            }
            OverTime::Ramp { from, to } => vec![*from, *to],
            OverTime::Table(points) => {
                if points.is_empty() {
                    return self.0.push(Problem::EmptyTable { load: index });
                }
                self.all_finite(path, points.as_flattened());
                points.iter().map(|[time, _]| *time).collect()
            }
        };
        self.all_finite(path, &times);
        let falls = |pair: &&[f64]| pair[0] >= pair[1];
        let found = times.windows(2).find(falls);
        self.0.extend(found.map(|pair| Problem::NotInOrder {
            load: index,
            before: pair[0],
            after: pair[1],
        }));
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
    use crate::Vector3;

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
            law: None,
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

    #[test]
    fn numbers_that_overflow_are_named() {
        let sound = || {
            let mut scene = Scene::default();
            scene.add_node(Node::fixed(Vector3::zeros()));
            scene.add_node(Node {
                mass: 1.0,
                ..Node::at(Vector3::x())
            });
            scene.add_spring(0, 1, 1.0);
            scene
        };
        let of = |change: fn(&mut Scene)| {
            let mut scene = sound();
            change(&mut scene);
            lines(&scene).join("; ")
        };
        assert_eq!(of(|_| {}), "");
        let far = of(|scene| scene.nodes[1].position.x = 1e308);
        assert!(
            far.starts_with("nodes[1].position: node 1 is too far"),
            "{far}"
        );
        let light = of(|scene| scene.nodes[1].mass = 1e-310);
        assert!(
            light.starts_with("nodes[1].mass: the mass of node 1 is too small"),
            "{light}"
        );
        let fast = of(|scene| scene.nodes[1].velocity.z = 1e160);
        assert!(
            fast.starts_with("nodes[1].velocity: the velocity of node 1"),
            "{fast}"
        );
        let moving = of(|scene| {
            scene.nodes[0].velocity.x = 1e153;
            scene.settings.duration = 100.0;
        });
        assert_eq!(
            moving,
            "nodes[0].velocity: node 0 is fixed and moves to 1e155 m, which is too large to compute with"
        );
        let strained = of(|scene| {
            scene.springs[0].stiffness = 1e300;
            scene.springs[0].rest_length = 1e10;
        });
        assert!(
            strained.starts_with("springs[0].stiffness: spring 0 is too stiff"),
            "{strained}"
        );
        let short = of(|scene| scene.settings.step = StepControl::Fixed(1e-170));
        assert!(
            short.starts_with("simulation.step: the simulation's step"),
            "{short}"
        );
    }
}
