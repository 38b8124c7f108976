//! Global vectors: one vector of three numbers a block.

use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use springs_assembly::System;
use springs_threads::{share_of_pass_here, share_out};

/// Numbers that are worked off at once: of four blocks. Loops over them do one simple
/// thing each, which compilers turn into a few instructions.
pub(crate) const WIDTH: usize = 12;

/// Copies vectors.
///
/// # Panics
///
/// If there are not as many of both.
pub(crate) fn copy(from: &[Vector3<f64>], to: &mut [Vector3<f64>]) {
    let Some(share) = share_of_pass_here(from.len()) else {
        return to.copy_from_slice(from);
    };
    assert_eq!(from.len(), to.len(), "as many vectors");
    let shares = from.chunks(share).zip(to.chunks_mut(share));
    share_out(shares, |(from, to)| to.copy_from_slice(from));
}

/// Vectors as plain numbers.
fn numbers_of(vectors: &[Vector3<f64>]) -> &[f64] {
    bytemuck::cast_slice(vectors)
}

/// Vectors as plain numbers.
pub(crate) fn numbers_mut(vectors: &mut [Vector3<f64>]) -> &mut [f64] {
    bytemuck::cast_slice_mut(vectors)
}

/// Vectors as plain arrays.
pub(crate) fn blocks_of(vectors: &[Vector3<f64>]) -> &[[f64; 3]] {
    bytemuck::cast_slice(vectors)
}

/// Where the largest component of a list of vectors is, and its magnitude; NaN
/// if there is one.
pub(crate) fn largest(vectors: &[Vector3<f64>]) -> (usize, f64) {
    let numbers = numbers_of(vectors);
    find_largest(numbers.len(), largest_of(numbers), |c| numbers[c].abs())
}

/// The magnitude alone, which is quicker.
pub(crate) fn largest_magnitude(vectors: &[Vector3<f64>]) -> f64 {
    largest_of(numbers_of(vectors)).unwrap_or_else(|| largest(vectors).1)
}

/// As [`largest`] of |a| + `factor`·|b|, component by component.
pub(crate) fn largest_sum(a: &[Vector3<f64>], factor: f64, b: &[Vector3<f64>]) -> (usize, f64) {
    let (a, b) = (numbers_of(a), numbers_of(b));
    let sum = |a: f64, b: f64| a.abs() + factor * b.abs();
    let magnitude = largest_term(a, b, sum);
    find_largest(a.len(), magnitude, |c| sum(a[c], b[c]))
}

/// The largest magnitude of a component of a − b; NaN if there is one.
pub(crate) fn largest_change(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let (a, b) = (numbers_of(a), numbers_of(b));
    let magnitude = largest_term(a, b, |a, b| (a - b).abs());
    magnitude.unwrap_or_else(|| find_largest(a.len(), None, |c| (a[c] - b[c]).abs()).1)
}

/// The block of a component of the known magnitude, which is the largest of all; without
/// one, some are not finite numbers.
fn find_largest(
    n_numbers: usize,
    magnitude: Option<f64>,
    at: impl Fn(usize) -> f64,
) -> (usize, f64) {
    if let Some(largest) = magnitude {
        let component = (0..n_numbers).position(|c| at(c) == largest);
        return (component.unwrap_or(0) / 3, largest);
    }
    let mut found = (0, 0.0);
    for component in 0..n_numbers {
        let here = at(component);
        if here.is_nan() {
            return (component / 3, here);
        }
        if here > found.1 {
            found = (component / 3, here);
        }
    }
    found
}

/// M v of the free blocks, in kg·m/s.
pub(crate) fn momenta_of(system: &System, v: &[Vector3<f64>], momenta: &mut [Vector3<f64>]) {
    for (p, (m, v)) in momenta.iter_mut().zip(system.masses().iter().zip(v)) {
        *p = v * *m;
    }
}

/// How far the components of velocities are apart: the largest difference of two
/// blocks, fixed ones included, along an axis. A common velocity adds nothing.
pub(crate) fn spread(velocities: &[Vector3<f64>]) -> f64 {
    let Some(first) = velocities.first() else {
        return 0.0;
    };
    let (numbers, rest) = numbers_of(velocities).as_chunks::<WIDTH>();
    let ends = [first; WIDTH / 3].map(|v| [v.x, v.y, v.z]);
    let (mut least, mut most) = (ends, ends);
    Arch::new().dispatch(Range {
        numbers,
        least: least.as_flattened_mut(),
        most: most.as_flattened_mut(),
    });
    for (c, &number) in rest.iter().enumerate() {
        least[0][c % 3] = smaller(least[0][c % 3], number);
        most[0][c % 3] = larger(most[0][c % 3], number);
    }
    let along = |axis: usize| {
        let least = least.iter().map(|v| v[axis]).reduce(smaller);
        let most = most.iter().map(|v| v[axis]).reduce(larger);
        most.unwrap_or(0.0) - least.unwrap_or(0.0)
    };
    larger(larger(along(0), along(1)), along(2))
}

