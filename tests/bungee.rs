//! The bungee jump of the examples against the energy balance of its source.

use springs::io::read_scene;
use springs::step::{NodeStates, Stepper};
use std::path::Path;

/// Without damping and with a cord that weighs next to nothing, the jumper
/// stops where m g (L + y) = ½ k y²: 78.8 m below the platform.
#[test]
fn the_lowest_point_is_where_the_energy_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/bungee.ron");
    let mut scene = read_scene(&path).unwrap().0;
    for spring in &mut scene.springs {
        spring.damping = 0.0;
        spring.mass = 1e-3;
    }
    let (weight, stiffness, length) = (75.0 * 9.81, 40.0, 25.0);
    let stretch = (weight + f64::sqrt(weight * (weight + 2.0 * stiffness * length))) / stiffness;
    let expected = length + stretch;
    assert!((expected - 78.8).abs() < 0.1);

    let mut stepper = Stepper::new(&scene).unwrap();
    let mut nodes = NodeStates::of(&scene);
    let mut lowest = f64::INFINITY;
    while stepper.time() < 6.0 {
        stepper.step(&mut nodes, 5e-4).unwrap();
        lowest = lowest.min(nodes.positions[26].z);
    }
    let drop = 80.0 - lowest;
    assert!(
        (drop / expected - 1.0).abs() < 5e-3,
        "{drop} m, not {expected} m"
    );
}
