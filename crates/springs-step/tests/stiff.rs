//! No locking at any stiffness, and few Newton iterations.
//!
//! The scenes are a pendulum released level, a chain of 20 released 30° below
//! level and a cloth of 8 × 8 nodes, mostly very stiff.

mod common;

use common::moving::{chain_of_20, pendulum, with_gravity};
use common::{distance, with};
use nalgebra::Vector3;
use springs_scene::{Method, Node, Scene, StepControl, Tangent};
use springs_step::{NodeStates, Simulation, Stepper};

/// 8 × 8 nodes 0.125 m apart, node mass 0.01 kg, two corners fixed.
fn cloth_8(stiffness: f64) -> Scene {
    let mut scene = with_gravity("cloth of 8 × 8");
    let n = 8;
    for j in 0..n {
        for i in 0..n {
            scene.add_node(Node {
                mass: 0.01,
                fixed: j == 0 && (i == 0 || i == n - 1),
                ..Node::at(Vector3::new(i as f64, j as f64, 0.0) * 0.125)
            });
        }
    }
    let offsets = [
        (1, 0, 1.0),
        (0, 1, 1.0),
        (1, 1, 0.5),
        (-1, 1, 0.5),
        (2, 0, 0.1),
        (0, 2, 0.1),
    ];
    for (di, dj, factor) in offsets {
        for j in 0..n as isize {
            for i in 0..n as isize {
                let (k, l) = (i + di, j + dj);
                if (0..n as isize).contains(&k) && (0..n as isize).contains(&l) {
                    let index = |i: isize, j: isize| (j * n as isize + i) as usize;
                    scene.add_spring(index(i, j), index(k, l), stiffness * factor);
                }
            }
        }
    }
    scene
}

/// Largest error of positions after one second of TR-BDF2 in `steps` steps.
fn error_after_a_second(scene: &Scene, steps: usize) -> f64 {
    let run = |steps: usize| {
        let scene = with(scene, Method::TrBdf2, None, 1.0 / steps as f64);
        common::after(&scene, steps).positions
    };
    distance(&run(steps), &run(20 * steps))
}

#[test]
fn tr_bdf2_does_not_lock() {
    for stiffness in [1e3, 1e5, 1e8, 1e10] {
        let pendulum = error_after_a_second(&pendulum(stiffness), 50);
        assert!(pendulum < 2e-3, "pendulum, K = {stiffness:e}: {pendulum:e}");
    }
    // The tip of the chain whips: more steps for the same error, but as many
    // at any stiffness, and of order 2.
    for stiffness in [1e8, 1e10] {
        let [coarse, fine] =
            [100, 200].map(|steps| error_after_a_second(&chain_of_20(stiffness), steps));
        assert!(fine < 2e-3, "chain, K = {stiffness:e}: {fine:e}");
        let order = (coarse / fine).log2();
        assert!((order - 2.0).abs() < 0.3, "{order}");
    }
}

/// What locking is: the note's own step hardly moves where the converged
/// methods fall.
#[test]
fn the_notes_step_locks_and_filtered_tension_does_not() {
    let after = |method, tangent| {
        let scene = with(&pendulum(1e8), method, tangent, 1.0 / 80.0);
        common::after(&scene, 80).positions
    };
    let euler = after(Method::ImplicitEuler, None);
    let filtered = after(Method::LinearlyImplicitEuler, Some(Tangent::Filtered));
    let exact = after(Method::LinearlyImplicitEuler, Some(Tangent::Exact));
    let reference = after(Method::TrBdf2, None);
    let error = |positions: &[Vector3<f64>]| distance(positions, &reference);
    assert!(error(&exact) > 1.0, "{:e}", error(&exact));
    assert!((error(&filtered) / error(&euler) - 1.0).abs() < 0.1);
}

fn newton_iterations(scene: &Scene, h: f64) -> f64 {
    let mut scene = with(scene, Method::ImplicitEuler, None, h);
    scene.settings.duration = 1.0;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.run(1, &mut ()).unwrap();
    let counts = simulation.work().counts;
    counts.newton_iterations as f64 / counts.steps as f64
}

/// Those with old matrices, of which some are made to save a factor, are among them.
#[test]
fn newton_needs_few_iterations() {
    let chain = newton_iterations(&chain_of_20(1e8), 0.1);
    let cloth = newton_iterations(&cloth_8(1e8), 0.02);
    assert!(chain <= 7.0, "{chain}");
    assert!(cloth <= 9.1, "{cloth}");
}

#[test]
fn implicit_euler_converges_at_every_step() {
    let scenes = [
        pendulum(1e5),
        chain_of_20(1e8),
        cloth_8(500.0),
        cloth_8(1e8),
        common::tangle(20, 2),
    ];
    for scene in scenes {
        for exponent in -9..=3 {
            let h = 10f64.powi(exponent);
            let scene = with(&scene, Method::ImplicitEuler, None, h);
            let mut stepper = Stepper::new(&scene).unwrap();
            let mut nodes = NodeStates::of(&scene);
            for _ in 0..5 {
                stepper.step(&mut nodes, h).unwrap();
            }
        }
    }
}

#[test]
fn adaptive_steps_hardly_depend_on_the_stiffness() {
    let run = |stiffness: f64, tolerance: f64| {
        let mut scene = pendulum(stiffness);
        scene.settings.method = Method::TrBdf2;
        scene.settings.step = StepControl::Tolerance(tolerance);
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let fine = with(&scene, Method::TrBdf2, None, 1e-5);
        let reference = common::after(&fine, 100_000);
        let error = distance(&simulation.nodes().positions, &reference.positions);
        (simulation.work().counts.steps, error)
    };
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let (soft_steps, soft_error) = run(60.0, tolerance);
        let (stiff_steps, stiff_error) = run(1e8, tolerance);
        assert!(stiff_steps <= 2 * soft_steps, "{soft_steps}, {stiff_steps}");
        for error in [soft_error, stiff_error] {
            assert!(error <= 1.5 * tolerance, "{error:e} of {tolerance:e}");
        }
    }
}
