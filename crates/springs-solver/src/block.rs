//! Small dense algebra: D × D blocks of N numbers. Symmetric ones are packed row
//! by row from the diagonal on, N = P = D(D + 1)/2; general ones stand row by
//! row, N = D².

use crate::Subspace;
use crate::lanes::Lanes;

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

/// Whether blocks of N numbers are symmetric.
#[inline(always)]
pub(crate) const fn is_symmetric<const D: usize, const N: usize>() -> bool {
    N != D * D || D == 1
}

/// Where the entry at (row, column) of a block of N numbers is.
#[inline(always)]
pub(crate) const fn place<const D: usize, const N: usize>(row: usize, column: usize) -> usize {
    if is_symmetric::<D, N>() {
        packed::<D>(row, column)
    } else {
        row * D + column
    }
}

#[inline(always)]
pub(crate) fn rows<const D: usize, const N: usize>(block: &[f64; N]) -> [[f64; D]; D] {
    std::array::from_fn(|row| std::array::from_fn(|column| block[place::<D, N>(row, column)]))
}

#[inline(always)]
pub(crate) fn columns<const D: usize, const N: usize>(block: &[f64; N]) -> [[f64; D]; D] {
    std::array::from_fn(|column| std::array::from_fn(|row| block[place::<D, N>(row, column)]))
}

/// Bᵀ.
#[inline(always)]
pub(crate) fn transposed<const D: usize, const N: usize>(b: &[f64; N]) -> [f64; N] {
    let mut transposed = *b;
    for row in 0..D {
        for column in 0..D {
            transposed[place::<D, N>(row, column)] = b[place::<D, N>(column, row)];
        }
    }
    transposed
}

/// B x.
#[inline(always)]
pub(crate) fn times<const D: usize, const N: usize>(b: &[f64; N], x: &[f64; D]) -> [f64; D] {
    rows::<D, N>(b).map(|row| dot(&row, x))
}

/// Bᵀ x.
#[inline(always)]
pub(crate) fn times_transposed<const D: usize, const N: usize>(
    b: &[f64; N],
    x: &[f64; D],
) -> [f64; D] {
    columns::<D, N>(b).map(|column| dot(&column, x))
}

#[inline(always)]
pub(crate) fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = a[0] * b[0];
    for axis in 1..D {
        sum += a[axis] * b[axis];
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

/// How precise the entries of a diagonal block are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rounding {
    /// Each entry relative to the diagonal entries of its row and column.
    ByEntry,
    /// Relative to the largest diagonal entry of its block: it is a sum in which
    /// larger entries may have cancelled.
    ByBlock,
}

impl Rounding {
    /// Blocks are reduced to a plane by sums, unless its basis vectors are axes.
    pub(crate) fn of(subspace: Subspace) -> Self {
        let is_axis = |x: f64| x == 0.0 || x.abs() == 1.0;
        match subspace {
            Subspace::Plane(basis) if !basis.into_iter().flatten().all(is_axis) => Self::ByBlock,
            _ => Self::ByEntry,
        }
    }

    /// Errors of the diagonal entries of a block after elimination: a few units of
    /// rounding of what they were before.
    ///
    /// A pivot must exceed what they make of it, or it may be zero in truth: its
    /// own error e_k and those of the pivots before it in the block,
    /// Σ (l_kj/l_jj)² e_j.
    #[inline(always)]
    pub(crate) fn diagonal_errors<const D: usize, const P: usize>(
        self,
        block: &[f64; P],
    ) -> [f64; D] {
        // What is not a number is not above zero.
        let above_zero = |x: f64| if x > 0.0 { x } else { 0.0 };
        let mut sizes: [f64; D] =
            std::array::from_fn(|axis| above_zero(block[packed::<D>(axis, axis)]));
        if self == Self::ByBlock {
            sizes = [sizes.into_iter().fold(0.0, f64::max); D];
        }
        sizes.map(|size| PIVOT_ROUNDING * f64::EPSILON * size)
    }
}

/// The few units of rounding. Pivots that are zero in truth came to less than
/// four of them in thousands of random directions, 16 in massless chains of 30
/// blocks; longer chains add up more.
const PIVOT_ROUNDING: f64 = 16.0;

/// L and D of packed blocks B = L D Lᵀ: the entries of the unit lower triangular L by
/// columns, with the inverse of D on its diagonal; and whether every pivot of a block
/// exceeds what the errors make of it, without which the numbers are of no use.
#[inline(always)]
pub(crate) fn ldlt<const D: usize, const P: usize, const W: usize>(
    b: &[Lanes<W>; P],
    errors: &[Lanes<W>; D],
) -> ([Lanes<W>; P], [bool; W]) {
    let mut l = *b;
    let mut is_positive = [true; W];
    for column in 0..D {
        let pivot = l[packed::<D>(column, column)];
        let mut limit = errors[column];
        for k in 0..D {
            if k < column {
                let entry = l[packed::<D>(k, column)];
                limit += entry * entry * errors[k];
            }
        }
        for (is_positive, (pivot, limit)) in is_positive.iter_mut().zip(pivot.0.iter().zip(limit.0))
        {
            // What is not a number does not exceed it either.
            *is_positive &= *pivot > limit;
        }
        let inverse = pivot.reciprocal();
        l[packed::<D>(column, column)] = inverse;
        // Bounds that are the same in every round let the loops be unrolled.
        for row in 0..D {
            if row <= column {
                continue;
            }
            let entry = l[packed::<D>(column, row)] * inverse;
            for k in 0..D {
                if k >= row {
                    let other = l[packed::<D>(column, k)];
                    l[packed::<D>(row, k)] -= entry * other;
                }
            }
            l[packed::<D>(column, row)] = entry;
        }
    }
    (l, is_positive)
}

