//! A solver of matrices with blocks of one dimension.

use crate::direct::Direct;
use crate::iterative::{
    ConjugateGradients, Ending, MakeCoarse, Multilevel, Pattern, Place, Rows, Until, translations,
};
use crate::strategy::{Chooser, USUAL_ITERATIONS};
use crate::{Counts, Interrupt, NearNullSpace, Options, Price, SolveError, StrategyState};

/// A solver for one dimension of blocks, of matrices with 3 × 3 blocks; off the
/// diagonal they have N numbers.
pub(crate) trait Dimension<const N: usize>: Send + Sync {
    fn strategy_state(&mut self) -> &mut StrategyState;

    fn factor_price(&self) -> Price;

    fn expect_uses(&mut self, uses: f64);

    fn set_interrupt(&mut self, interrupt: &Interrupt);

    fn counts(&self) -> Counts;

    /// Positions of the blocks from now on.
    fn set_positions(&mut self, positions: &[[f64; 3]]);

    /// Of each pair (a, b) the block of the upper triangle.
    fn set_matrix(&mut self, diagonal: &[[f64; 6]], upper: &[[f64; N]]) -> Result<(), SolveError>;

    fn solve_in_place(&mut self, rhs: &mut [[f64; 3]], accuracy: f64) -> Result<(), SolveError>;
}

/// A solver of A x = b with D × D blocks: P numbers a diagonal block, packed, and
/// Q an off-diagonal one. Of a pair (a, b) that is the block of the upper
/// triangle, at row min(a, b) and column max(a, b).
pub(crate) struct Core<const D: usize, const P: usize, const Q: usize> {
    direct: Direct<D, P>,
    /// Where it may be wanted.
    iterative: Option<Iterative<D, P, Q>>,
    /// Whether the present matrix is solved by iteration.
    is_iterative: bool,
    /// Whether the last matrix was taken and not found wanting since.
    has_matrix: bool,
    chooser: Chooser,
    counts: Counts,
}

/// What conjugate gradients take.
struct Iterative<const D: usize, const P: usize, const Q: usize> {
    matrix: Rows<P, Q>,
    gradients: ConjugateGradients<D>,
    solution: Vec<[f64; D]>,
    /// With translations of aggregates, and with all that the options ask for if that is
    /// more.
    multilevels: Vec<Multilevel<D, P, Q>>,
    /// The one that the present matrix has.
    used: usize,
    places: Vec<Place>,
}

impl<const D: usize, const P: usize, const Q: usize> Core<D, P, Q> {
    /// See [`crate::Solver::analyze`], like the others of these names.
    pub(crate) fn analyze(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        make_coarse: MakeCoarse<D, P, Q>,
    ) -> Result<Self, SolveError> {
        let direct = Direct::<D, P>::new(n_blocks, pairs, options)?;
        let iteration = Price::of_iteration::<P, Q>(n_blocks, pairs.len());
        let chooser = Chooser::new(&direct, iteration, options.strategy);
        let iterative = if chooser.may_iterate() {
            Some(Iterative::new(n_blocks, pairs, options, make_coarse)?)
        } else {
            None
        };
        Ok(Self {
            direct,
            iterative,
            is_iterative: false,
            has_matrix: false,
            chooser,
            counts: Counts::default(),
        })
    }

    pub(crate) fn price(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Price, SolveError> {
        let direct = Direct::<D, P>::new(n_blocks, pairs, options)?;
        let iteration = Price::of_iteration::<P, Q>(n_blocks, pairs.len());
        let chooser = Chooser::new(&direct, iteration, options.strategy);
        Ok(chooser.price())
    }

    pub(crate) fn memory(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        make_coarse: MakeCoarse<D, P, Q>,
    ) -> Result<u64, SolveError> {
        let solver = Self::analyze(n_blocks, pairs, options, make_coarse)?;
        let solution = match &solver.iterative {
            Some(iterative) => iterative.memory(),
            None => solver.direct.factor_memory(),
        };
        let sum = solution.map(|solution| solver.direct.symbolic_memory() + solution);
        sum.ok_or(SolveError::TooLarge { n_blocks })
    }

    pub(crate) fn strategy_state(&mut self) -> &mut StrategyState {
        &mut self.chooser.strategy_state
    }

    pub(crate) fn factor_price(&self) -> Price {
        self.chooser.factor_price
    }

    pub(crate) fn expect_uses(&mut self, uses: f64) {
        self.chooser.expect_uses(uses);
    }

    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.direct.interrupt = interrupt.clone();
    }

