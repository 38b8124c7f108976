//! The time loop: steps, frames, report.

use crate::auto::{Auto, Picked};
use crate::choose::{Schedule, Start, keeps_its_step, start};
use crate::controller::Verdict;
use crate::interpolate::Between;
use crate::{
    Anchors, Cause, Choice, Counts, Flows, HiddenState, Interval, Ledger, Method, NodeStates,
    SetupError, State, StepError, StepPlan, Stepper, Work,
};
use springs_assembly::{Energy, ForceEmitter as _, System, compile};
use springs_scene::Scene;
use std::ops::ControlFlow;

/// Positions and velocities at one of the times asked for.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Counted from 0.
    pub index: usize,
    /// In s.
    pub time: f64,
    /// All nodes, in the order of the scene.
    pub nodes: &'a NodeStates,
}

/// Energies at the end of a step or at the time of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Account {
    /// In s.
    pub time: f64,
    /// Energy then.
    pub energy: Energy,
    /// Energy at the start, and where it went since.
    pub ledger: Ledger,
}

/// Sees the frames and steps of a simulation, and may stop it.
pub trait Observer {
    /// Called for every frame, in order.
    fn frame(&mut self, _frame: Frame<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called after every step, with the simulated time in s.
    fn step(&mut self, _time: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Whether to be called with an account, asked after every frame, for its
    /// time, and after every step.
    fn wants_account(&self) -> bool {
        false
    }

    /// Called with energies, if they are wanted, after [`Self::frame`] or before
    /// [`Self::step`].
    fn account(&mut self, _account: Account) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// An observer that sees nothing.
impl Observer for () {}

/// How a simulation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The whole duration is simulated.
    Finished,
    /// The observer stopped it.
    Stopped,
}

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
    schedule: Schedule,
    /// Goes on choosing methods, if that is left open.
    auto: Option<Auto>,
    switches: Vec<Switch>,
    between: Between,
    /// Frames that were shown, if it was stopped on the way.
    shown: Option<Shown>,
    /// The last step, and the state before it.
    last: Option<Interval>,
    before: NodeStates,
    nodes: NodeStates,
    work: Work,
    ledger: Ledger,
    /// The ledger before the last step, and the flows in it as far as free nodes
    /// took part.
    ledger_before: Ledger,
    last_flows: Flows,
    /// The flows from the start of the last step to the time of the state between
    /// that was made last, if a step of the method gave them.
    flows_between: Option<(f64, Flows)>,
    /// Global vectors of states between steps; made when first needed.
    state_between: Option<State>,
    rescue_is_allowed: bool,
    /// The most that energy of motion and of springs could come from, in J.
    most_energy: f64,
}

/// Steps shorter than this part of the duration lead nowhere.
const SMALLEST_STEP: f64 = 1e-14;

/// Evaluations of forces between two looks at the energy of springs, where no
/// linear system is solved, beside which a look costs nothing.
const LOOK_AT_SPRINGS: u64 = 16;

/// So many times the energy that was known to be there is not possible.
const IMPOSSIBLE: f64 = 1e4;

/// Energy of springs counts from this strain on. Methods that filter stiff
/// springs hold their tension with a stretch that is far too large for their
/// stiffness, but small.
const NOTABLE_STRAIN: f64 = 0.5;

/// Parts of a step that fails may be as short as this part of it.
const SHORTEST_RESCUE: f64 = 1e-3;

/// Events are found to this part of the step they happen in.
const EVENT_ACCURACY: f64 = 1e-12;
const MOST_BISECTIONS: usize = 60;

impl Simulation {
    /// Compiles the scene and settles method and step.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        let system = compile(scene)?;
        let anchors = Anchors::new(&system, &State::initial(&system));
        let start = start(scene, &system, &anchors)?;
        let between = Between::of(&start.choice, &*start.method, &system)?;
        Self::starting(scene, system, start, between)
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
        method: impl FnOnce(&System) -> Box<dyn Method>,
    ) -> Result<Self, SetupError> {
        let system = compile(scene)?;
        let start = Start::with_method(scene, &system, method(&system));
        let between = Between::Polynomial {
            order: start.method.order(),
            straight_from: f64::INFINITY,
        };
        Self::starting(scene, system, start, between)
    }

