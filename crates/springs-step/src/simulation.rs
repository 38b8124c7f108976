//! The time loop: steps, frames, report.

use crate::choose::choose;
use crate::{
    Choice, Interval, Ledger, NodeStates, SetupError, StepError, StepPlan, Stepper, Work,
    interpolate,
};
use springs_assembly::{Energy, compile};
use springs_scene::Scene;
use std::ops::ControlFlow;

/// Positions and velocities at one of the times asked for.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Counted from 0.
    pub index: usize,
    /// In s.
    pub time: f64,
    /// All nodes, in the order of the scene.
    pub nodes: &'a NodeStates,
}

/// Sees the frames and steps of a simulation, and may stop it.
pub trait Observer {
    /// Called for every frame, in order.
    fn frame(&mut self, _frame: Frame<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called after every step, with the simulated time in s.
    fn step(&mut self, _time: f64) -> ControlFlow<()> {
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
    /// The observer stopped it.
    Stopped,
}

/// A scene on its way through its duration.
pub struct Simulation {
    stepper: Stepper,
    choice: Choice,
    plan: StepPlan,
    nodes: NodeStates,
    work: Work,
    ledger: Ledger,
}

impl Simulation {
    /// Compiles the scene and settles method and step.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        let system = compile(scene)?;
        let choice = choose(&system, &scene.settings)?;
        let stepper = Stepper::chosen(system, &choice)?;
        let mut work = Work::default();
        work.counts.symbolic_factorizations = u64::from(choice.tangent.is_some());
        Ok(Self {
            ledger: Ledger::open(stepper.system(), stepper.state()),
            plan: StepPlan::new(scene.settings.duration, choice.step_size),
            nodes: NodeStates::of(scene),
            choice,
            stepper,
            work,
        })
    }

    /// Method, tangent and step size.
    pub fn choice(&self) -> Choice {
        self.choice
    }

    /// How the duration is cut into steps.
    pub fn plan(&self) -> StepPlan {
        self.plan
    }

    /// The compiled scene and its state.
    pub fn stepper(&self) -> &Stepper {
        &self.stepper
    }

    /// Positions and velocities now, in the order of the scene.
    pub fn nodes(&self) -> &NodeStates {
        &self.nodes
    }

    /// What was done so far.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Energy at the start and its flows so far.
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// Energy now.
    pub fn energy(&self) -> Energy {
        let state = self.stepper.state();
        self.stepper.system().energy(&state.x, &state.v)
    }

    /// Runs to the end, or until the observer or an error stops it, and shows
    /// the observer `intervals` + 1 frames at equal distances, time 0 and the
    /// duration included. Frames never change the steps.
    ///
    /// # Errors
    ///
    /// If a step cannot be made. Everything up to it stays available.
    pub fn run(
        &mut self,
        intervals: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        let mut frames = Frames::new(&self.plan, intervals, &self.nodes);
        if frames.show(0.0, &self.nodes, observer).is_break() {
            return Ok(Outcome::Stopped);
        }
        for step in 1..=self.plan.n_steps() {
            let interval = Interval {
                start: self.stepper.time(),
                end: self.plan.end_of(step),
                size: self.plan.size_of(step),
            };
            frames.remember(interval, &self.nodes);
            self.step(interval)?;
            let order = self.stepper.method().order();
            let shown = frames.show_until(interval, order, &self.nodes, observer);
            if shown.is_break() || observer.step(interval.end).is_break() {
                return Ok(match step == self.plan.n_steps() {
                    true => Outcome::Finished,
                    false => Outcome::Stopped,
                });
            }
        }
        Ok(Outcome::Finished)
    }

    fn step(&mut self, interval: Interval) -> Result<(), StepError> {
        let work = self
            .stepper
            .step_until(&mut self.nodes, interval.end, interval.size)?;
        self.work += work;
        self.ledger.record(
            self.stepper.system(),
            self.stepper.state(),
            interval,
            self.stepper.method().quadrature(),
        );
        Ok(())
    }
}

/// The frames still to come.
struct Frames {
    duration: f64,
    intervals: usize,
    next: usize,
    /// State before the present step, if a frame lies inside it.
    before: NodeStates,
    between: NodeStates,
}

/// A frame this close to the end of a step, as a fraction of it, is the end.
const AT_THE_END: f64 = 1e-9;

impl Frames {
    fn new(plan: &StepPlan, intervals: usize, nodes: &NodeStates) -> Self {
        let intervals = if plan.duration == 0.0 { 0 } else { intervals };
        Self {
            duration: plan.duration,
            intervals,
            next: 0,
            before: nodes.clone(),
            between: nodes.clone(),
        }
    }

    /// Time of the next frame; the last one is exactly the duration.
    fn next_time(&self) -> Option<f64> {
        match self.next.cmp(&self.intervals) {
            std::cmp::Ordering::Less => {
                Some(self.duration * self.next as f64 / self.intervals as f64)
            }
            std::cmp::Ordering::Equal => Some(self.duration),
            std::cmp::Ordering::Greater => None,
        }
    }

    fn remember(&mut self, interval: Interval, nodes: &NodeStates) {
        if self.next_time().is_some_and(|time| time < interval.end) {
            self.before.clone_from(nodes);
        }
    }

    /// Shows the next frame.
    fn show(&mut self, time: f64, nodes: &NodeStates, to: &mut dyn Observer) -> ControlFlow<()> {
        let index = self.next;
        self.next += 1;
        to.frame(Frame { index, time, nodes })
    }

    /// Shows all frames up to the end of a step.
    fn show_until(
        &mut self,
        interval: Interval,
        order: u32,
        after: &NodeStates,
        to: &mut dyn Observer,
    ) -> ControlFlow<()> {
        while let Some(time) = self.next_time() {
            let fraction = (time - interval.start) / interval.size;
            if fraction >= 1.0 + AT_THE_END {
                break;
            }
            if fraction >= 1.0 - AT_THE_END {
                self.show(time, after, to)?;
                continue;
            }
            let (h, before) = (interval.size, &self.before);
            interpolate(order, before, after, h, fraction, &mut self.between);
            let between = std::mem::take(&mut self.between);
            let shown = self.show(time, &between, to);
            self.between = between;
            shown?;
        }
        ControlFlow::Continue(())
    }
}
