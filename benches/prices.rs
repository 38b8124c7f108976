//! What `Auto` thinks that steps cost against what they cost: measured time over the
//! price of what was counted, each as a multiple of the median over the table. Prints
//! a table in Markdown, and ends with an error if a ratio is off by more than a
//! factor of two.
//!
//! ```text
//! cargo bench --bench prices
//! ```

use nalgebra::Vector3;
use springs::scene::generate::{Material, block, chain, cloth};
use springs::scene::{Method, RunOptions, Scene, StepControl};
use springs::step::{CostModel, Observer, Simulation};
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::time::{Duration, Instant};

const METHODS: [Method; 7] = [
    Method::VelocityVerlet,
    Method::BlanesMoan4,
    Method::BlanesMoan6,
    Method::Dop853,
    Method::FilteredLeapfrog,
    Method::TrBdf2,
    Method::LinearlyImplicitEuler,
];

/// Each run is measured for so long.
const ENOUGH: Duration = Duration::from_millis(400);
const REPETITIONS: usize = 3;

fn scenes() -> Vec<Scene> {
    let mut scenes = Vec::new();
    for n in [1, 30, 1000, 30_000] {
        scenes.push(chain(n, Material::of_chain(n)));
    }
    for n in [8, 16, 32, 64] {
        scenes.push(cloth(n, Material::of_cloth()));
    }
    for n in [6, 10, 14] {
        scenes.push(block(n, Material::of_block()));
    }
    for scene in &mut scenes {
        scene
            .springs
            .iter_mut()
            .for_each(|spring| spring.damping = 0.0);
        for node in scene.nodes.iter_mut().filter(|node| !node.fixed) {
            let x = node.position;
            let wave = (7.0 * x.x + 5.0 * x.y + 3.0 * x.z).sin();
            node.velocity += Vector3::new(0.03, 0.02 * wave, 0.01 * wave);
        }
    }
    scenes
}

/// Stops a run that has been measured for long enough.
struct Watch(Instant);

impl Observer for Watch {
    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        if self.0.elapsed() > ENOUGH {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Measured time over the price, for steps as `Auto` makes them.
fn ratio(scene: &Scene, method: Method) -> Option<f64> {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.duration = 1e3;
    // Methods with equal steps would try whole runs out first.
    scene.settings.step = match method {
        Method::FilteredLeapfrog | Method::LinearlyImplicitEuler => StepControl::Fixed(1e-3),
        _ => StepControl::Tolerance(1e-4),
    };
    let options = RunOptions::default().with_threads(1);
    let mut least = f64::INFINITY;
    for _ in 0..REPETITIONS {
        let mut simulation = Simulation::with_options(&scene, &options).ok()?;
        let model = CostModel::new(simulation.system()).ok()?;
        // Allocations and first matrices are no part of a step.
        let warm = Instant::now();
        let mut first = Watch(warm - ENOUGH);
        simulation.run(1, &mut first).ok()?;
        let before = simulation.work().counts;
        let begin = Instant::now();
        simulation.run(1, &mut Watch(begin)).ok()?;
        let took = begin.elapsed().as_secs_f64() * 1e9;
        let counts = simulation.work().counts - before;
        least = least.min(took / model.of_run(method, &counts)?);
    }
    Some(least)
}

fn main() -> ExitCode {
    let rows: Vec<(String, Vec<Option<f64>>)> = scenes()
        .iter()
        .map(|scene| {
            let ratios = METHODS.iter().map(|method| ratio(scene, *method));
            (scene.name.clone(), ratios.collect())
        })
        .collect();
    let mut all: Vec<f64> = rows
        .iter()
        .flat_map(|row| &row.1)
        .flatten()
        .copied()
        .collect();
    all.sort_by(f64::total_cmp);
    let median = all[all.len() / 2];
    println!("A price of 1 ns is {median:.2} ns here.\n");
    let names = METHODS.map(Method::kebab_name).join(" | ");
    println!(
        "| scene | {names} |\n| --- |{}",
        " --- |".repeat(METHODS.len())
    );
    for (name, ratios) in &rows {
        let told = ratios.iter().map(|ratio| match ratio {
            Some(ratio) => format!(" {:.2} |", ratio / median),
            None => " |".to_owned(),
        });
        println!("| {name} |{}", told.collect::<String>());
    }
    let (least, most) = (all[0] / median, all[all.len() - 1] / median);
    println!("\nFrom {least:.2} to {most:.2}.");
    if least < 0.5 || most > 2.0 {
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
