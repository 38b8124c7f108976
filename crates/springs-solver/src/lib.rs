//! Solution of sparse symmetric systems of 3 × 3 blocks, positive definite or not.
//!
//! [`Solver::analyze`] orders the graph of blocks and factorizes symbolically,
//! once; [`Solver::set_matrix`] and [`Solver::solve_in_place`] then do numeric
//! work only and, on one thread, allocate nothing once warm. There are two
//! [strategies](Strategy): a factor, and conjugate gradients with a multilevel
//! preconditioner, which takes far less time and memory for large matrices. It takes
//! fewest iterations where it knows the [near null space](NearNullSpace) of the matrix,
//! for which it needs [positions](Solver::set_positions).
//!
//! The order is that of minimum degree or, with positions, of nested dissection,
//! whichever takes fewer operations. The factorization is multifrontal, with
//! faer's dense kernels in wide fronts; independent subtrees run on several
//! threads, with the same bits for any number of them.
//!
//! [`Indefinite`] makes factors L D Lᵀ of matrices that may be indefinite or singular, and
//! counts their pivots; [`lowest_eigenpairs`] finds some eigenpairs with any of them, and [`all_eigenpairs`] all, with
//! dense matrices.
//!
//! Matrices are given as one symmetric block per block row, packed as
//! (xx, xy, xz, yy, yz, zz), and one block per coupled pair: six numbers likewise
//! where all of these are symmetric themselves, or [nine](OffDiagonal). Where motion is known to stay in a [plane or on a
//! line](Subspace), or blocks are multiples of the identity, only that part is
//! solved.

mod block;
mod core;
mod dense;
mod direct;
mod eigenpairs;
mod interrupt;
mod iterative;
mod lanes;
mod ordering;
mod packing;
mod reduced;
mod solver;
mod storage;
mod strategy;
mod subspace;

pub use dense::all_eigenpairs;
pub use direct::{Indefinite, Inertia};
pub use eigenpairs::{Eigenpair, LowestEigenpairs, Pencil, lowest_eigenpairs};
pub use interrupt::Interrupt;
pub use ordering::elimination_order;
pub use packing::{OffDiagonal, Packing};
pub use solver::Solver;
pub use strategy::{Price, Strategy};
pub use subspace::Subspace;

/// How systems are to be solved.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// A position in space for every block, which may lead to a better order:
    /// minimum degree and nested dissection are compared by the operations they
    /// take.
    pub positions: Option<&'a [[f64; 3]]>,
    /// Threads that may be used; results are the same to the last bit for any
    /// number of them.
    pub threads: usize,
    /// Which way.
    pub strategy: Strategy,
    /// Where solutions are known to lie.
    pub subspace: Subspace,
    /// What the off-diagonal blocks are like.
    pub packing: Packing,
    /// What the matrix does little to.
    pub near_null_space: NearNullSpace,
}

/// Vectors that a matrix makes small beside others of their size, but for a part of it
/// that is small itself: what iterations take long to find, unless it is given to them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum NearNullSpace {
    /// The same vector for all blocks of a neighbourhood.
    #[default]
    Translations,
    /// Translations and rotations of neighbourhoods about their centres, as springs leave
    /// free. They follow from [positions](Options::positions), which must be given, and
    /// [present ones](Solver::set_positions).
    RigidMotions,
}

impl Default for Options<'_> {
    /// One thread, double precision, symmetric off-diagonal blocks.
    fn default() -> Self {
        Self {
            positions: None,
            threads: 1,
            strategy: Strategy::Double,
            subspace: Subspace::Space,
            packing: Packing::Symmetric,
            near_null_space: NearNullSpace::Translations,
        }
    }
}

/// How often each kind of work was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Numeric factorizations of whole matrices.
    pub factorizations: u64,
    /// Solutions.
    pub solutions: u64,
    /// Iterations of conjugate gradients.
    pub iterations: u64,
}

/// What a solver has learned of the last matrices, on which its next choice of a
/// strategy depends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StrategyState {
    /// Iterations of the last matrix, for all right-hand sides; `f64::MAX` if one of
    /// these was given up.
    pub iterations: f64,
    /// Right-hand sides that it was solved for by iteration.
    pub solutions: u32,
    /// Whether it was solved by iteration without a factor.
    pub is_iterative: bool,
    /// Matrices until that is tried again.
    pub pause: u32,
    /// How long the next such pause will be.
    pub next_pause: u32,
    /// Whether iterations treat rotations of parts, too, where positions are known.
    pub has_rotations: bool,
}

/// How much a factorization is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FactorSize {
    /// Entries of the factor, whole blocks counted.
    pub(crate) entries: f64,
    /// Multiplications and additions.
    pub(crate) flops: f64,
}

impl FactorSize {
    /// Adds columns of blocks of the given dimension that have so many blocks each, the
    /// diagonal included.
    pub(crate) fn add(&mut self, dimension: usize, columns: usize, blocks: usize) {
        let (dimension, columns) = (dimension as f64, columns as f64);
        let height = dimension * blocks as f64;
        self.entries += columns * dimension * height;
        self.flops += columns * dimension * height * height;
    }
}

/// Why a system could not be solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// A pivot, or the curvature along a search direction, was zero, negative or
    /// not a number.
    #[error("the matrix is not positive definite: non-positive pivot in block {block}")]
    NotPositiveDefinite {
        /// The block row it belongs to, or where the direction is largest.
        block: usize,
    },
    /// A coupled pair refers to a block that is not there.
    #[error("pair {pair} refers to block {block}, but there are {n_blocks} blocks")]
    NoSuchBlock {
        /// Index of the pair.
        pair: usize,
        /// The block it asks for.
        block: usize,
        /// How many blocks there are.
        n_blocks: usize,
    },
    /// A coupled pair joins a block to itself, or stands twice.
    #[error("pair {pair} joins a block to itself or stands twice")]
    RepeatedPair {
        /// Index of the pair.
        pair: usize,
    },
    /// There is no matrix: none was set, or the last one was refused.
    #[error("there is no matrix to solve with: none was set, or the last one was refused")]
    NoMatrix,
    /// It was [asked to stop](Interrupt).
    #[error("interrupted")]
    Interrupted,
    /// Iteration for all eigenpairs of a dense matrix did not converge.
    #[error("iteration for eigenpairs does not converge")]
    NotConverged,
    /// The factor has more entries than can be indexed or stored.
    #[error("the factor of {n_blocks} blocks is too large for this machine")]
    TooLarge {
        /// How many blocks there are.
        n_blocks: usize,
    },
}
