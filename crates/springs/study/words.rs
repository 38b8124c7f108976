//! A study as a table, as sentences, as CSV.

use super::{Setting, Study, Trial};
use std::fmt::Write as _;

/// All runs that count, a line each, method by method.
pub fn table(study: &Study) -> String {
    let mut text = String::from(
        "method                     step, s   tolerance, m      steps     time, s    error, m\n",
    );
    for trial in by_method(study) {
        let (step, tolerance) = match trial.setting {
            Setting::Step(h) => (format!("{h:.2e}"), String::new()),
            Setting::Tolerance(tolerance) => (String::new(), format!("{tolerance:.1e}")),
        };
        let floor = if trial.at_floor { "≤" } else { " " };
        writeln!(
            text,
            "{:<24} {step:>10}   {tolerance:>12} {:>10} {:>11.2e}  {floor} {:.1e}",
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

/// For every power of ten that some run reached: the quickest one.
pub fn recommendations(study: &Study) -> Vec<String> {
    let errors = study.trials.iter().map(|trial| trial.error);
    let (low, high) = errors.fold((f64::INFINITY, 0f64), |(low, high), error| {
        (low.min(error), high.max(error))
    });
    if study.trials.is_empty() {
        return Vec::new();
    }
    let decade = |error: f64| error.max(1e-300).log10().ceil() as i32;
    let levels = (decade(low)..=decade(high).min(decade(low) + 12)).rev();
    let mut sentences = Vec::new();
    for level in levels {
        let error = 10f64.powi(level);
        let good = study.trials.iter().filter(|trial| trial.error <= error);
        let Some(best) = good.min_by(|a, b| a.seconds.total_cmp(&b.seconds)) else {
            continue;
        };
        let how = match best.setting {
            Setting::Step(h) => format!("in steps of {h:.2e} s"),
            Setting::Tolerance(tolerance) => format!("at tolerance {tolerance:.1e} m"),
        };
        sentences.push(format!(
            "for {error:.0e} m use {} {how}: {:.2e} s",
            best.method, best.seconds
        ));
    }
    sentences
}

/// `method,step,tolerance,steps,seconds,repeats,error,at_floor`, a row per run.
pub fn csv(study: &Study) -> String {
    let mut text = String::from("method,step,tolerance,steps,seconds,repeats,error,at_floor\n");
    for trial in &study.trials {
        let (step, tolerance) = match trial.setting {
            Setting::Step(h) => (format!("{h:?}"), String::new()),
            Setting::Tolerance(tolerance) => (String::new(), format!("{tolerance:?}")),
        };
        writeln!(
            text,
            "{},{step},{tolerance},{},{:?},{},{:?},{}",
            trial.method, trial.steps, trial.seconds, trial.repeats, trial.error, trial.at_floor
        )
        .expect("writing to a string");
    }
    text
}
