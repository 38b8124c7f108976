//! Steps that stand, and what is taken back of those that do not.

use super::Simulation;
use super::breaks::Ahead;
use crate::control::controller::{Controller, Schedule, Verdict};
use crate::ledger::Books;
use crate::{Archive, Cause, Counts, Flows, Interval, StepError, StepPlan, Work};

/// What is to be taken back if a step is interrupted, beside the state.
struct Bookmark {
    /// What the method carries along.
    words: Vec<u64>,
    controller: Option<Controller>,
    work: Work,
    books: [Books; 2],
    last_flows: Flows,
    most_energy: f64,
    ahead: Option<Ahead>,
}

/// Steps shorter than this part of the duration lead nowhere.
const SMALLEST_STEP: f64 = 1e-14;

impl Simulation {
    /// Makes one step that stands. One that is interrupted leaves no trace.
    pub(super) fn advance(&mut self) -> Result<Interval, StepError> {
        if self.interrupt.is_requested() {
            return Err(self.interrupted());
        }
        self.end_step();
        self.review_method()?;
        let bookmark = self.bookmark();
        let made = match self.schedule {
            Schedule::Fixed(plan) => self.planned_step(plan).map(|interval| (interval, None)),
            Schedule::Adaptive(_) => {
                let made = self.adaptive_step();
                made.map(|(interval, rate)| (interval, Some(rate)))
            }
            Schedule::Open(_) => unreachable!("trial runs come first"),
        };
        if let Some(bookmark) = bookmark {
            let is_interrupted = made.is_err_and(|error| error.cause == Cause::Interrupted);
            self.words = if is_interrupted {
                self.take_back(bookmark)
            } else {
                bookmark.words
            };
        }
        let (interval, rate) = made?;
        self.last = Some(interval);
        self.last_rate = rate;
        if let Some(rate) = rate {
            *self.estimated_error.get_or_insert(0.0) += rate * interval.size;
        }
        self.is_told = false;
        self.is_end_open = self.system().has_memory();
        Ok(interval)
    }

    /// The error of a step that is not begun.
    pub(super) fn interrupted(&self) -> StepError {
        let time = self.stepper.time();
        let interval = Interval {
            start: time,
            end: time,
            size: 0.0,
        };
        self.stepper.error(Cause::Interrupted, 0, interval)
    }

    /// What an interrupted step has to take back; `None` if none will be
    /// interrupted, as with explicit methods, whose steps are short.
    fn bookmark(&mut self) -> Option<Bookmark> {
        if !self.interrupt.can_be_requested() || self.choice.is_explicit() {
            return None;
        }
        let mut archive = Archive::saving_into(std::mem::take(&mut self.words));
        self.stepper.archive_method(&mut archive);
        Some(Bookmark {
            words: archive.into_words(),
            controller: match self.schedule {
                Schedule::Adaptive(controller) => Some(controller),
                Schedule::Fixed(_) | Schedule::Open(_) => None,
            },
            work: self.work,
            books: [self.books.clone(), self.books_before.clone()],
            last_flows: self.last_flows.clone(),
            most_energy: self.most_energy,
            ahead: self.ahead,
        })
    }

    /// Everything but the state, which a failed step leaves as it was, becomes what
    /// it was at the bookmark.
    fn take_back(&mut self, bookmark: Bookmark) -> Vec<u64> {
        let mut archive = Archive::loading(bookmark.words);
        self.stepper.archive_method(&mut archive);
        if let Some(controller) = bookmark.controller {
            self.schedule = Schedule::Adaptive(controller);
        }
        self.work = bookmark.work;
        [self.books, self.books_before] = bookmark.books;
        self.last_flows = bookmark.last_flows;
        self.most_energy = bookmark.most_energy;
        self.ahead = bookmark.ahead;
        archive.into_words()
    }

    /// Makes the next step of a plan.
    fn planned_step(&mut self, plan: StepPlan) -> Result<Interval, StepError> {
        let step = self.stepper.steps() + 1;
        let interval = Interval {
            start: self.stepper.time(),
            end: plan.end_of(step),
            size: plan.size_of(step),
        };
        match self.take(interval) {
            Ok(()) => Ok(interval),
            Err(error) => self.substep(interval, error),
        }
    }

    /// Makes a step that stands, or none.
    pub(super) fn take(&mut self, interval: Interval) -> Result<(), StepError> {
        let counts = self.work.counts;
        self.stepper.attempt(interval, &mut self.work)?;
        self.enter(interval, counts)
    }

