//! The method of `Auto` with a tolerance: tried out on the scene itself.

mod trial;

use crate::control::controller::{Controller, Schedule};
use crate::control::costs::CostModel;
use crate::control::trials::{Abandoned, Budget, EqualSteps, Trials, Unsettled, equal_steps};
use crate::method::stiff_springs::{is_of_one_kind, stiff_springs};
use crate::method::table::{Attempt, Properties, methods};
use crate::work::Counts;
use crate::{Anchors, Archive, Choice, Method, SetupError, State, StepPlan};
use springs_assembly::System;
use springs_scene::{self as scene, Scene};
use springs_solver::Interrupt;
use trial::{Task, Trial};

/// Chooses among the methods by what they would cost from here on.
///
/// A candidate is tried by attempting a step from the present state until its
/// size suits the tolerance. What that step did, counted and weighted with the
/// cost of each operation, over its size is the price of the method. A
/// candidate is tried only if trying costs a small part of what is left to do
/// with the best one so far, so that the choice costs little even where the
/// whole run does. Since counts decide and not clocks, the same scene gets the
/// same methods on every machine.
///
/// The choice is reviewed during the run: when steps have come to cost much
/// more or less than at the last review, and now and then anyway.
pub(crate) struct Auto {
    candidates: Vec<Candidate>,
    current: usize,
    costs: CostModel,
    /// Cost of steps since the last review, the time they covered in s, and the
    /// cost of that review.
    spent: f64,
    covered: f64,
    review_cost: f64,
    /// What the method in use cost at the last review, in ns/s, and the size of
    /// the last step.
    price: f64,
    step_size: f64,
    tried: State,
    interrupt: Interrupt,
}

/// A method that may be chosen.
struct Candidate {
    choice: Choice,
    attempt: Attempt,
    /// What each evaluation costs, in ns.
    evaluation: f64,
    /// The method, unless it is in use or was not built yet.
    idle: Option<Box<dyn Method>>,
}

impl Candidate {
    fn is_explicit(&self) -> bool {
        self.attempt.stable_angle.is_some()
    }
}

/// What trial runs have settled.
pub(crate) struct Settled {
    pub(crate) choice: Choice,
    pub(crate) method: Box<dyn Method>,
    pub(crate) schedule: Schedule,
}

/// A method to go on with.
pub(crate) struct Picked {
    pub(crate) method: Box<dyn Method>,
    pub(crate) choice: Choice,
    /// The size of step it was tried with, in s.
    pub(crate) step_size: f64,
}

/// Trying a candidate may cost this part of what is left to do.
const SHARE: f64 = 0.1;
/// Trial runs with equal steps may cost this part of the whole run. Three of them, which
/// have to agree, have so many steps; beside an implicit method, which is not sure of its
/// price, they may have so many where two of them cost no more than that part.
const TRIAL_RUNS: f64 = 0.5;
const FEWEST_TRIAL_STEPS: f64 = 24.0;
const USUAL_TRIAL_STEPS: f64 = 56.0;
/// Trial runs may cost [`SHARE`] only beside an explicit method, if methods with a matrix that
/// change their steps cost so many times as much. A step of filtered leapfrog takes one
/// solution, a step of TR-BDF2 four or so, of about the same size; but only what is several
/// times cheaper pays for its trial runs.
const FAR: f64 = 2.0;
/// Springs that are stiff for steps are looked for in steps of so many halves of the
/// duration.
const MOST_HALVINGS: i32 = 16;
/// However dear the alternative seems, nobody waits for more.
const MOST_TRIAL_STEPS: f64 = 1e6;
/// Adaptive steps cost more than they seem to at the start, where most scenes
/// are at rest.
const FROM_REST: f64 = 2.0;
/// Their first step is this part of what suits them by trial.
const FIRST_STEP: f64 = 0.1;
/// Another method must be so many times cheaper than the present one.
const CLEARLY: f64 = 1.3;
/// Steps of other methods are tried from so many times those that the first one takes.
const LONGER: f64 = 4.0;
/// A review is due when steps have cost so many times the last one.
const REVIEW_COSTS: f64 = 5.0;
const REVIEW_ANYWAY: f64 = 40.0;
/// A price has changed by much if it has by this factor.
const MUCH: f64 = 2.5;

