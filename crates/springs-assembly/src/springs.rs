//! Springs as force emitters.

use crate::batch::Connections;
use crate::{Evaluation, ForceEmitter, Linearization, Numbering, Projection};
use nalgebra::Vector3;
use springs_math::{Separation, spring};
use springs_scene::Scene;

/// All springs that have a stiffness.
#[derive(Clone, Debug)]
pub struct Springs {
    pub(crate) connections: Connections,
    stiffness: Vec<f64>,
    rest_length: Vec<f64>,
    scene_index: Vec<usize>,
}

impl Springs {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let (connections, order) =
            Connections::new(scene, numbering, |spring| spring.stiffness > 0.0);
        let springs = || order.iter().map(|&index| &scene.springs[index]);
        Self {
            connections,
            stiffness: springs().map(|spring| spring.stiffness).collect(),
            rest_length: springs().map(|spring| spring.rest_length).collect(),
            scene_index: order,
        }
    }

    /// Number of springs in the batch.
    pub fn len(&self) -> usize {
        self.connections.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index in the scene of the spring at `index` of the batch.
    ///
    /// # Panics
    ///
    /// If there is no such spring.
    pub fn scene_index(&self, index: usize) -> usize {
        self.scene_index[index]
    }

    fn material(&self, index: usize) -> spring::Spring {
        spring::Spring {
            stiffness: self.stiffness[index],
            rest_length: self.rest_length[index],
        }
    }

    /// T = K(l − l₀) of one spring and its length, in N and m.
    #[inline(always)]
    fn tension_and_length(&self, index: usize, x: &[Vector3<f64>]) -> (f64, f64) {
        let length = Separation::of(&self.connections.difference(index, x)).length;
        (spring::tension(self.material(index), length), length)
    }

    fn linearize_with(
        &self,
        project: impl Fn(f64) -> f64 + Copy,
        at: &Evaluation<'_>,
        out: &mut Linearization,
    ) {
        let weight = at.weights.stiffness;
        for index in self.connections.live() {
            let dx = self.connections.difference(index, at.x);
            let (force, block) = spring::linearize(
                self.material(index),
                at.tensions.map(|tensions| tensions[index]),
                &dx,
                project,
            );
            let block = block.map(|entry| weight * entry);
            self.connections.add_force(index, force, &mut out.forces);
            match index < self.connections.interior().end {
                true => self.connections.add_block(index, &block, &mut out.matrix),
                false => self
                    .connections
                    .add_anchored_block(index, &block, at.v, out),
            }
        }
    }

    /// T = K(l − l₀) of every spring with a free end, in N; zero for the rest.
    ///
    /// # Panics
    ///
    /// If `tensions` does not have one entry per spring of the batch.
    pub fn tensions(&self, x: &[Vector3<f64>], tensions: &mut [f64]) {
        assert_eq!(tensions.len(), self.len(), "one entry per spring");
        for index in self.connections.live() {
            tensions[index] = self.tension_and_length(index, x).0;
        }
    }

    /// The tensions predicted for positions x + h·v, in N: T = K(l − l₀) at `x`
    /// plus K times the linear change of the length.
    ///
    /// # Panics
    ///
    /// If `tensions` does not have one entry per spring of the batch.
    pub fn predict_tensions(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        h: f64,
        tensions: &mut [f64],
    ) {
        self.tensions(x, tensions);
        for (index, tension) in tensions
            .iter_mut()
            .enumerate()
            .take(self.connections.live().end)
        {
            let u = Separation::of(&self.connections.difference(index, x)).direction;
            let change = h * u.dot(&self.connections.difference(index, v));
            *tension += self.stiffness[index] * change;
        }
    }

    /// How many springs with a free end have a negative tension: their own, or
    /// the given one.
    pub fn count_compressed(&self, x: &[Vector3<f64>], tensions: Option<&[f64]>) -> usize {
        let is_compressed = |index: &usize| {
            let (own, length) = self.tension_and_length(*index, x);
            tensions.map_or(own, |given| given[*index]) < 0.0 && length > 0.0
        };
        self.connections.live().filter(is_compressed).count()
    }

    /// Adds the stiffness of each spring, in N/m, to its free blocks.
    pub(crate) fn add_stiffness_sums(&self, sums: &mut [f64]) {
        self.connections.add_to_ends(&self.stiffness, sums);
    }

    /// Power, in W, that the anchors have to give to move against the springs.
    pub(crate) fn anchor_power(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        n_free: usize,
    ) -> f64 {
        self.connections.anchor_power(v, n_free, |index| {
            let dx = self.connections.difference(index, x);
            spring::force(self.material(index), &Vector3::zeros(), &dx)
        })
    }
}

impl ForceEmitter for Springs {
    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let energy = |index| {
            let dx = self.connections.difference(index, x);
            spring::energy(self.material(index), &Vector3::zeros(), &dx)
        };
        (0..self.len()).map(energy).sum()
    }

    fn add_forces(&self, x: &[Vector3<f64>], _v: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            let dx = self.connections.difference(index, x);
            let force = spring::force(self.material(index), &Vector3::zeros(), &dx);
            self.connections.add_force(index, force, forces);
        }
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        match at.projection {
            Projection::None => self.linearize_with(|across| across, at, out),
            Projection::Clamp => self.linearize_with(|across| across.max(0.0), at, out),
            Projection::Absolute => self.linearize_with(f64::abs, at, out),
            Projection::Drop => self.linearize_with(|_| 0.0, at, out),
        }
    }
}
