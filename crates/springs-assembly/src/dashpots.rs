//! Dashpots along springs as force emitters.

use crate::batch::{Connections, firsts_of_pairs};
use crate::{Evaluation, ForceEmitter, Linearization, Numbering, PACKED};
use nalgebra::{Matrix3, Vector3};
use springs_math::Separation;
use springs_math::dashpot::{self, Dashpot};
use springs_scene::{Scene, Spring};

/// All springs that have a damping; those between the same two nodes are one,
/// unless the scene says otherwise: c = Σc. Scenes without any pay nothing for them.
#[derive(Clone, Debug)]
pub struct Dashpots {
    pub(crate) connections: Connections,
    damping: Vec<f64>,
}

impl Dashpots {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let is_damped = |spring: &Spring| spring.damping > 0.0;
        let firsts = firsts_of_pairs(scene, is_damped);
        let mut sums = vec![0.0; scene.springs.len()];
        for (spring, &first) in scene.springs.iter().zip(&firsts) {
            sums[first] += spring.damping;
        }
        let (connections, order) = Connections::new(scene, numbering, |index| {
            is_damped(&scene.springs[index]) && firsts[index] == index
        });
        Self {
            connections,
            damping: order.iter().map(|&index| sums[index]).collect(),
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

    fn block(&self, index: usize, at: &Evaluation<'_>) -> [f64; 6] {
        let [a, b] = self.ends(index);
        let separation = Separation::between(&at.x[a], &at.x[b]);
        let damping = self.damping[index];
        let along = separation.along() * (damping * at.weights.damping);
        let rate = separation.direction.dot(&(at.v[b] - at.v[a]));
        if !at.dashpot_tension || rate <= 0.0 || separation.length == 0.0 {
            return PACKED.map(|entry| along[entry]);
        }
        let across = Matrix3::identity() - separation.along();
        let stiffness = damping * rate / separation.length;
        let block = along + across * (stiffness * at.weights.stiffness);
        PACKED.map(|entry| block[entry])
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
        self.connections
            .anchor_power(v, n_free, |index| self.force(index, x, v))
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

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        for index in self.connections.interior() {
            let block = self.block(index, at);
            self.connections.add_block(index, &block, &mut out.matrix);
        }
        for index in self.connections.anchored() {
            let block = self.block(index, at);
            self.connections
                .add_anchored_block(index, &block, at.v, out);
        }
    }

    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            let block = self.block(index, at);
            self.connections
                .add_product(index, &block, 1.0, y, products);
        }
    }
}
