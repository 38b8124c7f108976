//! Gravity as an emitter.

use crate::{Emitter, Evaluation, Linearization, Nature, Numbering, StiffnessKind};
use nalgebra::Vector3;
use springs_math::gravity;

/// Uniform gravity on all free nodes.
#[derive(Clone, Debug)]
pub(crate) struct Gravity {
    /// m g of each free block, in N; empty without gravity.
    weights: Vec<Vector3<f64>>,
}

impl Gravity {
    /// From g in m/s² and the masses of the free blocks, in kg.
    pub(crate) fn new(acceleration: &Vector3<f64>, masses: &[f64]) -> Self {
        let weights = if *acceleration == Vector3::zeros() {
            Vec::new()
        } else {
            let weight = |&mass: &f64| gravity::force(mass, acceleration);
            masses.iter().map(weight).collect()
        };
        Self { weights }
    }
}

impl Emitter for Gravity {
    fn name(&self) -> &str {
        "gravity"
    }

    fn nature(&self) -> Nature {
        Nature {
            n_terms: 0,
            n_merged: 0,
            stiffness: StiffnessKind::None,
            is_constant: true,
            is_load: false,
            is_damped: false,
            is_central: true,
            has_symmetric_blocks: true,
        }
    }

    fn number(&mut self, _numbering: &Numbering) {}

    fn each_stencil(&self, _visit: &mut dyn FnMut(&[u32])) {}

    fn place(&mut self, _pairs: &[u32]) {}

    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let weighted = self.weights.iter().zip(x);
        weighted.fold(0.0, |energy, (weight, x)| energy - weight.dot(x))
    }

    fn add_forces(&self, _x: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for (force, weight) in forces.iter_mut().zip(&self.weights) {
            *force += weight;
        }
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        self.add_forces(at.x, &mut out.forces);
    }

    fn add_products(&self, _at: &Evaluation<'_>, _y: &[Vector3<f64>], _p: &mut [Vector3<f64>]) {}

    fn add_stiffness_bounds(&self, _bounds: &mut [f64]) {}
}
