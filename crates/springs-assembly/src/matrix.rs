//! The sparse triplet system: symmetric 3 × 3 blocks on a pattern fixed once.

use crate::sorting::sorted_by_rows;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Row and column of each stored entry of a symmetric 3 × 3 block.
pub const PACKED: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Which blocks of a symmetric matrix are stored: the whole diagonal, and one
/// block for each pair of coupled blocks.
#[derive(Clone, Debug)]
pub struct BlockPattern {
    n_blocks: usize,
    pairs: Vec<[u32; 2]>,
}

impl BlockPattern {
    /// The pattern of a list of (row, column) block triplets, and for every
    /// triplet the index of the pair it adds up into.
    ///
    /// Orientation does not matter, duplicates share a pair.
    pub(crate) fn from_triplets(n_blocks: usize, triplets: &[[u32; 2]]) -> (Self, Vec<u32>) {
        let order: Vec<([u32; 2], u32)> = triplets
            .iter()
            .zip(0..)
            .map(|(&[a, b], index)| ([a.min(b), a.max(b)], index))
            .collect();
        let order = sorted_by_rows(&order, n_blocks, |(pair, _)| pair[0] as usize);
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        let mut pair_of_triplet = vec![0; triplets.len()];
        for (pair, index) in order {
            if pairs.last() != Some(&pair) {
                pairs.push(pair);
            }
            pair_of_triplet[index as usize] = pairs.len() as u32 - 1;
        }
        (Self { n_blocks, pairs }, pair_of_triplet)
    }

    /// Number of block rows.
    pub fn n_blocks(&self) -> usize {
        self.n_blocks
    }

    /// The coupled blocks, sorted, the smaller index first, each pair once.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }
}

/// Values on a [`BlockPattern`]. Diagonal blocks are symmetric, six entries each in
/// the order of [`PACKED`].
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    pattern: Arc<BlockPattern>,
    pub(crate) diagonal: Vec<[f64; 6]>,
    pub(crate) off_diagonal: OffDiagonal,
}

/// The blocks off the diagonal, one per pair (a, b) of the pattern: block (a, b),
/// whose transpose is block (b, a).
#[derive(Clone, Debug)]
pub enum OffDiagonal {
    /// Symmetric themselves, because every term acts along or across the line
    /// between two nodes: packed like those on the diagonal.
    Symmetric(Vec<[f64; 6]>),
    /// Any, row by row.
    General(Vec<[f64; 9]>),
}

impl OffDiagonal {
    /// So many blocks of zeros.
    pub fn zeros(n_pairs: usize, is_symmetric: bool) -> Self {
        if is_symmetric {
            Self::Symmetric(vec![[0.0; 6]; n_pairs])
        } else {
            Self::General(vec![[0.0; 9]; n_pairs])
        }
    }

    /// Takes the blocks of some of the pairs of another list of the same kind.
    ///
    /// # Panics
    ///
    /// If that is of the other kind, or has no such pair.
    pub fn take(&mut self, from: &Self, pairs: &[u32]) {
        fn take<B: Copy>(into: &mut [B], from: &[B], pairs: &[u32]) {
            for (block, &pair) in into.iter_mut().zip(pairs) {
                *block = from[pair as usize];
            }
        }
        match (self, from) {
            (Self::Symmetric(into), Self::Symmetric(from)) => take(into, from, pairs),
            (Self::General(into), Self::General(from)) => take(into, from, pairs),
            _ => panic!("blocks of one kind"),
        }
    }
}

/// A block off the diagonal that symmetric ones can be added to.
pub(crate) trait PairBlock: Send {
    /// Subtracts a packed block at both places of a pair.
    fn subtract_symmetric(&mut self, block: &[f64; 6]);
}

impl PairBlock for [f64; 6] {
    #[inline(always)]
    fn subtract_symmetric(&mut self, block: &[f64; 6]) {
        for (entry, value) in self.iter_mut().zip(block) {
            *entry -= value;
        }
    }
}

