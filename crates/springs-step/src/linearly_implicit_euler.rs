//! Linearly implicit Euler: the step of the note, Eqs. 10–14.

use crate::work::timed;
use crate::{Anchors, Interval, Method, MethodError, Quadrature, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Linearization, Projection, System, Weights};
use springs_scene::Tangent;
use springs_solver::{SolveError, SparseCholesky};

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
    cholesky: SparseCholesky,
    linearization: Linearization,
    /// The right-hand side, then the new velocities of the free blocks.
    velocities: Vec<Vector3<f64>>,
    /// Filtered tensions; only used with that tangent.
    tensions: Vec<f64>,
    tensions_are_known: bool,
}

impl LinearlyImplicitEuler {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System, tangent: Tangent) -> Result<Self, SolveError> {
        let n_tensions = match tangent {
            Tangent::Filtered => system.springs().len(),
            _ => 0,
        };
        Ok(Self {
            tangent,
            cholesky: SparseCholesky::analyze(system.n_free(), system.pattern().pairs())?,
            linearization: system.linearization(),
            velocities: vec![Vector3::zeros(); system.n_free()],
            tensions: vec![0.0; n_tensions],
            tensions_are_known: false,
        })
    }

    fn tensions(&self) -> Option<&[f64]> {
        (self.tangent == Tangent::Filtered).then_some(&*self.tensions)
    }

    /// f, and M + hD + h²H, from the force emitters.
    fn assemble(&mut self, system: &System, state: &State, h: f64, projection: Projection) {
        if self.tangent == Tangent::Filtered && !self.tensions_are_known {
            system.springs().tensions(&state.x, &mut self.tensions);
            self.tensions_are_known = true;
        }
        system.linearize(
            &state.x,
            &state.v,
            projection,
            (self.tangent == Tangent::Filtered).then_some(&*self.tensions),
            Weights::of_step(h),
            &mut self.linearization,
        );
    }

    fn factorize(&mut self) -> Result<(), SolveError> {
        let matrix = &self.linearization.matrix;
        self.cholesky
            .factorize(matrix.diagonal(), matrix.off_diagonal())
    }

    /// Solves for the new velocities, Eq. 14.
    fn velocity_step(
        &mut self,
        system: &System,
        state: &State,
        h: f64,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let mut factorized = timed(&mut work.phases.factorization, || self.factorize());
        work.counts.factorizations += 1;
        if factorized.is_err() && matches!(self.tangent, Tangent::Exact | Tangent::Filtered) {
            timed(&mut work.phases.assembly, || {
                self.assemble(system, state, h, Projection::Clamp);
            });
            let clamped = system.springs().count_compressed(&state.x, self.tensions());
            work.counts.clamped_springs += clamped as u64;
            factorized = timed(&mut work.phases.factorization, || self.factorize());
            work.counts.factorizations += 1;
        }
        match factorized {
            Ok(()) => {}
            Err(SolveError::NotPositiveDefinite { block }) => {
                return Err(MethodError::NotPositiveDefinite { block });
            }
            Err(other) => unreachable!("a numeric factorization does not report: {other}"),
        }
        timed(&mut work.phases.solve, || {
            let Linearization {
                forces,
                anchor_load,
                ..
            } = &self.linearization;
            let known = forces.iter().zip(anchor_load);
            let momenta = system.masses().iter().zip(&state.v);
            for ((rhs, (f, load)), (m, v)) in self.velocities.iter_mut().zip(known).zip(momenta) {
                *rhs = v * *m + f * h + load;
            }
            self.cholesky
                .solve_in_place(bytemuck::cast_slice_mut(&mut self.velocities));
        });
        work.counts.solves += 1;
        Ok(())
    }

    /// x' = x + h v'.
    fn position_step(&mut self, state: &mut State, h: f64) {
        let new = self.velocities.iter();
        for ((x, v), new) in state.x.iter_mut().zip(&mut state.v).zip(new) {
            *v = *new;
            *x += new * h;
        }
    }

    /// T ← K(l − l₀) + K·(the change of l that the new velocities predict).
    fn carry_tensions(&mut self, system: &System, state: &mut State, h: f64) {
        state.v[..self.velocities.len()].copy_from_slice(&self.velocities);
        system
            .springs()
            .predict_tensions(&state.x, &state.v, h, &mut self.tensions);
    }
}

impl Method for LinearlyImplicitEuler {
    fn order(&self) -> u32 {
        1
    }

    fn restart(&mut self) {
        self.tensions_are_known = false;
    }

    /// Section 2.1 of the note between collecting the nodes and copying back.
    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let h = interval.size;
        let projection = match self.tangent {
            Tangent::Exact | Tangent::Filtered => Projection::None,
            Tangent::Clamped => Projection::Clamp,
            Tangent::Absolute => Projection::Absolute,
            Tangent::Material => Projection::Drop,
        };
        timed(&mut work.phases.assembly, || {
            self.assemble(system, state, h, projection);
        });
        work.counts.force_evaluations += 1;
        self.velocity_step(system, state, h, work)?;
        if self.tangent == Tangent::Filtered {
            self.carry_tensions(system, state, h);
        }
        self.position_step(state, h);
        anchors.place(interval.end, &mut state.x);
        Ok(())
    }

    fn quadrature(&self) -> Quadrature {
        Quadrature::END
    }
}
