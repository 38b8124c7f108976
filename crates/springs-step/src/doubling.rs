//! Error control for methods without an estimate of their own.

use crate::{Anchors, ErrorEstimate, Interval, Method, MethodError, Quadrature, State, Work};
use springs_assembly::System;

/// Any method, made to estimate its error: each step is made once as a whole
/// and once as two halves, which are the result; their difference is the
/// estimate (Hairer, Nørsett, Wanner: Solving Ordinary Differential Equations
/// I, 1993, II.4).
pub struct Doubling {
    method: Box<dyn Method>,
    whole: State,
}

impl Doubling {
    /// Wraps a method.
    pub fn new(system: &System, method: Box<dyn Method>) -> Self {
        Self {
            method,
            whole: State::initial(system),
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

    fn restart(&mut self) {
        self.method.restart();
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
        // The first half is taken back if the whole step is, so hidden state
        // cannot be carried over.
        self.method.restart();
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
        self.method.accept();
        self.method.step(system, anchors, second, state, work)?;

        let scale = 1.0 / (2f64.powi(self.order() as i32) - 1.0);
        let (mut block, mut error) = (0, 0.0);
        for k in 0..system.n_free() {
            let x = (state.x[k] - self.whole.x[k]).amax();
            let v = (state.v[k] - self.whole.v[k]).amax();
            let here = scale * (x + h * v);
            if here > error || here.is_nan() {
                (block, error) = (k, here);
            }
        }
        Ok(Some(ErrorEstimate {
            rate: error / h,
            exponent: f64::from(self.order()),
            block,
        }))
    }

    fn accept(&mut self) {
        self.method.accept();
    }

    fn quadrature(&self) -> Quadrature {
        self.method.quadrature()
    }
}
