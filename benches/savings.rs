//! What leaving out saves, on scenes that have something to leave out, and what
//! looking for it costs on one that has not. Prints a table in Markdown.
//!
//! ```text
//! cargo bench --bench savings
//! ```

#[path = "../crates/springs-step/tests/common/mod.rs"]
mod common;

use common::append;
use springs::scene::generate::{Material, block, chain, cloth};
use springs::scene::{Method, RunOptions, Scene, StepControl, Vector3};
use springs::step::{Islands, solver_memory};
use std::time::Instant;

const H: f64 = 1.0 / 60.0;

/// What one run took and where it ended.
struct Run {
    setup: f64,
    seconds: f64,
    unknowns: usize,
    memory: u64,
    positions: Vec<Vector3<f64>>,
}

/// The quickest of three runs.
fn run(scene: &Scene, options: &RunOptions, skip: bool) -> Run {
    let mut options = options.with_skip(skip);
    options.sleep = options.sleep.filter(|_| skip);
    let once = || {
        let begin = Instant::now();
        let mut islands = Islands::with_options(scene, &options).expect("a sound scene");
        let setup = begin.elapsed().as_secs_f64();
        islands.run(1, &mut ()).expect("a run");
        let seconds = begin.elapsed().as_secs_f64();
        let systems = || {
            let parts = islands.parts().iter();
            parts.map(|part| part.simulation().stepper().system())
        };
        let unknowns = systems().map(|system| system.motion().dimension() * system.n_free());
        let memory = systems().map(|system| solver_memory(system, &options).expect("a size"));
        Run {
            setup,
            seconds,
            unknowns: unknowns.sum(),
            memory: memory.sum(),
            positions: islands.nodes().positions.clone(),
        }
    };
    let runs = (0..3).map(|_| once());
    runs.min_by(|a, b| a.seconds.total_cmp(&b.seconds))
        .expect("three runs")
}

fn with(mut scene: Scene, method: Method, step: StepControl, duration: f64) -> Scene {
    scene.settings.method = method;
    scene.settings.step = step;
    scene.settings.duration = duration;
    scene
}

fn note_step(scene: Scene, steps: f64) -> Scene {
    let step = StepControl::Fixed(H);
    with(scene, Method::LinearlyImplicitEuler, step, steps * H)
}

/// Copies of a scene, one behind the other, `turn` changing each.
fn copies(part: &Scene, n: usize, turn: impl Fn(usize, &mut Scene)) -> Scene {
    let mut scene = Scene {
        nodes: Vec::new(),
        springs: Vec::new(),
        ..part.clone()
    };
    for k in 0..n {
        let mut part = part.clone();
        turn(k, &mut part);
        for node in &mut part.nodes {
            node.position += Vector3::y() * (2.0 * k as f64);
        }
        append(&mut scene, &part);
    }
    scene
}

fn planar_cloth() -> Scene {
    let mut scene = cloth(96, Material::of_cloth());
    scene.gravity = Vector3::new(3.0, -9.0, 0.0);
    note_step(scene, 60.0)
}

fn straight_chain() -> Scene {
    let mut scene = chain(20_000, Material::of_chain(20_000));
    scene.gravity = Vector3::new(9.81, 0.0, 0.0);
    note_step(scene, 60.0)
}

fn net() -> Scene {
    let mut scene = cloth(96, Material::of_cloth());
    for spring in &mut scene.springs {
        spring.rest_length = 0.0;
    }
    note_step(scene, 60.0)
}

/// A thousand small cloths from soft to stiff, on all threads.
fn archipelago() -> Scene {
    let part = cloth(10, Material::of_cloth());
    let scene = copies(&part, 1000, |k, part| {
        for spring in &mut part.springs {
            spring.stiffness *= 10f64.powf(k as f64 / 250.0 - 2.0);
        }
    });
    with(scene, Method::Auto, StepControl::Tolerance(1e-3), 0.2)
}

/// Nine of ten blocks lie still.
fn sleepers() -> Scene {
    let mut part = block(10, Material::of_block());
    part.gravity = Vector3::zeros();
    let scene = copies(&part, 10, |k, part| {
        if k == 3 {
            for node in part.nodes.iter_mut().filter(|node| !node.fixed) {
                node.velocity = Vector3::new(0.3, 0.1, 0.5);
            }
        }
    });
    note_step(scene, 60.0)
}

/// As many springs again, between fixed nodes.
fn with_fixed_springs(mut scene: Scene) -> Scene {
    let mut copy = scene.clone();
    for node in &mut copy.nodes {
        node.fixed = true;
    }
    append(&mut scene, &copy);
    scene
}

fn doubled() -> Scene {
    let mut scene = cloth(64, Material::of_cloth());
    for spring in &mut scene.springs {
        spring.stiffness *= 0.5;
        spring.mass *= 0.5;
    }
    scene.springs.extend(scene.springs.clone());
    let step = StepControl::Fixed(1e-4);
    with(scene, Method::VelocityVerlet, step, 0.05)
}

fn main() {
    println!(
        "| scene | unknowns | left | solver, MB | left | time, s | left | ratio | largest difference, m |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let alone = RunOptions::default().with_threads(1);
    for (name, scene, options) in [
        ("cloth 96 in its plane", planar_cloth(), alone),
        ("straight chain of 20 000", straight_chain(), alone),
        ("net of zero rest lengths, 96", net(), alone),
        (
            "1 000 islands of 100 nodes",
            archipelago(),
            RunOptions::default(),
        ),
        (
            "nine of ten blocks at rest",
            sleepers(),
            alone.with_sleep(1e-6),
        ),
        ("every spring twice", doubled(), alone),
    ] {
        let [without, with] = [false, true].map(|skip| run(&scene, &options, skip));
        let differences = without.positions.iter().zip(&with.positions);
        let largest = differences.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        println!(
            "| {name} | {} | {} | {:.1} | {:.1} | {:.3} | {:.3} | {:.1} | {largest:.1e} |",
            3 * scene.nodes.iter().filter(|node| !node.fixed).count(),
            with.unknowns,
            1e-6 * without.memory as f64,
            1e-6 * with.memory as f64,
            without.seconds,
            with.seconds,
            without.seconds / with.seconds,
        );
    }
    let plain = with(
        cloth(64, Material::of_cloth()),
        Method::VelocityVerlet,
        StepControl::Fixed(1e-4),
        0.05,
    );
    let [seconds, more] =
        [plain.clone(), with_fixed_springs(plain)].map(|scene| run(&scene, &alone, true).seconds);
    println!(
        "\n500 steps of a cloth: {seconds:.3} s; with as many springs between fixed nodes: {more:.3} s."
    );
    println!("\nNothing to leave out, 60 steps of 1/60 s, setup and whole run in s:\n");
    println!("| scene | setup, plain | setup | difference, part of the run | run, plain | run |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for scene in [
        cloth(32, Material::of_cloth()),
        cloth(128, Material::of_cloth()),
        block(12, Material::of_block()),
    ] {
        let mut scene = note_step(scene, 60.0);
        // Out of every plane.
        scene.gravity = Vector3::new(0.5, 0.7, -9.8);
        let [without, with] = [false, true].map(|skip| run(&scene, &alone, skip));
        println!(
            "| {} | {:.4} | {:.4} | {:.1} % | {:.3} | {:.3} |",
            scene.name,
            without.setup,
            with.setup,
            100.0 * (with.setup - without.setup) / without.seconds,
            without.seconds,
            with.seconds,
        );
    }
}
