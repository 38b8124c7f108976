//! Vectors at the ends of several connections of a run at once.

use crate::run::{LANES, Run};
use nalgebra::Vector3;
use pulp::Simd;
use springs_math::SAFE_SQUARES;
use std::ops::Range;

/// The slots of each run within those of all.
pub(crate) fn slots(runs: &[Run]) -> impl Iterator<Item = (&Run, Range<usize>)> {
    runs.iter()
        .map(|run| (run, run.first_slot..run.first_slot + run.n_slots))
}

/// Coordinates of the blocks at one end.
pub(crate) type Ends = [f64; 3 * LANES];
/// A number of each connection.
pub(crate) type Lanes = [f64; LANES];

#[inline(always)]
pub(crate) fn lanes_at(vectors: &[f64], block: usize) -> &Ends {
    let lanes = &vectors[3 * block..3 * block + 3 * LANES];
    lanes.try_into().expect("as many as there are")
}

/// Adds to the first ends, and subtracts from the second ones.
#[inline(always)]
pub(crate) fn add_to_ends<S: Simd>(
    simd: S,
    sums: &mut [f64],
    [first, second]: [usize; 2],
    values: &Ends,
) {
    let (values, _) = S::as_simd_f64s(values);
    // The second end first: with an offset below the number of lanes, a block is the
    // second end of an earlier spring than it is the first of.
    let (sums_of_second, _) = S::as_mut_simd_f64s(&mut sums[3 * second..3 * second + 3 * LANES]);
    for (sum, &value) in sums_of_second.iter_mut().zip(values) {
        *sum = simd.sub_f64s(*sum, value);
    }
    let (sums_of_first, _) = S::as_mut_simd_f64s(&mut sums[3 * first..3 * first + 3 * LANES]);
    for (sum, &value) in sums_of_first.iter_mut().zip(values) {
        *sum = simd.add_f64s(*sum, value);
    }
}

#[inline(always)]
pub(crate) fn differences([start, end]: [&Ends; 2]) -> Ends {
    let mut differences = [0.0; 3 * LANES];
    for c in 0..3 * LANES {
        differences[c] = end[c] - start[c];
    }
    differences
}

#[inline(always)]
pub(crate) fn dots(a: &Ends, b: &Ends) -> Lanes {
    let mut dots = [0.0; LANES];
    for c in 0..LANES {
        dots[c] = a[3 * c] * b[3 * c] + a[3 * c + 1] * b[3 * c + 1] + a[3 * c + 2] * b[3 * c + 2];
    }
    dots
}

/// Whether lengths may be taken from their squares and what was made of them is finite.
pub(crate) struct Safety<S: Simd> {
    simd: S,
    least: S::f64s,
    most: S::f64s,
    /// Zero, unless something is infinite or not a number.
    odd: S::f64s,
}

impl<S: Simd> Safety<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S) -> Self {
        let one = simd.splat_f64s(1.0);
        Self {
            simd,
            least: one,
            most: one,
            odd: simd.splat_f64s(0.0),
        }
    }

    /// Takes note of squares of lengths and of results.
    #[inline(always)]
    pub(crate) fn note(&mut self, squares: S::f64s, results: S::f64s) {
        let simd = self.simd;
        self.least = simd.min_f64s(self.least, squares);
        self.most = simd.max_f64s(self.most, squares);
        self.odd = simd.add_f64s(self.odd, simd.sub_f64s(results, results));
    }

    #[inline(always)]
    pub(crate) fn is_given(&self) -> bool {
        let simd = self.simd;
        simd.reduce_min_f64s(self.least) >= *SAFE_SQUARES.start()
            && simd.reduce_max_f64s(self.most) <= *SAFE_SQUARES.end()
            && simd.reduce_sum_f64s(self.odd) == 0.0
    }
}

pub(crate) fn vector_at(vectors: &Ends, place: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&vectors[3 * place..3 * place + 3])
}

pub(crate) fn set_vector_at(vectors: &mut Ends, place: usize, vector: &Vector3<f64>) {
    vectors[3 * place..3 * place + 3].copy_from_slice(vector.as_slice());
}
