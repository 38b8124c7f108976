//! Parts of a scene that do not feel each other, each on its own way.

use crate::rest::Rest;
use crate::simulation::{Frames, Shown, offer};
use crate::{
    Account, ForeignState, HiddenState, Ledger, NodeStates, Observer, Outcome, SetupError,
    Simulation, StepError, Suspect, Work,
};
use nalgebra::Vector3;
use springs_assembly::{CompileError, Energy, machine_threads};
use springs_scene::{Island, Scene};
use std::sync::Mutex;

/// A scene on its way through its duration, cut into parts that do not feel each
/// other. Each has a method, steps and a solver of its own, and several run at
/// once; the result is the same to the last bit for any number of threads.
///
/// A scene in one part runs exactly like a [`Simulation`].
pub struct Islands {
    scene: Scene,
    parts: Vec<Part>,
    /// Parts that run at once.
    threads: usize,
    time: f64,
    /// Parts are somewhere within a round.
    is_under_way: bool,
    /// At that time.
    nodes: NodeStates,
    ledger: Ledger,
    /// Frames that were shown, if it was stopped on the way.
    shown: Option<Shown>,
}

/// A part of the scene.
pub struct Part {
    /// Where its nodes and springs are in the scene.
    island: Island,
    simulation: Simulation,
    state: NodeStates,
    /// When it was in that state.
    ledger: Ledger,
    asleep_since: Option<f64>,
    /// Made when it is first needed.
    rest: Option<Rest>,
    /// Rounds until it is asked again whether it is at rest.
    countdown: u32,
}

/// Scenes with more islands have several of them in one part.
const MOST_PARTS: usize = 2048;

/// The observer is asked about so often whether to go on; more often where parts
/// may fall asleep, which is looked for in every few rounds.
const ROUNDS: u64 = 16;
const ROUNDS_WITH_SLEEP: u64 = 256;

/// Scenes with fewer springs are done before a second thread is awake.
const WORTH_A_THREAD: usize = 1000;

/// Within a round, too, after so many steps of a part.
const MOST_STEPS: u64 = 1000;

/// Rounds between two looks at whether a part is at rest.
const LOOKS: u32 = 8;

/// A part with more than this share of all springs gets all threads.
const DOMINANT: f64 = 0.6;

impl Islands {
    /// Cuts the scene apart, compiles its parts, and settles their methods and
    /// steps.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or a method cannot move its part.
    pub fn new(scene: &Scene) -> Result<Self, SetupError> {
        let problems = scene.problems();
        if !problems.is_empty() {
            return Err(CompileError::Problems(problems).into());
        }
        let islands = cut(scene);
        let largest = islands.iter().map(|island| island.springs.len()).max();
        let dominant = DOMINANT * scene.springs.len() as f64;
        let is_dominated = largest.unwrap_or(0) as f64 > dominant || islands.len() == 1;
        let mut scene = scene.clone();
        let settings = &mut scene.settings;
        let all_threads = machine_threads(settings.threads);
        let is_small = scene.springs.len() < WORTH_A_THREAD;
        let threads = if is_dominated || is_small {
            1
        } else {
            all_threads
        };
        settings.threads = all_threads / threads;
        let parts = in_parallel(islands, threads, |island| Part::new(&scene, island));
        let mut parts: Vec<Part> = parts.into_iter().collect::<Result<_, _>>()?;
        // Somebody who runs what does not move at all wants to see its steps.
        if parts.iter().all(|part| part.asleep_since.is_some()) {
            parts.iter_mut().for_each(|part| part.asleep_since = None);
        }
        let mut islands = Self {
            ledger: parts[0].ledger,
            parts,
            threads,
            time: 0.0,
            is_under_way: false,
            nodes: NodeStates::of(&scene),
            shown: None,
            scene,
        };
        islands.sum_ledgers();
        Ok(islands)
    }

    fn sum_ledgers(&mut self) {
        let ledgers = self.parts.iter().map(|part| part.ledger);
        if let Some(sum) = Ledger::sum(ledgers) {
            self.ledger = sum;
        }
    }

