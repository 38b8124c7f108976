//! What steps cost: counts and times.

use crate::Archive;
use std::ops::{AddAssign, Sub};
use std::time::{Duration, Instant};

/// How often each kind of work was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Steps made.
    pub steps: u64,
    /// Steps made and thrown away because their error was too large.
    pub rejected_steps: u64,
    /// Steps that could not be made in one, and were made in shorter ones.
    pub rescued_steps: u64,
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
#[non_exhaustive]
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
#[non_exhaustive]
pub struct Work {
    /// How often.
    pub counts: Counts,
    /// How long.
    pub phases: Phases,
}

impl Counts {
    /// All of them; taken apart by name, so that a new one cannot be forgotten.
    fn fields(&mut self) -> [&mut u64; 12] {
        let Self {
            steps,
            rejected_steps,
            rescued_steps,
            force_evaluations,
            symbolic_factorizations,
            linearizations,
            factorizations,
            solves,
            solver_iterations,
            refinements,
            newton_iterations,
            clamped_springs,
        } = self;
        [
            steps,
            rejected_steps,
            rescued_steps,
            force_evaluations,
            symbolic_factorizations,
            linearizations,
            factorizations,
            solves,
            solver_iterations,
            refinements,
            newton_iterations,
            clamped_springs,
        ]
    }
}

impl Work {
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        for count in self.counts.fields() {
            archive.word(count);
        }
        let Phases {
            assembly,
            factorization,
            solve,
        } = &mut self.phases;
        for phase in [assembly, factorization, solve] {
            archive.duration(phase);
        }
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, mut other: Self) {
        let sums = self.counts.fields().into_iter();
        for (sum, count) in sums.zip(other.counts.fields()) {
            *sum += *count;
        }
        self.phases.assembly += other.phases.assembly;
        self.phases.factorization += other.phases.factorization;
        self.phases.solve += other.phases.solve;
    }
}

impl Sub for Counts {
    type Output = Self;

    /// What was done since an earlier count.
    fn sub(mut self, mut earlier: Self) -> Self {
        for (count, before) in self.fields().into_iter().zip(earlier.fields()) {
            *count -= *before;
        }
        self
    }
}

/// Runs `work` and adds its time to `phase`.
pub(crate) fn timed<R>(phase: &mut Duration, work: impl FnOnce() -> R) -> R {
    let start = Instant::now();
    let result = work();
    *phase += start.elapsed();
    result
}
