//! From a simulation to the report that is written to `report.json`.

use crate::inspect::skipped;
use springs_assembly::Energy;
use springs_io::{
    EnergyReport, EnergySum, FailureReport, FrameEnergies, IslandReport, LoadWorkReport, Report,
    SavingReport, SecondsReport, StepRow, SupportWorkReport, SwitchReport, TrialsReport,
};
use springs_scene::{Load, Scene};
use springs_step::{Account, Islands, Outcome, Pace, Part, StepError, StepRecord, SupportWork};
use std::time::Duration;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// The whole duration is simulated.
    Finished,
    /// Somebody stopped it.
    Interrupted,
    /// A step could not be made.
    Failed(StepError),
}

impl From<Result<Outcome, StepError>> for Ending {
    fn from(outcome: Result<Outcome, StepError>) -> Self {
        match outcome {
            Ok(Outcome::Finished) => Self::Finished,
            Ok(Outcome::Stopped) => Self::Interrupted,
            Err(error) => Self::Failed(error),
        }
    }
}

/// Energies and their flows as files and tables have them.
pub fn frame_energies(account: &Account) -> FrameEnergies {
    let (energy, ledger) = (&account.energy, &account.ledger);
    FrameEnergies {
        time: account.time,
        energy: energy_sum(energy),
        anchor_work: ledger.anchor_work,
        dashpot_heat: ledger.heat.sum(),
        load_work: ledger.load_work,
        method_gain: ledger.method_gain(energy),
        broken_energy: ledger.broken_energy,
    }
}

/// A step as files have it.
pub fn step_row(record: &StepRecord) -> StepRow {
    let counts = record.counts;
    StepRow {
        time: record.time,
        step_size: record.step_size,
        error: record.error,
        allowed_error: record.allowed_error,
        method: record.method.kebab_name(),
        steps: counts.steps,
        rejected_steps: counts.rejected_steps,
        force_evaluations: counts.force_evaluations,
        factorizations: counts.factorizations,
        newton_iterations: counts.newton_iterations,
        solver_iterations: counts.solver_iterations,
    }
}

/// The energy that moved during a run: the most that was kinetic, had gone into
/// or out of springs or gravity since the start, or had become heat or come from
/// anchors, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TurnedOver(pub f64);

impl TurnedOver {
    /// Takes note of a moment of the run.
    pub fn look(&mut self, account: &Account) {
        let (start, now) = (account.ledger.start, account.energy);
        let flows = [
            now.kinetic,
            start.kinetic,
            now.elastic() - start.elastic(),
            now.gravity() - start.gravity(),
            account.ledger.heat.sum(),
            account.ledger.anchor_work,
            account.ledger.load_work,
            account.ledger.broken_energy,
        ];
        self.0 = flows
            .into_iter()
            .fold(self.0, |most, flow| most.max(flow.abs()));
    }
}

/// What the caller of a simulation has timed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timings {
    /// Everything, from reading the scene on.
    pub total: Duration,
    /// Reading the scene or the checkpoint.
    pub reading: Duration,
    /// Checking, compiling, symbolic factorization, and settling where the scene starts in
    /// equilibrium.
    pub setup: Duration,
    /// Trial runs.
    pub trials: Duration,
    /// Steps and frames, without writing.
    pub stepping: Duration,
    /// Writing frames and files.
    pub output: Duration,
}

