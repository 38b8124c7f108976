//! Trial runs: attempts before the first step, to find out how to step.

use crate::{Anchors, Counts, Interval, Method, State, StepPlan, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::Interrupt;
use std::ops::ControlFlow;

/// Trial runs on their way. They may take long, so they can be stopped.
pub(crate) struct Trials<'a> {
    interrupt: &'a Interrupt,
    /// Hears how many steps were made, and may stop them.
    watch: &'a mut dyn FnMut(u64) -> ControlFlow<()>,
    steps: u64,
    /// Of the coarsest run with equal steps.
    fewest_steps: u64,
    /// What they did so far.
    pub(crate) work: Work,
}

/// Somebody stopped trial runs; nothing came of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Abandoned;

/// Why nothing came of trial runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unsettled {
    Abandoned,
    NotReached,
    OutOfMemory,
}

impl From<Abandoned> for Unsettled {
    fn from(_: Abandoned) -> Self {
        Self::Abandoned
    }
}

impl<'a> Trials<'a> {
    pub(crate) fn new(
        interrupt: &'a Interrupt,
        watch: &'a mut dyn FnMut(u64) -> ControlFlow<()>,
        fewest_steps: u64,
    ) -> Self {
        Self {
            interrupt,
            watch,
            steps: 0,
            fewest_steps: fewest_steps.next_power_of_two().max(FEWEST),
            work: Work::default(),
        }
    }

    /// Takes note of a step, made or failed.
    pub(crate) fn step(&mut self) -> Result<(), Abandoned> {
        self.steps += 1;
        if self.interrupt.is_requested() || (self.watch)(self.steps).is_break() {
            return Err(Abandoned);
        }
        Ok(())
    }
}

/// How many equal steps a method needs for a tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EqualSteps {
    pub(crate) n: u64,
    /// Estimated error at the end, in m.
    pub(crate) error: f64,
}

impl std::fmt::Display for EqualSteps {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "trial runs with fewer steps promise an error of {:.0e} m",
            self.error
        )
    }
}

/// Steps of the coarsest trial run, or more where loads and motions change in between,
/// and times at which runs are compared.
const FEWEST: u64 = 8;
/// Where errors fall as the order says, predictions are trusted this much
/// further.
const TRUSTED: f64 = 2.0;
/// The same where they keep to it within [`VERY_REGULAR`], and the method tells what it leaves
/// out: vibrations that all coarse runs miss.
const FAR_TRUSTED: f64 = 8.0;
/// Aimed at an error this much below the tolerance.
const MARGIN: f64 = 1.5;
/// Errors fall as the order says if their ratio is within this factor of it.
const REGULAR: f64 = 2.0;
const VERY_REGULAR: f64 = 1.1;
/// Runs one after the other that fail, or that go so far that rounding exceeds the
/// tolerance, each with steps half as long.
const MOST_FAILURES: u32 = 12;

/// Errors are taken to fall no faster than by this power of the number of steps. Where
/// runs begin to resolve the motion they may, by a little and for one doubling.
const STEEPEST: f64 = 3.0;

/// What trial runs with equal steps may cost.
pub(crate) struct Budget<'a> {
    pub(crate) all: f64,
    /// And the run that they are made for.
    pub(crate) of_run: f64,
    /// What a step of some size in s costs.
    pub(crate) of_step: &'a dyn Fn(&mut dyn Method, f64) -> f64,
    /// What work that was counted cost, or less: steps may cost more than they seem to.
    pub(crate) of_counts: &'a dyn Fn(&Counts) -> f64,
}

/// Finds the number of equal steps from whole runs with 8, 16, 32, … of them,
/// by Richardson's estimate of the error (Hairer, Nørsett, Wanner: Solving
/// Ordinary Differential Equations I, 1993, II.4). For methods that must not
/// change their step on the way. Trial runs end at the latest where their number
/// of steps is that needed, and in smooth scenes at half of it.
///
/// Two runs may agree by accident: both miss a vibration, or their errors cross
/// at the end. So runs are compared at eight times on the way, and an estimate is
/// not trusted to be smaller than the one before by more than twice what the
/// order says: three runs have to agree. A number of steps that was not tried is
/// taken only where errors fell as the order says twice: from four runs. It may be
/// up to eight times that of the last run where the method tells what all of them leave out.
///
/// `None` if trial runs cost more than the budget, or if so many steps do as it takes even
/// if errors fall as steeply as they ever do, or if a dozen
/// runs one after the other fail or leave the tolerance to rounding.
pub(crate) fn equal_steps(
    (system, anchors): (&System, &Anchors),
    method: &mut dyn Method,
    (duration, tolerance): (f64, f64),
    budget: Budget<'_>,
    trials: &mut Trials<'_>,
) -> Result<Option<EqualSteps>, Abandoned> {
    let order = method.order() as i32;
    let gain = 2f64.powi(order);
    let mut coarse: Option<Samples> = None;
    let mut coarse_error = f64::INFINITY;
    let mut last_falls = f64::NAN;
    let mut of_step = |n: u64| (budget.of_step)(method, duration / n as f64);
    let mut n = first_run(trials.fewest_steps, budget.all, &mut of_step);
    let (mut spent, mut failures) = (0.0, 0);
    let before = trials.work.counts;
    let is_spent = |work: &Work| (budget.of_counts)(&(work.counts - before)) > budget.all;
    loop {
        spent += n as f64 * (budget.of_step)(method, duration / n as f64);
        if spent > budget.all || failures == MOST_FAILURES {
            return Ok(None);
        }
        let compiled = (system, anchors);
        let fine = run(compiled, method, (duration, n), &is_spent, trials)?;
        if is_spent(&trials.work) {
            return Ok(None);
        }
        let is_sound = |fine: &Samples| f64::EPSILON * farthest(fine) <= tolerance;
        failures = if fine.as_ref().is_some_and(is_sound) {
            0
        } else {
            failures + 1
        };
        let error = match (&coarse, &fine) {
            (Some(coarse), Some(fine)) => distance(coarse, fine) / (gain - 1.0),
            _ => f64::INFINITY,
        };
        let falls = coarse_error / error;
        let trusted = error.max(coarse_error / (gain * REGULAR));
        // No two runs show what both leave out.
        let known = fine.as_ref().and_then(|fine| fine.left_out);
        let left_out = known.unwrap_or(0.0);
        let allowed = tolerance / MARGIN - left_out;
        // Not a number, too, is too large.
        if trusted <= allowed {
            let error = trusted + left_out;
            return Ok(Some(EqualSteps { n, error }));
        }
        let least = n as f64 * (error / tolerance).powf(1.0 / STEEPEST).max(1.0);
        if error.is_finite() && least * (budget.of_step)(method, duration / least) > budget.of_run {
            return Ok(None);
        }
        let is_regular = |within: f64| {
            let expected = gain / within..gain * within;
            expected.contains(&falls) && expected.contains(&last_falls)
        };
        let needed = n as f64 * (error / allowed).powf(1.0 / f64::from(order));
        let further = if known.is_some() && is_regular(VERY_REGULAR) {
            FAR_TRUSTED
        } else {
            TRUSTED
        };
        // Not a number where less is allowed than nothing.
        if is_regular(REGULAR) && needed <= further * n as f64 {
            return Ok(Some(EqualSteps {
                n: needed.ceil() as u64,
                error: tolerance / MARGIN,
            }));
        }
        (coarse, coarse_error, last_falls) = (fine, error, falls);
        n *= 2;
    }
}

