//! Cholesky factorization on a pattern analyzed once.

use crate::SolveError;
use crate::dissection::nested_dissection;
use crate::fronts::{Elimination, Fronts};
use crate::graph::minimum_degree;
use crate::mixed::Mixed;
use crate::multifrontal::{Layout, Multifrontal, NotPositive};
use crate::tree::Tree;

/// How much a factorization is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FactorSize {
    /// Entries of the factor, whole blocks counted.
    pub entries: f64,
    /// Multiplications and additions.
    pub flops: f64,
}

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
    /// What the factor is made of.
    pub precision: Precision,
}

impl Default for Options<'_> {
    /// One thread, double precision.
    fn default() -> Self {
        Self {
            positions: None,
            threads: 1,
            precision: Precision::Double,
        }
    }
}

/// What the factor is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Double precision; each solution takes one substitution.
    Double,
    /// Single precision; conjugate gradients in double precision, with the
    /// factor as preconditioner, bring each solution to 1e-11.
    Mixed,
    /// `Mixed` where the factorization takes long enough for that to pay.
    Auto,
}

/// A factorization P A Pᵀ = L Lᵀ of matrices with one pattern.
pub struct SparseCholesky {
    /// Block of the caller at each position of the elimination order.
    order: Vec<usize>,
    pairs: Vec<[u32; 2]>,
    fronts: Fronts,
    threads: usize,
    /// In place of all others where there is no fill.
    tree: Option<Tree>,
    /// Allocated when it is first needed.
    double: Option<Double>,
    mixed: Option<Mixed>,
    /// Whether the last factor is the double one.
    is_double: bool,
}

/// A factor in double precision.
struct Double {
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
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block.
    pub fn analyze(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<Self, SolveError> {
        let elimination = best_elimination(n_blocks, pairs, options.positions)?;
        let mut cholesky = Self {
            fronts: Fronts::new(&elimination),
            pairs: pairs.to_vec(),
            threads: options.threads,
            tree: Tree::new(&elimination),
            double: None,
            mixed: None,
            is_double: true,
            order: elimination.order,
        };
        if cholesky.tree.is_some() {
            return Ok(cholesky);
        }
        match is_mixed(&cholesky.fronts, options.precision) {
            true => {
                let mixed = Mixed::new(&cholesky.fronts, n_blocks, pairs.len(), options.threads);
                cholesky.mixed = Some(mixed.ok_or(SolveError::TooLarge { n_blocks })?);
            }
            false => cholesky.double = Some(cholesky.allocate_double()?),
        }
        Ok(cholesky)
    }

    fn allocate_double(&self) -> Result<Double, SolveError> {
        let n_blocks = self.n_blocks();
        let factor = Multifrontal::new(&self.fronts, self.threads);
        Ok(Double {
            factor: factor.ok_or(SolveError::TooLarge { n_blocks })?,
            blocks: vec![[0.0; 6]; n_blocks + self.pairs.len()],
            permuted: vec![0.0; 3 * n_blocks],
        })
    }

    /// Size of the factor of such a pattern, counted on the graph of blocks.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block.
    pub fn count(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        positions: Option<&[[f64; 3]]>,
    ) -> Result<FactorSize, SolveError> {
        Ok(best_elimination(n_blocks, pairs, positions)?.size())
    }

    /// Memory, in bytes, that a factorization with these options will take, with
    /// the matrix that it keeps; nothing of it is allocated.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block.
    pub fn memory(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
    ) -> Result<u64, SolveError> {
        let elimination = best_elimination(n_blocks, pairs, options.positions)?;
        if let Some(tree) = Tree::new(&elimination) {
            return Ok(tree.memory());
        }
        let fronts = Fronts::new(&elimination);
        let layout = Layout::new(&fronts).ok_or(SolveError::TooLarge { n_blocks })?;
        let size = layout.total_size(options.threads) as u64;
        let blocks = (n_blocks + pairs.len()) as u64;
        Ok(match is_mixed(&fronts, options.precision) {
            // The matrix in both precisions, and vectors.
            true => 4 * size + 72 * blocks + 150 * n_blocks as u64,
            false => 8 * size + 48 * blocks + 24 * n_blocks as u64,
        })
    }

    /// Number of block rows.
    pub fn n_blocks(&self) -> usize {
        self.order.len()
    }

    /// Factorizes the matrix with the given blocks, each packed as
    /// (xx, xy, xz, yy, yz, zz).
    ///
    /// Where single precision finds the matrix indefinite, double precision
    /// decides.
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
        assert_eq!(off_diagonal.len(), self.pairs.len(), "one block per pair");
        if let Some(tree) = &mut self.tree {
            let done = tree.factorize(diagonal, off_diagonal);
            return done.map_err(|failure| self.not_positive(failure));
        }
        if let Some(mixed) = &mut self.mixed {
            mixed.set(&self.pairs, diagonal, off_diagonal);
            if mixed.factorize(&self.fronts).is_ok() {
                self.is_double = false;
                return Ok(());
            }
        }
        self.factorize_double(diagonal, off_diagonal)
    }

