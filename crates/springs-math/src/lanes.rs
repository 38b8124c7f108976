//! The spring formulas for [`LANES`] springs side by side.
//!
//! The caller gathers the differences of positions, one array per coordinate,
//! and gets length, direction, tension and across stiffness the same way, so
//! that the compiler turns each line into vector instructions. The result does
//! not depend on which instructions it picks: nothing is fused or reordered.

use crate::Separation;
use crate::separation::is_safe_square;
use nalgebra::{ComplexField, SVector};

/// How many springs are evaluated side by side.
pub const LANES: usize = 8;

/// One number for each spring of a group.
pub type Lane = [f64; LANES];

/// Length (m) and direction of a group of springs.
#[derive(Clone, Copy, Debug)]
pub struct Separations<const D: usize> {
    /// l in m; zero where the nodes coincide.
    pub length: Lane,
    /// 1/l in 1/m; zero where the nodes coincide.
    pub inverse_length: Lane,
    /// u, one lane per coordinate; zero where the nodes coincide.
    pub direction: [Lane; D],
}

impl<const D: usize> Separations<D> {
    /// Separations with the given Δx = x₁ − x₀ in m, one lane per coordinate.
    ///
    /// Agrees with [`Separation::of`] to rounding, at every magnitude.
    #[inline(always)]
    pub fn of(dx: &[Lane; D]) -> Self {
        let mut square = [0.0; LANES];
        for component in dx {
            for k in 0..LANES {
                square[k] += component[k] * component[k];
            }
        }
        let mut all_safe = true;
        for &s in &square {
            all_safe &= is_safe_square(s);
        }
        if !all_safe {
            return Self::scaled(dx);
        }
        let mut length = [0.0; LANES];
        let mut inverse_length = [0.0; LANES];
        for k in 0..LANES {
            length[k] = ComplexField::sqrt(square[k]);
            inverse_length[k] = 1.0 / length[k];
        }
        let mut direction = *dx;
        for component in &mut direction {
            for k in 0..LANES {
                component[k] *= inverse_length[k];
            }
        }
        Self {
            length,
            inverse_length,
            direction,
        }
    }

    /// One by one, for groups with a coincident pair or an extreme length.
    #[cold]
    #[inline(never)]
    fn scaled(dx: &[Lane; D]) -> Self {
        let all: [Separation<D>; LANES] = core::array::from_fn(|k| {
            Separation::of(&SVector::<f64, D>::from_fn(|row, _| dx[row][k]))
        });
        let inverse = |length: f64| if length == 0.0 { 0.0 } else { 1.0 / length };
        Self {
            length: all.map(|one| one.length),
            inverse_length: all.map(|one| inverse(one.length)),
            direction: core::array::from_fn(|row| all.map(|one| one.direction[row])),
        }
    }

    /// Across stiffness `tension`/l in N/m, or K where the nodes coincide: the
    /// decision of [`crate::spring::hessian_block`].
    #[inline(always)]
    pub fn across_stiffness(
        &self,
        stiffness: &Lane,
        tension: &Lane,
        tangent: impl Fn(f64) -> f64,
    ) -> Lane {
        let mut across = [0.0; LANES];
        for k in 0..LANES {
            across[k] = if self.length[k] == 0.0 {
                stiffness[k]
            } else {
                tangent(tension[k] * self.inverse_length[k])
            };
        }
        across
    }

    /// Entry (row, column) of across·I + (along − across)·u uᵀ.
    ///
    /// Where the nodes coincide u is zero and the entry is that of across·I.
    #[inline(always)]
    pub fn block_entry(&self, row: usize, column: usize, along: &Lane, across: &Lane) -> Lane {
        let mut entry = [0.0; LANES];
        for k in 0..LANES {
            let product = self.direction[row][k] * self.direction[column][k];
            let isotropic = if row == column { across[k] } else { 0.0 };
            entry[k] = isotropic + (along[k] - across[k]) * product;
        }
        entry
    }
}

/// T = K(l − l₀), in N, of each spring.
#[inline(always)]
pub fn tension(stiffness: &Lane, rest_length: &Lane, length: &Lane) -> Lane {
    let mut tension = [0.0; LANES];
    for k in 0..LANES {
        tension[k] = stiffness[k] * (length[k] - rest_length[k]);
    }
    tension
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spring::{self, Spring};
    use nalgebra::{Matrix3, Vector3};

    type Tangent = fn(f64) -> f64;

    /// Differences that touch every branch: ordinary, coincident, tiny, huge.
    fn differences() -> [Vector3<f64>; LANES] {
        [
            Vector3::new(1.0, 2.0, -2.0),
            Vector3::new(0.3, -0.1, 0.2),
            Vector3::zeros(),
            Vector3::new(1e-160, 2e-160, 0.0),
            Vector3::new(5e200, -1e200, 3e200),
            Vector3::new(0.0, 0.0, -0.7),
            Vector3::new(1e-201, 0.0, 0.0),
            Vector3::new(12.0, 0.0, 5.0),
        ]
    }

    fn compare(dx: [Vector3<f64>; LANES]) {
        let mut lanes = [[0.0; LANES]; 3];
        for k in 0..LANES {
            for row in 0..3 {
                lanes[row][k] = dx[k][row];
            }
        }
        let stiffness = [3.0, 1e4, 5.0, 2.0, 1.0, 8.0, 6.0, 1e-3];
        let rest_length = [1.0, 0.0, 0.5, 0.0, 1.0, 0.9, 0.0, 13.0];
        let separations = Separations::of(&lanes);
        let tensions = tension(&stiffness, &rest_length, &separations.length);
        for k in 0..LANES {
            let one = Spring {
                stiffness: stiffness[k],
                rest_length: rest_length[k],
            };
            let x0 = Vector3::zeros();
            let force = Vector3::from_fn(|row, _| separations.direction[row][k] * tensions[k]);
            let expected = spring::force(one, &x0, &dx[k]);
            assert!((force - expected).amax() <= 1e-15 * expected.amax());
            let tangents: [(Tangent, Matrix3<f64>); 4] = [
                (|across| across, spring::hessian_block(one, &x0, &dx[k])),
                (
                    |across| across.max(0.0),
                    spring::hessian_block_clamped(one, &x0, &dx[k]),
                ),
                (f64::abs, spring::hessian_block_absolute(one, &x0, &dx[k])),
                (|_| 0.0, spring::hessian_block_material(one, &x0, &dx[k])),
            ];
            for (tangent, expected) in tangents {
                let across = separations.across_stiffness(&stiffness, &tensions, tangent);
                let block = Matrix3::from_fn(|row, column| {
                    separations.block_entry(row, column, &stiffness, &across)[k]
                });
                let error = (block - expected).amax() / expected.amax();
                assert!(error < 1e-15, "spring {k}: Hessian off by {error:e}");
            }
        }
    }

    #[test]
    fn lanes_agree_with_single_springs() {
        compare(differences());
        compare([Vector3::new(0.4, -1.1, 0.6); LANES]);
    }
}
