//! Length and direction of a spring, safe at every magnitude.

use nalgebra::{ComplexField, SVector};

/// Nodes closer than this, in m, have no usable direction and count as
/// coincident. It keeps l₀/l finite for every l₀ up to 1e100 m.
pub const COINCIDENT: f64 = 1e-200;

/// Squared lengths in this range, in m², neither overflow nor lose digits.
pub const SAFE_SQUARES: core::ops::RangeInclusive<f64> = 1e-280..=1e300;

/// Whether a length whose square was computed as `square` may be taken as the
/// plain square root.
#[inline(always)]
pub(crate) fn is_safe_square(square: f64) -> bool {
    SAFE_SQUARES.contains(&square)
}

/// Δx = x₁ − x₀ (m) as a length l and a unit direction u.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation<const D: usize> {
    /// l = ‖Δx‖ in m; zero if the nodes coincide.
    pub length: f64,
    /// u = Δx/l; zero if the nodes coincide.
    pub direction: SVector<f64, D>,
}

impl<const D: usize> Separation<D> {
    /// Separation of the nodes at `x0` and `x1`, in m.
    #[inline]
    pub fn between(x0: &SVector<f64, D>, x1: &SVector<f64, D>) -> Self {
        Self::of(&(x1 - x0))
    }

    /// Separation with the given difference of positions, in m.
    ///
    /// The length is accurate to rounding from [`COINCIDENT`] to the largest
    /// finite number: where the plain sum of squares would overflow or lose
    /// digits, Δx is scaled first.
    #[inline]
    pub fn of(dx: &SVector<f64, D>) -> Self {
        let length = length(dx);
        if length < COINCIDENT {
            return Self {
                length: 0.0,
                direction: SVector::zeros(),
            };
        }
        Self {
            length,
            direction: dx / length,
        }
    }

    /// u uᵀ, the projection onto the spring's direction.
    #[inline]
    pub fn along(&self) -> nalgebra::SMatrix<f64, D, D> {
        self.direction * self.direction.transpose()
    }
}

#[inline]
fn length<const D: usize>(dx: &SVector<f64, D>) -> f64 {
    let square = sum_of_squares(dx);
    if is_safe_square(square) {
        return ComplexField::sqrt(square);
    }
    let scale = dx.amax();
    if scale == 0.0 || !scale.is_finite() {
        return scale;
    }
    scale * ComplexField::sqrt(sum_of_squares(&(dx / scale)))
}

/// In the order of the coordinates.
#[inline]
pub(crate) fn sum_of_squares<const D: usize>(dx: &SVector<f64, D>) -> f64 {
    let mut sum = 0.0;
    for &component in dx.iter() {
        sum += component * component;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn lengths_are_accurate_at_every_magnitude() {
        for exponent in (-190..=300).step_by(7) {
            let scale = format!("1e{exponent}").parse::<f64>().unwrap();
            let separation = Separation::of(&Vector3::new(2.0, -3.0, 6.0).map(|c| c * scale));
            let relative = separation.length / (7.0 * scale) - 1.0;
            assert!(relative.abs() < 4e-16, "1e{exponent}: {relative:e}");
            assert!((separation.direction.norm() - 1.0).abs() < 4e-16);
        }
    }

    #[test]
    fn coincident_nodes_have_no_direction() {
        for dx in [Vector3::zeros(), Vector3::new(1e-201, 0.0, -1e-300)] {
            let separation = Separation::of(&dx);
            assert_eq!(separation.length, 0.0);
            assert_eq!(separation.direction, Vector3::zeros());
        }
    }

    #[test]
    fn not_a_number_stays_visible() {
        let dx = Vector3::new(f64::NAN, 0.0, 1.0);
        assert!(Separation::of(&dx).length.is_nan());
    }
}
