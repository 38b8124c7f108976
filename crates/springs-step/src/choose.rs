//! Which method and step a scene's settings come down to.

use crate::auto::{Auto, Picked};
use crate::controller::Controller;
use crate::dop853::Dop853;
use crate::doubling::Doubling;
use crate::filtered_leapfrog::FilteredLeapfrog;
use crate::implicit_euler::ImplicitEuler;
use crate::implicit_midpoint::ImplicitMidpoint;
use crate::linear::{self, Hessian};
use crate::rodas4::Rodas4;
use crate::tr_bdf2::TrBdf2;
use crate::trials::{EqualSteps, Trials, Unsettled, equal_steps};
use crate::{Anchors, LinearlyImplicitEuler, Method, SetupError, Splitting, StepPlan};
use springs_assembly::System;
use springs_scene::{self as scene, Scene, StepControl, Tangent};

/// The tolerance where nothing was asked for, as a fraction of the scene's
/// size.
const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Explicit steps of fixed size are chosen up to this product of step size and
/// frequency (or damping rate) bound: half of Verlet's stability limit.
const EXPLICIT_LIMIT: f64 = 1.0;

/// Trial runs for equal steps that were asked for end here.
const MOST_TRIAL_STEPS: f64 = 1e7;

/// What a scene is simulated with.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The method; `Auto` only before trial runs have found one.
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

/// The choice where nothing needs to be tried out: all but `Auto` with a
/// tolerance.
fn settle(
    scene: &Scene,
    system: &System,
    pace: Pace,
    schedule: &Schedule,
) -> Result<Choice, SetupError> {
    let mut choice = Choice::open(scene, pace);
    if let (scene::Method::Auto, Schedule::Fixed(plan)) = (choice.method, schedule) {
        pick_for_step(&mut choice, system, plan.step_size);
    }
    if let StepControl::Fixed(step) = scene.settings.step
        && pace != Pace::Fixed(step)
    {
        choice.reason = format!("steps of {step:?} s made equal: the last one cannot be shorter");
    }
    match choice.method {
        scene::Method::LinearlyImplicitEuler => {
            choice.tangent.get_or_insert(Tangent::Exact);
        }
        _ => refuse_tangent(&choice)?,
    }
    can_move(scene, system, choice.method)?;
    Ok(choice)
}

/// What the settings of a scene come to.
///
/// Without a step, a tolerance of 1e-3 of the scene's size is meant. With a
/// fixed step, `Auto` is velocity Verlet where the step resolves the fastest
/// motion of the scene, and linearly implicit Euler with filtered tensions
/// elsewhere. With a tolerance, methods are tried out on the scene before the
/// first step, and the cheapest one is taken.
pub(crate) struct Start {
    pub(crate) choice: Choice,
    pub(crate) method: Box<dyn Method>,
    pub(crate) schedule: Schedule,
    /// Chooses methods, if that is left open.
    pub(crate) auto: Option<Auto>,
}

/// Where the next step comes from.
pub(crate) enum Schedule {
    Fixed(StepPlan),
    Adaptive(Controller),
    /// Trial runs settle it before the first step; so far nothing moves. The
    /// controller is what the tolerance would begin with.
    Open(Controller),
}

impl Start {
    /// A method of somebody's own, which has no name.
    pub(crate) fn with_method(scene: &Scene, system: &System, method: Box<dyn Method>) -> Self {
        let (pace, schedule) = pace_of(scene, system);
        Self {
            choice: Choice::open(scene, pace),
            method,
            schedule,
            auto: None,
        }
    }
}

/// How steps are chosen; with a tolerance, by a controller.
fn pace_of(scene: &Scene, system: &System) -> (Pace, Schedule) {
    let settings = &scene.settings;
    let duration = settings.duration;
    let tolerance = match settings.step {
        StepControl::Fixed(step) => {
            let mut plan = StepPlan::new(duration, step);
            if plan.shortened.is_some() && keeps_its_step(settings.method) {
                plan = StepPlan::equal(duration, plan.n_steps());
            }
            return (Pace::Fixed(plan.step_size), Schedule::Fixed(plan));
        }
        StepControl::Tolerance(tolerance) => tolerance,
        StepControl::Auto => default_tolerance(scene),
    };
    let first_step = first_step(duration, system.frequency_bound());
    let controller = Controller::new(tolerance, duration, first_step);
    (Pace::Tolerance(tolerance), Schedule::Adaptive(controller))
}

