//! Linearly implicit Euler: the step of the note, Eqs. 10–14.

use crate::flows::Impulses;
use crate::implicit::linear::{Damping, LinearSystem, Linearized, OnDemand, Purpose};
use crate::implicit::moving_frame::MovingFrame;
use crate::implicit::solver_options::Hessian;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, Projection, System, Weights};
use springs_scene::{RunOptions, Tangent};
use springs_solver::{Interrupt, SolveError};

/// (M + hD + h²H) v' = M v + h f, x' = x + h v'.
///
/// Order 1. Eq. 14 with the sign of its matrix put right: with the K of Eq. 8,
/// which is H = +∂²V/∂x², the force gradient is −H. f holds every force but
/// that of the dashpots, which is −D v'; derivatives of D are left out.
///
/// H depends on the [`Tangent`]. With `Exact` and `Filtered` the matrix may be
/// indefinite where springs are compressed; then, and only then, the step is
/// made with negative across stiffness clamped to zero. `Filtered` carries a
/// tension per spring: after each step it becomes K(l − l₀) plus K times the
/// change of length that the step predicted.
pub struct LinearlyImplicitEuler {
    tangent: Tangent,
    linear: LinearSystem,
    frame: MovingFrame,
    n_free: usize,
    /// The right-hand side, then the new velocities; those of fixed blocks.
    velocities: Vec<Vector3<f64>>,
    /// Filtered tensions; only used with that tangent, or where they are kept.
    tensions: Vec<f64>,
    next_tensions: Vec<f64>,
    tensions_are_known: bool,
    impulses: Impulses,
}

impl LinearlyImplicitEuler {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(
        system: &System,
        tangent: Tangent,
        options: &RunOptions,
    ) -> Result<Self, SolveError> {
        let n_tensions = match tangent {
            Tangent::Filtered => system.n_carried(),
            _ => 0,
        };
        Ok(Self {
            tangent,
            linear: LinearSystem::new(system, Hessian::of_tangent(tangent), options)?,
            frame: MovingFrame::new(system),
            n_free: system.n_free(),
            velocities: vec![Vector3::zeros(); system.numbering().n_nodes()],
            tensions: vec![0.0; n_tensions],
            next_tensions: vec![0.0; n_tensions],
            tensions_are_known: false,
            impulses: Impulses::new(system),
        })
    }

    /// Assembles f and M + hD + h²H from the force emitters and solves for the
    /// new velocities, Eq. 14, in a frame that moves along with the system, so that
    /// a solution by iteration is precise relative to the motion within.
    fn velocity_step(
        &mut self,
        system: &System,
        state: &State,
        (h, end): (f64, f64),
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let n_free = system.n_free();
        self.velocities[n_free..].copy_from_slice(&state.v[n_free..]);
        let filtered = self.tangent == Tangent::Filtered;
        if filtered && !self.tensions_are_known {
            system.carried(&state.x, &mut self.tensions);
            self.tensions_are_known = true;
        }
        let (on_demand, projection) = match self.tangent {
            Tangent::Exact | Tangent::Filtered => (OnDemand::Clamp, Projection::None),
            Tangent::Clamped => (OnDemand::Always, Projection::Clamp),
            Tangent::Absolute => (OnDemand::Always, Projection::Absolute),
            Tangent::Material => (OnDemand::Always, Projection::Drop),
        };
        self.frame.enter(system, &state.v);
        let at = Evaluation {
            v: &self.frame.relative,
            projection,
            carried: filtered.then_some(&*self.tensions),
            ..Evaluation::new(&state.x, &state.v, Weights::of_step(h))
        };
        work.counts.force_evaluations += 1;
        let taken = self.linear.linearize_and_solve(
            system,
            Linearized {
                at,
                on_demand,
                purpose: Purpose::Step,
            },
            |out, rhs| {
                system.add_loads(end, &mut out.forces);
                let known = out.forces.iter().zip(&out.anchor_load);
                let momenta = system.masses().iter().zip(&self.frame.relative);
                for ((rhs, (f, load)), (m, v)) in rhs.iter_mut().zip(known).zip(momenta) {
                    *rhs = v * *m + f * h + load;
                }
            },
            &mut self.velocities[..n_free],
            work,
        )?;
        self.frame.leave(&mut self.velocities[..n_free]);
        // The forces that act are the linearized ones, −D v' and f − hH v'.
        self.impulses.begin(system, &state.v);
        self.impulses.add_loads(system, h, end);
        self.impulses
            .add_damping(system, h, &state.x, &self.velocities);
        if self.impulses.anchors_move() {
            let taken = Evaluation {
                v: &state.v,
                ..taken
            };
            let works = self.impulses.anchor_works(system);
            system.add_anchor_works(h, &state.x, &state.v, works);
            system.add_anchor_work_changes(&taken, &self.velocities, works);
        }
        self.impulses.finish(system, &self.velocities);
        Ok(())
    }

    /// x' = x + h v'.
    fn position_step(&self, state: &mut State, h: f64) {
        let moving = state.x.iter_mut().zip(&mut state.v).zip(&self.velocities);
        for ((x, v), new) in moving.take(self.n_free) {
            *v = *new;
            *x += new * h;
        }
    }

    /// T ← K(l − l₀) + K·(the change of l that the new velocities predict),
    /// for the next step.
    fn predict_tensions(&mut self, system: &System, state: &State, h: f64) {
        let next = &mut self.next_tensions;
        system.predict_carried(&state.x, &self.velocities, h, next);
    }
}

impl Method for LinearlyImplicitEuler {
    fn order(&self) -> u32 {
        1
    }

    fn setup(&self) -> Work {
        self.linear.setup()
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.linear.expect_changing_steps(system)
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.linear.set_interrupt(interrupt);
    }

    fn restart(&mut self) {
        self.tensions_are_known = false;
    }

    fn forces_jumped(&mut self, system: &System) {
        if !self.tensions.is_empty() {
            system.clear_broken(&mut self.tensions);
        }
    }

    /// Section 2.1 of the note between collecting the nodes and copying back.
    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let h = interval.size;
        anchors.point_at_end(interval, &state.x, &mut state.v);
        self.velocity_step(system, state, (h, interval.end), work)?;
        if !self.next_tensions.is_empty() {
            self.predict_tensions(system, state, h);
        }
        self.position_step(state, h);
        anchors.place(interval.end, &mut state.x, &mut state.v);
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
            carried: None,
            time_scale,
            passes: 1,
        };
        self.linear
            .damp_vibrations(system, state, damping, [errors], work)
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.linear.archive(archive);
        archive.flag(&mut self.tensions_are_known);
        archive.reals(&mut self.tensions);
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.tensions, &mut self.next_tensions);
    }

    fn keep_tensions(&mut self, system: &System) {
        self.tensions.resize(system.n_carried(), 0.0);
        self.next_tensions.resize(system.n_carried(), 0.0);
    }

    fn tensions(&self) -> Option<&[f64]> {
        (!self.tensions.is_empty()).then_some(&self.tensions)
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }
}
