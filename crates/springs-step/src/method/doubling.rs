//! Error control for methods without an estimate of their own.

use crate::implicit::response::Response;
use crate::method::time_scale;
use crate::vectors::{largest, spread};
use crate::{
    Anchors, ErrorEstimate, Flows, HiddenState, Interval, Method, MethodError, State, Work,
};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::{Interrupt, SolveError};

/// Any method, made to estimate its error: each step is made once as a whole
/// and once as two halves, which are the result; their difference gives the
/// errors e_x of positions and e_v of velocities (Hairer, Nørsett, Wanner:
/// Solving Ordinary Differential Equations I, 1993, II.4).
///
/// An error of velocities moves positions by no more than e_v/ω in a vibration
/// of frequency ω, and by T e_v in free motion, where T is the time in which the
/// motion itself changes. As in [`crate::TrBdf2`] both are met by
///
///   w = (M + TD + T²S)⁻¹ T²M e_v,
///
/// and a step adds ‖e_x‖ + (‖e_v‖·‖w‖)^½ to the error of positions. That is no
/// more than ‖e_x‖ + T‖e_v‖: only if that is too large the system is solved,
/// with the matrix of the method or, if it has none, by conjugate gradients. Even
/// then Ω of ‖w‖/‖e_v‖ = 1/(1/T² + Ω²), the frequency that e_v seems to have, is
/// mostly the last one. Methods with a matrix damp what their steps do not
/// resolve, so such vibrations are damped in e_v first.
pub struct Doubling {
    method: Box<dyn Method>,
    whole: State,
    /// Hidden state is that at the start of the step.
    is_fresh: bool,
    /// Velocities at the start of the last step, in m/s, and e_v at its end.
    velocities: Vec<Vector3<f64>>,
    errors: Vec<Vector3<f64>>,
    /// ‖e_x‖ of the last step, in m, and where its error is largest.
    error_of_positions: f64,
    block: usize,
    step_size: f64,
    /// T, in s.
    time_scale: f64,
    stiffness: Stiffness,
    response: Response,
    /// Of both halves.
    flows: Option<Flows>,
}

/// What was last found out of how springs hold errors of velocities back.
#[derive(Clone, Copy, Default)]
struct Stiffness {
    /// Ω, in rad/s.
    frequency: f64,
    /// ‖e_v‖ at that time, in m/s.
    error: f64,
    /// Estimates until it is found out anew.
    pause: u32,
}

/// Estimates that are made with one Ω. Conjugate gradients then cost less than
/// the steps themselves.
const LONGEST_PAUSE: u32 = 16;
/// It is found out anew when errors have grown so many times: they may be other
/// ones.
const GROWN: f64 = 2.0;

impl Doubling {
    /// Wraps a method.
    pub fn new(system: &System, method: Box<dyn Method>) -> Self {
        Self {
            method,
            whole: State::initial(system),
            is_fresh: true,
            velocities: vec![Vector3::zeros(); system.n_free()],
            errors: vec![Vector3::zeros(); system.n_free()],
            error_of_positions: 0.0,
            block: 0,
            step_size: 0.0,
            time_scale: 0.0,
            stiffness: Stiffness::default(),
            response: Response::default(),
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

    /// (‖w‖/‖e_v‖)^½, in s, for e_v of size `error` in m/s.
    fn time_of_errors(
        &mut self,
        (system, state): (&System, &State),
        error: f64,
        work: &mut Work,
    ) -> f64 {
        let (time, last) = (self.time_scale, &mut self.stiffness);
        last.pause = last.pause.saturating_sub(1);
        if error > 0.0 && (last.pause == 0 || error > GROWN * last.error) {
            let (response, errors) = (&mut self.response, &self.errors);
            let (method, at) = (&mut *self.method, (system, state));
            let left = match response.by_matrix(method, at, time, errors, work) {
                Some(left) => largest(left).1,
                None => response.bound(at, time, errors, work),
            };
            *last = Stiffness {
                frequency: (error / left - 1.0).max(0.0).sqrt() / time,
                error,
                pause: LONGEST_PAUSE,
            };
        }
        time.recip().hypot(last.frequency).recip()
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
        self.stiffness = Stiffness::default();
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
        self.velocities.copy_from_slice(&state.v[..system.n_free()]);
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
        let pairs = state.v.iter().zip(&self.velocities);
        let changes = pairs.map(|(end, start)| (end - start).amax());
        let acceleration = changes.fold(0.0, f64::max) / h;
        self.time_scale = time_scale(spread(&state.v), acceleration, h);
        let mut error = 0.0;
        (self.step_size, self.error_of_positions) = (h, 0.0);
        for k in 0..system.n_free() {
            let x = scale * (state.x[k] - self.whole.x[k]).amax();
            let v = (state.v[k] - self.whole.v[k]) * scale;
            let here = x + self.time_scale * v.amax();
            if here > error || here.is_nan() {
                (self.block, error) = (k, here);
            }
            self.error_of_positions = self.error_of_positions.max(x);
            self.errors[k] = v;
        }
        Ok(Some(self.estimate(error)))
    }

    /// With w of the documentation of the type.
    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let (h, at) = (self.step_size, (system, state));
        let (method, errors) = (&mut *self.method, &mut self.errors);
        if let Some(damped) = self.response.by_matrix(method, at, h, errors, work) {
            std::mem::swap(damped, errors);
        }
        let error = largest(&self.errors).1;
        let time = self.time_of_errors(at, error, work);
        Some(self.estimate(self.error_of_positions + time * error))
    }

    fn visit(&mut self, state: &mut HiddenState) {
        self.method.visit(state);
        state.flag(&mut self.is_fresh);
        state.real(&mut self.stiffness.frequency);
        state.real(&mut self.stiffness.error);
        state.count(&mut self.stiffness.pause);
    }

    fn accept(&mut self) {
        self.method.accept();
        self.is_fresh = true;
    }

    fn keep_tensions(&mut self, system: &System) {
        self.method.keep_tensions(system);
    }

    fn tensions(&self) -> Option<&[f64]> {
        self.method.tensions()
    }

    fn flows(&self) -> Option<Flows> {
        self.flows
    }
}
