//! The solution that errors are measured against.

use super::run::{Case, Clock, FRAMES, NoRun, Run, distance, recorded};
use super::{StudyError, run};
use nalgebra::Vector3;
use serde::Serialize;
use springs_scene::{Method, Scene, StepControl};
use std::collections::VecDeque;

/// A reference solution and how far it can be trusted.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Reference {
    /// The method that made it, in kebab-case.
    pub method: String,
    /// Its tolerance, in m.
    pub tolerance: f64,
    /// What solution it is furthest from, among those it was compared with.
    pub compared_with: String,
    /// Largest distance of a node between those two, in m: errors below this
    /// mean nothing.
    pub uncertainty: f64,
    /// Largest distance of a node from its start at the end, in m.
    pub extent: f64,
    /// How much there is to simulate, in m: the largest distance, over the run,
    /// of a node from where it would be without springs, or from its mean place
    /// over the run, whichever is less. (Mean places move with the mean velocity
    /// of the fixed nodes or, where there are none, of all nodes at the start.)
    pub motion: f64,
    /// From this error on a result is worthless: a tenth of the motion.
    pub worthless_from: f64,
    /// Positions at the end, in m, in the order of the scene.
    #[serde(skip)]
    pub positions: Vec<Vector3<f64>>,
}

impl Reference {
    /// Whether the scene moves by so little, or the reference is so uncertain,
    /// that no error can be told from the motion.
    pub fn is_worthless(&self) -> bool {
        self.uncertainty >= self.worthless_from
    }
}

/// From this part of the motion on an error makes a result worthless.
const WORTHLESS: f64 = 0.1;

/// Tolerances of reference solutions, as fractions of the scene's size.
const TOLERANCES: [f64; 9] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];

/// Parts of the budget after which the explicit method is given up, if it has not
/// got anywhere, or is refined no further; then the implicit one, then the
/// comparison.
const HOPELESS_SHARE: f64 = 0.1;
const EXPLICIT_SHARE: f64 = 0.2;
const IMPLICIT_SHARE: f64 = 0.35;
const SHARE: f64 = 0.45;

/// Errors up to so many uncertainties of the reference are not told apart.
pub(super) const TOLD_APART: f64 = 3.0;

/// Positions at the end of each of [`FRAMES`] intervals.
pub(super) type Frames = Vec<Vec<Vector3<f64>>>;

/// Solves at ever tighter tolerances, with DOP853 where that gets anywhere and
/// with TR-BDF2 elsewhere, until a share of the budget is used up. The tightest
/// solution is the reference. It is compared with the one before it, and with an
/// extrapolation of another method (see [`compare`]); its uncertainty is its
/// distance from the one that is further.
pub(super) fn make(case: &Case, clock: &mut Clock<'_>) -> Result<(Reference, Frames), StudyError> {
    let (mut method, mut ladder) = (Method::Dop853, refine(case, Method::Dop853, clock)?);
    // Failures of the explicit method mean little: its steps may have to be too
    // short to get anywhere.
    if ladder.solutions.len() < 2 {
        method = Method::TrBdf2;
        ladder = refine(case, method, clock)?;
    }
    let Some(best) = ladder.solutions.pop_back() else {
        return Err(ladder.why(method));
    };
    let end = |solution: &Solution| solution.frames[FRAMES - 1].clone();
    let positions = end(&best);
    let largest = positions.iter().map(|position| position.norm());
    // Two solutions may agree by chance, but not to less than rounding.
    let rounding = f64::EPSILON * largest.fold(f64::MIN_POSITIVE, f64::max);
    let before = ladder.solutions.pop_back().map(|solution| Compared {
        distance: distance(&end(&solution), &positions),
        with: format!("{method} at {:.0e} m", solution.tolerance),
    });
    let enough = before.as_ref().map_or(0.0, |before| before.distance);
    let other = compare(case, method, &positions, enough.max(rounding), clock)?;
    let further = [before, other]
        .into_iter()
        .flatten()
        .max_by(|a, b| a.distance.total_cmp(&b.distance));
    let Some(further) = further else {
        return Err(ladder.why(method));
    };
    let start: Vec<_> = case.scene.nodes.iter().map(|node| node.position).collect();
    let uncertainty = further.distance.max(rounding);
    let motion = motion(&case.scene, &best.frames, uncertainty);
    let reference = Reference {
        method: method.to_string(),
        tolerance: best.tolerance,
        compared_with: further.with,
        uncertainty,
        extent: distance(&start, &positions),
        motion,
        worthless_from: WORTHLESS * motion,
        positions,
    };
    Ok((reference, best.frames))
}

