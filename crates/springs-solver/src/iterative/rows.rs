//! Symmetric matrices of blocks, by rows of the lower triangle.

use crate::SolveError;
use crate::block::{Rounding, add, dot, invert, subtract, times, times_transposed};
use crate::storage::filled;

/// A symmetric matrix D + L + Lᵀ: the diagonal with P numbers a block, and the strictly
/// lower triangle with Q numbers a block, row by row with ascending columns. Blocks are
/// kept as they stand above the diagonal, in Lᵀ.
pub(crate) struct Rows<const P: usize, const Q: usize> {
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// Which of the caller's pairs each entry is.
    sources: Vec<u32>,
    diagonal: Vec<[f64; P]>,
    blocks: Vec<[f64; Q]>,
}

impl<const P: usize, const Q: usize> Rows<P, Q> {
    /// The pattern with the given pairs; all values are zero.
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]]) -> Self {
        let mut entries: Vec<([u32; 2], u32)> = pairs
            .iter()
            .zip(0..)
            .map(|(&[a, b], pair)| ([a.max(b), a.min(b)], pair))
            .collect();
        entries.sort_unstable();
        let starts = (0..=n_blocks)
            .map(|row| entries.partition_point(|entry| (entry.0[0] as usize) < row))
            .collect();
        Self {
            starts,
            columns: entries.iter().map(|entry| entry.0[1]).collect(),
            sources: entries.iter().map(|entry| entry.1).collect(),
            diagonal: vec![[0.0; P]; n_blocks],
            blocks: vec![[0.0; Q]; pairs.len()],
        }
    }

    /// Memory of such a matrix, in bytes.
    pub(crate) fn memory(n_blocks: usize, n_pairs: usize) -> u64 {
        ((8 + 8 * P) * n_blocks + (8 + 8 * Q) * n_pairs) as u64
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.diagonal.len()
    }

    pub(crate) fn n_pairs(&self) -> usize {
        self.blocks.len()
    }

    pub(crate) fn diagonal(&self) -> &[[f64; P]] {
        &self.diagonal
    }

    /// Takes values, off-diagonal ones in the order of the caller's pairs.
    pub(crate) fn set(&mut self, diagonal: &[[f64; P]], off_diagonal: &[[f64; Q]]) {
        self.diagonal.copy_from_slice(diagonal);
        for (entry, &source) in self.blocks.iter_mut().zip(&self.sources) {
            *entry = off_diagonal[source as usize];
        }
    }

    /// Every block above the diagonal: row, column, the caller's pair, values.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (usize, usize, usize, &[f64; Q])> {
        (0..self.n_blocks()).flat_map(move |column| {
            let entries = self.starts[column]..self.starts[column + 1];
            let sources = &self.sources[entries];
            self.row(column)
                .zip(sources)
                .map(move |((row, block), &source)| (row, column, source as usize, block))
        })
    }

    /// The off-diagonal blocks in the order of the caller's pairs; `None` without
    /// enough memory.
    pub(crate) fn by_pair(&self) -> Option<Vec<[f64; Q]>> {
        let mut blocks = filled([0.0; Q], self.blocks.len())?;
        for (block, &source) in self.blocks.iter().zip(&self.sources) {
            blocks[source as usize] = *block;
        }
        Some(blocks)
    }

    /// Columns left of the diagonal in a row, and the blocks of Lᵀ there.
    #[inline(always)]
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, &[f64; Q])> {
        let entries = self.starts[row]..self.starts[row + 1];
        let columns = &self.columns[entries.clone()];
        let blocks = &self.blocks[entries];
        columns.iter().map(|&column| column as usize).zip(blocks)
    }

    /// One row of L x.
    #[inline(always)]
    pub(crate) fn lower_row<const D: usize>(&self, row: usize, x: &[[f64; D]]) -> [f64; D] {
        let mut sum = [0.0; D];
        for (column, block) in self.row(row) {
            add(&mut sum, times_transposed(block, &x[column]));
        }
        sum
    }

    /// xᵀA x.
    pub(crate) fn quadratic_form<const D: usize>(&self, x: &[[f64; D]]) -> f64 {
        let of_row = |(row, block): (usize, &[f64; P])| {
            let own = dot(&x[row], &times(block, &x[row]));
            own + 2.0 * dot(&x[row], &self.lower_row(row, x))
        };
        self.diagonal.iter().enumerate().map(of_row).sum()
    }

    /// Solves (D + L) x = r with the inverses of the diagonal blocks. What is then left of
    /// r, −Lᵀx, is in `rest`.
    pub(crate) fn sweep_down<const D: usize>(
        &self,
        inverses: &[[f64; P]],
        r: &[[f64; D]],
        x: &mut [[f64; D]],
        rest: &mut [[f64; D]],
    ) {
        for row in 0..self.n_blocks() {
            let mut sum = r[row];
            subtract(&mut sum, self.lower_row(row, x));
            let here = times(&inverses[row], &sum);
            (x[row], rest[row]) = (here, [0.0; D]);
            for (column, block) in self.row(row) {
                subtract(&mut rest[column], times(block, &here));
            }
        }
    }

    /// Solves (D + Lᵀ) z = r − L x; `rest` is used up.
    pub(crate) fn sweep_up<const D: usize>(
        &self,
        inverses: &[[f64; P]],
        (r, x): (&[[f64; D]], &[[f64; D]]),
        z: &mut [[f64; D]],
        rest: &mut [[f64; D]],
    ) {
        rest.copy_from_slice(r);
        for row in (0..self.n_blocks()).rev() {
            let mut sum = rest[row];
            subtract(&mut sum, self.lower_row(row, x));
            let here = times(&inverses[row], &sum);
            z[row] = here;
            for (column, block) in self.row(row) {
                subtract(&mut rest[column], times(block, &here));
            }
        }
    }

    /// The inverses of the diagonal blocks.
    ///
    /// # Errors
    ///
    /// If one of them, and so the matrix, is not positive definite.
    pub(crate) fn invert_diagonal<const D: usize>(
        &self,
        inverses: &mut [[f64; P]],
        rounding: Rounding,
    ) -> Result<(), SolveError> {
        for (block, (inverse, values)) in inverses.iter_mut().zip(&self.diagonal).enumerate() {
            let inverted = invert::<D, P>(values, rounding);
            *inverse = inverted.ok_or(SolveError::NotPositiveDefinite { block })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix3};

    fn example() -> (Rows<6, 9>, DMatrix<f64>) {
        let pairs = [[2, 0], [1, 2], [3, 1], [0, 3]];
        let mut rows = Rows::new(4, &pairs);
        let block = |seed: f64| std::array::from_fn(|k| (seed * (k + 1) as f64).sin());
        let off_diagonal: Vec<_> = (0..4).map(|k| block(1.0 + f64::from(k))).collect();
        let diagonal: Vec<[f64; 6]> = (0..4)
            .map(|k| [9.0, 0.5, -0.5, 8.0, 1.0, 7.0 + f64::from(k)])
            .collect();
        rows.set(&diagonal, &off_diagonal);
        let mut dense = DMatrix::zeros(12, 12);
        let full =
            |b: &[f64; 6]| Matrix3::new(b[0], b[1], b[2], b[1], b[3], b[4], b[2], b[4], b[5]);
        for (k, block) in diagonal.iter().enumerate() {
            dense
                .fixed_view_mut::<3, 3>(3 * k, 3 * k)
                .copy_from(&full(block));
        }
        for (&[a, b], block) in pairs.iter().zip(&off_diagonal) {
            let [a, b] = [a.min(b), a.max(b)].map(|block: u32| 3 * block as usize);
            let block = Matrix3::from_row_slice(block);
            dense.fixed_view_mut::<3, 3>(a, b).copy_from(&block);
            dense.fixed_view_mut::<3, 3>(b, a).tr_copy_from(&block);
        }
        (rows, dense)
    }

    fn vector(blocks: &[[f64; 3]]) -> DVector<f64> {
        DVector::from_column_slice(blocks.as_flattened())
    }

    #[test]
    fn sweeps_equal_dense_ones() {
        let (rows, dense) = example();
        let r: Vec<[f64; 3]> = (0..4).map(|k| [1.0, f64::from(k), -0.5]).collect();
        let mut lower = dense.clone();
        let mut diagonal = DMatrix::zeros(12, 12);
        for row in 0..12 {
            for column in 0..12 {
                if column / 3 >= row / 3 {
                    lower[(row, column)] = 0.0;
                }
                if column / 3 == row / 3 {
                    diagonal[(row, column)] = dense[(row, column)];
                }
            }
        }
        let near = |y: &[[f64; 3]], expected: DVector<f64>| {
            let error = (vector(y) - expected).amax();
            assert!(error < 1e-13, "{error:e}");
        };
        let products: Vec<_> = (0..4).map(|row| rows.lower_row(row, &r)).collect();
        near(&products, &lower * vector(&r));
        let expected = vector(&r).dot(&(&dense * vector(&r)));
        assert!((rows.quadratic_form(&r) - expected).abs() < 1e-13 * expected.abs());

        let mut inverses = vec![[0.0; 6]; 4];
        rows.invert_diagonal::<3>(&mut inverses, Rounding::ByEntry)
            .unwrap();
        let zeros = vec![[0.0; 3]; 4];
        let (mut x, mut z, mut rest) = (zeros.clone(), zeros.clone(), zeros);
        rows.sweep_down(&inverses, &r, &mut x, &mut rest);
        let sum = &diagonal + &lower;
        near(&x, sum.clone().lu().solve(&vector(&r)).unwrap());
        near(&rest, -lower.transpose() * vector(&x));
        rows.sweep_up(&inverses, (&r, &x), &mut z, &mut rest);
        let left = vector(&r) - &lower * vector(&x);
        near(&z, sum.transpose().lu().solve(&left).unwrap());
    }
}
