//! Springs: energy, force, Hessian. Δx = x₁ − x₀ (m), l = ‖Δx‖ (m).
//!
//! The energy of a spring is a [law](LengthLaw) V(l) of its length alone: that of
//! the linear [`Spring`], Eq. 1, or any other. The Hessian block has the eigenvalue
//! k = V″ along the spring and one more, T/l with the tension T = V′, in every
//! direction across it; of a linear spring, k = K and T = K(l − l₀). A
//! *tangent* is a choice of the latter for the matrix of an implicit step:
//!
//! | tangent | across stiffness | why |
//! | --- | --- | --- |
//! | exact | T/l | the Hessian; indefinite when the spring is compressed |
//! | clamped | max(T/l, 0) | positive semidefinite |
//! | absolute | \|T/l\| | positive semidefinite, stiffer under compression |
//! | material | 0 | positive semidefinite; no false tension at high K |
//! | filtered | T̃/l, at most K | T̃ is a tension that the integrator carries along |

use crate::Separation;
use crate::separation::{is_safe_square, sum_of_squares};
use nalgebra::{ComplexField, SMatrix, SVector};

/// A law of the length of a spring: energy V, tension T = V′ and stiffness k = V″.
///
/// Methods of order p keep their order where V has p + 1 continuous derivatives;
/// T is continuous at least.
pub trait LengthLaw {
    /// V(l), in J, at the length l in m.
    fn energy(&self, length: f64) -> f64;

    /// T = V′(l), in N, at the length l in m; positive if it pulls.
    fn tension(&self, length: f64) -> f64;

    /// k = V″(l), in N/m, at the length l in m.
    fn stiffness(&self, length: f64) -> f64;

    /// A bound on k and on T/l at any length, in N/m; infinite if there is none.
    fn largest_stiffness(&self) -> f64;

    /// The length l₀, in m, at which it neither pulls nor pushes: strain is
    /// l/l₀ − 1.
    fn rest_length(&self) -> f64;

    /// Whether k is never negative.
    fn is_convex(&self) -> bool;

    /// K and l₀, if this is the linear law at all lengths.
    fn as_linear(&self) -> Option<Spring> {
        None
    }

    /// Takes K and l₀ of `spring` in place of its own; a law whose stiffness follows from
    /// other numbers takes l₀ alone, and one that has neither stays as it is. What it
    /// remembers stays.
    fn set_spring(&mut self, _spring: Spring) {}

    /// Whether [`Self::update_memory`] may change it.
    fn has_memory(&self) -> bool {
        false
    }

    /// Changes for good what lasts of having come to the length l in m, as where the
    /// spring breaks; returns the energy V(l), in J, that is lost with it. A tension in
    /// N that is known better than from the length stands for it.
    fn update_memory(&mut self, _length: f64, _known: Option<f64>) -> f64 {
        0.0
    }

    /// Whether [`Self::update_memory`] would break it at the length l in m.
    fn would_break(&self, _length: f64) -> bool {
        false
    }

    /// Whether it has broken: then it gives nothing any more.
    fn is_broken(&self) -> bool {
        false
    }

    /// How much longer it is for good than when it was new, in m.
    fn elongation(&self) -> f64 {
        0.0
    }

    /// Hands over the numbers that it remembers, always in the same order, to be saved or
    /// replaced.
    fn each_memory(&mut self, _visit: &mut dyn FnMut(&mut f64)) {}
}

impl<L: LengthLaw> LengthLaw for &L {
    #[inline(always)]
    fn energy(&self, length: f64) -> f64 {
        L::energy(self, length)
    }

    #[inline(always)]
    fn tension(&self, length: f64) -> f64 {
        L::tension(self, length)
    }

    #[inline(always)]
    fn stiffness(&self, length: f64) -> f64 {
        L::stiffness(self, length)
    }

    #[inline(always)]
    fn largest_stiffness(&self) -> f64 {
        L::largest_stiffness(self)
    }

    #[inline(always)]
    fn rest_length(&self) -> f64 {
        L::rest_length(self)
    }

    #[inline(always)]
    fn is_convex(&self) -> bool {
        L::is_convex(self)
    }

    fn as_linear(&self) -> Option<Spring> {
        L::as_linear(self)
    }

    fn is_broken(&self) -> bool {
        L::is_broken(self)
    }

    fn elongation(&self) -> f64 {
        L::elongation(self)
    }
}

/// The linear law V = ½K(l − l₀)², Eq. 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// K, in N/m; not negative.
    pub stiffness: f64,
    /// l₀, in m; may be zero.
    pub rest_length: f64,
}

impl Spring {
    /// The law in the strain ε = l/l₀ − 1: T = EA ε, K = EA/l₀, with the axial
    /// stiffness EA in N (Young's modulus times cross section) and l₀ in m, positive.
    #[inline]
    pub fn of_axial_stiffness(axial_stiffness: f64, rest_length: f64) -> Self {
        Self {
            stiffness: axial_stiffness / rest_length,
            rest_length,
        }
    }
}

impl LengthLaw for Spring {
    fn as_linear(&self) -> Option<Spring> {
        Some(*self)
    }

    fn set_spring(&mut self, spring: Spring) {
        *self = spring;
    }

    #[inline(always)]
    fn energy(&self, length: f64) -> f64 {
        let stretch = length - self.rest_length;
        0.5 * self.stiffness * stretch * stretch
    }

    #[inline(always)]
    fn tension(&self, length: f64) -> f64 {
        self.stiffness * (length - self.rest_length)
    }

    #[inline(always)]
    fn stiffness(&self, _length: f64) -> f64 {
        self.stiffness
    }

