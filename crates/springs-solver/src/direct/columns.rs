//! Solution with the columns of one front: a panel, which has as many rows as the right-hand
//! side y, column by column. D columns are worked off at a time, so that y is read and
//! written once for all of them.

use crate::block::dot;

/// Lanes of the sums of each of D columns.
const LANES: usize = 4;

/// The columns k to k + D of a panel below row k, and the row where they begin.
#[inline(always)]
fn block_columns<const D: usize>(
    panel: &[f64],
    height: usize,
) -> impl DoubleEndedIterator<Item = (usize, [&[f64]; D])> {
    let blocks = panel.chunks_exact(D * height).enumerate();
    blocks.map(move |(block, columns)| {
        let k = D * block;
        let column = |c: usize| &columns[c * height + k..(c + 1) * height];
        (k, std::array::from_fn(column))
    })
}

/// Solves L x = y in the columns of a panel, and takes what they do to the rows below
/// from y.
#[inline(always)]
pub(super) fn solve<const D: usize>(panel: &[f64], y: &mut [f64]) {
    for (k, columns) in block_columns::<D>(panel, y.len()) {
        let (x, below) = y[k..].split_at_mut(D);
        for c in 0..D {
            x[c] /= columns[c][c];
            for row in c + 1..D {
                x[row] -= x[c] * columns[c][row];
            }
        }
        let x: [f64; D] = std::array::from_fn(|c| x[c]);
        let columns = columns.map(|column| &column[D..][..below.len()]);
        for (row, y) in below.iter_mut().enumerate() {
            *y -= dot(&x, &columns.map(|column| column[row]));
        }
    }
}

/// Solves Lᵀ x = y in the columns of a panel, where y has x in the rows below already.
#[inline(always)]
pub(super) fn solve_transposed<const D: usize>(panel: &[f64], y: &mut [f64]) {
    for (k, columns) in block_columns::<D>(panel, y.len()).rev() {
        let (x, below) = y[k..].split_at_mut(D);
        let products = dots_in_lanes::<D, LANES>(columns.map(|column| &column[D..]), below);
        for c in (0..D).rev() {
            x[c] -= products[c];
            for row in c + 1..D {
                x[c] -= columns[c][row] * x[row];
            }
            x[c] /= columns[c][c];
        }
    }
}

/// The products of several vectors with y, in lanes so that the order of the sums is that
/// of the vector unit.
#[inline(always)]
pub(crate) fn dots_in_lanes<const N: usize, const LANES: usize>(
    xs: [&[f64]; N],
    y: &[f64],
) -> [f64; N] {
    let (ys, y_rest) = y.as_chunks::<LANES>();
    let split = xs.map(|x| x[..y.len()].as_chunks::<LANES>());
    let mut sums = [[0.0; LANES]; N];
    for (at, y) in ys.iter().enumerate() {
        for (sums, (xs, _)) in sums.iter_mut().zip(&split) {
            let x = &xs[at];
            for lane in 0..LANES {
                sums[lane] += x[lane] * y[lane];
            }
        }
    }
    std::array::from_fn(|n| {
        let lanes: f64 = sums[n].iter().sum();
        let rest = split[n].1.iter().zip(y_rest);
        rest.fold(lanes, |sum, (x, y)| sum + x * y)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beside one column after the other.
    fn check<const D: usize>(n_blocks: usize, below: usize) {
        let columns = D * n_blocks;
        let height = columns + below;
        let entry = |k: usize| (0.7 * k as f64).sin();
        let mut panel: Vec<f64> = (0..columns * height).map(entry).collect();
        for k in 0..columns {
            panel[k * height + k] = 2.0 + entry(k).abs();
        }
        let y: Vec<f64> = (0..height).map(|k| (1.3 * k as f64).cos()).collect();

        let (mut x, mut expected) = (y.clone(), y.clone());
        solve::<D>(&panel, &mut x);
        for (k, column) in panel.chunks_exact(height).enumerate() {
            expected[k] /= column[k];
            for row in k + 1..height {
                expected[row] -= expected[k] * column[row];
            }
        }
        near(&x, &expected);

        let (mut x, mut expected) = (y.clone(), y);
        solve_transposed::<D>(&panel, &mut x);
        for (k, column) in panel.chunks_exact(height).enumerate().rev() {
            for row in k + 1..height {
                expected[k] -= column[row] * expected[row];
            }
            expected[k] /= column[k];
        }
        near(&x, &expected);
    }

    fn near(x: &[f64], expected: &[f64]) {
        for (x, expected) in x.iter().zip(expected) {
            assert!((x - expected).abs() <= 1e-12 * (1.0 + expected.abs()));
        }
    }

    #[test]
    fn columns_together_are_those_one_after_the_other() {
        for below in [0, 1, 6, 8, 21] {
            check::<1>(3, below);
            check::<2>(2, below);
            check::<3>(1, below);
            check::<3>(4, below);
            check::<6>(2, below);
        }
    }
}
