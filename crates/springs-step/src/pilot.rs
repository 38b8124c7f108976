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

/// Steps of the coarsest trial run, and times at which runs are compared.
const FEWEST: u64 = 8;
/// Where errors fall as the order says, predictions are trusted this much
/// further.
const TRUSTED: f64 = 4.0;
/// Aimed at an error this much below the tolerance.
const MARGIN: f64 = 1.5;
/// Errors fall as the order says if their ratio is within this factor of it.
const REGULAR: f64 = 2.0;

/// Finds the number of equal steps from whole runs with 8, 16, 32, … of them,
/// by Richardson's estimate of the error (Hairer, Nørsett, Wanner: Solving
/// Ordinary Differential Equations I, 1993, II.4). For methods that must not
/// change their step on the way. Trial runs end where their number of steps is a
/// quarter of those needed, so they cost at most half of the run.
///
/// Two runs may agree by accident: both miss a vibration, or their errors cross
/// at the end. So runs are compared at eight times on the way, and an estimate is
/// not trusted to be smaller than the one before by more than twice what the
/// order says: three runs have to agree.
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
    let mut coarse: Option<Samples> = None;
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
        let falls = coarse_error / error;
        let trusted = error.max(coarse_error / (gain * REGULAR));
        // Not a number, too, is too large.
        if trusted <= tolerance / MARGIN {
            return Some(EqualSteps { n, error: trusted });
        }
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

/// Positions of the free blocks, in m, at equally spaced times.
type Samples = Vec<Vec<Vector3<f64>>>;

/// What comes of `n` equal steps; `None` if a step fails.
fn run(
    (system, anchors): (&System, &Anchors),
    method: &mut dyn Method,
    duration: f64,
    n: u64,
    work: &mut Work,
) -> Option<Samples> {
    let plan = StepPlan::equal(duration, n);
    let mut state = State::initial(system);
    let mut samples = Samples::new();
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
        if step.is_multiple_of(n / FEWEST) {
            samples.push(state.x[..system.n_free()].to_vec());
        }
    }
    Some(samples)
}

/// The largest distance of a node from itself, at any of the times.
fn distance(a: &Samples, b: &Samples) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    // `f64::max` would lose what is not a number.
    pairs.fold(0.0, |largest, (a, b)| {
        let distance = (a - b).norm();
        if distance > largest || distance.is_nan() {
            distance
        } else {
            largest
        }
    })
}