struct Solution {
    tolerance: f64,
    frames: Frames,
}

/// The last two solutions of one method at falling tolerances.
struct Ladder {
    solutions: VecDeque<Solution>,
    /// Why there are no more, if it was not the budget.
    failure: Option<String>,
}

impl Ladder {
    fn why(self, method: Method) -> StudyError {
        match self.failure {
            Some(reason) => StudyError::Unsolvable {
                method: method.to_string(),
                reason,
            },
            None => StudyError::NoReference,
        }
    }
}

fn refine(case: &Case, method: Method, clock: &mut Clock<'_>) -> Result<Ladder, StudyError> {
    let mut ladder = Ladder {
        solutions: VecDeque::new(),
        failure: None,
    };
    for fraction in TOLERANCES {
        let share = match method {
            Method::Dop853 if ladder.solutions.len() < 2 => HOPELESS_SHARE,
            Method::Dop853 => EXPLICIT_SHARE,
            _ => IMPLICIT_SHARE,
        };
        let tolerance = fraction * size_of(&case.scene);
        let what = format!("reference: {method} at {tolerance:.0e} m");
        let case = case.with(method, StepControl::Tolerance(tolerance));
        match solve(&case, &what, share, clock)? {
            Ok(run) => {
                // Two at most are compared.
                if ladder.solutions.len() == 2 {
                    ladder.solutions.pop_front();
                }
                let frames = run.frames;
                ladder.solutions.push_back(Solution { tolerance, frames });
            }
            Err(failure) => {
                ladder.failure = failure;
                break;
            }
        }
    }
    Ok(ladder)
}

/// The scene's size in m, or 1 where it has none.
pub(super) fn size_of(scene: &Scene) -> f64 {
    match scene.size() {
        size if size > 0.0 => size,
        _ => 1.0,
    }
}

/// A run within a share of the budget; otherwise why there is none, unless it
/// was the budget.
fn solve(
    case: &Case,
    what: &str,
    share: f64,
    clock: &mut Clock<'_>,
) -> Result<Result<Run, Option<String>>, StudyError> {
    if clock.tell(what).is_break() {
        return Err(StudyError::Stopped);
    }
    if clock.fraction() >= share {
        return Ok(Err(None));
    }
    let supervised = clock.supervise(share, |interrupt| recorded(case, interrupt))?;
    if supervised.is_interrupted {
        return Err(StudyError::Stopped);
    }
    Ok(supervised.result.map_err(|failure| match failure {
        NoRun::Refused(error) => Some(error.to_string()),
        NoRun::Failed(error) => Some(error.to_string()),
        NoRun::Stopped => None,
    }))
}

struct Compared {
    distance: f64,
    with: String,
}

/// The coarsest run that is extrapolated from, in steps, and how often they are
/// doubled at most.
const FEWEST_STEPS: u64 = 16;
const DOUBLINGS: u32 = 18;
/// Columns of the extrapolation.
const MOST_COLUMNS: usize = 6;

