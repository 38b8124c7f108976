//! How a step of linearly implicit Euler grows with the size of a scene, phase
//! by phase, with strict and with sufficient solutions, on one thread and on
//! all, beside the floor of the machine: dense products and copies, measured in
//! the same run. Prints a table in Markdown.
//!
//! ```text
//! cargo bench --bench growth
//! ```

use faer::Mat;
use springs::scene::generate::{Material, block, chain, cloth};
use springs::scene::{LinearTolerance, Method, RunOptions, Scene, StepControl};
use springs::step::Simulation;
use std::hint::black_box;
use std::time::{Duration, Instant};

const H: f64 = 1.0 / 60.0;
/// Steps are made for about so long.
const LONG: Duration = Duration::from_secs(2);

/// Best of some runs, in s.
fn best(mut work: impl FnMut()) -> f64 {
    let seconds = (0..7).map(|_| {
        let begin = Instant::now();
        work();
        begin.elapsed().as_secs_f64()
    });
    seconds.fold(f64::INFINITY, f64::min)
}

/// Multiplications and additions a second of a dense product on one thread.
fn dense_speed() -> f64 {
    const N: usize = 768;
    let a = Mat::from_fn(N, N, |i, j| 1.0 / (1.0 + i as f64 + j as f64));
    let mut c = Mat::zeros(N, N);
    let seconds = best(|| {
        faer::linalg::matmul::matmul(&mut c, faer::Accum::Replace, &a, &a, 1.0, faer::Par::Seq);
    });
    black_box(&c);
    (N as f64).powi(3) / seconds
}

/// Bytes a second that one thread reads and writes when it copies.
fn copy_speed() -> f64 {
    let from = vec![1.0f64; 1 << 24];
    let mut to = vec![0.0f64; 1 << 24];
    let seconds = best(|| to.copy_from_slice(black_box(&from)));
    black_box(&to);
    16.0 * from.len() as f64 / seconds
}

fn measure(scene: &Scene, threads: usize, linear_tolerance: LinearTolerance) -> String {
    let mut scene = scene.clone();
    scene.settings.method = Method::LinearlyImplicitEuler;
    scene.settings.step = StepControl::Fixed(H);
    let options = RunOptions::default()
        .with_threads(threads)
        .with_linear_tolerance(linear_tolerance);
    scene.settings.duration = 1e3;
    let begin = Instant::now();
    let mut simulation = Simulation::with_options(&scene, &options).expect("a sound scene");
    let setup = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let mut steps = 0.0;
    while begin.elapsed() < LONG || steps < 2.0 {
        simulation.step().expect("a step");
        steps += 1.0;
    }
    let step = begin.elapsed().as_secs_f64() / steps;
    let (counts, phases) = (simulation.work().counts, simulation.work().phases);
    let per_step = |phase: Duration| 1e3 * phase.as_secs_f64() / steps;
    format!(
        "{:.1} | {:.3} | {:.3} | {:.3} ({:.2}) | {:.3} ({:.1})",
        1e3 * setup,
        1e3 * step,
        per_step(phases.assembly),
        per_step(phases.factorization),
        counts.factorizations as f64 / steps,
        per_step(phases.solve),
        counts.solver_iterations as f64 / steps,
    )
}

fn main() {
    println!(
        "one thread: {:.1} G multiplications and additions a second, {:.1} GB/s copied\n",
        1e-9 * dense_speed(),
        1e-9 * copy_speed()
    );
    println!(
        "| scene | nodes | solution | threads | setup, ms | step, ms | assembly | matrix (factorizations a step) | solution (iterations a step) |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut scenes = Vec::new();
    for n in [1_000, 10_000, 100_000, 1_000_000] {
        scenes.push(chain(n, Material::of_chain(n)));
    }
    for n in [16, 32, 64, 128, 256] {
        scenes.push(cloth(n, Material::of_cloth()));
    }
    for n in [8, 12, 16, 24] {
        scenes.push(block(n, Material::of_block()));
    }
    for scene in &scenes {
        for (threads, label, solution) in [
            (1, "1", LinearTolerance::Strict),
            (1, "1", LinearTolerance::Sufficient),
            (0, "all", LinearTolerance::Sufficient),
        ] {
            let measured = measure(scene, threads, solution);
            println!(
                "| {} | {} | {solution} | {label} | {measured} |",
                scene.name,
                scene.nodes.len()
            );
        }
    }
}
