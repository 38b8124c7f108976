//! Parts of a scene that are not coupled, each on its own way.

mod results;

use crate::control::choose::refuse_unsettled;
use crate::run::frames::{Frames, Shown};
use crate::run::members::Supported;
use crate::run::observer::{either, offer};
use crate::run::part::{Part, cut};
use crate::run::probes::Probes;
use crate::run::simulation::Pause;
use crate::threads::threads;
use crate::{
    Account, Archive, Cause, ForeignState, Ledger, NodeStates, Observer, Outcome, Patience,
    SetupError, StepError, StepRecord, Work, Works,
};
use springs_assembly::{CompileError, Energy};
use springs_scene::{RunOptions, Scene};
use springs_solver::Interrupt;
use springs_threads::{in_parallel, with_threads, with_threads_watched};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A scene on its way through its duration, cut into parts that are not coupled.
/// Each has a method, steps and a solver of its own, and several run at
/// once; the result is the same to the last bit for any number of threads.
///
/// A scene in one part runs exactly like a [`Simulation`](crate::Simulation).
pub struct Islands {
    parts: Vec<Part>,
    /// Parts that run at once.
    threads: usize,
    /// Simulated, in s.
    duration: f64,
    /// How far parts may still move that are put to sleep, in m.
    sleep: Option<f64>,
    n_springs: usize,
    n_loads: usize,
    supported: Supported,
    probes: Probes,
    time: f64,
    /// Parts are somewhere within a round.
    is_under_way: bool,
    /// At that time.
    nodes: NodeStates,
    ledger: Ledger,
    /// Frames that were shown, if it was stopped on the way.
    shown: Option<Shown>,
    /// Whether the observer has been told of the last round.
    is_told: bool,
    trial_time: Duration,
    interrupt: Interrupt,
}

/// All parts come to one time so often at least, and more often where parts may
/// fall asleep, which is looked for in every few rounds.
const ROUNDS: u64 = 16;
const ROUNDS_WITH_SLEEP: u64 = 256;
/// Steps of one size in a round at most.
const LONGEST_ROUND: u64 = 128;

/// Scenes with fewer springs are done before a second thread is awake.
const WORTH_A_THREAD: usize = 1000;

/// The observer is asked whether to go on after this time, within rounds too.
const SLICE: Duration = Duration::from_millis(20);

/// A part with more than this share of all springs gets all threads.
const DOMINANT: f64 = 0.6;

