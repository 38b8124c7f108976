//! The graph of blocks.

use crate::SolveError;
use dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::cholesky::simplicial;

/// A symmetric pattern of blocks as the strictly upper triangle, column by
/// column, rows ascending.
pub(crate) struct UpperGraph {
    pub(crate) column_starts: Vec<usize>,
    pub(crate) rows: Vec<usize>,
    /// Which of the given pairs each entry is.
    pub(crate) pairs: Vec<usize>,
}

impl UpperGraph {
    /// The graph of the given pairs after renumbering block b to `position[b]`.
    pub(crate) fn new(position: &[usize], pairs: &[[u32; 2]]) -> Result<Self, SolveError> {
        let n_blocks = position.len();
        let mut entries = Vec::with_capacity(pairs.len());
        for (index, pair) in pairs.iter().enumerate() {
            let pair = pair.map(|block| block as usize);
            if let Some(&block) = pair.iter().find(|&&block| block >= n_blocks) {
                return Err(SolveError::NoSuchBlock {
                    pair: index,
                    block,
                    n_blocks,
                });
            }
            let [a, b] = pair.map(|block| position[block]);
            entries.push((a.max(b), a.min(b), index));
        }
        entries.sort_unstable();
        let twice = entries
            .windows(2)
            .find(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1));
        let looped = entries.iter().find(|entry| entry.0 == entry.1);
        if let Some(entry) = twice.map(|w| &w[1]).or(looped) {
            return Err(SolveError::RepeatedPair { pair: entry.2 });
        }
        let column_starts = (0..=n_blocks)
            .map(|column| entries.partition_point(|entry| entry.0 < column))
            .collect();
        Ok(Self {
            column_starts,
            rows: entries.iter().map(|entry| entry.1).collect(),
            pairs: entries.iter().map(|entry| entry.2).collect(),
        })
    }

    /// Blocks in each column of the factor, the diagonal included.
    pub(crate) fn column_counts(&self) -> Result<Vec<usize>, SolveError> {
        let n = self.n_blocks();
        let (mut tree, mut counts) = (vec![0isize; n], vec![0usize; n]);
        let scratch =
            simplicial::prefactorize_symbolic_cholesky_scratch::<usize>(n, self.rows.len());
        let mut memory =
            MemBuffer::try_new(scratch).map_err(|_| SolveError::TooLarge { n_blocks: n })?;
        let graph =
            SymbolicSparseColMatRef::new_checked(n, n, &self.column_starts, None, &self.rows);
        let stack = MemStack::new(&mut memory);
        simplicial::prefactorize_symbolic_cholesky(&mut tree, &mut counts, graph, stack);
        Ok(counts)
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.column_starts.len() - 1
    }

    /// Entries of one column: ranges into `rows` and `pairs`.
    pub(crate) fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.column_starts[column]..self.column_starts[column + 1]
    }
}
