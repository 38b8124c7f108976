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
        let firsts = firsts_of_pairs(scene, |spring| is_damped(spring).then_some(()));
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

    /// Heat that those with a free end produce, in W.
    pub fn dissipation(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let heat = |index| {
            let [a, b] = self.ends(index);
            dashpot::dissipation(self.dashpot(index), [&x[a], &x[b]], [&v[a], &v[b]])
        };
        self.connections.live().map(heat).sum()
    }

    /// v₁ − v₀ of the ends of each dashpot, in m/s.
    ///
    /// # Panics
    ///
    /// If `rates` does not have one entry per dashpot.
    pub fn rates(&self, v: &[Vector3<f64>], rates: &mut [Vector3<f64>]) {
        assert_eq!(rates.len(), self.len(), "one entry per dashpot");
        for (index, rate) in rates.iter_mut().enumerate() {
            *rate = self.connections.difference(index, v);
        }
    }

    /// Adds the force on the first end of each dashpot with a free end, times a
    /// time `weight` in s, to its impulse, in N·s.
    ///
    /// # Panics
    ///
    /// If `impulses` does not have one entry per dashpot.
    pub fn add_impulses(
        &self,
        weight: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        impulses: &mut [Vector3<f64>],
    ) {
        assert_eq!(impulses.len(), self.len(), "one entry per dashpot");
        for index in self.connections.live() {
            impulses[index] += self.force(index, x, v) * weight;
        }
    }

    /// Kinetic energy, in J, that impulses of the dashpots take from their ends
    /// when the [rates](Self::rates) change from `before` to those of `v`:
    /// Σ J·(w₀ + w₁)/2.
    pub fn energy_taken(
        &self,
        impulses: &[Vector3<f64>],
        before: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) -> f64 {
        let taken = |index| {
            let mean: Vector3<f64> = before[index] + self.connections.difference(index, v);
            0.5 * impulses[index].dot(&mean)
        };
        self.connections.live().map(taken).sum()
    }

    /// Work, in J, that anchors do against impulses of their dashpots to free
    /// nodes.
    pub fn anchor_work(&self, impulses: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let work =
            |index: usize| -> f64 { impulses[index].dot(&self.connections.second(index, v)) };
        self.connections.anchored().map(work).sum()
    }

    /// Heat, in J, of the dashpots between fixed nodes that go in a time `h`, in
    /// s, from `start` to `end` at constant velocities; anchors do as much work.
    pub fn heat_between_fixed(&self, start: &[Vector3<f64>], end: &[Vector3<f64>], h: f64) -> f64 {
        let heat = |index| {
            let [before, after] = [start, end].map(|x| self.connections.difference(index, x));
            dashpot::heat_of_passage(self.dashpot(index), &before, &after, h)
        };
        self.connections.between_fixed().map(heat).sum()
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

    /// Power, in W, that anchors give to move against their dashpots to free
    /// nodes.
    pub fn anchor_power(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let power = |index| -> f64 {
            let force = self.force(index, x, v);
            force.dot(&self.connections.second(index, v))
        };
        self.connections.anchored().map(power).sum()
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
