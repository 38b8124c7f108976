//! Which run to recommend for which error.

use super::run::{Case, Clock, least_seconds};
use super::{Options, Setting, Study, StudyError, Trial};
use serde::Serialize;

/// The quickest run that stays below an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Advice {
    /// The error that was asked for, in m.
    pub error_below: f64,
    /// Method, in kebab-case.
    pub method: String,
    /// Step or tolerance.
    pub setting: Setting,
    /// The error that it has, in m.
    pub error: f64,
    /// The error is not told apart from that of the reference.
    pub at_floor: bool,
    /// The time that it takes, in s: compiling the scene and all steps.
    pub seconds: f64,
    /// The command that makes this run, to the same bits.
    pub command: String,
}

impl Advice {
    /// What the command says about method and step.
    pub fn arguments(&self) -> [String; 4] {
        let (name, value) = match self.setting {
            Setting::Step(h) => ("--step", h),
            Setting::Tolerance(tolerance) => ("--tolerance", tolerance),
        };
        // The shortest decimal that reads back to the same bits.
        let value = format!("{value:?}");
        let method = self.method.clone();
        ["--method".to_owned(), method, name.to_owned(), value]
    }
}

/// Errors are asked for in so many powers of ten, at most.
const MOST_DECADES: i32 = 13;

/// Of runs that take up to this many times as long as the quickest one, the
/// tolerance nearest to the error is recommended.
const AS_QUICK: f64 = 1.15;

/// Runs that take up to this many times as long as the quickest one so far are
/// measured again.
const CONTENDER: f64 = 1.5;

/// The errors that are asked for, in m, largest first: that from which on results
/// are worthless, and all powers of ten from there to the least error.
fn levels(study: &Study) -> Vec<f64> {
    let from = study.reference.worthless_from;
    let errors = usable(study).map(|trial| trial.error);
    let Some(least) = errors.min_by(f64::total_cmp) else {
        return Vec::new();
    };
    let high = from.log10().floor() as i32;
    let low = (least.max(f64::MIN_POSITIVE).log10().ceil() as i32).max(high - MOST_DECADES);
    let decades = (low..=high).rev().map(|decade| {
        let text = format!("1e{decade}");
        text.parse().expect("a digit and an exponent")
    });
    std::iter::once(from).chain(decades).collect()
}

fn usable(study: &Study) -> impl Iterator<Item = &Trial> {
    let is_known = !study.reference.is_worthless();
    study
        .trials
        .iter()
        .filter(move |trial| is_known && !trial.worthless)
}

fn quickest_of<'a>(trials: impl Iterator<Item = &'a Trial>) -> Option<&'a Trial> {
    trials.min_by(|a, b| a.seconds.total_cmp(&b.seconds))
}

/// The runs that stay below an error.
fn below(study: &Study, error: f64) -> impl Iterator<Item = &Trial> {
    usable(study).filter(move |trial| trial.error <= error)
}

/// The quickest run for every error, each run once.
///
/// Where stability and not the tolerance sets the steps, many tolerances make
/// about the same run, some of them far above the error that comes out. The
/// largest one up to the error asked for is taken then.
pub(super) fn advice(study: &Study, command: &str) -> Vec<Advice> {
    let mut advice: Vec<Advice> = Vec::new();
    for level in levels(study) {
        let Some(quickest) = quickest_of(below(study, level)) else {
            continue;
        };
        let trial = match quickest.setting {
            Setting::Tolerance(tolerance) if tolerance > level => {
                let same = below(study, level).filter(|trial| {
                    trial.method == quickest.method
                        && trial.seconds <= AS_QUICK * quickest.seconds
                        && matches!(trial.setting, Setting::Tolerance(t) if t <= level)
                });
                quickest_of(same).unwrap_or(quickest)
            }
            _ => quickest,
        };
        let mut one = Advice {
            error_below: level,
            method: trial.method.clone(),
            setting: trial.setting,
            error: trial.error,
            at_floor: trial.at_floor,
            seconds: trial.seconds,
            command: String::new(),
        };
        one.command = format!("{command} {}", one.arguments().join(" "));
        // The same run for a smaller error takes the place of that for a larger.
        match advice.last_mut() {
            Some(last) if last.command == one.command => *last = one,
            _ => advice.push(one),
        }
    }
    advice
}

/// Measures all runs that may be recommended again, in rounds, so that each is
/// measured at several times; the least time counts.
pub(super) fn measure_again(
    case: &Case,
    options: &Options,
    study: &mut Study,
    clock: &mut Clock<'_>,
) -> Result<(), StudyError> {
    let mut contends = vec![false; study.trials.len()];
    for level in levels(study) {
        let Some(quickest) = quickest_of(below(study, level)) else {
            continue;
        };
        let most = CONTENDER * quickest.seconds;
        for (contends, trial) in contends.iter_mut().zip(&study.trials) {
            *contends |= !trial.worthless && trial.error <= level && trial.seconds <= most;
        }
    }
    for _ in 1..options.repeats {
        for (trial, _) in study.trials.iter_mut().zip(&contends).filter(|(_, c)| **c) {
            let now = clock.fraction();
            if now + clock.part(trial.seconds) > 1.0 {
                continue;
            }
            let what = format!("{}, again", trial.method);
            if study.interrupted || clock.tell(&what).is_break() {
                study.interrupted = true;
                return Ok(());
            }
            let method = trial.method.parse().expect("the name of a method");
            let case = case.with(method, trial.setting.control());
            let supervised = clock.supervise(1.0, |interrupt| least_seconds(&case, interrupt))?;
            if supervised.result.is_finite() {
                trial.seconds = trial.seconds.min(supervised.result);
                trial.repeats += 1;
            }
            if supervised.is_interrupted {
                study.interrupted = true;
                return Ok(());
            }
        }
    }
    Ok(())
}
