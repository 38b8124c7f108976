//! Which way a system is solved.

use crate::StrategyState;
use crate::direct::Direct;

/// Which way systems are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Strategy {
    /// With a factor in double precision.
    Double,
    /// By conjugate gradients without a factor, with a multilevel
    /// preconditioner.
    Iterative,
    /// The cheapest, by counted operations and by the iterations that the last
    /// matrices took.
    Auto,
}

/// A factor of so many entries is in no cache.
const FAR_ENTRIES: f64 = 4e6;

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
        // Twice as long for each entry where they come from memory.
        let far = (entries / FAR_ENTRIES).min(1.0);
        Self {
            matrix: 300.0 + 4.5 * entries + flops / 50.0,
            solution: 100.0 + (0.5 + 0.7 * far) * entries,
            iteration: 0.0,
        }
    }

    /// With a factor without fill, of so many entries: no front is assembled.
    fn of_tree(entries: f64, flops: f64) -> Self {
        Self {
            matrix: 300.0 + 2.2 * entries + flops / 50.0,
            ..Self::with_factor(entries, flops)
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

/// Chooses the strategy of each matrix. Clocks decide nothing: the same matrices
/// are solved the same way on every machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chooser {
    asked: Strategy,
    pub(crate) factor_price: Price,
    iteration: f64,
    /// How many matrices a factor of one serves in place of.
    uses: f64,
    pub(crate) strategy_state: StrategyState,
}

/// Iterations that a matrix is expected to take.
pub(crate) const USUAL_ITERATIONS: f64 = 20.0;
/// A preconditioner is made in the time of so many iterations.
const PREPARATION: f64 = 4.0;
/// Iteration is given up when it has cost so many times what a factor would have,
/// for all right-hand sides of a matrix.
const PATIENCE: f64 = 1.5;
/// If iteration was asked for, it is given up late.
const MOST_ITERATIONS: f64 = 1e4;
/// Rotations of aggregates halve iterations, but their matrix is made and factorized in the
/// time of several. So they are left out where a matrix took no more iterations with them
/// than this, and treated again where it took more without them than that.
const FEW_WITH_ROTATIONS: f64 = 8.0;
const MANY_WITHOUT: f64 = 18.0;
/// Iterations with rotations for one without.
const GAIN: f64 = 0.6;
const FIRST_PAUSE: u32 = 16;
const LONGEST_PAUSE: u32 = 1024;

impl Chooser {
    /// `iteration` is the price of one.
    pub(crate) fn new<const D: usize, const P: usize>(
        direct: &Direct<D, P>,
        iteration: f64,
        asked: Strategy,
    ) -> Self {
        let size = direct.size();
        let mut chooser = Self {
            asked: if direct.is_tree() {
                Strategy::Double
            } else {
                asked
            },
            factor_price: if direct.is_tree() {
                Price::of_tree(size.entries, size.flops)
            } else {
                Price::with_factor(size.entries, size.flops)
            },
            iteration,
            uses: 1.0,
            strategy_state: StrategyState {
                next_pause: FIRST_PAUSE,
                has_rotations: true,
                ..StrategyState::default()
            },
        };
        if chooser.asked == Strategy::Auto && !chooser.is_cheap(USUAL_ITERATIONS, 1) {
            chooser.asked = Strategy::Double;
        }
        chooser
    }

    /// Whether so many iterations for so many right-hand sides cost less than a
    /// factor and as many substitutions.
    fn is_cheap(&self, iterations: f64, solutions: u32) -> bool {
        (PREPARATION + iterations) * self.iteration < self.with_factor(solutions)
    }

    fn with_factor(&self, solutions: u32) -> f64 {
        self.factor_price.matrix / self.uses + f64::from(solutions) * self.factor_price.solution
    }

    /// See [`crate::Solver::expect_uses`].
    pub(crate) fn expect_uses(&mut self, uses: f64) {
        self.uses = uses.max(1.0);
    }

    /// Whether iteration without a factor is ever wanted.
    pub(crate) fn may_iterate(&self) -> bool {
        self.asked != Strategy::Double
    }

    pub(crate) fn price(&self) -> Price {
        if self.may_iterate() {
            Price {
                matrix: PREPARATION * self.iteration,
                solution: 0.0,
                iteration: self.iteration,
            }
        } else {
            self.factor_price
        }
    }

    /// Whether the next matrix is solved by iteration.
    pub(crate) fn next(&mut self) -> bool {
        let last = self.strategy_state;
        // A matrix that was refused says nothing.
        let is_known = last.is_iterative && last.solutions > 0;
        let has_rotations = match (is_known, last.has_rotations) {
            (false, _) => last.has_rotations,
            (true, true) => last.iterations > FEW_WITH_ROTATIONS,
            (true, false) => last.iterations > MANY_WITHOUT,
        };
        let expected = if has_rotations && !last.has_rotations {
            GAIN * last.iterations
        } else {
            last.iterations
        };
        let is_dear = !self.is_cheap(expected, last.solutions);
        let now = &mut self.strategy_state;
        now.has_rotations = has_rotations;
        if last.is_iterative && self.asked == Strategy::Auto {
            now.next_pause = FIRST_PAUSE;
            if is_dear {
                now.pause = last.next_pause;
                now.next_pause = last.next_pause.saturating_mul(2).min(LONGEST_PAUSE);
            }
        }
        let is_iterative = now.pause == 0 && self.asked != Strategy::Double;
        now.pause = now.pause.saturating_sub(1);
        (now.iterations, now.solutions) = (0.0, 0);
        now.is_iterative = is_iterative;
        is_iterative
    }

    /// Takes note of a solution by iteration.
    pub(crate) fn record(&mut self, iterations: u64) {
        self.strategy_state.iterations += iterations as f64;
        self.strategy_state.solutions = self.strategy_state.solutions.saturating_add(1);
    }

    /// Takes note that it came to nothing.
    pub(crate) fn record_stall(&mut self) {
        self.strategy_state.iterations = f64::MAX;
    }

    /// Iterations after which the next solution is given up.
    pub(crate) fn most_iterations(&self) -> usize {
        let last = self.strategy_state;
        let with_factor = self.with_factor(last.solutions.saturating_add(1));
        let most = (PATIENCE * with_factor / self.iteration).ceil() - last.iterations;
        match self.asked {
            // The cast makes zero of what is negative.
            Strategy::Auto => most as usize,
            _ => MOST_ITERATIONS as usize,
        }
    }
}
