//! Uniform gravity g (m/s²) on a point mass m (kg).

use nalgebra::SVector;

/// V = −m g·x, in J; zero at the origin. Its Hessian is zero.
#[inline]
pub fn energy<const D: usize>(mass: f64, gravity: &SVector<f64, D>, x: &SVector<f64, D>) -> f64 {
    -mass * gravity.dot(x)
}

/// f = −∂V/∂x = m g, in N.
#[inline]
pub fn force<const D: usize>(mass: f64, gravity: &SVector<f64, D>) -> SVector<f64, D> {
    gravity * mass
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn force_is_minus_the_slope_of_the_energy() {
        let g = Vector2::new(0.0, -9.81);
        let (x, step) = (Vector2::new(3.0, 2.0), Vector2::new(0.0, 1.0));
        let slope = energy(2.0, &g, &(x + step)) - energy(2.0, &g, &x);
        assert!((force(2.0, &g).y + slope).abs() < 1e-14);
    }
}
