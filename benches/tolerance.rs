//! The tolerance asked for against the error that a run ends with: every method
//! at tolerances from 1e-1 to 1e-8 m on scenes that really move, against
//! DOP853 at 1e-11 m. *Growth* says how many times larger a small disturbance
//! of velocities is at the end than it would be in free flight. Beside each error
//! stand the steps of the run, and how many times its linear solutions trial runs
//! made. Prints a table in Markdown.
//!
//! ```text
//! cargo bench --bench tolerance > table.md
//! ```

#[path = "../crates/springs-step/tests/common/mod.rs"]
mod common;

use common::moving::{moving_scenes, without_middle_mass};
use common::{distance, growth, reference};
use nalgebra::Vector3;
use springs::scene::{Method, Scene, StepControl};
use springs::step::{Observer, Outcome, Simulation};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

const METHODS: [Method; 9] = [
    Method::TrBdf2,
    Method::Dop853,
    Method::Rodas4,
    Method::ImplicitMidpoint,
    Method::FilteredLeapfrog,
    Method::VelocityVerlet,
    Method::BlanesMoan4,
    Method::BlanesMoan6,
    Method::ImplicitEuler,
];

/// A method that takes longer than this goes no further.
const LONG: Duration = Duration::from_secs(2);

/// Stops a run that takes too long.
struct Patience(Instant);

impl Observer for Patience {
    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        if self.0.elapsed() > LONG {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// Positions at the end, the steps made and the linear solutions of trial runs as
/// multiples of the run's; `None` if it took too long or the method cannot move the
/// scene.
fn run(scene: &Scene, method: Method, tolerance: f64) -> Option<(Vec<Vector3<f64>>, u64, f64)> {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.step = StepControl::Tolerance(tolerance);
    let mut simulation = Simulation::new(&scene).ok()?;
    match simulation.run(1, &mut Patience(Instant::now())) {
        Ok(Outcome::Finished) => {
            let counts = simulation.work().counts;
            let tried = simulation.trial_work().counts.solves as f64 / counts.solves.max(1) as f64;
            Some((simulation.nodes().positions.clone(), counts.steps, tried))
        }
        _ => None,
    }
}

fn main() {
    println!(
        "| scene, growth | method | error/tolerance (steps; trial runs) at 1e-1 | 1e-2 | 1e-3 | 1e-4 | 1e-5 | 1e-6 | 1e-7 | 1e-8 |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let filter: Option<String> = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    // What moves as each scene does and can be solved by DOP853: mostly itself.
    let same = |scene: Scene| (scene.clone(), scene);
    let scenes = moving_scenes().into_iter().map(same);
    for (scene, twin) in scenes.chain([without_middle_mass()]) {
        if filter.as_ref().is_some_and(|f| !scene.name.contains(f)) {
            continue;
        }
        let (reference, trusted) = reference(&twin);
        let growth = growth(&twin, &reference);
        for method in METHODS {
            let mut row = format!("| {}, {growth:.1} | {method} |", scene.name);
            for k in 1..=8 {
                let tolerance = 10f64.powi(-k);
                match run(&scene, method, tolerance) {
                    Some((positions, steps, tried)) => {
                        let error = distance(&positions[..reference.len()], &reference);
                        let told = if error > 3.0 * trusted { "" } else { "≤ " };
                        let tried = match tried {
                            0.0 => String::new(),
                            _ => format!("; {tried:.1}"),
                        };
                        row += &format!(" {told}{:.1e} ({steps}{tried}) |", error / tolerance);
                    }
                    None => {
                        row += " |";
                        break;
                    }
                }
            }
            println!("{row}");
        }
    }
}
