//! Something that is wrong with a scene, in words.

use crate::path::subject;
use crate::{BreakLimit, Guide, LawFault, Path, ProbeQuantity, printable};

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
        "the times of motion `{}` are not in order: {before:?} s stands before {after:?} s",
        printable(name)
    )]
    MotionNotInOrder {
        /// The motion.
        motion: usize,
        /// Its name.
        name: String,
        /// The first of two times, in s.
        before: f64,
        /// The second, in s.
        after: f64,
    },
    /// A motion has no points.
    #[error("the table of motion `{}` has no points", printable(name))]
    EmptyMotion {
        /// The motion.
        motion: usize,
        /// Its name.
        name: String,
    },
    /// A spring refers to a node that is not there.
    #[error("spring {spring} joins node {node}, but {}", available(*nodes, "node"))]
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
    /// A spring is stiffer while it yields than before.
    #[error(
        "the hardening of the law of spring {spring}, {hardening:?} N/m, must be below its \
         stiffness, which is {stiffness:?} N/m"
    )]
    HardensTooMuch {
        /// The spring.
        spring: usize,
        /// That of its law, in N/m.
        hardening: f64,
        /// Its K, in N/m.
        stiffness: f64,
    },
    /// A spring has yielded that cannot.
    #[error("spring {spring} has yielded by {elongation:?} m, but its law does not yield")]
    CannotYield {
        /// The spring.
        spring: usize,
        /// By how much, in m.
        elongation: f64,
    },
    /// A spring cannot break where it should.
    #[error(
        "the {} at which spring {spring} breaks must be finite and not negative, but is {}",
        limit.name(), limit.value()
    )]
    BreakLimit {
        /// The spring.
        spring: usize,
        /// Where it should break.
        limit: BreakLimit,
    },
    /// A strain needs a length to refer to.
    #[error("spring {spring} breaks at a strain, so its rest length must be greater than zero")]
    NoBreakingStrain {
        /// The spring.
        spring: usize,
    },
    /// A load acts on a node that is not there.
    #[error("load {load} acts on node {node}, but {}", available(*nodes, "node"))]
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
    /// A probe looks at a node or a spring that is not there.
    #[error("probe {probe} looks at {item} {index}, but {}", available(*count, item))]
    NoSuchProbed {
        /// The probe.
        probe: usize,
        /// `node` or `spring`.
        item: &'static str,
        /// The one it asks for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A probe asks of a node what springs have, or the other way round.
    #[error("probe {probe} asks for the {} of a {item}, which has none", quantity.name())]
    NoSuchQuantity {
        /// The probe.
        probe: usize,
        /// `node` or `spring`.
        item: &'static str,
        /// What it asks for.
        quantity: ProbeQuantity,
    },
    /// A probe asks for nothing.
    #[error("probe {probe} asks for nothing")]
    TellsNothing {
        /// The probe.
        probe: usize,
    },
    /// A strain needs a length to refer to.
    #[error("probe {probe} asks for the strain of spring {spring}, whose rest length is zero")]
    NoProbedStrain {
        /// The probe.
        probe: usize,
        /// The spring.
        spring: usize,
    },
    /// A probe looks more often than anybody can count.
    #[error(
        "probe {probe} looks every {every:e} s, more than {} times in a run",
        u32::MAX
    )]
    LooksTooOften {
        /// The probe.
        probe: usize,
        /// In s.
        every: f64,
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

/// Steps are not shorter than this, in s.
pub(crate) const SHORTEST_STEP: f64 = 1e-150;

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
            Self::MotionNotInOrder { motion, .. } | Self::EmptyMotion { motion, .. } => {
                Path::Motion(motion, None)
            }
            Self::MovesAcross { node, .. } => Path::Node(node, Some("velocity")),
            Self::TooFar { node } => Path::Node(node, Some("position")),
            Self::TooLight { node, .. } => Path::Node(node, Some("mass")),
            Self::TooFast { node } => Path::Node(node, Some("velocity")),
            Self::TooStrained { spring } | Self::OtherStiffness { spring, .. } => {
                Path::Spring(spring, Some("stiffness"))
            }
            Self::NoSuchLaw { spring, .. } | Self::HardensTooMuch { spring, .. } => {
                Path::Spring(spring, Some("law"))
            }
            Self::Law { law, .. } => Path::Law(law),
            Self::NoStrain { spring } => Path::Spring(spring, Some("rest_length")),
            Self::CannotYield { spring, .. } => Path::Spring(spring, Some("yielded")),
            Self::BreakLimit { spring, .. } | Self::NoBreakingStrain { spring } => {
                Path::Spring(spring, Some("breaks_at"))
            }
            Self::NoSuchProbed { probe, .. } => Path::Probe(probe, None),
            Self::NoSuchQuantity { probe, .. }
            | Self::TellsNothing { probe }
            | Self::NoProbedStrain { probe, .. } => Path::Probe(probe, Some("of")),
            Self::LooksTooOften { probe, .. } => Path::Probe(probe, Some("every")),
            Self::TooShort { .. } => Path::Simulation("step"),
            Self::TooMany { what, .. } => Path::Scene(what),
        }
    }

    /// What to do about it, where that is not plain from the message.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::NoSuchNode { .. } | Self::NoSuchLoaded { .. } => Some("nodes are counted from 0"),
            Self::NoSuchProbed { .. } => Some("nodes and springs are counted from 0"),
            Self::NoSuchQuantity { item: "node", .. } => {
                Some("of a node there are Position, Velocity and Energy")
            }
            Self::NoSuchQuantity { .. } => {
                Some("of a spring there are Length, Strain, Tension and Energy")
            }
            Self::TellsNothing { .. } => Some("write what it is to tell, such as of: [Energy]"),
            Self::NoSuchMotion { .. } => Some("motions are counted from 0"),
            Self::NoSuchLaw { .. } => Some("laws are counted from 0"),
            Self::Law { fault, .. } => fault.advice(),
            Self::HardensTooMuch { .. } => Some("it is the stiffness while the spring yields"),
            Self::CannotYield { .. } => Some("give it the law Plastic, or leave yielded out"),
            Self::NoBreakingStrain { .. } => Some("give it a rest_length, or break it at a Force"),
            Self::OtherStiffness { .. } => Some("leave the stiffness out"),
            Self::MovesFreely { .. } => Some("write fixed: true, or leave the motion out"),
            Self::EmptyMotion { .. } => Some("give it a point (time, (x, y, z)), or leave it out"),
            Self::MotionNotInOrder { .. } => Some("each time must be later than the one before"),
            Self::NotInOrder { .. } => Some(
                "each time must be later than the one before; a load that jumps rises within a \
                 short time",
            ),
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

fn available(count: usize, item: &str) -> String {
    match count {
        0 => format!("the scene has no {item}s"),
        1 => format!("the scene has only {item} 0"),
        _ => format!("the scene has only {item}s 0 to {}", count - 1),
    }
}
