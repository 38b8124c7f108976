//! Who looks on while a simulation runs.

use crate::{Ledger, Members, NodeStates, Sample, StepRecord};
use springs_assembly::Energy;
use std::ops::ControlFlow;

/// Positions and velocities at one of the times asked for.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Frame<'a> {
    /// Counted from 0.
    pub index: usize,
    /// In s.
    pub time: f64,
    /// All nodes, in the order of the scene.
    pub nodes: &'a NodeStates,
    /// What springs and supports carry, if that is [wanted](Observer::wants_members).
    pub members: Option<&'a Members>,
}

/// What [probes](springs_scene::Probe) tell at one time.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Samples<'a> {
    /// In s.
    pub time: f64,
    /// Of each probe that looks then, in the order of the scene.
    pub samples: &'a [Sample],
}

/// Energies at the end of a step or at the time of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Account {
    /// In s.
    pub time: f64,
    /// Energy then.
    pub energy: Energy,
    /// Energy at the start, and where it went since.
    pub ledger: Ledger,
}

/// How far a simulation may go before its observer wants to hear of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// Steps of any part of the scene, counted from the start of the run.
    pub steps: u64,
    /// Simulated time of any part, in s.
    pub time: f64,
}

impl Patience {
    /// It never wants to.
    pub const NEVER: Self = Self {
        steps: u64::MAX,
        time: f64::INFINITY,
    };

    /// Whether so much simulated time, in s, or so many steps are enough.
    pub fn is_used_up(&self, time: f64, steps: u64) -> bool {
        steps >= self.steps || time >= self.time
    }
}

/// Sees the frames and steps of a simulation, and may stop it.
///
/// What was called when it stopped is done; when the simulation goes on, the next
/// call is the one that would have followed.
pub trait Observer {
    /// Called during trial runs, before the first frame, with the steps that they
    /// have made so far.
    fn trial(&mut self, _steps: u64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called for every frame, in order.
    fn frame(&mut self, _frame: Frame<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Whether frames are to have what springs and supports carry, asked when a run
    /// begins or goes on. Tensions and their peaks are kept from then on.
    fn wants_members(&self) -> bool {
        false
    }

    /// Whether the probes of the scene are to look, asked when a run begins or goes on.
    fn wants_samples(&self) -> bool {
        false
    }

    /// Called with what probes tell, if that is wanted, in the order of time, and after the
    /// frame of the same time.
    fn samples(&mut self, _samples: Samples<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called after every step, with the simulated time in s and the steps made
    /// since the start.
    ///
    /// Where a scene is simulated in several parts, it is called several times a
    /// second, or when its [patience](Self::patience) is used up, with the time
    /// that all parts have reached and the steps of the part that made the most.
    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called before [`Self::step`] with what is known of the step, or of several parts
    /// when they have all come to one time: the same calls in every run of a scene.
    fn record(&mut self, _record: &StepRecord) {}

    /// When [`Self::step`] is to be called at the latest.
    fn patience(&self) -> Patience {
        Patience::NEVER
    }

    /// Whether to be called with an account, asked after every frame, for its
    /// time, and after every step.
    fn wants_account(&self) -> bool {
        false
    }

    /// Called with energies, if they are wanted, after [`Self::frame`] and the samples of
    /// its time, or before [`Self::step`].
    fn account(&mut self, _account: Account) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// An observer that sees nothing.
impl Observer for () {}

/// How a simulation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The whole duration is simulated.
    Finished,
    /// The observer or an [interrupt](springs_solver::Interrupt) stopped it.
    Stopped,
}

/// Gives an account to an observer who wants one; else it is not made.
pub(crate) fn offer(
    observer: &mut dyn Observer,
    account: impl FnOnce() -> Account,
) -> ControlFlow<()> {
    if observer.wants_account() {
        observer.account(account())
    } else {
        ControlFlow::Continue(())
    }
}

/// Stops if one of two calls, both of which were made, wants to.
pub(crate) fn either(a: ControlFlow<()>, b: ControlFlow<()>) -> ControlFlow<()> {
    if a.is_break() { a } else { b }
}
