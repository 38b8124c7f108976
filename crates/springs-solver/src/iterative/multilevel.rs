//! A preconditioner whose conjugate gradients take nearly the same number of
//! iterations for any size.

use super::rows::Rows;
use crate::block::{Rounding, add, is_symmetric, transposed, with_transposed};
use crate::direct::Direct;
use crate::ordering::Lists;
use crate::{Options, Price, SolveError};

/// A sweep of Gauss and Seidel, a correction that is constant on every
/// aggregate of blocks, and the sweep backwards.
///
/// Aggregates are neighbourhoods in the graph (as in Vaněk, Mandel and Brezina,
/// Computing 56, 1996, but not smoothed). A constant on an aggregate has as many
/// components as a block, so the coarse matrix is one of such blocks again; it
/// is factorized, or, where that would be much work, has a coarser one itself.
pub(crate) struct Multilevel<const D: usize, const P: usize, const Q: usize> {
    inverses: Vec<[f64; P]>,
    rounding: Rounding,
    /// Aggregate of each block.
    aggregates: Vec<u32>,
    /// Coarse pair of each pair of the caller; `INSIDE` of an aggregate there
    /// is none.
    coarse_pairs: Vec<u32>,
    coarse: Coarse<D, P, Q>,
    coarse_diagonal: Vec<[f64; P]>,
    coarse_off_diagonal: Vec<[f64; Q]>,
    coarse_vector: Vec<[f64; D]>,
    swept: Vec<[f64; D]>,
    rest: Vec<[f64; D]>,
}

/// What solves for the correction.
enum Coarse<const D: usize, const P: usize, const Q: usize> {
    Direct(Box<Direct<D, P>>),
    /// One application of the next coarser preconditioner.
    Level {
        matrix: Rows<P, Q>,
        preconditioner: Box<Multilevel<D, P, Q>>,
        solution: Vec<[f64; D]>,
    },
}

const INSIDE: u32 = u32::MAX;
/// Not in an aggregate yet.
const NONE: u32 = u32::MAX;

/// A coarse matrix whose factorization would cost more than so many iterations
/// has a coarser one.
const DEAREST_COARSE: f64 = 20.0;

