//! What can go wrong.

use springs_assembly::CompileError;
use springs_scene::Path;
use springs_solver::SolveError;

/// Why there is no equilibrium, path or mode.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StaticsError {
    /// The scene itself is wrong.
    #[error(transparent)]
    Scene(#[from] CompileError),
    /// There is not enough memory, or it was interrupted.
    #[error(transparent)]
    Solver(#[from] SolveError),
    /// Forces move a node further and further.
    #[error("no equilibrium was found: node {node} is carried off, nothing holds it")]
    CarriedOff {
        /// The node that went furthest.
        node: usize,
    },
    /// Forces were not balanced in the end.
    #[error(
        "no equilibrium was found in {iterations} iterations: \
         {residual:.3e} N are left at node {node}"
    )]
    NotBalanced {
        /// The node with the largest force left.
        node: usize,
        /// That force, in N.
        residual: f64,
        /// Iterations made.
        iterations: usize,
    },
    /// Forces or energies are beyond the range of numbers.
    #[error("forces at node {node} are beyond the range of numbers")]
    NotFinite {
        /// The node.
        node: usize,
    },
    /// A path needs loads.
    #[error("there are no loads that a path could follow")]
    NoLoads,
    /// Loads begin later.
    #[error(
        "all loads are zero at time 0, and statics takes them as they are then: there are none \
         that a path could follow"
    )]
    NoLoadsYet,
    /// A node without mass has no stiffness that would make it follow the others.
    #[error("node {node} has no mass, and nothing holds it in all directions")]
    LooseMasslessNode {
        /// The node.
        node: usize,
    },
    /// Nothing has a mass.
    #[error("there are no modes: no node that can move has a mass")]
    NoMass,
    /// There is not one force density for each spring.
    #[error("there are {found} force densities for {springs} springs")]
    WrongNumberOfDensities {
        /// How many there are.
        found: usize,
        /// How many springs there are.
        springs: usize,
    },
    /// Force densities leave a node free to move.
    #[error("the force densities at node {node} cancel, or nothing holds it: there is no form")]
    NoForm {
        /// The node.
        node: usize,
    },
}

impl StaticsError {
    /// Where in the scene the cause is, if it is in one place.
    pub fn path(&self) -> Option<Path> {
        match self {
            Self::Scene(CompileError::Problems(problems)) => Some(problems[0].path()),
            Self::CarriedOff { node }
            | Self::NotBalanced { node, .. }
            | Self::NotFinite { node }
            | Self::LooseMasslessNode { node }
            | Self::NoForm { node } => Some(Path::Node(*node, None)),
            _ => None,
        }
    }

    /// Whether no equilibrium was found, as opposed to something wrong with the scene.
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::CarriedOff { .. } | Self::NotBalanced { .. })
    }

    /// What to do about it.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::Scene(CompileError::Problems(problems)) => problems[0].advice(),
            Self::CarriedOff { .. } => Some("fix a node, or join it by a spring to what is held"),
            Self::NotBalanced { .. } => {
                Some("start closer to the equilibrium, or simulate the scene with damping first")
            }
            Self::NotFinite { .. } => Some("look at the units of positions and stiffnesses"),
            Self::NoLoads => Some("add `loads`; the path multiplies them by its load factor"),
            Self::NoLoadsYet => Some("leave their `over_time` out, or shift its times"),
            Self::LooseMasslessNode { .. } | Self::NoMass => Some("give it a mass"),
            _ => None,
        }
    }
}