    fn factorize_double(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; 6]],
    ) -> Result<(), SolveError> {
        let n_blocks = self.n_blocks();
        if self.double.is_none() {
            self.double = Some(self.allocate_double()?);
        }
        let double = self.double.as_mut().expect("allocated");
        self.is_double = true;
        double.blocks[..n_blocks].copy_from_slice(diagonal);
        double.blocks[n_blocks..].copy_from_slice(off_diagonal);
        let done = double.factor.factorize(&self.fronts, &double.blocks);
        done.map_err(|failure| self.not_positive(failure))
    }

    fn not_positive(&self, failure: NotPositive) -> SolveError {
        SolveError::NotPositiveDefinite {
            block: self.order[failure.column],
        }
    }

    /// Replaces b in `rhs` by the solution of A x = b, with the A of the last
    /// successful [`Self::factorize`].
    ///
    /// # Errors
    ///
    /// If conjugate gradients stall, and double precision finds the matrix
    /// indefinite.
    ///
    /// # Panics
    ///
    /// If `rhs` does not have three entries per block row.
    pub fn solve_in_place(&mut self, rhs: &mut [f64]) -> Result<(), SolveError> {
        let (blocks, rest) = rhs.as_chunks_mut::<3>();
        assert!(
            rest.is_empty() && blocks.len() == self.order.len(),
            "three entries per block row"
        );
        if let Some(tree) = &mut self.tree {
            tree.solve_in_place(blocks);
            return Ok(());
        }
        if let (false, Some(mixed)) = (self.is_double, &mut self.mixed) {
            if mixed.solve(&self.fronts, &self.order, &self.pairs, blocks) {
                return Ok(());
            }
            let (diagonal, off_diagonal) = mixed.take_matrix();
            let done = self.factorize_double(&diagonal, &off_diagonal);
            if let Some(mixed) = &mut self.mixed {
                mixed.give_back(diagonal, off_diagonal);
            }
            done?;
        }
        let double = self.double.as_mut().expect("a factor");
        let (permuted, _) = double.permuted.as_chunks_mut::<3>();
        for (target, &block) in permuted.iter_mut().zip(&self.order) {
            *target = blocks[block];
        }
        double
            .factor
            .solve_in_place(&self.fronts, &mut double.permuted);
        let (permuted, _) = double.permuted.as_chunks::<3>();
        for (source, &block) in permuted.iter().zip(&self.order) {
            blocks[block] = *source;
        }
        Ok(())
    }
}

/// Factorizations below this many operations are not worth single precision.
const WORTH_MIXING: f64 = 1e9;