    #[inline(always)]
    fn largest_stiffness(&self) -> f64 {
        self.stiffness
    }

    #[inline(always)]
    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    #[inline(always)]
    fn is_convex(&self) -> bool {
        true
    }
}

/// V(l), in J. Infinite where it exceeds the number range.
#[inline]
pub fn energy<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> f64 {
    law.energy(Separation::between(x0, x1).length)
}

/// f₀ = −∂V/∂x₀ = T Δx/l on node 0, in N, Eq. 4. Node 1 feels −f₀.
///
/// Zero if the nodes coincide: exact for T(0) = 0, as with l₀ = 0; otherwise the
/// force has no direction there, and zero keeps the momentum.
#[inline]
pub fn force<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SVector<f64, D> {
    let dx = x1 - x0;
    let square = sum_of_squares(&dx);
    if is_safe_square(square) {
        let length = ComplexField::sqrt(square);
        // One division for all components.
        let per_length = law.tension(length) / length;
        if per_length.is_finite() {
            return dx * per_length;
        }
    }
    let separation = Separation::of(&dx);
    separation.direction * law.tension(separation.length)
}

/// Block B = ∂²V/∂x₀² in N/m, symmetric D × D, Eq. 8: the exact tangent. The
/// element Hessian is `[[B, −B], [−B, B]]`, Eq. 9.
///
/// B has the eigenvalue k along the spring and T/l across it; of a linear spring
/// K and K(1 − l₀/l): indefinite when l < l₀. If the nodes coincide B is k·I, exact
/// for T(0) = 0.
#[inline]
pub fn hessian_block<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(law, x0, x1, |across| across)
}

/// [`hessian_block`] with the across stiffness max(T/l, 0), in N/m.
///
/// The nearest positive semidefinite matrix to B in the Frobenius norm; k, too, is
/// clamped if it is negative.
#[inline]
pub fn hessian_block_clamped<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(law, x0, x1, |across| across.max(0.0))
}

/// [`hessian_block`] with the across stiffness |T/l|, in N/m.
#[inline]
pub fn hessian_block_absolute<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(law, x0, x1, f64::abs)
}

/// [`hessian_block`] with no across stiffness: k u uᵀ, in N/m.
///
/// If the nodes coincide it is k·I like the others.
#[inline]
pub fn hessian_block_material<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    block(law, x0, x1, |_| 0.0)
}

/// [`hessian_block`] with the across stiffness `tension`/l, in N/m, where the
/// tension in N is the caller's own (for example one carried from step to step)
/// instead of T; at most the [largest](LengthLaw::largest_stiffness) of the law,
/// which no spring exceeds: K(1 − l₀/l) ≤ K.
#[inline]
pub fn hessian_block_filtered<const D: usize>(
    law: impl LengthLaw,
    tension: f64,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    let separation = Separation::between(x0, x1);
    let across = (tension / separation.length).min(law.largest_stiffness());
    assemble_block(law.stiffness(separation.length), &separation, across)
}

/// Force and block of one spring at once: [`force`] in N, and the block in N/m
/// as (xx, xy, xz, yy, yz, zz), with across stiffness `project`(T/l), where T is
/// the tension `given` in N or else the spring's own, and T/l of a given one is
/// bounded as in [`hessian_block_filtered`]. `dx` = x₁ − x₀ in m.
#[inline(always)]
pub fn linearize(
    law: impl LengthLaw,
    given: Option<f64>,
    dx: &SVector<f64, 3>,
    project: impl Fn(f64) -> f64,
) -> (SVector<f64, 3>, [f64; 6]) {
    let square = sum_of_squares(dx);
    if is_safe_square(square) {
        let length = ComplexField::sqrt(square);
        let inverse = 1.0 / length;
        let own = law.tension(length);
        let per_length = own * inverse;
        if per_length.is_finite() {
            let across = project(match given {
                Some(tension) => (tension * inverse).min(law.largest_stiffness()),
                None => own * inverse,
            });
            let u = dx * inverse;
            let more = along_stiffness(&law, length, &project) - across;
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
    let own = law.tension(separation.length);
    let across = project(match given {
        Some(tension) => (tension / separation.length).min(law.largest_stiffness()),
        None => own / separation.length,
    });
    let along = along_stiffness(&law, separation.length, &project);
    let b = assemble_block(along, &separation, across);
    let block = [b.m11, b.m12, b.m13, b.m22, b.m23, b.m33];
    (separation.direction * own, block)
}

#[inline(always)]
fn block<const D: usize>(
    law: impl LengthLaw,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
    tangent: impl Fn(f64) -> f64,
) -> SMatrix<f64, D, D> {
    let separation = Separation::between(x0, x1);
    let across = law.tension(separation.length) / separation.length;
    let along = along_stiffness(&law, separation.length, &tangent);
    assemble_block(along, &separation, tangent(across))
}

/// k, or what the tangent makes of it where it is negative.
#[inline(always)]
fn along_stiffness(law: &impl LengthLaw, length: f64, tangent: impl Fn(f64) -> f64) -> f64 {
    let stiffness = law.stiffness(length);
    if law.is_convex() || stiffness >= 0.0 {
        stiffness
    } else {
        tangent(stiffness)
    }
}

/// across·(I − u uᵀ) + k·u uᵀ, or k·I for coincident nodes.
#[inline(always)]
fn assemble_block<const D: usize>(
    stiffness: f64,
    separation: &Separation<D>,
    across: f64,
) -> SMatrix<f64, D, D> {
    if separation.length == 0.0 {
        return SMatrix::identity() * stiffness;
    }
    let along = separation.along();
    (SMatrix::identity() - along) * across + along * stiffness
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
