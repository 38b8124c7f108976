//! Laws that are powers of the strain.

use crate::spring::{LengthLaw, Spring};
use alloc::vec::Vec;
use nalgebra::ComplexField;

/// (l − l₀)/l₀, no less precise than l − l₀ near l₀, and finite, so that products with
/// a coefficient of zero are zero.
#[inline(always)]
pub(super) fn strain(length: f64, rest_length: f64) -> f64 {
    ((length - rest_length) / rest_length).min(f64::MAX)
}

/// |ε|ᵖ, finite likewise.
#[inline(always)]
fn power(strain: f64, exponent: f64) -> f64 {
    ComplexField::powf(strain.abs(), exponent).min(f64::MAX)
}

/// T = a₁ε + a₂ε² + …; V = l₀ Σ aᵢ εⁱ⁺¹/(i + 1).
///
/// There is no a₀, so that T(l₀) = 0. The chains of Fermi, Pasta, Ulam and Tsingou
/// (Los Alamos report LA-1940, 1955) have a₁, a₂ (α) and a₁, a₃ (β).
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    /// a₁, a₂, …, in N.
    pub coefficients: Vec<f64>,
    /// l₀, in m; positive.
    pub rest_length: f64,
}

impl Polynomial {
    /// Σ `factor`(i) aᵢ εⁱ⁻¹.
    #[inline(always)]
    fn sum(&self, strain: f64, factor: impl Fn(f64) -> f64) -> f64 {
        let coefficients = self.coefficients.iter().enumerate().rev();
        coefficients.fold(0.0, |sum, (index, a)| {
            sum * strain + a * factor((index + 1) as f64)
        })
    }
}

impl LengthLaw for Polynomial {
    fn energy(&self, length: f64) -> f64 {
        let strain = strain(length, self.rest_length);
        self.rest_length * (strain * (strain * self.sum(strain, |i| 1.0 / (i + 1.0))))
    }

    fn tension(&self, length: f64) -> f64 {
        let strain = strain(length, self.rest_length);
        strain * self.sum(strain, |_| 1.0)
    }

    fn stiffness(&self, length: f64) -> f64 {
        self.sum(strain(length, self.rest_length), |i| i) / self.rest_length
    }

    /// a₁/l₀ if no other coefficient is there, and infinite otherwise.
    fn largest_stiffness(&self) -> f64 {
        match self.coefficients.split_first() {
            None => 0.0,
            Some((&first, others)) if first >= 0.0 && others.iter().all(|&a| a == 0.0) => {
                first / self.rest_length
            }
            Some(_) => f64::INFINITY,
        }
    }

    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    fn set_spring(&mut self, spring: Spring) {
        self.rest_length = spring.rest_length;
    }

    /// Whether no coefficient is negative and 2j·a₂ⱼ ≤ (2j − 1)·a₂ⱼ₋₁ for each j: then
    /// l₀ k, in pairs of terms ε²ʲ⁻²((2j − 1)a₂ⱼ₋₁ + 2j a₂ⱼ ε), is not negative for
    /// ε ≥ −1. A law that is convex otherwise is not recognized.
    fn is_convex(&self) -> bool {
        let mut pairs = self.coefficients.chunks(2).enumerate();
        pairs.all(|(j, pair)| {
            let degree = (2 * j + 1) as f64;
            let even = pair.get(1).copied().unwrap_or(0.0);
            even >= 0.0 && (degree + 1.0) * even <= degree * pair[0]
        })
    }
}

/// T = K l₀ sign(ε)|ε|ᵖ, odd in ε; V = K l₀² |ε|ᵖ⁺¹/(p + 1).
///
/// K is the slope of the line from ε = 0 to 1. A spring that has p > 1 has no
/// stiffness at l₀. Contact of two balls is p = 3/2, F = C d^{3/2} with the overlap
/// d = l₀ − l, K = C √l₀ (Hertz 1882; Johnson, *Contact Mechanics*, 1985, chapter 4):
/// this law pulls likewise where they part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Power {
    /// K, in N/m; not negative.
    pub stiffness: f64,
    /// p, at least 1: below it k is infinite at l₀.
    pub exponent: f64,
    /// l₀, in m; positive.
    pub rest_length: f64,
}

impl LengthLaw for Power {
    #[inline]
    fn energy(&self, length: f64) -> f64 {
        let power = power(strain(length, self.rest_length), self.exponent + 1.0);
        self.stiffness * self.rest_length * self.rest_length * power / (self.exponent + 1.0)
    }

    #[inline]
    fn tension(&self, length: f64) -> f64 {
        let strain = strain(length, self.rest_length);
        self.stiffness * self.rest_length * power(strain, self.exponent).copysign(strain)
    }

    #[inline]
    fn stiffness(&self, length: f64) -> f64 {
        let power = power(strain(length, self.rest_length), self.exponent - 1.0);
        self.stiffness * self.exponent * power
    }

    /// K if p = 1, and infinite otherwise.
    #[inline]
    fn largest_stiffness(&self) -> f64 {
        if self.exponent == 1.0 {
            self.stiffness
        } else {
            f64::INFINITY
        }
    }

    #[inline]
    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    fn set_spring(&mut self, spring: Spring) {
        self.stiffness = spring.stiffness;
        self.rest_length = spring.rest_length;
    }

    #[inline]
    fn is_convex(&self) -> bool {
        true
    }
}
