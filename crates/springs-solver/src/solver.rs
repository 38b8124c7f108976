//! Systems on a pattern analyzed once.

use crate::core::{Core, Dimension};
use crate::iterative::{in_plane, in_space, translations};
use crate::packing::Upper;
use crate::reduced::{Reduced, RightHandSide};
use crate::{
    Counts, Interrupt, NearNullSpace, OffDiagonal, Options, Packing, Price, SolveError,
    StrategyState, Subspace,
};

/// A solver of A x = b with matrices of one pattern.
///
/// ```
/// use springs_solver::{Options, Solver};
///
/// // [4I  −I; −I  4I] x = b
/// let mut solver = Solver::analyze(2, &[[0, 1]], Options::default())?;
/// let identity = |s: f64| [s, 0.0, 0.0, s, 0.0, s];
/// solver.set_matrix(&[identity(4.0); 2], &[identity(-1.0)])?;
/// let mut x = [3.0; 6];
/// solver.solve_in_place(&mut x, 1e-11)?;
/// assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-15));
/// # Ok::<(), springs_solver::SolveError>(())
/// ```
pub struct Solver {
    n_blocks: usize,
    n_pairs: usize,
    solutions: u64,
    near_null_space: NearNullSpace,
    kind: Kind,
}

/// By packing of the off-diagonal blocks.
enum Kind {
    Symmetric(Box<dyn Dimension<6>>),
    General(Box<dyn Dimension<9>>, Upper),
}