impl<const D: usize, const P: usize, const Q: usize> Multilevel<D, P, Q> {
    pub(crate) fn new(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Self, SolveError> {
        Self::with_dearest_coarse(n_blocks, pairs, options, DEAREST_COARSE)
    }

    fn with_dearest_coarse(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        dearest_coarse: f64,
    ) -> Result<Self, SolveError> {
        let (aggregates, n_coarse) = aggregate(n_blocks, pairs);
        let mut between: Vec<([u32; 2], usize)> = pairs
            .iter()
            .map(|pair| pair.map(|block| aggregates[block as usize]))
            .enumerate()
            .filter(|(_, [a, b])| a != b)
            .map(|(pair, [a, b])| ([a.min(b), a.max(b)], pair))
            .collect();
        between.sort_unstable();
        let mut coarse_pairs = vec![INSIDE; pairs.len()];
        let mut distinct: Vec<[u32; 2]> = Vec::new();
        for (ends, pair) in between {
            if distinct.last() != Some(&ends) {
                distinct.push(ends);
            }
            coarse_pairs[pair] = distinct.len() as u32 - 1;
        }
        let options = Options {
            positions: None,
            ..options
        };
        let direct = Direct::new(n_coarse, &distinct, options)?;
        let dearest = dearest_coarse * Price::of_iteration::<P, Q>(n_blocks, pairs.len());
        let size = direct.size();
        let is_cheap = Price::with_factor(size.entries, size.flops).matrix <= dearest;
        let coarse = if is_cheap || n_coarse == n_blocks {
            Coarse::Direct(Box::new(direct))
        } else {
            let next = Self::with_dearest_coarse(n_coarse, &distinct, options, dearest_coarse);
            Coarse::Level {
                matrix: Rows::new(n_coarse, &distinct),
                preconditioner: Box::new(next?),
                solution: vec![[0.0; D]; n_coarse],
            }
        };
        Ok(Self {
            inverses: vec![[0.0; P]; n_blocks],
            rounding: Rounding::of(options.subspace),
            aggregates,
            coarse_pairs,
            coarse,
            coarse_diagonal: vec![[0.0; P]; n_coarse],
            coarse_off_diagonal: vec![[0.0; Q]; distinct.len()],
            coarse_vector: vec![[0.0; D]; n_coarse],
            swept: vec![[0.0; D]; n_blocks],
            rest: vec![[0.0; D]; n_blocks],
        })
    }

    /// Memory, in bytes; `None` if it cannot be counted.
    pub(crate) fn memory(&self) -> Option<u64> {
        let (n_blocks, n_coarse) = (self.inverses.len(), self.coarse_diagonal.len());
        let own = (8 * P + 16 * D + 4) * n_blocks + 4 * self.coarse_pairs.len();
        let coarse_values = 8 * (P + D) * n_coarse + 8 * Q * self.coarse_off_diagonal.len();
        let coarse = match &self.coarse {
            Coarse::Direct(direct) => direct.symbolic_memory() + direct.factor_memory()?,
            Coarse::Level { preconditioner, .. } => {
                Rows::<P, Q>::memory(n_coarse, self.coarse_off_diagonal.len())
                    + (8 * D * n_coarse) as u64
                    + preconditioner.memory()?
            }
        };
        Some((own + coarse_values) as u64 + coarse)
    }

    /// Prepares for a matrix.
    ///
    /// # Errors
    ///
    /// If that of a block or the coarse matrix, and so the matrix, is not
    /// positive definite.
    pub(crate) fn set(&mut self, matrix: &Rows<P, Q>) -> Result<(), SolveError> {
        matrix.invert_diagonal::<D>(&mut self.inverses, self.rounding)?;
        self.coarse_diagonal.fill([0.0; P]);
        self.coarse_off_diagonal.fill([0.0; Q]);
        for (block, &aggregate) in matrix.diagonal().iter().zip(&self.aggregates) {
            add(&mut self.coarse_diagonal[aggregate as usize], *block);
        }
        for (row, column, pair, values) in matrix.pairs() {
            let [above, beside] = [row, column].map(|block| self.aggregates[block]);
            match self.coarse_pairs[pair] {
                // It stands above and below the diagonal.
                INSIDE => add(
                    &mut self.coarse_diagonal[above as usize],
                    with_transposed::<D, P, Q>(values),
                ),
                coarse => {
                    let is_upper = is_symmetric::<D, Q>() || above < beside;
                    let values = if is_upper {
                        *values
                    } else {
                        transposed::<D, Q>(values)
                    };
                    add(&mut self.coarse_off_diagonal[coarse as usize], values);
                }
            }
        }
        let (diagonal, off_diagonal) = (&self.coarse_diagonal, &self.coarse_off_diagonal);
        let done = match &mut self.coarse {
            Coarse::Direct(direct) => direct.factorize(diagonal, off_diagonal),
            Coarse::Level {
                matrix,
                preconditioner,
                ..
            } => {
                matrix.set(diagonal, off_diagonal);
                preconditioner.set(matrix)
            }
        };
        done.map_err(|error| match error {
            SolveError::NotPositiveDefinite { block: aggregate } => {
                let mut members = self.aggregates.iter();
                let first = members.position(|&of| of as usize == aggregate);
                SolveError::NotPositiveDefinite {
                    block: first.unwrap_or_default(),
                }
            }
            other => other,
        })
    }

    /// Adds what is constant on aggregates and takes the sums of the residual
    /// `r` over aggregates away.
    pub(crate) fn correct(&mut self, r: &[[f64; D]], z: &mut [[f64; D]]) {
        self.coarse_vector.fill([0.0; D]);
        for (r, &aggregate) in r.iter().zip(&self.aggregates) {
            add(&mut self.coarse_vector[aggregate as usize], *r);
        }
        let correction = match &mut self.coarse {
            Coarse::Direct(direct) => {
                direct.solve_in_place(&mut self.coarse_vector);
                &self.coarse_vector
            }
            Coarse::Level {
                matrix,
                preconditioner,
                solution,
            } => {
                preconditioner.apply(matrix, &self.coarse_vector, solution);
                solution
            }
        };
        for (z, &aggregate) in z.iter_mut().zip(&self.aggregates) {
            add(z, correction[aggregate as usize]);
        }
    }

    /// `z` from the residual `r`: an approximation of the inverse, symmetric and
    /// positive definite.
    pub(crate) fn apply(&mut self, matrix: &Rows<P, Q>, r: &[[f64; D]], z: &mut [[f64; D]]) {
        let (mut swept, mut rest) = (
            std::mem::take(&mut self.swept),
            std::mem::take(&mut self.rest),
        );
        rest.copy_from_slice(r);
        matrix.solve_lower(&self.inverses, &mut rest, &mut swept);
        // The residual is now −U x.
        matrix.multiply_upper(&swept, &mut rest);
        for block in &mut rest {
            *block = block.map(|entry| -entry);
        }
        self.correct(&rest, &mut swept);
        rest.copy_from_slice(r);
        matrix.subtract_lower(&swept, &mut rest);
        matrix.solve_upper(&self.inverses, &rest, z);
        (self.swept, self.rest) = (swept, rest);
    }
}

/// Aggregate of each block, and how many there are: neighbourhoods that do not
/// touch, then what is left joins one of them.
fn aggregate(n_blocks: usize, pairs: &[[u32; 2]]) -> (Vec<u32>, usize) {
    let neighbours = Lists::of_neighbours(n_blocks, pairs);
    let mut aggregates = vec![NONE; n_blocks];
    let mut n_aggregates = 0;
    for block in 0..n_blocks {
        let around = neighbours.of(block);
        let is_free = |&block: &u32| aggregates[block as usize] == NONE;
        if is_free(&(block as u32)) && around.iter().all(is_free) {
            aggregates[block] = n_aggregates;
            for &neighbour in around {
                aggregates[neighbour as usize] = n_aggregates;
            }
            n_aggregates += 1;
        }
    }
    // Every block that is left has a neighbour in one of these.
    let roots = aggregates.clone();
    for (block, aggregate) in aggregates.iter_mut().enumerate() {
        if *aggregate == NONE {
            let mut around = neighbours.of(block).iter();
            let taken = around.find(|&&neighbour| roots[neighbour as usize] != NONE);
            *aggregate = roots[*taken.expect("a neighbour in an aggregate") as usize];
        }
    }
    (aggregates, n_aggregates as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Interrupt;
    use crate::iterative::{ConjugateGradients, Ending, Until};

    fn grid(side: u32) -> Vec<[u32; 2]> {
        let node = move |i: u32, j: u32| i * side + j;
        let across =
            (0..side).flat_map(move |i| (1..side).map(move |j| [node(i, j - 1), node(i, j)]));
        let along =
            (1..side).flat_map(move |i| (0..side).map(move |j| [node(i - 1, j), node(i, j)]));
        across.chain(along).collect()
    }

    /// Unit springs in all directions and a mass.
    fn membrane(side: u32, mass: f64) -> (Rows<6, 6>, Vec<[u32; 2]>) {
        let pairs = grid(side);
        let n_blocks = (side * side) as usize;
        let identity = |s: f64| [s, 0.0, 0.0, s, 0.0, s];
        let mut diagonal = vec![identity(mass); n_blocks];
        for &block in pairs.as_flattened() {
            add(&mut diagonal[block as usize], identity(1.0));
        }
        let mut rows = Rows::new(n_blocks, &pairs);
        rows.set(&diagonal, &vec![identity(-1.0); pairs.len()]);
        (rows, pairs)
    }

    fn iterations(side: u32, dearest_coarse: f64) -> u64 {
        // What one block feels reaches ten blocks far.
        let (rows, pairs) = membrane(side, 1e-2);
        let n_blocks = rows.n_blocks();
        let mut multilevel = Multilevel::<3, 6, 6>::with_dearest_coarse(
            n_blocks,
            &pairs,
            Options::default(),
            dearest_coarse,
        )
        .unwrap();
        multilevel.set(&rows).unwrap();
        let mut gradients = ConjugateGradients::new(n_blocks);
        for (block, r) in gradients.residual.iter_mut().enumerate() {
            let t = block as f64;
            *r = [t.sin(), (0.1 * t).cos(), 1.0];
        }
        let b = gradients.residual.clone();
        let mut x = vec![[0.0; 3]; n_blocks];
        let until = Until {
            accuracy: 1e-10,
            most_iterations: 1000,
            interrupt: &Interrupt::default(),
        };
        let ending = gradients.solve(&rows, &mut multilevel, until, &mut x);
        assert_eq!(ending, Ending::Converged);
        let mut product = b.clone();
        rows.multiply(&x, &mut product);
        let off = product.as_flattened().iter().zip(b.as_flattened());
        let worst = off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst:e}");
        gradients.iterations
    }

    #[test]
    fn iterations_hardly_grow_with_size() {
        let (small, large) = (iterations(30, 1e9), iterations(120, 1e9));
        assert!(large <= small + small / 2, "{small} and {large}");
    }

    #[test]
    fn a_third_level_converges_too() {
        let (two, three) = (iterations(60, 1e9), iterations(60, 1.0));
        assert!(three <= 3 * two, "{two} and {three}");
    }

    #[test]
    fn everything_is_in_one_aggregate() {
        let (aggregates, n) = aggregate(6, &[[0, 1], [1, 2], [4, 5]]);
        assert_eq!((aggregates, n), (vec![0, 0, 0, 1, 2, 2], 3));
    }

    /// Zero sums of the residual: what conserves momentum.
    #[test]
    fn a_correction_leaves_no_sum_on_any_aggregate() {
        let (rows, pairs) = membrane(12, 1.0);
        let mut multilevel = Multilevel::<3, 6, 6>::new(144, &pairs, Options::default()).unwrap();
        multilevel.set(&rows).unwrap();
        let b: Vec<[f64; 3]> = (0..144).map(|k| [1.0, f64::from(k).sin(), 2.0]).collect();
        let mut x = vec![[0.0; 3]; 144];
        multilevel.correct(&b, &mut x);
        let mut product = b.clone();
        rows.multiply(&x, &mut product);
        let mut sums = vec![[0.0; 3]; 144];
        for ((b, product), &aggregate) in b.iter().zip(&product).zip(&multilevel.aggregates) {
            let rest = std::array::from_fn(|axis| b[axis] - product[axis]);
            add(&mut sums[aggregate as usize], rest);
        }
        assert!(sums.as_flattened().iter().all(|sum| sum.abs() < 1e-12));
    }
}
