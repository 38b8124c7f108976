//! Symmetric matrices of blocks, by rows of the upper triangle.

use crate::SolveError;
use crate::block::{Rounding, add, invert, subtract, times, times_transposed};
use crate::storage::filled;

/// A symmetric matrix: the diagonal with P numbers a block, and the strictly upper
/// triangle with Q numbers a block, row by row with ascending columns.
pub(crate) struct Rows<const P: usize, const Q: usize> {
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// Which of the caller's pairs each entry is.
    sources: Vec<u32>,
    diagonal: Vec<[f64; P]>,
    upper: Vec<[f64; Q]>,
}

impl<const P: usize, const Q: usize> Rows<P, Q> {
    /// The pattern with the given pairs; all values are zero.
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]]) -> Self {
        let mut entries: Vec<([u32; 2], u32)> = pairs
            .iter()
            .zip(0..)
            .map(|(&[a, b], pair)| ([a.min(b), a.max(b)], pair))
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
            upper: vec![[0.0; Q]; pairs.len()],
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
        self.upper.len()
    }

    pub(crate) fn diagonal(&self) -> &[[f64; P]] {
        &self.diagonal
    }

    /// Takes values, off-diagonal ones in the order of the caller's pairs.
    pub(crate) fn set(&mut self, diagonal: &[[f64; P]], off_diagonal: &[[f64; Q]]) {
        self.diagonal.copy_from_slice(diagonal);
        for (entry, &source) in self.upper.iter_mut().zip(&self.sources) {
            *entry = off_diagonal[source as usize];
        }
    }

    /// Every off-diagonal block once: row, column, the caller's pair, values.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (usize, usize, usize, &[f64; Q])> {
        (0..self.n_blocks()).flat_map(move |row| {
            self.row(row)
                .map(move |(column, entry)| (row, column, self.sources[entry] as usize))
                .zip(&self.upper[self.starts[row]..self.starts[row + 1]])
                .map(|((row, column, source), values)| (row, column, source, values))
        })
    }

    /// The off-diagonal blocks in the order of the caller's pairs; `None` without
    /// enough memory.
    pub(crate) fn by_pair(&self) -> Option<Vec<[f64; Q]>> {
        let mut blocks = filled([0.0; Q], self.upper.len())?;
        for (block, &source) in self.upper.iter().zip(&self.sources) {
            blocks[source as usize] = *block;
        }
        Some(blocks)
    }

    /// Columns right of the diagonal in a row, and where their blocks are.
    #[inline(always)]
    fn row(&self, row: usize) -> impl DoubleEndedIterator<Item = (usize, usize)> {
        let entries = self.starts[row]..self.starts[row + 1];
        let columns = &self.columns[entries.clone()];
        columns.iter().map(|&column| column as usize).zip(entries)
    }

    /// y = A x.
    pub(crate) fn multiply<const D: usize>(&self, x: &[[f64; D]], y: &mut [[f64; D]]) {
        for ((y, x), block) in y.iter_mut().zip(x).zip(&self.diagonal) {
            *y = times(block, x);
        }
        for row in 0..self.n_blocks() {
            let here = x[row];
            let mut sum = [0.0; D];
            for (column, entry) in self.row(row) {
                let block = &self.upper[entry];
                add(&mut sum, times(block, &x[column]));
                add(&mut y[column], times_transposed(block, &here));
            }
            add(&mut y[row], sum);
        }
    }

    /// y = U x with the strictly upper triangle U.
    pub(crate) fn multiply_upper<const D: usize>(&self, x: &[[f64; D]], y: &mut [[f64; D]]) {
        for (row, y) in y.iter_mut().enumerate() {
            *y = [0.0; D];
            for (column, entry) in self.row(row) {
                add(y, times(&self.upper[entry], &x[column]));
            }
        }
    }

    /// y −= L x with the strictly lower triangle L = Uᵀ.
    pub(crate) fn subtract_lower<const D: usize>(&self, x: &[[f64; D]], y: &mut [[f64; D]]) {
        for (row, x) in x.iter().enumerate() {
            for (column, entry) in self.row(row) {
                subtract(&mut y[column], times_transposed(&self.upper[entry], x));
            }
        }
    }

    /// Solves (D + L) x = b with the inverses of the diagonal blocks; `b` is
    /// used up.
    pub(crate) fn solve_lower<const D: usize>(
        &self,
        inverses: &[[f64; P]],
        b: &mut [[f64; D]],
        x: &mut [[f64; D]],
    ) {
        for row in 0..self.n_blocks() {
            let here = times(&inverses[row], &b[row]);
            x[row] = here;
            for (column, entry) in self.row(row) {
                subtract(&mut b[column], times_transposed(&self.upper[entry], &here));
            }
        }
    }

    /// Solves (D + U) x = b.
    pub(crate) fn solve_upper<const D: usize>(
        &self,
        inverses: &[[f64; P]],
        b: &[[f64; D]],
        x: &mut [[f64; D]],
    ) {
        for row in (0..self.n_blocks()).rev() {
            let mut rest = b[row];
            for (column, entry) in self.row(row) {
                subtract(&mut rest, times(&self.upper[entry], &x[column]));
            }
            x[row] = times(&inverses[row], &rest);
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
    fn products_and_sweeps_equal_dense_ones() {
        let (rows, dense) = example();
        let x: Vec<[f64; 3]> = (0..4).map(|k| [1.0, f64::from(k), -0.5]).collect();
        let mut upper = dense.clone();
        let mut diagonal = DMatrix::zeros(12, 12);
        for row in 0..12 {
            for column in 0..12 {
                if column / 3 <= row / 3 {
                    upper[(row, column)] = 0.0;
                }
                if column / 3 == row / 3 {
                    diagonal[(row, column)] = dense[(row, column)];
                }
            }
        }
        let mut y = vec![[0.0; 3]; 4];
        let near = |y: &[[f64; 3]], expected: DVector<f64>| {
            let error = (vector(y) - expected).amax();
            assert!(error < 1e-13, "{error:e}");
        };
        rows.multiply(&x, &mut y);
        near(&y, &dense * vector(&x));
        rows.multiply_upper(&x, &mut y);
        near(&y, &upper * vector(&x));
        y.fill([1.0; 3]);
        rows.subtract_lower(&x, &mut y);
        near(
            &y,
            DVector::repeat(12, 1.0) - upper.transpose() * vector(&x),
        );

        let mut inverses = vec![[0.0; 6]; 4];
        rows.invert_diagonal::<3>(&mut inverses, Rounding::ByEntry)
            .unwrap();
        let sum = &diagonal + &upper;
        rows.solve_upper(&inverses, &x, &mut y);
        near(&(y.clone()), sum.clone().lu().solve(&vector(&x)).unwrap());
        rows.solve_lower(&inverses, &mut x.clone(), &mut y);
        near(&y, sum.transpose().lu().solve(&vector(&x)).unwrap());
    }
}
