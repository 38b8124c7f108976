//! Which method and step a scene's settings come down to.

use crate::control::auto::{Auto, Picked};
use crate::control::controller::{Controller, Schedule};
use crate::control::costs::CostModel;
use crate::control::trials::{Budget, EqualSteps, Trials, Unsettled, equal_steps};
use crate::method::stiff_springs::is_of_one_kind;
use crate::method::table::properties;
use crate::{Anchors, Choice, Method, Pace, SetupError, Splitting, StepPlan};
use springs_assembly::System;
use springs_scene::{self as scene, RunOptions, Scene, Settings, StepControl, Tangent};

/// The tolerance where nothing was asked for, as a fraction of the scene's
/// size.
const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Explicit steps of fixed size are chosen up to this product of step size and
/// frequency (or damping rate) bound: half of Verlet's stability limit.
const EXPLICIT_LIMIT: f64 = 1.0;

/// Trial runs for equal steps that were asked for end here.
const MOST_TRIAL_STEPS: f64 = 1e7;

/// The choice where nothing needs to be tried out: all but `Auto` with a
/// tolerance.
fn settle(
    scene: &Scene,
    asked: StepControl,
    system: &System,
    mut choice: Choice,
    schedule: &Schedule,
) -> Result<Choice, SetupError> {
    if let (scene::Method::Auto, Schedule::Fixed(plan)) = (choice.method, schedule) {
        pick_for_step(&mut choice, system, plan.step_size);
    }
    if let StepControl::Fixed(step) = asked
        && choice.pace != Pace::Fixed(step)
    {
        choice.reason = format!("steps of {step:?} s made equal: the last one cannot be shorter");
    }
    match choice.method {
        scene::Method::LinearlyImplicitEuler => {
            choice.tangent.get_or_insert(Tangent::Exact);
        }
        _ => refuse_tangent(&choice)?,
    }
    if let Some(row) = choice.properties() {
        row.can_move(scene, system)?;
    }
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

impl Start {
    /// A method of somebody's own, which has no name.
    pub(crate) fn with_method(
        scene: &Scene,
        options: &RunOptions,
        system: &System,
        method: Box<dyn Method>,
    ) -> Self {
        let (pace, schedule) = pace_of(scene, &scene.settings, system);
        Self {
            choice: Choice::open(&scene.settings, options, pace),
            method,
            schedule,
            auto: None,
        }
    }
}

/// How steps are chosen; with a tolerance, by a controller.
fn pace_of(scene: &Scene, settings: &Settings, system: &System) -> (Pace, Schedule) {
    let duration = settings.duration;
    let tolerance = match settings.step {
        StepControl::Fixed(step) => {
            let mut plan = StepPlan::new(duration, step);
            if plan.shortened.is_some()
                && properties(settings.method).is_some_and(|row| row.keeps_step)
            {
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

/// What a scene starts with under these settings; nothing is tried out yet.
pub(crate) fn start(
    scene: &Scene,
    (settings, options): (&Settings, &RunOptions),
    system: &System,
) -> Result<Start, SetupError> {
    refuse_unsettled(settings)?;
    let (pace, schedule) = pace_of(scene, settings, system);
    let choice = Choice::open(settings, options, pace);
    let needs_trials = |controller: &Controller| controller.left() > 0.0;
    if let (scene::Method::Auto, Schedule::Adaptive(controller)) = (settings.method, &schedule) {
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
    let choice = settle(scene, settings.step, system, choice, &schedule)?;
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
    // Steps of all sizes cost the same, unless matrices have fewer springs in some.
    let costs = if is_of_one_kind(compiled.0) {
        None
    } else {
        CostModel::new(compiled.0).ok()
    };
    let of_whole = costs.as_ref().map_or(1.0, CostModel::step_with_matrix);
    let of_step = |method: &mut dyn Method, h: f64| {
        let of_part = costs.as_ref().and_then(|costs| {
            let price = method.price_at(compiled.0, h)?;
            Some(costs.step_with_price(price))
        });
        of_part.unwrap_or(of_whole)
    };
    let budget = Budget {
        all: MOST_TRIAL_STEPS * of_whole,
        of_run: f64::INFINITY,
        of_step: &of_step,
        of_counts: &|_| 0.0,
    };
    let steps = equal_steps(compiled, method, task, budget, trials)?;
    method.restart();
    steps.ok_or(Unsettled::NotReached)
}

/// A first step that is short for anything the scene can do; the controller
/// lengthens it quickly.
pub(crate) fn first_step(duration: f64, fastest: f64) -> f64 {
    let resolving = 0.1 / fastest;
    (duration / 100.0).min(resolving.max(1e-6 * duration))
}

/// Equilibria are found before.
pub(crate) fn refuse_unsettled(settings: &Settings) -> Result<(), SetupError> {
    match settings.start {
        scene::Start::AsGiven => Ok(()),
        scene::Start::Equilibrium => Err(SetupError::NotSettled),
    }
}

fn refuse_tangent(choice: &Choice) -> Result<(), SetupError> {
    match choice.tangent {
        Some(_) => Err(SetupError::NoTangent {
            method: choice.method,
        }),
        None => Ok(()),
    }
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
    if is_explicit {
        choice.method = scene::Method::VelocityVerlet
    } else {
        choice.method = scene::Method::LinearlyImplicitEuler;
        choice.tangent.get_or_insert(Tangent::Filtered);
    }
}
