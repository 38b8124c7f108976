//! Which method and step a scene's settings come down to.

use crate::{LinearlyImplicitEuler, Method, SetupError, VelocityVerlet};
use springs_assembly::System;
use springs_scene::{self as scene, Settings, StepControl, Tangent};

/// Step size where nothing was asked for, in s.
pub const DEFAULT_STEP: f64 = 1.0 / 240.0;

/// Explicit steps are chosen up to this product of step size and frequency (or
/// damping rate) bound: a quarter of Verlet's stability limit.
const EXPLICIT_LIMIT: f64 = 0.5;

/// What a scene is simulated with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The method; never `Auto`.
    pub method: scene::Method,
    /// The tangent, if the method has a matrix.
    pub tangent: Option<Tangent>,
    /// Step size, in s.
    pub step_size: f64,
}

/// Settles what the settings leave open.
///
/// `Auto` is velocity Verlet where the step resolves every motion of the scene,
/// and linearly implicit Euler elsewhere.
///
/// # Errors
///
/// If the settings ask for what no method can do, or the method cannot move
/// the scene.
pub fn choose(system: &System, settings: &Settings) -> Result<Choice, SetupError> {
    let step_size = match settings.step {
        StepControl::Fixed(step) => step,
        StepControl::Auto => DEFAULT_STEP,
        StepControl::Tolerance(_) => return Err(SetupError::NoErrorControl),
    };
    let massless = system.masses().iter().position(|&mass| mass == 0.0);
    let fastest = system.frequency_bound().max(system.damping_rate_bound());
    let method = match settings.method {
        scene::Method::Auto if massless.is_none() && step_size * fastest <= EXPLICIT_LIMIT => {
            scene::Method::VelocityVerlet
        }
        scene::Method::Auto => scene::Method::LinearlyImplicitEuler,
        named => named,
    };
    let tangent = match method {
        scene::Method::LinearlyImplicitEuler => Some(settings.tangent.unwrap_or(Tangent::Exact)),
        _ => None,
    };
    if let (scene::Method::VelocityVerlet, Some(block)) = (method, massless) {
        let node = system.numbering().node(block);
        return Err(SetupError::Massless { node, method });
    }
    Ok(Choice {
        method,
        tangent,
        step_size,
    })
}

impl Choice {
    /// The method, ready to step.
    pub(crate) fn build(&self, system: &System) -> Result<Box<dyn Method>, SetupError> {
        Ok(match self.tangent {
            Some(tangent) => Box::new(LinearlyImplicitEuler::new(system, tangent)?),
            None => Box::new(VelocityVerlet::new(system)),
        })
    }
}
