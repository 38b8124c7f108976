//! Run time against error on a fixed set: an elastic pendulum, a chain of 100,
//! a cloth of 16 × 16 and a block of 8 × 8 × 8 nodes, each soft, moderate and
//! very stiff, all really moving.
//!
//! Writes a work-precision diagram and a table of all runs per scene into
//! `target/work-precision`, prints the quickest method beside the note's own
//! step, velocity Verlet and a plain scalar Verlet, and holds every run of
//! `auto` against the best method at the same error. Seconds per scene may be
//! given:
//!
//! ```text
//! cargo bench --bench work_precision -- 60
//! ```

#[path = "../crates/springs-step/tests/common/mod.rs"]
mod common;

use common::moving::pendulum;
use nalgebra::Vector3;
use springs::scene::generate::{Material, block, chain, cloth};
use springs::scene::{Method, Scene};
use springs::study::{Options, Setting, Study, Trial, csv, diagram, study};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

/// The set, with short times where cloth would become chaotic.
fn scenes() -> Vec<Scene> {
    let of = |stiffness, material| Material {
        stiffness,
        ..material
    };
    let mut scenes = Vec::new();
    for (word, stiffness) in [("soft", 60.0), ("moderate", 1e4), ("very stiff", 1e8)] {
        let mut scene = pendulum(stiffness);
        scene.name = format!("pendulum, {word}");
        scenes.push(scene);
    }
    for (word, stiffness) in [("soft", 2e3), ("moderate", 1e6), ("very stiff", 1e9)] {
        let mut scene = chain(100, of(stiffness, Material::of_chain(100)));
        scene.name = format!("chain 100, {word}");
        scene.settings.duration = 0.5;
        scenes.push(scene);
    }
    for (word, stiffness) in [("soft", 100.0), ("moderate", 1e4), ("very stiff", 1e7)] {
        let mut scene = cloth(16, of(stiffness, Material::of_cloth()));
        scene.name = format!("cloth 16, {word}");
        scene.settings.duration = 0.3;
        scenes.push(scene);
    }
    for (word, stiffness) in [("soft", 200.0), ("moderate", 1e5), ("very stiff", 1e8)] {
        let mut scene = block(8, of(stiffness, Material::of_block()));
        scene.name = format!("block 8, {word}");
        // Thrown sideways off its layer.
        for node in &mut scene.nodes {
            node.fixed = false;
            node.velocity = Vector3::new(2.0 * node.position.z, 0.0, 1.0);
        }
        scene.settings.duration = 0.3;
        scenes.push(scene);
    }
    // A small uneven speed, so that nothing stays symmetric; uneven positions
    // would load very stiff springs.
    for node in scenes.iter_mut().flat_map(|scene| &mut scene.nodes) {
        if !node.fixed {
            let x = node.position;
            let wave = (7.0 * x.x + 5.0 * x.y + 3.0 * x.z).sin();
            node.velocity += Vector3::new(0.0, 0.02 * wave, 0.01 * wave);
        }
    }
    scenes
}

/// Time that a method would take to an error, interpolated between its runs
/// next to it, both logarithmic; `None` outside them.
fn seconds_at(study: &Study, method: &str, error: f64) -> Option<f64> {
    let runs = study.trials.iter().filter(|trial| trial.method == method);
    let runs: Vec<(f64, f64)> = runs
        .map(|trial| (trial.error.ln(), trial.seconds.ln()))
        .collect();
    let pairs = runs.windows(2).filter_map(|pair| {
        let [(e0, t0), (e1, t1)] = [pair[0], pair[1]];
        let at = error.ln();
        let fraction = (at - e0) / (e1 - e0);
        (0.0..=1.0)
            .contains(&fraction)
            .then(|| (t0 + fraction * (t1 - t0)).exp())
    });
    pairs.min_by(f64::total_cmp)
}