/// The report of a simulation of `scene`.
pub fn report(
    scene: &Scene,
    islands: &Islands,
    ending: Ending,
    timings: Timings,
    turned_over: TurnedOver,
) -> Report {
    let largest = islands.largest().simulation();
    let choice = largest.choice();
    let work = islands.work();
    let (counts, phases) = (work.counts, work.phases);
    let trials = islands.trial_work();
    Report {
        springs_version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene.name.clone(),
        status: match ending {
            Ending::Finished => "finished",
            Ending::Interrupted => "interrupted",
            Ending::Failed(_) => "failed",
        }
        .to_owned(),
        method: choice.method.to_string(),
        tangent: choice.tangent.map(|tangent| tangent.to_string()),
        solution: choice.options.linear_tolerance.to_string(),
        threads: islands.threads(),
        nodes: scene.nodes.len(),
        springs: scene.springs.len(),
        unknowns: 3 * islands.n_free(),
        reason: Some(choice.reason.clone()).filter(|reason| !reason.is_empty()),
        switches: switches(islands),
        islands: parts(islands),
        skipped: skipped(scene, islands)
            .into_iter()
            .map(|saving| SavingReport {
                what: saving.what,
                saves: saving.saves,
                exact: saving.exact,
            })
            .collect(),
        step_size: largest.plan().map(|plan| plan.step_size),
        tolerance: match choice.pace {
            Pace::Fixed(_) => None,
            Pace::Tolerance(tolerance) => Some(tolerance),
        },
        estimated_error: islands.estimated_error(),
        shortened_last_step: largest
            .plan()
            .filter(|plan| largest.work().counts.steps >= plan.n_steps())
            .and_then(|plan| plan.shortened),
        steps: counts.steps,
        rejected_steps: counts.rejected_steps,
        rescued_steps: counts.rescued_steps,
        force_evaluations: counts.force_evaluations,
        symbolic_factorizations: counts.symbolic_factorizations,
        linearizations: counts.linearizations,
        factorizations: counts.factorizations,
        solves: counts.solves,
        solver_iterations: counts.solver_iterations,
        refinements: counts.refinements,
        newton_iterations: counts.newton_iterations,
        clamped_springs: counts.clamped_springs,
        broken_springs: islands.breaks().len(),
        trials: TrialsReport {
            force_evaluations: trials.counts.force_evaluations,
            linearizations: trials.counts.linearizations,
            factorizations: trials.counts.factorizations,
            solves: trials.counts.solves,
        },
        simulated_seconds: islands.time(),
        seconds: SecondsReport {
            total: timings.total.as_secs_f64(),
            reading: timings.reading.as_secs_f64(),
            setup: timings.setup.as_secs_f64(),
            trials: timings.trials.as_secs_f64(),
            stepping: timings.stepping.as_secs_f64(),
            assembly: phases.assembly.as_secs_f64(),
            factorization: phases.factorization.as_secs_f64(),
            solve: phases.solve.as_secs_f64(),
            output: timings.output.as_secs_f64(),
        },
        energy: energy(scene, islands, turned_over),
        peak_memory_bytes: peak_memory_bytes(),
        failure: match ending {
            Ending::Failed(error) => Some(failure(error)),
            _ => None,
        },
    }
}

/// How each part is simulated; nothing for a scene in one part.
fn parts(islands: &Islands) -> Vec<IslandReport> {
    let parts = islands.parts();
    if parts.len() == 1 {
        return Vec::new();
    }
    let report = |part: &Part| {
        let (island, simulation) = (part.island(), part.simulation());
        let counts = simulation.work().counts;
        IslandReport {
            first_node: island.nodes[0],
            nodes: island.nodes.len(),
            springs: island.springs.len(),
            method: simulation.choice().method.to_string(),
            steps: counts.steps,
            asleep_since: part.asleep_since(),
        }
    };
    parts.iter().map(report).collect()
}

fn switches(islands: &Islands) -> Vec<SwitchReport> {
    let parts = islands.parts().iter();
    let switches = parts.flat_map(|part| part.simulation().switches());
    let reports = switches.map(|switch| SwitchReport {
        time: switch.time,
        method: switch.method.to_string(),
        reason: switch.reason.clone(),
    });
    reports.collect()
}

fn energy(scene: &Scene, islands: &Islands, mut turned_over: TurnedOver) -> EnergyReport {
    let (ledger, end, works) = (islands.ledger(), islands.energy(), islands.works());
    turned_over.look(&islands.account());
    let support = |support: &SupportWork| {
        let motion = scene.nodes[support.node].motion;
        SupportWorkReport {
            node: support.node,
            motion: motion.map(|motion| scene.motions[motion].name.clone()),
            work: support.work,
        }
    };
    let load = |(index, (load, &work)): (usize, (&Load, &f64))| LoadWorkReport {
        load: index,
        name: load.name.clone(),
        first_node: load.nodes.first().copied(),
        nodes: load.nodes.len(),
        work,
    };
    let loads = scene.loads.iter().zip(&works.loads).enumerate();
    EnergyReport {
        start: energy_sum(&ledger.start),
        end: energy_sum(&end),
        anchor_work: ledger.anchor_work,
        supports: works.supports.iter().map(support).collect(),
        dashpot_heat: ledger.heat.sum(),
        load_work: ledger.load_work,
        loads: loads.map(load).collect(),
        broken_energy: ledger.broken_energy,
        method_gain: ledger.method_gain(&end),
        turned_over: turned_over.0,
    }
}

/// An energy as files and tables have it.
fn energy_sum(energy: &Energy) -> EnergySum {
    EnergySum {
        kinetic: energy.kinetic,
        elastic: energy.elastic(),
        gravity: energy.gravity(),
        total: energy.total(),
    }
}

fn failure(error: StepError) -> FailureReport {
    FailureReport {
        time: error.time,
        step: error.step,
        step_size: error.step_size,
        node: error.node,
        reason: error.to_string(),
    }
}

/// Largest resident memory of this process so far, where the system tells it.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kibibytes)
}
