//! Symmetric matrices of 3 × 3 blocks, by rows of the upper triangle.

use crate::SolveError;

/// A block vector.
pub(crate) type Blocks = [[f64; 3]];

/// A symmetric matrix whose blocks are symmetric, too: the diagonal, and the
/// strictly upper triangle row by row with ascending columns.
pub(crate) struct Rows {
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// Which of the caller's pairs each entry is.
    sources: Vec<u32>,
    diagonal: Vec<[f64; 6]>,
    upper: Vec<[f64; 6]>,
}

impl Rows {
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
            diagonal: vec![[0.0; 6]; n_blocks],
            upper: vec![[0.0; 6]; pairs.len()],
        }
    }

    /// Memory of such a matrix, in bytes.
    pub(crate) fn memory(n_blocks: usize, n_pairs: usize) -> u64 {
        (56 * n_blocks + 56 * n_pairs) as u64
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.diagonal.len()
    }

    pub(crate) fn n_pairs(&self) -> usize {
        self.upper.len()
    }

    pub(crate) fn diagonal(&self) -> &[[f64; 6]] {
        &self.diagonal
    }

    /// Takes values, off-diagonal ones in the order of the caller's pairs.
    pub(crate) fn set(&mut self, diagonal: &[[f64; 6]], off_diagonal: &[[f64; 6]]) {
        self.diagonal.copy_from_slice(diagonal);
        for (entry, &source) in self.upper.iter_mut().zip(&self.sources) {
            *entry = off_diagonal[source as usize];
        }
    }

    /// Every off-diagonal block once: row, column, the caller's pair, values.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (usize, usize, usize, &[f64; 6])> {
        (0..self.n_blocks()).flat_map(move |row| {
            self.row(row)
                .map(move |(column, entry)| (row, column, self.sources[entry] as usize))
                .zip(&self.upper[self.starts[row]..self.starts[row + 1]])
                .map(|((row, column, source), values)| (row, column, source, values))
        })
    }

    /// Columns right of the diagonal in a row, and where their blocks are.
    #[inline(always)]
    fn row(&self, row: usize) -> impl DoubleEndedIterator<Item = (usize, usize)> {
        let entries = self.starts[row]..self.starts[row + 1];
        let columns = &self.columns[entries.clone()];
        columns.iter().map(|&column| column as usize).zip(entries)
    }

    /// y = A x.
    pub(crate) fn multiply(&self, x: &Blocks, y: &mut Blocks) {
        for ((y, x), block) in y.iter_mut().zip(x).zip(&self.diagonal) {
            *y = times(block, x);
        }
        for row in 0..self.n_blocks() {
            let here = x[row];
            let mut sum = [0.0; 3];
            for (column, entry) in self.row(row) {
                let block = &self.upper[entry];
                add(&mut sum, times(block, &x[column]));
                add(&mut y[column], times(block, &here));
            }
            add(&mut y[row], sum);
        }
    }

    /// y = U x with the strictly upper triangle U.
    pub(crate) fn multiply_upper(&self, x: &Blocks, y: &mut Blocks) {
        for (row, y) in y.iter_mut().enumerate() {
            *y = [0.0; 3];
            for (column, entry) in self.row(row) {
                add(y, times(&self.upper[entry], &x[column]));
            }
        }
    }

    /// y −= L x with the strictly lower triangle L = Uᵀ.
    pub(crate) fn subtract_lower(&self, x: &Blocks, y: &mut Blocks) {
        for (row, x) in x.iter().enumerate() {
            for (column, entry) in self.row(row) {
                subtract(&mut y[column], times(&self.upper[entry], x));
            }
        }
    }

    /// Solves (D + L) x = b with the inverses of the diagonal blocks; `b` is
    /// used up.
    pub(crate) fn solve_lower(&self, inverses: &[[f64; 6]], b: &mut Blocks, x: &mut Blocks) {
        for row in 0..self.n_blocks() {
            let here = times(&inverses[row], &b[row]);
            x[row] = here;
            for (column, entry) in self.row(row) {
                subtract(&mut b[column], times(&self.upper[entry], &here));
            }
        }
    }

    /// Solves (D + U) x = b.
    pub(crate) fn solve_upper(&self, inverses: &[[f64; 6]], b: &Blocks, x: &mut Blocks) {
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
    pub(crate) fn invert_diagonal(&self, inverses: &mut [[f64; 6]]) -> Result<(), SolveError> {
        for (block, (inverse, values)) in inverses.iter_mut().zip(&self.diagonal).enumerate() {
            *inverse = invert(values).ok_or(SolveError::NotPositiveDefinite { block })?;
        }
        Ok(())
    }
}

