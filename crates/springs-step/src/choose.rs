//! Which method and step a scene's settings come down to.

use crate::dop853::Dop853;
use crate::doubling::Doubling;
use crate::filtered_leapfrog::FilteredLeapfrog;
use crate::implicit_euler::ImplicitEuler;
use crate::implicit_midpoint::ImplicitMidpoint;
use crate::rodas4::Rodas4;
use crate::tr_bdf2::TrBdf2;
use crate::{LinearlyImplicitEuler, Method, SetupError, Splitting};
use springs_assembly::System;
use springs_scene::{self as scene, Scene, StepControl, Tangent};
use springs_solver::SparseCholesky;

/// The tolerance where nothing was asked for, as a fraction of the scene's
/// size.
const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Explicit steps of fixed size are chosen up to this product of step size and
/// frequency (or damping rate) bound: a quarter of Verlet's stability limit.
const EXPLICIT_LIMIT: f64 = 0.5;

/// What a scene is simulated with.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The method; never `Auto`.
    pub method: scene::Method,
    /// The tangent, if the method has a choice of it.
    pub tangent: Option<Tangent>,
    /// How steps are chosen.
    pub pace: Pace,
    /// Simulated time, in s, that a tolerance is shared out over.
    pub duration: f64,
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

/// Settles what the settings leave open.
///
/// Without a step, a tolerance of 1e-3 of the scene's size is meant. `Auto` is
/// velocity Verlet or DOP853 where the fastest motion of the scene is worth
/// following, and TR-BDF2 or, with a fixed step, linearly implicit Euler with
/// filtered tensions elsewhere.
///
/// # Errors
///
/// If the method cannot move the scene.
pub fn choose(scene: &Scene, system: &System) -> Result<Choice, SetupError> {
    let settings = &scene.settings;
    let pace = match settings.step {
        StepControl::Fixed(step) => Pace::Fixed(step),
        StepControl::Tolerance(tolerance) => Pace::Tolerance(tolerance),
        StepControl::Auto => Pace::Tolerance(match scene.size() {
            size if size > 0.0 => DEFAULT_TOLERANCE * size,
            _ => DEFAULT_TOLERANCE,
        }),
    };
    let (method, tangent, reason) = match settings.method {
        scene::Method::Auto => pick(scene, system, pace)?,
        named => (named, None, String::new()),
    };
    let tangent = match method {
        scene::Method::LinearlyImplicitEuler => {
            Some(settings.tangent.or(tangent).unwrap_or(Tangent::Exact))
        }
        _ => None,
    };
    if let (Some(_), None) = (settings.tangent, tangent) {
        return Err(SetupError::NoTangent { method });
    }
    refuse(scene, system, method)?;
    Ok(Choice {
        method,
        tangent,
        pace,
        duration: settings.duration,
        reason,
    })
}

/// Refuses what a method cannot treat.
fn refuse(scene: &Scene, system: &System, method: scene::Method) -> Result<(), SetupError> {
    let divides_by_mass = matches!(
        method,
        scene::Method::VelocityVerlet
            | scene::Method::BlanesMoan4
            | scene::Method::BlanesMoan6
            | scene::Method::Dop853
            | scene::Method::Rodas4
    );
    let massless = system.masses().iter().position(|&mass| mass == 0.0);
    if let (true, Some(block)) = (divides_by_mass, massless) {
        let node = system.numbering().node(block);
        return Err(SetupError::Massless { node, method });
    }
    let without_dashpots = matches!(
        method,
        scene::Method::BlanesMoan4 | scene::Method::BlanesMoan6 | scene::Method::Rodas4
    );
    let damped = scene.springs.iter().position(|spring| spring.damping > 0.0);
    if let (true, Some(spring)) = (without_dashpots, damped) {
        return Err(SetupError::VelocityDependent { spring, method });
    }
    Ok(())
}

type Picked = (scene::Method, Option<Tangent>, String);

fn pick(scene: &Scene, system: &System, pace: Pace) -> Result<Picked, SetupError> {
    let fastest = system.frequency_bound().max(system.damping_rate_bound());
    if system.masses().contains(&0.0) {
        let why = "a massless node has no explicit motion".to_owned();
        return Ok(match pace {
            Pace::Fixed(_) => (
                scene::Method::LinearlyImplicitEuler,
                Some(Tangent::Filtered),
                why,
            ),
            Pace::Tolerance(_) => (scene::Method::TrBdf2, None, why),
        });
    }
    let picked = match pace {
        Pace::Fixed(h) if h * fastest <= EXPLICIT_LIMIT => (
            scene::Method::VelocityVerlet,
            None,
            format!(
                "the step resolves the fastest motion, h·ω ≤ {:.2}",
                h * fastest
            ),
        ),
        Pace::Fixed(h) => (
            scene::Method::LinearlyImplicitEuler,
            Some(Tangent::Filtered),
            format!(
                "the step does not resolve the fastest motion, h·ω ≤ {:.1}",
                h * fastest
            ),
        ),
        Pace::Tolerance(tolerance) => {
            let (explicit, implicit) = (
                explicit_work(system, scene, fastest),
                implicit_work(scene, system, tolerance)?,
            );
            let (method, which) = match explicit <= implicit {
                true => (scene::Method::Dop853, "explicit"),
                false => (scene::Method::TrBdf2, "implicit"),
            };
            let why = format!(
                "{which} steps cost less: about {:.1e} operations explicit, {:.1e} implicit",
                explicit, implicit
            );
            (method, None, why)
        }
    };
    Ok(picked)
}