impl PairBlock for [f64; 9] {
    #[inline(always)]
    fn subtract_symmetric(&mut self, block: &[f64; 6]) {
        for (entry, packed) in self.iter_mut().zip([0, 1, 2, 1, 3, 4, 2, 4, 5]) {
            *entry -= block[packed];
        }
    }
}

impl BlockMatrix {
    pub(crate) fn zeros(pattern: Arc<BlockPattern>, is_symmetric: bool) -> Self {
        let n_pairs = pattern.pairs.len();
        Self {
            diagonal: vec![[0.0; 6]; pattern.n_blocks],
            off_diagonal: OffDiagonal::zeros(n_pairs, is_symmetric),
            pattern,
        }
    }

    /// Its pattern.
    pub fn pattern(&self) -> &BlockPattern {
        &self.pattern
    }

    /// The diagonal blocks, one per block row.
    pub fn diagonal(&self) -> &[[f64; 6]] {
        &self.diagonal
    }

    /// The off-diagonal blocks, one per pair of the pattern.
    pub fn off_diagonal(&self) -> &OffDiagonal {
        &self.off_diagonal
    }

    /// Makes it `weight`·M with the given lumped masses.
    pub(crate) fn set_mass(&mut self, weight: f64, masses: &[f64]) {
        for (block, mass) in self.diagonal.iter_mut().zip(masses) {
            let m = weight * mass;
            *block = [m, 0.0, 0.0, m, 0.0, m];
        }
        match &mut self.off_diagonal {
            OffDiagonal::Symmetric(blocks) => blocks.fill([0.0; 6]),
            OffDiagonal::General(blocks) => blocks.fill([0.0; 9]),
        }
    }

    /// Adds a symmetric block, of which the upper triangle counts, at (row, row).
    ///
    /// # Panics
    ///
    /// If there is no such row.
    pub fn add_diagonal(&mut self, row: u32, block: &Matrix3<f64>) {
        add(
            &mut self.diagonal[row as usize],
            &PACKED.map(|entry| block[entry]),
        );
    }

    /// Adds a block at (`row`, the other block of the pair), and its transpose there.
    /// Where blocks are symmetric, its upper triangle counts.
    ///
    /// # Panics
    ///
    /// If there is no such pair.
    pub fn add_off_diagonal(&mut self, pair: u32, row: u32, block: &Matrix3<f64>) {
        let is_turned = self.pattern.pairs[pair as usize][0] != row;
        match &mut self.off_diagonal {
            OffDiagonal::Symmetric(blocks) => {
                add(
                    &mut blocks[pair as usize],
                    &PACKED.map(|entry| block[entry]),
                );
            }
            OffDiagonal::General(blocks) => {
                let turned = if is_turned { block.transpose() } else { *block };
                // Columns of the transpose are rows.
                let rows = turned.transpose();
                for (entry, value) in blocks[pair as usize].iter_mut().zip(rows.as_slice()) {
                    *entry += value;
                }
            }
        }
    }

    /// Block (a, b) of a pair (a, b), row by row.
    fn whole(&self, pair: usize) -> [f64; 9] {
        match &self.off_diagonal {
            OffDiagonal::Symmetric(blocks) => unpacked(&blocks[pair]),
            OffDiagonal::General(blocks) => blocks[pair],
        }
    }

    /// Every stored scalar of the whole matrix as (row, column, value), both
    /// triangles, diagonal included, each position once.
    pub fn triplets(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let diagonal = self.diagonal.iter().enumerate();
        let diagonal = diagonal.flat_map(|(block, values)| scalars(block, block, unpacked(values)));
        let pairs = self.pattern.pairs.iter().enumerate();
        let off_diagonal = pairs.flat_map(|(pair, ends)| {
            let [a, b] = ends.map(|block| block as usize);
            let block = self.whole(pair);
            scalars(a, b, block).chain(scalars(b, a, transposed(block)))
        });
        diagonal.chain(off_diagonal)
    }