/// The inverse of a packed symmetric block, if it is positive definite.
fn invert(b: &[f64; 6]) -> Option<[f64; 6]> {
    // Cholesky with the diagonal apart, B = L D Lᵀ.
    let d0 = b[0];
    let (l10, l20) = (b[1] / d0, b[2] / d0);
    let d1 = b[3] - l10 * b[1];
    let l21 = (b[4] - l20 * b[1]) / d1;
    let d2 = b[5] - l20 * b[2] - l21 * l21 * d1;
    let is_definite = d0 > 0.0 && d1 > 0.0 && d2 > 0.0;
    if !is_definite {
        return None;
    }
    // The rows of L⁻¹ are (1), (−l10, 1), (m20, −l21, 1).
    let m20 = l10 * l21 - l20;
    let (e0, e1, e2) = (1.0 / d0, 1.0 / d1, 1.0 / d2);
    let inverse = [
        e0 + l10 * l10 * e1 + m20 * m20 * e2,
        -l10 * e1 - m20 * l21 * e2,
        m20 * e2,
        e1 + l21 * l21 * e2,
        -l21 * e2,
        e2,
    ];
    inverse
        .iter()
        .all(|entry| entry.is_finite())
        .then_some(inverse)
}

/// B x for a packed symmetric block.
#[inline(always)]
pub(crate) fn times(b: &[f64; 6], x: &[f64; 3]) -> [f64; 3] {
    [
        b[0] * x[0] + b[1] * x[1] + b[2] * x[2],
        b[1] * x[0] + b[3] * x[1] + b[4] * x[2],
        b[2] * x[0] + b[4] * x[1] + b[5] * x[2],
    ]
}

#[inline(always)]
pub(crate) fn add<const N: usize>(y: &mut [f64; N], x: [f64; N]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += x;
    }
}

#[inline(always)]
fn subtract(y: &mut [f64; 3], x: [f64; 3]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix3};

    fn example() -> (Rows, DMatrix<f64>) {
        let pairs = [[2, 0], [1, 2], [3, 1], [0, 3]];
        let mut rows = Rows::new(4, &pairs);
        let block =
            |seed: f64| [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(|entry: f64| (seed * entry).sin());
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
        for (pair, block) in pairs.iter().zip(&off_diagonal) {
            let [a, b] = pair.map(|block| 3 * block as usize);
            dense.fixed_view_mut::<3, 3>(a, b).copy_from(&full(block));
            dense.fixed_view_mut::<3, 3>(b, a).copy_from(&full(block));
        }
        (rows, dense)
    }

    fn vector(blocks: &Blocks) -> DVector<f64> {
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
        let near = |y: &Blocks, expected: DVector<f64>| {
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
        rows.invert_diagonal(&mut inverses).unwrap();
        let sum = &diagonal + &upper;
        rows.solve_upper(&inverses, &x, &mut y);
        near(&(y.clone()), sum.clone().lu().solve(&vector(&x)).unwrap());
        rows.solve_lower(&inverses, &mut x.clone(), &mut y);
        near(&y, sum.transpose().lu().solve(&vector(&x)).unwrap());
    }

    #[test]
    fn an_indefinite_diagonal_block_is_found() {
        assert!(invert(&[1.0, 2.0, 0.0, 1.0, 0.0, 1.0]).is_none());
        assert!(invert(&[1.0, 0.0, 0.0, 1.0, 0.0, f64::NAN]).is_none());
        assert!(invert(&[0.0; 6]).is_none());
    }
}
