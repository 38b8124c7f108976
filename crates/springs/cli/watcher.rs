//! What watches a run: writes frames, draws progress, notices an interrupt or when a
//! checkpoint is due.

use super::Unwritten;
use super::output::Output;
use super::progress::Progress;
use springs::report::TurnedOver;
use springs::step::{Account, Frame, Observer, Patience, Samples, StepRecord};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Writes frames, draws progress, notices an interrupt or when a checkpoint is
/// due.
pub(super) struct Watcher {
    pub(super) is_interrupted: Arc<AtomicBool>,
    pub(super) progress: Progress,
    pub(super) duration: f64,
    pub(super) output: Output,
    pub(super) stepping: Duration,
    pub(super) writing: Duration,
    pub(super) failure: Option<Unwritten>,
    pub(super) next_checkpoint: Patience,
    pub(super) is_due: bool,
    /// Energy that moved so far.
    pub(super) turned_over: TurnedOver,
    /// When energies are looked at next, in simulated seconds.
    pub(super) next_look: f64,
    pub(super) is_look_due: bool,
}

/// Looks at the energies of a run, in equal intervals.
const LOOKS: f64 = 64.0;

impl Watcher {
    pub(super) fn is_interrupted(&self) -> bool {
        self.is_interrupted.load(Ordering::SeqCst)
    }

    /// A failure ends the run at the next step: what belongs to this one is kept
    /// to be written later, as long as it is not too much.
    fn write(
        &mut self,
        write: impl FnOnce(&mut Output) -> Result<(), Unwritten>,
    ) -> ControlFlow<()> {
        let start = Instant::now();
        let written = write(&mut self.output);
        self.writing += start.elapsed();
        if let Err(error) = written {
            self.failure.get_or_insert(error);
            if self.output.n_unwritten() > MOST_UNWRITTEN {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
}

/// Bytes that are kept in memory if they cannot be written.
const MOST_UNWRITTEN: usize = 1 << 28;

impl Observer for Watcher {
    fn trial(&mut self, steps: u64) -> ControlFlow<()> {
        self.progress.trial(steps);
        if self.is_interrupted() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn wants_members(&self) -> bool {
        self.output.wants_members()
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.write(|output| output.frame(frame))
    }

    fn wants_samples(&self) -> bool {
        self.output.wants_samples()
    }

    fn samples(&mut self, samples: Samples<'_>) -> ControlFlow<()> {
        self.write(|output| output.samples(samples))
    }

    fn patience(&self) -> Patience {
        self.next_checkpoint
    }

    fn wants_account(&self) -> bool {
        self.is_look_due || self.output.wants_account()
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        self.is_look_due = false;
        self.turned_over.look(&account);
        if !self.output.wants_account() {
            return ControlFlow::Continue(());
        }
        self.write(|output| output.account(&account))
    }

    fn record(&mut self, record: &StepRecord) {
        self.progress.record(record);
        // What could not be written ends the run below.
        let _ = self.write(|output| output.step(record));
    }

    fn step(&mut self, time: f64, steps: u64) -> ControlFlow<()> {
        self.progress.come_to(time);
        if time >= self.next_look {
            self.is_look_due = true;
            self.next_look = time + self.duration / LOOKS;
        }
        self.is_due = self.next_checkpoint.is_used_up(time, steps);
        if self.is_due || self.is_interrupted() || self.failure.is_some() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}
