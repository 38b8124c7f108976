//! Cholesky factorization on a pattern analyzed once.

use crate::SolveError;
use crate::graph::UpperGraph;
use dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::cholesky::{simplicial, supernodal};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};

/// Which kind of factorization the pattern got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Factorization {
    /// Column by column; the ordering leaves no fill.
    Simplicial,
    /// Dense kernels on groups of columns.
    Supernodal,
}

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
    symbolic: Symbolic,
    /// The permuted scalar matrix: upper triangle by columns for the
    /// simplicial code, lower triangle by columns for the supernodal one.
    column_starts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    /// For each scalar of the matrix, in order: the packed entry it copies.
    sources: Vec<Source>,
    factor: Vec<f64>,
    permuted: Vec<f64>,
    memory: MemBuffer,
}

enum Symbolic {
    Simplicial(simplicial::SymbolicSimplicialCholesky<usize>),
    Supernodal(supernodal::SymbolicSupernodalCholesky<usize>),
}

/// Entry `entry` of diagonal block `block`, or of pair `block − n_blocks`.
#[derive(Clone, Copy)]
struct Source {
    block: u32,
    entry: u8,
}

/// Position of (row, column) of a symmetric block in its packed form.
const fn packed_entry(row: usize, column: usize) -> u8 {
    [[0, 1, 2], [1, 3, 4], [2, 4, 5]][row][column]
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
        let too_large = SolveError::TooLarge { n_blocks };
        let (order, graph) = UpperGraph::ordered(n_blocks, pairs)?;
        let upper = BlockTriangle::upper(&graph, &order).expand(|row, column| row <= column);
        let n = 3 * n_blocks;
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &upper.column_starts, None, &upper.rows);
        let mut tree = vec![0isize; n];
        let mut counts = vec![0usize; n];
        let scratch = StackReq::any_of(&[
            simplicial::prefactorize_symbolic_cholesky_scratch::<usize>(n, upper.rows.len()),
            simplicial::factorize_simplicial_symbolic_cholesky_scratch::<usize>(n),
            supernodal::factorize_supernodal_symbolic_cholesky_scratch::<usize>(n),
        ]);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large)?;
        let stack = MemStack::new(&mut memory);
        let tree =
            simplicial::prefactorize_symbolic_cholesky(&mut tree, &mut counts, pattern, stack);
        let has_fill = counts.iter().sum::<usize>() > upper.rows.len();

        let (symbolic, scalars, scratch, length) = if has_fill {
            let symbolic = supernodal::factorize_supernodal_symbolic_cholesky(
                pattern,
                tree,
                &counts,
                stack,
                SymbolicSupernodalParams::default(),
            )
            .map_err(|_| too_large)?;
            let scratch = supernodal::factorize_supernodal_numeric_llt_scratch::<usize, f64>(
                &symbolic,
                Par::Seq,
                Default::default(),
            )
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
            let length = symbolic.len_val();
            let lower = BlockTriangle::lower(&graph, &order).expand(|row, column| row >= column);
            (Symbolic::Supernodal(symbolic), lower, scratch, length)
        } else {
            let symbolic =
                simplicial::factorize_simplicial_symbolic_cholesky(pattern, tree, &counts, stack)
                    .map_err(|_| too_large)?;
            let scratch = simplicial::factorize_simplicial_numeric_llt_scratch::<usize, f64>(n);
            let length = symbolic.len_val();
            (Symbolic::Simplicial(symbolic), upper, scratch, length)
        };
        Ok(Self {
            order,
            symbolic,
            values: vec![0.0; scalars.rows.len()],
            column_starts: scalars.column_starts,
            rows: scalars.rows,
            sources: scalars.sources,
            factor: zeros(length).ok_or(too_large)?,
            permuted: vec![0.0; n],
            memory: MemBuffer::try_new(scratch).map_err(|_| too_large)?,
        })
    }

    /// Size of the factor of such a pattern, counted on the graph of blocks.
    ///
    /// # Errors
    ///
    /// As [`Self::analyze`].
    pub fn count(n_blocks: usize, pairs: &[[u32; 2]]) -> Result<FactorSize, SolveError> {
        let (_, graph) = UpperGraph::ordered(n_blocks, pairs)?;
        let mut size = FactorSize::default();
        for blocks in graph.column_counts()? {
            let column = 3.0 * blocks as f64;
            size.entries += 3.0 * column;
            size.flops += 3.0 * column * column;
        }
        Ok(size)
    }

    /// Number of block rows.
    pub fn n_blocks(&self) -> usize {
        self.order.len()
    }

    /// Which kind of factorization is used.
    pub fn factorization(&self) -> Factorization {
        match self.symbolic {
            Symbolic::Simplicial(_) => Factorization::Simplicial,
            Symbolic::Supernodal(_) => Factorization::Supernodal,
        }
    }

    /// Number of stored entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.factor.len()
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
        let n_pairs = (self.sources.len() - 6 * n_blocks) / 9;
        assert_eq!(diagonal.len(), n_blocks, "one diagonal block per row");
        assert_eq!(off_diagonal.len(), n_pairs, "one block per pair");
        for (value, source) in self.values.iter_mut().zip(&self.sources) {
            let block = source.block as usize;
            let blocks = match block.checked_sub(n_blocks) {
                None => &diagonal[block],
                Some(pair) => &off_diagonal[pair],
            };
            *value = blocks[source.entry as usize];
        }
        let n = 3 * n_blocks;
        let pattern = SymbolicSparseColMatRef::new_unsorted_checked(
            n,
            n,
            &self.column_starts,
            None,
            &self.rows,
        );
        let matrix = SparseColMatRef::new(pattern, &self.values);
        let stack = MemStack::new(&mut self.memory);
        // The simplicial code counts the failing column from 1, the supernodal
        // one from 0.
        let (result, first) = match &self.symbolic {
            Symbolic::Simplicial(symbolic) => {
                let result = simplicial::factorize_simplicial_numeric_llt(
                    &mut self.factor,
                    matrix,
                    Default::default(),
                    symbolic,
                    stack,
                );
                (result, 1)
            }
            Symbolic::Supernodal(symbolic) => {
                let result = supernodal::factorize_supernodal_numeric_llt(
                    &mut self.factor,
                    matrix,
                    Default::default(),
                    symbolic,
                    Par::Seq,
                    stack,
                    Default::default(),
                );
                (result, 0)
            }
        };
        result
            .map(|_| ())
            .map_err(|LltError::NonPositivePivot { index }| {
                let block = self.order[(index - first) / 3];
                SolveError::NotPositiveDefinite { block }
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
        let n = 3 * blocks.len();
        let x = MatMut::from_column_major_slice_mut(&mut self.permuted, n, 1);
        let stack = MemStack::new(&mut self.memory);
        match &self.symbolic {
            Symbolic::Simplicial(symbolic) => {
                simplicial::SimplicialLltRef::new(symbolic, &self.factor).solve_in_place_with_conj(
                    Conj::No,
                    x,
                    Par::Seq,
                    stack,
                );
            }
            Symbolic::Supernodal(symbolic) => {
                supernodal::SupernodalLltRef::new(symbolic, &self.factor).solve_in_place_with_conj(
                    Conj::No,
                    x,
                    Par::Seq,
                    stack,
                );
            }
        }
        let (permuted, _) = self.permuted.as_chunks::<3>();
        for (source, &block) in permuted.iter().zip(&self.order) {
            blocks[block] = *source;
        }
    }
}

