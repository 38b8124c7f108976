//! Every method on every hard scene of the stress tests: did it finish, how far
//! off did it end, and what did it take. Prints a table in Markdown, the one in
//! `docs/stress.md`.
//!
//! ```text
//! cargo bench --bench stress
//! ```

#[path = "../crates/springs-step/tests/common/mod.rs"]
mod common;

use common::distance;
use common::hard::hard_scenes;
use nalgebra::Vector3;
use springs::scene::{Method, Scene, StepControl};
use springs::step::{Islands, Observer};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Ends runs that take longer.
struct Patience(Instant);

const LONGEST: Duration = Duration::from_secs(10);

impl Observer for Patience {
    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        if self.0.elapsed() > LONGEST {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Where the scene ends according to DOP853 at a tight tolerance, if that gets
/// there in time and agrees with a looser one.
fn reference(scene: &Scene) -> Option<Vec<Vector3<f64>>> {
    let solved = |tolerance: f64| {
        let mut scene = scene.clone();
        scene.settings.method = Method::Dop853;
        scene.settings.step = StepControl::Tolerance(tolerance * scene.size().max(1e-9));
        let mut islands = Islands::new(&scene).ok()?;
        islands.run(1, &mut Patience(Instant::now())).ok()?;
        let is_there = islands.time() == islands.duration();
        is_there.then(|| islands.nodes().positions.clone())
    };
    let (best, other) = (solved(1e-10)?, solved(1e-9)?);
    (distance(&best, &other) < 1e-3 * scene.size()).then_some(best)
}

fn main() {
    println!("| scene | method | ended | error, part of the size | steps | clamped | ms |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for scene in hard_scenes() {
        let reference = reference(&scene);
        for &method in Method::ALL {
            let mut scene = scene.clone();
            scene.settings.method = method;
            let begin = Instant::now();
            let mut islands = match Islands::new(&scene) {
                Ok(islands) => islands,
                Err(_) => {
                    println!("| {} | {method} | refused | | | | |", scene.name);
                    continue;
                }
            };
            let ended = islands.run(1, &mut Patience(begin));
            let milliseconds = 1e3 * begin.elapsed().as_secs_f64();
            let counts = islands.work().counts;
            let error = reference
                .as_ref()
                .filter(|_| ended.is_ok())
                .map(|reference| {
                    let error = distance(&islands.nodes().positions, reference) / scene.size();
                    format!("{error:.0e}")
                });
            println!(
                "| {} | {method} | {} | {} | {} | {} | {milliseconds:.1} |",
                scene.name,
                match ended {
                    Ok(_) => "finite".to_owned(),
                    Err(error) => error.cause.to_string(),
                },
                error.unwrap_or_default(),
                counts.steps,
                counts.clamped_springs,
            );
        }
    }
}
