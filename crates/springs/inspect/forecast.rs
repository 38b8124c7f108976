//! What a run will take, by count.

use serde::Serialize;
use springs_scene::{RunOptions, Scene};
use springs_solver::SolveError;
use springs_step::{CostModel, Islands, Pace, Simulation, solver_memory};

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
}

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
        let has_estimate = matches!(choice.pace, Pace::Tolerance(_));
        let of_step = |method, estimates| {
            let nanoseconds = costs.as_ref()?.of_step(method, estimates)?;
            Some(1e-9 * nanoseconds)
        };
        let add = |sum: &mut Option<f64>, seconds: Option<f64>| {
            *sum = sum.zip(seconds).map(|(sum, seconds)| sum + seconds);
        };
        let step = of_step(choice.method, has_estimate);
        add(&mut self.step_seconds, step);
        let n_steps = simulation.plan().map(|plan| plan.n_steps() as f64);
        add(
            &mut self.seconds,
            step.zip(n_steps).map(|(step, n)| step * n),
        );
        let fastest = system.frequency_bound().max(system.damping_rate_bound());
        let resolved = simulation.duration() * fastest;
        let verlet = of_step(springs_scene::Method::VelocityVerlet, false);
        let seconds = verlet.map(|step| step * resolved.ceil());
        add(
            &mut self.seconds_if_resolved,
            seconds.filter(|seconds| seconds.is_finite()),
        );
    }
}
