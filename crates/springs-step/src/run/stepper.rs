//! Single steps: gather, step, copy back.

use crate::control::choose::start;
use crate::threads::threads;
use crate::vectors::largest;
use crate::{
    Anchors, Archive, Cause, ErrorEstimate, Flows, Interval, Method, NodeStates, SetupError, State,
    StepError, Suspect, Work,
};
use nalgebra::Vector3;
use springs_assembly::{Compilation, MemoryUpdate, System, compile_with};
use springs_scene::{self as scene, RunOptions, Scene, StepControl};
use springs_solver::Interrupt;
use springs_threads::with_threads;

/// A compiled scene with a method that advances it.
pub struct Stepper {
    system: System,
    method: Box<dyn Method>,
    anchors: Anchors,
    state: State,
    /// The state before the last step.
    before: State,
    /// Steps of one size are counted, so that time is not summed up.
    clock: Clock,
    steps: u64,
    /// After the last attempt, in J.
    kinetic_energy: f64,
    keeps_tensions: bool,
    /// That steps are made on.
    threads: usize,
}

/// Steps of systems with fewer terms are made by the calling thread, since to hand them over
/// would take longer: where forces are all that is made, and where there is a matrix.
const FEW_TERMS: usize = 30_000;
const FEW_TERMS_OF_MATRIX: usize = 4_000;

/// Where a stepper was.
pub(crate) struct Bookmark {
    state: State,
    steps: u64,
}

/// Time as `since + steps·size`.
#[derive(Clone, Copy, Debug)]
struct Clock {
    since: f64,
    steps: u64,
    size: f64,
}

impl Clock {
    fn time(&self) -> f64 {
        self.since + self.steps as f64 * self.size
    }

    /// The next step of size `h`.
    fn next(&self, h: f64) -> Self {
        let (since, steps) = if self.size == h {
            (self.since, self.steps)
        } else {
            (self.time(), 0)
        };
        Self {
            since,
            steps: steps + 1,
            size: h,
        }
    }
}