/// Zeroed storage, or `None` if there is not enough memory.
fn zeros(length: usize) -> Option<Vec<f64>> {
    let mut values = Vec::new();
    values.try_reserve_exact(length).ok()?;
    values.resize(length, 0.0);
    Some(values)
}

/// One triangle of the permuted block matrix, diagonal included, by columns:
/// the row of each block and the block of the caller that it copies.
struct BlockTriangle {
    column_starts: Vec<usize>,
    entries: Vec<(usize, u32)>,
}

impl BlockTriangle {
    fn upper(graph: &UpperGraph, order: &[usize]) -> Self {
        let mut triangle = Self::with_capacity(graph);
        for column in 0..order.len() {
            let range = graph.column(column);
            let pairs = graph.pairs[range.clone()].iter();
            let pairs = pairs.map(|&pair| (order.len() + pair) as u32);
            let above = graph.rows[range].iter().copied().zip(pairs);
            triangle.entries.extend(above);
            triangle.entries.push((column, order[column] as u32));
            triangle.column_starts.push(triangle.entries.len());
        }
        triangle
    }

    /// The transpose of [`Self::upper`].
    fn lower(graph: &UpperGraph, order: &[usize]) -> Self {
        let upper = Self::upper(graph, order);
        let mut column_starts = vec![0; order.len() + 1];
        for &(row, _) in &upper.entries {
            column_starts[row + 1] += 1;
        }
        for column in 0..order.len() {
            column_starts[column + 1] += column_starts[column];
        }
        let mut next = column_starts.clone();
        let mut entries = vec![(0, 0); upper.entries.len()];
        // The diagonal is the last of an upper column, so ascending columns
        // put it first in every lower one.
        for column in 0..order.len() {
            for &(row, block) in upper.column(column) {
                entries[next[row]] = (column, block);
                next[row] += 1;
            }
        }
        Self {
            column_starts,
            entries,
        }
    }