/// The larger one, and the first if the second is not a number: one instruction.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The largest magnitude; `None` if something is not a finite number.
fn largest_of(numbers: &[f64]) -> Option<f64> {
    largest_term(numbers, numbers, |a, _| a.abs())
}

/// The largest of terms that are not negative, one for each two numbers; `None` if one
/// is not a finite number.
fn largest_term(a: &[f64], b: &[f64], term: impl Fn(f64, f64) -> f64 + Copy) -> Option<f64> {
    Arch::new().dispatch(LargestTerm { a, b, term })
}

struct LargestTerm<'a, F> {
    a: &'a [f64],
    b: &'a [f64],
    term: F,
}

impl<F: Fn(f64, f64) -> f64> WithSimd for LargestTerm<'_, F> {
    type Output = Option<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Option<f64> {
        let (a, a_rest) = self.a.as_chunks::<WIDTH>();
        let (b, b_rest) = self.b.as_chunks::<WIDTH>();
        let mut largest = [0.0; WIDTH];
        // Zero, unless a term is infinite or not a number.
        let mut odd = [0.0; WIDTH];
        for (a, b) in a.iter().zip(b) {
            let mut terms = [0.0; WIDTH];
            for (term, (&a, &b)) in terms.iter_mut().zip(a.iter().zip(b)) {
                *term = (self.term)(a, b);
            }
            for (largest, &term) in largest.iter_mut().zip(&terms) {
                *largest = larger(*largest, term);
            }
            for (odd, term) in odd.iter_mut().zip(&terms) {
                *odd += 0.0 * term;
            }
        }
        for (c, (&a, &b)) in a_rest.iter().zip(b_rest).enumerate() {
            let term = (self.term)(a, b);
            largest[c] = larger(largest[c], term);
            odd[c] += 0.0 * term;
        }
        let is_finite = odd.iter().sum::<f64>() == 0.0;
        is_finite.then(|| largest.into_iter().fold(0.0, larger))
    }
}

/// Takes note of the least and the largest number of each place in a chunk.
struct Range<'a> {
    numbers: &'a [[f64; WIDTH]],
    least: &'a mut [f64],
    most: &'a mut [f64],
}

impl WithSimd for Range<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let (mut least, mut most) = ([0.0; WIDTH], [0.0; WIDTH]);
        least.copy_from_slice(self.least);
        most.copy_from_slice(self.most);
        for numbers in self.numbers {
            for (least, &number) in least.iter_mut().zip(numbers) {
                *least = smaller(*least, number);
            }
            for (most, &number) in most.iter_mut().zip(numbers) {
                *most = larger(*most, number);
            }
        }
        self.least.copy_from_slice(&least);
        self.most.copy_from_slice(&most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vectors(n: usize, of: impl Fn(f64) -> f64) -> Vec<Vector3<f64>> {
        let vector = |k| Vector3::from_fn(|axis, _| of((3 * k + axis) as f64));
        (0..n).map(vector).collect()
    }

    #[test]
    fn the_largest_is_found_wherever_it_is() {
        for n in 1..11 {
            let (mut a, b) = (vectors(n, f64::sin), vectors(n, f64::cos));
            for c in 0..3 * n {
                let before = a[c / 3][c % 3];
                for odd in [-7.0, f64::NEG_INFINITY, f64::NAN] {
                    a[c / 3][c % 3] = odd;
                    let (block, value) = largest(&a);
                    assert_eq!(value.to_bits(), largest_magnitude(&a).to_bits());
                    assert!(block == c / 3 && value.to_bits() == odd.abs().to_bits());
                    let (block, value) = largest_sum(&a, 0.5, &b);
                    let expected = odd.abs() + 0.5 * b[c / 3][c % 3].abs();
                    assert!(block == c / 3 && value.to_bits() == expected.to_bits());
                    let change = (odd - b[c / 3][c % 3]).abs();
                    let found = largest_change(&a, &b);
                    assert!(found == change || (found.is_nan() && change.is_nan()));
                }
                a[c / 3][c % 3] = before;
            }
            assert_eq!(largest(&vec![Vector3::zeros(); n]), (0, 0.0));
        }
        assert_eq!(largest(&[]), (0, 0.0));
    }

    #[test]
    fn the_spread_is_that_along_the_axis_where_it_is_largest() {
        assert_eq!(spread(&[]), 0.0);
        for n in 1..11 {
            let common = Vector3::new(64.0, -32.0, 16.0);
            let mut v = vec![common; n];
            assert_eq!(spread(&v), 0.0);
            v[n - 1].y -= 2.0;
            v[0].z += 1.0;
            let expected = if n == 1 { 0.0 } else { 2.0 };
            assert_eq!(spread(&v), expected);
        }
    }
}
