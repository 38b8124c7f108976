//! The report of a run as JSON.

use crate::atomic::{WriteError, write_whole};
use serde::Serialize;
use std::path::Path;

/// What a run did, field by field as in `report.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Version of the program.
    pub springs_version: String,
    /// Name of the scene.
    pub scene: String,
    /// `finished`, `interrupted` or `failed`.
    pub status: String,
    /// Method, in kebab-case; the last one, if it changed.
    pub method: String,
    /// Tangent, in kebab-case, if the method has a matrix.
    pub tangent: Option<String>,
    /// How precisely linear systems are solved: `sufficient` or `strict`.
    pub solution: String,
    /// Threads used.
    pub threads: usize,
    /// Nodes of the scene.
    pub nodes: usize,
    /// Springs of the scene.
    pub springs: usize,
    /// Scalar unknowns of a step.
    pub unknowns: usize,
    /// Why this method, where the scene left it open.
    pub reason: Option<String>,
    /// Changes of method during the run.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub switches: Vec<SwitchReport>,
    /// How each part is simulated, where the scene falls into several that are
    /// not coupled. Method, tangent and step size above are then those
    /// of the largest, and `steps` the most that one made.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub islands: Vec<IslandReport>,
    /// What was left out, and why that changed nothing.
    pub skipped: Vec<SavingReport>,
    /// Size of all steps, in s, if it is fixed.
    pub step_size: Option<f64>,
    /// Error that steps are chosen by, in m, if they are.
    pub tolerance: Option<f64>,
    /// What the steps added to the error of positions by the estimates of the method, in m; of
    /// several parts that of the worst one. None with steps of one size.
    pub estimated_error: Option<f64>,
    /// Size of the last step, in s, if the duration was not a whole number of
    /// steps.
    pub shortened_last_step: Option<f64>,
    /// Steps made.
    pub steps: u64,
    /// Steps made and thrown away.
    pub rejected_steps: u64,
    /// Steps that could not be made in one, and were made in shorter ones.
    pub rescued_steps: u64,
    /// Evaluations of all forces.
    pub force_evaluations: u64,
    /// Orderings and symbolic factorizations.
    pub symbolic_factorizations: u64,
    /// Evaluations of forces and matrix at once.
    pub linearizations: u64,
    /// Numeric factorizations.
    pub factorizations: u64,
    /// Solutions of a linear system.
    pub solves: u64,
    /// Iterations of conjugate gradients in these.
    pub solver_iterations: u64,
    /// Solutions that were refined because stiffness hid the masses.
    pub refinements: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Springs clamped on demand, summed over steps.
    pub clamped_springs: u64,
    /// Springs that broke.
    pub broken_springs: usize,
    /// What trial runs did that settled the method and the steps; not in the
    /// counts above, except for symbolic factorizations.
    pub trials: TrialsReport,
    /// Simulated time, in s.
    pub simulated_seconds: f64,
    /// Where the run time went.
    pub seconds: SecondsReport,
    /// Where the energy went.
    pub energy: EnergyReport,
    /// Largest memory of the process, in bytes, where the system tells it.
    pub peak_memory_bytes: Option<u64>,
    /// Why the simulation could not go on, if it failed.
    pub failure: Option<FailureReport>,
}

/// A part of the scene that does not feel the others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IslandReport {
    /// Its first node.
    pub first_node: usize,
    /// Its nodes, fixed ones included.
    pub nodes: usize,
    /// Its springs.
    pub springs: usize,
    /// Its method, in kebab-case.
    pub method: String,
    /// Steps made.
    pub steps: u64,
    /// Since when it has been at rest, in s, if it is.
    pub asleep_since: Option<f64>,
}

/// What trial runs did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TrialsReport {
    /// Evaluations of all forces.
    pub force_evaluations: u64,
    /// Evaluations of forces and matrix at once.
    pub linearizations: u64,
    /// Numeric factorizations.
    pub factorizations: u64,
    /// Solutions of a linear system.
    pub solves: u64,
}

/// Something that was left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SavingReport {
    /// What was found.
    pub what: String,
    /// What that saves.
    pub saves: String,
    /// When it changes nothing.
    pub exact: String,
}

/// A change of method during a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SwitchReport {
    /// When, in s.
    pub time: f64,
    /// The method from then on, in kebab-case.
    pub method: String,
    /// Why.
    pub reason: String,
}

/// Run time by phase, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SecondsReport {
    /// From reading the scene to writing the last file but the report.
    pub total: f64,
    /// Reading the scene or the checkpoint.
    pub reading: f64,
    /// Checking, compiling, symbolic factorization, and settling where the scene starts in
    /// equilibrium.
    pub setup: f64,
    /// Forces, matrices and solutions of trial runs.
    pub trials: f64,
    /// All steps.
    pub stepping: f64,
    /// Of these, forces and matrices; this and the next two are summed over
    /// parts that run at once.
    pub assembly: f64,
    /// Of these, numeric factorization.
    pub factorization: f64,
    /// Of these, solution of linear systems.
    pub solve: f64,
    /// Writing frames and files.
    pub output: f64,
}

/// Energy in J: end = start + anchor_work + load_work − dashpot_heat − broken_energy +
/// method_gain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EnergyReport {
    /// At time 0.
    pub start: EnergySum,
    /// At the end.
    pub end: EnergySum,
    /// Work of moving anchors.
    pub anchor_work: f64,
    /// That of each of them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub supports: Vec<SupportWorkReport>,
    /// Heat of dashpots and drag.
    pub dashpot_heat: f64,
    /// Work of loads.
    pub load_work: f64,
    /// That of each of them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<LoadWorkReport>,
    /// What broken springs held when they broke, and the work of yielding.
    pub broken_energy: f64,
    /// The rest: gain of the method itself, negative for a loss. Heat and work
    /// are integrated from step ends, to order 2 at most; what that misses is
    /// in here, too.
    pub method_gain: f64,
    /// What moved: the most that was kinetic, had gone into or out of springs or
    /// gravity, or was heat or work, as far as it was looked at on the way.
    pub turned_over: f64,
}

/// Work of a fixed node that moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SupportWorkReport {
    /// The node.
    pub node: usize,
    /// The name of its motion, if it follows one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<String>,
    /// In J.
    pub work: f64,
}

/// Work of a load.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadWorkReport {
    /// Its index; fields come after the loads of the file.
    pub load: usize,
    /// Its name, or that of its group of nodes, if it has one.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Its first node.
    pub first_node: Option<usize>,
    /// The nodes that it acts on.
    pub nodes: usize,
    /// In J.
    pub work: f64,
}

/// Mechanical energy, in J.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergySum {
    /// Of the free nodes.
    pub kinetic: f64,
    /// Of all springs.
    pub elastic: f64,
    /// Of the free nodes, zero at the origin.
    pub gravity: f64,
    /// The sum.
    pub total: f64,
}

/// Where and why a simulation could not go on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailureReport {
    /// Time at the start of the step, in s.
    pub time: f64,
    /// The step, counted from 1.
    pub step: u64,
    /// Its size, in s.
    pub step_size: f64,
    /// The node.
    pub node: usize,
    /// Why.
    pub reason: String,
}

/// Writes `report.json`, whole or not at all. A number that is not finite
/// becomes `null`.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_report(path: &Path, report: &impl Serialize) -> Result<(), WriteError> {
    let mut text = serde_json::to_string_pretty(report).map_err(|error| WriteError {
        path: path.to_owned(),
        source: error.into(),
    })?;
    text.push('\n');
    write_whole(path, text.as_bytes())
}
