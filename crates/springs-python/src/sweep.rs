//! Scenes with other numbers, and numbers of their runs, for sweeps.

use crate::attended::{Progress, Shared, attended};
use crate::errors::Fault;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use springs::solver::Interrupt;
use springs::sweep::{Measure, RunFailure, Setting, Subject, measure};

/// The name of a number, or a number, is not possible.
fn wrong(error: impl std::fmt::Display) -> Fault {
    Fault::scene(error.to_string())
}

/// A subject with other numbers, by name.
pub(crate) fn changed(subject: Subject, settings: &Bound<'_, PyDict>) -> PyResult<Subject> {
    let mut names: Vec<Setting> = Vec::with_capacity(settings.len());
    let mut values: Vec<f64> = Vec::with_capacity(settings.len());
    for (name, value) in settings {
        names.push(name.extract::<String>()?.parse().map_err(wrong)?);
        values.push(value.extract()?);
    }
    Ok(subject.with(&names, &values).map_err(wrong)?)
}

/// These numbers of a run of a subject on one thread.
pub(crate) fn measured(
    py: Python<'_>,
    mut subject: Subject,
    names: &[String],
) -> PyResult<Vec<f64>> {
    subject.options.threads = 1;
    let measures = names.iter().map(|name| {
        let measure: Measure = name.parse().map_err(wrong)?;
        measure.check(&subject).map_err(wrong)?;
        Ok(measure)
    });
    let measures = measures.collect::<Result<Vec<Measure>, Fault>>()?;
    let shared = Shared::default();
    let interrupt = Interrupt::from(shared.is_stopped.clone());
    let work = || measure(&subject, &measures, &interrupt);
    let (measured, raised) = attended(py, &shared, &Progress::new(None)?, work)?;
    if let Some(raised) = raised {
        return Err(raised);
    }
    let failed = |failure| match failure {
        RunFailure::Setup(error) => Fault::from(&error),
        RunFailure::Start(error) => Fault::from(&error),
        RunFailure::Step { error } => Fault::from(&error),
        other => wrong(other),
    };
    Ok(measured.map_err(failed)?)
}
