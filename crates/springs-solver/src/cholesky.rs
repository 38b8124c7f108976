//! Cholesky factorization on a pattern analyzed once.

use crate::SolveError;
use crate::dissection::nested_dissection;
use crate::fronts::{Elimination, Fronts};
use crate::graph::minimum_degree;
use crate::multifrontal::Multifrontal;

/// How much a factorization is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FactorSize {
    /// Entries of the factor, whole blocks counted.
    pub entries: f64,
    /// Multiplications and additions.
    pub flops: f64,
}

/// A factorization P A Pᵀ = L Lᵀ of matrices with one pattern.
pub struct SparseCholesky {
    /// Block of the caller at each position of the elimination order.
    order: Vec<usize>,
    n_pairs: usize,
    fronts: Fronts,
    factor: Multifrontal<f64>,
    blocks: Vec<[f64; 6]>,
    permuted: Vec<f64>,
}

impl SparseCholesky {
    /// Orders and factorizes symbolically.
    ///
    /// `pairs` are the coupled blocks, each pair once, in the order in which
    /// [`Self::factorize`] will get their values.
    ///
    /// # Errors
    ///
    /// If a pair is not two different blocks below `n_blocks` or stands twice,
    /// or if the factor cannot be stored.
    pub fn analyze(n_blocks: usize, pairs: &[[u32; 2]]) -> Result<Self, SolveError> {
        Self::analyze_at(n_blocks, pairs, None, 1)
    }

    /// The same, with a position in space for every block, which may lead to a
    /// better order: minimum degree and nested dissection are compared by the
    /// operations they take. Up to `threads` threads are used; the results are
    /// the same to the last bit for any number of them.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    ///
    /// # Panics
    ///
    /// If there is not one position per block.
    pub fn analyze_at(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        positions: Option<&[[f64; 3]]>,
        threads: usize,
    ) -> Result<Self, SolveError> {
        let elimination = best_elimination(n_blocks, pairs, positions)?;
        let fronts = Fronts::new(&elimination);
        let factor =
            Multifrontal::new(&fronts, threads).ok_or(SolveError::TooLarge { n_blocks })?;
        Ok(Self {
            order: elimination.order,
            n_pairs: pairs.len(),
            factor,
            fronts,
            blocks: vec![[0.0; 6]; n_blocks + pairs.len()],
            permuted: vec![0.0; 3 * n_blocks],
        })
    }

    /// Size of the factor of such a pattern, counted on the graph of blocks.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    pub fn count(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        positions: Option<&[[f64; 3]]>,
    ) -> Result<FactorSize, SolveError> {
        Ok(best_elimination(n_blocks, pairs, positions)?.size())
    }

    /// Number of block rows.
    pub fn n_blocks(&self) -> usize {
        self.order.len()
    }

    /// Number of stored entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.factor.entries()
    }

    /// Factorizes the matrix with the given blocks, each packed as
    /// (xx, xy, xz, yy, yz, zz).
    ///
    /// # Errors
    ///
    /// If the matrix is not positive definite; the factor is then unusable
    /// until the next success.
    ///
    /// # Panics
    ///
    /// If there is not one diagonal block per block row and one off-diagonal
    /// block per pair.
    pub fn factorize(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; 6]],
    ) -> Result<(), SolveError> {
        let n_blocks = self.n_blocks();
        assert_eq!(diagonal.len(), n_blocks, "one diagonal block per row");
        assert_eq!(off_diagonal.len(), self.n_pairs, "one block per pair");
        self.blocks[..n_blocks].copy_from_slice(diagonal);
        self.blocks[n_blocks..].copy_from_slice(off_diagonal);
        let done = self.factor.factorize(&self.fronts, &self.blocks);
        done.map_err(|failure| SolveError::NotPositiveDefinite {
            block: self.order[failure.column],
        })
    }

    /// Replaces b in `rhs` by the solution of A x = b, with the A of the last
    /// successful [`Self::factorize`].
    ///
    /// # Panics
    ///
    /// If `rhs` does not have three entries per block row.
    pub fn solve_in_place(&mut self, rhs: &mut [f64]) {
        let (blocks, rest) = rhs.as_chunks_mut::<3>();
        assert!(
            rest.is_empty() && blocks.len() == self.order.len(),
            "three entries per block row"
        );
        let (permuted, _) = self.permuted.as_chunks_mut::<3>();
        for (target, &block) in permuted.iter_mut().zip(&self.order) {
            *target = blocks[block];
        }
        self.factor.solve_in_place(&self.fronts, &mut self.permuted);
        let (permuted, _) = self.permuted.as_chunks::<3>();
        for (source, &block) in permuted.iter().zip(&self.order) {
            blocks[block] = *source;
        }
    }
}