/// Steps of the first trial run: the fewest, unless steps of finer ones cost so little that
/// three of these are made sooner than all that are coarser, and within the budget.
fn first_run(fewest: u64, budget: f64, of_step: &mut dyn FnMut(u64) -> f64) -> u64 {
    let of_coarse = of_step(fewest);
    let mut finer = (1..MOST_DOUBLINGS).map(|k| fewest << k);
    let is_cheap = |&n: &u64| {
        let of_three = THREE_RUNS * of_step(n);
        of_three < of_coarse && of_three * n as f64 <= budget
    };
    finer.find(is_cheap).unwrap_or(fewest)
}

/// n, 2n and 4n steps beside n.
const THREE_RUNS: f64 = 7.0;
const MOST_DOUBLINGS: u32 = 13;

/// What comes of a run.
#[derive(Default)]
struct Samples {
    /// Positions of the free blocks, in m, at equally spaced times.
    positions: Vec<Vec<Vector3<f64>>>,
    /// Of vibrations, in m, at most at these times, if it is known.
    left_out: Option<f64>,
}

/// What comes of `n` equal steps; `None` if a step fails or the budget is spent.
fn run(
    (system, anchors): (&System, &Anchors),
    method: &mut dyn Method,
    (duration, n): (f64, u64),
    is_spent: &dyn Fn(&Work) -> bool,
    trials: &mut Trials<'_>,
) -> Result<Option<Samples>, Abandoned> {
    let plan = StepPlan::equal(duration, n);
    let mut state = State::initial(system);
    let mut samples = Samples::default();
    method.restart();
    for step in 1..=n {
        let interval = Interval {
            start: state.time,
            end: plan.end_of(step),
            size: plan.size_of(step),
        };
        let made = method.step(system, anchors, interval, &mut state, &mut trials.work);
        trials.step()?;
        if made.is_err() || is_spent(&trials.work) {
            return Ok(None);
        }
        method.accept();
        state.time = interval.end;
        if step.is_multiple_of(n / FEWEST) {
            samples.positions.push(state.x[..system.n_free()].to_vec());
            let Ok(left_out) = method.left_out(system, &mut trials.work) else {
                return Ok(None);
            };
            samples.left_out = match (samples.left_out, left_out) {
                (Some(most), Some(left_out)) => Some(most.max(left_out)),
                (_, left_out) => left_out,
            };
        }
    }
    Ok(Some(samples))
}

/// The largest coordinate at any of the times, in m.
fn farthest(samples: &Samples) -> f64 {
    let coordinates = samples.positions.iter().flatten().map(Vector3::amax);
    coordinates.fold(0.0, f64::max)
}

/// The largest distance of a node from itself, at any of the times.
fn distance(a: &Samples, b: &Samples) -> f64 {
    let [a, b] = [a, b].map(|samples| samples.positions.iter().flatten());
    let pairs = a.zip(b);
    // `f64::max` would lose what is not a number.
    pairs.fold(0.0, |largest, (a, b)| {
        let distance = (a - b).norm();
        if distance > largest || distance.is_nan() {
            distance
        } else {
            largest
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trial_runs_begin_where_steps_are_cheap() {
        let from = |cheap_from: u64, price: f64, budget: f64| {
            first_run(8, budget, &mut |n| {
                if n < cheap_from { 100.0 } else { price }
            })
        };
        assert_eq!(from(64, 10.0, 1e9), 64);
        // Seven of them cost as much as a coarse one, or there are none.
        assert_eq!(from(64, 15.0, 1e9), 8);
        assert_eq!(from(u64::MAX, 10.0, 1e9), 8);
        // Three runs are beyond the budget.
        assert_eq!(from(64, 10.0, 4000.0), 8);
    }
}
