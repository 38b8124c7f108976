//! Dashpot along a spring: it resists the change of the spring's length.
//!
//! With u = Δx/l and w = v₁ − v₀, node 0 feels f₀ = c (w·u) u and node 1 feels
//! −f₀. Forces depend on positions through u alone. If the nodes coincide there
//! is no direction, and force and derivatives are zero.

use crate::Separation;
use nalgebra::{SMatrix, SVector};

/// One dashpot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dashpot {
    /// c, in N·s/m; not negative.
    pub damping: f64,
}

/// f₀ = c (w·u) u on node 0, in N. Node 1 feels −f₀.
///
/// Positions in m, velocities in m/s.
#[inline]
pub fn force<const D: usize>(
    dashpot: Dashpot,
    x: [&SVector<f64, D>; 2],
    v: [&SVector<f64, D>; 2],
) -> SVector<f64, D> {
    let u = Separation::between(x[0], x[1]).direction;
    u * (dashpot.damping * u.dot(&(v[1] - v[0])))
}

/// The heat it produces, c (w·u)², in W; never negative.
#[inline]
pub fn dissipation<const D: usize>(
    dashpot: Dashpot,
    x: [&SVector<f64, D>; 2],
    v: [&SVector<f64, D>; 2],
) -> f64 {
    let rate = Separation::between(x[0], x[1])
        .direction
        .dot(&(v[1] - v[0]));
    dashpot.damping * rate * rate
}

/// Block C = −∂f₀/∂v₀ = c u uᵀ, in N·s/m, symmetric positive semidefinite. The
/// element's damping matrix is `[[C, −C], [−C, C]]`.
#[inline]
pub fn damping_block<const D: usize>(
    dashpot: Dashpot,
    x0: &SVector<f64, D>,
    x1: &SVector<f64, D>,
) -> SMatrix<f64, D, D> {
    Separation::between(x0, x1).along() * dashpot.damping
}

/// Block G = −∂f₀/∂x₀ = (c/l)[u (P w)ᵀ + (w·u) P] with P = I − u uᵀ, in N/m.
/// Not symmetric. The element's matrix is `[[G, −G], [−G, G]]`.
#[inline]
pub fn position_block<const D: usize>(
    dashpot: Dashpot,
    x: [&SVector<f64, D>; 2],
    v: [&SVector<f64, D>; 2],
) -> SMatrix<f64, D, D> {
    let separation = Separation::between(x[0], x[1]);
    if separation.length == 0.0 {
        return SMatrix::zeros();
    }
    let u = separation.direction;
    let w = v[1] - v[0];
    let rate = u.dot(&w);
    let across = SMatrix::identity() - separation.along();
    let turning = u * (w - u * rate).transpose();
    (turning + across * rate) * (dashpot.damping / separation.length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const DASHPOT: Dashpot = Dashpot { damping: 3.0 };

    #[test]
    fn a_case_by_hand() {
        // u = x, w = (2, 5, 0): the rate is 2, the force 6 along x.
        let (x0, x1) = (Vector3::zeros(), Vector3::new(4.0, 0.0, 0.0));
        let (v0, v1) = (Vector3::new(1.0, 0.0, 0.0), Vector3::new(3.0, 5.0, 0.0));
        let force = force(DASHPOT, [&x0, &x1], [&v0, &v1]);
        assert_eq!(force, Vector3::new(6.0, 0.0, 0.0));
        assert_eq!(dissipation(DASHPOT, [&x0, &x1], [&v0, &v1]), 12.0);
        // The force on both ends removes energy at the rate of the heat.
        assert_eq!(force.dot(&v0) - force.dot(&v1), -12.0);
    }

    #[test]
    fn coincident_nodes_feel_nothing() {
        let x = Vector3::new(1.0, 1.0, 1.0);
        let v = Vector3::new(3.0, 0.0, 0.0);
        assert_eq!(force(DASHPOT, [&x, &x], [&v, &-v]), Vector3::zeros());
        assert_eq!(damping_block(DASHPOT, &x, &x).norm(), 0.0);
        assert_eq!(position_block(DASHPOT, [&x, &x], [&v, &-v]).norm(), 0.0);
    }
}
