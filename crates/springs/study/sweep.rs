//! The runs that are compared.

use super::reference::{Frames, TOLD_APART, size_of};
use super::run::{Case, Clock, FRAMES, NoRun, Run, distance, least_seconds, recorded};
use super::{Options, Study, StudyError};
use serde::Serialize;
use springs_scene::{Method, Scene, StepControl};
use springs_solver::Interrupt;
use springs_step::properties;

/// What a run was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Setting {
    /// Steps of this size, in s.
    Step(f64),
    /// Steps from this tolerance, in m.
    Tolerance(f64),
}

impl Setting {
    pub(super) fn control(self) -> StepControl {
        match self {
            Self::Step(h) => StepControl::Fixed(h),
            Self::Tolerance(tolerance) => StepControl::Tolerance(tolerance),
        }
    }
}

/// One run of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Trial {
    /// Method, in kebab-case.
    pub method: String,
    /// Step or tolerance.
    pub setting: Setting,
    /// Steps made.
    pub steps: u64,
    /// Least time of a run, in s: compiling the scene and all steps.
    pub seconds: f64,
    /// How often it was measured, each time in a thread of its own.
    pub repeats: usize,
    /// Largest distance of a node from the reference at the end, in m; never
    /// below the uncertainty of the reference.
    pub error: f64,
    /// The same at any of eight times of the run.
    pub error_over_time: f64,
    /// Whether the error is not told apart from the reference's own.
    pub at_floor: bool,
    /// Whether the error over time is as large as [`Reference::worthless_from`].
    ///
    /// [`Reference::worthless_from`]: super::Reference::worthless_from
    pub worthless: bool,
}

/// What became of a method.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MethodSummary {
    /// Method, in kebab-case.
    pub method: String,
    /// Runs that reached the end and were not unstable.
    pub runs: usize,
    /// Runs that failed or were unstable.
    pub failed_runs: usize,
    /// Least error that is not worthless, in m.
    pub best_error: Option<f64>,
    /// Why it was refined no further.
    pub end: SweepEnd,
}

/// Why a method was refined no further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SweepEnd {
    /// It cannot move the scene.
    Refused,
    /// Its error is not told apart from that of the reference.
    AtFloor,
    /// There is no finer step or tolerance in the sweep.
    Finest,
    /// The next run takes more than its share of the budget.
    Budget,
    /// The user stopped the study.
    Interrupted,
}

/// Halvings of the step of methods that are run with fixed steps, and of the
/// root of ten that tolerances fall by.
const HALVINGS: i32 = 20;
/// Steps of the coarsest such run.
const COARSEST: f64 = 10.0;
/// Errors of so many sizes of the scene mean that a run was unstable.
const UNSTABLE: f64 = 10.0;
/// Part of the budget after which no run begins; what is left measures those
/// again that may be recommended.
const SHARE: f64 = 0.85;
/// The next run takes so many times as long as the last one, at least.
const GROWTH: f64 = 1.4;

/// A method on its way from coarse to fine.
struct Sweep {
    method: Method,
    /// The coarsest that was not run yet is the last.
    settings: Vec<Setting>,
    /// Part of the budget that all its runs have taken, and the last one.
    used: f64,
    last: f64,
    failed_runs: usize,
    end: Option<SweepEnd>,
}

/// Sweeps all methods from coarse to fine. The next run is always of the method
/// that has taken the least time so far, and each gets an equal share of what is
/// left of the budget, so that a short one still shows all of them.
pub(super) fn run(
    case: &Case,
    options: &Options,
    reference: &Frames,
    study: &mut Study,
    clock: &mut Clock<'_>,
) -> Result<(), StudyError> {
    let sweep = |&method: &Method| Sweep {
        method,
        settings: settings(&case.scene, method, study.reference.worthless_from),
        used: 0.0,
        last: 0.0,
        failed_runs: 0,
        end: None,
    };
    let mut sweeps: Vec<Sweep> = options.methods.iter().map(sweep).collect();
    loop {
        let going = sweeps.iter_mut().filter(|sweep| sweep.end.is_none());
        let going: Vec<&mut Sweep> = going.collect();
        let n_going = going.len() as f64;
        let next = going.into_iter().min_by(|a, b| a.used.total_cmp(&b.used));
        let Some(sweep) = next else { break };
        let now = clock.fraction();
        let share = (SHARE - now) / n_going;
        if share <= 0.0 || GROWTH * sweep.last > share {
            sweep.end = Some(SweepEnd::Budget);
            continue;
        }
        sweep.end = one(case, sweep, now + share, reference, study, clock)?;
        sweep.last = clock.fraction() - now;
        sweep.used += sweep.last;
        if sweep.end == Some(SweepEnd::Interrupted) {
            study.interrupted = true;
            break;
        }
    }
    study.methods = sweeps.iter().map(|sweep| summary(sweep, study)).collect();
    match (study.trials.is_empty(), study.interrupted) {
        (false, _) => Ok(()),
        (true, true) => Err(StudyError::Stopped),
        (true, false) if study.refused.len() == sweeps.len() => {
            Err(StudyError::AllRefused(std::mem::take(&mut study.refused)))
        }
        (true, false) => Err(StudyError::NoRun),
    }
}

