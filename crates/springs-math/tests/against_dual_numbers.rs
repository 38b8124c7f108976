//! Forces and Hessians against automatic differentiation of the energy, which
//! shares no formula with the kernels.
//!
//! The comparison runs from lengths of 1e-160 to 5e200. Dual numbers cannot
//! square such lengths, so both K-homogeneous quantities are differentiated at
//! Δx/s with l₀/s, s a power of two (exact), and scaled back: the energy is
//! homogeneous of degree 2 in (x, l₀), the force of degree 1, the Hessian of
//! degree 0.

use nalgebra::{Matrix3, SVector, Vector3};
use num_dual::{DualNum, hessian, jacobian};
use springs_math::dashpot::{self, Dashpot};
use springs_math::spring::{self, Spring};

/// Eq. 1 in plain components.
fn scaled_energy<T: DualNum<Primitive = f64>>(
    spring: Spring,
    rest_length: f64,
    x0: &SVector<T, 3>,
    x1: &Vector3<f64>,
) -> T {
    let d: [T; 3] = std::array::from_fn(|k| -x0[k].clone() + x1[k]);
    let stretch = dot(&d, &d).sqrt() - rest_length;
    stretch.clone() * stretch * (0.5 * spring.stiffness)
}

fn dot<T: DualNum<Primitive = f64>>(a: &[T; 3], b: &[T; 3]) -> T {
    a[0].clone() * b[0].clone() + a[1].clone() * b[1].clone() + a[2].clone() * b[2].clone()
}

/// The force on node 0 of a dashpot as a function of (x₀, v₀).
fn dashpot_force<T: DualNum<Primitive = f64>>(
    dashpot: Dashpot,
    state: &SVector<T, 6>,
    x1: &Vector3<f64>,
    v1: &Vector3<f64>,
) -> SVector<T, 3> {
    let d: [T; 3] = std::array::from_fn(|k| -state[k].clone() + x1[k]);
    let w: [T; 3] = std::array::from_fn(|k| -state[k + 3].clone() + v1[k]);
    let factor = dot(&d, &w) / dot(&d, &d) * dashpot.damping;
    SVector::from_fn(|k, _| d[k].clone() * factor.clone())
}

/// Force and Hessian block of node 0 by dual numbers.
fn reference(spring: Spring, dx: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let scale = 2f64.powi(dx.amax().log2().floor() as i32);
    let scaled = dx / scale;
    let (_, gradient, hessian) = hessian(
        |x0| scaled_energy(spring, spring.rest_length / scale, &x0, &scaled),
        &Vector3::zeros(),
    );
    (-gradient * scale, hessian)
}

/// Directions well away from special positions, and on the axes.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let golden = 2.399963229728653;
    (0..40)
        .map(move |k| {
            let z: f64 = 1.0 - (2.0 * k as f64 + 1.0) / 40.0;
            let r = (1.0 - z * z).sqrt();
            let angle = golden * k as f64;
            Vector3::new(r * angle.cos(), r * angle.sin(), z)
        })
        .chain([Vector3::x(), -Vector3::y(), Vector3::z()])
}

#[test]
fn force_and_hessian_at_every_length() {
    let lengths = [
        1e-160, 3e-90, 1e-8, 0.1, 0.999999, 1.0, 2.5, 1e6, 7e100, 5e200,
    ];
    let mut compared = 0;
    for direction in directions() {
        for length in lengths {
            // Rest lengths: none, shorter, equal, longer, unrelated.
            for rest_length in [0.0, 0.3 * length, length, 4.0 * length, 1.0] {
                let spring = Spring {
                    stiffness: 250.0,
                    rest_length,
                };
                let dx = direction * length;
                let (force, hessian) = reference(spring, &dx);
                // T is a difference of l and l₀: its rounding is relative to
                // the larger of the two.
                let scale = spring.stiffness * length.max(rest_length);
                let error = (spring::force(spring, &Vector3::zeros(), &dx) - force).amax();
                assert!(
                    error <= 1e-13 * scale,
                    "force at l = {length:e}, l0 = {rest_length:e}: {:e}",
                    error / scale
                );
                let block = spring::hessian_block(spring, &Vector3::zeros(), &dx);
                let error = (block - hessian).amax() / hessian.amax();
                assert!(
                    error <= 1e-12,
                    "Hessian at l = {length:e}, l0 = {rest_length:e}: {error:e}"
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 43 * 10 * 5);
}

#[test]
fn dashpot_derivatives() {
    let dashpot = Dashpot { damping: 4.5 };
    let x1 = Vector3::new(0.9, -0.4, 0.3);
    let v1 = Vector3::new(-1.0, 0.7, 2.0);
    for direction in directions() {
        let x0 = direction * 0.7;
        let v0 = Vector3::new(direction.z, -direction.x, 0.3);
        let (force, derivative) = jacobian(
            |state| dashpot_force(dashpot, &state, &x1, &v1),
            &SVector::<f64, 6>::from_iterator(x0.iter().chain(v0.iter()).copied()),
        );
        let ours = dashpot::force(dashpot, [&x0, &x1], [&v0, &v1]);
        assert!((ours - force).amax() < 1e-13 * force.amax().max(1.0));
        let by_position = dashpot::position_block(dashpot, [&x0, &x1], [&v0, &v1]);
        let expected = -derivative.fixed_view::<3, 3>(0, 0);
        assert!((by_position - expected).amax() < 1e-12 * expected.amax());
        let by_velocity = dashpot::damping_block(dashpot, &x0, &x1);
        let expected = -derivative.fixed_view::<3, 3>(0, 3);
        assert!((by_velocity - expected).amax() < 1e-12 * expected.amax());
    }
}
