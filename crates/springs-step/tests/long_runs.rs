//! Long runs: no drift of energy, momentum kept.

mod common;

use common::{tangle, with};
use nalgebra::Vector3;
use springs_scene::{Method, Node, Scene};
use springs_step::{NodeStates, Stepper};

/// Two masses on a spring, far from rest and turning.
fn rotor() -> Scene {
    let mut scene = Scene::default();
    for (x, y) in [(-0.5, -1.0), (0.5, 1.0)] {
        scene.add_node(Node {
            mass: 1.0,
            velocity: Vector3::new(0.3, y, 0.1),
            ..Node::at(Vector3::new(x, 0.0, 0.0))
        });
    }
    scene.add_spring(0, 1, 100.0);
    scene.springs[0].rest_length = 0.8;
    scene
}

/// The energy error in the last tenth of a million steps is that of the first.
#[test]
fn energy_does_not_drift() {
    for (method, steps) in [
        (Method::VelocityVerlet, 1_000_000),
        (Method::ImplicitMidpoint, 100_000),
    ] {
        let h = 0.01;
        let scene = with(&rotor(), method, None, h);
        let mut stepper = Stepper::new(&scene).unwrap();
        let mut nodes = NodeStates::of(&scene);
        let energy = |stepper: &Stepper| {
            let state = stepper.state();
            stepper.system().energy(&state.x, &state.v).total()
        };
        let start = energy(&stepper);
        let mut worst = [0f64; 10];
        for step in 0..steps {
            stepper.step(&mut nodes, h).unwrap();
            let tenth = &mut worst[10 * step / steps];
            *tenth = tenth.max((energy(&stepper) - start).abs());
        }
        assert!(
            worst[0] > 0.0 && worst[9] <= 1.05 * worst[0],
            "{method}: {worst:?}"
        );
    }
}

/// Nothing outside touches the scene: momentum to 1e-12, angular momentum to
/// 1e-11 of what its nodes carry, for the methods that promise the latter.
#[test]
fn free_flight_keeps_momentum() {
    let mut scene = tangle(4, 7);
    scene.gravity = Vector3::zeros();
    for node in &mut scene.nodes {
        node.fixed = false;
    }
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    let masses = scene.node_masses();
    let carried = |nodes: &NodeStates, lever: bool| -> (Vector3<f64>, f64) {
        let (mut sum, mut scale) = (Vector3::zeros(), 0.0);
        for ((m, x), v) in masses.iter().zip(&nodes.positions).zip(&nodes.velocities) {
            let p = v * *m;
            let one = if lever { x.cross(&p) } else { p };
            sum += one;
            scale += if lever { x.norm() * p.norm() } else { p.norm() };
        }
        (sum, scale)
    };
    for (method, angular) in [
        (Method::VelocityVerlet, true),
        (Method::ImplicitMidpoint, true),
        (Method::FilteredLeapfrog, false),
    ] {
        let h = 1e-3;
        let scene = with(&scene, method, None, h);
        let mut stepper = Stepper::new(&scene).unwrap();
        let mut nodes = NodeStates::of(&scene);
        let start = [false, true].map(|lever| carried(&nodes, lever).0);
        for _ in 0..100_000 {
            stepper.step(&mut nodes, h).unwrap();
        }
        let (p, scale) = carried(&nodes, false);
        let error = (p - start[0]).norm() / scale;
        assert!(error < 1e-12, "{method}: momentum {error:e}");
        let (l, scale) = carried(&nodes, true);
        let error = (l - start[1]).norm() / scale;
        assert!(
            !angular || error < 1e-11,
            "{method}: angular momentum {error:e}"
        );
    }
}
