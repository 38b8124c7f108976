//! The sparse triplet system: symmetric 3 × 3 blocks on a pattern fixed once.

use nalgebra::Vector3;
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
        let mut order: Vec<([u32; 2], u32)> = triplets
            .iter()
            .zip(0..)
            .map(|(&[a, b], index)| ([a.min(b), a.max(b)], index))
            .collect();
        order.sort_unstable();
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

/// Values on a [`BlockPattern`]: symmetric blocks, six entries each in the
/// order of [`PACKED`].
///
/// Off-diagonal blocks are symmetric too, because every term acts along or
/// across the line between two nodes; so block (i, j) also stands at (j, i).
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    pattern: Arc<BlockPattern>,
    diagonal: Vec<[f64; 6]>,
    off_diagonal: Vec<[f64; 6]>,
}

impl BlockMatrix {
    pub(crate) fn zeros(pattern: Arc<BlockPattern>) -> Self {
        Self {
            diagonal: vec![[0.0; 6]; pattern.n_blocks],
            off_diagonal: vec![[0.0; 6]; pattern.pairs.len()],
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
    pub fn off_diagonal(&self) -> &[[f64; 6]] {
        &self.off_diagonal
    }

    /// Makes it `weight`·M with the given lumped masses.
    pub(crate) fn set_mass(&mut self, weight: f64, masses: &[f64]) {
        for (block, mass) in self.diagonal.iter_mut().zip(masses) {
            let m = weight * mass;
            *block = [m, 0.0, 0.0, m, 0.0, m];
        }
        self.off_diagonal.fill([0.0; 6]);
    }

    /// Adds `block` at (row, row).
    #[inline(always)]
    pub(crate) fn add_diagonal(&mut self, row: u32, block: &[f64; 6]) {
        add(&mut self.diagonal[row as usize], block);
    }

    /// Subtracts `block` at both places of a pair.
    #[inline(always)]
    pub(crate) fn subtract_pair(&mut self, pair: u32, block: &[f64; 6]) {
        let target = &mut self.off_diagonal[pair as usize];
        for (entry, value) in target.iter_mut().zip(block) {
            *entry -= value;
        }
    }

    /// Every stored scalar of the whole matrix as (row, column, value), both
    /// triangles, diagonal included, each position once.
    pub fn triplets(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let diagonal = self.diagonal.iter().enumerate();
        let diagonal = diagonal.flat_map(|(block, values)| scalars(block, block, values));
        let pairs = self.pattern.pairs.iter().zip(&self.off_diagonal);
        let off_diagonal = pairs.flat_map(|(pair, values)| {
            let [a, b] = pair.map(|block| block as usize);
            scalars(a, b, values).chain(scalars(b, a, values))
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
        for (pair, block) in self.pattern.pairs.iter().zip(&self.off_diagonal) {
            let [a, b] = pair.map(|block| block as usize);
            y[a] += times(block, &x[b]);
            y[b] += times(block, &x[a]);
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
fn add(target: &mut [f64; 6], block: &[f64; 6]) {
    for (entry, value) in target.iter_mut().zip(block) {
        *entry += value;
    }
}

/// The nine scalars of the block at (row, column).
fn scalars(
    row: usize,
    column: usize,
    values: &[f64; 6],
) -> impl Iterator<Item = (usize, usize, f64)> {
    let values = *values;
    PACKED
        .into_iter()
        .zip(values)
        .flat_map(move |((r, c), value)| {
            let upper = (3 * row + r, 3 * column + c, value);
            let lower = (3 * row + c, 3 * column + r, value);
            std::iter::once(upper).chain((r != c).then_some(lower))
        })
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
        let mut matrix = BlockMatrix::zeros(Arc::new(pattern));
        matrix.set_mass(2.0, &[1.0, 2.0, 3.0]);
        matrix.add_diagonal(1, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        matrix.subtract_pair(pairs[0], &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        matrix.subtract_pair(pairs[1], &[7.0, 0.0, 1.0, 2.0, 0.0, 3.0]);
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
