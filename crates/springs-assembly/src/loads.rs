//! Loads as an emitter.

use crate::{Emitter, Evaluation, Linearization, Nature, Numbering, StiffnessKind};
use nalgebra::Vector3;
use springs_scene::{OverTime, Scene};

/// A force over time.
pub trait History: Send + Sync {
    /// In N, at a time in s.
    fn force(&self, time: f64) -> Vector3<f64>;

    /// What it changes by with time, in N/s.
    fn rate(&self, time: f64) -> Vector3<f64>;
}

/// Forces on single nodes that follow histories, wherever the nodes are. Their work is
/// a flow of the energy ledger.
pub struct Loads<H> {
    name: String,
    histories: Vec<H>,
    /// The load that each is a force of.
    loads: Vec<u32>,
    n_loads: usize,
    /// Nodes of the scene until they are numbered; then blocks.
    blocks: Vec<u32>,
    n_free: usize,
    /// Forces on all blocks that were set, in N; empty unless that may happen.
    set: Vec<Vector3<f64>>,
}

/// A force over time, as scenes have it.
#[derive(Clone, Debug)]
pub(crate) struct SceneLoad {
    pub(crate) force: Vector3<f64>,
    pub(crate) over_time: OverTime,
}

impl History for SceneLoad {
    fn force(&self, time: f64) -> Vector3<f64> {
        self.force * self.over_time.factor(time)
    }

    fn rate(&self, time: f64) -> Vector3<f64> {
        self.force * self.over_time.rate(time)
    }
}

impl Loads<SceneLoad> {
    /// Those of a scene.
    pub(crate) fn of_scene(scene: &Scene) -> Self {
        let mut all = Self::new("loads", []);
        for load in &scene.loads {
            all.add_load(load.nodes.iter().map(|&node| {
                let history = SceneLoad {
                    force: load.force,
                    over_time: load.over_time.clone(),
                };
                (node, history)
            }));
        }
        all
    }
}

impl<H: History> Loads<H> {
    /// Loads on nodes of a scene, each of a single force.
    pub fn new(name: &str, loads: impl IntoIterator<Item = (usize, H)>) -> Self {
        let mut all = Self {
            name: name.to_owned(),
            histories: Vec::new(),
            loads: Vec::new(),
            n_loads: 0,
            blocks: Vec::new(),
            n_free: 0,
            set: Vec::new(),
        };
        for load in loads {
            all.add_load([load]);
        }
        all
    }

    /// Adds a load of some forces.
    fn add_load(&mut self, forces: impl IntoIterator<Item = (usize, H)>) {
        for (node, history) in forces {
            self.histories.push(history);
            self.loads.push(self.n_loads as u32);
            self.blocks.push(node as u32);
        }
        self.n_loads += 1;
    }

    /// With forces on all of `n_nodes` nodes that are [set](Emitter::set_forces) between
    /// steps, none so far; they are one more load.
    pub(crate) fn with_set_forces(self, n_nodes: usize) -> Self {
        Self {
            set: vec![Vector3::zeros(); n_nodes],
            ..self
        }
    }

    fn is_empty(&self) -> bool {
        self.histories.is_empty() && self.set.is_empty()
    }

    /// Hands over a vector for each force on a free block.
    fn each(
        &self,
        of: impl Fn(&H) -> Vector3<f64>,
        mut visit: impl FnMut(usize, usize, &Vector3<f64>),
    ) {
        for (index, &block) in self.blocks.iter().enumerate() {
            if (block as usize) < self.n_free {
                let load = self.loads[index] as usize;
                visit(load, block as usize, &of(&self.histories[index]));
            }
        }
    }
}

impl<H: History> Emitter for Loads<H> {
    fn name(&self) -> &str {
        &self.name
    }

    fn nature(&self) -> Nature {
        Nature {
            n_terms: 0,
            n_merged: 0,
            stiffness: StiffnessKind::None,
            is_constant: false,
            is_load: !self.is_empty(),
            is_damped: false,
            // They may push anywhere.
            is_central: self.is_empty(),
            has_symmetric_blocks: true,
        }
    }

    fn number(&mut self, numbering: &Numbering) {
        self.n_free = numbering.n_free();
        for block in &mut self.blocks {
            *block = numbering.block(*block as usize) as u32;
        }
    }

    fn each_stencil(&self, _visit: &mut dyn FnMut(&[u32])) {}

    fn place(&mut self, _pairs: &[u32]) {}

    fn energy(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    fn add_forces(&self, _x: &[Vector3<f64>], _forces: &mut [Vector3<f64>]) {}

    fn add_loads(&self, time: f64, forces: &mut [Vector3<f64>]) {
        let of = |history: &H| history.force(time);
        self.each(of, |_, block, force| forces[block] += force);
        add_each(&self.set, &mut forces[..self.n_free]);
    }

    fn add_loads_on_all(&self, time: f64, forces: &mut [Vector3<f64>]) {
        for (history, &block) in self.histories.iter().zip(&self.blocks) {
            forces[block as usize] += history.force(time);
        }
        add_each(&self.set, forces);
    }

    fn set_forces(&mut self, forces: &[Vector3<f64>]) {
        self.set.copy_from_slice(forces);
    }

    fn n_loads(&self) -> usize {
        self.n_loads + usize::from(!self.set.is_empty())
    }

    fn each_load(&self, time: f64, visit: &mut dyn FnMut(usize, usize, &Vector3<f64>)) {
        self.each(|history| history.force(time), &mut *visit);
        for (block, force) in self.set.iter().take(self.n_free).enumerate() {
            visit(self.n_loads, block, force);
        }
    }

    fn each_load_rate(&self, time: f64, visit: &mut dyn FnMut(usize, usize, &Vector3<f64>)) {
        self.each(|history| history.rate(time), &mut *visit);
    }

    fn linearize(&self, _at: &Evaluation<'_>, _out: &mut Linearization) {}

    fn add_products(&self, _at: &Evaluation<'_>, _y: &[Vector3<f64>], _p: &mut [Vector3<f64>]) {}

    fn add_stiffness_bounds(&self, _bounds: &mut [f64]) {}
}

/// Adds vectors to as many others, or none.
fn add_each(vectors: &[Vector3<f64>], sums: &mut [Vector3<f64>]) {
    for (sum, vector) in sums.iter_mut().zip(vectors) {
        *sum += vector;
    }
}
