//! `springs check`: what is in a scene; runs nothing.

use super::source::SceneArguments;
use super::summary::short;
use super::{Ending, print};
use anyhow::Context as _;
use springs::assembly::System;
use springs::inspect::{Saving, count, skipped, suspicious};
use springs::materials;
use springs::proportions::OwnWeight;
use springs::scene::{Method, Scene, Start, StepControl, printable};
use springs::step::{Islands, Pace, solver_memory};
use std::fmt::Write as _;

#[derive(clap::Args)]
pub(crate) struct CheckArguments {
    #[command(flatten)]
    scene: SceneArguments,
}

pub(crate) fn check(arguments: &CheckArguments) -> anyhow::Result<Ending> {
    let mut source = arguments.scene.load()?;
    // A run finds the equilibrium first; here nothing is run.
    let start = std::mem::take(&mut source.scene.settings.start);
    let scene = &source.scene;
    let islands =
        Islands::with_options(scene, &source.options).map_err(|error| source.advised(&error))?;
    let skipped = skipped(scene, &islands);
    let mut suspicious = suspicious(scene, &islands);
    suspicious.extend(materials::suspicious(scene, &source.inputs));
    let largest = islands.largest().simulation();
    let choice = largest.choice();
    let systems = || {
        let parts = islands.parts().iter();
        parts.map(|part| part.simulation().stepper().system())
    };

    let name = if scene.name.is_empty() {
        "scene".to_owned()
    } else {
        printable(&scene.name)
    };
    let moving = scene
        .nodes
        .iter()
        .filter(|node| node.is_moving_anchor())
        .count();
    let fixed = scene.nodes.iter().filter(|node| node.fixed).count();
    let masses = systems().flat_map(System::masses);
    let mass = masses.fold(0.0, |sum, mass| sum + mass);
    let mut text = String::new();
    writeln!(text, "{name}")?;
    writeln!(
        text,
        "  {}: {} free, {fixed} fixed, {moving} of them moving",
        count(scene.nodes.len(), "node"),
        islands.n_free()
    )?;
    let guided = scene.nodes.iter().filter(|node| node.guide.is_some());
    match guided.count() {
        0 => {}
        1 => writeln!(text, "  1 free node may move in part only")?,
        guided => writeln!(text, "  {guided} of the free nodes may move in part only")?,
    }
    let damped = (0..scene.springs.len()).filter(|&spring| scene.dashpot(spring) > 0.0);
    writeln!(
        text,
        "  {}, {} with damping",
        count(scene.springs.len(), "spring"),
        damped.count()
    )?;
    for line in materials::ranges(scene, &source.inputs, short) {
        writeln!(text, "    {line}")?;
    }
    let can_break = scene.springs.iter();
    let can_break = can_break.filter(|spring| spring.breaks_at.is_some());
    let parts = islands.parts().iter();
    // With those that are beyond their limits.
    let broken = parts.map(|part| part.simulation().system().broken().len());
    match (can_break.count(), broken.sum::<usize>()) {
        (0, 0) => {}
        (can_break, broken) => writeln!(
            text,
            "    {} can break, {broken} broken before the first step",
            count(can_break, "spring")
        )?,
    }
    writeln!(
        text,
        "  {} kg free to move, {} m from corner to corner",
        short(mass),
        short(scene.size())
    )?;
    let [x, y, z] = scene.gravity.into();
    writeln!(text, "  gravity ({x}, {y}, {z}) m/s²")?;
    if !scene.loads.is_empty() {
        let loaded: usize = scene.loads.iter().map(|load| load.nodes.len()).sum();
        let loads = count(scene.loads.len(), "load");
        writeln!(text, "  {loads} on {}", count(loaded, "node"))?;
    }
    let drags = scene.node_drags();
    let drags = drags.into_iter().filter(|drag| *drag > 0.0);
    if let Some((least, most, nodes)) = range_of(drags) {
        let (least, most) = (short(least), short(most));
        let drag = if least == most {
            least
        } else {
            format!("{least} to {most}")
        };
        writeln!(text, "  drag {drag} N·s/m on {}", count(nodes, "free node"))?;
    }
    if let Some(weight) = OwnWeight::of(scene) {
        writeln!(
            text,
            "  its weight, carried by the springs at fixed nodes, changes their length by {} %",
            short(100.0 * weight.strain)
        )?;
    }
    if start == Start::Equilibrium {
        writeln!(
            text,
            "  starts from its equilibrium, which a run finds first"
        )?;
    }
    let tangent = choice
        .tangent
        .map_or(String::new(), |tangent| format!(" with {tangent} tangent"));
    let duration = scene.settings.duration;
    match choice.pace {
        Pace::Fixed(h) => {
            let plan = largest.plan().expect("steps of fixed size have a plan");
            let steps = count(plan.n_steps() as usize, "step");
            let (method, h) = (choice.method, short(h));
            writeln!(
                text,
                "  {method}{tangent}: {steps} of {h} s for {duration} s"
            )?;
            if let Some(rest) = plan.shortened {
                writeln!(text, "  the last step is shortened to {} s", short(rest))?;
            }
        }
        Pace::Tolerance(_) => {
            let (method, error) = (choice.method, asked_for(scene));
            writeln!(
                text,
                "  {method}{tangent}: steps for an error of {error} after {duration} s"
            )?;
        }
    }
    if largest.needs_trials() {
        let settled = match choice.method {
            Method::Auto => "the method and its steps",
            _ => "the number of equal steps",
        };
        writeln!(
            text,
            "  a run makes trial runs first; they settle {settled}"
        )?;
    }
    if !choice.reason.is_empty() {
        writeln!(text, "  because {}", choice.reason)?;
    }
    let blocks = systems().map(|system| system.n_free() + system.pattern().pairs().len());
    writeln!(
        text,
        "  {} unknowns, {} stored matrix blocks",
        3 * islands.n_free(),
        blocks.sum::<usize>()
    )?;
    let mut bytes = 0;
    for part in islands.parts() {
        let simulation = part.simulation();
        // One for the steps, one to find out whether the part is at rest.
        let may_solve = simulation.needs_trials() || simulation.choice().has_matrix();
        let solvers = u64::from(may_solve) + u64::from(source.options.sleep.is_some());
        if solvers > 0 {
            let system = simulation.stepper().system();
            let bytes_each = solver_memory(system, &simulation.choice().options);
            let bytes_each = bytes_each.context("the solver cannot be sized")?;
            bytes += solvers * bytes_each;
        }
    }
    if bytes > 0 {
        writeln!(text, "  linear solvers need {:.1} MB", 1e-6 * bytes as f64)?;
    }
    if !skipped.is_empty() {
        writeln!(text, "skipped, without changing the result:")?;
    }
    for saving in &skipped {
        let Saving { what, saves, exact } = saving;
        writeln!(text, "  - {what}: saves {saves}\n    exact {exact}")?;
    }
    if !suspicious.is_empty() {
        writeln!(text, "worth a look:")?;
    }
    for line in &suspicious {
        writeln!(text, "  - {line}")?;
    }
    if suspicious.is_empty() {
        writeln!(text, "nothing looks wrong")?;
    }
    print(&text)?;
    Ok(Ending::Done)
}

fn asked_for(scene: &Scene) -> String {
    match scene.settings.step {
        StepControl::Tolerance(tolerance) => format!("{} m", short(tolerance)),
        _ => "1e-3 of the size".to_owned(),
    }
}

/// The least and the largest of some numbers, and how many they are.
fn range_of(numbers: impl Iterator<Item = f64>) -> Option<(f64, f64, usize)> {
    let one = numbers.map(|number| (number, number, 1));
    one.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2))
}
