//! Direct solution: an order of elimination, and a factor.

mod failure;
mod front;
mod fronts;
mod indefinite;
mod kernels;
mod layout;
mod multifrontal;
mod pivoting;
mod registers;
mod substitution;
mod tree;

pub use self::indefinite::{Indefinite, Inertia};
pub(crate) use self::kernels::dot_in_lanes;

use self::failure::NoFactor;
use self::front::Values;
use self::fronts::Fronts;
use self::multifrontal::Multifrontal;
use self::tree::Tree;
use crate::block::Rounding;
use crate::ordering::best_elimination;
use crate::storage::filled;
use crate::{FactorSize, Interrupt, Options, SolveError};

/// The symbolic factorization P A Pᵀ = L Lᵀ of a pattern, and the factor made
/// with it, which is allocated when it is first needed.
pub(crate) struct Direct<const D: usize, const P: usize> {
    /// Block of the caller at each position of the elimination order.
    order: Vec<usize>,
    fronts: Fronts,
    threads: usize,
    rounding: Rounding,
    size: FactorSize,
    /// In place of all others where there is no fill.
    tree: Option<Tree<D, P>>,
    factor: Option<Factor<D>>,
    /// Heard by factorizations.
    pub(crate) interrupt: Interrupt,
}

/// A factor, and a vector in the order of its columns.
struct Factor<const D: usize> {
    multifrontal: Multifrontal<D>,
    permuted: Vec<f64>,
}

impl<const D: usize, const P: usize> Direct<D, P> {
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
            tree: Tree::new(&elimination),
            size: elimination.size(D),
            fronts,
            order: elimination.order,
            factor: None,
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

    /// Memory of the factor and what belongs to it, in bytes; `None` if it cannot
    /// be counted.
    pub(crate) fn factor_memory(&self) -> Option<u64> {
        if let Some(tree) = &self.tree {
            return Some(tree.memory());
        }
        let factor = Multifrontal::<D>::memory(&self.fronts, self.threads)?;
        Some(factor + (8 * D * self.n_blocks()) as u64)
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

    pub(crate) fn factorize<const Q: usize>(
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
        self.allocate()?;
        let factor = self.factor.as_mut().expect("allocated");
        let done = factor
            .multifrontal
            .factorize(&self.fronts, values, &self.interrupt);
        done.map_err(|why| self.no_factor(why))
    }

    fn allocate(&mut self) -> Result<(), SolveError> {
        if self.factor.is_none() {
            let allocate = || {
                Some(Factor {
                    multifrontal: Multifrontal::new(&self.fronts, self.threads)?,
                    permuted: filled(0.0, D * self.n_blocks())?,
                })
            };
            self.factor = Some(allocate().ok_or(self.too_large())?);
        }
        Ok(())
    }

    /// Solves with the last factor; there must have been one.
    pub(crate) fn solve_in_place(&mut self, x: &mut [[f64; D]]) {
        if let Some(tree) = &mut self.tree {
            return tree.solve_in_place(x);
        }
        let factor = self.factor.as_mut().expect("a factor");
        let (permuted, _) = factor.permuted.as_chunks_mut::<D>();
        for (target, &block) in permuted.iter_mut().zip(&self.order) {
            *target = x[block];
        }
        factor
            .multifrontal
            .solve_in_place(&self.fronts, &mut factor.permuted);
        let (permuted, _) = factor.permuted.as_chunks::<D>();
        for (source, &block) in permuted.iter().zip(&self.order) {
            x[block] = *source;
        }
    }
}
