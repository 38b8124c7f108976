//! Which way a system is solved.

use crate::Experience;
use crate::direct::Direct;

/// Which way systems are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// With a factor in double precision.
    Double,
    /// With a factor in single precision; conjugate gradients in double
    /// precision, with the factor as preconditioner, bring each solution to
    /// 1e-11. Where they do not, or single precision finds a matrix indefinite that
    /// is not, the next matrices are factorized in double precision at once.
    Mixed,
    /// By conjugate gradients without a factor, with a multilevel
    /// preconditioner.
    Iterative,
    /// The cheapest, by counted operations and by the iterations that the last
    /// matrices took.
    Auto,
}

/// What something costs, in ns, roughly; only ratios matter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Price {
    /// To take a matrix.
    pub matrix: f64,
    /// To solve for a right-hand side.
    pub solution: f64,
    /// An iteration of conjugate gradients without a factor.
    pub iteration: f64,
}

impl Price {
    /// With a factor of so many entries, which takes so many multiplications and
    /// additions.
    pub fn with_factor(entries: f64, flops: f64) -> Self {
        Self {
            matrix: 300.0 + 4.5 * entries + flops / 50.0,
            solution: 100.0 + 1.2 * entries,
            iteration: 0.0,
        }
    }

    /// Of an iteration with a matrix of such a pattern, P numbers a diagonal block
    /// and Q an off-diagonal one.
    pub(crate) fn of_iteration<const P: usize, const Q: usize>(
        n_blocks: usize,
        n_pairs: usize,
    ) -> f64 {
        // More numbers, but as many blocks of vectors that are fetched.
        let n_pairs = n_pairs as f64 * (0.75 + 0.25 * Q as f64 / P as f64);
        200.0 + P as f64 / 6.0 * (10.0 * n_pairs + 20.0 * n_blocks as f64)
    }
}

/// Chooses the route of each matrix. Clocks decide nothing: the same matrices
/// are solved the same way on every machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chooser {
    asked: Route,
    /// The route where iteration does not pay.
    direct: Route,
    direct_price: Price,
    iteration: f64,
    pub(crate) experience: Experience,
}

/// Factorizations below this many operations are not worth single precision.
const WORTH_MIXING: f64 = 1e9;
/// Iterations that a matrix is expected to take.
const USUAL_ITERATIONS: f64 = 40.0;
/// A preconditioner is made in the time of so many iterations.
const PREPARATION: f64 = 4.0;
/// Iteration is given up when it has cost so many times what a factor would have,
/// for all right-hand sides of a matrix.
const PATIENCE: f64 = 1.5;
/// If iteration was asked for, it is given up late.
const MOST_ITERATIONS: f64 = 1e4;
const FIRST_PAUSE: u32 = 16;
const LONGEST_PAUSE: u32 = 1024;

impl Chooser {
    pub(crate) fn new<const D: usize, const P: usize, const Q: usize>(
        n_blocks: usize,
        n_pairs: usize,
        direct: &Direct<D, P, Q>,
        asked: Route,
    ) -> Self {
        let size = direct.size();
        let mut chooser = Self {
            asked: match direct.is_tree() {
                true => Route::Double,
                false => asked,
            },
            direct: match asked {
                Route::Mixed => Route::Mixed,
                Route::Auto | Route::Iterative if size.flops > WORTH_MIXING => Route::Mixed,
                _ => Route::Double,
            },
            direct_price: Price::with_factor(size.entries, size.flops),
            iteration: Price::of_iteration::<P, Q>(n_blocks, n_pairs),
            experience: Experience {
                next_pause: FIRST_PAUSE,
                next_mixed_pause: FIRST_PAUSE,
                ..Experience::default()
            },
        };
        if chooser.asked == Route::Auto && !chooser.is_cheap(USUAL_ITERATIONS, 1) {
            chooser.asked = chooser.direct;
        }
        chooser
    }

    /// Whether so many iterations for so many right-hand sides cost less than a
    /// factor and as many substitutions.
    fn is_cheap(&self, iterations: f64, solutions: u32) -> bool {
        (PREPARATION + iterations) * self.iteration < self.with_factor(solutions)
    }

    fn with_factor(&self, solutions: u32) -> f64 {
        self.direct_price.matrix + f64::from(solutions) * self.direct_price.solution
    }

    /// Whether iteration without a factor is ever wanted.
    pub(crate) fn may_iterate(&self) -> bool {
        matches!(self.asked, Route::Iterative | Route::Auto)
    }

    /// Whether a factor in single precision is ever wanted.
    pub(crate) fn may_mix(&self) -> bool {
        self.direct == Route::Mixed
    }

    /// The first route, and that after a pause.
    pub(crate) fn first(&self) -> Route {
        match self.may_iterate() {
            true => Route::Iterative,
            false => self.direct,
        }
    }

    /// The route of a matrix for which iteration is not wanted or does not converge.
    pub(crate) fn direct(&mut self) -> Route {
        let pause = &mut self.experience.mixed_pause;
        match self.direct {
            Route::Mixed if *pause > 0 => {
                *pause -= 1;
                Route::Double
            }
            direct => direct,
        }
    }

    /// Takes note of whether a factor in single precision was good enough; if not,
    /// one in double precision was.
    pub(crate) fn record_mixed(&mut self, is_good: bool) {
        let now = &mut self.experience;
        if is_good {
            now.next_mixed_pause = FIRST_PAUSE;
        } else {
            now.mixed_pause = now.next_mixed_pause;
            now.next_mixed_pause = longer(now.next_mixed_pause);
        }
    }

    pub(crate) fn price(&self) -> Price {
        match self.may_iterate() {
            true => Price {
                matrix: PREPARATION * self.iteration,
                solution: 0.0,
                iteration: self.iteration,
            },
            false => self.direct_price,
        }
    }

    /// The route of the next matrix.
    pub(crate) fn next(&mut self) -> Route {
        let last = self.experience;
        let is_dear = !self.is_cheap(last.iterations, last.solutions);
        let now = &mut self.experience;
        if last.is_iterative && self.asked == Route::Auto {
            now.next_pause = FIRST_PAUSE;
            if is_dear {
                now.pause = last.next_pause;
                now.next_pause = longer(last.next_pause);
            }
        }
        let is_iterative = now.pause == 0 && matches!(self.asked, Route::Iterative | Route::Auto);
        now.pause = now.pause.saturating_sub(1);
        (now.iterations, now.solutions) = (0.0, 0);
        now.is_iterative = is_iterative;
        match is_iterative {
            true => Route::Iterative,
            false => self.direct(),
        }
    }

    /// Takes note of a solution by iteration.
    pub(crate) fn record(&mut self, iterations: u64) {
        self.experience.iterations += iterations as f64;
        self.experience.solutions = self.experience.solutions.saturating_add(1);
    }

    /// Iterations after which the next solution is given up.
    pub(crate) fn most_iterations(&self) -> usize {
        let last = self.experience;
        let with_factor = self.with_factor(last.solutions.saturating_add(1));
        let most = (PATIENCE * with_factor / self.iteration).ceil() - last.iterations;
        match self.asked {
            // The cast makes zero of what is negative.
            Route::Auto => most as usize,
            _ => MOST_ITERATIONS as usize,
        }
    }
}

fn longer(pause: u32) -> u32 {
    pause.saturating_mul(2).min(LONGEST_PAUSE)
}
