//! A scene on its way through its duration: steps, frames, report.

mod accounts;
mod archive;
mod breaks;
mod changes;
mod events;
mod members;
mod running;
mod steps;
mod substeps;
mod trials;
mod watch;

use self::breaks::Ahead;
pub use self::changes::ChangeError;
use self::changes::Controls;
use crate::control::auto::{Auto, Picked};
use crate::control::choose::{Start, start};
use crate::control::controller::Schedule;
use crate::control::timetable::Timetable;
use crate::ledger::Books;
use crate::run::breaks::Break;
use crate::run::dense_output::DenseOutput;
use crate::run::frames::{AT_THE_END, Shown};
use crate::run::members::{Supported, Track};
use crate::run::probes::Probes;
use crate::{
    Archive, Cause, Choice, Flows, Interval, Ledger, Method, MethodError, NodeStates, Patience,
    SetupError, State, StepError, StepPlan, StepRecord, Stepper, Work, Works,
};
use springs_assembly::{Compilation, Emitter, Energy, System, compile_with};
use springs_scene::{RunOptions, Scene};
use springs_solver::Interrupt;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// A change of method during a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// When, in s.
    pub time: f64,
    /// The method from then on.
    pub method: springs_scene::Method,
    /// Why.
    pub reason: String,
}

/// A scene on its way through its duration.
pub struct Simulation {
    stepper: Stepper,
    choice: Choice,
    duration: f64,
    timetable: Timetable,
    schedule: Schedule,
    /// Trial runs settle the schedule, or did.
    needs_trials: bool,
    /// Chooses methods, if that is left open.
    auto: Option<Auto>,
    switches: Vec<Switch>,
    dense_output: DenseOutput,
    /// Frames that were shown, if it was stopped on the way.
    shown: Option<Shown>,
    /// The last step, and the state before it.
    last: Option<Interval>,
    /// What the method estimated of that step: the rate at which it adds to the error of
    /// positions, in m/s.
    last_rate: Option<f64>,
    /// Of the steps so far, by their estimates, in m.
    estimated_error: Option<f64>,
    /// Whether the observer has been told of that step's end.
    is_told: bool,
    before: NodeStates,
    nodes: NodeStates,
    work: Work,
    trial_work: Work,
    trial_time: Duration,
    books: Books,
    /// The books before the last step, and the flows in it as far as free nodes
    /// took part.
    books_before: Books,
    last_flows: Flows,
    /// Room for those of an attempted step.
    next_flows: Flows,
    /// The flows from the start of the last step to the time of the state between
    /// that was made last, if a step of the method gave them.
    flows_between: Option<(f64, Flows)>,
    /// Global vectors of states between steps; made when first needed.
    state_between: Option<State>,
    /// The most that energy of motion and of springs could come from, in J.
    most_energy: f64,
    interrupt: Interrupt,
    n_springs: usize,
    /// Those of the scene.
    n_loads: usize,
    supported: Supported,
    probes: Probes,
    /// Tensions and their peaks, where somebody wants them.
    track: Option<Track>,
    /// Whether it is still to be found out what breaks at the end of the last step.
    is_end_open: bool,
    breaks: Vec<Break>,
    /// Something is known to break soon.
    ahead: Option<Ahead>,
    /// What may be changed between steps, as it is now; `None` if nothing may.
    controls: Option<Box<Controls>>,
    /// Room for what a step may have to take back.
    words: Vec<u64>,
}

/// How far a simulation may go at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pause {
    pub(crate) patience: Patience,
    /// It makes one step at least.
    pub(crate) deadline: Option<Instant>,
}

impl Pause {
    pub(crate) const NEVER: Self = Self {
        patience: Patience::NEVER,
        deadline: None,
    };

    /// Whether a pause is due after a step.
    fn is_due(&self, time: f64, steps: u64) -> bool {
        self.patience.is_used_up(time, steps)
            || self
                .deadline
                .is_some_and(|deadline| Instant::now() >= deadline)
    }
}

