//! What can go wrong before and during a simulation.

use springs_assembly::CompileError;
use springs_scene::{Method, Path};
use springs_solver::SolveError;
use std::fmt;

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
    /// The method divides by the mass of every node.
    #[error("node {node} has no mass, which {method} cannot move")]
    Massless {
        /// The node.
        node: usize,
        /// The method.
        method: Method,
    },
    /// A tangent was given to a method that has no choice of it.
    #[error("{method} has no choice of tangent")]
    NoTangent {
        /// The method.
        method: Method,
    },
    /// The scene asks to start from an equilibrium, which is to be found first.
    #[error("the scene starts from its equilibrium, which has not been found")]
    NotSettled,
    /// Energies at the start are larger than a number can be.
    #[error("the energy at the start is beyond the range of numbers")]
    EnergyOverflow,
    /// The method is of its order only for forces that do not depend on
    /// velocities.
    #[error("{method} cannot treat dashpots, and spring {spring} has one")]
    VelocityDependent {
        /// The first spring with a dashpot.
        spring: usize,
        /// The method.
        method: Method,
    },
    /// Likewise, of an emitter that is not of the scene.
    #[error("{method} cannot treat damping, and {emitter} have some")]
    Damped {
        /// Its name.
        emitter: String,
        /// The method.
        method: Method,
    },
}

impl SetupError {
    /// The same with the indices of a scene that it is a part of.
    pub(crate) fn of_part(self, nodes: &[usize], springs: &[usize]) -> Self {
        match self {
            Self::Massless { node, method } => Self::Massless {
                node: nodes[node],
                method,
            },
            Self::VelocityDependent { spring, method } => Self::VelocityDependent {
                spring: springs[spring],
                method,
            },
            Self::Scene(CompileError::Law { spring, source }) => Self::Scene(CompileError::Law {
                spring: springs[spring],
                source,
            }),
            other => other,
        }
    }

    /// Where in the scene the cause is, if it is in one place.
    pub fn path(&self) -> Option<Path> {
        match self {
            Self::Scene(CompileError::Problems(problems)) => Some(problems[0].path()),
            Self::Scene(CompileError::Law { spring, .. }) => {
                Some(Path::Spring(*spring, Some("law")))
            }
            Self::Massless { node, .. } => Some(Path::Node(*node, None)),
            Self::NoTangent { .. } => Some(Path::Simulation("tangent")),
            Self::NotSettled => Some(Path::Simulation("start")),
            Self::VelocityDependent { spring, .. } => Some(Path::Spring(*spring, Some("damping"))),
            _ => None,
        }
    }

    /// What to do about it.
    pub fn advice(&self) -> Option<&'static str> {
        match self {
            Self::Massless { .. } => {
                Some("give it a mass, or use an implicit method such as tr-bdf2")
            }
            Self::NotSettled => {
                Some("settle the scene first, and run what `springs_statics::start` gives")
            }
            Self::EnergyOverflow => Some("look at the units of masses, velocities and stiffnesses"),
            Self::VelocityDependent { .. } | Self::Damped { .. } => {
                Some("use dop853 or tr-bdf2, or leave out the damping")
            }
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
    /// There is not enough memory for a factor that turned out to be needed.
    OutOfMemory,
    /// It was [asked to stop](springs_solver::Interrupt).
    Interrupted,
    /// Newton's method did not converge.
    NotConverged {
        /// The free block with the largest correction left.
        block: usize,
    },
}

impl MethodError {
    /// Of a failed solution.
    pub(crate) fn of(error: SolveError) -> Self {
        match error {
            SolveError::NotPositiveDefinite { block } => Self::NotPositiveDefinite { block },
            SolveError::Interrupted => Self::Interrupted,
            _ => Self::OutOfMemory,
        }
    }

    /// The free block it happened at.
    pub(crate) fn block(self) -> usize {
        match self {
            Self::NotPositiveDefinite { block } | Self::NotConverged { block } => block,
            Self::OutOfMemory | Self::Interrupted => 0,
        }
    }
}

/// A step could not be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub struct StepError {
    /// What went wrong.
    pub cause: Cause,
    /// The node where it did.
    pub node: usize,
    /// The step, counted from 1.
    pub step: u64,
    /// Time at the start of the step, in s.
    pub time: f64,
    /// Its size, in s.
    pub step_size: f64,
    /// The spring that pulled or pushed most there before.
    pub suspect: Option<Suspect>,
}

