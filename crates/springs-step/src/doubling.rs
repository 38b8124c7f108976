//! Error control for methods without an estimate of their own.

use crate::stage::largest;
use crate::{
    Anchors, ErrorEstimate, Flows, HiddenState, Interval, Method, MethodError, State, Work,
};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::{Interrupt, SolveError};

/// Any method, made to estimate its error: each step is made once as a whole
/// and once as two halves, which are the result; their difference is the
/// estimate (Hairer, Nørsett, Wanner: Solving Ordinary Differential Equations
/// I, 1993, II.4).
pub struct Doubling {
    method: Box<dyn Method>,
    whole: State,
    /// Hidden state is that at the start of the step.
    is_fresh: bool,
    /// Estimated errors of velocities of the last step, in m/s.
    errors: Vec<Vector3<f64>>,
    /// Of positions, in m, and where.
    error_of_positions: f64,
    block: usize,
    step_size: f64,
    /// Of both halves.
    flows: Option<Flows>,
}

impl Doubling {
    /// Wraps a method.
    pub fn new(system: &System, method: Box<dyn Method>) -> Self {
        Self {
            method,
            whole: State::initial(system),
            is_fresh: true,
            errors: vec![Vector3::zeros(); system.n_free()],
            error_of_positions: 0.0,
            block: 0,
            step_size: 0.0,
            flows: None,
        }
    }

    fn estimate(&self, error: f64) -> ErrorEstimate {
        ErrorEstimate {
            rate: error / self.step_size,
            exponent: f64::from(self.order()),
            block: self.block,
        }
    }
}

impl Method for Doubling {
    fn order(&self) -> u32 {
        self.method.order()
    }

    fn setup(&self) -> Work {
        self.method.setup()
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.method.expect_changing_steps(system)
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.method.set_interrupt(interrupt);
    }

    fn restart(&mut self) {
        self.method.restart();
        self.is_fresh = true;
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let h = interval.size;
        let middle = interval.start + 0.5 * h;
        self.whole.x.copy_from_slice(&state.x);
        self.whole.v.copy_from_slice(&state.v);
        // The first half of a rejected step was accepted by the method.
        if !self.is_fresh {
            self.method.restart();
        }
        self.method
            .step(system, anchors, interval, &mut self.whole, work)?;
        let first = Interval {
            start: interval.start,
            end: middle,
            size: 0.5 * h,
        };
        let second = Interval {
            start: middle,
            end: interval.end,
            size: 0.5 * h,
        };
        self.method.step(system, anchors, first, state, work)?;
        let flows = self.method.flows();
        self.method.accept();
        self.is_fresh = false;
        self.method.step(system, anchors, second, state, work)?;
        self.flows = flows.zip(self.method.flows()).map(|(a, b)| a + b);

        let scale = 1.0 / (2f64.powi(self.order() as i32) - 1.0);
        let mut error = 0.0;
        (self.step_size, self.error_of_positions) = (h, 0.0);
        for k in 0..system.n_free() {
            let x = scale * (state.x[k] - self.whole.x[k]).amax();
            let v = (state.v[k] - self.whole.v[k]) * scale;
            let here = x + h * v.amax();
            if here > error || here.is_nan() {
                (self.block, error) = (k, here);
            }
            self.error_of_positions = self.error_of_positions.max(x);
            self.errors[k] = v;
        }
        Ok(Some(self.estimate(error)))
    }

    /// The same with vibrations damped in the errors of velocities.
    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let h = self.step_size;
        let errors = &mut self.errors;
        let is_damped = self.method.damp_vibrations(system, state, h, errors, work);
        is_damped.then(|| self.estimate(self.error_of_positions + h * largest(&self.errors).1))
    }

    fn visit(&mut self, state: &mut HiddenState) {
        self.method.visit(state);
        state.flag(&mut self.is_fresh);
    }

    fn accept(&mut self) {
        self.method.accept();
        self.is_fresh = true;
    }

    fn flows(&self) -> Option<Flows> {
        self.flows
    }
}