/// Every run of `auto`: time over that of the best method at the same error,
/// and error over tolerance; prints them and adds them to `judged`.
fn judge_auto(study: &Study, judged: &mut Vec<[f64; 2]>) {
    let mut methods: Vec<&str> = study.trials.iter().map(|t| t.method.as_str()).collect();
    methods.sort_unstable();
    methods.dedup();
    methods.retain(|method| *method != "auto");
    for run in study.trials.iter().filter(|trial| trial.method == "auto") {
        let Setting::Tolerance(tolerance) = run.setting else {
            continue;
        };
        let best = methods
            .iter()
            .filter_map(|method| Some((seconds_at(study, method, run.error)?, method)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((seconds, method)) = best {
            let (times, off) = (run.seconds / seconds, run.error / tolerance);
            println!(
                "  auto {tolerance:.1e}: {times:.2} x {method}, error {off:.1e} x tolerance, {:.1e} s",
                run.seconds
            );
            judged.push([times, off]);
        }
    }
}

/// What [`judge_auto`] found of all scenes.
fn summarize(judged: &[[f64; 2]]) {
    let mut times: Vec<f64> = judged.iter().map(|[times, _]| *times).collect();
    times.sort_by(f64::total_cmp);
    let Some(last) = times.len().checked_sub(1) else {
        return;
    };
    let at = |part: f64| times[(part * last as f64).round() as usize];
    let n_within = judged.iter().filter(|[_, off]| *off <= 1.0).count();
    println!(
        "\nauto in {} runs: {:.2} x the best in the median, {:.2} in three of four, {:.2} in nine \
         of ten, {:.2} at most; error below the tolerance in {n_within}",
        times.len(),
        at(0.5),
        at(0.75),
        at(0.9),
        at(1.0)
    );
}

/// Velocity Verlet as it is usually written first: springs one after the other,
/// forces scattered to both ends. Seconds for the whole duration.
fn plain_verlet(scene: &Scene, h: f64) -> f64 {
    let masses = scene.node_masses();
    let mut x: Vec<Vector3<f64>> = scene.nodes.iter().map(|node| node.position).collect();
    let mut v: Vec<Vector3<f64>> = scene.nodes.iter().map(|node| node.velocity).collect();
    let n_steps = (scene.settings.duration / h).round() as u64;
    let accelerate = |x: &[Vector3<f64>], a: &mut [Vector3<f64>]| {
        a.fill(Vector3::zeros());
        for spring in &scene.springs {
            let [i, j] = spring.nodes;
            let d = x[j] - x[i];
            let l = d.norm();
            let force = d * (spring.stiffness * (l - spring.rest_length) / l);
            a[i] += force;
            a[j] -= force;
        }
        for ((a, mass), node) in a.iter_mut().zip(&masses).zip(&scene.nodes) {
            *a = if node.fixed {
                Vector3::zeros()
            } else {
                *a / *mass + scene.gravity
            };
        }
    };
    let begin = Instant::now();
    let mut a = vec![Vector3::zeros(); x.len()];
    accelerate(&x, &mut a);
    for _ in 0..n_steps {
        for ((x, v), a) in x.iter_mut().zip(&mut v).zip(&a) {
            *v += a * (0.5 * h);
            *x += *v * h;
        }
        accelerate(&x, &mut a);
        for (v, a) in v.iter_mut().zip(&a) {
            *v += a * (0.5 * h);
        }
    }
    std::hint::black_box(&x);
    begin.elapsed().as_secs_f64()
}

/// Time of [`plain_verlet`] with the step with which velocity Verlet reached an
/// error: its result is the same up to rounding.
fn plain_verlet_at(study: &Study, scene: &Scene, error: f64) -> Option<f64> {
    let trial = quickest(study, error, Some("velocity-verlet"))?;
    match trial.setting {
        Setting::Step(h) => {
            let mut seconds: Vec<f64> = (0..3).map(|_| plain_verlet(scene, h)).collect();
            seconds.sort_by(f64::total_cmp);
            Some(seconds[1])
        }
        Setting::Tolerance(_) => None,
    }
}

/// The quickest run that reached an error, of one method or of all.
fn quickest<'a>(study: &'a Study, error: f64, method: Option<&str>) -> Option<&'a Trial> {
    let reached = study
        .trials
        .iter()
        .filter(|trial| trial.error <= error && method.is_none_or(|method| trial.method == method));
    reached.min_by(|a, b| a.seconds.total_cmp(&b.seconds))
}

fn seconds(seconds: Option<f64>) -> String {
    seconds.map_or("–".to_owned(), |seconds| format!("{seconds:.1e}"))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let budget = std::env::args().find_map(|argument| argument.parse().ok());
    let options = Options {
        methods: Method::ALL.to_vec(),
        budget: Duration::from_secs_f64(budget.unwrap_or(15.0)),
        ..Options::default()
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/work-precision");
    std::fs::create_dir_all(&folder)?;
    println!(
        "| scene | error, m | quickest, s | method | note's step, s | Verlet, s | plain Verlet, s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let mut judged = Vec::new();
    for scene in scenes() {
        let study = match study(&scene, &options, &mut |_| ControlFlow::Continue(())) {
            Ok(study) => study,
            Err(error) => {
                println!("| {} | | | {error} | | |", scene.name);
                continue;
            }
        };
        let file = scene.name.replace([',', ' '], "-").replace("--", "-");
        std::fs::write(folder.join(format!("{file}.svg")), diagram(&study))?;
        std::fs::write(folder.join(format!("{file}.csv")), csv(&study))?;
        judge_auto(&study, &mut judged);
        for error in [1e-2, 1e-4] {
            let best = quickest(&study, error, None);
            let of = |method| quickest(&study, error, Some(method)).map(|trial| trial.seconds);
            println!(
                "| {} | {error:.0e} | {} | {} | {} | {} | {} |",
                scene.name,
                seconds(best.map(|trial| trial.seconds)),
                best.map_or("–", |trial| &trial.method),
                seconds(of("linearly-implicit-euler")),
                seconds(of("velocity-verlet")),
                seconds(plain_verlet_at(&study, &scene, error)),
            );
        }
    }
    summarize(&judged);
    println!("\ndiagrams and tables are in {}", folder.display());
    Ok(())
}
