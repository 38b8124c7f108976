//! Dashpot along a spring: it resists the change of the spring's length.
//!
//! With u = Δx/l and w = v₁ − v₀, node 0 feels f₀ = c (w·u) u and node 1 feels
//! −f₀. Forces depend on positions through u alone. If the nodes coincide there
//! is no direction, and force and derivatives are zero.

use crate::Separation;
use nalgebra::{RealField, SMatrix, SVector, Vector3};

/// One dashpot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dashpot {
    /// c, in N·s/m; not negative.
    pub damping: f64,
}

/// Where a dashpot acts: it fades with a spring that pulls or pushes only.
///
/// Over a width w its damping is c·φ(u) with φ = u³(10 − 15u + 6u²), the one polynomial
/// of degree 5 that goes from 0 at u = 0 to 1 at u = 1 with two derivatives of zero
/// at both ends, so that forces are as smooth as those of a
/// [tension-only law](crate::law::TensionOnly).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fading {
    /// At any length.
    Nowhere,
    /// Not below `length`, with all of c from `length` + `width` on.
    Below {
        /// In m.
        length: f64,
        /// w in m; c sets in at once if zero.
        width: f64,
    },
    /// Not above `length`, with all of c up to `length` − `width`.
    Above {
        /// In m.
        length: f64,
        /// w in m; c sets in at once if zero.
        width: f64,
    },
}

impl Fading {
    /// The part of c that acts at a length in m, and what it changes by with it, in 1/m.
    #[inline]
    pub fn at(&self, length: f64) -> (f64, f64) {
        let (stretch, width, side) = match *self {
            Self::Nowhere => return (1.0, 0.0),
            Self::Below {
                length: least,
                width,
            } => (length - least, width, 1.0),
            Self::Above {
                length: most,
                width,
            } => (most - length, width, -1.0),
        };
        if stretch <= 0.0 {
            (0.0, 0.0)
        } else if stretch >= width {
            (1.0, 0.0)
        } else {
            let u = stretch / width;
            let factor = u * u * u * (10.0 - u * (15.0 - 6.0 * u));
            let slope = 30.0 * u * u * (1.0 - u) * (1.0 - u);
            (factor, side * slope / width)
        }
    }
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

/// The heat, in J, that it produces when Δx goes from `start` to `end`, in m, at
/// constant velocity in a time `h`, in s: ∫ c (w·u)² dt.
///
/// With the distance r that Δx passes the origin at, and the angle θ that it
/// turns by, this is (c/h)‖Δ‖(‖Δ‖ − rθ), where Δ is the way and r‖Δ‖ = q the
/// norm of start × end.
#[inline]
pub fn heat_of_passage(dashpot: Dashpot, start: &Vector3<f64>, end: &Vector3<f64>, h: f64) -> f64 {
    let q = start.cross(end).norm();
    let angle = RealField::atan2(q, start.dot(end));
    let heat = dashpot.damping / h * ((end - start).norm_squared() - q * angle);
    heat.max(0.0)
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

    /// Differences of 1e-6 m with an error of φ‴ h²/6.
    #[test]
    fn dashpots_fade_smoothly() {
        let (length, width) = (2.0, 0.5);
        let below = Fading::Below { length, width };
        let above = Fading::Above { length, width };
        assert_eq!(below.at(2.0), (0.0, 0.0));
        assert_eq!(below.at(2.25), (0.5, 3.75));
        assert_eq!(below.at(2.5), (1.0, 0.0));
        assert_eq!(above.at(1.75), (0.5, -3.75));
        assert_eq!(Fading::Nowhere.at(0.0), (1.0, 0.0));
        for k in 0..100 {
            let (l, h) = (1.4 + 0.012 * f64::from(k), 1e-6);
            for fading in [below, above] {
                let difference = (fading.at(l + h).0 - fading.at(l - h).0) / (2.0 * h);
                assert!(
                    (fading.at(l).1 - difference).abs() < 1e-8,
                    "{fading:?} at {l}"
                );
            }
        }
        let kink = Fading::Below { length, width: 0.0 };
        assert_eq!([kink.at(2.0).0, kink.at(2.1).0], [0.0, 1.0]);
    }

    #[test]
    fn coincident_nodes_feel_nothing() {
        let x = Vector3::new(1.0, 1.0, 1.0);
        let v = Vector3::new(3.0, 0.0, 0.0);
        assert_eq!(force(DASHPOT, [&x, &x], [&v, &-v]), Vector3::zeros());
        assert_eq!(damping_block(DASHPOT, &x, &x).norm(), 0.0);
        assert_eq!(position_block(DASHPOT, [&x, &x], [&v, &-v]).norm(), 0.0);
    }

    /// Along a line the rate of length is the whole velocity; on a half turn
    /// around the origin it is compared with Simpson's rule on 2000 intervals.
    #[test]
    fn the_heat_of_a_passage_is_the_integral_of_the_dissipation() {
        let (h, ahead) = (0.5, Vector3::new(1.0, 0.0, 0.0));
        let along = heat_of_passage(DASHPOT, &ahead, &(ahead * 3.0), h);
        assert!((along - 3.0 * 4.0 * 4.0 * h).abs() < 1e-13);
        let (start, end) = (Vector3::new(1.0, 0.2, 0.1), Vector3::new(-0.7, 0.6, -0.3));
        let velocity = (end - start) / h;
        let power = |t: f64| {
            let x = start + velocity * t;
            let zero = Vector3::zeros();
            dissipation(DASHPOT, [&zero, &x], [&zero, &velocity])
        };
        let (n, mut sum) = (2000, 0.0);
        for i in 0..n {
            let (a, b) = (f64::from(i) / 2000.0 * h, f64::from(i + 1) / 2000.0 * h);
            sum += (b - a) / 6.0 * (power(a) + 4.0 * power(0.5 * (a + b)) + power(b));
        }
        let heat = heat_of_passage(DASHPOT, &start, &end, h);
        assert!((heat - sum).abs() < 1e-10 * sum, "{heat} {sum}");
        assert_eq!(heat_of_passage(DASHPOT, &start, &start, h), 0.0);
    }
}
