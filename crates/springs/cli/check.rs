//! `springs check`: what is in a scene; runs nothing.

use super::source::SceneArguments;
use super::{Ending, print};
use anyhow::Context as _;
use springs::assembly::compile;
use springs::inspect::{count, inspect};
use springs::step::{Pace, StepPlan, choose, solver_memory};
use std::fmt::Write as _;

#[derive(clap::Args)]
pub(crate) struct CheckArguments {
    #[command(flatten)]
    scene: SceneArguments,
}

pub(crate) fn check(arguments: &CheckArguments) -> anyhow::Result<Ending> {
    let source = arguments.scene.load()?;
    let scene = &source.scene;
    let system = compile(scene)?;
    let choice = choose(scene, &system).map_err(|error| source.advised(&error))?;
    let inspection = inspect(scene, &system, &choice);

    let name = if scene.name.is_empty() {
        "scene"
    } else {
        &scene.name
    };
    let moving = scene
        .nodes
        .iter()
        .filter(|node| node.is_moving_anchor())
        .count();
    let fixed = scene.nodes.iter().filter(|node| node.fixed).count();
    let mass: f64 = system.masses().iter().sum();
    let mut text = String::new();
    writeln!(text, "{name}")?;
    writeln!(
        text,
        "  {}: {} free, {fixed} fixed, {moving} of them moving",
        count(scene.nodes.len(), "node"),
        system.n_free()
    )?;
    writeln!(
        text,
        "  {}, {} with damping",
        count(scene.springs.len(), "spring"),
        system.dashpots().len()
    )?;
    writeln!(
        text,
        "  {mass:.4} kg free to move, {:.4} m from corner to corner",
        scene.size()
    )?;
    let [x, y, z] = scene.gravity.into();
    writeln!(text, "  gravity ({x}, {y}, {z}) m/s²")?;
    let tangent = choice
        .tangent
        .map_or(String::new(), |tangent| format!(" with {tangent} tangent"));
    let duration = scene.settings.duration;
    match choice.pace {
        Pace::Fixed(h) => {
            let plan = StepPlan::new(duration, h);
            let steps = count(plan.n_steps() as usize, "step");
            writeln!(
                text,
                "  {}{tangent}: {steps} of {h} s for {duration} s",
                choice.method
            )?;
            if let Some(rest) = plan.shortened {
                writeln!(text, "  the last step is shortened to {rest} s")?;
            }
        }
        Pace::Tolerance(tolerance) => writeln!(
            text,
            "  {}{tangent}: steps for an error of {tolerance} m after {duration} s",
            choice.method
        )?,
    }
    if !choice.reason.is_empty() {
        writeln!(text, "  because {}", choice.reason)?;
    }
    writeln!(
        text,
        "  {} unknowns, {} stored matrix blocks",
        3 * system.n_free(),
        system.n_free() + system.pattern().pairs().len()
    )?;
    if choice.has_matrix() {
        let bytes = solver_memory(&system).context("the solver cannot be sized")?;
        writeln!(
            text,
            "  the linear solver needs {:.1} MB",
            1e-6 * bytes as f64
        )?;
    }
    list(
        &mut text,
        "skipped, without changing the result",
        &inspection.skipped,
    )?;
    list(&mut text, "worth a look", &inspection.suspicious)?;
    if inspection.suspicious.is_empty() {
        writeln!(text, "nothing looks wrong")?;
    }
    print(&text)?;
    Ok(Ending::Done)
}

fn list(text: &mut String, title: &str, lines: &[String]) -> std::fmt::Result {
    if !lines.is_empty() {
        writeln!(text, "{title}:")?;
    }
    for line in lines {
        writeln!(text, "  - {line}")?;
    }
    Ok(())
}