    /// Everything that the run has come to, as words that mean something to
    /// [`Self::restore`] only.
    pub fn save(&mut self) -> Vec<u64> {
        let mut state = HiddenState::saving();
        self.visit(&mut state);
        state.into_words()
    }

    /// Goes on where another run of the same scene was when it was saved; from
    /// there on it gives the same bits.
    ///
    /// # Errors
    ///
    /// If the words do not come from a run of this scene; this one is of no use
    /// any more then.
    pub fn restore(&mut self, words: Vec<u64>) -> Result<(), ForeignState> {
        let mut state = HiddenState::loading(words);
        self.visit(&mut state);
        state.finish()
    }

    fn visit(&mut self, state: &mut HiddenState) {
        let mut n_parts = self.parts.len() as u64;
        state.word(&mut n_parts);
        if n_parts != self.parts.len() as u64 {
            return state.refuse();
        }
        state.real(&mut self.time);
        state.flag(&mut self.is_under_way);
        self.nodes.visit(state);
        self.ledger.visit(state);
        state.option(&mut self.shown, |shown, state| shown.visit(state));
        for part in &mut self.parts {
            part.simulation.visit(state);
            part.state.visit(state);
            part.ledger.visit(state);
            state.option(&mut part.asleep_since, |since, state| state.real(since));
            state.count(&mut part.countdown);
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
        self.threads * self.largest().simulation.stepper().system().threads()
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
        self.scene.settings.duration
    }

    /// Positions and velocities, in the order of the scene.
    pub fn nodes(&self) -> &NodeStates {
        &self.nodes
    }

    /// What was done so far by all parts; steps are those of the part that made
    /// the most.
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

    /// Energy now.
    pub fn energy(&self) -> Energy {
        let energies = self.parts.iter().map(|part| part.energy(&self.nodes));
        energies.fold(Energy::default(), |a, b| a + b)
    }

    /// Runs to the end, or until the observer or an error stops it, and shows
    /// the observer `intervals` + 1 frames, as [`Simulation::run`] does. After a
    /// stop it goes on, with the frames that are still to come.
    ///
    /// # Errors
    ///
    /// If a step cannot be made. All parts are then where the one that failed
    /// is.
    pub fn run(
        &mut self,
        intervals: usize,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        if let [part] = &mut self.parts[..]
            && part.asleep_since.is_none()
            && self.scene.settings.sleep.is_none()
        {
            let outcome = part.simulation.run(intervals, observer);
            self.time = part.simulation.stepper().time();
            self.nodes.clone_from(part.simulation.nodes());
            self.ledger = part.simulation.ledger();
            return outcome;
        }
        let mut frames = Frames::new(self.duration(), intervals, &self.nodes);
        frames.go_on(self.shown, self.time);
        let outcome = self.run_on(&mut frames, observer);
        self.shown = Some(frames.shown());
        outcome
    }

    fn run_on(
        &mut self,
        frames: &mut Frames,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, StepError> {
        let duration = self.duration();
        if frames.is_first()
            && (frames.show(0.0, &self.nodes, observer).is_break()
                || offer(observer, || self.account()).is_break())
        {
            return Ok(Outcome::Stopped);
        }
        while self.time < duration {
            let frame = frames.next_time().unwrap_or(duration);
            let time = frame.min(self.end_of_round());
            if !self.advance_to(time)? {
                // On its way there; somebody may not want to wait.
                if observer.step(self.time).is_break() {
                    return Ok(Outcome::Stopped);
                }
                continue;
            }
            let stops_at_frame = time == frame && {
                let shown = frames.show(time, &self.nodes, observer);
                shown.is_break()
            };
            if stops_at_frame
                || offer(observer, || self.account()).is_break()
                || observer.step(time).is_break()
            {
                return Ok(match self.time < duration {
                    true => Outcome::Stopped,
                    false => Outcome::Finished,
                });
            }
        }
        Ok(Outcome::Finished)
    }

    fn account(&self) -> Account {
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
        let rounds = match self.scene.settings.sleep {
            None => ROUNDS,
            Some(_) => ROUNDS_WITH_SLEEP,
        };
        let plan = self.parts[0].simulation.plan();
        let is_common = |part: &Part| part.simulation.plan() == plan;
        let Some(plan) = plan.filter(|_| self.parts.iter().all(is_common)) else {
            let round = (self.time / self.duration() * rounds as f64 + 1e-6).floor() + 1.0;
            return (self.duration() * round / rounds as f64).min(self.duration());
        };
        let stride = plan.n_steps().div_ceil(rounds).max(1);
        let done = (self.time / plan.step_size + 1e-6) as u64;
        plan.end_of((done / stride + 1) * stride)
    }

    /// Brings all parts nearer to a time; says whether they got there.
    fn advance_to(&mut self, time: f64) -> Result<bool, StepError> {
        let parts: Vec<&mut Part> = self.parts.iter_mut().collect();
        let sleep = self.scene.settings.sleep.filter(|_| !self.is_under_way);
        let done = in_parallel(parts, self.threads, |part| {
            part.fall_asleep(sleep);
            part.advance_to(time, MOST_STEPS)
        });
        let failures = done.iter().filter_map(|done| done.as_ref().err());
        let first = failures.min_by(|a, b| a.time.total_cmp(&b.time));
        let result = match first {
            None => Ok(done.iter().all(|done| *done == Ok(true))),
            Some(error) => {
                self.time = error.time;
                self.go_back(error.time);
                Err(*error)
            }
        };
        self.is_under_way = result == Ok(false);
        if self.is_under_way {
            return result;
        }
        if result.is_ok() {
            self.time = time;
        }
        self.sum_ledgers();
        for part in &self.parts {
            for (k, &node) in part.island.nodes.iter().enumerate() {
                self.nodes.positions[node] = part.state.positions[k];
                self.nodes.velocities[node] = part.state.velocities[k];
            }
        }
        result
    }

    /// After a failure: brings the parts that are further to an earlier time, by
    /// running them anew.
    fn go_back(&mut self, time: f64) {
        let scene = &self.scene;
        let parts: Vec<&mut Part> = self.parts.iter_mut().collect();
        in_parallel(parts, self.threads, |part| {
            if part.simulation.stepper().time() > time
                && let Ok(anew) = Part::new(scene, part.island.clone())
            {
                *part = anew;
            }
            // It was there before, so it gets there again.
            let _ = part.advance_to(time, u64::MAX);
        });
    }
}

impl Part {
    fn new(scene: &Scene, island: Island) -> Result<Self, SetupError> {
        let is_whole = island.nodes.len() == scene.nodes.len();
        let simulation = match is_whole {
            true => Simulation::new(scene),
            false => Simulation::new(&scene.part(&island)),
        };
        let simulation =
            simulation.map_err(|error| error.of_part(&island.nodes, &island.springs))?;
        let (system, state) = (simulation.stepper().system(), simulation.stepper().state());
        let is_at_rest = scene.settings.skip && Rest::is_exact(system, state);
        Ok(Self {
            state: simulation.nodes().clone(),
            ledger: simulation.ledger(),
            island,
            asleep_since: is_at_rest.then_some(0.0),
            rest: None,
            countdown: 0,
            simulation,
        })
    }

    /// Since when it has been at rest, in s, if it is. It stays so: what could
    /// wake it does not change during a run.
    pub fn asleep_since(&self) -> Option<f64> {
        self.asleep_since
    }

    /// Puts it to sleep if it can move no further than `reach`, in m.
    fn fall_asleep(&mut self, reach: Option<f64>) {
        let (None, Some(reach)) = (self.asleep_since, reach) else {
            return;
        };
        if self.countdown > 0 {
            self.countdown -= 1;
            return;
        }
        self.countdown = LOOKS;
        let stepper = self.simulation.stepper();
        let (system, state) = (stepper.system(), stepper.state());
        let rest = self.rest.get_or_insert_with(|| Rest::new(system));
        if rest.reach(system, state).is_some_and(|r| r <= reach) {
            self.asleep_since = Some(state.time);
            self.rest = None;
            self.state.clone_from(self.simulation.nodes());
            self.state.velocities.fill(Vector3::zeros());
        }
    }

    /// Where its nodes and springs are in the scene.
    pub fn island(&self) -> &Island {
        &self.island
    }

    /// How it is simulated. Nodes and springs are counted within the part.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Energy where the nodes of the scene are, those of others left out.
    fn energy(&self, nodes: &NodeStates) -> Energy {
        let of_part = |vectors: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
            let nodes = self.island.nodes.iter();
            nodes.map(|&node| vectors[node]).collect()
        };
        let system = self.simulation.stepper().system();
        let blocks = |vectors: &[Vector3<f64>]| {
            let mut blocks = vec![Vector3::zeros(); self.island.nodes.len()];
            system.numbering().gather(&of_part(vectors), &mut blocks);
            blocks
        };
        system.energy(&blocks(&nodes.positions), &blocks(&nodes.velocities))
    }

    /// Says whether it got there with so many steps.
    fn advance_to(&mut self, time: f64, most_steps: u64) -> Result<bool, StepError> {
        if self.asleep_since.is_some_and(|since| since <= time) {
            return Ok(true);
        }
        let done = self
            .simulation
            .advance_to(time, most_steps, &mut self.state);
        if done == Ok(true) {
            self.ledger = self.simulation.ledger_at(time, &self.state);
        }
        done.map_err(|error| StepError {
            node: self.island.nodes[error.node],
            suspect: error.suspect.map(|suspect| Suspect {
                spring: self.island.springs[suspect.spring],
                ..suspect
            }),
            ..error
        })
    }
}

/// The nodes and springs of each part.
fn cut(scene: &Scene) -> Vec<Island> {
    let whole = || Island {
        nodes: (0..scene.nodes.len()).collect(),
        springs: (0..scene.springs.len()).collect(),
    };
    if !scene.settings.skip {
        return vec![whole()];
    }
    let islands = scene.islands();
    if islands.connected.len() + usize::from(!islands.loose.is_empty()) <= 1 {
        return vec![whole()];
    }
    let n_together = islands.connected.len().div_ceil(MOST_PARTS).max(1);
    let together = islands.connected.chunks(n_together);
    let mut parts: Vec<Island> = together.map(unite).collect();
    let loose = Island {
        nodes: islands.loose,
        springs: Vec::new(),
    };
    let rest = [loose, islands.fixed].into_iter();
    parts.extend(rest.filter(|island| !island.nodes.is_empty()));
    parts
}

fn unite(islands: &[Island]) -> Island {
    let nodes = islands.iter().flat_map(|island| &island.nodes);
    let springs = islands.iter().flat_map(|island| &island.springs);
    let mut united = Island {
        nodes: nodes.copied().collect(),
        springs: springs.copied().collect(),
    };
    united.nodes.sort_unstable();
    united.nodes.dedup();
    united.springs.sort_unstable();
    united
}

/// Does `work` on every item, on several threads; results are in the order of
/// the items.
fn in_parallel<T: Send, R: Send>(
    items: Vec<T>,
    threads: usize,
    work: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    if threads <= 1 {
        return items.into_iter().map(work).collect();
    }
    let results: Vec<Mutex<Option<R>>> = items.iter().map(|_| Mutex::new(None)).collect();
    let queue = Mutex::new(items.into_iter().zip(&results));
    let take = || queue.lock().ok()?.next();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((item, result)) = take() {
                    let done = work(item);
                    *result.lock().expect("nobody else has it") = Some(done);
                }
            });
        }
    });
    let results = results.into_iter();
    let done = results.map(|result| result.into_inner().ok().flatten());
    done.map(|result| result.expect("every item was done"))
        .collect()
}
