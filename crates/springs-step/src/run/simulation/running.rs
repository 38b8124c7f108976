//! A run with somebody who looks on.

use super::Simulation;
use crate::run::frames::{AT_THE_END, Due, Frames};
use crate::run::observer::{either, offer};
use crate::{Cause, Interval, NodeStates, Observer, Outcome, StepError};
use std::ops::ControlFlow;

impl Simulation {
    /// Runs to the end, or until the observer, an interrupt or an error stops it,
    /// and shows the observer `intervals` + 1 frames at equal distances, time 0 and
    /// the duration included. Frames never change the steps. After a stop it goes
    /// on, with the frames that are still to come.
    ///
    /// The first run begins with the trial runs that the settings leave open.
    ///
    /// # Errors
    ///
    /// If a step cannot be made, everything up to it stays available; or if trial
    /// runs settle nothing.
    pub fn run(
        &mut self,
        intervals: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        let (duration, nodes) = (self.duration, &self.nodes);
        let mut frames = Frames::new(duration, intervals, nodes, &self.probes, observer);
        frames.go_on(self.shown.as_ref(), self.stepper.time());
        let outcome = self.run_on(&mut frames, observer);
        self.shown = Some(frames.shown());
        self.stepper.scatter(&mut self.nodes);
        match outcome {
            Err(error) if error.cause == Cause::Interrupted => Ok(Outcome::Stopped),
            other => other,
        }
    }

    fn run_on(
        &mut self,
        frames: &mut Frames,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        if self.settle(&mut |steps| observer.trial(steps))?.is_break() {
            return Ok(Outcome::Stopped);
        }
        self.track_members_for(observer);
        if let Some(due) = frames.take(0.0) {
            frames.between.clone_from(&self.nodes);
            if self.show(&due, None, &frames.between, observer).is_break() {
                return Ok(Outcome::Stopped);
            }
        }
        loop {
            if let Some(interval) = self.last.filter(|_| !self.is_told) {
                let told = self.tell(frames, interval, observer)?;
                if told.is_break() && !(self.is_told && self.is_finished()) {
                    return Ok(Outcome::Stopped);
                }
            }
            if self.is_finished() {
                return Ok(Outcome::Finished);
            }
            self.advance()?;
        }
    }

    /// Tells the observer of the last step: its frames, its energies, its end.
    fn tell(
        &mut self,
        frames: &mut Frames,
        interval: Interval,
        observer: &mut dyn Observer,
    ) -> Result<ControlFlow<()>, StepError> {
        while let Some(time) = frames.next_time() {
            let fraction = (time - interval.start) / (interval.end - interval.start);
            if fraction >= 1.0 + AT_THE_END {
                break;
            }
            if self.interrupt.is_requested() {
                return Ok(ControlFlow::Break(()));
            }
            self.stepper.scatter(&mut self.nodes);
            let is_between = fraction < 1.0 - AT_THE_END;
            let mut nodes = std::mem::take(&mut frames.between);
            if is_between {
                let made = self.evaluate(interval, time, &mut nodes);
                if made.is_err() {
                    frames.between = nodes;
                    return made.map(ControlFlow::Continue);
                }
            } else {
                self.end_step();
                nodes.clone_from(&self.nodes);
            }
            let due = frames.take(time);
            let step = is_between.then_some(interval);
            let shown = due.map(|due| self.show(&due, step, &nodes, observer));
            frames.between = nodes;
            if let Some(ControlFlow::Break(())) = shown {
                return Ok(ControlFlow::Break(()));
            }
        }
        self.end_step();
        self.is_told = true;
        let offered = offer(observer, || self.account(interval.end));
        if let Some(record) = self.record() {
            observer.record(&record);
        }
        Ok(either(
            offered,
            observer.step(interval.end, self.stepper.steps()),
        ))
    }

    /// Shows what is due, where `nodes` are within a step, or at the end of the last one.
    fn show(
        &mut self,
        due: &Due,
        within: Option<Interval>,
        nodes: &NodeStates,
        observer: &mut dyn Observer,
    ) -> ControlFlow<()> {
        let view = self.view(due, nodes, observer);
        let shown = due.show(nodes, &view, observer);
        if due.frame.is_none() {
            return shown;
        }
        let account = || match within {
            None => self.account(due.time),
            Some(interval) => self.account_between(interval, due.time, nodes),
        };
        either(shown, offer(observer, account))
    }
}
