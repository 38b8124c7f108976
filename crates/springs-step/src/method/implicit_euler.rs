//! Implicit Euler, converged.

use crate::flows::Impulses;
use crate::implicit::linear::Damping;
use crate::implicit::stage::{Stage, StageProblem};
use crate::implicit::tensions::Tensions;
use crate::vectors::momenta_of;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::RunOptions;
use springs_solver::{Interrupt, SolveError};

/// M(v' − v) = h f(x', v'), x' = x + h v', solved.
///
/// Order 1, L-stable; without gravity and anchors the energy never rises. The
/// robust one: it converges at any step.
pub struct ImplicitEuler {
    stage: Stage,
    momenta: Vec<Vector3<f64>>,
    tensions: Tensions,
    impulses: Impulses,
}

impl ImplicitEuler {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System, options: &RunOptions) -> Result<Self, SolveError> {
        Ok(Self {
            stage: Stage::new(system, options)?,
            momenta: vec![Vector3::zeros(); system.n_free()],
            tensions: Tensions::new(system),
            impulses: Impulses::new(system),
        })
    }
}

impl Method for ImplicitEuler {
    fn order(&self) -> u32 {
        1
    }

    fn setup(&self) -> Work {
        self.stage.setup()
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.stage.expect_changing_steps(system)
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.stage.set_interrupt(interrupt);
    }

    fn restart(&mut self) {
        self.tensions.forget();
    }

    fn forces_jumped(&mut self, system: &System) {
        self.tensions.clear_broken(system);
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        self.tensions.begin(system, &state.x);
        momenta_of(system, &state.v, &mut self.momenta);
        self.impulses.begin(system, &state.v);
        anchors.place(interval.end, &mut state.x, &mut state.v);
        let problem = StageProblem {
            c: interval.size,
            time: interval.end,
            momenta: &self.momenta,
            accuracy: None,
            goes_on: false,
        };
        self.stage
            .solve(system, &problem, state, &mut self.tensions.end, work)?;
        let (h, end) = (interval.size, interval.end);
        self.impulses.add(system, h, end, &state.x, &state.v);
        self.impulses.finish(system, &state.v);
        Ok(None)
    }

    fn damp_vibrations(
        &mut self,
        system: &System,
        state: &State,
        time_scale: f64,
        errors: &mut [Vector3<f64>],
        work: &mut Work,
    ) -> bool {
        let damping = Damping {
            carried: Some(&self.tensions.end),
            time_scale,
            passes: 1,
        };
        self.stage
            .damp_vibrations(system, state, damping, [errors], work)
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.stage.archive(archive);
        self.tensions.archive(archive);
    }

    fn accept(&mut self) {
        self.tensions.accept();
    }

    fn tensions(&self) -> Option<&[f64]> {
        Some(&self.tensions.start)
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }
}
