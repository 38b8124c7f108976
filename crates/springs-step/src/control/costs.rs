//! What methods cost, counted in advance and afterwards.

use crate::implicit::solver_options;
use crate::{Counts, SetupError};
use springs_assembly::System;
use springs_solver::Price;

/// Factorizations of an attempt with an implicit method, usually.
const USUAL_FACTORIZATIONS: f64 = 10.0;

/// Cost of each operation in ns, roughly; only their ratios matter.
pub(super) struct Costs {
    pub(super) force: f64,
    linearization: f64,
    pub(super) analysis: f64,
    /// As little as it can be, until it is known.
    system: Price,
    without_fill: Price,
    pub(super) is_system_known: bool,
}

/// Iterations of a solution, where it takes any.
const USUAL_ITERATIONS: f64 = 20.0;

impl Costs {
    pub(super) fn of(system: &System) -> Self {
        let springs = system.n_terms() as f64;
        let nodes = system.n_free() as f64;
        let pairs = system.pattern().pairs().len() as f64;
        let entries = 6.0 * nodes + 9.0 * pairs;
        Self {
            force: 40.0 + 4.2 * springs + 2.0 * nodes,
            linearization: 100.0 + 15.0 * springs + 10.0 * nodes,
            analysis: 5e3 + 500.0 * nodes + 150.0 * pairs,
            system: Price::with_factor(entries, 0.0),
            without_fill: Price::with_factor(entries, 0.0),
            is_system_known: false,
        }
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

    pub(super) fn attempt_with_matrix(&self) -> f64 {
        USUAL_FACTORIZATIONS * self.step_with_matrix()
    }

    /// What was counted, with `evaluation` for each evaluation of forces alone.
    pub(super) fn of_counts(&self, counts: &Counts, evaluation: f64) -> f64 {
        let linearizations = counts.linearizations;
        let forces = counts.force_evaluations.saturating_sub(linearizations);
        forces as f64 * evaluation
            + linearizations as f64 * (self.linearization + self.system.matrix)
            + counts.solves as f64 * self.system.solution
            + counts.solver_iterations as f64 * self.system.iteration
    }
}
