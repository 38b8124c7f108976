//! What methods cost, counted in advance and afterwards; the only place where the
//! operations of a step have prices, beside the solver's [`Price`].

use crate::implicit::solver_options;
use crate::method::table::{ToleranceKind, UsualStep, properties};
use crate::{Counts, SetupError};
use springs_assembly::System;
use springs_scene::Method;
use springs_solver::Price;

/// Steps with a matrix and a solution that cost as much as an attempt with an implicit
/// method, usually.
const USUAL_STEPS: f64 = 4.0;

/// What each operation of a step costs with one thread, in ns, roughly: `Auto`
/// compares methods by it. Only ratios matter.
#[derive(Clone, Debug)]
pub struct CostModel {
    force: f64,
    n_nodes: f64,
    linearization: f64,
    pub(super) analysis: f64,
    /// As little as it can be, until it is known.
    system: Price,
    without_fill: Price,
    pub(super) is_system_known: bool,
}

/// Iterations of a solution, where it takes any: as `Auto` reckons with them.
const USUAL_ITERATIONS: f64 = 20.0;
/// The same in steps that resolve what moves.
const FORECAST_ITERATIONS: f64 = 5.0;
/// Steps whose corrections one factor serves: up to so many radians of the fastest vibration.
const MOST_RESOLVED: f64 = 10.0;
/// What an operation of price 1 takes, in ns, in steps of scenes like those of
/// `cargo bench --bench prices`, in processor time.
const NANOSECONDS: f64 = 0.7;

/// How large the steps are whose price is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepSizes {
    /// They are chosen by the error: the method makes an estimate of it, too.
    ByError,
    /// They are equal.
    Equal {
        /// The step size times the angular frequency of the fastest vibration.
        angle: f64,
    },
}

impl CostModel {
    /// Of a system; what its matrices cost is known in full.
    ///
    /// # Errors
    ///
    /// If a factor cannot be planned.
    pub fn new(system: &System) -> Result<Self, SetupError> {
        let mut model = Self::without_fill(system);
        model.learn_system(system)?;
        Ok(model)
    }

    /// What a run that counted so much cost, in ns; `None` for `Auto`, which is no
    /// method.
    pub fn of_run(&self, method: Method, counts: &Counts) -> Option<f64> {
        let evaluation = self.evaluation(properties(method)?.node_cost);
        Some(self.of_counts(counts, evaluation))
    }

    /// Of a system whose matrices are not looked at: for methods that have none.
    pub fn without_matrix(system: &System) -> Self {
        Self::without_fill(system)
    }

    /// What a usual step takes, in ns, roughly. `None` for `Auto`, which is no method.
    pub fn of_step(&self, method: Method, sizes: StepSizes) -> Option<f64> {
        let row = properties(method)?;
        let is_doubled = row.tolerance == ToleranceKind::Doubling;
        let (times, is_resolved) = match sizes {
            StepSizes::ByError => (if is_doubled { 3.0 } else { 1.0 }, true),
            StepSizes::Equal { angle } => (1.0, angle <= MOST_RESOLVED),
        };
        let UsualStep {
            evaluations,
            linearizations,
            solves,
        } = row.usual_step;
        // A factor serves all corrections of a step, as long as they get smaller fast.
        let has_factor = self.system.iteration == 0.0;
        let matrices = if has_factor && is_resolved {
            linearizations.min(1.0)
        } else {
            linearizations
        };
        let of_matrix = self.linearization + self.system.matrix;
        let of_solve = self.system.solution + FORECAST_ITERATIONS * self.system.iteration;
        let work = (evaluations + linearizations - matrices) * self.evaluation(row.node_cost)
            + matrices * of_matrix
            + solves * of_solve;
        Some(NANOSECONDS * (times * work + self.attempt()))
    }

    /// As little as it can be, until the system is [learnt](Self::learn_system).
    pub(super) fn without_fill(system: &System) -> Self {
        let springs = system.n_terms() as f64;
        let nodes = system.n_free() as f64;
        let pairs = system.pattern().pairs().len() as f64;
        let entries = 6.0 * nodes + 9.0 * pairs;
        Self {
            n_nodes: nodes,
            force: 60.0 + 2.9 * springs + 1.4 * nodes,
            linearization: 100.0 + 15.0 * springs + 10.0 * nodes,
            analysis: 5e3 + 500.0 * nodes + 150.0 * pairs,
            system: Price::with_factor(entries, 0.0),
            without_fill: Price::with_factor(entries, 0.0),
            is_system_known: false,
        }
    }

    /// An evaluation of forces with what a method does per node.
    pub(super) fn evaluation(&self, node_cost: f64) -> f64 {
        self.force + node_cost * self.n_nodes
    }

    pub(super) fn forget_system(&mut self) {
        self.system = self.without_fill;
        self.is_system_known = false;
    }

    pub(super) fn learn_system(&mut self, system: &System) -> Result<(), SetupError> {
        if !self.is_system_known {
            self.system = solver_options::price(system)?;
            self.is_system_known = true;
        }
        Ok(())
    }

    pub(super) fn step_with_matrix(&self) -> f64 {
        let Price {
            matrix,
            solution,
            iteration,
        } = self.system;
        self.linearization + matrix + solution + USUAL_ITERATIONS * iteration
    }

    /// Where the matrix has a few terms only, with this price: forces and tensions of all.
    pub(super) fn step_with_price(&self, price: Price) -> f64 {
        2.0 * self.force + price.matrix + price.solution
    }

    pub(super) fn attempt_with_matrix(&self) -> f64 {
        USUAL_STEPS * self.step_with_matrix()
    }

    /// A step, made or thrown away, beside what it counts otherwise: copies of the state,
    /// the weighing of errors, the ledger.
    pub(super) fn attempt(&self) -> f64 {
        750.0 + 12.0 * self.n_nodes
    }

    /// What was counted, with `evaluation` for each evaluation of forces alone.
    pub(super) fn of_counts(&self, counts: &Counts, evaluation: f64) -> f64 {
        let linearizations = counts.linearizations;
        let forces = counts.force_evaluations.saturating_sub(linearizations);
        forces as f64 * evaluation
            + linearizations as f64 * (self.linearization + self.system.matrix)
            + counts.solves as f64 * self.system.solution
            + counts.solver_iterations as f64 * self.system.iteration
            + (counts.steps + counts.rejected_steps) as f64 * self.attempt()
    }
}
