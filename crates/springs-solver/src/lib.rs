//! Direct solution of sparse symmetric positive definite systems of 3 × 3
//! blocks.
//!
//! [`SparseCholesky::analyze`] orders the graph of blocks and factorizes
//! symbolically, once; [`SparseCholesky::factorize`] and
//! [`SparseCholesky::solve_in_place`] then do numeric work only and, on one
//! thread, allocate nothing. The order is that of minimum degree or, with
//! positions, of nested dissection, whichever takes fewer operations. The
//! factorization is multifrontal, with faer's dense kernels in wide fronts;
//! independent subtrees run on several threads, with the same bits for any
//! number of them.
//!
//! Matrices are given as one symmetric block per block row and one per coupled
//! pair, each packed as (xx, xy, xz, yy, yz, zz); off-diagonal blocks are
//! symmetric themselves.
//!
//! ```
//! use springs_solver::{Options, SparseCholesky};
//!
//! // [4I  −I; −I  4I] x = b
//! let mut cholesky = SparseCholesky::analyze(2, &[[0, 1]], Options::default())?;
//! let identity = |s: f64| [s, 0.0, 0.0, s, 0.0, s];
//! cholesky.factorize(&[identity(4.0); 2], &[identity(-1.0)])?;
//! let mut x = [3.0; 6];
//! cholesky.solve_in_place(&mut x)?;
//! assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-15));
//! # Ok::<(), springs_solver::SolveError>(())
//! ```

mod cholesky;
mod dissection;
mod fronts;
mod graph;
mod mixed;
mod multifrontal;
mod sharing;
mod substitution;
mod tree;

pub use cholesky::{FactorSize, Options, Precision, SparseCholesky};

/// Why a system could not be solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// A pivot was zero, negative or not a number.
    #[error("the matrix is not positive definite: non-positive pivot in block {block}")]
    NotPositiveDefinite {
        /// The block row it belongs to.
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
    /// The factor has more entries than can be indexed or stored.
    #[error("the factor of {n_blocks} blocks is too large for this machine")]
    TooLarge {
        /// How many blocks there are.
        n_blocks: usize,
    },
}