fn summary(sweep: &Sweep, study: &Study) -> MethodSummary {
    let method = sweep.method.to_string();
    let trials = || study.trials.iter().filter(|trial| trial.method == method);
    let errors = trials().filter(|trial| !trial.worthless);
    MethodSummary {
        runs: trials().count(),
        failed_runs: sweep.failed_runs,
        best_error: errors.map(|trial| trial.error).min_by(f64::total_cmp),
        // What had no end was interrupted.
        end: sweep.end.unwrap_or(SweepEnd::Interrupted),
        method,
    }
}

/// From coarse (last) to fine. The note's own step has no tolerance worth the
/// name; explicit methods are shown as plain users run them, too. Tolerances
/// begin where results begin to be worth something, and are round numbers.
fn settings(scene: &Scene, method: Method, worthless_from: f64) -> Vec<Setting> {
    let duration = scene.settings.duration;
    let steps = |k: i32| Setting::Step(duration / (COARSEST * 2f64.powi(k)));
    let coarsest = match worthless_from {
        from if from > 0.0 => from,
        _ => 0.1 * size_of(scene),
    };
    let decade = coarsest.log10().floor() as i32;
    let tolerance = |k: i32| {
        let digit = if k % 2 == 0 { 1 } else { 3 };
        let text = format!("{digit}e{}", decade - (k + 1) / 2);
        Setting::Tolerance(text.parse().expect("a digit and an exponent"))
    };
    let by_steps = properties(method).is_some_and(|row| row.is_compared_by_steps);
    let all = (0..HALVINGS).rev();
    if by_steps {
        all.map(steps).collect()
    } else {
        all.map(tolerance).collect()
    }
}

/// The next run of a method; says why there should be none after it, if so.
fn one(
    case: &Case,
    sweep: &mut Sweep,
    share: f64,
    reference: &Frames,
    study: &mut Study,
    clock: &mut Clock<'_>,
) -> Result<Option<SweepEnd>, StudyError> {
    let Some(setting) = sweep.settings.pop() else {
        return Ok(Some(SweepEnd::Finest));
    };
    let method = sweep.method;
    let what = match setting {
        Setting::Step(h) => format!("{method} in steps of {h:.1e} s"),
        Setting::Tolerance(tolerance) => format!("{method} at {tolerance:.0e} m"),
    };
    if clock.tell(&what).is_break() {
        return Ok(Some(SweepEnd::Interrupted));
    }
    let size = case.scene.size();
    let case = case.with(method, setting.control());
    let supervised = clock.supervise(share, |interrupt| measured(&case, interrupt))?;
    if supervised.is_interrupted {
        return Ok(Some(SweepEnd::Interrupted));
    }
    let run = match supervised.result {
        Ok(run) => run,
        Err(NoRun::Refused(error)) => {
            study.refused.push((method.to_string(), error.to_string()));
            return Ok(Some(SweepEnd::Refused));
        }
        Err(NoRun::Stopped) => return Ok(Some(SweepEnd::Budget)),
        // Unstable at this step; a finer one may do.
        Err(NoRun::Failed(_)) => {
            sweep.failed_runs += 1;
            return Ok(None);
        }
    };
    let errors: Vec<f64> = (0..FRAMES)
        .map(|k| distance(&run.frames[k], &reference[k]))
        .collect();
    let error = errors[FRAMES - 1];
    if !error.is_finite() || error > UNSTABLE * (size + study.reference.extent) {
        sweep.failed_runs += 1;
        return Ok(None);
    }
    let floor = study.reference.uncertainty;
    let error_over_time = errors.into_iter().fold(floor, f64::max);
    let worthless = error_over_time >= study.reference.worthless_from;
    let at_floor = error < TOLD_APART * floor;
    study.trials.push(Trial {
        method: method.to_string(),
        setting,
        steps: run.steps,
        seconds: run.seconds,
        repeats: 1,
        error: error.max(floor),
        error_over_time,
        at_floor,
        worthless,
    });
    Ok((at_floor && !worthless).then_some(SweepEnd::AtFloor))
}

/// A run so long that recording it hardly counts, in s and in steps.
const LONG: f64 = 0.02;
const MANY_STEPS: u64 = 20 * FRAMES as u64;

/// A recorded run with its time. Frames may cost a part of a step each, so unless
/// the run is long it is timed apart.
fn measured(case: &Case, interrupt: &Interrupt) -> Result<Run, NoRun> {
    let mut run = recorded(case, interrupt)?;
    if run.seconds < LONG || run.steps < MANY_STEPS {
        let seconds = least_seconds(case, interrupt);
        // If that was stopped, the run with frames is all there is.
        run.seconds = run.seconds.min(seconds);
    }
    Ok(run)
}