    fn starting(
        scene: &Scene,
        system: System,
        start: Start,
        between: Between,
    ) -> Result<Self, SetupError> {
        let duration = scene.settings.duration;
        let stepper = Stepper::with_method(system, start.method);
        let nodes = NodeStates::of(scene);
        let mut work = stepper.method().setup();
        work += start.work;
        let start_method = start.choice.method;
        let ledger = Ledger::open(stepper.system(), stepper.state());
        if !ledger.start.total().is_finite() {
            return Err(SetupError::EnergyOverflow);
        }
        Ok(Self {
            ledger,
            ledger_before: ledger,
            last_flows: Flows::default(),
            flows_between: None,
            state_between: None,
            duration,
            schedule: start.schedule,
            auto: start.auto,
            switches: Vec::new(),
            between,
            choice: start.choice,
            work,
            stepper,
            shown: None,
            rescue_is_allowed: scene.settings.rescue && !keeps_its_step(start_method),
            most_energy: 0.0,
            last: None,
            before: nodes.clone(),
            nodes,
        })
    }

    /// Method, tangent and step.
    pub fn choice(&self) -> &Choice {
        &self.choice
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
            Schedule::Adaptive(_) => None,
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

    /// What was done so far.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Energy at the start and its flows so far.
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// Energy now.
    pub fn energy(&self) -> Energy {
        let state = self.stepper.state();
        self.stepper.system().energy(&state.x, &state.v)
    }

    /// Runs to the end, or until the observer or an error stops it, and shows
    /// the observer `intervals` + 1 frames at equal distances, time 0 and the
    /// duration included. Frames never change the steps. After a stop it goes
    /// on, with the frames that are still to come.
    ///
    /// # Errors
    ///
    /// If a step cannot be made. Everything up to it stays available.
    pub fn run(
        &mut self,
        intervals: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        let mut frames = Frames::new(self.duration, intervals, &self.nodes);
        frames.go_on(self.shown, self.stepper.time());
        let outcome = self.run_on(&mut frames, observer);
        self.shown = Some(frames.shown());
        outcome
    }

    fn run_on(
        &mut self,
        frames: &mut Frames,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        if frames.is_first()
            && (frames.show(0.0, &self.nodes, observer).is_break()
                || offer(observer, || self.account(0.0)).is_break())
        {
            return Ok(Outcome::Stopped);
        }
        while !self.is_finished() {
            let interval = match self.advance() {
                Ok(interval) => interval,
                Err(error) => {
                    self.stepper.scatter(&mut self.nodes);
                    return Err(error);
                }
            };
            let shown = self.show_frames(frames, interval, observer)?;
            if shown.is_break()
                || offer(observer, || self.account(interval.end)).is_break()
                || observer.step(interval.end).is_break()
            {
                self.stepper.scatter(&mut self.nodes);
                return Ok(match self.is_finished() {
                    true => Outcome::Finished,
                    false => Outcome::Stopped,
                });
            }
        }
        self.stepper.scatter(&mut self.nodes);
        Ok(Outcome::Finished)
    }

    /// Energies at the end of the last step, which `time` is.
    fn account(&self, time: f64) -> Account {
        Account {
            time,
            energy: self.energy(),
            ledger: self.ledger,
        }
    }

    /// Energies at a time within the last step, where `nodes` are.
    fn account_between(&mut self, interval: Interval, time: f64, nodes: &NodeStates) -> Account {
        let ledger = self.ledger_between(interval, time, nodes);
        let state = self.gather_between(nodes);
        let energy = self.stepper.system().energy(&state.x, &state.v);
        self.state_between = Some(state);
        Account {
            time,
            energy,
            ledger,
        }
    }

    /// The ledger at a time within the last step, where `nodes` are.
    fn ledger_between(&mut self, interval: Interval, time: f64, nodes: &NodeStates) -> Ledger {
        let state = self.gather_between(nodes);
        let (system, h) = (self.stepper.system(), interval.size);
        let ends = [self.stepper.before(), self.stepper.state()];
        let elapsed = time - interval.start;
        let flows = match self.flows_between {
            Some((at, flows)) if at == time => flows,
            _ => self.last_flows.part(system, ends, h, elapsed / h),
        };
        let mut ledger = self.ledger_before;
        ledger.record(flows + Flows::between_fixed(system, &ends[0].x, &state, elapsed));
        self.state_between = Some(state);
        ledger
    }

    /// The global vectors of `nodes`; to be put back for the next time.
    fn gather_between(&mut self, nodes: &NodeStates) -> State {
        let state = self.state_between.take();
        let mut state = state.unwrap_or_else(|| self.stepper.state().clone());
        state.gather(self.stepper.system(), nodes);
        state
    }

    /// The ledger when [`Self::advance_to`] got to a time, where `nodes` were.
    pub(crate) fn ledger_at(&mut self, time: f64, nodes: &NodeStates) -> Ledger {
        match self.last {
            Some(interval) if time < interval.end - AT_THE_END * interval.size => {
                self.ledger_between(interval, time, nodes)
            }
            _ => self.ledger,
        }
    }

    /// Steps until `time` lies within the last step, and gives the state then;
    /// or makes `most_steps` steps, and says that it did not get there.
    ///
    /// # Errors
    ///
    /// If a step cannot be made; `out` is then the state where that was.
    pub(crate) fn advance_to(
        &mut self,
        time: f64,
        most_steps: u64,
        out: &mut NodeStates,
    ) -> Result<bool, StepError> {
        let is_reached = |interval: Interval| time <= interval.end + AT_THE_END * interval.size;
        let mut steps = 0;
        while time > 0.0 && !self.last.is_some_and(is_reached) && !self.is_finished() {
            if steps == most_steps {
                return Ok(false);
            }
            steps += 1;
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
            _ => out.clone_from(&self.nodes),
        }
        Ok(true)
    }

    /// Makes one step towards the end of the duration and says which; `None` at
    /// the end. For a loop of one's own.
    ///
    /// # Errors
    ///
    /// If it cannot be made; time and state are then as they were before.
    pub fn step(&mut self) -> Result<Option<Interval>, StepError> {
        if self.is_finished() {
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

    /// Steps until `event`, a function of time and state, passes from negative
    /// to zero or above, and returns when that was and the state then; `None`
    /// if it does not happen within the duration. The simulation itself stands
    /// at the end of the step in which it happened, and can go on.
    ///
    /// An event that begins and ends within one step is not seen.
    ///
    /// # Errors
    ///
    /// If a step cannot be made.
    pub fn run_until(
        &mut self,
        mut event: impl FnMut(f64, &NodeStates) -> f64,
    ) -> Result<Option<(f64, NodeStates)>, StepError> {
        let mut before = event(self.stepper.time(), &self.nodes);
        while let Some(interval) = self.step()? {
            let after = event(interval.end, &self.nodes);
            if before < 0.0 && after >= 0.0 {
                return self.locate(interval, event).map(Some);
            }
            before = after;
        }
        Ok(None)
    }

    /// When within the last step an event happens, by bisection.
    fn locate(
        &mut self,
        interval: Interval,
        mut event: impl FnMut(f64, &NodeStates) -> f64,
    ) -> Result<(f64, NodeStates), StepError> {
        let (mut early, mut late) = (interval.start, interval.end);
        let mut found = self.nodes.clone();
        let mut middle_state = self.nodes.clone();
        for _ in 0..MOST_BISECTIONS {
            let middle = 0.5 * (early + late);
            if late - early <= EVENT_ACCURACY * interval.size || middle <= early || middle >= late {
                break;
            }
            self.evaluate(interval, middle, &mut middle_state)?;
            if event(middle, &middle_state) >= 0.0 {
                late = middle;
                std::mem::swap(&mut found, &mut middle_state);
            } else {
                early = middle;
            }
        }
        Ok((late, found))
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
        let made = self
            .between
            .evaluate((system, anchors), ends, interval, time, out);
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
        self.flows_between = self.between.flows().map(|flows| (time, flows));
        Ok(())
    }

    fn is_finished(&self) -> bool {
        match self.schedule {
            Schedule::Fixed(plan) => self.stepper.steps() >= plan.n_steps(),
            Schedule::Adaptive(_) => self.stepper.time() >= self.duration,
        }
    }

    /// Makes one step that stands.
    fn advance(&mut self) -> Result<Interval, StepError> {
        let interval = match self.schedule {
            Schedule::Fixed(plan) => {
                let step = self.stepper.steps() + 1;
                let interval = Interval {
                    start: self.stepper.time(),
                    end: plan.end_of(step),
                    size: plan.size_of(step),
                };
                if let Err(error) = self.take(interval) {
                    return self.rescue(interval, error);
                }
                interval
            }
            Schedule::Adaptive(_) => self.adaptive_step()?,
        };
        self.last = Some(interval);
        Ok(interval)
    }

    /// Makes a step that stands, or none.
    fn take(&mut self, interval: Interval) -> Result<(), StepError> {
        let counts = self.work.counts;
        self.stepper.attempt(interval, &mut self.work)?;
        self.enter(interval, counts)
    }

    /// The attempted step stands and is booked, unless there is more energy than
    /// can be; `counts` are those before it.
    fn enter(&mut self, interval: Interval, counts: Counts) -> Result<(), StepError> {
        let flows = self.stepper.flows(interval);
        let (before, after) = (self.stepper.before(), self.stepper.state());
        let system = self.stepper.system();
        let mut ledger = self.ledger;
        ledger.record(flows + Flows::between_fixed(system, &before.x, after, interval.size));
        if let Some(cause) = self.watch_energy(interval, counts, ledger.anchor_work) {
            let fastest = self.stepper.fastest_block();
            self.stepper.reject();
            return Err(self.stepper.error(cause, fastest, interval));
        }
        self.stepper.accept(interval, &mut self.work);
        self.ledger_before = std::mem::replace(&mut self.ledger, ledger);
        self.last_flows = flows;
        self.flows_between = None;
        Ok(())
    }

    /// Makes a step that failed as a whole in shorter ones, if that is allowed.
    /// They count as one; the last of them that fails is the error, and
    /// everything is then as it was before the first.
    fn rescue(&mut self, whole: Interval, error: StepError) -> Result<Interval, StepError> {
        // Shorter steps do not take away energy that is there already.
        let is_final = |cause| {
            matches!(
                cause,
                Cause::OutOfMemory | Cause::EnergyDiverged | Cause::EnergyOverflow
            )
        };
        if !self.rescue_is_allowed || is_final(error.cause) {
            return Err(error);
        }
        let (saved, ledger) = (self.stepper.bookmark(), self.ledger);
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
            interval.end = match is_last {
                true => whole.end,
                false => interval.start + interval.size,
            };
            match self.take(interval) {
                Ok(()) => flows += self.last_flows,
                Err(error)
                    if is_final(error.cause) || interval.size < SHORTEST_RESCUE * whole.size =>
                {
                    self.stepper.return_to(saved);
                    self.ledger = ledger;
                    return Err(error);
                }
                Err(_) => {
                    interval.size *= 0.5;
                    interval.end = interval.start;
                }
            }
        }
        self.stepper.count_as_one(saved);
        (self.ledger_before, self.last_flows) = (ledger, flows);
        self.work.counts.rescued_steps += 1;
        self.last = Some(whole);
        Ok(whole)
    }

    /// What is wrong with the energy after the attempted step, if anything is:
    /// there is far more than there ever was or came in, as with steps that are
    /// too long for an explicit method, long before numbers overflow.
    ///
    /// The kinetic energy is looked at in every step, where it costs nothing; the
    /// others where that is cheap beside the step, and in the last one.
    fn watch_energy(
        &mut self,
        interval: Interval,
        counts: Counts,
        anchor_work: f64,
    ) -> Option<Cause> {
        let (system, state) = (self.stepper.system(), self.stepper.state());
        let now = self.work.counts;
        let is_last = match self.schedule {
            Schedule::Fixed(plan) => self.stepper.steps() + 1 >= plan.n_steps(),
            Schedule::Adaptive(_) => interval.end >= self.duration,
        };
        let looks = is_last
            || now.solves > counts.solves
            || now.force_evaluations / LOOK_AT_SPRINGS > counts.force_evaluations / LOOK_AT_SPRINGS;
        let kinetic = self.stepper.kinetic_energy();
        let mut elastic = 0.0;
        if looks {
            elastic = system.springs().energy(&state.x);
            if !(kinetic + elastic + system.gravity_energy(&state.x)).is_finite() {
                return Some(Cause::EnergyOverflow);
            }
        }
        if kinetic + elastic <= IMPOSSIBLE * self.most_energy {
            return None;
        }
        if looks {
            elastic = system.springs().energy_beyond(NOTABLE_STRAIN, &state.x);
        }
        let start = self.ledger.start;
        let fallen = (start.gravity - system.gravity_energy(&state.x)).abs();
        // Every step rounds once more.
        let rounding = system.springs().energy_of_rounding(&state.x);
        let rounded = (self.stepper.steps() + 1) as f64 * rounding;
        let known = start.kinetic + start.elastic + anchor_work.abs() + fallen + rounded;
        self.most_energy = self.most_energy.max(known);
        (kinetic + elastic > IMPOSSIBLE * self.most_energy).then_some(Cause::EnergyDiverged)
    }

    /// Attempts steps until one is accurate enough.
    fn adaptive_step(&mut self) -> Result<Interval, StepError> {
        self.review_method();
        let Schedule::Adaptive(controller) = &mut self.schedule else {
            unreachable!("only called with a controller");
        };
        let counts = self.work.counts;
        let start = self.stepper.time();
        let interval = loop {
            let interval = next_interval(start, self.duration, controller.step_size());
            let attempt = self.stepper.attempt(interval, &mut self.work);
            let too_small = interval.size < SMALLEST_STEP * self.duration
                || interval.start + 0.1 * interval.size == interval.start;
            match attempt {
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
                    match controller.judge(interval.size, estimate) {
                        Verdict::Accept => break interval,
                        Verdict::Reject if too_small => {
                            self.stepper.reject();
                            let cause = Cause::StepTooSmall;
                            return Err(self.stepper.error(cause, estimate.block, interval));
                        }
                        Verdict::Reject => self.stepper.reject(),
                    }
                }
            }
            self.work.counts.rejected_steps += 1;
        };
        self.enter(interval, counts)?;
        if let Some(auto) = &mut self.auto {
            auto.record(interval.size, self.work.counts - counts);
        }
        Ok(interval)
    }

    /// Goes on with another method, if methods are chosen and one has become
    /// clearly cheaper.
    fn review_method(&mut self) {
        let (Some(auto), Schedule::Adaptive(controller)) = (&mut self.auto, &mut self.schedule)
        else {
            return;
        };
        if !auto.is_review_due() {
            return;
        }
        let compiled = (self.stepper.system(), self.stepper.anchors());
        let picked = auto.review(compiled, self.stepper.state(), controller);
        // A method that cannot be built is no choice.
        let Ok(Some(picked)) = picked else { return };
        let (step_size, reason) = (picked.step_size, picked.choice.reason.clone());
        if let Some(setup) = self.put_to_use(picked) {
            self.work += setup;
            self.switches.push(Switch {
                time: self.stepper.time(),
                method: self.choice.method,
                reason,
            });
            if let Schedule::Adaptive(controller) = &mut self.schedule {
                controller.change_method(step_size);
            }
        }
    }

    /// Goes on with another method; what its construction took, or `None` if
    /// states between its steps cannot be made.
    fn put_to_use(&mut self, picked: Picked) -> Option<Work> {
        let Picked { method, choice, .. } = picked;
        self.between = Between::of(&choice, &*method, self.stepper.system()).ok()?;
        let setup = method.setup();
        let old = self.stepper.change_method(method);
        if let Some(auto) = &mut self.auto {
            auto.put_back(self.choice.method, old);
        }
        self.choice.method = choice.method;
        Some(setup)
    }

    /// Hands over everything that the run has come to; the scene and what
    /// follows from it alone are not among it.
    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        if let Some(auto) = &mut self.auto {
            let mut current = auto.current() as u64;
            state.word(&mut current);
            if current != auto.current() as u64 {
                let picked = auto.switch_to(self.stepper.system(), current as usize);
                if picked.and_then(|picked| self.put_to_use(picked)).is_none() {
                    return state.refuse();
                }
            }
        }
        if let Some(auto) = &mut self.auto {
            auto.visit(self.stepper.system(), state);
        }
        if let Schedule::Adaptive(controller) = &mut self.schedule {
            controller.visit(state);
        }
        self.stepper.visit(state);
        self.between.visit(state);
        self.ledger.visit(state);
        self.ledger_before.visit(state);
        self.last_flows.visit(state);
        state.real(&mut self.most_energy);
        self.work.visit(state);
        state.option(&mut self.last, |interval, state| {
            for real in [&mut interval.start, &mut interval.end, &mut interval.size] {
                state.real(real);
            }
        });
        state.option(&mut self.shown, |shown, state| shown.visit(state));
        self.visit_switches(state);
        self.stepper.scatter(&mut self.nodes);
    }

