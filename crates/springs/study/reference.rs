//! The solution that errors are measured against.

use super::{Clock, StudyError};
use nalgebra::Vector3;
use serde::Serialize;
use springs_scene::{Method, Scene, StepControl};
use springs_step::{Islands, Observer, Outcome};
use std::ops::ControlFlow;

/// A reference solution and how far it can be trusted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reference {
    /// The method that made it, in kebab-case.
    pub method: String,
    /// Its tolerance, in m.
    pub tolerance: f64,
    /// The method of the solution that it was compared with.
    pub compared_with: String,
    /// Largest distance of a node between both, in m: errors below this mean
    /// nothing.
    pub uncertainty: f64,
    /// Largest distance that a node covers, in m.
    pub extent: f64,
}

/// Tolerances of reference solutions, as fractions of the scene's size.
const TOLERANCES: [f64; 9] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];

/// Part of the budget that the reference may take.
const SHARE: f64 = 0.4;

struct Solution {
    method: Method,
    tolerance: f64,
    positions: Vec<Vector3<f64>>,
}

/// Solves with two independent methods at ever tighter tolerances until a share
/// of the budget is used up. The tightest solution is the reference; how far it
/// is from the tightest one of the other method, or from its own one before if
/// that is further, is its uncertainty.
pub(super) fn make(
    scene: &Scene,
    clock: &mut Clock<'_>,
) -> Result<(Reference, Vec<Vector3<f64>>), StudyError> {
    let size = match scene.size() {
        size if size > 0.0 => size,
        _ => 1.0,
    };
    let mut explicit: Vec<Solution> = Vec::new();
    let mut implicit: Vec<Solution> = Vec::new();
    for method in [Method::Dop853, Method::TrBdf2] {
        let explicit_works = explicit.len() > 1;
        let (share, solutions) = match method {
            Method::Dop853 => (0.5 * SHARE, &mut explicit),
            _ if explicit_works => (0.7 * SHARE, &mut implicit),
            _ => (SHARE, &mut implicit),
        };
        // Where the explicit method can be run, the other one is only a check.
        let n = match method == Method::TrBdf2 && explicit_works {
            true => 3,
            false => TOLERANCES.len(),
        };
        for tolerance in TOLERANCES[..n].iter().map(|fraction| fraction * size) {
            let what = format!("reference: {method} at {tolerance:.0e} m");
            if clock.tell(&what).is_break() {
                return Err(StudyError::Stopped);
            }
            match solve(scene, method, tolerance, clock, share)? {
                Some(positions) => solutions.push(Solution {
                    method,
                    tolerance,
                    positions,
                }),
                None => break,
            }
        }
    }
    let start: Vec<_> = scene.nodes.iter().map(|node| node.position).collect();
    pick(&start, explicit, implicit).ok_or(StudyError::NoReference)
}

fn pick(
    start: &[Vector3<f64>],
    explicit: Vec<Solution>,
    implicit: Vec<Solution>,
) -> Option<(Reference, Vec<Vector3<f64>>)> {
    // The explicit method is of much higher order, so its last word counts
    // wherever it could be run at all.
    let (mut first, second) = match explicit.len() {
        0 | 1 => (implicit, explicit),
        _ => (explicit, implicit),
    };
    let best = first.pop()?;
    let other = [first.last(), second.last()];
    let compared = other.into_iter().flatten().map(|solution| {
        let apart = distance(&solution.positions, &best.positions);
        (apart, solution)
    });
    // The closer of the two is the fairer judge if both exist: the other
    // method may be much less accurate.
    let (uncertainty, judge) = compared.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let reference = Reference {
        method: best.method.to_string(),
        tolerance: best.tolerance,
        compared_with: format!("{} at {:.0e} m", judge.method, judge.tolerance),
        // Two solutions may agree by chance, but not to less than rounding.
        uncertainty: uncertainty.max(f64::EPSILON * largest(&best.positions)),
        extent: distance(start, &best.positions),
    };
    Some((reference, best.positions))
}

fn largest(positions: &[Vector3<f64>]) -> f64 {
    let sizes = positions.iter().map(|position| position.norm());
    sizes.fold(f64::MIN_POSITIVE, f64::max)
}

/// Largest distance of a node between two solutions, in m.
pub(super) fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// Final positions, or `None` if a step fails or a share of the budget is
/// used up first.
fn solve(
    scene: &Scene,
    method: Method,
    tolerance: f64,
    clock: &mut Clock<'_>,
    share: f64,
) -> Result<Option<Vec<Vector3<f64>>>, StudyError> {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.tangent = None;
    scene.settings.step = StepControl::Tolerance(tolerance);
    let Ok(mut simulation) = Islands::new(&scene) else {
        return Ok(None);
    };
    let mut guard = Guard {
        clock,
        share,
        countdown: 0,
        stopped: false,
    };
    let outcome = simulation.run(1, &mut guard);
    if guard.stopped {
        return Err(StudyError::Stopped);
    }
    Ok(match outcome {
        Ok(Outcome::Finished) => Some(simulation.nodes().positions.clone()),
        _ => None,
    })
}

/// Stops a run when a share of the budget is used up, or the user says so.
pub(super) struct Guard<'a, 'b> {
    pub(super) clock: &'a mut Clock<'b>,
    pub(super) share: f64,
    /// Steps until the clock is looked at again.
    pub(super) countdown: u32,
    /// Whether it was the user.
    pub(super) stopped: bool,
}

const STEPS_PER_LOOK: u32 = 64;

impl Observer for Guard<'_, '_> {
    fn step(&mut self, _time: f64) -> ControlFlow<()> {
        if self.countdown > 0 {
            self.countdown -= 1;
            return ControlFlow::Continue(());
        }
        self.countdown = STEPS_PER_LOOK;
        if self.clock.tell("").is_break() {
            self.stopped = true;
            return ControlFlow::Break(());
        }
        match self.clock.fraction() < self.share {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}
