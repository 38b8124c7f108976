//! Filtered leapfrog with the stiff springs alone in its matrix.

mod common;

use common::{after, distance, solved, with};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::generate::{Material, chain};
use springs_scene::{Method, Node, RunOptions, Scene, StepControl};
use springs_step::{FilteredLeapfrog, Islands, NodeStates, Outcome, Simulation};

/// A chain of bars joined by cables, uneven so that nothing stays in a plane; free or held.
fn bars_and_cables(is_held: bool) -> Scene {
    let material = Material {
        stiffness: 1e3,
        ..Material::of_chain(18)
    };
    let mut scene = chain(18, material);
    scene.name = "bars and cables".to_owned();
    for spring in scene.springs.iter_mut().skip(1).step_by(3) {
        spring.stiffness = 1e8;
    }
    for (index, node) in scene.nodes.iter_mut().enumerate() {
        node.fixed &= is_held;
        node.velocity = Vector3::new(0.0, 0.1, 0.05) * f64::from(index as u32 % 5);
    }
    scene.settings.duration = 0.25;
    scene
}

/// To be run with a tolerance.
fn leapfrog(scene: &Scene, tolerance: f64) -> Scene {
    let mut scene = scene.clone();
    scene.settings.method = Method::FilteredLeapfrog;
    scene.settings.step = StepControl::Tolerance(tolerance);
    scene
}

/// After steps of fixed size, and whether the matrix had stiff springs alone: that shows in
/// the number of symbolic factorizations, one of the whole, one of a part.
fn run(scene: &Scene, h: f64) -> (Simulation, bool) {
    let mut scene = scene.clone();
    scene.settings.step = StepControl::Fixed(h);
    let options = RunOptions::default();
    let method = |system: &System| -> Box<dyn springs_step::Method> {
        let method = FilteredLeapfrog::new(system, &options).unwrap();
        Box::new(method.for_tolerance())
    };
    let mut simulation = Simulation::with_method(&scene, &options, method).unwrap();
    simulation.run(1, &mut ()).unwrap();
    let has_part = simulation.work().counts.symbolic_factorizations == 2;
    (simulation, has_part)
}

#[test]
fn order_is_two_and_errors_are_those_of_all_springs_in_the_matrix() {
    let scene = bars_and_cables(true);
    let exact = solved(&scene, Method::BlanesMoan6, 1e-9);
    let errors: Vec<f64> = (0..4)
        .map(|k| {
            let n = 128 << k;
            let h = scene.settings.duration / f64::from(n);
            let (simulation, has_part) = run(&scene, h);
            assert!(has_part, "{n}");
            distance(&simulation.nodes().positions, &exact)
        })
        .collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.7..2.3).contains(&order), "{errors:?}");
    }
    let h = scene.settings.duration / 128.0;
    let nodes = after(&with(&scene, Method::FilteredLeapfrog, None, h), 128);
    let ratio = errors[0] / distance(&nodes.positions, &exact);
    assert!((0.1..2.0).contains(&ratio), "{ratio}");
    // A dashpot of next to nothing keeps all springs in the matrix.
    let mut damped = scene.clone();
    damped.springs[0].damping = 1e-12;
    let (simulation, has_part) = run(&damped, h);
    assert!(!has_part);
    assert!(distance(&simulation.nodes().positions, &nodes.positions) < 1e-9);
}

#[test]
fn linear_momentum_stays() {
    let scene = bars_and_cables(false);
    let momentum = |nodes: &NodeStates| {
        let masses = scene.node_masses();
        let momenta = masses.iter().zip(&nodes.velocities).map(|(m, v)| v * *m);
        momenta.sum::<Vector3<f64>>()
    };
    let mut still = scene.clone();
    still.gravity = Vector3::zeros();
    still.settings.duration = 2.0;
    let before = momentum(&NodeStates::of(&still));
    let (simulation, has_part) = run(&still, 1e-3);
    assert!(has_part);
    let change = (momentum(simulation.nodes()) - before).norm();
    assert!(change < 1e-12 * before.norm(), "{change:e}");
}

