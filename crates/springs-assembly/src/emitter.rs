//! Force emitters: what gives energy, force and force gradient.

use crate::Linearization;
use nalgebra::Vector3;

/// A batch of terms of one kind. Everything is added to what is there.
///
/// `x` and `v` hold all blocks, in m and m/s.
pub trait ForceEmitter {
    /// Potential energy, in J.
    fn energy(&self, x: &[Vector3<f64>]) -> f64;

    /// Adds the forces on the free blocks, in N.
    fn add_forces(&self, x: &[Vector3<f64>], v: &[Vector3<f64>], forces: &mut [Vector3<f64>]);

    /// Adds forces that do not depend on velocities, `damping`·D and
    /// `stiffness`·H, and what anchors bring, in one pass.
    ///
    /// H = ∂²V/∂x² in N/m; D = −∂f/∂v in N·s/m.
    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization);

    /// Adds the products of `y` with what [`Self::linearize`] adds to the matrix,
    /// term by term: differences of `y` come first, so that uniform motion gives
    /// exactly nothing, however stiff the terms.
    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]);
}

/// Where and how a system is linearized.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation<'a> {
    /// Positions of all blocks, in m.
    pub x: &'a [Vector3<f64>],
    /// Velocities of all blocks, in m/s. Those of fixed blocks give the anchor
    /// load; those of free ones enter only with `dashpot_tension`.
    pub v: &'a [Vector3<f64>],
    /// What becomes of the across stiffness.
    pub projection: Projection,
    /// Tensions of the springs of [`crate::System::springs`], in N, that the
    /// across stiffness T/l is taken from; `None`: their own K(l − l₀).
    pub tensions: Option<&'a [f64]>,
    /// Whether H has the across stiffness c(w·u)/l of dashpots that are being
    /// stretched, the symmetric part of what their forces change by when they
    /// turn (see `springs_math::dashpot::position_block`).
    pub dashpot_tension: bool,
    /// What the matrix is made of.
    pub weights: Weights,
}

/// Coefficients of a system matrix `mass`·M + `damping`·D + `stiffness`·H.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Of the lumped mass M.
    pub mass: f64,
    /// Of the damping matrix D = −∂f/∂v.
    pub damping: f64,
    /// Of the Hessian H = ∂²V/∂x².
    pub stiffness: f64,
}

impl Weights {
    /// H alone, in N/m.
    pub const STIFFNESS: Self = Self {
        mass: 0.0,
        damping: 0.0,
        stiffness: 1.0,
    };

    /// M + hD + h²H, in kg, of a step of size h in s.
    pub fn of_step(h: f64) -> Self {
        Self {
            mass: 1.0,
            damping: h,
            stiffness: h * h,
        }
    }
}

/// What the matrix takes for the stiffness T/l of a spring across itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// T/l: the matrix is exact, and indefinite where springs are compressed.
    None,
    /// max(T/l, 0): positive semidefinite.
    Clamp,
    /// |T/l|: positive semidefinite.
    Absolute,
    /// 0: positive semidefinite.
    Drop,
}

impl Projection {
    /// What becomes of an across stiffness, in N/m.
    #[inline(always)]
    pub(crate) fn apply(self, across: f64) -> f64 {
        match self {
            Self::None => across,
            Self::Clamp => across.max(0.0),
            Self::Absolute => across.abs(),
            Self::Drop => 0.0,
        }
    }
}