/// Operations that forces of one spring take.
const FORCE: f64 = 40.0;
/// Operations that forces and matrix blocks of one spring take.
const LINEARIZATION: f64 = 120.0;
/// Dense kernels of a factorization do so many more operations in a time.
const DENSE_GAIN: f64 = 4.0;
/// Newton iterations of a stage.
const ITERATIONS: f64 = 3.0;
/// DOP853 takes steps of about this angle of the fastest motion.
const DOP853_ANGLE: f64 = 4.5;

/// Operations of DOP853 for the duration, at its stability limit.
fn explicit_work(system: &System, scene: &Scene, fastest: f64) -> f64 {
    let steps = (scene.settings.duration * fastest / DOP853_ANGLE).max(10.0);
    steps * 12.0 * FORCE * springs(system)
}

/// Operations of TR-BDF2 for the duration: steps from the error constant of the
/// method and the accelerations at the start.
fn implicit_work(scene: &Scene, system: &System, tolerance: f64) -> Result<f64, SetupError> {
    let flops = SparseCholesky::count_flops(system.n_free(), system.pattern().pairs())?;
    let mut forces = system.linearization().forces;
    let (x, v) = (system.initial_positions(), system.initial_velocities());
    system.forces(x, v, &mut forces);
    let accelerations = forces.iter().zip(system.masses());
    let acceleration = accelerations
        .filter(|(_, mass)| **mass > 0.0)
        .map(|(force, mass)| force.norm() / mass)
        .fold(scene.gravity.norm(), f64::max);
    let duration = scene.settings.duration;
    let time_scale = (scene.size() / acceleration).sqrt();
    let h = (25.0 * tolerance * time_scale / (acceleration * duration)).sqrt();
    let steps = if h > 0.0 {
        (duration / h).max(10.0)
    } else {
        10.0
    };
    let iteration = flops / DENSE_GAIN + LINEARIZATION * springs(system);
    Ok(steps * 2.0 * ITERATIONS * iteration)
}

fn springs(system: &System) -> f64 {
    system.springs().len().max(1) as f64
}

impl Choice {
    /// The method, ready to step; with an error estimate if steps are chosen
    /// from the error.
    pub(crate) fn build(&self, system: &System) -> Result<Box<dyn Method>, SetupError> {
        let method: Box<dyn Method> = match self.method {
            scene::Method::Auto => unreachable!("settled by choose"),
            scene::Method::LinearlyImplicitEuler => {
                let tangent = self.tangent.unwrap_or(Tangent::Exact);
                Box::new(LinearlyImplicitEuler::new(system, tangent)?)
            }
            scene::Method::ImplicitEuler => Box::new(ImplicitEuler::new(system)?),
            scene::Method::ImplicitMidpoint => Box::new(ImplicitMidpoint::new(system)?),
            scene::Method::VelocityVerlet => Box::new(Splitting::velocity_verlet(system)),
            scene::Method::BlanesMoan4 => Box::new(Splitting::blanes_moan_4(system)),
            scene::Method::BlanesMoan6 => Box::new(Splitting::blanes_moan_6(system)),
            scene::Method::FilteredLeapfrog => Box::new(FilteredLeapfrog::new(system)?),
            scene::Method::Rodas4 => return Ok(Box::new(Rodas4::new(system)?)),
            scene::Method::Dop853 => return Ok(Box::new(Dop853::new(system))),
            scene::Method::TrBdf2 => {
                let method = TrBdf2::new(system)?;
                return Ok(Box::new(match self.pace {
                    Pace::Fixed(_) => method,
                    Pace::Tolerance(tolerance) => {
                        method.with_accuracy(STAGE_ACCURACY * tolerance / self.duration)
                    }
                }));
            }
        };
        Ok(match self.pace {
            Pace::Fixed(_) => method,
            Pace::Tolerance(_) => Box::new(Doubling::new(system, method)),
        })
    }

    /// Whether a matrix is factorized.
    pub fn has_matrix(&self) -> bool {
        matches!(
            self.method,
            scene::Method::LinearlyImplicitEuler
                | scene::Method::ImplicitEuler
                | scene::Method::ImplicitMidpoint
                | scene::Method::TrBdf2
                | scene::Method::FilteredLeapfrog
                | scene::Method::Rodas4
        )
    }
}

/// The part of the tolerance that stages may be off by.
const STAGE_ACCURACY: f64 = 0.03;