    fn visit_switches(&mut self, state: &mut HiddenState) {
        let mut n = self.switches.len() as u64;
        state.word(&mut n);
        let mut switches = std::mem::take(&mut self.switches).into_iter();
        for _ in 0..n {
            let mut switch = switches.next().unwrap_or(Switch {
                time: 0.0,
                method: springs_scene::Method::Auto,
                reason: String::new(),
            });
            let methods = springs_scene::Method::ALL;
            let index = methods.iter().position(|&method| method == switch.method);
            let mut index = index.unwrap_or_default() as u64;
            state.real(&mut switch.time);
            state.word(&mut index);
            state.text(&mut switch.reason);
            match methods.get(index as usize) {
                Some(&method) if state.is_sound() => switch.method = method,
                _ => return state.refuse(),
            }
            self.switches.push(switch);
        }
    }

    fn show_frames(
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
            self.stepper.scatter(&mut self.nodes);
            let is_stopped = if fraction >= 1.0 - AT_THE_END {
                frames.show(time, &self.nodes, observer).is_break()
                    || offer(observer, || self.account(time)).is_break()
            } else {
                let mut between = std::mem::take(&mut frames.between);
                self.evaluate(interval, time, &mut between)?;
                let account = || self.account_between(interval, time, &between);
                let is_stopped = frames.show(time, &between, observer).is_break()
                    || offer(observer, account).is_break();
                frames.between = between;
                is_stopped
            };
            if is_stopped {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// Gives an account to an observer who wants one; else it is not made.
pub(crate) fn offer(
    observer: &mut dyn Observer,
    account: impl FnOnce() -> Account,
) -> ControlFlow<()> {
    match observer.wants_account() {
        true => observer.account(account()),
        false => ControlFlow::Continue(()),
    }
}

/// The next step of about `h`: to the end if that is near, and in two equal
/// steps if it is not much further.
fn next_interval(start: f64, duration: f64, h: f64) -> Interval {
    let left = duration - start;
    let size = match left / h {
        steps if steps <= 1.0 + 1e-9 => left,
        steps if steps < 2.0 => 0.5 * left,
        _ => h,
    };
    Interval {
        start,
        end: if size == left { duration } else { start + size },
        size,
    }
}

/// How many frames of how many intervals were shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Shown {
    intervals: u64,
    frames: u64,
}

impl Shown {
    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        state.word(&mut self.intervals);
        state.word(&mut self.frames);
    }
}

/// The frames still to come.
pub(crate) struct Frames {
    duration: f64,
    intervals: usize,
    next: usize,
    between: NodeStates,
}

/// A frame this close to the end of a step, as a fraction of it, is the end.
const AT_THE_END: f64 = 1e-9;

impl Frames {
    pub(crate) fn new(duration: f64, intervals: usize, nodes: &NodeStates) -> Self {
        let intervals = if duration == 0.0 { 0 } else { intervals };
        Self {
            duration,
            intervals,
            next: 0,
            between: nodes.clone(),
        }
    }