impl Auto {
    /// The candidates for a scene.
    pub(crate) fn new(scene: &Scene, system: &System, choice: &Choice) -> Self {
        let costs = CostModel::without_fill(system);
        let candidate = |row: &Properties| {
            let attempt = row.attempt?;
            let can_move = row.can_move(scene, system).is_ok();
            can_move.then(|| Candidate {
                choice: Choice {
                    method: row.method,
                    ..choice.clone()
                },
                attempt,
                evaluation: costs.evaluation(row.node_cost),
                idle: None,
            })
        };
        Self {
            candidates: methods().iter().filter_map(candidate).collect(),
            current: 0,
            costs,
            spent: 0.0,
            review_cost: 0.0,
            covered: 0.0,
            price: 0.0,
            step_size: 0.0,
            tried: State::initial(system),
            interrupt: Interrupt::default(),
        }
    }

    /// Whom its methods hear.
    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
        for candidate in &mut self.candidates {
            if let Some(method) = &mut candidate.idle {
                method.set_interrupt(interrupt);
            }
        }
    }

    /// As if nothing had been tried.
    fn forget(&mut self) {
        self.current = 0;
        self.costs.forget_system();
        for candidate in &mut self.candidates {
            candidate.idle = None;
        }
    }

    /// Hands over what the choice depends on. Methods that were built are built
    /// again.
    pub(crate) fn archive(&mut self, system: &System, archive: &mut Archive) {
        for real in [
            &mut self.spent,
            &mut self.covered,
            &mut self.review_cost,
            &mut self.price,
            &mut self.step_size,
        ] {
            archive.real(real);
        }
        let mut is_known = self.costs.is_system_known;
        archive.flag(&mut is_known);
        if !is_known {
            self.costs.forget_system();
        } else if self.costs.learn_system(system).is_err() {
            archive.refuse();
        }
        for index in 0..self.candidates.len() {
            let mut is_built = self.candidates[index].idle.is_some();
            archive.flag(&mut is_built);
            if !is_built {
                self.candidates[index].idle = None;
            } else if self.ensure_built(system, index).is_err() {
                archive.refuse();
            }
            if let Some(method) = &mut self.candidates[index].idle {
                method.archive(archive);
            }
        }
    }

    /// Which of the candidates is in use.
    pub(crate) fn current(&self) -> usize {
        self.current
    }

    /// Another candidate, to be put to use; `None` if there is no such one or it
    /// cannot be built.
    pub(crate) fn switch_to(&mut self, system: &System, index: usize) -> Option<Picked> {
        self.candidates.get(index)?;
        self.ensure_built(system, index).ok()?;
        let idle = &mut self.candidates[index].idle;
        idle.as_mut().expect("it is built").restart();
        self.current = index;
        Some(self.hand_over(Trial::default(), String::new()))
    }

    /// The first candidate, where nothing is to be done. TR-BDF2 can move any
    /// scene, so there is one.
    pub(crate) fn first(&mut self, system: &System) -> Result<Picked, SetupError> {
        self.ensure_built(system, 0)?;
        Ok(self.hand_over(Trial::default(), "there is nothing to do".to_owned()))
    }

    /// Finds out by trial steps and runs what to start with. If that is stopped,
    /// nothing is left of it.
    pub(crate) fn settle(
        &mut self,
        compiled: (&System, &Anchors),
        controller: Controller,
        trials: &mut Trials<'_>,
    ) -> Result<Settled, Unsettled> {
        let settled = self.try_all(compiled, controller, trials);
        if settled.is_err() {
            self.forget();
        }
        settled
    }

    fn try_all(
        &mut self,
        compiled: (&System, &Anchors),
        mut controller: Controller,
        trials: &mut Trials<'_>,
    ) -> Result<Settled, Unsettled> {
        let (picked, with_matrix) = self.begin(compiled, &controller, trials)?;
        let choice = &picked.choice;
        if let Some(settled) =
            self.equal_steps_if_cheaper(compiled, &controller, (choice, with_matrix), trials)?
        {
            return Ok(settled);
        }
        // What looks good at rest may be too long once it moves; explicit steps are bounded
        // anyway. But steps that resolve vibrations only to leave them behind are many.
        controller.begin_with(if self.candidates[self.current].is_explicit() {
            picked.step_size
        } else {
            FIRST_STEP * picked.step_size
        });
        Ok(Settled {
            choice: picked.choice,
            method: picked.method,
            schedule: Schedule::Adaptive(controller),
        })
    }

    /// Finds out by trial runs whether filtered leapfrog is cheaper than the
    /// method picked so far. They are few if that is explicit and the price `with_matrix` of
    /// methods that were tried, in ns/s, is far above it.
    fn equal_steps_if_cheaper(
        &mut self,
        (system, anchors): (&System, &Anchors),
        controller: &Controller,
        (picked, with_matrix): (&Choice, f64),
        trials: &mut Trials<'_>,
    ) -> Result<Option<Settled>, Abandoned> {
        // Nothing breaks in trial runs, and equal steps do not end where it does.
        if system.has_memory() {
            return Ok(None);
        }
        let (duration, tolerance) = (controller.left(), controller.tolerance());
        let to_beat = self.price * duration;
        // Explicit steps keep what they promise: stability bounds them.
        let is_explicit = self.candidates[self.current].is_explicit();
        let from_rest = if is_explicit { 1.0 } else { FROM_REST };
        // Where few springs are stiff, matrices with all of them say nothing of these steps.
        let mut halvings = (3..MOST_HALVINGS).map(|k| duration * 0.5f64.powi(k));
        let has_few_stiff =
            !is_of_one_kind(system) && halvings.any(|h| stiff_springs(system, h).is_some());
        let is_far = is_explicit && !has_few_stiff && with_matrix > FAR * self.price;
        let part = if is_far { SHARE } else { TRIAL_RUNS };
        let budget = part * from_rest * to_beat;
        let fewest = if is_explicit {
            USUAL_TRIAL_STEPS
        } else {
            FEWEST_TRIAL_STEPS
        };
        let is_too_dear = |costs: &CostModel| {
            let usual = costs.step_with_matrix() + costs.attempt();
            costs.analysis + fewest * usual > budget && !has_few_stiff
        };
        // What cannot be built is no choice. Without fill it would cost at least as much.
        if is_too_dear(&self.costs)
            || self.costs.learn_system(system).is_err()
            || is_too_dear(&self.costs)
        {
            return Ok(None);
        }
        let usual = self.costs.step_with_matrix() + self.costs.attempt();
        let choice = Choice {
            method: scene::Method::FilteredLeapfrog,
            ..picked.clone()
        };
        let Ok(mut method) = choice.build(system) else {
            return Ok(None);
        };
        method.set_interrupt(&self.interrupt);
        let costs = &self.costs;
        let of_step = |method: &mut dyn Method, h: f64| match method.price_at(system, h) {
            Some(price) => costs.step_with_price(price) + costs.attempt(),
            None => usual,
        };
        // Where the matrix may have few terms, counts do not say how few.
        let is_counted = is_explicit && !has_few_stiff;
        let of_counts = |counts: &Counts| match costs.of_run(choice.method, counts) {
            Some(cost) if is_counted => cost,
            _ => 0.0,
        };
        let affordable = if is_explicit {
            budget
        } else {
            budget.max(USUAL_TRIAL_STEPS * usual)
        }
        .min(MOST_TRIAL_STEPS * usual);
        let (task, budget) = (
            (duration, tolerance),
            Budget {
                all: affordable,
                of_run: from_rest * to_beat,
                of_step: &of_step,
                of_counts: &of_counts,
            },
        );
        let steps = equal_steps((system, anchors), &mut *method, task, budget, trials)?;
        let is_cheaper = |steps: &EqualSteps| {
            let of_step = of_step(&mut *method, duration / steps.n as f64);
            steps.n as f64 * of_step < from_rest * to_beat
        };
        Ok(steps.filter(is_cheaper).map(|steps| {
            method.restart();
            Settled {
                choice: Choice {
                    reason: steps.to_string(),
                    ..choice
                },
                method,
                schedule: Schedule::Fixed(StepPlan::equal(duration, steps.n)),
            }
        }))
    }

    /// The method to begin with among those with error control, and the least price of
    /// one with a matrix, in ns/s; infinite if none was worth trying.
    fn begin(
        &mut self,
        compiled: (&System, &Anchors),
        controller: &Controller,
        trials: &mut Trials<'_>,
    ) -> Result<(Picked, f64), Unsettled> {
        let system = compiled.0;
        let state = &State::initial(system);
        let built = self.ensure_built(system, 0);
        built.map_err(|_| Unsettled::OutOfMemory)?;
        let task = Task {
            compiled,
            state,
            controller,
        };
        let (mut best, mut cost) =
            self.try_out_from_rest(task, 0, (None, f64::INFINITY), trials)?;
        // Where the error bounds steps of order 8, and not stability, steps of order 2 are
        // hardly longer; far longer ones only cost corrections that do not converge.
        let longest = self.longest_step(system, 0, controller.left());
        let is_resolved = best.step_size < CLEARLY.recip() * longest;
        let suitable = is_resolved.then_some(LONGER * best.step_size);
        let mut with_matrix = self.price_with_matrix(0, &best);
        for index in 1..self.candidates.len() {
            if self.is_worth_trying(system, controller, index, best.price) {
                let from = suitable.filter(|_| !self.candidates[index].is_explicit());
                let from = (from, best.price);
                let (tried, took) = self.try_out_from_rest(task, index, from, trials)?;
                cost += took;
                with_matrix = with_matrix.min(self.price_with_matrix(index, &tried));
                if tried.price < best.price {
                    (best, self.current) = (tried, index);
                }
            }
        }
        (self.review_cost, self.price) = (cost, best.price);
        let reason = format!(
            "by trial steps {} is the cheapest for this tolerance: about {:.0e} s of work a \
             simulated second, in steps of {:.1e} s",
            self.candidates[self.current].choice.method,
            1e-9 * best.price,
            best.step_size
        );
        Ok((self.hand_over(best, reason), with_matrix))
    }

    /// The price of a candidate that was tried, in ns/s; infinite without a matrix.
    fn price_with_matrix(&self, index: usize, tried: &Trial) -> f64 {
        if self.candidates[index].is_explicit() {
            f64::INFINITY
        } else {
            tried.price
        }
    }

    /// Takes note of a step of size `h` that did `counts`.
    pub(crate) fn record(&mut self, h: f64, counts: Counts) {
        let evaluation = self.candidates[self.current].evaluation;
        self.spent += self.costs.of_counts(&counts, evaluation);
        self.covered += h;
        self.step_size = h;
    }

    /// Whether it is time to compare the methods again.
    pub(crate) fn is_review_due(&self) -> bool {
        let ratio = self.spent / self.covered / self.price;
        let has_changed = !(1.0 / MUCH..MUCH).contains(&ratio);
        self.spent > REVIEW_COSTS * self.review_cost
            && (has_changed || self.spent > REVIEW_ANYWAY * self.review_cost)
    }

    /// Compares the method in use with the others; another one is handed over
    /// if it is clearly cheaper.
    pub(crate) fn review(
        &mut self,
        compiled: (&System, &Anchors),
        state: &State,
        controller: &Controller,
        trials: &mut Trials<'_>,
    ) -> Result<Option<Picked>, Abandoned> {
        let mut best: Option<(usize, Trial)> = None;
        self.price = self.spent / self.covered;
        let mut to_beat = self.price / CLEARLY;
        let mut cost = 0.0;
        let task = Task {
            compiled,
            state,
            controller,
        };
        for index in 0..self.candidates.len() {
            if index != self.current && self.is_worth_trying(compiled.0, controller, index, to_beat)
            {
                let from = (Some(self.step_size), to_beat);
                let (tried, took) = self.try_out(task, index, from, trials)?;
                cost += took;
                if tried.price < to_beat {
                    to_beat = tried.price;
                    best = Some((index, tried));
                }
            }
        }
        // Even where nothing was tried it is not asked again at once.
        self.review_cost = cost.max(self.review_cost).max(self.price * self.step_size);
        (self.spent, self.covered) = (0.0, 0.0);
        Ok(best.map(|(index, trial)| {
            let reason = format!("{:.1} times cheaper from then on", self.price / trial.price);
            (self.current, self.price) = (index, trial.price);
            self.hand_over(trial, reason)
        }))
    }

    /// Takes back the method that was in use.
    pub(crate) fn put_back(&mut self, which: scene::Method, method: Box<dyn Method>) {
        let mut candidates = self.candidates.iter_mut();
        if let Some(candidate) = candidates.find(|candidate| candidate.choice.method == which) {
            candidate.idle = Some(method);
        }
    }

    fn hand_over(&mut self, trial: Trial, reason: String) -> Picked {
        let candidate = &mut self.candidates[self.current];
        let mut method = candidate.idle.take().expect("it was tried out");
        // Explicit ones were tried from here: for them it is as if that step was rejected.
        if !candidate.is_explicit() {
            method.restart();
        }
        Picked {
            method,
            choice: Choice {
                reason,
                ..candidate.choice.clone()
            },
            step_size: trial.step_size,
        }
    }

    fn ensure_built(&mut self, system: &System, index: usize) -> Result<(), SetupError> {
        let candidate = &mut self.candidates[index];
        if candidate.idle.is_none() {
            let mut method = candidate.choice.build(system)?;
            method.set_interrupt(&self.interrupt);
            candidate.idle = Some(method);
        }
        Ok(())
    }
}
