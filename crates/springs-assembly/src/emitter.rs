//! Force emitters: what gives energy, force and force gradient.

use crate::BlockMatrix;
use nalgebra::Vector3;

/// A batch of terms of one kind.
///
/// `x` and `v` hold all blocks, in m and m/s; `forces` and `matrix` the free
/// ones. Everything is added to what is there.
pub trait ForceEmitter {
    /// Potential energy, in J.
    fn energy(&self, x: &[Vector3<f64>]) -> f64;

    /// Adds the forces on the free blocks, in N.
    fn add_forces(&self, x: &[Vector3<f64>], v: &[Vector3<f64>], forces: &mut [Vector3<f64>]);

    /// Adds `weights.stiffness`·H + `weights.damping`·D of the free blocks.
    ///
    /// H = ∂²V/∂x² in N/m; D = −∂f/∂v in N·s/m.
    fn add_matrix(&self, x: &[Vector3<f64>], weights: Weights, matrix: &mut BlockMatrix);
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