impl Stepper {
    /// Compiles the scene with the method of its settings; `Auto` without a step
    /// is TR-BDF2, which can move any scene in steps of any size. Since nodes may
    /// be moved between steps, nothing is left out because of where they are.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        Self::with_options(scene, &RunOptions::default())
    }

    /// The same, with threads and linear systems as the options say.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn with_options(scene: &Scene, options: &RunOptions) -> Result<Self, SetupError> {
        let mut settings = scene.settings;
        let is_open = !matches!(settings.step, StepControl::Fixed(_));
        if settings.method == scene::Method::Auto && is_open {
            settings.method = scene::Method::TrBdf2;
        }
        let system = compile_with(scene, Compilation::complete())?;
        let method = start(scene, (&settings, options), &system)?.method;
        Ok(Self::with_method(system, method).on_threads_of(options))
    }

    /// A compiled scene with any method, for example one's own. Where
    /// [`System::motion`] is in a plane or on a line, nodes must not be moved out
    /// of it between steps.
    pub fn with_method(system: System, method: Box<dyn Method>) -> Self {
        let state = State::initial(&system);
        let mut stepper = Self {
            anchors: Anchors::new(&system, &state),
            clock: Clock {
                since: 0.0,
                steps: 0,
                size: 0.0,
            },
            steps: 0,
            kinetic_energy: 0.0,
            keeps_tensions: false,
            threads: 1,
            system,
            method,
            before: state.clone(),
            state,
        };
        // What breaks is judged by the tensions of the method.
        if stepper.system.has_memory() {
            stepper.keep_tensions();
        }
        stepper
    }

    /// The same with steps on so many threads as the options say.
    pub(crate) fn on_threads_of(self, options: &RunOptions) -> Self {
        let has_matrix = self.method.setup().counts.symbolic_factorizations > 0;
        let few = if has_matrix {
            FEW_TERMS_OF_MATRIX
        } else {
            FEW_TERMS
        };
        let is_small = self.system.n_terms() < few;
        Self {
            threads: if is_small { 1 } else { threads(options) },
            ..self
        }
    }

    /// Time since the start, in s.
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// Steps made so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The compiled scene.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Where fixed nodes are at any time.
    pub fn anchors(&self) -> &Anchors {
        &self.anchors
    }

    /// Scene, anchors and method apart.
    pub(crate) fn apart(&mut self) -> ((&System, &Anchors), &mut dyn Method) {
        ((&self.system, &self.anchors), &mut *self.method)
    }

    /// Changes the system between steps.
    pub(crate) fn change(&mut self, change: impl FnOnce(&mut System)) {
        change(&mut self.system);
        self.method.forces_jumped(&self.system);
    }

    /// From now on fixed nodes move at these velocities, in m/s, by node, beside their
    /// motions.
    pub(crate) fn set_anchor_velocities(&mut self, velocities: &[Vector3<f64>]) {
        let numbering = self.system.numbering();
        for block in self.system.n_free()..numbering.n_nodes() {
            self.state.v[block] = velocities[numbering.node(block)];
        }
        for prescribed in &**self.system.prescribed() {
            let moved = prescribed.at(self.state.time);
            prescribed
                .blocks()
                .for_each(|block| self.state.v[block] += moved.velocity);
        }
        self.anchors = Anchors::new(&self.system, &self.state);
        self.method.forces_jumped(&self.system);
    }

    pub(crate) fn archive_anchors(&mut self, archive: &mut Archive) {
        self.anchors.archive(archive);
    }

    /// The method.
    pub fn method(&self) -> &dyn Method {
        &*self.method
    }

    /// As [`Method::longest_step`].
    pub(crate) fn longest_step(&self) -> f64 {
        self.method.longest_step(&self.system)
    }

    /// From now on methods keep tensions.
    pub(crate) fn keep_tensions(&mut self) {
        self.keeps_tensions = true;
        self.method.keep_tensions(&self.system);
    }

    /// Goes on with another method, and gives back the one before.
    pub(crate) fn change_method(&mut self, mut method: Box<dyn Method>) -> Box<dyn Method> {
        if self.keeps_tensions {
            method.keep_tensions(&self.system);
        }
        std::mem::replace(&mut self.method, method)
    }

    /// The global vectors after the last step.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Whom to hear during steps that may take long: asked to stop, they fail with
    /// [`Cause::Interrupted`].
    pub fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.method.set_interrupt(interrupt);
    }

    /// Makes one step of size `h` in s: section 2.1 of the note.
    ///
    /// The nodes may have been changed since the last step; the method then
    /// starts afresh from their positions and velocities.
    ///
    /// # Errors
    ///
    /// If the step cannot be made; `nodes` then is as it was before.
    ///
    /// # Panics
    ///
    /// If `nodes` does not have the nodes of the scene, or `h` is not positive
    /// and finite.
    pub fn step(&mut self, nodes: &mut NodeStates, h: f64) -> Result<Work, StepError> {
        assert!(
            h > 0.0 && h.is_finite(),
            "a step size is positive and finite"
        );
        let clock = self.clock.next(h);
        let mut work = Work::default();
        self.gather(nodes);
        self.step_until(clock.time(), h, &mut work)?;
        self.update_memory();
        self.clock = clock;
        self.scatter(nodes);
        Ok(work)
    }

    /// [`Self::step`] from the global vectors to a time `end` that is one step away up to rounding.
    pub(crate) fn step_until(
        &mut self,
        end: f64,
        h: f64,
        work: &mut Work,
    ) -> Result<(), StepError> {
        let interval = Interval {
            start: self.state.time,
            end,
            size: h,
        };
        self.attempt(interval, work)?;
        self.accept(interval, work);
        Ok(())
    }

    /// What is beyond its limit at the end of a step breaks; `None` where nothing can.
    pub(crate) fn update_memory(&mut self) -> Option<MemoryUpdate> {
        if !self.system.has_memory() {
            return None;
        }
        let carried = self.method.tensions();
        let update = self.system.update_memory(&self.state.x, carried);
        if update.is_abrupt {
            self.method.springs_broke(&self.system);
        }
        Some(update)
    }

    /// What lasts of where the system has been.
    pub(crate) fn each_memory(&mut self, archive: &mut Archive) {
        if self.system.has_memory() {
            self.system.each_memory(&mut |real| archive.real(real));
        }
    }

    /// Makes a step that is not yet accepted. If it fails, everything is as it
    /// was before.
    pub(crate) fn attempt(
        &mut self,
        interval: Interval,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, StepError> {
        let made = with_threads(self.threads, || {
            self.before.copy_from(&self.state);
            let (system, anchors) = (&self.system, &self.anchors);
            self.method
                .step(system, anchors, interval, &mut self.state, work)
        });
        let failure = match made {
            Err(error) => Some((Cause::from(error), error.block())),
            Ok(_) => self.find_overflow(),
        };
        match failure {
            None => Ok(made.unwrap_or_default()),
            Some((cause, block)) => {
                self.reject();
                Err(self.error(cause, block, interval))
            }
        }
    }

    /// What is not a finite number after an attempt, and where; and keeps the
    /// kinetic energy.
    fn find_overflow(&mut self) -> Option<(Cause, usize)> {
        let masses = self.system.masses();
        let of_method = self.method.kinetic_energy();
        let kinetic = of_method.or_else(|| self.state.finite_kinetic_energy(masses));
        if let Some(kinetic) = kinetic {
            self.kinetic_energy = kinetic;
            return None;
        }
        let not_finite = self.state.first_not_finite(masses.len());
        Some(match not_finite {
            Some(block) => (Cause::NotFinite, block),
            None => (Cause::EnergyOverflow, self.fastest_block()),
        })
    }

    /// Kinetic energy after the attempted step, in J.
    pub(crate) fn kinetic_energy(&self) -> f64 {
        self.kinetic_energy
    }

    /// What dashpots, moving anchors and loads took and gave in the attempted step, as
    /// far as free nodes took part, into `flows`.
    pub(crate) fn copy_flows(&self, interval: Interval, flows: &mut Flows) {
        match self.method.flows() {
            Some(of_method) => flows.copy_from(of_method),
            None => {
                let ends = [&self.before, &self.state];
                *flows = Flows::trapezoidal(&self.system, ends, interval.size);
            }
        }
    }

    /// The state before the last step.
    pub(crate) fn before(&self) -> &State {
        &self.before
    }

    /// A sharper estimate of the error of the attempted step, if there is one.
    pub(crate) fn second_estimate(&mut self, work: &mut Work) -> Option<ErrorEstimate> {
        self.method.second_estimate(&self.system, &self.state, work)
    }

    /// The error of a step that did not work out, or of a state within the last
    /// one.
    pub(crate) fn error(&self, cause: Cause, block: usize, interval: Interval) -> StepError {
        // A step that stands is counted already.
        let stands = self.state.time > interval.start;
        StepError {
            cause,
            node: self.system.numbering().node(block),
            step: self.steps + u64::from(!stands),
            time: interval.start,
            step_size: interval.size,
            suspect: self.suspect(block),
        }
    }

    /// The spring that pulls or pushes most at a block in the present state.
    fn suspect(&self, block: usize) -> Option<Suspect> {
        let strained = self.system.most_strained_at(block, &self.state.x)?;
        Some(Suspect {
            spring: strained.spring,
            length: strained.length,
            stiffness: strained.stiffness,
            stable_step: self.system.stable_step_at(block),
        })
    }

    /// Where it is, to return to or to count from.
    pub(crate) fn bookmark(&self) -> Bookmark {
        Bookmark {
            state: self.state.clone(),
            steps: self.steps,
        }
    }

    /// Is again where it was; the method starts from positions and velocities
    /// alone.
    pub(crate) fn return_to(&mut self, bookmark: Bookmark) {
        self.state = bookmark.state;
        self.steps = bookmark.steps;
        self.method.restart();
    }

    /// All steps since then are one.
    pub(crate) fn count_as_one(&mut self, since: Bookmark) {
        self.before = since.state;
        self.steps = since.steps + 1;
    }

    /// The free block that moves fastest.
    pub(crate) fn fastest_block(&self) -> usize {
        largest(&self.state.v[..self.system.n_free()]).0
    }

    /// The attempted step stands.
    pub(crate) fn accept(&mut self, interval: Interval, work: &mut Work) {
        self.method.accept();
        self.state.time = interval.end;
        self.steps += 1;
        work.counts.steps += 1;
    }

    /// The attempted step is taken back; what is carried was not touched.
    pub(crate) fn reject(&mut self) {
        self.state.copy_from(&self.before);
    }

    /// What the method carries along.
    pub(crate) fn archive_method(&mut self, archive: &mut Archive) {
        self.method.archive(archive);
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        self.state.archive(archive);
        self.before.archive(archive);
        archive.word(&mut self.steps);
        self.method.archive(archive);
    }

    /// Copies the global vectors back to the nodes.
    pub(crate) fn scatter(&self, nodes: &mut NodeStates) {
        self.state.scatter(&self.system, nodes);
    }

    /// The same with those before the last step.
    pub(crate) fn scatter_before(&self, nodes: &mut NodeStates) {
        self.before.scatter(&self.system, nodes);
    }

    /// Collects positions and velocities of the nodes into the global vectors.
    fn gather(&mut self, nodes: &NodeStates) {
        if self.state.gather(&self.system, nodes) {
            self.anchors = Anchors::new(&self.system, &self.state);
            self.method.restart();
        }
    }
}