/// L⁻¹ b with the L of [`ldlt`].
#[inline(always)]
pub(crate) fn forward<const D: usize, const P: usize, const W: usize>(
    l: &[Lanes<W>; P],
    b: [Lanes<W>; D],
) -> [Lanes<W>; D] {
    let mut y = b;
    for row in 1..D {
        for k in 0..row {
            y[row] -= l[packed::<D>(k, row)] * y[k];
        }
    }
    y
}

/// D⁻¹ y.
#[inline(always)]
pub(crate) fn divide<const D: usize, const P: usize, const W: usize>(
    l: &[Lanes<W>; P],
    y: [Lanes<W>; D],
) -> [Lanes<W>; D] {
    let mut z = y;
    for row in 0..D {
        z[row] = z[row] * l[packed::<D>(row, row)];
    }
    z
}

/// L⁻ᵀ z.
#[inline(always)]
pub(crate) fn backward<const D: usize, const P: usize, const W: usize>(
    l: &[Lanes<W>; P],
    z: [Lanes<W>; D],
) -> [Lanes<W>; D] {
    let mut x = z;
    for row in (0..D).rev() {
        for k in (row + 1..D).rev() {
            x[row] -= l[packed::<D>(row, k)] * x[k];
        }
    }
    x
}

/// The inverse of a packed block, if it is positive definite.
#[inline(always)]
pub(crate) fn invert<const D: usize, const P: usize>(
    b: &[f64; P],
    rounding: Rounding,
) -> Option<[f64; P]> {
    let errors = rounding.diagonal_errors(b);
    let (l, [is_positive]) = ldlt::<D, P, 1>(&Lanes::of(&[*b]), &Lanes::of(&[errors]));
    if !is_positive {
        return None;
    }
    let mut inverse = [0.0; P];
    for column in 0..D {
        let unit = std::array::from_fn(|row| Lanes::splat(if row == column { 1.0 } else { 0.0 }));
        let x = backward::<D, P, 1>(&l, divide(&l, forward(&l, unit)));
        for row in 0..=column {
            inverse[packed::<D>(row, column)] = x[row].0[0];
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
        let full = rows::<D, P>(&b);
        let dense = DMatrix::from_fn(D, D, |row, column| full[row][column]);
        assert_eq!(dense, dense.transpose());
        let near = |a: [f64; D], expected: &DVector<f64>| {
            let error = (DVector::from_column_slice(&a) - expected).amax();
            assert!(error < 1e-14, "{error:e}");
        };
        let vector = DVector::from_column_slice(&x);
        near(times::<D, P>(&b, &x), &(&dense * &vector));
        let solution = dense.lu().solve(&vector).unwrap();
        // Beside another block, which is not positive definite.
        let both = Lanes::of(&[b, [f64::NAN; P]]);
        let (l, is_positive) = ldlt::<D, P, 2>(&both, &[Lanes::splat(0.0); D]);
        assert_eq!(is_positive, [true, false]);
        let y = forward::<D, P, 2>(&l, Lanes::of(&[x; 2]));
        let found = backward::<D, P, 2>(&l, divide(&l, y));
        near(Lanes::lane(&found, 0), &solution);
        near(
            times::<D, P>(&invert::<D, P>(&b, Rounding::ByEntry).unwrap(), &x),
            &solution,
        );
    }

    #[test]
    fn general_blocks_equal_dense_ones() {
        let b = [4.0, 1.0, -0.5, 3.0, 0.25, 2.0, -7.0, 8.0, 9.0];
        let x = [1.0, -2.0, 0.5];
        let dense = DMatrix::from_row_slice(3, 3, &b);
        let vector = DVector::from_column_slice(&x);
        let product = |b: &DMatrix<f64>| <[f64; 3]>::try_from((b * &vector).as_slice()).unwrap();
        assert_eq!(times(&b, &x), product(&dense));
        assert_eq!(times_transposed(&b, &x), product(&dense.transpose()));
        assert_eq!(
            times(&transposed::<3, 9>(&b), &x),
            product(&dense.transpose())
        );
    }

    #[test]
    fn all_equals_dense_algebra() {
        check::<3, 6>([4.0, 1.0, -0.5, 3.0, 0.25, 2.0], [1.0, -2.0, 0.5]);
        check::<2, 3>([4.0, 1.0, 3.0], [1.0, -2.0]);
        check::<1, 1>([4.0], [1.0]);
    }

    #[test]
    fn indefinite_blocks_are_found() {
        let rounding = Rounding::ByEntry;
        assert!(invert::<3, 6>(&[1.0, 2.0, 0.0, 1.0, 0.0, 1.0], rounding).is_none());
        assert!(invert::<3, 6>(&[1.0, 0.0, 0.0, 1.0, 0.0, f64::NAN], rounding).is_none());
        assert!(invert::<3, 6>(&[1.0, 0.0, 0.0, 1.0, 0.0, f64::INFINITY], rounding).is_none());
        assert!(invert::<2, 3>(&[0.0; 3], rounding).is_none());
        assert!(invert::<1, 1>(&[-1.0], rounding).is_none());
    }
}