/// Tensions of stiff springs are what they hold, those of soft ones what positions say.
#[test]
fn tensions_are_those_of_a_fine_run() {
    let mut scene = Scene::default();
    for (index, mass) in [0.0, 2.0, 3.0].into_iter().enumerate() {
        scene.add_node(Node {
            fixed: index == 0,
            mass,
            ..Node::at(Vector3::new(0.0, 0.0, -(index as f64)))
        });
    }
    // A weight of 3 kg on a soft spring under one of 2 kg on a very stiff one, in balance.
    scene.add_spring(0, 1, 1e8);
    scene.add_spring(1, 2, 300.0);
    let g = scene.gravity.norm();
    scene.springs[0].rest_length = 1.0 - 5.0 * g / 1e8;
    scene.springs[1].rest_length = 1.0 - 3.0 * g / 300.0;
    scene.nodes[2].velocity = Vector3::new(0.0, 0.1, 0.0);
    scene.settings.duration = 0.2;
    let (simulation, has_part) = run(&scene, 2e-3);
    assert!(has_part);
    let method = simulation.stepper().method();
    let tensions = method.tensions().unwrap();
    let mut held: Vec<f64> = tensions.to_vec();
    held.sort_by(f64::total_cmp);
    assert!((held[0] - 3.0 * g).abs() < 0.05, "{held:?}");
    assert!((held[1] - 5.0 * g).abs() < 0.05, "{held:?}");
}

#[test]
fn a_run_that_was_resumed_gives_the_same_bits() {
    let scene = leapfrog(&bars_and_cables(true), 1e-5);
    let mut through = Islands::new(&scene).unwrap();
    through.run(5, &mut ()).unwrap();
    let mut stops = 0;
    let mut resumed = Islands::new(&scene).unwrap();
    let mut stop = StopSoon { left: 7 };
    while resumed.run(5, &mut stop).unwrap() == Outcome::Stopped {
        let words = resumed.save();
        resumed = Islands::new(&scene).unwrap();
        resumed.restore(words).unwrap();
        stop.left = 7;
        stops += 1;
    }
    assert!(stops > 10);
    assert_eq!(resumed.nodes(), through.nodes());
    let [symbolic, of_through] =
        [&resumed, &through].map(|run| run.work().counts.symbolic_factorizations);
    assert_eq!(symbolic, of_through);
}

struct StopSoon {
    left: usize,
}

impl springs_step::Observer for StopSoon {
    fn step(&mut self, _time: f64, _steps: u64) -> std::ops::ControlFlow<()> {
        self.left -= 1;
        if self.left == 0 {
            std::ops::ControlFlow::Break(())
        } else {
            std::ops::ControlFlow::Continue(())
        }
    }
}

/// Springs that are changed are in the matrix from then on.
#[test]
fn changed_springs_count() {
    let scene = leapfrog(&bars_and_cables(true), 1e-5);
    let mut simulation = Simulation::changeable(&scene, &RunOptions::default()).unwrap();
    for _ in 0..5 {
        simulation.step().unwrap();
    }
    let of_trials = simulation.trial_work().counts;
    assert!(of_trials.symbolic_factorizations > 0, "{of_trials:?}");
    let stiff = vec![1e8; scene.springs.len()];
    simulation.set_stiffnesses(&stiff).unwrap();
    while simulation.stepper().time() < 0.1 {
        simulation.step().unwrap();
    }
    let lengths = scene.springs.iter().map(|spring| {
        let [a, b] = spring.nodes.map(|node| simulation.nodes().positions[node]);
        ((a - b).norm() / spring.rest_length - 1.0).abs()
    });
    let most = lengths.fold(0.0, f64::max);
    assert!(most < 0.1, "{most}");
}

#[test]
fn a_tolerance_is_met() {
    let scene = bars_and_cables(true);
    let exact = solved(&scene, Method::BlanesMoan6, 1e-9);
    for tolerance in [1e-3, 1e-4] {
        let x = solved(&scene, Method::FilteredLeapfrog, tolerance);
        let error = distance(&x, &exact);
        assert!(error < tolerance, "{error:e}");
    }
}
