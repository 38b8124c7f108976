//! Velocity Verlet: kick, drift, kick.

use crate::work::timed;
use crate::{Anchors, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;

/// v½ = v + ½h a, x' = x + h v½, a' = M⁻¹f(x', v + h a), v' = v½ + ½h a'.
///
/// Order 2, explicit; without dashpots symplectic, time-reversible and
/// momentum-conserving, stable for hω < 2 (Verlet, Phys. Rev. 159, 1967; Swope
/// et al., J. Chem. Phys. 76, 1982). Forces that depend on velocities are taken
/// at the velocity predicted for the end of the step, which keeps order 2
/// (Groot and Warren, J. Chem. Phys. 107, 1997, with λ = 1).
pub struct VelocityVerlet {
    accelerations: Vec<Vector3<f64>>,
    predicted: Vec<Vector3<f64>>,
    accelerations_are_known: bool,
}

impl VelocityVerlet {
    /// Allocates the workspace.
    pub fn new(system: &System) -> Self {
        Self {
            accelerations: vec![Vector3::zeros(); system.n_free()],
            predicted: system.initial_velocities().to_vec(),
            accelerations_are_known: false,
        }
    }

    fn accelerate(&mut self, system: &System, x: &[Vector3<f64>], work: &mut Work) {
        timed(&mut work.phases.assembly, || {
            system.forces(x, &self.predicted, &mut self.accelerations);
            for (a, mass) in self.accelerations.iter_mut().zip(system.masses()) {
                *a /= *mass;
            }
        });
        work.counts.force_evaluations += 1;
    }
}

impl Method for VelocityVerlet {
    fn order(&self) -> u32 {
        2
    }

    fn restart(&mut self) {
        self.accelerations_are_known = false;
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let h = interval.size;
        if !self.accelerations_are_known {
            self.predicted.copy_from_slice(&state.v);
            self.accelerate(system, &state.x, work);
            self.accelerations_are_known = true;
        }
        let blocks = self.accelerations.iter().zip(&mut self.predicted);
        let moving = state.x.iter_mut().zip(&mut state.v);
        for ((a, predicted), (x, v)) in blocks.zip(moving) {
            *predicted = *v + a * h;
            *v += a * (0.5 * h);
            *x += *v * h;
        }
        anchors.place(interval.end, &mut state.x);
        self.accelerate(system, &state.x, work);
        for (v, a) in state.v.iter_mut().zip(&self.accelerations) {
            *v += a * (0.5 * h);
        }
        Ok(())
    }
}
