//! A part of a scene that is not coupled with the others.

use crate::ledger::Books;
use crate::run::simulation::Pause;
use crate::run::sleep::Sleep;
use crate::threads::threads;
use crate::{Archive, NodeStates, SetupError, Simulation, StepError, Suspect, Works};
use nalgebra::Vector3;
use springs_assembly::Energy;
use springs_scene::{Island, RunOptions, Scene};
use std::ops::ControlFlow;

/// A part of the scene.
pub struct Part {
    /// Where its nodes and springs are in the scene.
    pub(super) island: Island,
    /// The loads of the scene that act on it.
    pub(super) loads: Vec<usize>,
    pub(super) simulation: Simulation,
    pub(super) state: NodeStates,
    /// When it was in that state.
    pub(super) books: Books,
    pub(super) asleep_since: Option<f64>,
    /// Made when it is first needed.
    pub(super) sleep: Option<Sleep>,
    /// Rounds until it is asked again whether it is at rest.
    pub(super) countdown: u32,
    /// Where it was some steps ago, at the beginning of a round, to go back to if
    /// another part fails; and its steps then.
    pub(super) saved: Option<(Vec<u64>, u64)>,
}

/// Scenes with more islands have several of them in one part.
const MOST_PARTS: usize = 2048;

/// Steps of a part between two times that are kept to go back to.
const STEPS_BACK: u64 = 1000;

/// Rounds between two looks at whether a part is at rest.
const LOOKS: u32 = 8;

impl Part {
    pub(super) fn new(
        scene: &Scene,
        options: &RunOptions,
        island: Island,
    ) -> Result<Self, SetupError> {
        let is_whole = island.nodes.len() == scene.nodes.len();
        let simulation = if is_whole {
            Simulation::with_options(scene, options)
        } else {
            Simulation::with_options(&scene.part(&island), options)
        };
        let simulation =
            simulation.map_err(|error| error.of_part(&island.nodes, &island.springs))?;
        let (system, state) = (simulation.stepper().system(), simulation.stepper().state());
        let is_at_rest = options.skip && Sleep::is_exact(system, state);
        Ok(Self {
            state: simulation.nodes().clone(),
            books: simulation.books().clone(),
            loads: scene.loads_on(&island),
            island,
            asleep_since: is_at_rest.then_some(0.0),
            sleep: None,
            countdown: 0,
            saved: None,
            simulation,
        })
    }

    /// Since when it has been at rest, in s, if it is. It stays so: what could
    /// wake it does not change during a run.
    pub fn asleep_since(&self) -> Option<f64> {
        self.asleep_since
    }

    /// Makes its trial runs.
    pub(super) fn settle(
        &mut self,
        watch: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, StepError> {
        let settled = self.simulation.settle(watch);
        settled.map_err(|error| self.in_scene(error))
    }

    /// Keeps where it is, if it made many steps since that was done.
    pub(super) fn save(&mut self) {
        let steps = self.simulation.stepper().steps();
        let is_recent = |(_, at): &(Vec<u64>, u64)| steps < at + STEPS_BACK;
        if self.asleep_since.is_some() || self.saved.as_ref().is_some_and(is_recent) {
            return;
        }
        let words = self.saved.take().map_or(Vec::new(), |(words, _)| words);
        let mut archive = Archive::saving_into(words);
        self.simulation.archive(&mut archive);
        self.saved = Some((archive.into_words(), steps));
    }

    /// Goes back to where it was some steps ago, if its last step began after a
    /// time; says whether it can.
    pub(super) fn go_back(&mut self, time: f64) -> bool {
        if self.simulation.last_start() <= time {
            return true;
        }
        let Some((words, _)) = self.saved.take() else {
            return false;
        };
        let mut archive = Archive::loading(words);
        self.simulation.archive(&mut archive);
        archive.finish().is_ok()
    }

    /// Puts it to sleep if from where it is now, at a time that all parts have come
    /// to, it can move no further than `reach`, in m.
    pub(super) fn fall_asleep(&mut self, reach: Option<f64>, now: f64) {
        let (None, Some(reach)) = (self.asleep_since, reach) else {
            return;
        };
        if self.countdown > 0 {
            self.countdown -= 1;
            return;
        }
        self.countdown = LOOKS;
        let stepper = self.simulation.stepper();
        let system = stepper.system();
        // The last step may have gone beyond.
        let mut state = stepper.state().clone();
        state.gather(system, &self.state);
        state.time = now;
        let sleep = self
            .sleep
            .get_or_insert_with(|| Sleep::new(system, threads(&self.simulation.choice().options)));
        if sleep.reach(system, &state).is_some_and(|r| r <= reach) {
            self.asleep_since = Some(now);
            self.sleep = None;
            self.saved = None;
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

    /// Adds what its loads and supports did to those of the scene.
    pub(super) fn add_works(&self, works: &mut Works) {
        let own = self.simulation.works_of(&self.books);
        works.add_part(own, &self.island.nodes, &self.loads);
    }

    /// Energy where the nodes of the scene are, those of others left out.
    pub(super) fn energy(&self, nodes: &NodeStates) -> Energy {
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

    /// Says whether it got there, or pauses on the way.
    pub(super) fn advance_to(&mut self, time: f64, pause: Pause) -> Result<bool, StepError> {
        if self.asleep_since.is_some_and(|since| since <= time) {
            return Ok(true);
        }
        let done = self.simulation.advance_to(time, pause, &mut self.state);
        if done == Ok(true) {
            self.books = self.simulation.books_at(time, &self.state);
        }
        done.map_err(|error| self.in_scene(error))
    }

    /// An error with the indices of the scene.
    fn in_scene(&self, error: StepError) -> StepError {
        StepError {
            node: self.island.nodes[error.node],
            suspect: error.suspect.map(|suspect| Suspect {
                spring: self.island.springs[suspect.spring],
                ..suspect
            }),
            ..error
        }
    }
}

/// The nodes and springs of each part.
pub(super) fn cut(scene: &Scene, options: &RunOptions) -> Vec<Island> {
    let whole = || Island {
        nodes: (0..scene.nodes.len()).collect(),
        springs: (0..scene.springs.len()).collect(),
    };
    if !options.skip {
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
