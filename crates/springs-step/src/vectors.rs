//! Global vectors: one vector of three numbers a block.

use nalgebra::Vector3;
use springs_assembly::System;

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
    let mut found = (0, 0.0);
    for (index, vector) in vectors.iter().enumerate() {
        for component in vector.iter() {
            if component.is_nan() {
                return (index, f64::NAN);
            }
            if component.abs() > found.1 {
                found = (index, component.abs());
            }
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
    let (mut least, mut most) = (*first, *first);
    for v in velocities {
        least = least.inf(v);
        most = most.sup(v);
    }
    (most - least).amax()
}
