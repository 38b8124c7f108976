//! Small dense algebra: symmetric D × D blocks, packed row by row from the
//! diagonal on into P = D(D + 1)/2 entries.

use std::ops::{Add, Mul};

/// Where the entry at (row, column) of a symmetric block is packed.
#[inline(always)]
pub(crate) const fn packed<const D: usize>(row: usize, column: usize) -> usize {
    let (row, column) = if row < column {
        (row, column)
    } else {
        (column, row)
    };
    row * D - row * (row + 1) / 2 + column
}

/// The rows of a packed block.
#[inline(always)]
pub(crate) fn rows<T: Copy, const D: usize, const P: usize>(block: &[T; P]) -> [[T; D]; D] {
    std::array::from_fn(|row| std::array::from_fn(|column| block[packed::<D>(row, column)]))
}

/// B x.
#[inline(always)]
pub(crate) fn times<const D: usize, const P: usize>(b: &[f64; P], x: &[f64; D]) -> [f64; D] {
    rows::<f64, D, P>(b).map(|row| dot(&row, x))
}

#[inline(always)]
pub(crate) fn dot<T, const D: usize>(a: &[T; D], b: &[T; D]) -> T
where
    T: Copy + Mul<Output = T> + Add<Output = T>,
{
    let mut sum = a[0] * b[0];
    for axis in 1..D {
        sum = sum + a[axis] * b[axis];
    }
    sum
}

/// y += x.
#[inline(always)]
pub(crate) fn add<const N: usize>(y: &mut [f64; N], x: [f64; N]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += x;
    }
}

/// y −= x.
#[inline(always)]
pub(crate) fn subtract<const N: usize>(y: &mut [f64; N], x: [f64; N]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= x;
    }
}

/// L of a packed block B = L Lᵀ, by columns, with inverted diagonal entries;
/// `None` if the block is not positive definite.
#[inline(always)]
pub(crate) fn cholesky<const D: usize, const P: usize>(b: &[f64; P]) -> Option<[f64; P]> {
    let mut l = *b;
    for column in 0..D {
        let mut pivot = b[packed::<D>(column, column)];
        for k in 0..column {
            pivot -= l[packed::<D>(k, column)] * l[packed::<D>(k, column)];
        }
        // What is not a number is not positive.
        let is_positive = pivot > 0.0;
        if !is_positive {
            return None;
        }
        let inverse = 1.0 / pivot.sqrt();
        l[packed::<D>(column, column)] = inverse;
        for row in column + 1..D {
            let mut entry = b[packed::<D>(column, row)];
            for k in 0..column {
                entry -= l[packed::<D>(k, row)] * l[packed::<D>(k, column)];
            }
            l[packed::<D>(column, row)] = entry * inverse;
        }
    }
    Some(l)
}

/// L⁻¹ b with the L of [`cholesky`].
#[inline(always)]
pub(crate) fn forward<const D: usize, const P: usize>(l: &[f64; P], b: [f64; D]) -> [f64; D] {
    let mut y = b;
    for row in 0..D {
        for k in 0..row {
            y[row] -= l[packed::<D>(k, row)] * y[k];
        }
        y[row] *= l[packed::<D>(row, row)];
    }
    y
}

/// L⁻ᵀ y.
#[inline(always)]
pub(crate) fn backward<const D: usize, const P: usize>(l: &[f64; P], y: [f64; D]) -> [f64; D] {
    let mut x = y;
    for row in (0..D).rev() {
        for k in row + 1..D {
            x[row] -= l[packed::<D>(row, k)] * x[k];
        }
        x[row] *= l[packed::<D>(row, row)];
    }
    x
}

/// The inverse of a packed block, if it is positive definite.
#[inline(always)]
pub(crate) fn invert<const D: usize, const P: usize>(b: &[f64; P]) -> Option<[f64; P]> {
    let l = cholesky::<D, P>(b)?;
    let mut inverse = [0.0; P];
    for column in 0..D {
        let unit = std::array::from_fn(|row| if row == column { 1.0 } else { 0.0 });
        let x = backward::<D, P>(&l, forward::<D, P>(&l, unit));
        for row in 0..=column {
            inverse[packed::<D>(row, column)] = x[row];
        }
    }
    let is_finite = inverse.iter().all(|entry| entry.is_finite());
    is_finite.then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    fn check<const D: usize, const P: usize>(b: [f64; P], x: [f64; D]) {
        let full = rows::<f64, D, P>(&b);
        let dense = DMatrix::from_fn(D, D, |row, column| full[row][column]);
        assert_eq!(dense, dense.transpose());
        let near = |a: [f64; D], expected: &DVector<f64>| {
            let error = (DVector::from_column_slice(&a) - expected).amax();
            assert!(error < 1e-14, "{error:e}");
        };
        let vector = DVector::from_column_slice(&x);
        near(times::<D, P>(&b, &x), &(&dense * &vector));
        let solution = dense.lu().solve(&vector).unwrap();
        let l = cholesky::<D, P>(&b).unwrap();
        near(backward::<D, P>(&l, forward::<D, P>(&l, x)), &solution);
        near(times::<D, P>(&invert::<D, P>(&b).unwrap(), &x), &solution);
    }

    #[test]
    fn all_equals_dense_algebra() {
        check::<3, 6>([4.0, 1.0, -0.5, 3.0, 0.25, 2.0], [1.0, -2.0, 0.5]);
        check::<2, 3>([4.0, 1.0, 3.0], [1.0, -2.0]);
        check::<1, 1>([4.0], [1.0]);
    }

    #[test]
    fn indefinite_blocks_are_found() {
        assert!(invert::<3, 6>(&[1.0, 2.0, 0.0, 1.0, 0.0, 1.0]).is_none());
        assert!(invert::<3, 6>(&[1.0, 0.0, 0.0, 1.0, 0.0, f64::NAN]).is_none());
        assert!(invert::<2, 3>(&[0.0; 3]).is_none());
        assert!(invert::<1, 1>(&[-1.0]).is_none());
    }
}