impl Solver {
    /// Orders and factorizes symbolically, and decides on the strategy to begin
    /// with.
    ///
    /// `pairs` are the coupled blocks, each pair once, in the order in which
    /// [`Self::set_matrix`] will get their values.
    ///
    /// # Errors
    ///
    /// If a pair is not two different blocks below `n_blocks` or stands twice,
    /// or if there is not enough memory.
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block, or none for rigid motions, or
    /// off-diagonal blocks are general where all are said to be multiples of the identity.
    pub fn analyze(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Self, SolveError> {
        check_packing(options);
        let kind = match options.packing {
            Packing::Symmetric => Kind::Symmetric(dimension::<6, 3>(n_blocks, pairs, options)?),
            Packing::General => {
                let dimension = dimension::<9, 4>(n_blocks, pairs, options)?;
                Kind::General(dimension, Upper::new(pairs))
            }
        };
        let mut solver = Self {
            n_blocks,
            n_pairs: pairs.len(),
            solutions: 0,
            near_null_space: options.near_null_space,
            kind,
        };
        if options.near_null_space == NearNullSpace::RigidMotions {
            solver.set_positions(options.positions.expect("positions for rigid motions"));
        }
        Ok(solver)
    }

    /// What systems with such a pattern will cost, roughly.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block, or off-diagonal blocks are
    /// general where all are said to be multiples of the identity.
    pub fn price(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Price, SolveError> {
        check_packing(options);
        match options.packing {
            Packing::Symmetric => price::<6, 3>(n_blocks, pairs, options),
            Packing::General => price::<9, 4>(n_blocks, pairs, options),
        }
    }

    /// Memory, in bytes, that a solver with these options will begin with. What
    /// iteration takes is allocated for a moment to count it; factors are not.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block, or off-diagonal blocks are
    /// general where all are said to be multiples of the identity.
    pub fn memory(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<u64, SolveError> {
        check_packing(options);
        match options.packing {
            Packing::Symmetric => memory::<6, 3>(n_blocks, pairs, options),
            Packing::General => {
                let own = Upper::new(pairs).memory();
                Ok(own + memory::<9, 4>(n_blocks, pairs, options)?)
            }
        }
    }

    /// Number of block rows.
    pub fn n_blocks(&self) -> usize {
        self.n_blocks
    }

    /// What it has learned of the last matrices.
    pub fn strategy_state(&mut self) -> &mut StrategyState {
        match &mut self.kind {
            Kind::Symmetric(solver) => solver.strategy_state(),
            Kind::General(solver, _) => solver.strategy_state(),
        }
    }

    /// What a factor of a matrix and a solution with it cost, for each of the directions
    /// that are solved as one.
    pub fn factor_price(&self) -> Price {
        match &self.kind {
            Kind::Symmetric(solver) => solver.factor_price(),
            Kind::General(solver, _) => solver.factor_price(),
        }
    }

    /// From the next matrix on, a factor of one would serve in place of so many matrices
    /// that are solved by iteration: of one (the default), or of several where their owner
    /// keeps a factor for the systems that follow. The strategy is chosen accordingly.
    pub fn expect_uses(&mut self, uses: f64) {
        match &mut self.kind {
            Kind::Symmetric(solver) => solver.expect_uses(uses),
            Kind::General(solver, _) => solver.expect_uses(uses),
        }
    }

    /// Whom to hear while a matrix is taken or a system solved: asked to stop,
    /// that ends soon with [`SolveError::Interrupted`].
    pub fn set_interrupt(&mut self, interrupt: &Interrupt) {
        match &mut self.kind {
            Kind::Symmetric(solver) => solver.set_interrupt(interrupt),
            Kind::General(solver, _) => solver.set_interrupt(interrupt),
        }
    }

    /// Takes the present positions, one per block: rigid motions are those of these
    /// from the next matrix on. Only differences of positions matter. Without effect on
    /// other near null spaces.
    ///
    /// # Panics
    ///
    /// If there is not one position per block.
    pub fn set_positions(&mut self, positions: &[[f64; 3]]) {
        assert_eq!(positions.len(), self.n_blocks, "one position per block");
        if self.near_null_space != NearNullSpace::RigidMotions {
            return;
        }
        match &mut self.kind {
            Kind::Symmetric(solver) => solver.set_positions(positions),
            Kind::General(solver, _) => solver.set_positions(positions),
        }
    }

    /// What was done so far.
    pub fn counts(&self) -> Counts {
        let counts = match &self.kind {
            Kind::Symmetric(solver) => solver.counts(),
            Kind::General(solver, _) => solver.counts(),
        };
        Counts {
            solutions: self.solutions,
            ..counts
        }
    }

    /// Takes the matrix with the given blocks, those of the diagonal packed as
    /// (xx, xy, xz, yy, yz, zz), and factorizes it or prepares iterations. In a
    /// subspace, if it is the last one, that stands.
    ///
    /// # Errors
    ///
    /// If the matrix is found not to be positive definite, or it is interrupted;
    /// there is then no matrix until the next success.
    ///
    /// # Panics
    ///
    /// If there is not one diagonal block per block row and one off-diagonal
    /// block per pair, or if those are not of the packing of the options.
    pub fn set_matrix<'a>(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: impl Into<OffDiagonal<'a>>,
    ) -> Result<(), SolveError> {
        let off_diagonal = off_diagonal.into();
        assert_eq!(diagonal.len(), self.n_blocks, "one diagonal block per row");
        assert_eq!(off_diagonal.len(), self.n_pairs, "one block per pair");
        match (&mut self.kind, off_diagonal) {
            (Kind::Symmetric(solver), OffDiagonal::Symmetric(blocks)) => {
                solver.set_matrix(diagonal, blocks)
            }
            (Kind::General(solver, upper), OffDiagonal::General(blocks)) => {
                solver.set_matrix(diagonal, upper.of(blocks))
            }
            _ => panic!("off-diagonal blocks of the packing of the options"),
        }
    }

    /// Replaces b in `rhs` by the solution of A x = b with the matrix of the
    /// last successful [`Self::set_matrix`].
    ///
    /// `accuracy` is the part of the solution, in the norm of the matrix, that
    /// an iteration may leave as error; direct solutions are right to rounding.
    /// However loose it is, the residuals of iterations add up to zero as
    /// precisely as rounding allows: no momentum is made.
    ///
    /// # Errors
    ///
    /// If there is no matrix, or it turns out not to be positive definite, or
    /// there is not enough memory for a factor that turns out to be needed, or it
    /// is interrupted;
    /// there is then no matrix until the next success of [`Self::set_matrix`],
    /// and what stands in `rhs` is of no use.
    ///
    /// # Panics
    ///
    /// If `rhs` does not have three entries per block row.
    pub fn solve_in_place(&mut self, rhs: &mut [f64], accuracy: f64) -> Result<(), SolveError> {
        let (blocks, rest) = rhs.as_chunks_mut::<3>();
        assert!(
            rest.is_empty() && blocks.len() == self.n_blocks,
            "three entries per block row"
        );
        self.solutions += 1;
        match &mut self.kind {
            Kind::Symmetric(solver) => solver.solve_in_place(blocks, accuracy),
            Kind::General(solver, _) => solver.solve_in_place(blocks, accuracy),
        }
    }
}

/// A solver for blocks of N numbers off the diagonal, of which OF_PLANE are left in
/// a plane.
fn dimension<const N: usize, const OF_PLANE: usize>(
    n_blocks: usize,
    pairs: &[[u32; 2]],
    options: Options<'_>,
) -> Result<Box<dyn Dimension<N>>, SolveError> {
    use RightHandSide::{Anywhere, InSubspace};
    let line = |direction, right_hand_side| {
        let solved = ([direction], right_hand_side);
        Reduced::<1, 1, 1>::new(n_blocks, pairs, options, solved, translations)
    };
    Ok(match options.subspace {
        Subspace::Space => Box::new(Core::<3, 6, N>::analyze(
            n_blocks, pairs, options, in_space,
        )?),
        Subspace::Plane(basis) => {
            let solved = (basis, InSubspace);
            let reduced =
                Reduced::<2, 3, OF_PLANE>::new(n_blocks, pairs, options, solved, in_plane)?;
            Box::new(reduced)
        }
        Subspace::Line(direction) => Box::new(line(direction, InSubspace)?),
        Subspace::Isotropic => Box::new(line([1.0, 0.0, 0.0], Anywhere)?),
    })
}

fn price<const N: usize, const OF_PLANE: usize>(
    n_blocks: usize,
    pairs: &[[u32; 2]],
    options: Options<'_>,
) -> Result<Price, SolveError> {
    match options.subspace {
        Subspace::Space => Core::<3, 6, N>::price(n_blocks, pairs, options),
        Subspace::Plane(_) => Core::<2, 3, OF_PLANE>::price(n_blocks, pairs, options),
        Subspace::Line(_) => Core::<1, 1, 1>::price(n_blocks, pairs, options),
        Subspace::Isotropic => {
            let one = Core::<1, 1, 1>::price(n_blocks, pairs, options)?;
            Ok(Price {
                solution: 3.0 * one.solution,
                ..one
            })
        }
    }
}

fn memory<const N: usize, const OF_PLANE: usize>(
    n_blocks: usize,
    pairs: &[[u32; 2]],
    options: Options<'_>,
) -> Result<u64, SolveError> {
    match options.subspace {
        Subspace::Space => Core::<3, 6, N>::memory(n_blocks, pairs, options, in_space),
        Subspace::Plane(_) => Reduced::<2, 3, OF_PLANE>::memory(n_blocks, pairs, options, in_plane),
        Subspace::Line(_) | Subspace::Isotropic => {
            Reduced::<1, 1, 1>::memory(n_blocks, pairs, options, translations)
        }
    }
}

/// Panics if every block is said to be a multiple of the identity, but not packed
/// as a symmetric one.
fn check_packing(options: Options<'_>) {
    assert!(
        options.subspace != Subspace::Isotropic || options.packing == Packing::Symmetric,
        "multiples of the identity are packed as symmetric blocks"
    );
}