impl fmt::Display for StepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cause,
            node,
            step,
            time,
            step_size,
            suspect,
        } = self;
        if *cause == Cause::NotReached {
            return write!(f, "{cause}");
        }
        write!(
            f,
            "{cause} at node {node} in step {step} of {step_size:?} s at time {time:?} s"
        )?;
        suspect.map_or(Ok(()), |suspect| write!(f, ", where {suspect}"))
    }
}

/// A spring where something went wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspect {
    /// Its index in the scene.
    pub spring: usize,
    /// Its length, in m, when all was well for the last time.
    pub length: f64,
    /// Its stiffness, in N/m.
    pub stiffness: f64,
    /// The step size, in s, that an explicit method needs for its node; not
    /// finite if the node has no mass.
    pub stable_step: f64,
}

impl fmt::Display for Suspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            spring,
            length,
            stiffness,
            stable_step,
        } = self;
        write!(
            f,
            "spring {spring} of {stiffness:?} N/m was {length:.3e} m long"
        )?;
        if *stable_step > 0.0 {
            write!(
                f,
                " and explicit methods need steps below {stable_step:.1e} s"
            )
        } else {
            Ok(())
        }
    }
}

/// What went wrong in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Cause {
    /// The system matrix has a zero or negative pivot.
    #[error("the system matrix is not positive definite")]
    NotPositiveDefinite,
    /// A position or velocity is infinite or not a number.
    #[error("the position or velocity left the range of numbers")]
    NotFinite,
    /// There is not enough memory for a factor that turned out to be needed.
    #[error("there is not enough memory for a factor of the matrix")]
    OutOfMemory,
    /// There is far more energy than there was or came in.
    #[error("the energy diverged")]
    EnergyDiverged,
    /// Energies are larger than a number can be.
    #[error("the energy is beyond the range of numbers")]
    EnergyOverflow,
    /// Newton's method failed.
    #[error("the implicit equations were not solved")]
    NotConverged,
    /// The tolerance asks for steps too small to advance the time.
    #[error("the tolerance cannot be kept: steps shrank to nothing")]
    StepTooSmall,
    /// Trial runs did not come near the tolerance, so that there is no first step.
    #[error("the tolerance is not reached with any number of equal steps that was tried")]
    NotReached,
    /// It was asked to stop; everything is as it was before the step.
    #[error("interrupted")]
    Interrupted,
    /// A method of somebody's own has no error estimate.
    #[error("a tolerance needs a method that estimates its error, which this one does not")]
    NoEstimate,
}

impl From<MethodError> for Cause {
    fn from(error: MethodError) -> Self {
        match error {
            MethodError::NotPositiveDefinite { .. } => Self::NotPositiveDefinite,
            MethodError::NotConverged { .. } => Self::NotConverged,
            MethodError::OutOfMemory => Self::OutOfMemory,
            MethodError::Interrupted => Self::Interrupted,
        }
    }
}

impl StepError {
    /// What to do about it.
    pub fn advice(&self) -> &'static str {
        match self.cause {
            Cause::NotPositiveDefinite => {
                "give the node a mass, or hold it by springs in all directions"
            }
            Cause::NotFinite => {
                "use a smaller step or an implicit method such as tr-bdf2, \
                 and look at masses and stiffnesses around the node"
            }
            Cause::EnergyDiverged => {
                "use a smaller step or an implicit method such as tr-bdf2, or a tolerance"
            }
            Cause::EnergyOverflow => "look at the units of masses, velocities and stiffnesses",
            Cause::OutOfMemory => "use a smaller step, with which iteration converges",
            Cause::NotConverged => "use a smaller step, or a tolerance instead of a step",
            Cause::NoEstimate => "wrap the method in Doubling, or use steps of fixed size",
            Cause::NotReached => "use a larger tolerance, a shorter duration, or tr-bdf2 or dop853",
            Cause::Interrupted => "go on from where it stands",
            Cause::StepTooSmall => {
                "use a larger tolerance, and look at masses and stiffnesses around the node"
            }
        }
    }
}
