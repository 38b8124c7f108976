//! Dashpots along springs as force emitters.

use crate::batch::Connections;
use crate::{BlockMatrix, ForceEmitter, Linearization, Numbering, PACKED, Weights};
use nalgebra::Vector3;
use springs_math::dashpot::{self, Dashpot};
use springs_scene::Scene;

/// All springs that have a damping. Scenes without any pay nothing for them.
#[derive(Clone, Debug)]
pub struct Dashpots {
    pub(crate) connections: Connections,
    damping: Vec<f64>,
}

impl Dashpots {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let (connections, order) =
            Connections::new(scene, numbering, |spring| spring.damping > 0.0);
        let damping = |&index: &usize| scene.springs[index].damping;
        Self {
            connections,
            damping: order.iter().map(damping).collect(),
        }
    }

    /// Number of dashpots.
    pub fn len(&self) -> usize {
        self.damping.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.damping.is_empty()
    }

    /// Heat that all of them produce, in W.
    pub fn dissipation(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let heat = |index| {
            let [a, b] = self.ends(index);
            dashpot::dissipation(self.dashpot(index), [&x[a], &x[b]], [&v[a], &v[b]])
        };
        (0..self.len()).map(heat).sum()
    }

    fn dashpot(&self, index: usize) -> Dashpot {
        Dashpot {
            damping: self.damping[index],
        }
    }

    fn ends(&self, index: usize) -> [usize; 2] {
        self.connections.ends()[index].map(|block| block as usize)
    }

    fn force(&self, index: usize, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Vector3<f64> {
        let [a, b] = self.ends(index);
        dashpot::force(self.dashpot(index), [&x[a], &x[b]], [&v[a], &v[b]])
    }

    fn block(&self, index: usize, x: &[Vector3<f64>], weight: f64) -> [f64; 6] {
        let [a, b] = self.ends(index);
        let block = dashpot::damping_block(self.dashpot(index), &x[a], &x[b]) * weight;
        PACKED.map(|entry| block[entry])
    }

    /// Adds `weight`·D, and what moving anchors bring to the right-hand side.
    pub(crate) fn linearize(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        weight: f64,
        out: &mut Linearization,
    ) {
        for index in self.connections.live() {
            let block = self.block(index, x, weight);
            self.connections.add_block_and_load(index, &block, v, out);
        }
    }

    /// Adds the damping of each dashpot, in N·s/m, to its free blocks.
    pub(crate) fn add_damping_sums(&self, sums: &mut [f64]) {
        self.connections.add_to_ends(&self.damping, sums);
    }

    /// Power, in W, that the anchors have to give to move against the dashpots.
    pub(crate) fn anchor_power(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        n_free: usize,
    ) -> f64 {
        let mut power = 0.0;
        for index in self.connections.anchored_moving().start..self.len() {
            let force = self.force(index, x, v);
            let [a, b] = self.ends(index);
            power += force.dot(&v[b]);
            if a >= n_free {
                power -= force.dot(&v[a]);
            }
        }
        power
    }
}

impl ForceEmitter for Dashpots {
    fn energy(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    fn add_forces(&self, x: &[Vector3<f64>], v: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            let force = self.force(index, x, v);
            self.connections.add_force(index, force, forces);
        }
    }

    fn add_matrix(&self, x: &[Vector3<f64>], weights: Weights, matrix: &mut BlockMatrix) {
        for index in self.connections.live() {
            let block = self.block(index, x, weights.damping);
            self.connections.add_block(index, &block, matrix);
        }
    }
}
