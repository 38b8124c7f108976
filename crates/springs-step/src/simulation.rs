//! The time loop: steps, frames, report.

use crate::choose::choose;
use crate::controller::{Controller, Verdict};
use crate::interpolate::Between;
use crate::{
    Cause, Choice, Interval, Ledger, NodeStates, Pace, SetupError, State, StepError, StepPlan,
    Stepper, Work,
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
    duration: f64,
    schedule: Schedule,
    between: Between,
    nodes: NodeStates,
    work: Work,
    ledger: Ledger,
}

/// Where the next step comes from.
enum Schedule {
    Fixed(StepPlan),
    Adaptive(Controller),
}

/// Steps shorter than this part of the duration lead nowhere.
const SMALLEST_STEP: f64 = 1e-14;

/// Methods of at least this order need more than a polynomial between steps.
const HIGH_ORDER: u32 = 4;

impl Simulation {
    /// Compiles the scene and settles method and step.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        let system = compile(scene)?;
        let choice = choose(scene, &system)?;
        let duration = scene.settings.duration;
        let schedule = match choice.pace {
            Pace::Fixed(step_size) => Schedule::Fixed(StepPlan::new(duration, step_size)),
            Pace::Tolerance(tolerance) => Schedule::Adaptive(Controller::new(
                tolerance,
                duration,
                first_step(duration, system.frequency_bound()),
            )),
        };
        let stepper = Stepper::chosen(system, &choice)?;
        let between = match stepper.method().order() {
            order if order < HIGH_ORDER => Between::Polynomial { order },
            _ => Between::Substep {
                method: choice.build(stepper.system())?,
                state: State::initial(stepper.system()),
            },
        };
        Ok(Self {
            ledger: Ledger::open(stepper.system(), stepper.state()),
            nodes: NodeStates::of(scene),
            duration,
            schedule,
            between,
            choice,
            work: stepper.method().setup(),
            stepper,
        })
    }

    /// Method, tangent and step.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// Simulated time at the end, in s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// How the duration is cut into steps, if they are of fixed size.
    pub fn plan(&self) -> Option<StepPlan> {
        match self.schedule {
            Schedule::Fixed(plan) => Some(plan),
            Schedule::Adaptive(_) => None,
        }
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
    /// duration included. Frames never change the steps. After a stop it goes
    /// on, with the frames that are still to come.
    ///
    /// # Errors
    ///
    /// If a step cannot be made. Everything up to it stays available.
    pub fn run(
        &mut self,
        intervals: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        let mut frames = Frames::new(self.duration, intervals, &self.nodes);
        if self.stepper.steps() > 0 {
            frames.skip(self.stepper.time());
        } else if frames.show(0.0, &self.nodes, observer).is_break() {
            return Ok(Outcome::Stopped);
        }
        while !self.is_finished() {
            frames.remember(&self.nodes);
            let interval = self.step()?;
            let shown = self.show_frames(&mut frames, interval, observer)?;
            if shown.is_break() || observer.step(interval.end).is_break() {
                return Ok(match self.is_finished() {
                    true => Outcome::Finished,
                    false => Outcome::Stopped,
                });
            }
        }
        Ok(Outcome::Finished)
    }

    fn is_finished(&self) -> bool {
        match self.schedule {
            Schedule::Fixed(plan) => self.stepper.steps() >= plan.n_steps(),
            Schedule::Adaptive(_) => self.stepper.time() >= self.duration,
        }
    }

    /// Makes one step that stands.
    fn step(&mut self) -> Result<Interval, StepError> {
        let interval = match self.schedule {
            Schedule::Fixed(plan) => {
                let step = self.stepper.steps() + 1;
                let interval = Interval {
                    start: self.stepper.time(),
                    end: plan.end_of(step),
                    size: plan.size_of(step),
                };
                let (end, h) = (interval.end, interval.size);
                self.stepper
                    .step_until(&mut self.nodes, end, h, &mut self.work)?;
                interval
            }
            Schedule::Adaptive(_) => self.adaptive_step()?,
        };
        self.ledger.record(
            self.stepper.system(),
            self.stepper.state(),
            interval,
            self.stepper.method().quadrature(),
        );
        Ok(interval)
    }

    /// Attempts steps until one is accurate enough.
    fn adaptive_step(&mut self) -> Result<Interval, StepError> {
        let Schedule::Adaptive(controller) = &mut self.schedule else {
            unreachable!("only called with a controller");
        };
        let start = self.stepper.time();
        loop {
            let interval = next_interval(start, self.duration, controller.step_size());
            let attempt = self.stepper.attempt(&self.nodes, interval, &mut self.work);
            let too_small = interval.size < SMALLEST_STEP * self.duration
                || interval.start + 0.1 * interval.size == interval.start;
            match attempt {
                Err(error) if too_small => return Err(error),
                Err(_) => controller.fail(interval.size),
                Ok(estimate) => {
                    let mut estimate = estimate.expect("methods are built with an estimate");
                    if !controller.is_clear(estimate)
                        && let Some(second) = self.stepper.second_estimate(&mut self.work)
                    {
                        estimate = second;
                    }
                    match controller.judge(interval.size, estimate) {
                        Verdict::Accept => {
                            self.stepper
                                .accept(&mut self.nodes, interval, &mut self.work);
                            return Ok(interval);
                        }
                        Verdict::Reject if too_small => {
                            self.stepper.reject(&self.nodes);
                            let cause = Cause::StepTooSmall;
                            return Err(self.stepper.error(cause, estimate.block, interval));
                        }
                        Verdict::Reject => self.stepper.reject(&self.nodes),
                    }
                }
            }
            self.work.counts.rejected_steps += 1;
        }
    }

    fn show_frames(
        &mut self,
        frames: &mut Frames,
        interval: Interval,
        observer: &mut dyn Observer,
    ) -> Result<ControlFlow<()>, StepError> {
        while let Some(time) = frames.next_time() {
            let fraction = (time - interval.start) / (interval.end - interval.start);
            if fraction >= 1.0 + AT_THE_END {
                break;
            }
            let shown = if fraction >= 1.0 - AT_THE_END {
                frames.show(time, &self.nodes, observer)
            } else {
                let mut between = std::mem::take(&mut frames.between);
                let compiled = (self.stepper.system(), self.stepper.anchors());
                let ends = [&frames.before, &self.nodes];
                self.between
                    .evaluate(compiled, ends, interval, time, &mut between)
                    .map_err(|error| {
                        let block = error.block();
                        self.stepper.error(Cause::from(error), block, interval)
                    })?;
                let shown = frames.show(time, &between, observer);
                frames.between = between;
                shown
            };
            if shown.is_break() {
                return Ok(shown);
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// A first step that is short for anything the scene can do; the controller
/// lengthens it quickly.
fn first_step(duration: f64, fastest: f64) -> f64 {
    let resolving = 0.1 / fastest;
    (duration / 100.0).min(resolving.max(1e-6 * duration))
}

/// The next step of about `h`: to the end if that is near, and in two equal
/// steps if it is not much further.
fn next_interval(start: f64, duration: f64, h: f64) -> Interval {
    let left = duration - start;
    let size = match left / h {
        steps if steps <= 1.0 + 1e-9 => left,
        steps if steps < 2.0 => 0.5 * left,
        _ => h,
    };
    Interval {
        start,
        end: if size == left { duration } else { start + size },
        size,
    }
}

/// The frames still to come.
struct Frames {
    duration: f64,
    intervals: usize,
    next: usize,
    /// State before the present step.
    before: NodeStates,
    between: NodeStates,
}

/// A frame this close to the end of a step, as a fraction of it, is the end.
const AT_THE_END: f64 = 1e-9;

impl Frames {
    fn new(duration: f64, intervals: usize, nodes: &NodeStates) -> Self {
        let intervals = if duration == 0.0 { 0 } else { intervals };
        Self {
            duration,
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

    /// Leaves out the frames up to `time`.
    fn skip(&mut self, time: f64) {
        while self.next_time().is_some_and(|next| next <= time) {
            self.next += 1;
        }
    }

    /// Keeps the state before a step, if there are frames that could lie in it.
    fn remember(&mut self, nodes: &NodeStates) {
        if self.next_time().is_some_and(|time| time < self.duration) {
            self.before.clone_from(nodes);
        }
    }

    /// Shows the next frame.
    fn show(&mut self, time: f64, nodes: &NodeStates, to: &mut dyn Observer) -> ControlFlow<()> {
        let index = self.next;
        self.next += 1;
        to.frame(Frame { index, time, nodes })
    }
}