    fn is_interrupted(&self) -> bool {
        self.direct.interrupt.is_requested()
    }

    /// What was done so far.
    pub(crate) fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether there is a matrix to solve with.
    pub(crate) fn has_matrix(&self) -> bool {
        self.has_matrix
    }

    /// Positions of the blocks, in their own coordinates, from now on.
    pub(crate) fn set_positions(&mut self, positions: impl Iterator<Item = [f64; 3]>) {
        if let Some(iterative) = &mut self.iterative {
            iterative.set_positions(positions);
        }
    }

    pub(crate) fn set_matrix(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
    ) -> Result<(), SolveError> {
        self.has_matrix = false;
        if self.is_interrupted() {
            return Err(SolveError::Interrupted);
        }
        self.take_matrix(diagonal, off_diagonal)?;
        self.has_matrix = true;
        Ok(())
    }

    fn take_matrix(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
    ) -> Result<(), SolveError> {
        self.is_iterative = self.chooser.next();
        match &mut self.iterative {
            Some(iterative) if self.is_iterative => {
                let has_rotations = self.chooser.strategy_state.has_rotations;
                iterative.set(diagonal, off_diagonal, has_rotations)
            }
            _ => {
                self.counts.factorizations += 1;
                self.direct.factorize(diagonal, off_diagonal)
            }
        }
    }

    /// Makes a factor of a matrix that was to be solved by iteration.
    fn factorize_instead(&mut self) -> Result<(), SolveError> {
        self.is_iterative = false;
        let iterative = self.iterative.as_ref().expect("made with the strategy");
        let matrix = &iterative.matrix;
        let (diagonal, off_diagonal) = matrix.by_source::<D>().ok_or(SolveError::TooLarge {
            n_blocks: matrix.n_blocks(),
        })?;
        self.counts.factorizations += 1;
        self.direct.factorize(&diagonal, &off_diagonal)
    }

    pub(crate) fn solve_in_place(
        &mut self,
        blocks: &mut [[f64; D]],
        accuracy: f64,
    ) -> Result<(), SolveError> {
        if !self.has_matrix {
            return Err(SolveError::NoMatrix);
        }
        let done = self.solve(blocks, accuracy);
        self.has_matrix = done.is_ok();
        done
    }

    fn solve(&mut self, blocks: &mut [[f64; D]], accuracy: f64) -> Result<(), SolveError> {
        if self.is_iterative {
            match self.iterate(blocks, accuracy) {
                Ending::Converged => return Ok(()),
                Ending::Interrupted => return Err(SolveError::Interrupted),
                Ending::Indefinite { block } => {
                    return Err(SolveError::NotPositiveDefinite { block });
                }
                Ending::Stalled => self.factorize_instead()?,
            }
        }
        self.direct.solve_in_place(blocks);
        Ok(())
    }

    /// Conjugate gradients; b stays as it is unless they converge.
    fn iterate(&mut self, b: &mut [[f64; D]], accuracy: f64) -> Ending {
        let Iterative {
            matrix,
            gradients,
            solution,
            multilevels,
            used,
            ..
        } = self.iterative.as_mut().expect("made with the strategy");
        let multilevel = &mut multilevels[*used];
        let before = gradients.iterations;
        let of_sources = gradients.residual.iter_mut().zip(matrix.of_sources(b));
        for (residual, b) in of_sources {
            *residual = *b;
        }
        let until = Until {
            accuracy,
            most_iterations: self.chooser.most_iterations(),
            interrupt: &self.direct.interrupt,
        };
        let ending = gradients.solve(matrix, multilevel, until, solution);
        if ending == Ending::Converged {
            let residual = gradients.residual_after_correction(matrix, multilevel);
            multilevel.correct(residual, solution);
            matrix.give_back(solution, b);
        }
        let ending = match ending {
            Ending::Indefinite { block } => Ending::Indefinite {
                block: matrix.source(block),
            },
            ending => ending,
        };
        let iterations = gradients.iterations - before;
        self.counts.iterations += iterations;
        self.chooser.record(iterations);
        if ending == Ending::Stalled {
            self.chooser.record_stall();
        }
        ending
    }
}

