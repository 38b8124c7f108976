//! What steps of fixed size do: a change of these counts is a change of cost.

use springs_scene::generate::{Material, chain, cloth};
use springs_scene::{Method, Scene, StepControl};
use springs_step::{Simulation, methods};
use std::fmt::Write as _;

/// A cloth that falls, and a stiff straight chain; without dashpots, so that every
/// method takes them.
fn scenes() -> [(Scene, f64); 2] {
    let stiff = Material {
        stiffness: 1e6,
        ..Material::of_chain(10)
    };
    let mut scenes = [
        (cloth(6, Material::of_cloth()), 1e-3),
        (chain(10, stiff), 2e-4),
    ];
    for (scene, step) in &mut scenes {
        scene.settings.step = StepControl::Fixed(*step);
        scene.settings.duration = 20.0 * *step;
        for spring in &mut scene.springs {
            spring.damping = 0.0;
        }
    }
    scenes
}

fn counts(scene: &Scene, method: Method) -> String {
    let mut scene = scene.clone();
    scene.settings.method = method;
    let mut simulation = Simulation::new(&scene).unwrap();
    let outcome = simulation.run(1, &mut ());
    let counts = simulation.work().counts;
    match outcome {
        Ok(_) => format!(
            "{} forces, {} linearizations, {} factorizations, {} solutions, {} Newton iterations",
            counts.force_evaluations,
            counts.linearizations,
            counts.factorizations,
            counts.solves,
            counts.newton_iterations,
        ),
        Err(error) => error.to_string(),
    }
}

#[test]
fn twenty_steps_of_each_method() {
    let mut table = String::new();
    for (scene, step) in scenes() {
        writeln!(table, "{}, 20 steps of {step} s", scene.name).unwrap();
        for row in methods() {
            writeln!(table, "  {}: {}", row.method, counts(&scene, row.method)).unwrap();
        }
    }
    insta::assert_snapshot!(table);
}
