//! What a run will take, by count.

use serde::Serialize;
use springs_assembly::System;
use springs_scene::{Method, RunOptions, Scene};
use springs_solver::SolveError;
use springs_step::{CostModel, Islands, Pace, Simulation, StepSizes, properties, solver_memory};

/// What a run will take: counted operations and bytes, with prices that hold roughly on a
/// processor of these years.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Forecast {
    /// Memory of linear solvers, in bytes.
    pub solver_bytes: u64,
    /// Memory of all, in bytes, outputs left out.
    pub bytes: u64,
    /// Processor time of one step of all parts, in s; `None` while trial runs are to choose the
    /// method.
    pub step_seconds: Option<f64>,
    /// Steps of the largest part; `None` where they come from the error.
    pub steps: Option<u64>,
    /// Processor time of all steps, in s, where their number is known.
    pub seconds: Option<f64>,
    /// Where it is not: that of velocity Verlet at half its limit of stability, in s, which a run
    /// for a loose error hardly exceeds; `None` if it cannot move the scene.
    pub seconds_if_resolved: Option<f64>,
    /// Where steps are chosen by the error, by DOP853 or by `auto`, which then takes DOP853 or
    /// something cheaper: as many as DOP853 usually makes.
    pub usual: Option<UsualSteps>,
}

/// Steps that DOP853 makes for an error, as far as that can be known before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct UsualSteps {
    /// Fewest and most, of the largest part.
    pub steps: [u64; 2],
    /// Processor time of all parts with that, in s.
    pub seconds: [f64; 2],
}

/// Steps that DOP853 made for errors of 1e-2 to 1e-5 of the size, as multiples of those at its
/// limit of stability by the bound on frequencies (`docs/performance.md`). Its order makes it
/// depend little on the error.
const OF_STABLE_STEPS: [f64; 2] = [0.7, 5.4];

/// What a program takes without a scene, in bytes; a node, a spring and a stored block of
/// matrices in the scene, the compiled system, and the states of a method.
const BYTES_OF_NOTHING: u64 = 6_000_000;
const BYTES_OF_NODE: u64 = 1000;
const BYTES_OF_SPRING: u64 = 500;
const BYTES_OF_BLOCK: u64 = 72;

impl Forecast {
    /// Of a compiled scene.
    ///
    /// # Errors
    ///
    /// If a solver cannot be sized.
    pub(super) fn of(
        scene: &Scene,
        options: &RunOptions,
        islands: &Islands,
    ) -> Result<Self, SolveError> {
        let parts = || islands.parts().iter().map(|part| part.simulation());
        let mut forecast = Self {
            solver_bytes: 0,
            bytes: BYTES_OF_NOTHING
                + BYTES_OF_NODE * scene.nodes.len() as u64
                + BYTES_OF_SPRING * scene.springs.len() as u64,
            step_seconds: Some(0.0),
            steps: None,
            seconds: Some(0.0),
            usual: None,
            seconds_if_resolved: Some(0.0),
        };
        for simulation in parts() {
            let system = simulation.system();
            // One for the steps, one to find out whether the part is at rest.
            let may_solve = simulation.needs_trials() || simulation.choice().has_matrix();
            let solvers = u64::from(may_solve) + u64::from(options.sleep.is_some());
            if solvers > 0 {
                let blocks = system.n_free() + system.pattern().pairs().len();
                forecast.bytes += BYTES_OF_BLOCK * blocks as u64;
                let each = solver_memory(system, &simulation.choice().options)?;
                forecast.solver_bytes += solvers * each;
            }
            forecast.add_time(simulation);
        }
        forecast.bytes += forecast.solver_bytes;
        forecast.steps = islands
            .largest()
            .simulation()
            .plan()
            .map(|plan| plan.n_steps());
        forecast.usual = usual_steps(islands);
        Ok(forecast)
    }

    fn add_time(&mut self, simulation: &Simulation) {
        let (system, choice) = (simulation.system(), simulation.choice());
        let is_priced = choice.properties().is_some();
        let costs = if is_priced && choice.has_matrix() {
            CostModel::new(system).ok()
        } else {
            Some(CostModel::without_matrix(system))
        };
        let fastest = fastest(system);
        let sizes = match choice.pace {
            Pace::Tolerance(_) => StepSizes::ByError,
            Pace::Fixed(size) => StepSizes::Equal {
                angle: size * fastest,
            },
        };
        let of_step = |method, sizes| {
            let nanoseconds = costs.as_ref()?.of_step(method, sizes)?;
            Some(1e-9 * nanoseconds)
        };
        let add = |sum: &mut Option<f64>, seconds: Option<f64>| {
            *sum = sum.zip(seconds).map(|(sum, seconds)| sum + seconds);
        };
        let step = of_step(choice.method, sizes);
        add(&mut self.step_seconds, step);
        let n_steps = simulation.plan().map(|plan| plan.n_steps() as f64);
        add(
            &mut self.seconds,
            step.zip(n_steps).map(|(step, n)| step * n),
        );
        let resolved = simulation.duration() * fastest;
        let verlet = of_step(Method::VelocityVerlet, StepSizes::Equal { angle: 1.0 });
        let seconds = verlet.map(|step| step * resolved.ceil());
        add(
            &mut self.seconds_if_resolved,
            seconds.filter(|seconds| seconds.is_finite()),
        );
    }
}

/// A bound on angular frequencies and damping rates, in 1/s.
fn fastest(system: &System) -> f64 {
    system.frequency_bound().max(system.damping_rate_bound())
}

/// Of all parts, if DOP853 can move them and they have steps chosen by the error.
fn usual_steps(islands: &Islands) -> Option<UsualSteps> {
    let method = Method::Dop853;
    let angle = properties(method)?.stable_angle?;
    let stable_steps =
        |simulation: &Simulation| simulation.duration() * fastest(simulation.system()) / angle;
    let mut seconds = 0.0;
    for simulation in islands.parts().iter().map(|part| part.simulation()) {
        let (system, choice) = (simulation.system(), simulation.choice());
        let is_chosen = matches!(choice.method, Method::Auto | Method::Dop853)
            && matches!(choice.pace, Pace::Tolerance(_))
            && system.masses().iter().all(|&mass| mass > 0.0);
        if !is_chosen {
            return None;
        }
        let step = CostModel::without_matrix(system).of_step(method, StepSizes::ByError)?;
        seconds += 1e-9 * step * stable_steps(simulation);
    }
    let steps = stable_steps(islands.largest().simulation());
    (seconds.is_finite() && steps >= 1.0).then(|| UsualSteps {
        steps: OF_STABLE_STEPS.map(|times| (times * steps).ceil() as u64),
        seconds: OF_STABLE_STEPS.map(|times| times * seconds),
    })
}
