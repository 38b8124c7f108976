//! What a time integration method is.

mod across;
pub(crate) mod dop853;
pub(crate) mod doubling;
pub(crate) mod filtered_leapfrog;
pub(crate) mod implicit_euler;
pub(crate) mod implicit_midpoint;
pub(crate) mod linearly_implicit_euler;
mod passes;
pub(crate) mod rodas4;
pub(crate) mod splitting;
pub(crate) mod stiff_springs;
pub(crate) mod table;
pub(crate) mod tr_bdf2;
pub(crate) mod verlet_pairs;
pub(crate) mod weighing;

use crate::{Anchors, Archive, Flows, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::{Interrupt, Price, SolveError};

/// The time span of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interval {
    /// Time at its start, in s.
    pub start: f64,
    /// Time at its end, in s; start + size up to rounding.
    pub end: f64,
    /// Step size h, in s, exactly as asked for.
    pub size: f64,
}

impl Interval {
    /// Its halves.
    pub(crate) fn halves(&self) -> [Self; 2] {
        let size = 0.5 * self.size;
        let middle = self.start + size;
        let [start, end] = [self.start, self.end];
        [(start, middle), (middle, end)].map(|(start, end)| Self { start, end, size })
    }
}

/// An estimate of the error of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// Rate at which the step adds to the error of positions, in m/s.
    pub rate: f64,
    /// The power of the step size that `rate` is proportional to.
    pub exponent: f64,
    /// The free block where it is largest.
    pub block: usize,
}

impl ErrorEstimate {
    /// The estimate of a result that is one order better than the estimate
    /// itself: rate·(rate/speed)^(1/exponent), where `speed` in m/s says what
    /// a small rate is compared with.
    pub(crate) fn of_better_result(self, speed: f64) -> Self {
        let small = self.rate / speed.max(f64::MIN_POSITIVE);
        Self {
            rate: self.rate * small.powf(1.0 / self.exponent).min(1.0),
            exponent: self.exponent + 1.0,
            ..self
        }
    }
}

/// A one-step method for M dv/dt = f(x, v), dx/dt = v.
///
/// A method owns its workspace and allocates nothing in [`Self::step`] once it
/// is warm. It may carry something (a tension, an acceleration) from step to
/// step; [`Self::restart`] tells it that the state was changed from outside.
pub trait Method: Send {
    /// Order of consistency.
    fn order(&self) -> u32;

    /// What its construction took, such as a symbolic factorization.
    fn setup(&self) -> Work {
        Work::default()
    }

    /// Says, before the first step, that steps will be of changing size, for which
    /// other ways to solve may pay.
    ///
    /// # Errors
    ///
    /// If there is not enough memory for these.
    fn expect_changing_steps(&mut self, _system: &System) -> Result<(), SolveError> {
        Ok(())
    }

    /// Steps that are chosen by the error are no longer than this, in s: beyond it the
    /// estimate cannot be relied on.
    fn longest_step(&self, _system: &System) -> f64 {
        f64::INFINITY
    }

    /// What a matrix and its solution will cost in steps of size `h` in s, where the matrix
    /// has fewer terms than the system.
    fn price_at(&mut self, _system: &System, _h: f64) -> Option<Price> {
        None
    }

    /// How large vibrations are, in m, that positions do not show, because they were left out at
    /// the start or steps do not resolve them: about, and not less. Asked after a step
    /// that was accepted. `None` where the method does not know.
    ///
    /// # Errors
    ///
    /// If a system of equations cannot be solved.
    fn left_out(&mut self, _system: &System, _work: &mut Work) -> Result<Option<f64>, MethodError> {
        Ok(None)
    }

    /// Whom to hear during a step that may take long: asked to stop, it ends soon
    /// with [`MethodError::Interrupted`].
    fn set_interrupt(&mut self, _interrupt: &Interrupt) {}

    /// Forgets what is carried; the next step starts from positions and
    /// velocities alone.
    fn restart(&mut self);

    /// Forces jumped at the end of the last step that stands, since somebody changed them:
    /// those known there are stale.
    fn forces_jumped(&mut self, _system: &System) {
        self.restart();
    }

    /// The same where springs broke: what is carried of these is
    /// [zero](System::clear_broken).
    fn springs_broke(&mut self, system: &System) {
        self.forces_jumped(system);
    }

    /// Advances the free blocks of `state` over `interval`, puts the fixed ones
    /// where `anchors` has them at its end, and adds what it did to `work`.
    /// `state.time` is the caller's.
    ///
    /// What is carried stays as it was until [`Self::accept`], so that the step
    /// can be made again with another size.
    ///
    /// # Errors
    ///
    /// If the step cannot be made; `state` is then undefined.
    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError>;

    /// For methods with a matrix: replaces errors of velocities e, in m/s, by
    /// what the springs and dashpots leave of them after a time `time_scale` = τ
    /// in s, (M + τD + τ²S)⁻¹M e, and says that it did. Errors of vibrations faster
    /// than τ become small, however long they ring.
    fn damp_vibrations(
        &mut self,
        _system: &System,
        _state: &State,
        _time_scale: f64,
        _errors: &mut [Vector3<f64>],
        _work: &mut Work,
    ) -> bool {
        false
    }

    /// A costlier and sharper estimate of the error of the last step, asked for
    /// when the first one would reject it; `None` if there is no better one.
    fn second_estimate(
        &mut self,
        _system: &System,
        _state: &State,
        _work: &mut Work,
    ) -> Option<ErrorEstimate> {
        None
    }

    /// What [`Self::second_estimate`] of the last step will not be below; `None` if that is
    /// not known.
    fn least_estimate(&self) -> Option<ErrorEstimate> {
        None
    }

    /// Hands over everything that it carries from step to step, always in the
    /// same order; what a step makes anew need not be there. A method without
    /// this cannot be stopped and resumed.
    fn archive(&mut self, archive: &mut Archive);

    /// The last step stands; the next one starts at its end.
    fn accept(&mut self);

    /// Asked before the first step to keep the tensions at the ends of steps, for
    /// [`Self::tensions`].
    fn keep_tensions(&mut self, _system: &System) {}

    /// What [`System::carried`] gives, as the method took it at the end of the last
    /// step; `None` where that is what the positions say.
    fn tensions(&self) -> Option<&[f64]> {
        None
    }

    /// Heat of dashpots, and work of anchors and loads, in the last step, with the weights
    /// that the method itself gave to the forces of its stages, so that the
    /// energy ledger closes to the method's order. `None`: the ledger takes the
    /// trapezoidal rule over the step.
    fn flows(&self) -> Option<&Flows> {
        None
    }

    /// Kinetic energy of the free blocks at the end of the last step, in J, if the method
    /// found it on its way, and that and the squares of all positions and velocities there
    /// are finite numbers. `None`: it is computed from the state.
    fn kinetic_energy(&self) -> Option<f64> {
        None
    }
}

/// The time, in s, over which an error of velocities grows into one of
/// positions: the one in which the motion itself changes, speed/acceleration,
/// but no less than a step and no more than [`LONGEST_TIME_SCALE`]. `speed` is a
/// [`crate::vectors::spread`], so that it is the same in every frame of reference.
pub(crate) fn time_scale(speed: f64, acceleration: f64, h: f64) -> f64 {
    let changing = speed / acceleration.max(f64::MIN_POSITIVE);
    changing.clamp(h, LONGEST_TIME_SCALE * h)
}

/// In steps.
const LONGEST_TIME_SCALE: f64 = 1e3;