fn is_mixed(fronts: &Fronts, precision: Precision) -> bool {
    match precision {
        Precision::Double => false,
        Precision::Mixed => true,
        Precision::Auto => fronts.total_flops() > WORTH_MIXING,
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

    fn complete(n: u32) -> Vec<[u32; 2]> {
        (0..n).flat_map(|b| (0..b).map(move |a| [a, b])).collect()
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
            // One front of several tiles.
            (150, complete(150)),
        ];
        for (n_blocks, pairs) in cases {
            let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
            let dense = dense(&pairs, &diagonal, &off_diagonal);
            let expected = DVector::from_fn(3 * n_blocks, |row, _| (row as f64).cos());
            let mut x: Vec<f64> = (&dense * &expected).iter().copied().collect();
            let mut cholesky =
                SparseCholesky::analyze(n_blocks, &pairs, Options::default()).unwrap();
            // Twice, to see that nothing is left over from the first time.
            for _ in 0..2 {
                cholesky.factorize(&diagonal, &off_diagonal).unwrap();
            }
            cholesky.solve_in_place(&mut x).unwrap();
            let error = (DVector::from_vec(x) - expected).amax();
            // No eigenvalue is below 1, so this is a bound of the condition.
            let condition = dense
                .row_iter()
                .map(|row| row.lp_norm(1))
                .fold(0.0, f64::max);
            let rounding = 8.0 * f64::EPSILON * condition;
            assert!(
                error < rounding,
                "{n_blocks} blocks: {error:e} > {rounding:e}"
            );
        }
    }

    #[test]
    fn a_non_positive_pivot_names_its_block() {
        for (n_blocks, pairs) in [(30, chain(30)), (49, grid(7))] {
            let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
            let mut cholesky =
                SparseCholesky::analyze(n_blocks, &pairs, Options::default()).unwrap();
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

    /// Also at a condition number that single precision alone cannot have.
    #[test]
    fn mixed_precision_solves_as_well_as_double() {
        let pairs = grid(30);
        let options = Options {
            precision: Precision::Mixed,
            ..Options::default()
        };
        for stiffness in [1.0, 1e4, 1e8] {
            let (mut diagonal, mut off_diagonal) = matrix(900, &pairs);
            for block in &mut off_diagonal {
                *block = block.map(|value| stiffness * value);
            }
            for block in &mut diagonal {
                let [xx, xy, xz, yy, yz, zz] = block.map(|value| stiffness * value);
                *block = [xx + 1.0, xy, xz, yy + 1.0, yz, zz + 1.0];
            }
            let expected: Vec<f64> = (0..2700).map(|row| f64::from(row).cos()).collect();
            let product =
                dense(&pairs, &diagonal, &off_diagonal) * DVector::from_column_slice(&expected);
            let mut x: Vec<f64> = product.iter().copied().collect();
            let mut cholesky = SparseCholesky::analyze(900, &pairs, options).unwrap();
            cholesky.factorize(&diagonal, &off_diagonal).unwrap();
            cholesky.solve_in_place(&mut x).unwrap();
            let differences = x.iter().zip(&expected).map(|(a, b)| (a - b).abs());
            let error = differences.fold(0.0, f64::max);
            assert!(error < 1e-9, "{stiffness:e}: {error:e}");
        }
    }

    /// Single precision takes it for definite; double precision knows better.
    #[test]
    fn double_precision_decides_what_is_definite() {
        let options = Options {
            precision: Precision::Mixed,
            ..Options::default()
        };
        let mut cholesky = SparseCholesky::analyze(2, &[[0, 1]], options).unwrap();
        // [1 1; 1 1 + e] in each direction, e = ±1e-9.
        let matrix = |e: f64| {
            let identity = |s: f64| [s, 0.0, 0.0, s, 0.0, s];
            ([identity(1.0), identity(1.0 + e)], [identity(1.0)])
        };
        let (diagonal, off_diagonal) = matrix(1e-9);
        cholesky.factorize(&diagonal, &off_diagonal).unwrap();
        let (diagonal, off_diagonal) = matrix(-1e-9);
        assert!(cholesky.factorize(&diagonal, &off_diagonal).is_err());
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let mut pairs = grid(60);
        // A corner where everything is coupled: a front of several tiles.
        let corner = complete(150)
            .into_iter()
            .filter(|pair| !pairs.contains(pair));
        let corner: Vec<[u32; 2]> = corner.collect();
        pairs.retain(|pair| !corner.contains(&[pair[1], pair[0]]));
        pairs.extend(corner);
        let (diagonal, off_diagonal) = matrix(3600, &pairs);
        let positions: Vec<[f64; 3]> = (0..3600)
            .map(|block| [f64::from(block % 60), f64::from(block / 60), 0.0])
            .collect();
        let solution = |precision, threads| {
            let options = Options {
                positions: Some(&positions),
                threads,
                precision,
            };
            let mut cholesky = SparseCholesky::analyze(3600, &pairs, options).unwrap();
            cholesky.factorize(&diagonal, &off_diagonal).unwrap();
            let mut x: Vec<f64> = (0..3 * 3600).map(|row| f64::from(row).sin()).collect();
            cholesky.solve_in_place(&mut x).unwrap();
            x
        };
        for precision in [Precision::Double, Precision::Mixed] {
            let alone = solution(precision, 1);
            for threads in [2, 3, 8] {
                let together = solution(precision, threads);
                assert_eq!(alone, together, "{precision:?}, {threads} threads");
            }
        }
    }

    #[test]
    fn an_empty_system_is_solved() {
        let mut cholesky = SparseCholesky::analyze(0, &[], Options::default()).unwrap();
        cholesky.factorize(&[], &[]).unwrap();
        cholesky.solve_in_place(&mut []).unwrap();
    }

    #[test]
    fn bad_patterns_are_refused() {
        let error = |pairs: &[[u32; 2]]| {
            SparseCholesky::analyze(3, pairs, Options::default())
                .err()
                .unwrap()
        };
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
