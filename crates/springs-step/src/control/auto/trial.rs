//! Trying a candidate out.

use super::{Auto, SHARE};
use crate::control::controller::{Controller, MOST_SUITABLE};
use crate::control::trials::{Abandoned, Trials};
use crate::{Anchors, ErrorEstimate, Interval, State, Work};
use springs_assembly::System;

/// Attempts that a trial takes at most, and usually.
const MOST_ATTEMPTS: usize = 4;
const USUAL_ATTEMPTS: f64 = 2.0;
/// Sharper estimates are made once in so many steps of a run.
const SHARE_OF_ESTIMATES: f64 = 0.125;
/// Implicit methods are not trusted with fewer steps for what is left.
const FEWEST_STEPS: f64 = 10.0;

/// Where a candidate is tried, and what for.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) compiled: (&'a System, &'a Anchors),
    pub(super) state: &'a State,
    pub(super) controller: &'a Controller,
}

/// What became of trying a candidate.
#[derive(Default)]
pub(super) struct Trial {
    /// Cost of a step over its size, in ns/s.
    pub(super) price: f64,
    pub(super) step_size: f64,
}

impl Auto {
    /// Whether a candidate could be cheaper than `price`, and finding out costs
    /// little; it is then built. One that cannot be built is no choice.
    pub(super) fn is_worth_trying(
        &mut self,
        system: &System,
        controller: &Controller,
        index: usize,
        price: f64,
    ) -> bool {
        let left = controller.left();
        let longest = self.longest_step(system, index, left);
        let candidate = &self.candidates[index];
        let is_built = candidate.idle.is_some();
        let attempt = if candidate.is_explicit() {
            let attempt = candidate.attempt.evaluations * candidate.evaluation;
            if attempt > price * longest {
                return false;
            }
            attempt
        } else {
            if !self.costs.is_system_known {
                // Without fill it would cost at least this.
                let least = self.costs.attempt_with_matrix() + self.costs.analysis;
                if least > SHARE * price * left || self.costs.learn_system(system).is_err() {
                    return false;
                }
            }
            let setup = if is_built { 0.0 } else { self.costs.analysis };
            self.costs.attempt_with_matrix() + setup / USUAL_ATTEMPTS
        };
        USUAL_ATTEMPTS * attempt < SHARE * price * left && self.ensure_built(system, index).is_ok()
    }

    pub(super) fn longest_step(&self, system: &System, index: usize, left: f64) -> f64 {
        let stable = self.candidates[index].attempt.stable_angle.map(|angle| {
            let fastest = system.frequency_bound().max(system.damping_rate_bound());
            angle / fastest
        });
        match stable {
            Some(stable) if stable < f64::INFINITY => stable.min(left),
            _ => left / FEWEST_STEPS,
        }
    }

    /// [`Self::try_out`] at the start, with steps of size `from`, and for implicit methods
    /// once more where the step leads: from rest they would promise steps that they do not
    /// keep.
    pub(super) fn try_out_from_rest(
        &mut self,
        task: Task<'_>,
        index: usize,
        (from, to_beat): (Option<f64>, f64),
        trials: &mut Trials<'_>,
    ) -> Result<(Trial, f64), Abandoned> {
        let (first, cost) = self.try_out(task, index, (from, to_beat), trials)?;
        if self.candidates[index].is_explicit() || !first.price.is_finite() {
            return Ok((first, cost));
        }
        let mut moving = self.tried.clone();
        moving.time += first.step_size;
        let from_there = Task {
            state: &moving,
            ..task
        };
        let from = (Some(first.step_size), to_beat);
        let (second, more) = self.try_out(from_there, index, from, trials)?;
        Ok(if second.price > first.price {
            (second, cost + more)
        } else {
            (first, cost + more)
        })
    }

    /// Finds the step size that suits a candidate, beginning with `h`; also
    /// returns what that cost. Sharper estimates are made only for sizes that may cost less than
    /// `to_beat`, in ns/s, if the error is small enough.
    pub(super) fn try_out(
        &mut self,
        Task {
            compiled: (system, anchors),
            state,
            controller,
        }: Task<'_>,
        index: usize,
        (h, to_beat): (Option<f64>, f64),
        trials: &mut Trials<'_>,
    ) -> Result<(Trial, f64), Abandoned> {
        let longest = self.longest_step(system, index, controller.left());
        let candidate = &mut self.candidates[index];
        let method = candidate.idle.as_mut().expect("it is built");
        let mut h = h.unwrap_or(longest).min(longest);
        let mut total = 0.0;
        let mut trial = Trial {
            price: f64::INFINITY,
            step_size: h,
        };
        for _ in 0..MOST_ATTEMPTS {
            self.tried.copy_from(state);
            method.restart();
            let interval = Interval {
                start: state.time,
                end: state.time + h,
                size: h,
            };
            let mut work = Work::default();
            let estimate = method
                .step(system, anchors, interval, &mut self.tried, &mut work)
                .ok()
                .flatten();
            // The attempt itself is not counted: nothing stands.
            let step =
                self.costs.of_counts(&work.counts, candidate.evaluation) + self.costs.attempt();
            let suitable = |estimate| controller.suitable(h, estimate).min(longest);
            let is_too_dear = |least: &ErrorEstimate| {
                let most = suitable(*least);
                most < MOST_SUITABLE * h && step / most > to_beat
            };
            let mut of_estimate = Work::default();
            let estimate = estimate.map(|first| {
                let least = method.least_estimate().filter(is_too_dear);
                match least {
                    // A sharper one would not help.
                    Some(least) => least,
                    None if controller.is_clear(first) => first,
                    None => {
                        let second = method.second_estimate(system, &self.tried, &mut of_estimate);
                        second.unwrap_or(first)
                    }
                }
            });
            trials.work += work;
            trials.work += of_estimate;
            trials.step()?;
            let of_estimate = self
                .costs
                .of_counts(&of_estimate.counts, candidate.evaluation);
            total += step + of_estimate;
            let cost = step + SHARE_OF_ESTIMATES * of_estimate;
            let suits = estimate.map_or(0.1 * h, suitable);
            trial = Trial {
                price: cost / suits,
                step_size: suits,
            };
            if (0.6..1.7).contains(&(suits / h)) {
                break;
            }
            h = suits;
        }
        Ok((trial, total))
    }
}
