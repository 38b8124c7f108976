//! Trial runs before the first step, and comparisons of methods later on.

use super::{Simulation, Switch};
use crate::control::auto::Settled;
use crate::control::choose::settle_equal_steps;
use crate::control::controller::Schedule;
use crate::control::trials::{Abandoned, Trials, Unsettled};
use crate::run::dense_output::DenseOutput;
use crate::{Archive, Cause, Interval, StepError, StepPlan};
use std::ops::ControlFlow;
use std::time::Instant;

impl Simulation {
    /// Makes the trial runs that the settings leave open, unless that is done.
    /// `watch` hears the steps they made and may stop them; they leave nothing
    /// behind then.
    ///
    /// # Errors
    ///
    /// If they settle nothing.
    pub(crate) fn settle(
        &mut self,
        watch: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, StepError> {
        let Schedule::Open(controller) = self.schedule else {
            return Ok(ControlFlow::Continue(()));
        };
        let begin = Instant::now();
        let interrupt = self.interrupt.clone();
        let fewest = self.timetable.fewest_equal_steps(self.duration);
        let mut trials = Trials::new(&interrupt, watch, fewest);
        let settled = match &mut self.auto {
            Some(auto) => {
                let compiled = (self.stepper.system(), self.stepper.anchors());
                auto.settle(compiled, controller, &mut trials)
                    .and_then(|settled| self.put_settled(settled))
            }
            None => {
                let mut archive = Archive::saving();
                self.stepper.archive_method(&mut archive);
                let (compiled, method) = self.stepper.apart();
                let steps = settle_equal_steps(compiled, method, &controller, &mut trials);
                if steps.is_err() {
                    let mut archive = Archive::loading(archive.into_words());
                    self.stepper.archive_method(&mut archive);
                }
                steps.map(|steps| {
                    self.choice.reason = steps.to_string();
                    self.schedule = Schedule::Fixed(StepPlan::equal(self.duration, steps.n));
                })
            }
        };
        self.trial_work += trials.work;
        self.trial_time += begin.elapsed();
        let cause = match settled {
            Ok(()) => return Ok(ControlFlow::Continue(())),
            Err(Unsettled::Abandoned) => return Ok(ControlFlow::Break(())),
            Err(Unsettled::NotReached) => Cause::NotReached,
            Err(Unsettled::OutOfMemory) => Cause::OutOfMemory,
        };
        Err(self.stepper.error(cause, 0, Interval::default()))
    }

    /// Begins with what trial runs have settled.
    pub(super) fn put_settled(&mut self, settled: Settled) -> Result<(), Unsettled> {
        let Settled {
            choice,
            method,
            schedule,
        } = settled;
        let dense_output = DenseOutput::of(&choice, &*method, self.stepper.system());
        self.dense_output = dense_output.map_err(|_| Unsettled::OutOfMemory)?;
        self.dense_output.set_interrupt(&self.interrupt);
        self.work += method.setup();
        self.stepper.change_method(method);
        if matches!(schedule, Schedule::Fixed(_)) {
            self.auto = None;
        }
        (self.choice, self.schedule) = (choice, schedule);
        Ok(())
    }

    /// Goes on with another method, if methods are chosen and one has become
    /// clearly cheaper. A comparison that is interrupted leaves nothing behind.
    pub(super) fn review_method(&mut self) -> Result<(), StepError> {
        let (Some(auto), Schedule::Adaptive(controller)) = (&mut self.auto, &self.schedule) else {
            return Ok(());
        };
        if !auto.is_review_due() {
            return Ok(());
        }
        let begin = Instant::now();
        let system = self.stepper.system();
        let mut before = Archive::saving();
        auto.archive(system, &mut before);
        let interrupt = self.interrupt.clone();
        let mut watch = |_| ControlFlow::Continue(());
        let mut trials = Trials::new(&interrupt, &mut watch, 0);
        let compiled = (system, self.stepper.anchors());
        let picked = auto.review(compiled, self.stepper.state(), controller, &mut trials);
        self.trial_work += trials.work;
        self.trial_time += begin.elapsed();
        let picked = match picked {
            Ok(Some(picked)) => picked,
            Ok(None) => return Ok(()),
            Err(Abandoned) => {
                let mut archive = Archive::loading(before.into_words());
                auto.archive(system, &mut archive);
                return Err(self.interrupted());
            }
        };
        let (step_size, reason) = (picked.step_size, picked.choice.reason.clone());
        if let Some(setup) = self.put_to_use(picked) {
            self.work += setup;
            self.switches.push(Switch {
                time: self.stepper.time(),
                method: self.choice.method,
                reason,
            });
            if let Schedule::Adaptive(controller) = &mut self.schedule {
                controller.begin_with(step_size);
            }
        }
        Ok(())
    }
}