impl<const D: usize, const P: usize, const Q: usize> Iterative<D, P, Q> {
    fn new(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        make_coarse: MakeCoarse<D, P, Q>,
    ) -> Result<Self, SolveError> {
        let matrix = Rows::renumbered(n_blocks, pairs);
        let pattern = Pattern::of(&matrix, options, USUAL_ITERATIONS);
        let make = |make_coarse| Multilevel::new(&pattern, make_coarse);
        let mut multilevels = vec![make(make_coarse)?];
        if D > 1 && options.near_null_space != NearNullSpace::Translations {
            multilevels.insert(0, make(translations)?);
        }
        Ok(Self {
            matrix,
            gradients: ConjugateGradients::new(n_blocks),
            solution: vec![[0.0; D]; n_blocks],
            multilevels,
            used: 0,
            places: Vec::with_capacity(n_blocks),
        })
    }

    fn set_positions(&mut self, positions: impl Iterator<Item = [f64; 3]>) {
        let positions: Vec<[f64; 3]> = positions.collect();
        let of_sources = self.matrix.of_sources(&positions);
        self.places.clear();
        self.places.extend(of_sources.copied().map(Place::node));
    }

    fn set(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
        has_rotations: bool,
    ) -> Result<(), SolveError> {
        self.matrix.set::<D>(diagonal, off_diagonal);
        self.used = if has_rotations {
            self.multilevels.len() - 1
        } else {
            0
        };
        let multilevel = &mut self.multilevels[self.used];
        if has_rotations && !self.places.is_empty() {
            multilevel.set_places(&self.places);
        }
        multilevel.set(&self.matrix).map_err(|error| match error {
            SolveError::NotPositiveDefinite { block } => SolveError::NotPositiveDefinite {
                block: self.matrix.source(block),
            },
            other => other,
        })
    }

    /// In bytes; `None` if it cannot be counted.
    fn memory(&self) -> Option<u64> {
        let n_blocks = self.solution.len();
        let rows = Rows::<P, Q>::memory(n_blocks, self.matrix.n_pairs());
        let vectors = ConjugateGradients::<D>::memory(n_blocks)
            + ((8 * D + size_of::<Place>()) * n_blocks) as u64;
        let preconditioners = self.multilevels.iter().map(Multilevel::memory);
        let preconditioners: Option<u64> = preconditioners.sum();
        Some(rows + vectors + preconditioners?)
    }
}

impl<const N: usize> Dimension<N> for Core<3, 6, N> {
    fn strategy_state(&mut self) -> &mut StrategyState {
        self.strategy_state()
    }

    fn factor_price(&self) -> Price {
        self.factor_price()
    }

    fn expect_uses(&mut self, uses: f64) {
        self.expect_uses(uses);
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.set_interrupt(interrupt);
    }

    fn counts(&self) -> Counts {
        self.counts()
    }

    fn set_positions(&mut self, positions: &[[f64; 3]]) {
        self.set_positions(positions.iter().copied());
    }

    fn set_matrix(&mut self, diagonal: &[[f64; 6]], upper: &[[f64; N]]) -> Result<(), SolveError> {
        self.set_matrix(diagonal, upper)
    }

    fn solve_in_place(&mut self, rhs: &mut [[f64; 3]], accuracy: f64) -> Result<(), SolveError> {
        self.solve_in_place(rhs, accuracy)
    }
}
