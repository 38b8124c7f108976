//! Linear spring: energy, force, Hessian. Δx = x₁ − x₀ (m), l = ‖Δx‖ (m).
//!
//! The Hessian block of a spring has the eigenvalue K along the spring and one
//! more, T/l with the tension T = K(l − l₀), in every direction across it. A
//! *tangent* is a choice of the latter for the matrix of an implicit step:
//!
//! | tangent | across stiffness | why |
//! | --- | --- | --- |
//! | exact | T/l | the Hessian; indefinite when the spring is compressed |
//! | clamped | max(T/l, 0) | positive semidefinite |
//! | absolute | \|T/l\| | positive semidefinite, stiffer under compression |
//! | material | 0 | positive semidefinite; no false tension at high K |
//! | filtered | min(T̃/l, K) | T̃ is a tension that the integrator carries along |

use crate::Separation;
use crate::separation::{is_safe_square, sum_of_squares};
use nalgebra::{ComplexField, SMatrix, SVector};

/// Material of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// K, in N/m; not negative.
    pub stiffness: f64,
    /// l₀, in m; may be zero.
    pub rest_length: f64,
}

/// V = ½K(l − l₀)², in J, Eq. 1. Infinite where it exceeds the number range.
#[inline]
pub fn energy<const D: usize>(spring: Spring, x0: &SVector<f64, D>, x1: &SVector<f64, D>) -> f64 {
    let stretch = Separation::between(x0, x1).length - spring.rest_length;
    0.5 * spring.stiffness * stretch * stretch
}

/// T = K(l − l₀), in N, of a spring of length l in m; positive when stretched.
#[inline(always)]
pub fn tension(spring: Spring, length: f64) -> f64 {
    spring.stiffness * (length - spring.rest_length)
}

