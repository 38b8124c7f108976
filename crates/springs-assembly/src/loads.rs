//! Loads as an emitter.

use crate::{Emitter, Evaluation, Linearization, Nature, Numbering, StiffnessKind};
use nalgebra::Vector3;
use springs_scene::OverTime;

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

impl<H: History> Loads<H> {
    /// Loads on nodes of a scene.
    pub fn new(name: &str, loads: impl IntoIterator<Item = (usize, H)>) -> Self {
        let loads = loads.into_iter();
        let (blocks, histories) = loads.map(|(node, history)| (node as u32, history)).unzip();
        Self {
            name: name.to_owned(),
            histories,
            blocks,
            n_free: 0,
            set: Vec::new(),
        }
    }

    /// With forces on all of `n_nodes` nodes that are [set](Emitter::set_forces) between
    /// steps, none so far.
    pub(crate) fn with_set_forces(self, n_nodes: usize) -> Self {
        Self {
            set: vec![Vector3::zeros(); n_nodes],
            ..self
        }
    }

    fn is_empty(&self) -> bool {
        self.histories.is_empty() && self.set.is_empty()
    }

    /// Adds a vector for each load on a free block.
    fn add(&self, of: impl Fn(&H) -> Vector3<f64>, sums: &mut [Vector3<f64>]) {
        for (history, &block) in self.histories.iter().zip(&self.blocks) {
            if (block as usize) < self.n_free {
                sums[block as usize] += of(history);
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
        self.add(|history| history.force(time), forces);
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

    fn add_load_rates(&self, time: f64, rates: &mut [Vector3<f64>]) {
        self.add(|history| history.rate(time), rates);
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
