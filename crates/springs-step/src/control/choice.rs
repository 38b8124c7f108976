//! What a scene is simulated with.

use crate::implicit::solver_options::{self, Hessian};
use crate::method::table::{Properties, ToleranceKind, properties};
use crate::{Method, SetupError};
use springs_assembly::System;
use springs_scene::{self as scene, RunOptions, Settings, Tangent};

/// What a scene is simulated with.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Choice {
    /// The method; `Auto` only before trial runs have found one.
    pub method: scene::Method,
    /// The tangent, if the method has a choice of it.
    pub tangent: Option<Tangent>,
    /// How steps are chosen.
    pub pace: Pace,
    /// Simulated time, in s, that a tolerance is shared out over.
    pub duration: f64,
    /// How it is run.
    pub options: RunOptions,
    /// Why, where the settings left it open; else empty.
    pub reason: String,
}

/// How steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// All of this size, in s.
    Fixed(f64),
    /// From the error, which must stay below this, in m.
    Tolerance(f64),
}

impl Choice {
    /// What the settings say.
    pub(crate) fn open(settings: &Settings, options: &RunOptions, pace: Pace) -> Self {
        Self {
            method: settings.method,
            tangent: settings.tangent,
            pace,
            duration: settings.duration,
            options: *options,
            reason: String::new(),
        }
    }

    /// What is known of the method; `None` while it is left open.
    pub fn properties(&self) -> Option<&'static Properties> {
        properties(self.method)
    }

    /// The method, ready to step; with an error estimate if steps are chosen
    /// from the error.
    pub(crate) fn build(&self, system: &System) -> Result<Box<dyn Method>, SetupError> {
        let row = self.properties().expect("settled before it is built");
        Ok(row.build(system, self)?)
    }

    /// Whether a tolerance means steps of equal size from trial runs.
    pub(crate) fn wants_equal_steps(&self) -> bool {
        let row = self.properties();
        row.is_some_and(|row| row.tolerance == ToleranceKind::EqualSteps)
    }

    /// Whether the method is left to trial runs that were not made yet.
    pub(crate) fn is_open(&self) -> bool {
        self.method == scene::Method::Auto
    }

    /// Whether it is known that a step solves no system.
    pub(crate) fn is_explicit(&self) -> bool {
        self.properties().is_some_and(Properties::is_explicit)
    }

    /// Whether there is a matrix.
    pub fn has_matrix(&self) -> bool {
        self.hessian().is_some()
    }

    /// Whether there is a matrix that depends on nothing but the step size.
    pub fn has_constant_matrix(&self, system: &System) -> bool {
        let hessian = self.hessian();
        hessian.is_some_and(|hessian| solver_options::is_constant(system, hessian))
    }

    /// Whether there is a matrix whose blocks are multiples of the identity.
    pub fn has_isotropic_matrix(&self, system: &System) -> bool {
        let hessian = self.hessian();
        hessian.is_some_and(|hessian| solver_options::is_isotropic(system, hessian))
    }

    fn hessian(&self) -> Option<Hessian> {
        self.properties()?.hessian(self.tangent)
    }
}
