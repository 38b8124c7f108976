//! Prescribed motion of fixed nodes.

use crate::State;
use nalgebra::Vector3;
use springs_assembly::System;

/// Fixed nodes follow x₀ + v t. The position is computed from the time, never
/// summed up over steps.
#[derive(Clone, Debug)]
pub struct Anchors {
    first: usize,
    /// Positions at time `since`, in m.
    origins: Vec<Vector3<f64>>,
    velocities: Vec<Vector3<f64>>,
    since: f64,
    any_moves: bool,
}

impl Anchors {
    /// Anchors that are where `state` has them at its time.
    pub(crate) fn new(system: &System, state: &State) -> Self {
        let first = system.n_free();
        let velocities = state.v[first..].to_vec();
        Self {
            first,
            origins: state.x[first..].to_vec(),
            any_moves: velocities.iter().any(|v| *v != Vector3::zeros()),
            velocities,
            since: state.time,
        }
    }

    /// Puts them where they are at `time`, in s.
    pub fn place(&self, time: f64, x: &mut [Vector3<f64>]) {
        if !self.any_moves {
            return;
        }
        let elapsed = time - self.since;
        let moved = self.origins.iter().zip(&self.velocities);
        for (x, (origin, velocity)) in x[self.first..].iter_mut().zip(moved) {
            *x = origin + velocity * elapsed;
        }
    }
}
