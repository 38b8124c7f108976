//! Global vectors: one vector of three numbers a block.

mod largest;

pub(crate) use self::largest::{
    LargestSum, largest, largest_change, largest_magnitude, largest_sum,
};
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
