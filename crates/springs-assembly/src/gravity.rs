//! Gravity as a force emitter.

use crate::{Evaluation, ForceEmitter, Linearization};
use nalgebra::Vector3;
use springs_math::gravity;

/// Uniform gravity on all free nodes.
#[derive(Clone, Debug)]
pub struct Gravity {
    /// m g of each free block, in N; empty without gravity.
    weights: Vec<Vector3<f64>>,
}

impl Gravity {
    pub(crate) fn new(acceleration: &Vector3<f64>, masses: &[f64]) -> Self {
        let weights = match *acceleration == Vector3::zeros() {
            true => Vec::new(),
            false => {
                let weight = |&mass: &f64| gravity::force(mass, acceleration);
                masses.iter().map(weight).collect()
            }
        };
        Self { weights }
    }
}

impl Gravity {
    /// Writes the weights, or zeros without gravity, over what is there.
    pub(crate) fn set_forces(&self, forces: &mut [Vector3<f64>]) {
        match self.weights.is_empty() {
            true => forces.fill(Vector3::zeros()),
            false => forces.copy_from_slice(&self.weights),
        }
    }
}

impl ForceEmitter for Gravity {
    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let weighted = self.weights.iter().zip(x);
        weighted.fold(0.0, |energy, (weight, x)| energy - weight.dot(x))
    }

    fn add_forces(&self, _x: &[Vector3<f64>], _v: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for (force, weight) in forces.iter_mut().zip(&self.weights) {
            *force += weight;
        }
    }

    /// Adds the force alone: it does not depend on positions or velocities.
    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        self.add_forces(at.x, at.v, &mut out.forces);
    }

    fn add_products(&self, _at: &Evaluation<'_>, _y: &[Vector3<f64>], _p: &mut [Vector3<f64>]) {}
}