    fn with_capacity(graph: &UpperGraph) -> Self {
        let mut column_starts = Vec::with_capacity(graph.n_blocks() + 1);
        column_starts.push(0);
        Self {
            column_starts,
            entries: Vec::with_capacity(graph.n_blocks() + graph.rows.len()),
        }
    }

    fn column(&self, column: usize) -> &[(usize, u32)] {
        &self.entries[self.column_starts[column]..self.column_starts[column + 1]]
    }

    /// Expands blocks to scalars; `keep` says which scalars (row and column) of
    /// a diagonal block belong to the triangle.
    fn expand(&self, keep: impl Fn(usize, usize) -> bool) -> Scalars {
        let length = 9 * self.entries.len();
        let mut scalars = Scalars {
            column_starts: Vec::with_capacity(3 * self.column_starts.len()),
            rows: Vec::with_capacity(length),
            sources: Vec::with_capacity(length),
        };
        scalars.column_starts.push(0);
        for block_column in 0..self.column_starts.len() - 1 {
            for column in 0..3 {
                for &(block_row, block) in self.column(block_column) {
                    for row in 0..3 {
                        if block_row != block_column || keep(row, column) {
                            let entry = packed_entry(row, column);
                            scalars.rows.push(3 * block_row + row);
                            scalars.sources.push(Source { block, entry });
                        }
                    }
                }
                scalars.column_starts.push(scalars.rows.len());
            }
        }
        scalars
    }
}

/// A triangle of the permuted scalar matrix and where its values come from.
struct Scalars {
    column_starts: Vec<usize>,
    rows: Vec<usize>,
    sources: Vec<Source>,
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
                    let entry = packed_entry(r, c) as usize;
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
            (1, vec![], Factorization::Simplicial),
            (40, chain(40), Factorization::Simplicial),
            (50, tree(50), Factorization::Simplicial),
            (64, grid(8), Factorization::Supernodal),
        ];
        for (n_blocks, pairs, kind) in cases {
            let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
            let dense = dense(&pairs, &diagonal, &off_diagonal);
            let expected = DVector::from_fn(3 * n_blocks, |row, _| (row as f64).cos());
            let mut x: Vec<f64> = (&dense * &expected).iter().copied().collect();
            let mut cholesky = SparseCholesky::analyze(n_blocks, &pairs).unwrap();
            assert_eq!(cholesky.factorization(), kind);
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
    fn without_fill_the_factor_is_as_sparse_as_the_matrix() {
        for pairs in [chain(200), tree(200)] {
            let cholesky = SparseCholesky::analyze(200, &pairs).unwrap();
            assert_eq!(cholesky.factor_entries(), 200 * 6 + 199 * 9);
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
        let size = SparseCholesky::count(10, &chain(10)).unwrap();
        assert_eq!(size.flops, 9.0 * 3.0 * 36.0 + 3.0 * 9.0);
        assert_eq!(size.entries, 9.0 * 18.0 + 9.0);
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
