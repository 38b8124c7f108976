//! A law that yields.

use crate::spring::{LengthLaw, Spring};

/// Elastic and plastic with linear kinematic hardening: T = K(l − l₀ − p), where the
/// elongation p that lasts changes as soon as |T − H p| would exceed Y, so that the stretched
/// spring goes on with the stiffness K′ = K H/(K + H) (Simo, Hughes: Computational
/// Inelasticity, 1998, 1.3).
///
/// V is that of a step that began with `elongation` and goes straight to the length:
/// ½K(l − l₀ − p)² + ½H p² + Y |change of p|, the least over all p. Its last part is lost when
/// the step stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    /// K, in N/m; positive.
    pub stiffness: f64,
    /// l₀ of the new spring, in m.
    pub rest_length: f64,
    /// Y, in N; not negative.
    pub yields_at: f64,
    /// K′, in N/m; not negative, and below K.
    pub hardening: f64,
    /// p so far, in m.
    pub elongation: f64,
}

impl Plastic {
    /// H, in N/m: 1/K′ = 1/K + 1/H.
    #[inline(always)]
    fn modulus(&self) -> f64 {
        self.stiffness * self.hardening / (self.stiffness - self.hardening)
    }

    /// By how much p changes on the way to a length, in m.
    #[inline(always)]
    fn change(&self, length: f64) -> f64 {
        let modulus = self.modulus();
        let stretch = length - self.rest_length - self.elongation;
        let driving = self.stiffness * stretch - modulus * self.elongation;
        let beyond = (driving.abs() - self.yields_at).max(0.0);
        (beyond / (self.stiffness + modulus)).copysign(driving)
    }
}

impl LengthLaw for Plastic {
    #[inline(always)]
    fn energy(&self, length: f64) -> f64 {
        let change = self.change(length);
        let elongation = self.elongation + change;
        let stretch = length - self.rest_length - elongation;
        let stored = self.stiffness * stretch * stretch + self.modulus() * elongation * elongation;
        0.5 * stored + self.yields_at * change.abs()
    }

    #[inline(always)]
    fn tension(&self, length: f64) -> f64 {
        let elongation = self.elongation + self.change(length);
        self.stiffness * (length - self.rest_length - elongation)
    }

    #[inline(always)]
    fn stiffness(&self, length: f64) -> f64 {
        if self.change(length) == 0.0 {
            self.stiffness
        } else {
            self.hardening
        }
    }

    fn largest_stiffness(&self) -> f64 {
        self.stiffness
    }

    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    fn set_spring(&mut self, spring: Spring) {
        self.stiffness = spring.stiffness;
        self.rest_length = spring.rest_length;
    }

    fn is_convex(&self) -> bool {
        true
    }

    fn has_memory(&self) -> bool {
        true
    }

    /// By the length, also where a tension is known: that of the law ends where it yields.
    fn update_memory(&mut self, length: f64, _known: Option<f64>) -> f64 {
        let change = self.change(length);
        self.elongation += change;
        self.yields_at * change.abs()
    }

    fn elongation(&self) -> f64 {
        self.elongation
    }

    fn each_memory(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        visit(&mut self.elongation);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEW: Plastic = Plastic {
        stiffness: 100.0,
        rest_length: 2.0,
        yields_at: 5.0,
        hardening: 20.0,
        elongation: 0.0,
    };

    /// Up to 2.15 m, down to 1.85 m and back: the sides of the loop have K, then K′, and
    /// are 2 Y high; what is lost is its area.
    #[test]
    fn a_cycle_is_a_parallelogram() {
        let mut spring = NEW;
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a}, {b}");
        near(spring.tension(2.05), 5.0);
        near(spring.tension(2.15), 5.0 + 20.0 * 0.1);
        near(spring.stiffness(2.15), 20.0);
        let first = spring.update_memory(2.15, None);
        near(spring.tension(2.15), 7.0);
        near(spring.tension(2.05), -3.0);
        near(spring.tension(1.85), -3.0 - 20.0 * 0.2);
        let down = spring.update_memory(1.85, None);
        near(spring.tension(1.85), -7.0);
        let up = spring.update_memory(2.15, None);
        near(spring.tension(2.15), 7.0);
        // p goes from 0 to 0.08 m, to −0.08 m, and back.
        near(first, 5.0 * 0.08);
        near(down, 5.0 * 0.16);
        near(up, 5.0 * 0.16);
        // 10 N high, 0.2 m wide at T of the yielding side, without the elastic part.
        let area: f64 = {
            let n = 20_000;
            let mut spring = Plastic {
                elongation: 0.08,
                ..NEW
            };
            let way = |k: usize| 2.0 + 0.15 * (std::f64::consts::TAU * k as f64 / n as f64).cos();
            let mut work = 0.0;
            for k in 0..n {
                let [from, to] = [way(k), way(k + 1)];
                work += 0.5 * (spring.tension(from) + spring.tension(to)) * (to - from);
                spring.update_memory(to, None);
            }
            work
        };
        assert!((area - (down + up)).abs() < 1e-5, "{area}, {}", down + up);
    }

    /// T = V′ and k = T′ on both sides of where it yields.
    #[test]
    fn tension_is_the_slope_of_energy() {
        let spring = Plastic {
            elongation: 0.03,
            ..NEW
        };
        for length in [1.5, 1.9, 1.99, 2.01, 2.06, 2.2, 3.0] {
            let h = 1e-6;
            let slope = (spring.energy(length + h) - spring.energy(length - h)) / (2.0 * h);
            assert!((slope - spring.tension(length)).abs() < 1e-7, "{length}");
            let slope = (spring.tension(length + h) - spring.tension(length - h)) / (2.0 * h);
            assert!((slope - spring.stiffness(length)).abs() < 1e-6, "{length}");
        }
    }

    /// What is lost is the difference of V before and after.
    #[test]
    fn the_loss_is_a_difference_of_energies() {
        let mut spring = NEW;
        let before = spring.energy(2.3);
        let lost = spring.update_memory(2.3, None);
        assert!((before - spring.energy(2.3) - lost).abs() < 1e-13);
        assert_eq!(spring.elongation(), spring.elongation);
    }
}