    /// Time of the next frame; the last one is exactly the duration.
    pub(crate) fn next_time(&self) -> Option<f64> {
        match self.next.cmp(&self.intervals) {
            std::cmp::Ordering::Less => {
                Some(self.duration * self.next as f64 / self.intervals as f64)
            }
            std::cmp::Ordering::Equal => Some(self.duration),
            std::cmp::Ordering::Greater => None,
        }
    }

    /// Leaves out the frames that were `shown`, or, if those were others, all
    /// up to `time`.
    pub(crate) fn go_on(&mut self, shown: Option<Shown>, time: f64) {
        match shown {
            Some(shown) if shown.intervals == self.intervals as u64 => {
                self.next = shown.frames as usize;
            }
            _ if time > 0.0 => {
                while self.next_time().is_some_and(|next| next <= time) {
                    self.next += 1;
                }
            }
            _ => {}
        }
    }

    pub(crate) fn is_first(&self) -> bool {
        self.next == 0
    }

    pub(crate) fn shown(&self) -> Shown {
        Shown {
            intervals: self.intervals as u64,
            frames: self.next as u64,
        }
    }

    /// Shows the next frame.
    pub(crate) fn show(
        &mut self,
        time: f64,
        nodes: &NodeStates,
        to: &mut dyn Observer,
    ) -> ControlFlow<()> {
        let index = self.next;
        self.next += 1;
        to.frame(Frame { index, time, nodes })
    }
}
