//! Steps of equal size from trial runs.

use crate::{Anchors, Interval, Method, State, StepPlan, Work};
use nalgebra::Vector3;
use springs_assembly::System;

/// How many equal steps a method needs for a tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EqualSteps {
    pub(crate) n: u64,
    /// Estimated error at the end, in m.
    pub(crate) error: f64,
}

impl std::fmt::Display for EqualSteps {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "trial runs with fewer steps promise an error of {:.0e} m",
            self.error
        )
    }
}

/// The coarsest trial run.
const FEWEST: u64 = 8;
/// Where errors fall as the order says, predictions are trusted this much
/// further.
const TRUSTED: f64 = 4.0;
/// Aimed at an error this much below the tolerance.
const MARGIN: f64 = 1.5;
/// Errors fall as the order says if their ratio is within this factor of it.
const REGULAR: f64 = 2.0;

/// Finds the number of equal steps from whole runs with 8, 16, 32, … of them,
/// by Richardson's estimate of the error at the end (Hairer, Nørsett, Wanner:
/// Solving Ordinary Differential Equations I, 1993, II.4). For methods that
/// must not change their step on the way. Trial runs end where their number of
/// steps is a quarter of those needed, so they cost at most half of the run.
///
/// `None` if that takes more than `affordable` steps in trial runs.
pub(crate) fn equal_steps(
    (system, anchors): (&System, &Anchors),
    method: &mut dyn Method,
    (duration, tolerance): (f64, f64),
    affordable: f64,
    work: &mut Work,
) -> Option<EqualSteps> {
    let order = method.order() as i32;
    let gain = 2f64.powi(order);
    let mut coarse: Option<Vec<Vector3<f64>>> = None;
    let mut coarse_error = f64::INFINITY;
    let (mut n, mut made) = (FEWEST, 0.0);
    loop {
        made += n as f64;
        if made > affordable {
            return None;
        }
        let fine = run((system, anchors), method, duration, n, work);
        let error = match (&coarse, &fine) {
            (Some(coarse), Some(fine)) => distance(coarse, fine) / (gain - 1.0),
            _ => f64::INFINITY,
        };
        // Not a number, too, is too large.
        if error <= tolerance / MARGIN {
            return Some(EqualSteps { n, error });
        }
        let falls = coarse_error / error;
        let is_regular = (gain / REGULAR..gain * REGULAR).contains(&falls);
        let needed = n as f64 * (MARGIN * error / tolerance).powf(1.0 / f64::from(order));
        if is_regular && needed <= TRUSTED * n as f64 {
            return Some(EqualSteps {
                n: needed.ceil() as u64,
                error: tolerance / MARGIN,
            });
        }
        (coarse, coarse_error) = (fine, error);
        n *= 2;
    }
}

/// Positions of the free blocks at the end of `n` equal steps; `None` if a step
/// fails.
fn run(
    (system, anchors): (&System, &Anchors),
    method: &mut dyn Method,
    duration: f64,
    n: u64,
    work: &mut Work,
) -> Option<Vec<Vector3<f64>>> {
    let plan = StepPlan::equal(duration, n);
    let mut state = State::initial(system);
    method.restart();
    for step in 1..=n {
        let interval = Interval {
            start: state.time,
            end: plan.end_of(step),
            size: plan.size_of(step),
        };
        method
            .step(system, anchors, interval, &mut state, work)
            .ok()?;
        method.accept();
        state.time = interval.end;
    }
    state.x.truncate(system.n_free());
    Some(state.x)
}

fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let distances = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    // `f64::max` would lose what is not a number.
    distances.fold(0.0, |largest, d| {
        if d > largest || d.is_nan() {
            d
        } else {
            largest
        }
    })
}
