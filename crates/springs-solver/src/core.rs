//! A solver of matrices with blocks of one dimension.

use crate::direct::Direct;
use crate::iterative::{ConjugateGradients, Ending, Multilevel, Rows, Until};
use crate::strategy::Chooser;
use crate::{Counts, Experience, Interrupt, Options, Price, Route, SolveError};

/// A solver of A x = b with D × D blocks: P numbers a diagonal block, packed, and
/// Q an off-diagonal one. Of a pair (a, b) that is the block of the upper
/// triangle, at row min(a, b) and column max(a, b).
pub(crate) struct Core<const D: usize, const P: usize, const Q: usize> {
    direct: Direct<D, P, Q>,
    /// Allocated where conjugate gradients may be wanted.
    iterative: Option<Iterative<D, P, Q>>,
    /// How the present matrix is solved.
    now: Route,
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
    /// Not needed where the factor in single precision is the preconditioner.
    multilevel: Option<Multilevel<D, P, Q>>,
}

/// Relative accuracy of a solution with a factor in single precision; another
/// digit costs next to nothing there.
const MIXED_ACCURACY: f64 = 1e-11;
/// A factor in double precision is better than more iterations than this with
/// one in single precision.
const MOST_MIXED_ITERATIONS: usize = 24;

impl<const D: usize, const P: usize, const Q: usize> Core<D, P, Q> {
    /// See [`crate::Solver::analyze`], like the others of these names.
    pub(crate) fn analyze(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Self, SolveError> {
        let direct = Direct::<D, P, Q>::new(n_blocks, pairs, options)?;
        let chooser = Chooser::new(n_blocks, pairs.len(), &direct, options.route);
        let iterative = match chooser.may_iterate() || chooser.may_mix() {
            true => Some(Iterative::new(n_blocks, pairs, &chooser, options)?),
            false => None,
        };
        Ok(Self {
            direct,
            iterative,
            now: Route::Double,
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
        let direct = Direct::<D, P, Q>::new(n_blocks, pairs, options)?;
        let chooser = Chooser::new(n_blocks, pairs.len(), &direct, options.route);
        Ok(chooser.price())
    }

    pub(crate) fn memory(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<u64, SolveError> {
        let solver = Self::analyze(n_blocks, pairs, options)?;
        let iterative = solver
            .iterative
            .as_ref()
            .map_or(Some(0), Iterative::<D, P, Q>::memory);
        let factor = match solver.chooser.first() {
            Route::Iterative => Some(0),
            Route::Mixed => solver.direct.single_memory(),
            Route::Double | Route::Auto => solver.direct.double_memory(),
        };
        let symbolic = solver.direct.symbolic_memory();
        let sum = iterative.and_then(|iterative| Some(symbolic + iterative + factor?));
        sum.ok_or(SolveError::TooLarge { n_blocks })
    }

    pub(crate) fn experience(&mut self) -> &mut Experience {
        &mut self.chooser.experience
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

    /// Where single precision finds the matrix indefinite, double precision
    /// decides.
    fn take_matrix(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
    ) -> Result<(), SolveError> {
        self.now = self.chooser.next();
        let Some(iterative) = self
            .iterative
            .as_mut()
            .filter(|_| self.now != Route::Double)
        else {
            self.counts.factorizations += 1;
            return self.direct.factorize(diagonal, off_diagonal);
        };
        iterative.matrix.set(diagonal, off_diagonal);
        match self.now {
            Route::Iterative => {
                let multilevel = iterative.multilevel.as_mut().expect("made with the route");
                multilevel.set(&iterative.matrix)
            }
            _ => self.factorize(),
        }
    }

    /// Factorizes the matrix by rows: in single precision, if that is the route,
    /// or else in double.
    fn factorize(&mut self) -> Result<(), SolveError> {
        let iterative = self.iterative.as_ref().expect("the matrix by rows");
        if self.now == Route::Mixed {
            self.counts.factorizations += 1;
            match self.direct.factorize_single(&iterative.matrix) {
                Err(SolveError::NotPositiveDefinite { .. }) => return self.replace_single(),
                done => return done,
            }
        }
        self.factorize_double()
    }

    /// Factorizes in double precision what single precision was not good enough
    /// for.
    fn replace_single(&mut self) -> Result<(), SolveError> {
        self.now = Route::Double;
        self.factorize_double()?;
        self.chooser.record_mixed(false);
        Ok(())
    }

    fn factorize_double(&mut self) -> Result<(), SolveError> {
        let iterative = self.iterative.as_ref().expect("the matrix by rows");
        self.counts.factorizations += 1;
        self.direct.factorize_rows(&iterative.matrix)
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
        if self.now == Route::Iterative {
            let most = self.chooser.most_iterations();
            let (ending, iterations) = self.iterate(blocks, accuracy, most);
            self.chooser.record(iterations);
            match ending {
                Ending::Converged => return Ok(()),
                Ending::Interrupted => return Err(SolveError::Interrupted),
                Ending::Indefinite { block } => {
                    return Err(SolveError::NotPositiveDefinite { block });
                }
                Ending::Stalled => {
                    self.now = self.chooser.direct();
                    self.factorize()?;
                }
            }
        }
        if self.now == Route::Mixed {
            let (ending, _) = self.iterate(blocks, MIXED_ACCURACY, MOST_MIXED_ITERATIONS);
            match ending {
                Ending::Converged => {
                    self.chooser.record_mixed(true);
                    return Ok(());
                }
                Ending::Interrupted => return Err(SolveError::Interrupted),
                Ending::Stalled | Ending::Indefinite { .. } => {}
            }
            self.replace_single()?;
        }
        self.direct.solve_in_place(blocks);
        Ok(())
    }

    /// Conjugate gradients with the preconditioner of the route; b stays as it
    /// is unless they converge.
    fn iterate(
        &mut self,
        b: &mut [[f64; D]],
        accuracy: f64,
        most_iterations: usize,
    ) -> (Ending, u64) {
        let Iterative {
            matrix,
            gradients,
            solution,
            multilevel,
        } = self.iterative.as_mut().expect("made with the route");
        let before = gradients.iterations;
        gradients.residual.copy_from_slice(b);
        let interrupt = self.direct.interrupt.clone();
        let until = Until {
            accuracy,
            most_iterations,
            interrupt: &interrupt,
        };
        let ending = match (self.now, multilevel) {
            (Route::Iterative, Some(multilevel)) => {
                let ending = gradients.solve(matrix, multilevel, until, solution);
                if ending == Ending::Converged {
                    multilevel.correct(gradients.residual_after_correction(matrix), solution);
                }
                ending
            }
            _ => {
                let mut single = self.direct.single();
                gradients.solve(matrix, &mut single, until, solution)
            }
        };
        if ending == Ending::Converged {
            b.copy_from_slice(solution);
        }
        let iterations = gradients.iterations - before;
        self.counts.iterations += iterations;
        (ending, iterations)
    }
}

impl<const D: usize, const P: usize, const Q: usize> Iterative<D, P, Q> {
    fn new(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        chooser: &Chooser,
        options: Options<'_>,
    ) -> Result<Self, SolveError> {
        Ok(Self {
            matrix: Rows::new(n_blocks, pairs),
            gradients: ConjugateGradients::new(n_blocks),
            solution: vec![[0.0; D]; n_blocks],
            multilevel: match chooser.may_iterate() {
                true => Some(Multilevel::new(n_blocks, pairs, options)?),
                false => None,
            },
        })
    }

    /// In bytes; `None` if it cannot be counted.
    fn memory(&self) -> Option<u64> {
        let n_blocks = self.solution.len();
        let multilevel = self.multilevel.as_ref();
        let rows = Rows::<P, Q>::memory(n_blocks, self.matrix.n_pairs());
        let vectors = ConjugateGradients::<D>::memory(n_blocks) + (8 * D * n_blocks) as u64;
        Some(rows + vectors + multilevel.map_or(Some(0), Multilevel::<D, P, Q>::memory)?)
    }
}
