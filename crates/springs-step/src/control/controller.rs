//! Step sizes from error estimates.

use crate::{Archive, ErrorEstimate, StepPlan};

/// Where the next step comes from.
pub(crate) enum Schedule {
    Fixed(StepPlan),
    Adaptive(Controller),
    /// Trial runs settle it before the first step; so far nothing moves. The
    /// controller is what the tolerance would begin with.
    Open(Controller),
}

/// A proportional–integral controller (Gustafsson, ACM TOMS 17, 1991) that
/// keeps the estimated error of the whole duration at the tolerance.
///
/// The tolerance is shared out by time: a step may add to the error at a rate
/// of tolerance/duration, so that the error at the end is in proportion to the
/// tolerance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Controller {
    allowed_rate: f64,
    duration: f64,
    /// Time that is left, in s.
    left: f64,
    step_size: f64,
    last_ratio: f64,
    just_rejected: bool,
}

/// What becomes of an attempted step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Accept,
    Reject,
}

const SAFETY: f64 = 0.85;
const CLEAR: f64 = 0.1;
const LARGEST_GROWTH: f64 = 5.0;
/// Suitable sizes are at most so many times that of the attempt.
pub(crate) const MOST_SUITABLE: f64 = 10.0;
const SMALLEST_SHRINKAGE: f64 = 0.1;

impl Controller {
    /// `tolerance` in m, `duration` and the size of the first step in s.
    pub(crate) fn new(tolerance: f64, duration: f64, first_step: f64) -> Self {
        Self {
            allowed_rate: tolerance / duration,
            duration,
            left: duration,
            step_size: first_step.min(duration),
            last_ratio: 1.0,
            just_rejected: false,
        }
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        for real in [&mut self.left, &mut self.step_size, &mut self.last_ratio] {
            archive.real(real);
        }
        archive.flag(&mut self.just_rejected);
    }

    /// Goes on with this step size, in s, as with another method or changed forces.
    pub(crate) fn begin_with(&mut self, step_size: f64) {
        self.step_size = step_size.min(self.duration);
        self.last_ratio = 1.0;
    }

    /// What the last step said of the next one does not hold: something broke.
    pub(crate) fn begin_anew(&mut self) {
        self.last_ratio = 1.0;
    }

    /// The error allowed at the end, in m.
    pub(crate) fn tolerance(&self) -> f64 {
        self.allowed_rate * self.duration
    }

    /// Of all steps together, in s.
    pub(crate) fn duration(&self) -> f64 {
        self.duration
    }

    /// Time that is left, in s.
    pub(crate) fn left(&self) -> f64 {
        self.left
    }

    /// The size of step that an attempt of size `h` suggests.
    pub(crate) fn suitable(&self, h: f64, estimate: ErrorEstimate) -> f64 {
        let ratio = (estimate.rate / self.allowed_rate).max(1e-10);
        let factor = SAFETY * ratio.powf(-1.0 / estimate.exponent);
        h * if factor.is_nan() {
            0.1
        } else {
            factor.clamp(0.1, MOST_SUITABLE)
        }
    }

    /// Size of the next step, in s.
    pub(crate) fn step_size(&self) -> f64 {
        self.step_size
    }

    /// Whether the estimate is so low that a sharper one is not worth having.
    /// Far below what is accepted: else the step would settle where this one is
    /// just good enough, and never learn that it could be longer.
    pub(crate) fn is_clear(&self, estimate: ErrorEstimate) -> bool {
        estimate.rate <= CLEAR * self.allowed_rate
    }

    /// Judges a step of size `h`, which may be shorter than the one proposed.
    pub(crate) fn judge(&mut self, h: f64, estimate: ErrorEstimate) -> Verdict {
        let ratio = estimate.rate / self.allowed_rate;
        if ratio > 1.0 || ratio.is_nan() {
            let factor = SAFETY * ratio.powf(-1.0 / estimate.exponent);
            self.shrink(h, factor);
            return Verdict::Reject;
        }
        // Aimed at a step that is shorter than allowed by the safety factor.
        let ratio = (ratio / SAFETY.powf(estimate.exponent)).max(1e-10);
        let mut factor =
            ratio.powf(-0.7 / estimate.exponent) * self.last_ratio.powf(0.4 / estimate.exponent);
        if self.just_rejected {
            factor = factor.min(1.0);
        }
        let proposed = h * factor.clamp(SMALLEST_SHRINKAGE, LARGEST_GROWTH);
        // A step that was cut short at the end says little about longer ones.
        if h >= 0.5 * self.step_size || proposed > self.step_size {
            self.step_size = proposed.min(self.duration);
        }
        self.last_ratio = ratio;
        self.just_rejected = false;
        self.left -= h;
        Verdict::Accept
    }

    /// A step of size `h` could not be made at all.
    pub(crate) fn fail(&mut self, h: f64) {
        self.shrink(h, 0.25);
    }

    fn shrink(&mut self, h: f64, factor: f64) {
        // Not a number shrinks as much as possible.
        let factor = if factor.is_nan() { 0.0 } else { factor };
        self.step_size = h * factor.clamp(SMALLEST_SHRINKAGE, 0.9);
        self.just_rejected = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With an error rate of c·h² the controller settles where c·h² is just
    /// below the allowed rate.
    #[test]
    fn it_settles_below_the_tolerance() {
        for c in [1e-3, 1.0, 1e6] {
            let mut controller = Controller::new(1e-4, 2.0, 1e-6);
            let mut accepted = 0;
            for _ in 0..200 {
                let h = controller.step_size();
                let estimate = ErrorEstimate {
                    rate: c * h * h,
                    exponent: 2.0,
                    block: 0,
                };
                accepted += usize::from(controller.judge(h, estimate) == Verdict::Accept);
            }
            let h = controller.step_size();
            let ideal = (0.5e-4 / c).sqrt().min(2.0);
            assert!(h > 0.7 * ideal && h <= ideal, "{h} for {ideal}");
            assert!(accepted > 190);
        }
    }

    #[test]
    fn not_a_number_is_rejected() {
        let mut controller = Controller::new(1e-4, 1.0, 0.5);
        let estimate = ErrorEstimate {
            rate: f64::NAN,
            exponent: 2.0,
            block: 0,
        };
        assert_eq!(controller.judge(0.5, estimate), Verdict::Reject);
        assert_eq!(controller.step_size(), 0.05);
    }
}
