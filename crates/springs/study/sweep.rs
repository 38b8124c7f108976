//! The runs that are compared.

use super::reference::{Guard, distance};
use super::{Clock, Options, Study};
use nalgebra::Vector3;
use serde::Serialize;
use springs_scene::{Method, Scene, StepControl};
use springs_step::{Islands, Outcome};
use std::time::Instant;

/// What a run was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Setting {
    /// Steps of this size, in s.
    Step(f64),
    /// Steps from this tolerance, in m.
    Tolerance(f64),
}

/// One run of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Method, in kebab-case.
    pub method: String,
    /// Step or tolerance.
    pub setting: Setting,
    /// Steps made.
    pub steps: u64,
    /// Median run time of the simulation, setup included, in s.
    pub seconds: f64,
    /// How often it was run.
    pub repeats: usize,
    /// Largest distance of a node from the reference at the end, in m; never
    /// below the uncertainty of the reference.
    pub error: f64,
    /// Whether the error is not told apart from the reference's own.
    pub at_floor: bool,
}

/// Halvings of the step of methods that are run with fixed steps.
const HALVINGS: i32 = 14;
/// Steps of the coarsest such run.
const COARSEST: f64 = 10.0;
/// Errors up to so many uncertainties of the reference are not told apart.
const TOLD_APART: f64 = 3.0;
/// A method whose run takes this part of the budget is not refined further.
const COSTLY: f64 = 0.02;
/// Errors of so many sizes of the scene mean that a run was unstable.
const UNSTABLE: f64 = 10.0;
/// Runs shorter than this, in s, are repeated.
const SHORT: f64 = 1.0;

/// Sweeps all methods, coarse to fine, in turns, so that a short budget still
/// shows all of them.
pub(super) fn run(
    scene: &Scene,
    options: &Options,
    reference: &[Vector3<f64>],
    study: &mut Study,
    clock: &mut Clock<'_>,
) {
    let mut sweeps: Vec<(Method, Vec<Setting>)> = options
        .methods
        .iter()
        .map(|&method| (method, settings(scene, method)))
        .collect();
    while !sweeps.is_empty() {
        let mut kept = Vec::new();
        for (method, mut settings) in std::mem::take(&mut sweeps) {
            let Some(setting) = settings.pop() else {
                continue;
            };
            match one(scene, method, setting, options, reference, study, clock) {
                Next::Finer => kept.push((method, settings)),
                Next::Enough => {}
                Next::Stop => return,
            }
        }
        sweeps = kept;
    }
}

/// From coarse (last) to fine. The note's own step has no tolerance worth the
/// name; explicit ones are shown as plain users run them, too.
fn settings(scene: &Scene, method: Method) -> Vec<Setting> {
    let duration = scene.settings.duration;
    let steps = |k: i32| Setting::Step(duration / (COARSEST * 2f64.powi(k)));
    let size = match scene.size() {
        size if size > 0.0 => size,
        _ => 1.0,
    };
    let tolerances = |k: i32| Setting::Tolerance(size * 10f64.powf(-1.0 - 0.5 * f64::from(k)));
    let fixed = matches!(
        method,
        Method::LinearlyImplicitEuler
            | Method::VelocityVerlet
            | Method::BlanesMoan4
            | Method::BlanesMoan6
            | Method::FilteredLeapfrog
            | Method::ImplicitMidpoint
    );
    match fixed {
        true => (0..HALVINGS).rev().map(steps).collect(),
        false => (0..20).rev().map(tolerances).collect(),
    }
}

/// What comes after a run.
enum Next {
    Finer,
    Enough,
    Stop,
}

fn one(
    scene: &Scene,
    method: Method,
    setting: Setting,
    options: &Options,
    reference: &[Vector3<f64>],
    study: &mut Study,
    clock: &mut Clock<'_>,
) -> Next {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.tangent = None;
    let what = match setting {
        Setting::Step(h) => {
            scene.settings.step = StepControl::Fixed(h);
            format!("{method} in steps of {h:.1e} s")
        }
        Setting::Tolerance(tolerance) => {
            scene.settings.step = StepControl::Tolerance(tolerance);
            format!("{method} at {tolerance:.0e} m")
        }
    };
    let mut seconds = Vec::new();
    let mut last = None;
    for _ in 0..options.repeats.max(1) {
        if clock.tell(&what).is_break() {
            study.interrupted = true;
            return Next::Stop;
        }
        let begin = Instant::now();
        let mut simulation = match Islands::new(&scene) {
            Ok(simulation) => simulation,
            Err(error) => {
                study.refused.push((method.to_string(), error.to_string()));
                return Next::Enough;
            }
        };
        let mut guard = Guard {
            clock: &mut *clock,
            share: 1.0,
            countdown: 0,
            stopped: false,
        };
        match simulation.run(1, &mut guard) {
            Ok(Outcome::Finished) => {}
            Ok(Outcome::Stopped) => {
                study.interrupted |= guard.stopped;
                return if guard.stopped {
                    Next::Stop
                } else {
                    Next::Enough
                };
            }
            // Unstable at this step; a finer one may do.
            Err(_) => return Next::Finer,
        }
        seconds.push(begin.elapsed().as_secs_f64());
        let enough = seconds[0] > SHORT;
        last = Some(simulation);
        if enough {
            break;
        }
    }
    let Some(simulation) = last else {
        return Next::Enough;
    };
    seconds.sort_by(f64::total_cmp);
    let error = distance(&simulation.nodes().positions, reference);
    if !error.is_finite() || error > UNSTABLE * (scene.size() + study.reference.extent) {
        return Next::Finer;
    }
    let floor = study.reference.uncertainty;
    let at_floor = error < TOLD_APART * floor;
    study.trials.push(Trial {
        method: method.to_string(),
        setting,
        steps: simulation.work().counts.steps,
        seconds: seconds[seconds.len() / 2],
        repeats: seconds.len(),
        error: error.max(floor),
        at_floor,
    });
    let costly = seconds[0] > COSTLY * options.budget.as_secs_f64();
    match at_floor || costly || clock.fraction() > 1.0 {
        true => Next::Enough,
        false => Next::Finer,
    }
}