/// Factorizations below this many operations are not worth a second order.
const WORTH_DISSECTION: f64 = 1e7;

/// The order that takes the fewest operations.
fn best_elimination(
    n_blocks: usize,
    pairs: &[[u32; 2]],
    positions: Option<&[[f64; 3]]>,
) -> Result<Elimination, SolveError> {
    let minimum = Elimination::new(&minimum_degree(n_blocks, pairs)?, pairs)?;
    let Some(positions) = positions.filter(|_| minimum.size().flops > WORTH_DISSECTION) else {
        return Ok(minimum);
    };
    assert_eq!(positions.len(), n_blocks, "one position per block");
    let dissected = Elimination::new(&nested_dissection(pairs, positions)?, pairs)?;
    match dissected.size().flops < minimum.size().flops {
        true => Ok(dissected),
        false => Ok(minimum),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A positive definite matrix: for every pair a block B that couples as
    /// [[B, −B], [−B, B]], and the identity.
    fn matrix(n_blocks: usize, pairs: &[[u32; 2]]) -> (Vec<[f64; 6]>, Vec<[f64; 6]>) {
        let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; n_blocks];
        let mut off_diagonal = Vec::new();
        for (index, pair) in pairs.iter().enumerate() {
            let u = [1.0, (index as f64).sin(), (2.0 * index as f64).cos()];
            let k = 10.0 + index as f64;
            let block =
                [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|(r, c)| k * u[r] * u[c]);
            for &end in pair {
                for (entry, value) in diagonal[end as usize].iter_mut().zip(block) {
                    *entry += value;
                }
            }
            off_diagonal.push(block.map(|value| -value));
        }
        (diagonal, off_diagonal)
    }

    fn dense(pairs: &[[u32; 2]], diagonal: &[[f64; 6]], off_diagonal: &[[f64; 6]]) -> DMatrix<f64> {
        let n = 3 * diagonal.len();
        let mut dense = DMatrix::zeros(n, n);
        let mut put = |row: usize, column: usize, block: &[f64; 6]| {
            for r in 0..3 {
                for c in 0..3 {
                    let entry = [[0, 1, 2], [1, 3, 4], [2, 4, 5]][r][c];
                    dense[(3 * row + r, 3 * column + c)] = block[entry];
                }
            }
        };
        for (row, block) in diagonal.iter().enumerate() {
            put(row, row, block);
        }
        for (&[a, b], block) in pairs.iter().zip(off_diagonal) {
            put(a as usize, b as usize, block);
            put(b as usize, a as usize, block);
        }
        dense
    }

    fn grid(n: u32) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let node = j * n + i;
                if i + 1 < n {
                    pairs.push([node + 1, node]);
                }
                if j + 1 < n {
                    pairs.push([node, node + n]);
                }
            }
        }
        pairs
    }

    fn chain(n: u32) -> Vec<[u32; 2]> {
        (1..n).map(|node| [node - 1, node]).collect()
    }

    fn tree(n: u32) -> Vec<[u32; 2]> {
        (1..n).map(|node| [(node - 1) / 3, node]).collect()
    }

    #[test]
    fn solutions_equal_dense_ones() {
        let cases = [
            (1, vec![]),
            (40, chain(40)),
            (50, tree(50)),
            (64, grid(8)),
            (900, grid(30)),
        ];
        for (n_blocks, pairs) in cases {
            let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
            let dense = dense(&pairs, &diagonal, &off_diagonal);
            let expected = DVector::from_fn(3 * n_blocks, |row, _| (row as f64).cos());
            let mut x: Vec<f64> = (&dense * &expected).iter().copied().collect();
            let mut cholesky = SparseCholesky::analyze(n_blocks, &pairs).unwrap();
            // Twice, to see that nothing is left over from the first time.
            for _ in 0..2 {
                cholesky.factorize(&diagonal, &off_diagonal).unwrap();
            }
            cholesky.solve_in_place(&mut x);
            let error = (DVector::from_vec(x) - expected).amax();
            assert!(error < 1e-11, "{n_blocks} blocks: {error:e}");
        }
    }

    #[test]
    fn a_non_positive_pivot_names_its_block() {
        for (n_blocks, pairs) in [(30, chain(30)), (49, grid(7))] {
            let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
            let mut cholesky = SparseCholesky::analyze(n_blocks, &pairs).unwrap();
            for block in [0, 7, n_blocks - 1] {
                for entry in [0, 3, 5] {
                    for bad in [-1e9, f64::NAN] {
                        let mut diagonal = diagonal.clone();
                        diagonal[block][entry] = bad;
                        let error = cholesky.factorize(&diagonal, &off_diagonal).unwrap_err();
                        if bad < 0.0 {
                            assert_eq!(error, SolveError::NotPositiveDefinite { block });
                        }
                    }
                }
            }
            assert!(cholesky.factorize(&diagonal, &off_diagonal).is_ok());
        }
    }

    #[test]
    fn the_size_of_the_factor_is_counted() {
        // A chain: each of the columns but the last has two blocks.
        let size = SparseCholesky::count(10, &chain(10), None).unwrap();
        assert_eq!(size.flops, 9.0 * 3.0 * 36.0 + 3.0 * 9.0);
        assert_eq!(size.entries, 9.0 * 18.0 + 9.0);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let pairs = grid(60);
        let (diagonal, off_diagonal) = matrix(3600, &pairs);
        let positions: Vec<[f64; 3]> = (0..3600)
            .map(|block| [f64::from(block % 60), f64::from(block / 60), 0.0])
            .collect();
        let solution = |threads| {
            let mut cholesky =
                SparseCholesky::analyze_at(3600, &pairs, Some(&positions), threads).unwrap();
            cholesky.factorize(&diagonal, &off_diagonal).unwrap();
            let mut x: Vec<f64> = (0..3 * 3600).map(|row| f64::from(row).sin()).collect();
            cholesky.solve_in_place(&mut x);
            x
        };
        let alone = solution(1);
        for threads in [2, 3, 8] {
            assert_eq!(alone, solution(threads), "{threads} threads");
        }
    }

    #[test]
    fn an_empty_system_is_solved() {
        let mut cholesky = SparseCholesky::analyze(0, &[]).unwrap();
        cholesky.factorize(&[], &[]).unwrap();
        cholesky.solve_in_place(&mut []);
    }

    #[test]
    fn bad_patterns_are_refused() {
        let error = |pairs: &[[u32; 2]]| SparseCholesky::analyze(3, pairs).err().unwrap();
        let (pair, block, n_blocks) = (1, 3, 3);
        assert_eq!(
            error(&[[0, 1], [3, 1]]),
            SolveError::NoSuchBlock {
                pair,
                block,
                n_blocks
            }
        );
        assert_eq!(error(&[[0, 1], [2, 2]]), SolveError::RepeatedPair { pair });
        assert_eq!(error(&[[0, 1], [1, 0]]), SolveError::RepeatedPair { pair });
    }
}
