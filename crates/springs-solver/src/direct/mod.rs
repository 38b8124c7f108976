//! Direct solution: one order of elimination, and factors that share it.

mod failure;
mod front;
mod fronts;
mod kernels;
mod layout;
mod multifrontal;
mod registers;
mod single;
mod storage;
mod substitution;
mod tree;

use self::failure::NoFactor;
use self::front::Values;
use self::fronts::Fronts;
use self::multifrontal::Multifrontal;
use self::single::{Single, Substitution};
use self::storage::filled;
use self::tree::Tree;
use crate::block::Rounding;
use crate::iterative::Rows;
use crate::ordering::best_elimination;
use crate::{FactorSize, Interrupt, Options, SolveError};

/// The symbolic factorization P A Pᵀ = L Lᵀ of a pattern, and the factors made
/// with it; each is allocated when it is first needed.
pub(crate) struct Direct<const D: usize, const P: usize, const Q: usize> {
    /// Block of the caller at each position of the elimination order.
    order: Vec<usize>,
    n_pairs: usize,
    fronts: Fronts,
    threads: usize,
    rounding: Rounding,
    size: FactorSize,
    /// In place of all others where there is no fill.
    tree: Option<Tree<D, P>>,
    double: Option<Double<D>>,
    single: Option<Single<D, P, Q>>,
    /// By pair, of a matrix that came by rows; allocated with the first one.
    off_diagonal: Vec<[f64; Q]>,
    /// Heard by factorizations.
    pub(crate) interrupt: Interrupt,
}

/// A factor in double precision.
struct Double<const D: usize> {
    factor: Multifrontal<f64, D>,
    permuted: Vec<f64>,
}

impl<const D: usize, const P: usize, const Q: usize> Direct<D, P, Q> {
    /// Orders and factorizes symbolically.
    pub(crate) fn new(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Self, SolveError> {
        let elimination = best_elimination(n_blocks, pairs, options.positions)?;
        let fronts = Fronts::new(&elimination);
        Ok(Self {
            threads: options.threads,
            rounding: Rounding::of(options.subspace),
            n_pairs: pairs.len(),
            tree: Tree::new(&elimination),
            size: elimination.size(D),
            fronts,
            order: elimination.order,
            double: None,
            single: None,
            off_diagonal: Vec::new(),
            interrupt: Interrupt::default(),
        })
    }

    pub(crate) fn is_tree(&self) -> bool {
        self.tree.is_some()
    }

    /// As counted on the graph of blocks.
    pub(crate) fn size(&self) -> FactorSize {
        self.size
    }

    /// Memory of the symbolic factorization, in bytes.
    pub(crate) fn symbolic_memory(&self) -> u64 {
        self.fronts.memory() + (size_of::<usize>() * self.order.len()) as u64
    }

    /// Memory of the factor in double precision and what belongs to it, in
    /// bytes; `None` if it cannot be counted.
    pub(crate) fn double_memory(&self) -> Option<u64> {
        if let Some(tree) = &self.tree {
            return Some(tree.memory());
        }
        let factor = Multifrontal::<f64, D>::memory(&self.fronts, self.threads)?;
        Some(factor + (8 * D * self.n_blocks()) as u64)
    }

    /// The same in single precision.
    pub(crate) fn single_memory(&self) -> Option<u64> {
        let factor = Multifrontal::<f32, D>::memory(&self.fronts, self.threads)?;
        Some(factor + Single::<D, P, Q>::memory(self.n_blocks(), self.n_pairs))
    }

    fn n_blocks(&self) -> usize {
        self.order.len()
    }

    fn too_large(&self) -> SolveError {
        SolveError::TooLarge {
            n_blocks: self.n_blocks(),
        }
    }

    fn no_factor(&self, why: NoFactor) -> SolveError {
        match why {
            NoFactor::NotPositive { column } => SolveError::NotPositiveDefinite {
                block: self.order[column],
            },
            NoFactor::Interrupted => SolveError::Interrupted,
        }
    }

    /// Factorizes in double precision.
    pub(crate) fn factorize(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
    ) -> Result<(), SolveError> {
        if let Some(tree) = &mut self.tree {
            let done = tree.factorize(diagonal, off_diagonal, self.rounding);
            return done.map_err(|why| self.no_factor(why));
        }
        let values = Values {
            diagonal,
            off_diagonal,
            rounding: self.rounding,
        };
        self.allocate_double()?;
        let double = self.double.as_mut().expect("allocated");
        let done = double
            .factor
            .factorize(&self.fronts, values, &self.interrupt);
        done.map_err(|why| self.no_factor(why))
    }

    /// The same with a matrix by rows.
    pub(crate) fn factorize_rows(&mut self, matrix: &Rows<P, Q>) -> Result<(), SolveError> {
        let mut off_diagonal = std::mem::take(&mut self.off_diagonal);
        if off_diagonal.is_empty() {
            off_diagonal = filled([0.0; Q], self.n_pairs).ok_or(self.too_large())?;
        }
        for (_, _, pair, values) in matrix.pairs() {
            off_diagonal[pair] = *values;
        }
        let done = self.factorize(matrix.diagonal(), &off_diagonal);
        self.off_diagonal = off_diagonal;
        done
    }

    fn allocate_double(&mut self) -> Result<(), SolveError> {
        if self.double.is_none() {
            let allocate = || {
                Some(Double {
                    factor: Multifrontal::new(&self.fronts, self.threads)?,
                    permuted: filled(0.0, D * self.n_blocks())?,
                })
            };
            self.double = Some(allocate().ok_or(self.too_large())?);
        }
        Ok(())
    }

    /// Factorizes in single precision.
    pub(crate) fn factorize_single(&mut self, matrix: &Rows<P, Q>) -> Result<(), SolveError> {
        if self.single.is_none() {
            let n_blocks = self.n_blocks();
            let single = Single::new(&self.fronts, n_blocks, self.n_pairs, self.threads);
            self.single = Some(single.ok_or(self.too_large())?);
        }
        let single = self.single.as_mut().expect("allocated");
        let done = single.factorize(&self.fronts, matrix, self.rounding, &self.interrupt);
        done.map_err(|why| self.no_factor(why))
    }

    /// The factor in single precision; there must have been one.
    pub(crate) fn single(&mut self) -> Substitution<'_, D, P, Q> {
        Substitution {
            single: self.single.as_mut().expect("a factor"),
            fronts: &self.fronts,
            order: &self.order,
        }
    }

    /// Solves with the last factor in double precision; there must have been
    /// one.
    pub(crate) fn solve_in_place(&mut self, x: &mut [[f64; D]]) {
        if let Some(tree) = &mut self.tree {
            return tree.solve_in_place(x);
        }
        let double = self.double.as_mut().expect("a factor");
        let (permuted, _) = double.permuted.as_chunks_mut::<D>();
        for (target, &block) in permuted.iter_mut().zip(&self.order) {
            *target = x[block];
        }
        double
            .factor
            .solve_in_place(&self.fronts, &mut double.permuted);
        let (permuted, _) = double.permuted.as_chunks::<D>();
        for (source, &block) in permuted.iter().zip(&self.order) {
            x[block] = *source;
        }
    }
}
