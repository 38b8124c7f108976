//! What can go wrong before and during a simulation.

use springs_assembly::CompileError;
use springs_scene::{Method, Path};
use springs_solver::SolveError;

/// Why a simulation cannot start.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SetupError {
    /// The scene itself is wrong.
    #[error(transparent)]
    Scene(#[from] CompileError),
    /// The matrix cannot be analyzed.
    #[error(transparent)]
    Solver(#[from] SolveError),
    /// An explicit method divides by the mass of every node.
    #[error("node {node} has no mass, which {method} cannot move")]
    Massless {
        /// The node.
        node: usize,
        /// The method.
        method: Method,
    },
    /// A tolerance was asked for.
    #[error("no method of this version chooses its steps from a tolerance")]
    NoErrorControl,
}

impl SetupError {
    /// Where in the scene the cause is, if it is in one place.
    pub fn path(&self) -> Option<Path> {
        match self {
            Self::Scene(CompileError::Problems(problems)) => Some(problems[0].path()),
            Self::Massless { node, .. } => Some(Path::Node(*node, None)),
            Self::NoErrorControl => Some(Path::Simulation("tolerance")),
            _ => None,
        }
    }

    /// What to do about it.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::Massless { .. } => {
                Some("give it a mass, or use the method linearly-implicit-euler")
            }
            Self::NoErrorControl => Some("give a step in seconds instead of the tolerance"),
            Self::Scene(CompileError::Problems(problems)) => problems[0].advice(),
            _ => None,
        }
    }
}

/// Why a method could not make its step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MethodError {
    /// The system matrix is not positive definite at a free block.
    NotPositiveDefinite {
        /// The block.
        block: usize,
    },
}

/// Why a step failed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// The system matrix is not positive definite.
    #[error(
        "the system matrix is not positive definite at node {node} \
         in step {step} of {step_size} s at time {time} s"
    )]
    NotPositiveDefinite {
        /// The node of the first bad pivot.
        node: usize,
        /// The step, counted from 1.
        step: u64,
        /// Time at the start of the step, in s.
        time: f64,
        /// Its size, in s.
        step_size: f64,
    },
    /// A position or velocity is infinite or not a number.
    #[error(
        "the position or velocity of node {node} stopped being a finite number \
         in step {step} of {step_size} s at time {time} s"
    )]
    NotFinite {
        /// The first such node.
        node: usize,
        /// The step, counted from 1.
        step: u64,
        /// Time at the start of the step, in s.
        time: f64,
        /// Its size, in s.
        step_size: f64,
    },
}

impl StepError {
    /// The node it happened at.
    pub fn node(&self) -> usize {
        match *self {
            Self::NotPositiveDefinite { node, .. } | Self::NotFinite { node, .. } => node,
        }
    }

    /// Time at the start of the step in s, the step counted from 1, and its
    /// size in s.
    pub fn when(&self) -> (f64, u64, f64) {
        match *self {
            Self::NotPositiveDefinite {
                time,
                step,
                step_size,
                ..
            }
            | Self::NotFinite {
                time,
                step,
                step_size,
                ..
            } => (time, step, step_size),
        }
    }

    /// What to do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::NotPositiveDefinite { .. } => {
                "give the node mass or a stretched spring, or use the tangent absolute"
            }
            Self::NotFinite { .. } => {
                "use a smaller step or the method linearly-implicit-euler, \
                 and look at masses and stiffnesses around the node"
            }
        }
    }
}