impl Simulation {
    /// Compiles the scene, and builds the method and its steps as far as the
    /// settings say which. What they leave to trial runs is settled by the first
    /// [`Self::run`].
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        Self::with_options(scene, &RunOptions::default())
    }

    /// The same, run as the options say; [`RunOptions::sleep`] is for
    /// [`crate::Islands`].
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn with_options(scene: &Scene, options: &RunOptions) -> Result<Self, SetupError> {
        Self::with_emitters(scene, options, Vec::new())
    }

    /// The same with more emitters than those of the scene, on its nodes.
    ///
    /// # Errors
    ///
    /// If the scene is wrong, the method cannot move it, or there are too many
    /// emitters.
    ///
    /// # Panics
    ///
    /// If an emitter asks for a node that is not there.
    pub fn with_emitters(
        scene: &Scene,
        options: &RunOptions,
        emitters: Vec<Box<dyn Emitter>>,
    ) -> Result<Self, SetupError> {
        let compilation = Compilation {
            emitters,
            is_complete: !options.skip,
            may_change: false,
        };
        Self::compiled(scene, options, compilation)
    }

    /// With the method of the settings.
    fn compiled(
        scene: &Scene,
        options: &RunOptions,
        compilation: Compilation,
    ) -> Result<Self, SetupError> {
        let system = compile_with(scene, compilation)?;
        let start = start(scene, (&scene.settings, options), &system)?;
        let dense_output = DenseOutput::of(&start.choice, &*start.method, &system)?;
        Self::starting(scene, system, start, dense_output)
    }

    /// The same with a method of one's own, in place of that of the settings.
    /// With a tolerance it must estimate its error; [`crate::Doubling`] makes
    /// any method do so.
    /// States between its steps are interpolated by a cubic polynomial, or
    /// linearly if its order is 1.
    ///
    /// # Errors
    ///
    /// If the scene is wrong.
    pub fn with_method(
        scene: &Scene,
        options: &RunOptions,
        method: impl FnOnce(&System) -> Box<dyn Method>,
    ) -> Result<Self, SetupError> {
        let compilation = Compilation {
            is_complete: !options.skip,
            ..Compilation::default()
        };
        let system = compile_with(scene, compilation)?;
        let start = Start::with_method(scene, options, &system, method(&system));
        let dense_output = DenseOutput::Polynomial {
            order: start.method.order(),
            is_straight_if_coarse: false,
        };
        Self::starting(scene, system, start, dense_output)
    }

    fn starting(
        scene: &Scene,
        system: System,
        start: Start,
        dense_output: DenseOutput,
    ) -> Result<Self, SetupError> {
        let duration = scene.settings.duration;
        let options = &start.choice.options;
        let stepper = Stepper::with_method(system, start.method).on_threads_of(options);
        let nodes = NodeStates::of(scene);
        let work = stepper.method().setup();
        let books = Books::open(stepper.system(), stepper.state());
        if !books.ledger.start.total().is_finite() {
            return Err(SetupError::EnergyOverflow);
        }
        Ok(Self {
            books_before: books.clone(),
            books,
            last_flows: Flows::default(),
            next_flows: Flows::default(),
            flows_between: None,
            state_between: None,
            duration,
            timetable: Timetable::of(scene),
            needs_trials: matches!(start.schedule, Schedule::Open(_)),
            schedule: start.schedule,
            auto: start.auto,
            switches: Vec::new(),
            dense_output,
            choice: start.choice,
            work,
            trial_work: Work::default(),
            trial_time: Duration::ZERO,
            stepper,
            shown: None,
            most_energy: 0.0,
            last: None,
            last_rate: None,
            estimated_error: None,
            is_told: true,
            before: nodes.clone(),
            nodes,
            interrupt: Interrupt::default(),
            n_springs: scene.springs.len(),
            n_loads: scene.loads.len(),
            supported: Supported::of(scene),
            probes: Probes::of(scene),
            track: None,
            is_end_open: false,
            breaks: Vec::new(),
            ahead: None,
            controls: None,
            words: Vec::new(),
        })
    }

    /// Whom to hear while it runs: asked to stop, [`Self::run`] ends soon, within
    /// trial runs and long steps too. A step that was under way is taken back, so
    /// that whoever goes on gets the same bits as without a stop.
    pub fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
        self.stepper.set_interrupt(interrupt);
        self.dense_output.set_interrupt(interrupt);
        if let Some(auto) = &mut self.auto {
            auto.set_interrupt(interrupt);
        }
    }

    /// Method, tangent and step; the method is `Auto` until trial runs have found
    /// one.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// Whether trial runs are still to be made, by the first [`Self::run`].
    pub fn needs_trials(&self) -> bool {
        matches!(self.schedule, Schedule::Open(_))
    }

    /// What trial runs and later comparisons of methods did so far.
    pub fn trial_work(&self) -> Work {
        self.trial_work
    }

    /// The time that took.
    pub fn trial_time(&self) -> Duration {
        self.trial_time
    }

    /// Changes of method so far; only `Auto` with a tolerance makes any.
    pub fn switches(&self) -> &[Switch] {
        &self.switches
    }

    /// Simulated time at the end, in s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// How the duration is cut into steps, if they are of fixed size.
    pub fn plan(&self) -> Option<StepPlan> {
        match self.schedule {
            Schedule::Fixed(plan) => Some(plan),
            Schedule::Adaptive(_) | Schedule::Open(_) => None,
        }
    }

    /// The compiled scene and its state.
    pub fn stepper(&self) -> &Stepper {
        &self.stepper
    }

    /// Positions and velocities now, in the order of the scene.
    pub fn nodes(&self) -> &NodeStates {
        &self.nodes
    }

    /// The compiled scene.
    pub fn system(&self) -> &System {
        self.stepper.system()
    }

    /// What was done so far, trial runs aside.
    pub fn work(&self) -> Work {
        self.work
    }

    /// What is known of the last step; `None` before the first one.
    pub fn record(&self) -> Option<StepRecord> {
        let interval = self.last?;
        let (choice, counts) = (&self.choice, self.work.counts);
        let step = (interval.end, interval.size);
        Some(StepRecord::of(step, self.last_rate, choice, counts))
    }

    /// The error of positions now, in m: what the steps added to it by the estimates of the
    /// method. `None` where it makes none, as with steps of one size.
    pub fn estimated_error(&self) -> Option<f64> {
        self.estimated_error
    }

    /// Energy at the start and its flows so far.
    pub fn ledger(&self) -> Ledger {
        self.books.ledger
    }

    /// What each load and each moving support did so far.
    pub fn works(&self) -> Works {
        self.works_of(&self.books)
    }

    pub(crate) fn books(&self) -> &Books {
        &self.books
    }

    /// Energy now.
    pub fn energy(&self) -> Energy {
        let state = self.stepper.state();
        self.stepper.system().energy(&state.x, &state.v)
    }

    /// Steps until `time` lies within the last step, and gives the state then; or
    /// pauses on the way, and says that it did not get there.
    ///
    /// # Errors
    ///
    /// If a step cannot be made; `out` is then the state where that was.
    pub(crate) fn advance_to(
        &mut self,
        time: f64,
        pause: Pause,
        out: &mut NodeStates,
    ) -> Result<bool, StepError> {
        let is_reached = |interval: Interval| time <= interval.end + AT_THE_END * interval.size;
        let mut has_stepped = false;
        while time > 0.0 && !self.last.is_some_and(is_reached) && !self.is_finished() {
            let (steps, now) = (self.stepper.steps(), self.stepper.time());
            if has_stepped && pause.is_due(now, steps) {
                return Ok(false);
            }
            has_stepped = true;
            if let Err(error) = self.advance() {
                self.stepper.scatter(&mut self.nodes);
                out.clone_from(&self.nodes);
                return Err(error);
            }
        }
        self.stepper.scatter(&mut self.nodes);
        match self.last {
            Some(interval) if time < interval.end - AT_THE_END * interval.size => {
                self.evaluate(interval, time, out)?;
            }
            _ => {
                self.end_step();
                out.clone_from(&self.nodes);
            }
        }
        Ok(true)
    }

    /// Where the last step began, in s.
    pub(crate) fn last_start(&self) -> f64 {
        self.last.map_or(0.0, |interval| interval.start)
    }

    /// Makes one step towards the end of the duration and says which; `None` at
    /// the end. For a loop of one's own. The first one is made after the trial runs
    /// that the settings leave open.
    ///
    /// # Errors
    ///
    /// If it cannot be made; time and state are then as they were before.
    pub fn step(&mut self) -> Result<Option<Interval>, StepError> {
        if self.settle(&mut |_| ControlFlow::Continue(()))?.is_break() {
            let nothing = Interval::default();
            return Err(self.stepper.error(Cause::Interrupted, 0, nothing));
        }
        if self.is_finished() {
            self.end_step();
            return Ok(None);
        }
        let interval = self.advance()?;
        self.stepper.scatter(&mut self.nodes);
        Ok(Some(interval))
    }

    /// The state at a time within the last step, by [`Self::step`] or
    /// [`Self::run`], to the order of the method.
    ///
    /// # Errors
    ///
    /// If it takes a part of a step, and that cannot be made.
    ///
    /// # Panics
    ///
    /// If there was no step yet, or the time does not lie within it.
    pub fn state_at(&mut self, time: f64, out: &mut NodeStates) -> Result<(), StepError> {
        let interval = self.last.expect("a step was made");
        assert!(
            (interval.start..=interval.end).contains(&time),
            "a time within the last step"
        );
        if time == interval.end {
            out.clone_from(&self.nodes);
            return Ok(());
        }
        self.evaluate(interval, time, out)
    }

    /// The state within the last step.
    fn evaluate(
        &mut self,
        interval: Interval,
        time: f64,
        out: &mut NodeStates,
    ) -> Result<(), StepError> {
        self.stepper.scatter_before(&mut self.before);
        let (system, anchors) = (self.stepper.system(), self.stepper.anchors());
        let ends = [&self.before, &self.nodes];
        let words = self.interrupt.can_be_requested().then(|| {
            let mut archive = Archive::saving_into(std::mem::take(&mut self.words));
            self.dense_output.archive(&mut archive);
            archive.into_words()
        });
        let compiled = (system, anchors);
        let made = self
            .dense_output
            .evaluate(compiled, ends, interval, time, out);
        if let Some(words) = words {
            let mut archive = Archive::loading(words);
            if made == Err(MethodError::Interrupted) {
                self.dense_output.archive(&mut archive);
            }
            self.words = archive.into_words();
        }
        let failure = match made {
            Err(error) => Some((Cause::from(error), error.block())),
            Ok(()) => {
                let node = out.first_not_finite();
                node.map(|node| (Cause::NotFinite, system.numbering().block(node)))
            }
        };
        if let Some((cause, block)) = failure {
            return Err(self.stepper.error(cause, block, interval));
        }
        self.flows_between = self.dense_output.flows().map(|flows| (time, flows.clone()));
        Ok(())
    }

    fn is_finished(&self) -> bool {
        match self.schedule {
            Schedule::Fixed(plan) => self.stepper.steps() >= plan.n_steps(),
            Schedule::Adaptive(_) | Schedule::Open(_) => self.stepper.time() >= self.duration,
        }
    }

    /// Goes on with another method; what its construction took, or `None` if
    /// states between its steps cannot be made.
    fn put_to_use(&mut self, picked: Picked) -> Option<Work> {
        let Picked { method, choice, .. } = picked;
        self.dense_output = DenseOutput::of(&choice, &*method, self.stepper.system()).ok()?;
        self.dense_output.set_interrupt(&self.interrupt);
        let setup = method.setup();
        let old = self.stepper.change_method(method);
        if let Some(auto) = &mut self.auto {
            auto.put_back(self.choice.method, old);
        }
        self.choice.method = choice.method;
        Some(setup)
    }
}
