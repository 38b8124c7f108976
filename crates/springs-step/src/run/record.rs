//! What is told of a step.

use crate::{Choice, Counts, Pace};
use springs_scene::Method;

/// A step that was made, or of a scene in several parts, what they came to together.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StepRecord {
    /// At its end, in s.
    pub time: f64,
    /// Its size, in s; of several parts the shortest of their last steps.
    pub step_size: f64,
    /// What it added to the error of positions, by the estimate of the method, in m; of several
    /// parts the one that is largest beside what was allowed. `None` where there is no estimate.
    pub error: Option<f64>,
    /// What it was allowed to add, in m: its part of the tolerance by time.
    pub allowed_error: Option<f64>,
    /// The method; of several parts that of the shortest step.
    pub method: Method,
    /// What was done since the start; of several parts the sum, but for steps, which are
    /// those of the part that made the most.
    pub counts: Counts,
}

impl StepRecord {
    /// Of a step of this size, in s, until `time`, with the estimate that it was accepted by.
    pub(crate) fn of(
        (time, step_size): (f64, f64),
        rate: Option<f64>,
        choice: &Choice,
        counts: Counts,
    ) -> Self {
        let allowed_rate = match choice.pace {
            Pace::Tolerance(tolerance) => tolerance / choice.duration,
            Pace::Fixed(_) => f64::NAN,
        };
        Self {
            time,
            step_size,
            error: rate.map(|rate| rate * step_size),
            allowed_error: rate.map(|_| allowed_rate * step_size),
            method: choice.method,
            counts,
        }
    }

    /// What several parts came to at a time in s; `None` of none. `counts` are those of all.
    pub(crate) fn together(
        records: impl Iterator<Item = Self>,
        time: f64,
        counts: Counts,
    ) -> Option<Self> {
        let ratio = |record: &Self| Some(record.error? / record.allowed_error?);
        let sum = records.reduce(|sum, one| {
            let short = if one.step_size < sum.step_size {
                one
            } else {
                sum
            };
            let worst = if ratio(&one) > ratio(&sum) { one } else { sum };
            Self {
                error: worst.error,
                allowed_error: worst.allowed_error,
                ..short
            }
        });
        sum.map(|sum| Self {
            time,
            counts,
            ..sum
        })
    }
}
