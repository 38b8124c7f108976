//! Fixed steps over a duration.

/// How a duration is cut into steps of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepPlan {
    /// Simulated time, in s.
    pub duration: f64,
    /// Step size, in s.
    pub step_size: f64,
    /// Steps of exactly that size.
    pub whole_steps: u64,
    /// Size of a last, shorter step, in s.
    pub shortened: Option<f64>,
}

/// A duration this close to a whole number of steps, relatively, is that many.
const WHOLE: f64 = 1e-9;

impl StepPlan {
    /// Cuts `duration` into steps of `step_size`, both in s.
    pub fn new(duration: f64, step_size: f64) -> Self {
        let ratio = duration / step_size;
        let nearest = ratio.round();
        let whole = (ratio - nearest).abs() <= WHOLE * nearest;
        let whole_steps = if whole { nearest } else { ratio.floor() };
        let rest = (duration - whole_steps * step_size).max(0.0);
        Self {
            duration,
            step_size,
            whole_steps: whole_steps as u64,
            shortened: (!whole && rest > 0.0).then_some(rest),
        }
    }

    /// Cuts `duration` in s into `n` equal steps.
    pub(crate) fn equal(duration: f64, n: u64) -> Self {
        Self {
            duration,
            step_size: duration / n as f64,
            whole_steps: n,
            shortened: None,
        }
    }

    /// Number of steps, the shortened one included.
    pub fn n_steps(&self) -> u64 {
        self.whole_steps + u64::from(self.shortened.is_some())
    }

    /// Time at the end of step `step`, counted from 1, in s.
    pub fn end_of(&self, step: u64) -> f64 {
        if step >= self.n_steps() {
            self.duration
        } else {
            step as f64 * self.step_size
        }
    }

    /// Size of step `step`, counted from 1, in s.
    pub fn size_of(&self, step: u64) -> f64 {
        match self.shortened {
            Some(rest) if step == self.n_steps() => rest,
            _ => self.step_size,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_of_steps_stay_whole() {
        for (duration, step_size, steps) in [(1.0, 1.0 / 60.0, 60), (2.0, 0.1, 20), (0.3, 0.1, 3)] {
            let plan = StepPlan::new(duration, step_size);
            assert_eq!((plan.whole_steps, plan.shortened), (steps, None));
            assert_eq!(plan.end_of(steps), duration);
        }
    }

    #[test]
    fn the_last_step_is_shortened() {
        let plan = StepPlan::new(1.0, 0.3);
        assert_eq!(plan.n_steps(), 4);
        assert!((plan.shortened.unwrap() - 0.1).abs() < 1e-15);
        assert_eq!(plan.size_of(3), 0.3);
        assert_eq!(plan.size_of(4), plan.shortened.unwrap());
        assert_eq!((plan.end_of(3), plan.end_of(4)), (3.0 * 0.3, 1.0));
        // A step longer than the whole.
        let plan = StepPlan::new(0.5, 2.0);
        assert_eq!((plan.n_steps(), plan.shortened), (1, Some(0.5)));
    }

    #[test]
    fn no_duration_needs_no_step() {
        assert_eq!(StepPlan::new(0.0, 0.1).n_steps(), 0);
    }
}
