//! Shorter steps in place of one that fails.

use super::Simulation;
use crate::{Cause, Flows, Interval, StepError};

/// Parts of a step that fails may be as short as this part of it.
const SHORTEST_SUBSTEP: f64 = 1e-3;

impl Simulation {
    /// Makes a step that failed as a whole in shorter ones, if that is allowed.
    /// They count as one; the last of them that fails is the error, and
    /// everything is then as it was before the first.
    pub(super) fn substep(
        &mut self,
        whole: Interval,
        error: StepError,
    ) -> Result<Interval, StepError> {
        // Shorter steps do not take away energy that is there already.
        let is_final = |cause| {
            matches!(
                cause,
                Cause::OutOfMemory
                    | Cause::EnergyDiverged
                    | Cause::EnergyOverflow
                    | Cause::Interrupted
            )
        };
        let is_allowed = self.choice.options.substeps
            && !self.choice.properties().is_some_and(|row| row.keeps_step);
        if !is_allowed || is_final(error.cause) {
            return Err(error);
        }
        let (saved, books) = (self.stepper.bookmark(), self.books.clone());
        let track = self.track.clone();
        let mut flows = Flows::default();
        let mut interval = Interval {
            end: whole.start,
            ..whole
        };
        while interval.end < whole.end {
            interval.start = interval.end;
            let left = whole.end - interval.start;
            // Halves end where the whole step does.
            let is_last = left <= interval.size * (1.0 + 1e-9);
            interval.size = if is_last { left } else { interval.size };
            interval.end = if is_last {
                whole.end
            } else {
                interval.start + interval.size
            };
            match self.take(interval) {
                Ok(()) => flows.add(&self.last_flows),
                Err(error)
                    if is_final(error.cause) || interval.size < SHORTEST_SUBSTEP * whole.size =>
                {
                    self.stepper.return_to(saved);
                    self.books = books;
                    self.track = track;
                    return Err(error);
                }
                Err(_) => {
                    interval.size *= 0.5;
                    interval.end = interval.start;
                }
            }
        }
        self.stepper.count_as_one(saved);
        if let (Some(track), Some(before)) = (&mut self.track, track) {
            track.began_with(before.end().to_vec());
        }
        (self.books_before, self.last_flows) = (books, flows);
        self.work.counts.rescued_steps += 1;
        Ok(whole)
    }
}