impl Islands {
    /// Cuts the scene apart and compiles its parts, as [`Simulation::new`](crate::Simulation::new) does.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or a method cannot move its part.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        Self::with_options(scene, &RunOptions::default())
    }

    /// The same, run as the options say.
    ///
    /// # Errors
    ///
    /// If the scene or an option is wrong, or a method cannot move its part.
    pub fn with_options(scene: &Scene, options: &RunOptions) -> Result<Self, SetupError> {
        let mut problems = scene.problems();
        problems.extend(options.problems());
        if !problems.is_empty() {
            return Err(CompileError::Problems(problems).into());
        }
        refuse_unsettled(&scene.settings)?;
        let islands = cut(scene, options);
        let largest = islands.iter().map(|island| island.springs.len()).max();
        let dominant = DOMINANT * scene.springs.len() as f64;
        let is_dominated = largest.unwrap_or(0) as f64 > dominant || islands.len() == 1;
        let all_threads = threads(options);
        let is_small = scene.springs.len() < WORTH_A_THREAD;
        let threads = if is_dominated || is_small {
            1
        } else {
            all_threads.min(islands.len())
        };
        let mut of_part = *options;
        of_part.threads = all_threads / threads;
        let parts = with_threads(threads * of_part.threads, || {
            in_parallel(islands, threads, |island| {
                Part::new(scene, &of_part, island)
            })
        });
        let mut parts: Vec<Part> = parts.into_iter().collect::<Result<_, _>>()?;
        // Somebody who runs what does not move at all wants to see its steps.
        if parts.iter().all(|part| part.asleep_since.is_some()) {
            parts.iter_mut().for_each(|part| part.asleep_since = None);
        }
        let mut islands = Self {
            ledger: parts[0].books.ledger,
            parts,
            threads,
            duration: scene.settings.duration,
            sleep: options.sleep,
            n_springs: scene.springs.len(),
            n_loads: scene.loads.len(),
            supported: Supported::of(scene),
            probes: Probes::of(scene),
            time: 0.0,
            is_under_way: false,
            nodes: NodeStates::of(scene),
            shown: None,
            is_told: true,
            trial_time: Duration::ZERO,
            interrupt: Interrupt::default(),
        };
        islands.sum_ledgers();
        Ok(islands)
    }

    /// Whom to hear, as [`crate::Simulation::set_interrupt`].
    pub fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
        for part in &mut self.parts {
            part.simulation.set_interrupt(interrupt);
        }
    }

    fn sum_ledgers(&mut self) {
        let ledgers = self.parts.iter().map(|part| part.books.ledger);
        if let Some(sum) = Ledger::sum(ledgers) {
            self.ledger = sum;
        }
    }

    /// Everything that the run has come to, as words that mean something to
    /// [`Self::restore`] only.
    pub fn save(&mut self) -> Vec<u64> {
        let mut archive = Archive::saving();
        self.archive(&mut archive);
        archive.into_words()
    }

    /// Goes on where another run of the same scene was when it was saved; from
    /// there on it gives the same bits.
    ///
    /// # Errors
    ///
    /// If the words do not come from a run of this scene; this one is of no use
    /// any more then.
    pub fn restore(&mut self, words: Vec<u64>) -> Result<(), ForeignState> {
        let mut archive = Archive::loading(words);
        self.archive(&mut archive);
        archive.finish()
    }

    fn archive(&mut self, archive: &mut Archive) {
        let mut n_parts = self.parts.len() as u64;
        archive.word(&mut n_parts);
        if n_parts != self.parts.len() as u64 {
            return archive.refuse();
        }
        archive.real(&mut self.time);
        archive.flag(&mut self.is_under_way);
        archive.flag(&mut self.is_told);
        archive.duration(&mut self.trial_time);
        self.nodes.archive(archive);
        self.ledger.archive(archive);
        archive.option(&mut self.shown, |shown, archive| shown.archive(archive));
        for part in &mut self.parts {
            part.simulation.archive(archive);
            part.state.archive(archive);
            part.books.archive(part.simulation.system(), archive);
            archive.option(&mut part.asleep_since, |since, archive| archive.real(since));
            archive.count(&mut part.countdown);
            archive.option(&mut part.saved, |(words, steps), archive| {
                archive.words(words);
                archive.word(steps);
            });
        }
    }

    /// The parts; one of them at least.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The part with the most springs.
    ///
    /// # Panics
    ///
    /// Never: there is one.
    pub fn largest(&self) -> &Part {
        let size = |part: &&Part| (part.island.springs.len(), part.island.nodes.len());
        let largest = self.parts.iter().rev().max_by_key(size);
        largest.expect("one part at least")
    }

    /// Threads that are used, over parts and within them.
    pub fn threads(&self) -> usize {
        self.threads * self.largest().simulation.choice().options.threads
    }

    /// Number of free nodes; the unknowns of all parts are three times as many
    /// at most.
    pub fn n_free(&self) -> usize {
        let n_free = |part: &Part| part.simulation.stepper().system().n_free();
        self.parts.iter().map(n_free).sum()
    }

    /// Simulated time, in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Simulated time at the end, in s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Positions and velocities, in the order of the scene.
    pub fn nodes(&self) -> &NodeStates {
        &self.nodes
    }

    /// Whether trial runs are still to be made, by the first [`Self::run`].
    pub fn needs_trials(&self) -> bool {
        self.parts.iter().any(|part| part.simulation.needs_trials())
    }

    /// What trial runs and later comparisons of methods did so far.
    pub fn trial_work(&self) -> Work {
        let mut sum = Work::default();
        for part in &self.parts {
            sum += part.simulation.trial_work();
        }
        sum
    }

    /// The time that trial runs took before the first step.
    pub fn trial_time(&self) -> Duration {
        self.trial_time
    }

    /// What was done so far by all parts, trial runs aside; steps are those of the
    /// part that made the most.
    pub fn work(&self) -> Work {
        let mut sum = Work::default();
        for part in &self.parts {
            sum += part.simulation.work();
        }
        let steps = self
            .parts
            .iter()
            .map(|part| part.simulation.work().counts.steps);
        sum.counts.steps = steps.max().unwrap_or(0);
        sum
    }

    /// Energy at the start and its flows so far.
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// What each load and each moving support did so far.
    pub fn works(&self) -> Works {
        let mut works = Works {
            loads: vec![0.0; self.n_loads],
            ..Works::default()
        };
        self.parts
            .iter()
            .for_each(|part| part.add_works(&mut works));
        works.finish()
    }

    /// Energy now.
    pub fn energy(&self) -> Energy {
        let energies = self.parts.iter().map(|part| part.energy(&self.nodes));
        energies.fold(Energy::default(), |a, b| a + b)
    }

    /// Runs to the end, or until the observer, an interrupt or an error stops it,
    /// and shows the observer `intervals` + 1 frames, as [`crate::Simulation::run`] does.
    /// After a stop it goes on, with the frames that are still to come.
    ///
    /// # Errors
    ///
    /// If a step cannot be made, or trial runs settle nothing. All parts are then
    /// where the one that failed is; if that was interrupted, too, at the last time
    /// they had in common.
    pub fn run(
        &mut self,
        intervals: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        if let [part] = &mut self.parts[..]
            && part.asleep_since.is_none()
            && self.sleep.is_none()
        {
            let outcome = part.simulation.run(intervals, observer);
            self.time = part.simulation.stepper().time();
            self.nodes.clone_from(part.simulation.nodes());
            part.books.clone_from(part.simulation.books());
            self.ledger = part.books.ledger;
            self.trial_time = part.simulation.trial_time();
            return outcome;
        }
        if self.settle(observer)?.is_break() {
            return Ok(Outcome::Stopped);
        }
        let (duration, nodes) = (self.duration(), &self.nodes);
        let mut frames = Frames::new(duration, intervals, nodes, &self.probes, observer);
        frames.go_on(self.shown.as_ref(), self.time);
        let outcome = self.run_on(&mut frames, observer);
        self.shown = Some(frames.shown());
        outcome
    }

    /// Makes the trial runs of all parts.
    fn settle(&mut self, observer: &mut dyn Observer) -> Result<ControlFlow<()>, StepError> {
        let (at_once, threads) = (self.threads, self.threads());
        let parts = self.parts.iter_mut();
        let open: Vec<&mut Part> = parts
            .filter(|part| part.simulation.needs_trials())
            .collect();
        if open.is_empty() {
            return Ok(ControlFlow::Continue(()));
        }
        let begin = Instant::now();
        let (steps, is_stopped) = (AtomicU64::new(0), AtomicBool::new(false));
        let take_note = || {
            steps.fetch_add(1, Ordering::Relaxed);
            if is_stopped.load(Ordering::Relaxed) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let mut ask = || {
            let goes_on = observer.trial(steps.load(Ordering::Relaxed));
            is_stopped.fetch_or(goes_on.is_break(), Ordering::Relaxed);
        };
        let settled: Vec<_> = if at_once > 1 {
            let settle = |part: &mut Part| part.settle(&mut |_| take_note());
            let settle_all = || in_parallel(open, at_once, settle);
            with_threads_watched(threads, settle_all, &mut ask)
        } else {
            let settle = |part: &mut Part| {
                part.settle(&mut |_| {
                    ask();
                    take_note()
                })
            };
            open.into_iter().map(settle).collect()
        };
        self.trial_time += begin.elapsed();
        for settled in settled {
            if settled?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    fn run_on(
        &mut self,
        frames: &mut Frames,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        let duration = self.duration();
        let probes_do = observer.wants_samples() && self.probes.want_tensions();
        if observer.wants_members() || probes_do {
            let simulations = self.parts.iter_mut().map(|part| &mut part.simulation);
            simulations.for_each(crate::Simulation::track_members);
        }
        if let Some(due) = frames.take(0.0) {
            let shown = self.show(&due, observer);
            if either(shown, offer(observer, || self.account())).is_break() {
                return Ok(Outcome::Stopped);
            }
        }
        loop {
            if !self.is_told && self.tell(frames, observer).is_break() && self.time < duration {
                return Ok(Outcome::Stopped);
            }
            if self.time >= duration {
                return Ok(Outcome::Finished);
            }
            let shown_next = frames.next_time().unwrap_or(duration);
            let time = shown_next.min(self.end_of_round());
            if self.advance_to(time, observer.patience())? {
                self.is_told = false;
            } else if self.interrupt.is_requested()
                || observer.step(self.reached(), self.steps()).is_break()
            {
                return Ok(Outcome::Stopped);
            }
        }
    }

    /// Tells the observer of the round that was made.
    fn tell(&mut self, frames: &mut Frames, observer: &mut dyn Observer) -> ControlFlow<()> {
        self.is_told = true;
        let shown = match frames.take(self.time) {
            Some(due) => self.show(&due, observer),
            None => ControlFlow::Continue(()),
        };
        let offered = offer(observer, || self.account());
        if let Some(record) = self.record() {
            observer.record(&record);
        }
        let stepped = observer.step(self.time, self.steps());
        either(shown, either(offered, stepped))
    }

    /// The time that all parts have reached, in s.
    fn reached(&self) -> f64 {
        let awake = self.parts.iter().filter(|part| part.asleep_since.is_none());
        let times = awake.map(|part| part.simulation.stepper().time());
        times.fold(self.duration(), f64::min)
    }

    /// Steps of the part that made the most; one that was made in shorter ones is
    /// one.
    pub fn steps(&self) -> u64 {
        let steps = |part: &Part| part.simulation.stepper().steps();
        self.parts.iter().map(steps).max().unwrap_or(0)
    }

    /// What is known of the last steps of the parts together; `None` if none made any.
    pub fn record(&self) -> Option<StepRecord> {
        let records = self.parts.iter().map(|part| part.simulation.record());
        StepRecord::together(records.flatten(), self.time, self.work().counts)
    }

    /// Its energies now.
    pub fn account(&self) -> Account {
        Account {
            time: self.time,
            energy: self.energy(),
            ledger: self.ledger(),
        }
    }

    /// The end of the present round: a whole number of steps, where they are all
    /// of one size.
    fn end_of_round(&self) -> f64 {
        let end = self.planned_end_of_round();
        // Rounding of very many steps, or of hardly any duration, leads nowhere.
        if end > self.time {
            end
        } else {
            self.duration()
        }
    }

    fn planned_end_of_round(&self) -> f64 {
        // Nothing wakes them.
        if self.parts.iter().all(|part| part.asleep_since.is_some()) {
            return self.duration();
        }
        let rounds = match self.sleep {
            None => ROUNDS,
            Some(_) => ROUNDS_WITH_SLEEP,
        };
        let plan = self.parts[0].simulation.plan();
        let is_common = |part: &Part| part.simulation.plan() == plan;
        let Some(plan) = plan.filter(|_| self.parts.iter().all(is_common)) else {
            let round = (self.time / self.duration() * rounds as f64 + 1e-6).floor() + 1.0;
            return (self.duration() * round / rounds as f64).min(self.duration());
        };
        let stride = plan.n_steps().div_ceil(rounds).clamp(1, LONGEST_ROUND);
        let done = (self.time / plan.step_size + 1e-6) as u64;
        plan.end_of((done / stride + 1) * stride)
    }

    /// Brings all parts nearer to a time; says whether they got there, or pause on
    /// the way.
    fn advance_to(&mut self, time: f64, patience: Patience) -> Result<bool, StepError> {
        let pause = Pause {
            patience,
            deadline: Some(Instant::now() + SLICE),
        };
        let (now, begins) = (self.time, !self.is_under_way);
        let sleep = self.sleep;
        let done = self.move_parts(|part| {
            if begins {
                part.fall_asleep(sleep, now);
                part.save();
            }
            part.advance_to(time, pause)
        });
        let failures = done.iter().filter_map(|done| done.as_ref().err());
        let failures = failures.filter(|error| error.cause != Cause::Interrupted);
        let first = failures.min_by(|a, b| a.time.total_cmp(&b.time)).copied();
        self.is_under_way = done.iter().any(|done| *done != Ok(true));
        let come_to = match first {
            None if self.is_under_way => return Ok(false),
            None => time,
            Some(error) if self.come_to(error.time) => error.time,
            // They stand apart; what they had in common last is kept.
            Some(error) => return Err(error),
        };
        self.time = come_to;
        self.sum_ledgers();
        for part in &self.parts {
            for (k, &node) in part.island.nodes.iter().enumerate() {
                self.nodes.positions[node] = part.state.positions[k];
                self.nodes.velocities[node] = part.state.velocities[k];
            }
        }
        first.map_or(Ok(true), Err)
    }

    /// The same with all parts, several at once.
    fn move_parts<R: Send>(&mut self, work: impl Fn(&mut Part) -> R + Send + Sync) -> Vec<R> {
        let (at_once, threads) = (self.threads, self.threads());
        let parts: Vec<&mut Part> = self.parts.iter_mut().collect();
        if at_once == 1 {
            return parts.into_iter().map(work).collect();
        }
        with_threads(threads, || in_parallel(parts, at_once, work))
    }

    /// After a failure: brings all parts to its time; those that are further by
    /// running them anew from where they were some steps ago. Says whether all got
    /// there.
    fn come_to(&mut self, time: f64) -> bool {
        let done = self.move_parts(|part| {
            // It was there before, so it gets there again.
            part.go_back(time) && part.advance_to(time, Pause::NEVER) == Ok(true)
        });
        done.into_iter().all(|is_there| is_there)
    }
}