    /// y = A x.
    ///
    /// # Panics
    ///
    /// If `x` or `y` does not have one entry per block row.
    pub fn multiply(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        assert_eq!(x.len(), self.diagonal.len(), "one entry per block row");
        assert_eq!(y.len(), self.diagonal.len(), "one entry per block row");
        for ((y, x), block) in y.iter_mut().zip(x).zip(&self.diagonal) {
            *y = times(block, x);
        }
        for (pair, ends) in self.pattern.pairs.iter().enumerate() {
            let [a, b] = ends.map(|block| block as usize);
            let block = Matrix3::from_row_slice(&self.whole(pair));
            y[a] += block * x[b];
            y[b] += block.tr_mul(&x[a]);
        }
    }
}

/// B x for a packed symmetric block.
#[inline(always)]
pub(crate) fn times(b: &[f64; 6], x: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        b[0] * x.x + b[1] * x.y + b[2] * x.z,
        b[1] * x.x + b[3] * x.y + b[4] * x.z,
        b[2] * x.x + b[4] * x.y + b[5] * x.z,
    )
}

#[inline(always)]
pub(crate) fn add(target: &mut [f64; 6], block: &[f64; 6]) {
    for (entry, value) in target.iter_mut().zip(block) {
        *entry += value;
    }
}

/// A packed symmetric block row by row.
fn unpacked(b: &[f64; 6]) -> [f64; 9] {
    [0, 1, 2, 1, 3, 4, 2, 4, 5].map(|packed| b[packed])
}

fn transposed(b: [f64; 9]) -> [f64; 9] {
    [0, 3, 6, 1, 4, 7, 2, 5, 8].map(|entry| b[entry])
}

/// The nine scalars of the block at (row, column).
fn scalars(
    row: usize,
    column: usize,
    block: [f64; 9],
) -> impl Iterator<Item = (usize, usize, f64)> {
    block
        .into_iter()
        .enumerate()
        .map(move |(k, value)| (3 * row + k / 3, 3 * column + k % 3, value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn duplicates_and_orientation_share_a_pair() {
        let (pattern, pair_of) = BlockPattern::from_triplets(4, &[[2, 0], [1, 3], [0, 2], [0, 1]]);
        assert_eq!(pattern.pairs(), [[0, 1], [0, 2], [1, 3]]);
        assert_eq!(pair_of, [1, 2, 1, 0]);
    }

    #[test]
    fn product_equals_the_dense_product_of_the_triplets() {
        let (pattern, pairs) = BlockPattern::from_triplets(3, &[[0, 1], [2, 1]]);
        for is_symmetric in [true, false] {
            product_equals(
                BlockMatrix::zeros(Arc::new(pattern.clone()), is_symmetric),
                &pairs,
            );
        }
    }

    fn product_equals(mut matrix: BlockMatrix, pairs: &[u32]) {
        matrix.set_mass(2.0, &[1.0, 2.0, 3.0]);
        let symmetric = Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0);
        matrix.add_diagonal(1, &symmetric);
        matrix.add_off_diagonal(pairs[0], 0, &(symmetric * -0.1));
        if let OffDiagonal::General(_) = matrix.off_diagonal() {
            let any = Matrix3::new(7.0, 0.0, 1.0, 2.0, 0.0, 3.0, -4.0, 5.0, -6.0);
            // The pair is stored as (1, 2).
            matrix.add_off_diagonal(pairs[1], 2, &any);
            let there = matrix
                .triplets()
                .find(|(row, column, _)| (*row, *column) == (6, 5));
            assert_eq!(there, Some((6, 5, 1.0)));
        }
        let mut dense = DMatrix::zeros(9, 9);
        for (row, column, value) in matrix.triplets() {
            assert_eq!(dense[(row, column)], 0.0, "each position once");
            dense[(row, column)] = value;
        }
        assert_eq!(dense, dense.transpose());
        let x: Vec<_> = (0..3)
            .map(|k| Vector3::new(1.0 + k as f64, -0.5, 0.25 * k as f64))
            .collect();
        let mut y = vec![Vector3::zeros(); 3];
        matrix.multiply(&x, &mut y);
        let expected = dense * DVector::from_iterator(9, x.iter().flatten().copied());
        let y = DVector::from_iterator(9, y.iter().flatten().copied());
        assert!((y - expected).norm() < 1e-13);
    }
}
