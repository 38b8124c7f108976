//! What steps cost: counts and times.

use crate::HiddenState;
use std::ops::{AddAssign, Sub};
use std::time::{Duration, Instant};

/// How often each kind of work was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Steps made.
    pub steps: u64,
    /// Steps made and thrown away because their error was too large.
    pub rejected_steps: u64,
    /// Evaluations of all forces.
    pub force_evaluations: u64,
    /// Orderings and symbolic factorizations.
    pub symbolic_factorizations: u64,
    /// Evaluations of forces and matrix at once, each with a new matrix to be
    /// solved with.
    pub linearizations: u64,
    /// Numeric factorizations.
    pub factorizations: u64,
    /// Solutions of a linear system.
    pub solves: u64,
    /// Iterations of conjugate gradients in these solutions.
    pub solver_iterations: u64,
    /// Solutions that were refined because stiffness hid the masses.
    pub refinements: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Springs whose negative across stiffness was clamped on demand, summed
    /// over steps.
    pub clamped_springs: u64,
}

/// Where the time of steps went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Phases {
    /// Forces and matrices.
    pub assembly: Duration,
    /// Numeric factorization.
    pub factorization: Duration,
    /// Solution of linear systems.
    pub solve: Duration,
}

/// Counts and times together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// How often.
    pub counts: Counts,
    /// How long.
    pub phases: Phases,
}

impl Work {
    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        let Counts {
            steps,
            rejected_steps,
            force_evaluations,
            symbolic_factorizations,
            linearizations,
            factorizations,
            solves,
            solver_iterations,
            refinements,
            newton_iterations,
            clamped_springs,
        } = &mut self.counts;
        for count in [
            steps,
            rejected_steps,
            force_evaluations,
            symbolic_factorizations,
            linearizations,
            factorizations,
            solves,
            solver_iterations,
            refinements,
            newton_iterations,
            clamped_springs,
        ] {
            state.word(count);
        }
        let Phases {
            assembly,
            factorization,
            solve,
        } = &mut self.phases;
        for phase in [assembly, factorization, solve] {
            state.duration(phase);
        }
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        let (a, b) = (&mut self.counts, other.counts);
        a.steps += b.steps;
        a.rejected_steps += b.rejected_steps;
        a.force_evaluations += b.force_evaluations;
        a.symbolic_factorizations += b.symbolic_factorizations;
        a.linearizations += b.linearizations;
        a.factorizations += b.factorizations;
        a.solves += b.solves;
        a.solver_iterations += b.solver_iterations;
        a.refinements += b.refinements;
        a.newton_iterations += b.newton_iterations;
        a.clamped_springs += b.clamped_springs;
        self.phases.assembly += other.phases.assembly;
        self.phases.factorization += other.phases.factorization;
        self.phases.solve += other.phases.solve;
    }
}

impl Sub for Counts {
    type Output = Self;

    /// What was done since an earlier count.
    fn sub(self, earlier: Self) -> Self {
        Self {
            steps: self.steps - earlier.steps,
            rejected_steps: self.rejected_steps - earlier.rejected_steps,
            force_evaluations: self.force_evaluations - earlier.force_evaluations,
            symbolic_factorizations: self.symbolic_factorizations - earlier.symbolic_factorizations,
            linearizations: self.linearizations - earlier.linearizations,
            factorizations: self.factorizations - earlier.factorizations,
            solves: self.solves - earlier.solves,
            solver_iterations: self.solver_iterations - earlier.solver_iterations,
            refinements: self.refinements - earlier.refinements,
            newton_iterations: self.newton_iterations - earlier.newton_iterations,
            clamped_springs: self.clamped_springs - earlier.clamped_springs,
        }
    }
}

/// Runs `work` and adds its time to `phase`.
pub(crate) fn timed<R>(phase: &mut Duration, work: impl FnOnce() -> R) -> R {
    let start = Instant::now();
    let result = work();
    *phase += start.elapsed();
    result
}
