//! States between two steps.

use crate::{
    Anchors, Archive, Choice, Flows, Interval, Method, MethodError, NodeStates, SetupError, State,
    Work,
};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::Interrupt;

/// States between the steps of a method, to the method's order.
pub(crate) enum DenseOutput {
    /// By a polynomial through the ends of the step.
    Polynomial {
        /// Order of the method.
        order: u32,
        /// Whether it is a straight line where steps do not resolve the fastest
        /// vibrations.
        is_straight_if_coarse: bool,
    },
    /// By a step of the method to where the state is wanted, with an instance
    /// of its own so that the steps themselves are not disturbed.
    Substep {
        /// That instance.
        method: Box<dyn Method>,
        /// Its global vectors.
        state: State,
    },
}

/// Methods of at least this order need more than a polynomial between steps.
const HIGH_ORDER: u32 = 4;

/// Methods that do not damp unresolved vibrations keep velocities of them, which
/// would carry a cubic polynomial far off between two steps. From this product of
/// step size and frequency bound on a straight line, of order 2 too, takes its
/// place.
const LONGEST_CURVE: f64 = 2.0;

impl DenseOutput {
    /// What suits a method; of high order, another instance of it is built.
    pub(crate) fn of(
        choice: &Choice,
        method: &dyn Method,
        system: &System,
    ) -> Result<Self, SetupError> {
        Ok(match method.order() {
            order if order < HIGH_ORDER => Self::Polynomial {
                order,
                is_straight_if_coarse: choice.wants_equal_steps(),
            },
            _ => Self::Substep {
                method: choice.build(system)?,
                state: State::initial(system),
            },
        })
    }

    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        if let Self::Substep { method, .. } = self {
            method.set_interrupt(interrupt);
        }
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        if let Self::Substep { method, .. } = self {
            method.archive(archive);
        }
    }

    /// Flows from the start of the step to the state that was made last, where a
    /// step of the method made it.
    pub(crate) fn flows(&self) -> Option<&Flows> {
        match self {
            Self::Polynomial { .. } => None,
            Self::Substep { method, .. } => method.flows(),
        }
    }

    /// State at `time` of a step from `before` to `after` over `interval`.
    pub(crate) fn evaluate(
        &mut self,
        (system, anchors): (&System, &Anchors),
        [before, after]: [&NodeStates; 2],
        interval: Interval,
        time: f64,
        out: &mut NodeStates,
    ) -> Result<(), MethodError> {
        match self {
            Self::Polynomial {
                order,
                is_straight_if_coarse,
            } => {
                let fraction = (time - interval.start) / (interval.end - interval.start);
                // Massless nodes leave the frequency without a bound.
                let straight_from = LONGEST_CURVE / system.frequency_bound();
                let is_straight =
                    *is_straight_if_coarse && straight_from > 0.0 && interval.size >= straight_from;
                let order = if is_straight { 1 } else { *order };
                interpolate(order, before, after, interval.size, fraction, out);
                anchors.place_nodes(system, time, out);
                Ok(())
            }
            // Methods have no step of no length.
            Self::Substep { .. } if time == interval.start => {
                out.clone_from(before);
                Ok(())
            }
            Self::Substep { method, state } => {
                state.gather(system, before);
                method.restart();
                let part = Interval {
                    start: interval.start,
                    end: time,
                    size: time - interval.start,
                };
                method.step(system, anchors, part, state, &mut Work::default())?;
                state.scatter(system, out);
                Ok(())
            }
        }
    }
}

/// The state at `start + fraction·h` of a step of size `h` in s from `before` to
/// `after`, to the given order of the method: linear for order 1, cubic Hermite
/// for more.
///
/// # Panics
///
/// If the three do not have the same number of nodes.
pub fn interpolate(
    order: u32,
    before: &NodeStates,
    after: &NodeStates,
    h: f64,
    fraction: f64,
    out: &mut NodeStates,
) {
    let n = out.positions.len();
    assert_eq!(before.positions.len(), n, "the same nodes");
    assert_eq!(after.positions.len(), n, "the same nodes");
    for node in 0..n {
        let (x0, x1) = (before.positions[node], after.positions[node]);
        let (v0, v1) = (before.velocities[node], after.velocities[node]);
        (out.positions[node], out.velocities[node]) = match order {
            // What stands still stands still to the last bit.
            _ if x0 == x1 && [v0, v1] == [Vector3::zeros(); 2] => (x0, v0),
            1 => (x0.lerp(&x1, fraction), v0.lerp(&v1, fraction)),
            _ => hermite([x0, x1], [v0, v1], h, fraction),
        };
    }
}

/// Value and derivative of the cubic with the given values and derivatives.
fn hermite(
    [x0, x1]: [Vector3<f64>; 2],
    [v0, v1]: [Vector3<f64>; 2],
    h: f64,
    s: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let slope = (x1 - x0) / h;
    let curved = v0 + v1 - slope * 2.0;
    let bend = slope * 3.0 - v0 * 2.0 - v1;
    let position = x0 + (v0 + (bend + curved * s) * s) * (s * h);
    let velocity = v0 + (bend * 2.0 + curved * (3.0 * s)) * s;
    (position, velocity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_motion_is_reproduced() {
        let x = |t: f64| Vector3::new(1.0 + t * (2.0 - t * (0.5 - 3.0 * t)), t, 0.0);
        let v = |t: f64| Vector3::new(2.0 - t * (1.0 - 9.0 * t), 1.0, 0.0);
        let state = |t: f64| NodeStates {
            positions: vec![x(t)],
            velocities: vec![v(t)],
        };
        let (before, after) = (state(0.3), state(0.8));
        let mut between = before.clone();
        for fraction in [0.0, 0.25, 0.7, 1.0] {
            interpolate(2, &before, &after, 0.5, fraction, &mut between);
            let expected = state(0.3 + 0.5 * fraction);
            assert!((between.positions[0] - expected.positions[0]).norm() < 1e-14);
            assert!((between.velocities[0] - expected.velocities[0]).norm() < 1e-14);
        }
        interpolate(1, &before, &after, 0.5, 0.5, &mut between);
        let middle = (before.positions[0] + after.positions[0]) / 2.0;
        assert_eq!(between.positions[0], middle);
    }
}
