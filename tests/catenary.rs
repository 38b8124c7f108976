//! The power line of the examples, once settled, against the elastic catenary.

#[allow(dead_code, unreachable_pub)]
#[path = "../examples/power_line.rs"]
mod power_line;

use power_line::{Catenary, deviation, power_line};
use springs::io::read_scene;
use springs::step::{NodeStates, Stepper};
use std::path::Path;

/// Positions after the line has come to rest: half a minute as it is, then
/// steps so long that the implicit step is a Newton step toward equilibrium.
fn settled(segments: usize) -> NodeStates {
    let scene = power_line(segments);
    let mut stepper = Stepper::new(&scene).unwrap();
    let mut nodes = NodeStates::of(&scene);
    for (h, steps) in [(0.01, 3000), (1.0, 100), (100.0, 100)] {
        for _ in 0..steps {
            stepper.step(&mut nodes, h).unwrap();
        }
    }
    let speed = nodes
        .velocities
        .iter()
        .map(|v| v.norm())
        .fold(0.0, f64::max);
    assert!(speed < 1e-12, "still moving at {speed:e} m/s");
    nodes
}

#[test]
fn the_settled_line_is_an_elastic_catenary_to_second_order() {
    let errors: Vec<f64> = [15, 30, 60, 120]
        .into_iter()
        .map(|segments| deviation(&settled(segments).positions))
        .collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.05, "{errors:?}");
    }
    assert!(errors[3] < 2e-4, "{errors:?}");
}

/// What the README says of the scene as it stands.
#[test]
fn the_scene_settles_within_its_minute() {
    let mut simulation = springs::step::Simulation::new(&power_line(60)).unwrap();
    simulation.run(1, &mut ()).unwrap();
    let error = deviation(&simulation.nodes().positions);
    assert!(error < 6e-4, "{error:e} m");
}

/// Parabola: for a shallow line H³ = EA w² S²/24, sag = w S²/(8 H).
#[test]
fn the_catenary_agrees_with_the_shallow_formula() {
    let catenary = Catenary::of_the_line();
    let weight: f64 = 1.628 * 9.81;
    let tension = (34.7e6 * weight.powi(2) * 300f64.powi(2) / 24.0).cbrt();
    assert!((catenary.horizontal_tension / tension - 1.0).abs() < 2e-3);
    let sag = weight * 300f64.powi(2) / (8.0 * tension);
    assert!((catenary.sag() / sag - 1.0).abs() < 2e-3);
}

#[test]
fn the_scene_file_is_the_scene_of_the_program() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/power-line.ron");
    assert_eq!(read_scene(&path).unwrap().0, power_line(60));
}