/// f₀ = −∂V/∂x₀ = K(l − l₀)Δx/l on node 0, in N, Eq. 4. Node 1 feels −f₀.
///
/// Zero if the nodes coincide: exact for l₀ = 0; for l₀ > 0 the force has no
/// direction there, and zero keeps the momentum.
#[inline]
pub fn force<const D: usize>(
    spring: Spring,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SVector<f64, D> {
    let dx = x1 - x0;
    let square = sum_of_squares(&dx);
    if is_safe_square(square) {
        let length = ComplexField::sqrt(square);
        // One division for all components.
        let per_length = tension(spring, length) / length;
        if per_length.is_finite() {
            return dx * per_length;
        }
    }
    let separation = Separation::of(&dx);
    separation.direction * tension(spring, separation.length)
}

/// Block B = ∂²V/∂x₀² in N/m, symmetric D × D, Eq. 8: the exact tangent. The
/// element Hessian is `[[B, −B], [−B, B]]`, Eq. 9.
///
/// B has the eigenvalue K along the spring and K(1 − l₀/l) across it:
/// indefinite when l < l₀. If the nodes coincide B is K·I, exact for l₀ = 0.
#[inline]
pub fn hessian_block<const D: usize>(
    spring: Spring,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(spring, x0, x1, |across| across)
}

/// [`hessian_block`] with the across stiffness max(K(1 − l₀/l), 0), in N/m.
///
/// The nearest positive semidefinite matrix to B in the Frobenius norm.
#[inline]
pub fn hessian_block_clamped<const D: usize>(
    spring: Spring,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(spring, x0, x1, |across| across.max(0.0))
}

/// [`hessian_block`] with the across stiffness |K(1 − l₀/l)|, in N/m.
#[inline]
pub fn hessian_block_absolute<const D: usize>(
    spring: Spring,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(spring, x0, x1, f64::abs)
}

/// [`hessian_block`] with no across stiffness: K u uᵀ, in N/m.
///
/// If the nodes coincide it is K·I like the others.
#[inline]
pub fn hessian_block_material<const D: usize>(
    spring: Spring,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(spring, x0, x1, |_| 0.0)
}

/// [`hessian_block`] with the across stiffness `tension`/l, in N/m, where the
/// tension in N is the caller's own (for example one carried from step to step)
/// instead of K(l − l₀); at most K, which no spring exceeds: K(1 − l₀/l) ≤ K.
#[inline]
pub fn hessian_block_filtered<const D: usize>(
    spring: Spring,
    tension: f64,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    let separation = Separation::between(x0, x1);
    let across = (tension / separation.length).min(spring.stiffness);
    assemble_block(spring, &separation, across)
}

/// Force and block of one spring at once: [`force`] in N, and the block in N/m
/// as (xx, xy, xz, yy, yz, zz), with across stiffness `project`(T/l), where T is
/// the tension `given` in N or else the spring's own, and T/l of a given one is at
/// most K, as in [`hessian_block_filtered`]. `dx` = x₁ − x₀ in m.
#[inline(always)]
pub fn linearize(
    spring: Spring,
    given: Option<f64>,
    dx: &SVector<f64, 3>,
    project: impl Fn(f64) -> f64,
) -> (SVector<f64, 3>, [f64; 6]) {
    let square = sum_of_squares(dx);
    if is_safe_square(square) {
        let length = ComplexField::sqrt(square);
        let inverse = 1.0 / length;
        let own = tension(spring, length);
        let per_length = own * inverse;
        if per_length.is_finite() {
            let across = project(match given {
                Some(tension) => (tension * inverse).min(spring.stiffness),
                None => own * inverse,
            });
            let u = dx * inverse;
            let more = spring.stiffness - across;
            let [x, y, z] = [u.x * more, u.y * more, u.z * more];
            let block = [
                across + x * u.x,
                x * u.y,
                x * u.z,
                across + y * u.y,
                y * u.z,
                across + z * u.z,
            ];
            return (dx * per_length, block);
        }
    }
    let separation = Separation::of(dx);
    let own = tension(spring, separation.length);
    let across = project(match given {
        Some(tension) => (tension / separation.length).min(spring.stiffness),
        None => own / separation.length,
    });
    let b = assemble_block(spring, &separation, across);
    let block = [b.m11, b.m12, b.m13, b.m22, b.m23, b.m33];
    (separation.direction * own, block)
}

#[inline(always)]
fn block<const D: usize>(
    spring: Spring,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
    tangent: impl Fn(f64) -> f64,
) -> SMatrix<f64, D, D> {
    let separation = Separation::between(x0, x1);
    let across = tension(spring, separation.length) / separation.length;
    assemble_block(spring, &separation, tangent(across))
}

/// across·(I − u uᵀ) + K·u uᵀ, or K·I for coincident nodes.
#[inline(always)]
fn assemble_block<const D: usize>(
    spring: Spring,
    separation: &Separation<D>,
    across: f64,
) -> SMatrix<f64, D, D> {
    if separation.length == 0.0 {
        return SMatrix::identity() * spring.stiffness;
    }
    let along = separation.along();
    (SMatrix::identity() - along) * across + along * spring.stiffness
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3, Vector1, Vector2, Vector3};

    /// Ordinary, compressed, coincident, tiny, huge, along an axis.
    #[test]
    fn linearize_is_force_and_block_at_once() {
        let differences = [
            Vector3::new(1.0, 2.0, -2.0),
            Vector3::new(0.3, -0.1, 0.2),
            Vector3::zeros(),
            Vector3::new(1e-160, 2e-160, 0.0),
            Vector3::new(5e200, -1e200, 3e200),
            Vector3::new(0.0, 0.0, -0.7),
            Vector3::new(1e-201, 0.0, 0.0),
        ];
        let origin = Vector3::zeros();
        let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-14 * scale || a == b;
        for dx in differences {
            let expected_force = force(SPRING, &origin, &dx);
            let scale = SPRING.stiffness * dx.norm().max(SPRING.rest_length);
            for (project, block) in [
                (
                    (|across| across) as fn(f64) -> f64,
                    hessian_block(SPRING, &origin, &dx),
                ),
                (
                    |across| across.max(0.0),
                    hessian_block_clamped(SPRING, &origin, &dx),
                ),
                (f64::abs, hessian_block_absolute(SPRING, &origin, &dx)),
                (|_| 0.0, hessian_block_material(SPRING, &origin, &dx)),
            ] {
                let (force, packed) = linearize(SPRING, None, &dx, project);
                for (a, b) in force.iter().zip(&expected_force) {
                    assert!(close(*a, *b, scale), "{dx}: {a:e} {b:e}");
                }
                let [xx, xy, xz, yy, yz, zz] = packed;
                let whole = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let largest = block.amax();
                for (a, b) in whole.iter().zip(&block) {
                    assert!(close(*a, *b, 10.0 * largest), "{dx}: {a:e} {b:e}");
                }
            }
            let (_, filtered) = linearize(SPRING, Some(0.4), &dx, |across| across);
            let block = hessian_block_filtered(SPRING, 0.4, &origin, &dx);
            assert!(close(filtered[0], block.m11, 10.0 * block.amax()));
        }
    }

    const SPRING: Spring = Spring {
        stiffness: 7.0,
        rest_length: 2.0,
    };

    #[test]
    fn at_rest_there_is_no_energy_and_no_force() {
        let x1 = Vector3::new(0.0, 2.0, 0.0);
        assert_eq!(energy(SPRING, &Vector3::zeros(), &x1), 0.0);
        assert_eq!(force(SPRING, &Vector3::zeros(), &x1), Vector3::zeros());
        assert_eq!(
            hessian_block(SPRING, &Vector3::zeros(), &x1),
            Matrix3::from_diagonal(&Vector3::new(0.0, 7.0, 0.0))
        );
    }

    #[test]
    fn a_case_by_hand() {
        // l = 5, T = 21, u = (0, 0.6, 0.8), across stiffness 21/5 = 4.2.
        let (x0, x1) = (Vector3::new(1.0, 0.0, 0.0), Vector3::new(1.0, 3.0, 4.0));
        assert_eq!(energy(SPRING, &x0, &x1), 31.5);
        let expected = Vector3::new(0.0, 12.6, 16.8);
        assert!((force(SPRING, &x0, &x1) - expected).norm() < 1e-14);
        let block = hessian_block(SPRING, &x0, &x1);
        let expected = Matrix3::new(
            4.2,
            0.0,
            0.0, //
            0.0,
            4.2 + 2.8 * 0.36,
            2.8 * 0.48, //
            0.0,
            2.8 * 0.48,
            4.2 + 2.8 * 0.64,
        );
        assert!((block - expected).norm() < 1e-14);
    }

    #[test]
    fn one_and_two_dimensions_are_the_three_dimensional_case_restricted() {
        let line = hessian_block(SPRING, &Vector1::new(1.0), &Vector1::new(-0.5));
        assert_eq!(line[(0, 0)], 7.0);
        assert_eq!(
            force(SPRING, &Vector1::new(1.0), &Vector1::new(-0.5))[0],
            3.5
        );

        let (x0, x1) = (Vector2::new(0.3, -0.2), Vector2::new(1.7, 0.9));
        let lift = |x: Vector2<f64>| Vector3::new(x.x, x.y, 0.0);
        let plane = hessian_block(SPRING, &x0, &x1);
        let space = hessian_block(SPRING, &lift(x0), &lift(x1));
        assert_eq!(plane, space.fixed_view::<2, 2>(0, 0).into_owned());
        assert_eq!(space[(0, 2)], 0.0);
    }

    #[test]
    fn tangents_differ_only_across() {
        // Compressed: l = 1, T = −7, across −7.
        let (x0, x1) = (Vector3::zeros(), Vector3::x());
        let diagonal = |across: f64| Matrix3::from_diagonal(&Vector3::new(7.0, across, across));
        assert_eq!(hessian_block(SPRING, &x0, &x1), diagonal(-7.0));
        assert_eq!(hessian_block_clamped(SPRING, &x0, &x1), diagonal(0.0));
        assert_eq!(hessian_block_absolute(SPRING, &x0, &x1), diagonal(7.0));
        assert_eq!(hessian_block_material(SPRING, &x0, &x1), diagonal(0.0));
        assert_eq!(hessian_block_filtered(SPRING, 3.0, &x0, &x1), diagonal(3.0));
    }

    /// A tension carried from where the spring was long may be far above what the
    /// spring has now; T/l ≤ K always.
    #[test]
    fn a_given_tension_is_no_stiffer_across_than_along() {
        for dx in [Vector3::new(1e-6, 0.0, 0.0), Vector3::new(1e-160, 0.0, 0.0)] {
            let stiff = Matrix3::identity() * 7.0;
            let block = hessian_block_filtered(SPRING, 100.0, &Vector3::zeros(), &dx);
            assert!((block - stiff).norm() < 1e-14);
            let (_, packed) = linearize(SPRING, Some(100.0), &dx, |across| across);
            for (a, b) in packed.iter().zip([7.0, 0.0, 0.0, 7.0, 0.0, 7.0]) {
                assert!((a - b).abs() < 1e-14, "{packed:?}");
            }
        }
    }

    #[test]
    fn coincident_nodes_are_decided() {
        let x = Vector3::new(1.0, 2.0, 3.0);
        let stiff = Matrix3::identity() * 7.0;
        assert_eq!(force(SPRING, &x, &x), Vector3::zeros());
        assert_eq!(energy(SPRING, &x, &x), 14.0);
        assert_eq!(hessian_block(SPRING, &x, &x), stiff);
        assert_eq!(hessian_block_clamped(SPRING, &x, &x), stiff);
        assert_eq!(hessian_block_absolute(SPRING, &x, &x), stiff);
        assert_eq!(hessian_block_material(SPRING, &x, &x), stiff);
        assert_eq!(hessian_block_filtered(SPRING, 3.0, &x, &x), stiff);
    }

    #[test]
    fn zero_rest_length_is_linear() {
        let spring = Spring {
            stiffness: 7.0,
            rest_length: 0.0,
        };
        let (x0, x1) = (Vector3::new(0.1, 0.2, 0.3), Vector3::new(-0.7, 0.4, 1.1));
        assert!((force(spring, &x0, &x1) - 7.0 * (x1 - x0)).norm() < 1e-14);
        let block = hessian_block(spring, &x0, &x1);
        assert!((block - Matrix3::identity() * 7.0).norm() < 1e-14);
    }

    #[test]
    fn rigid_motions_turn_the_force_and_keep_the_energy() {
        let (x0, x1) = (Vector3::new(0.1, -0.4, 0.9), Vector3::new(2.1, 0.3, -0.5));
        let turn = Rotation3::from_euler_angles(0.3, -1.2, 2.1);
        let shift = Vector3::new(5.0, -3.0, 2.0);
        let (y0, y1) = (turn * x0 + shift, turn * x1 + shift);
        assert!((energy(SPRING, &x0, &x1) - energy(SPRING, &y0, &y1)).abs() < 1e-13);
        assert!((turn * force(SPRING, &x0, &x1) - force(SPRING, &y0, &y1)).norm() < 1e-13);
        let turned = turn * hessian_block(SPRING, &x0, &x1) * turn.transpose();
        assert!((turned - hessian_block(SPRING, &y0, &y1)).norm() < 1e-13);
    }
}