/// The tolerance, in m, where nothing was asked for.
fn default_tolerance(scene: &Scene) -> f64 {
    match scene.size() {
        size if size > 0.0 => DEFAULT_TOLERANCE * size,
        _ => DEFAULT_TOLERANCE,
    }
}

/// What a scene starts with; nothing is tried out yet.
pub(crate) fn start(scene: &Scene, system: &System) -> Result<Start, SetupError> {
    let (pace, schedule) = pace_of(scene, system);
    let needs_trials = |controller: &Controller| controller.left() > 0.0;
    if let (scene::Method::Auto, Schedule::Adaptive(controller)) =
        (scene.settings.method, &schedule)
    {
        let choice = Choice::open(scene, pace);
        refuse_tangent(&choice)?;
        let mut auto = Auto::new(scene, system, &choice);
        if needs_trials(controller) {
            return Ok(Start {
                choice,
                // Stands in until trial runs have found one.
                method: Box::new(Splitting::velocity_verlet(system)),
                schedule: Schedule::Open(*controller),
                auto: Some(auto),
            });
        }
        let Picked { method, choice, .. } = auto.first(system)?;
        return Ok(Start {
            choice,
            method,
            schedule,
            auto: Some(auto),
        });
    }
    let choice = settle(scene, system, pace, &schedule)?;
    let schedule = match schedule {
        Schedule::Adaptive(controller)
            if choice.wants_equal_steps() && needs_trials(&controller) =>
        {
            Schedule::Open(controller)
        }
        settled => settled,
    };
    Ok(Start {
        method: choice.build(system)?,
        choice,
        schedule,
        auto: None,
    })
}

/// Finds out by trial runs how many equal steps a method needs.
pub(crate) fn settle_equal_steps(
    compiled: (&System, &Anchors),
    method: &mut dyn Method,
    controller: &Controller,
    trials: &mut Trials<'_>,
) -> Result<EqualSteps, Unsettled> {
    let task = (controller.left(), controller.tolerance());
    let steps = equal_steps(compiled, method, task, MOST_TRIAL_STEPS, trials)?;
    method.restart();
    steps.ok_or(Unsettled::NotReached)
}

/// Whether all steps of a method must have one size, the last one included:
/// what stiff springs hold would be let go by a shorter one.
pub(crate) fn keeps_its_step(method: scene::Method) -> bool {
    method == scene::Method::FilteredLeapfrog
}

/// A first step that is short for anything the scene can do; the controller
/// lengthens it quickly.
fn first_step(duration: f64, fastest: f64) -> f64 {
    let resolving = 0.1 / fastest;
    (duration / 100.0).min(resolving.max(1e-6 * duration))
}

fn refuse_tangent(choice: &Choice) -> Result<(), SetupError> {
    match choice.tangent {
        Some(_) => Err(SetupError::NoTangent {
            method: choice.method,
        }),
        None => Ok(()),
    }
}

/// Refuses what a method cannot treat.
pub(crate) fn can_move(
    scene: &Scene,
    system: &System,
    method: scene::Method,
) -> Result<(), SetupError> {
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
    if let (true, Some((_, emitter))) = (without_dashpots, system.damped().next()) {
        let emitter = emitter.name().to_owned();
        return Err(SetupError::Damped { emitter, method });
    }
    Ok(())
}

