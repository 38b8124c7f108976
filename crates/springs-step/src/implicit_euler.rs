//! Implicit Euler, converged.

use crate::stage::{Stage, StageProblem};
use crate::{Anchors, ErrorEstimate, Interval, Method, MethodError, Quadrature, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::SolveError;

/// M(v' − v) = h f(x', v'), x' = x + h v', solved.
///
/// Order 1, L-stable; without gravity and anchors the energy never rises. The
/// robust one: it converges at any step.
pub struct ImplicitEuler {
    stage: Stage,
    momenta: Vec<Vector3<f64>>,
    tensions: Tensions,
}

/// Tensions of all springs as first guesses of Newton's method, at the start of
/// a step and at its end.
pub(crate) struct Tensions {
    pub(crate) start: Vec<f64>,
    pub(crate) end: Vec<f64>,
    are_known: bool,
}

impl Tensions {
    pub(crate) fn new(system: &System) -> Self {
        Self {
            start: vec![0.0; system.springs().len()],
            end: vec![0.0; system.springs().len()],
            are_known: false,
        }
    }

    pub(crate) fn forget(&mut self) {
        self.are_known = false;
    }

    /// Begins a step at the given positions; `end` is then the guess.
    pub(crate) fn begin(&mut self, system: &System, x: &[Vector3<f64>]) {
        if !self.are_known {
            system.springs().tensions(x, &mut self.start);
            self.are_known = true;
        }
        self.end.copy_from_slice(&self.start);
    }

    pub(crate) fn accept(&mut self) {
        std::mem::swap(&mut self.start, &mut self.end);
    }
}

impl ImplicitEuler {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System) -> Result<Self, SolveError> {
        Ok(Self {
            stage: Stage::new(system)?,
            momenta: vec![Vector3::zeros(); system.n_free()],
            tensions: Tensions::new(system),
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

    fn restart(&mut self) {
        self.tensions.forget();
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
        let momenta = system.masses().iter().zip(&state.v);
        for (p, (m, v)) in self.momenta.iter_mut().zip(momenta) {
            *p = v * *m;
        }
        anchors.place(interval.end, &mut state.x);
        let problem = StageProblem {
            c: interval.size,
            momenta: &self.momenta,
            accuracy: None,
        };
        self.stage
            .solve(system, &problem, state, &mut self.tensions.end, work)?;
        Ok(None)
    }

    fn accept(&mut self) {
        self.tensions.accept();
    }

    fn quadrature(&self) -> Quadrature {
        Quadrature::END
    }
}
