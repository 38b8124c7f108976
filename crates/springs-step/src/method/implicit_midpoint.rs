//! Implicit midpoint, converged.

use crate::flows::Impulses;
use crate::implicit::stage::{Stage, StageProblem};
use crate::implicit::tensions::Tensions;
use crate::vectors::momenta_of;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::RunOptions;
use springs_solver::{Interrupt, SolveError};

/// M(v' − v) = h f at the middle of (x, v) and (x', v'), x' − x = ½h(v + v').
///
/// Order 2, symplectic, symmetric, A-stable but not L-stable: linear and
/// angular momentum are kept to rounding, energy errors stay bounded, and
/// vibrations that the step does not resolve are not damped either (Hairer,
/// Lubich, Wanner: Geometric Numerical Integration, 2006, II.1.3).
pub struct ImplicitMidpoint {
    stage: Stage,
    momenta: Vec<Vector3<f64>>,
    before: State,
    tensions: Tensions,
    impulses: Impulses,
    is_started: bool,
}

impl ImplicitMidpoint {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System, options: &RunOptions) -> Result<Self, SolveError> {
        Ok(Self {
            stage: Stage::new(system, options)?,
            momenta: vec![Vector3::zeros(); system.n_free()],
            before: State::initial(system),
            tensions: Tensions::new(system),
            impulses: Impulses::new(system),
            is_started: false,
        })
    }
}

impl Method for ImplicitMidpoint {
    fn order(&self) -> u32 {
        2
    }

    fn setup(&self) -> Work {
        self.stage.setup()
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.stage.set_interrupt(interrupt);
    }

    fn restart(&mut self) {
        self.tensions.forget();
        self.is_started = false;
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        if !self.is_started {
            let h = interval.size;
            let start = interval.start;
            self.stage
                .settle_massless(system, (start, h), state, work)?;
        }
        self.tensions.begin(system, &state.x);
        self.before.x.copy_from_slice(&state.x);
        self.before.v.copy_from_slice(&state.v);
        momenta_of(system, &state.v, &mut self.momenta);
        self.impulses.begin(system, &state.v);
        let half = 0.5 * interval.size;
        let middle = interval.start + half;
        anchors.place(middle, &mut state.x, &mut state.v);
        let problem = StageProblem {
            c: half,
            time: middle,
            momenta: &self.momenta,
            accuracy: None,
            goes_on: false,
        };
        self.stage
            .solve(system, &problem, state, &mut self.tensions.end, work)?;
        self.impulses
            .add(system, interval.size, middle, &state.x, &state.v);
        // From the middle as far again.
        for block in 0..system.n_free() {
            state.x[block] = state.x[block] * 2.0 - self.before.x[block];
            state.v[block] = state.v[block] * 2.0 - self.before.v[block];
        }
        anchors.place(interval.end, &mut state.x, &mut state.v);
        self.impulses.finish(system, &state.v);
        Ok(None)
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.stage.archive(archive);
        self.tensions.archive(archive);
        archive.flag(&mut self.is_started);
    }

    fn accept(&mut self) {
        self.tensions.accept();
        self.is_started = true;
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }
}
