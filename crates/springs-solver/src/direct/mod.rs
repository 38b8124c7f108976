//! Direct solution: an order of elimination, and a factor.

mod columns;
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

pub(crate) use self::columns::dots_in_lanes;
pub use self::indefinite::{Indefinite, Inertia};

use self::failure::NoFactor;
use self::front::Values;
use self::fronts::Fronts;
use self::multifrontal::Multifrontal;
use self::tree::Tree;
use crate::block::Rounding;
use crate::ordering::best_elimination;
use crate::storage::filled;
use crate::{FactorSize, Interrupt, Options, SolveError};

/// The symbolic factorization of a pattern, and the factor made with it.
pub(crate) struct Direct<const D: usize, const P: usize> {
    kind: Kind<D, P>,
    n_blocks: usize,
    rounding: Rounding,
    size: FactorSize,
    /// Heard by factorizations.
    pub(crate) interrupt: Interrupt,
}

enum Kind<const D: usize, const P: usize> {
    /// Where there is no fill.
    Tree(Box<Tree<D, P>>),
    Fronts(Box<InFronts<D>>),
}

/// P A Pᵀ = L Lᵀ in fronts.
struct InFronts<const D: usize> {
    /// Block of the caller at each position of the elimination order.
    order: Vec<usize>,
    fronts: Fronts,
    threads: usize,
    /// Allocated when it is first needed.
    factor: Option<Factor<D>>,
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
        let (kind, size) = match Tree::new(n_blocks, pairs) {
            Some(tree) => {
                let size = tree.size();
                (Kind::Tree(Box::new(tree)), size)
            }
            None => {
                let elimination = best_elimination(n_blocks, pairs, options.positions)?;
                let size = elimination.size(D);
                let fronts = InFronts {
                    fronts: Fronts::new(&elimination),
                    order: elimination.order,
                    threads: options.threads,
                    factor: None,
                };
                (Kind::Fronts(Box::new(fronts)), size)
            }
        };
        Ok(Self {
            kind,
            n_blocks,
            rounding: Rounding::of(options.subspace),
            size,
            interrupt: Interrupt::default(),
        })
    }

    pub(crate) fn is_tree(&self) -> bool {
        matches!(self.kind, Kind::Tree(_))
    }

    /// As counted on the graph of blocks.
    pub(crate) fn size(&self) -> FactorSize {
        self.size
    }

    /// Memory of the symbolic factorization, in bytes.
    pub(crate) fn symbolic_memory(&self) -> u64 {
        match &self.kind {
            Kind::Tree(tree) => tree.symbolic_memory(),
            Kind::Fronts(fronts) => fronts.symbolic_memory(),
        }
    }

    /// Memory of the factor and what belongs to it, in bytes; `None` if it cannot
    /// be counted.
    pub(crate) fn factor_memory(&self) -> Option<u64> {
        match &self.kind {
            Kind::Tree(tree) => Some(tree.factor_memory()),
            Kind::Fronts(fronts) => fronts.factor_memory(),
        }
    }

    pub(crate) fn factorize<const Q: usize>(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
    ) -> Result<(), SolveError> {
        match &mut self.kind {
            Kind::Tree(tree) => {
                let n_blocks = self.n_blocks;
                tree.allocate().ok_or(SolveError::TooLarge { n_blocks })?;
                let done = tree.factorize(diagonal, off_diagonal, self.rounding);
                done.map_err(|block| SolveError::NotPositiveDefinite { block })
            }
            Kind::Fronts(fronts) => {
                let values = Values {
                    diagonal,
                    off_diagonal,
                    rounding: self.rounding,
                };
                fronts.factorize(values, &self.interrupt)
            }
        }
    }

    /// Solves with the last factor; there must have been one.
    pub(crate) fn solve_in_place(&mut self, x: &mut [[f64; D]]) {
        match &mut self.kind {
            Kind::Tree(tree) => tree.solve_in_place(x),
            Kind::Fronts(fronts) => fronts.solve_in_place(x),
        }
    }
}

impl<const D: usize> InFronts<D> {
    fn symbolic_memory(&self) -> u64 {
        self.fronts.memory() + (size_of::<usize>() * self.n_blocks()) as u64
    }

    fn factor_memory(&self) -> Option<u64> {
        let factor = Multifrontal::<D>::memory(&self.fronts, self.threads)?;
        Some(factor + (8 * D * self.n_blocks()) as u64)
    }

    fn n_blocks(&self) -> usize {
        self.order.len()
    }

    fn factorize<const P: usize, const Q: usize>(
        &mut self,
        values: Values<'_, P, Q>,
        interrupt: &Interrupt,
    ) -> Result<(), SolveError> {
        self.allocate()?;
        let factor = self.factor.as_mut().expect("allocated");
        let done = factor
            .multifrontal
            .factorize(&self.fronts, values, interrupt);
        done.map_err(|why| match why {
            NoFactor::NotPositive { column } => SolveError::NotPositiveDefinite {
                block: self.order[column],
            },
            NoFactor::Interrupted => SolveError::Interrupted,
        })
    }

    fn allocate(&mut self) -> Result<(), SolveError> {
        if self.factor.is_none() {
            let allocate = || {
                Some(Factor {
                    multifrontal: Multifrontal::new(&self.fronts, self.threads)?,
                    permuted: filled(0.0, D * self.n_blocks())?,
                })
            };
            let too_large = SolveError::TooLarge {
                n_blocks: self.n_blocks(),
            };
            self.factor = Some(allocate().ok_or(too_large)?);
        }
        Ok(())
    }

    fn solve_in_place(&mut self, x: &mut [[f64; D]]) {
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