/// Method and tangent for steps of fixed size.
fn pick_for_step(choice: &mut Choice, system: &System, h: f64) {
    let fastest = system.frequency_bound().max(system.damping_rate_bound());
    let angle = h * fastest;
    let is_explicit = angle <= EXPLICIT_LIMIT && !system.masses().contains(&0.0);
    choice.reason = match () {
        _ if is_explicit => format!("the step resolves the fastest motion, h·ω ≤ {angle:.2}"),
        _ if angle <= EXPLICIT_LIMIT => "a massless node has no explicit motion".to_owned(),
        _ => format!("the step does not resolve the fastest motion, h·ω ≤ {angle:.1}"),
    };
    match is_explicit {
        true => choice.method = scene::Method::VelocityVerlet,
        false => {
            choice.method = scene::Method::LinearlyImplicitEuler;
            choice.tangent.get_or_insert(Tangent::Filtered);
        }
    }
}

impl Choice {
    /// What the settings say.
    fn open(scene: &Scene, pace: Pace) -> Self {
        Self {
            method: scene.settings.method,
            tangent: scene.settings.tangent,
            pace,
            duration: scene.settings.duration,
            reason: String::new(),
        }
    }

    /// The method, ready to step; with an error estimate if steps are chosen
    /// from the error.
    pub(crate) fn build(&self, system: &System) -> Result<Box<dyn Method>, SetupError> {
        let mut method = self.build_for_equal_steps(system)?;
        if self.changes_steps() {
            method.expect_changing_steps(system)?;
        }
        Ok(method)
    }

    /// Whether steps are chosen one by one.
    fn changes_steps(&self) -> bool {
        matches!(self.pace, Pace::Tolerance(_)) && !self.wants_equal_steps()
    }

    fn build_for_equal_steps(&self, system: &System) -> Result<Box<dyn Method>, SetupError> {
        let method: Box<dyn Method> = match self.method {
            scene::Method::Auto => unreachable!("settled before it is built"),
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
                    Pace::Tolerance(tolerance) => method.with_tolerance(tolerance, self.duration),
                }));
            }
        };
        Ok(if self.changes_steps() {
            Box::new(Doubling::new(system, method))
        } else {
            method
        })
    }

    /// Whether a tolerance means steps of equal size from trial runs: for
    /// methods that do not damp vibrations they do not resolve, which a change
    /// of step would excite.
    pub(crate) fn wants_equal_steps(&self) -> bool {
        matches!(
            self.method,
            scene::Method::ImplicitMidpoint | scene::Method::FilteredLeapfrog
        )
    }

    /// Whether the method is left to trial runs that were not made yet.
    pub(crate) fn is_open(&self) -> bool {
        self.method == scene::Method::Auto
    }

    /// Whether a step solves no system.
    pub(crate) fn is_explicit(&self) -> bool {
        matches!(
            self.method,
            scene::Method::VelocityVerlet
                | scene::Method::BlanesMoan4
                | scene::Method::BlanesMoan6
                | scene::Method::Dop853
        )
    }

    /// Whether there is a matrix.
    pub fn has_matrix(&self) -> bool {
        self.hessian().is_some()
    }

    /// Whether there is a matrix that depends on nothing but the step size.
    pub fn has_constant_matrix(&self, system: &System) -> bool {
        let hessian = self.hessian();
        hessian.is_some_and(|hessian| linear::is_constant(system, hessian))
    }

    /// Whether there is a matrix whose blocks are multiples of the identity.
    pub fn has_isotropic_matrix(&self, system: &System) -> bool {
        let hessian = self.hessian();
        hessian.is_some_and(|hessian| linear::is_isotropic(system, hessian))
    }

    /// What the method's matrix has, if there is one.
    fn hessian(&self) -> Option<Hessian> {
        match self.method {
            scene::Method::LinearlyImplicitEuler => {
                Some(Hessian::of_tangent(self.tangent.unwrap_or(Tangent::Exact)))
            }
            scene::Method::ImplicitEuler
            | scene::Method::ImplicitMidpoint
            | scene::Method::TrBdf2 => Some(Hessian::Exact),
            scene::Method::FilteredLeapfrog => Some(Hessian::Altered),
            scene::Method::Rodas4 => Some(Hessian::Unclamped),
            _ => None,
        }
    }
}
