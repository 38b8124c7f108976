//! A study as a table, as sentences, as CSV.

use super::{MethodSummary, Setting, Study, SweepEnd, Trial};
use std::fmt::Write as _;

/// All runs that count, a line each, method by method. Errors that are not told
/// apart from those of the reference are marked with `≤`, worthless ones with
/// `×`.
pub fn table(study: &Study) -> String {
    let mut text = String::from(
        "method                          step, s  tolerance, m      steps     time, s    error, m\n",
    );
    for trial in by_method(study) {
        let (step, tolerance) = match trial.setting {
            Setting::Step(h) => (format!("{h:.3e}"), String::new()),
            Setting::Tolerance(tolerance) => (String::new(), format!("{tolerance:.0e}")),
        };
        let mark = match (trial.at_floor, trial.worthless) {
            (_, true) => "×",
            (true, false) => "≤",
            (false, false) => " ",
        };
        writeln!(
            text,
            "{:<27} {step:>11}  {tolerance:>12} {:>10} {:>11.2e}  {mark} {:.1e}",
            trial.method, trial.steps, trial.seconds, trial.error
        )
        .expect("writing to a string");
    }
    text
}

fn by_method(study: &Study) -> Vec<&Trial> {
    let mut methods: Vec<&str> = Vec::new();
    for trial in &study.trials {
        if !methods.contains(&trial.method.as_str()) {
            methods.push(&trial.method);
        }
    }
    let of = |method: &str| {
        let trials = study.trials.iter();
        trials.filter(move |trial| trial.method == method).collect()
    };
    let groups: Vec<Vec<&Trial>> = methods.into_iter().map(of).collect();
    groups.concat()
}

/// How far the reference can be trusted, and from which error on a result is
/// worthless.
pub fn reference_note(study: &Study) -> String {
    let reference = &study.reference;
    let mut text = format!(
        "reference by {} at {:.0e} m, uncertain by {:.0e} m (against {})\n",
        reference.method, reference.tolerance, reference.uncertainty, reference.compared_with,
    );
    let floor = format!("{:.0e} m", reference.uncertainty);
    text += &match (reference.is_worthless(), reference.motion > 0.0) {
        (false, _) => format!(
            "the motion is {:.1e} m; from an error of {:.1e} m on, a tenth of it, a result is \
             worthless (marked ×)",
            reference.motion, reference.worthless_from
        ),
        (true, true) => format!(
            "the motion is {:.1e} m, and the reference is uncertain by {floor}: no error can be \
             told from the motion, so nothing is recommended",
            reference.motion
        ),
        (true, false) => "nothing moves, so there is nothing to compare".to_owned(),
    };
    text
}

/// A sentence for each method that is missing in the table, has only worthless
/// runs, or was refused.
pub fn method_notes(study: &Study) -> Vec<String> {
    let mut notes: Vec<String> = study
        .refused
        .iter()
        .map(|(method, why)| format!("left out {method}: {why}"))
        .collect();
    let of = |is_wanted: &dyn Fn(&MethodSummary) -> bool| {
        let methods = study.methods.iter().filter(|summary| is_wanted(summary));
        let names: Vec<&str> = methods.map(|summary| &summary.method[..]).collect();
        names.join(", ")
    };
    let is_missing =
        |summary: &MethodSummary| summary.runs == 0 && summary.end != SweepEnd::Refused;
    let unreached = of(&|summary| is_missing(summary) && summary.failed_runs == 0);
    if !unreached.is_empty() {
        notes.push(format!("no run within the budget: {unreached}"));
    }
    let unstable = of(&|summary| is_missing(summary) && summary.failed_runs > 0);
    if !unstable.is_empty() {
        notes.push(format!(
            "unstable at every step that fits into the budget: {unstable}"
        ));
    }
    let worthless = of(&|summary| summary.runs > 0 && summary.best_error.is_none());
    if !worthless.is_empty() {
        notes.push(format!("worthless at best: {worthless}"));
    }
    notes
}

/// For every power of ten that some run reached, the quickest one: what it is
/// good for, and the command that makes it, two lines each. Before them, whether
/// something is missing.
pub fn recommendations(study: &Study) -> Vec<String> {
    let mut sentences = Vec::new();
    if study.interrupted {
        sentences.push("interrupted, so the advice is incomplete".to_owned());
    }
    sentences.extend(study.advice.iter().map(|advice| {
        format!(
            "below {} m, with {}{:.1e} m in {}:\n  {}",
            short(advice.error_below),
            if advice.at_floor { "≤ " } else { "" },
            advice.error,
            time(advice.seconds),
            advice.command
        )
    }));
    sentences
}

/// Two digits, or one.
fn short(value: f64) -> String {
    let (one, two) = (format!("{value:.0e}"), format!("{value:.1e}"));
    if one.parse::<f64>() == two.parse::<f64>() {
        one
    } else {
        two
    }
}

/// "1.2 ms", "3.4 s".
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{:.0} µs", s * 1e6),
        s if s < 1.0 => format!("{:.2} ms", s * 1e3),
        s => format!("{s:.2} s"),
    }
}

/// `method,step,tolerance,steps,seconds,repeats,error,at_floor,error_over_time,worthless`,
/// a row per run.
pub fn csv(study: &Study) -> String {
    let mut text = String::from(
        "method,step,tolerance,steps,seconds,repeats,error,at_floor,error_over_time,worthless\n",
    );
    for trial in &study.trials {
        let (step, tolerance) = match trial.setting {
            Setting::Step(h) => (format!("{h:?}"), String::new()),
            Setting::Tolerance(tolerance) => (String::new(), format!("{tolerance:?}")),
        };
        writeln!(
            text,
            "{},{step},{tolerance},{},{:?},{},{:?},{},{:?},{}",
            trial.method,
            trial.steps,
            trial.seconds,
            trial.repeats,
            trial.error,
            trial.at_floor,
            trial.error_over_time,
            trial.worthless
        )
        .expect("writing to a string");
    }
    text
}

/// `node,x,y,z`: positions of the reference at the end, in m, that read back to
/// the same bits.
pub fn reference_csv(study: &Study) -> String {
    let mut text = String::from("node,x,y,z\n");
    for (node, position) in study.reference.positions.iter().enumerate() {
        let [x, y, z] = <[f64; 3]>::from(*position);
        writeln!(text, "{node},{x:?},{y:?},{z:?}").expect("writing to a string");
    }
    text
}