    /// The attempted step stands and is booked, unless there is more energy than
    /// can be; `counts` are those before it.
    fn enter(&mut self, interval: Interval, counts: Counts) -> Result<(), StepError> {
        self.stepper.copy_flows(interval, &mut self.next_flows);
        let (before, after) = (self.stepper.before(), self.stepper.state());
        let mut between = Flows::default();
        between.add_between_fixed(self.system(), &before.x, after, interval.size);
        let mut ledger = self.books.ledger;
        ledger.record(&self.next_flows);
        ledger.record(&between);
        if let Some(cause) = self.watch_energy(
            interval,
            counts,
            ledger.anchor_work.abs() + ledger.load_work.abs() + ledger.control_work.abs(),
        ) {
            let fastest = self.stepper.fastest_block();
            self.stepper.reject();
            return Err(self.stepper.error(cause, fastest, interval));
        }
        self.stepper.accept(interval, &mut self.work);
        if let Some(track) = &mut self.track {
            let (system, state) = (self.stepper.system(), self.stepper.state());
            track.take(system, self.stepper.method(), state);
        }
        self.books_before.copy_from(&self.books);
        self.books.ledger = ledger;
        self.books.works.add_times(&self.next_flows.works, 1.0);
        self.books.works.add_times(&between.works, 1.0);
        std::mem::swap(&mut self.last_flows, &mut self.next_flows);
        self.flows_between = None;
        Ok(())
    }

    /// Attempts steps until one is accurate enough; that step and the estimated rate of its
    /// error, in m/s.
    fn adaptive_step(&mut self) -> Result<(Interval, f64), StepError> {
        let Schedule::Adaptive(controller) = &mut self.schedule else {
            unreachable!("only called with a controller");
        };
        let counts = self.work.counts;
        let start = self.stepper.time();
        let (interval, rate) = loop {
            let size = Ahead::limit(self.ahead, start, controller.step_size());
            let end = self.timetable.end_of_step(start, self.duration);
            let longest = self
                .stepper
                .longest_step()
                .min(self.timetable.longest_step());
            let interval = next_interval(start, end, size.min(longest));
            let attempt = self.stepper.attempt(interval, &mut self.work);
            let too_small = interval.size < SMALLEST_STEP * self.duration
                || interval.start + 0.1 * interval.size == interval.start;
            match attempt {
                Err(error) if error.cause == Cause::Interrupted => return Err(error),
                Err(error) if too_small => return Err(error),
                Err(_) => controller.fail(interval.size),
                Ok(None) => {
                    self.stepper.reject();
                    return Err(self.stepper.error(Cause::NoEstimate, 0, interval));
                }
                Ok(Some(mut estimate)) => {
                    if !controller.is_clear(estimate)
                        && let Some(second) = self.stepper.second_estimate(&mut self.work)
                    {
                        estimate = second;
                    }
                    // An estimate that was interrupted is none.
                    if self.interrupt.is_requested() && !self.choice.is_explicit() {
                        self.stepper.reject();
                        return Err(self.stepper.error(Cause::Interrupted, 0, interval));
                    }
                    let before = *controller;
                    match controller.judge(interval.size, estimate) {
                        Verdict::Accept if !too_small => {
                            let Some(ahead) = Ahead::of(&self.stepper, &before, interval) else {
                                break (interval, estimate.rate);
                            };
                            *controller = before;
                            self.ahead = Some(ahead);
                            self.stepper.reject();
                        }
                        _ if too_small => {
                            self.stepper.reject();
                            let cause = Cause::StepTooSmall;
                            return Err(self.stepper.error(cause, estimate.block, interval));
                        }
                        _ => self.stepper.reject(),
                    }
                }
            }
            self.work.counts.rejected_steps += 1;
        };
        self.enter(interval, counts)?;
        if let Some(auto) = &mut self.auto {
            auto.record(interval.size, self.work.counts - counts);
        }
        Ok((interval, rate))
    }
}

/// The next step of about `h`: to `end` if that is near, and in two equal
/// steps if it is not much further.
fn next_interval(start: f64, end: f64, h: f64) -> Interval {
    let left = end - start;
    let size = match left / h {
        steps if steps <= 1.0 + 1e-9 => left,
        steps if steps < 2.0 => 0.5 * left,
        _ => h,
    };
    Interval {
        start,
        end: if size == left { end } else { start + size },
        size,
    }
}
