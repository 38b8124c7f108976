//! The largest components of global vectors.

use super::numbers_of;
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};

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

/// The largest component of |a| + `factor`·|b|.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LargestSum {
    pub(crate) block: usize,
    pub(crate) sum: f64,
    /// The largest magnitudes of a and b.
    pub(crate) of_each: [f64; 2],
}

/// As [`largest`] of |a| + `factor`·|b|, component by component, and of both by themselves.
pub(crate) fn largest_sum(a: &[Vector3<f64>], factor: f64, b: &[Vector3<f64>]) -> LargestSum {
    let numbers = (numbers_of(a), numbers_of(b));
    let found = largest_terms(numbers, SumAndEach { factor });
    let at = |c: usize| numbers.0[c].abs() + factor * numbers.1[c].abs();
    let (block, sum) = find_largest(numbers.0.len(), found.map(|[sum, ..]| sum), at);
    let of_each = match found {
        Some([_, a, b]) => [a, b],
        None => [a, b].map(|vectors| largest(vectors).1),
    };
    LargestSum {
        block,
        sum,
        of_each,
    }
}

/// The largest magnitude of a component of a − b; NaN if there is one.
pub(crate) fn largest_change(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let (a, b) = (numbers_of(a), numbers_of(b));
    match largest_terms((a, b), Change) {
        Some([change]) => change,
        None => find_largest(a.len(), None, |c| (a[c] - b[c]).abs()).1,
    }
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

/// The largest magnitude; `None` if something is not a finite number.
fn largest_of(numbers: &[f64]) -> Option<f64> {
    largest_terms((numbers, numbers), Magnitude).map(|[largest]| largest)
}

/// N terms of every two numbers, which are not negative, and zero of zeros.
trait Terms<const N: usize>: Copy {
    fn of<S: Simd>(self, simd: S, a: S::f64s, b: S::f64s) -> [S::f64s; N];
}

/// |a|.
#[derive(Clone, Copy)]
struct Magnitude;

impl Terms<1> for Magnitude {
    #[inline(always)]
    fn of<S: Simd>(self, simd: S, a: S::f64s, _b: S::f64s) -> [S::f64s; 1] {
        [simd.abs_f64s(a)]
    }
}

/// |a − b|.
#[derive(Clone, Copy)]
struct Change;

impl Terms<1> for Change {
    #[inline(always)]
    fn of<S: Simd>(self, simd: S, a: S::f64s, b: S::f64s) -> [S::f64s; 1] {
        [simd.abs_f64s(simd.sub_f64s(a, b))]
    }
}

/// |a| + `factor`·|b|, |a| and |b|.
#[derive(Clone, Copy)]
struct SumAndEach {
    factor: f64,
}

impl Terms<3> for SumAndEach {
    #[inline(always)]
    fn of<S: Simd>(self, simd: S, a: S::f64s, b: S::f64s) -> [S::f64s; 3] {
        let (a, b) = (simd.abs_f64s(a), simd.abs_f64s(b));
        let part = simd.mul_f64s(simd.splat_f64s(self.factor), b);
        [simd.add_f64s(a, part), a, b]
    }
}

/// The largest of each term; `None` if a first one is not a finite number.
fn largest_terms<const N: usize>(
    numbers: (&[f64], &[f64]),
    terms: impl Terms<N>,
) -> Option<[f64; N]> {
    Arch::new().dispatch(LargestTerms { numbers, terms })
}

struct LargestTerms<'a, const N: usize, T: Terms<N>> {
    numbers: (&'a [f64], &'a [f64]),
    terms: T,
}

impl<const N: usize, T: Terms<N>> WithSimd for LargestTerms<'_, N, T> {
    type Output = Option<[f64; N]>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<[f64; N]> {
        let (a, a_rest) = S::as_simd_f64s(self.numbers.0);
        let (b, b_rest) = S::as_simd_f64s(self.numbers.1);
        let (a, a_last) = a.as_chunks::<2>();
        let (b, b_last) = b.as_chunks::<2>();
        // Two at once, as comparisons take several cycles.
        let (mut even, mut odd) = (Noted::new(simd), Noted::new(simd));
        for (&[a0, a1], &[b0, b1]) in a.iter().zip(b) {
            even.note(self.terms.of(simd, a0, b0));
            odd.note(self.terms.of(simd, a1, b1));
        }
        for (&a, &b) in a_last.iter().zip(b_last) {
            even.note(self.terms.of(simd, a, b));
        }
        let (a, b) = (
            simd.partial_load_f64s(a_rest),
            simd.partial_load_f64s(b_rest),
        );
        even.note(self.terms.of(simd, a, b));
        even.largest(&odd)
    }
}

/// What was seen so far of N terms.
struct Noted<S: Simd, const N: usize> {
    simd: S,
    largest: [S::f64s; N],
    /// Zero, unless a first term is infinite or not a number.
    odd: S::f64s,
}

impl<S: Simd, const N: usize> Noted<S, N> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let zero = simd.splat_f64s(0.0);
        Self {
            simd,
            largest: [zero; N],
            odd: zero,
        }
    }

    #[inline(always)]
    fn note(&mut self, terms: [S::f64s; N]) {
        let simd = self.simd;
        for (largest, &term) in self.largest.iter_mut().zip(&terms) {
            *largest = simd.max_f64s(*largest, term);
        }
        self.odd = simd.add_f64s(self.odd, simd.sub_f64s(terms[0], terms[0]));
    }

    /// The largest of both.
    #[inline(always)]
    fn largest(&self, other: &Self) -> Option<[f64; N]> {
        let simd = self.simd;
        let mut largest = [0.0; N];
        let both = self.largest.iter().zip(&other.largest);
        for (largest, (&a, &b)) in largest.iter_mut().zip(both) {
            *largest = simd.reduce_max_f64s(simd.max_f64s(a, b));
        }
        let odd = simd.reduce_sum_f64s(simd.add_f64s(self.odd, other.odd));
        (odd == 0.0).then_some(largest)
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
                    let found = largest_sum(&a, 0.5, &b);
                    let expected = odd.abs() + 0.5 * b[c / 3][c % 3].abs();
                    assert!(found.block == c / 3 && found.sum.to_bits() == expected.to_bits());
                    let of_each = [&a, &b].map(|vectors| largest(vectors).1);
                    assert_eq!(found.of_each.map(f64::to_bits), of_each.map(f64::to_bits));
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
}