/// Compares the reference with a solution that shares as little as possible with
/// it: another family of methods, fixed steps, nothing skipped. Runs with 16,
/// 32, 64, … steps are extrapolated to steps of zero size (Hairer, Nørsett,
/// Wanner: Solving Ordinary Differential Equations I, 1993, II.9) until it is as
/// near to the reference as `enough`, in m, or a share of the budget is used up.
/// Beside DOP853 that is velocity Verlet; beside TR-BDF2 implicit midpoint or,
/// for massless nodes, which that one leaves ringing, implicit Euler.
fn compare(
    case: &Case,
    reference: Method,
    positions: &[Vector3<f64>],
    enough: f64,
    clock: &mut Clock<'_>,
) -> Result<Option<Compared>, StudyError> {
    let masses = case.scene.node_masses();
    let mut nodes = case.scene.nodes.iter().zip(&masses);
    let has_massless = nodes.any(|(node, mass)| !node.fixed && *mass <= 0.0);
    let is_damped = case.scene.has_dashpots() || case.scene.has_drag();
    // Powers of the step in the error: even ones only of symmetric methods.
    let (method, first, stride) = match reference {
        Method::Dop853 if is_damped => (Method::VelocityVerlet, 2, 1),
        Method::Dop853 => (Method::VelocityVerlet, 2, 2),
        _ if has_massless => (Method::ImplicitEuler, 1, 1),
        _ => (Method::ImplicitMidpoint, 2, 2),
    };
    let mut row: Vec<Vec<Vector3<f64>>> = Vec::new();
    let mut nearest: Option<Compared> = None;
    for doubling in 0..DOUBLINGS {
        let n_steps = FEWEST_STEPS << doubling;
        let what = format!("comparison of the reference: {method} in {n_steps} steps");
        let step = case.scene.settings.duration / n_steps as f64;
        let mut case = case.with(method, StepControl::Fixed(step));
        case.options.skip = false;
        let run = match solve(&case, &what, SHARE, clock)? {
            Ok(run) => run,
            // The budget.
            Err(None) => break,
            // The step is too long.
            Err(Some(_)) => {
                row.clear();
                continue;
            }
        };
        row = extrapolate(run.into_end(), &row, first, stride);
        let Some(extrapolated) = best_of(&row) else {
            continue;
        };
        let apart = distance(extrapolated, positions);
        if apart.is_finite() {
            // Always the finest, whether or not that is nearer: agreement by
            // chance is none.
            nearest = Some(Compared {
                distance: apart,
                with: format!("{method} extrapolated from {n_steps} steps"),
            });
        }
        if apart <= enough {
            break;
        }
    }
    Ok(nearest)
}

/// The next row of the extrapolation: the run itself, then without the first
/// power of the step in its error, the first two, …
fn extrapolate(
    finest: Vec<Vector3<f64>>,
    row: &[Vec<Vector3<f64>>],
    first: i32,
    stride: i32,
) -> Vec<Vec<Vector3<f64>>> {
    let mut next = vec![finest];
    for (k, coarse) in row.iter().take(MOST_COLUMNS - 1).enumerate() {
        let gain = 2f64.powi(first + stride * k as i32) - 1.0;
        let fine = &next[k];
        let pairs = fine.iter().zip(coarse);
        next.push(
            pairs
                .map(|(fine, coarse)| fine + (fine - coarse) / gain)
                .collect(),
        );
    }
    next
}

/// The entry after the smallest change along a row; none if there is only one.
fn best_of(row: &[Vec<Vector3<f64>>]) -> Option<&[Vector3<f64>]> {
    let changes = row.windows(2).map(|pair| run::distance(&pair[0], &pair[1]));
    let pairs = changes.zip(&row[1..]);
    let best = pairs.min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, entry)| &entry[..])
}

/// See [`Reference::motion`].
fn motion(scene: &Scene, frames: &Frames, uncertainty: f64) -> f64 {
    let times: Vec<f64> = (1..=FRAMES)
        .map(|k| scene.settings.duration * k as f64 / FRAMES as f64)
        .collect();
    let has_fixed = scene.nodes.iter().any(|node| node.fixed);
    let leading = || scene.nodes.iter().filter(|node| node.fixed == has_fixed);
    let sum: Vector3<f64> = leading().map(|node| node.velocity).sum();
    let drift = sum / (leading().count().max(1) as f64);
    let (mut without_springs, mut from_mean) = (0.0, 0.0);
    for (i, node) in scene.nodes.iter().enumerate() {
        let gravity = if node.fixed {
            Vector3::zeros()
        } else {
            scene.gravity
        };
        let along = |k: usize| frames[k][i] - drift * times[k];
        let places = (0..FRAMES).map(along).sum::<Vector3<f64>>() + node.position;
        let mean = places / (FRAMES + 1) as f64;
        from_mean = f64::max(from_mean, (node.position - mean).norm());
        for (k, &t) in times.iter().enumerate() {
            let thrown = node.position + node.velocity * t + gravity * (0.5 * t * t);
            without_springs = f64::max(without_springs, (frames[k][i] - thrown).norm());
            from_mean = f64::max(from_mean, (along(k) - mean).norm());
        }
    }
    // Where springs make no difference, that is no measure.
    if without_springs > TOLD_APART * uncertainty {
        without_springs.min(from_mean)
    } else {
        from_mean
    }
}
