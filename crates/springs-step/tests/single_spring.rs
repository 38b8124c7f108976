//! One mass on one spring, moving along it: the step in numbers.

mod common;

use common::with;
use nalgebra::Vector3;
use springs_scene::{Method, Node, Scene};
use springs_step::{NodeStates, Stepper};

const K: f64 = 40.0;
const MASS: f64 = 0.5;
const REST: f64 = 1.0;

/// A mass on a spring along a slanted line, stretched, and its direction.
fn oscillator(stretch: f64, speed: f64) -> (Scene, Vector3<f64>) {
    let u = Vector3::new(2.0, -3.0, 6.0) / 7.0;
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: MASS,
        velocity: u * speed,
        ..Node::at(u * (REST + stretch))
    });
    scene.add_spring(0, 1, K);
    scene.springs[0].rest_length = REST;
    (scene, u)
}

/// Runs the oscillator and calls `check` with (step, stretch, speed).
fn run(scene: &Scene, u: Vector3<f64>, h: f64, steps: i32, mut check: impl FnMut(i32, f64, f64)) {
    let mut stepper = Stepper::new(scene).unwrap();
    let mut nodes = NodeStates::of(scene);
    for step in 1..=steps {
        stepper.step(&mut nodes, h).unwrap();
        check(
            step,
            nodes.positions[1].dot(&u) - REST,
            nodes.velocities[1].dot(&u),
        );
    }
}

#[test]
fn linearly_implicit_euler_follows_its_recurrence() {
    for h in [1e-3, 0.02, 0.3] {
        let (scene, u) = oscillator(0.1, -0.3);
        let scene = with(&scene, Method::LinearlyImplicitEuler, None, h);
        let (mut s, mut v) = (0.1, -0.3);
        run(&scene, u, h, 400, |step, stretch, speed| {
            v = (MASS * v - h * K * s) / (MASS + h * h * K);
            s += h * v;
            assert!((stretch - s).abs() < 1e-12, "h = {h}, step {step}");
            assert!((speed - v).abs() < 1e-12 * (K / MASS).sqrt());
        });
    }
}

#[test]
fn velocity_verlet_follows_its_recurrence() {
    let h = 0.02;
    let (scene, u) = oscillator(0.1, -0.3);
    let scene = with(&scene, Method::VelocityVerlet, None, h);
    let (mut s, mut v) = (0.1, -0.3);
    run(&scene, u, h, 400, |step, stretch, speed| {
        v -= 0.5 * h * K / MASS * s;
        s += h * v;
        v -= 0.5 * h * K / MASS * s;
        assert!((stretch - s).abs() < 1e-12, "step {step}");
        assert!((speed - v).abs() < 1e-12 * (K / MASS).sqrt());
    });
}

/// Eq. 14 as printed has M − h²K. With the K of Eq. 8 its amplification exceeds
/// 1 (1.155 at hω = 0.5), while first-order convergence would not show it: only
/// the energy does.
#[test]
fn the_sign_of_equation_14_is_put_right() {
    let omega = (K / MASS).sqrt();
    let h = 0.5 / omega;
    let (scene, u) = oscillator(0.1, 0.0);
    let scene = with(&scene, Method::LinearlyImplicitEuler, None, h);
    let energy = |s: f64, v: f64| 0.5 * K * s * s + 0.5 * MASS * v * v;
    let mut last = energy(0.1, 0.0);
    let steps = 100;
    run(&scene, u, h, steps, |step, stretch, speed| {
        let now = energy(stretch, speed);
        assert!(now < last, "step {step}: the energy grew");
        last = now;
    });

    // The spectral radius of the step with either sign.
    let radius = |sign: f64| {
        let shrink = 1.0 / (1.0 + sign * 0.25);
        // (s, v/ω)' = [[1 − ¼ shrink, ½ shrink], [−½ shrink, shrink]] (s, v/ω)
        let step = nalgebra::Matrix2::new(1.0 - 0.25 * shrink, 0.5 * shrink, -0.5 * shrink, shrink);
        step.complex_eigenvalues().map(|value| value.norm()).max()
    };
    assert!((radius(-1.0) - 1.155).abs() < 1e-3, "as printed");
    let expected = 0.1 * radius(1.0).powi(steps);
    assert!(last < energy(2.0 * expected, 0.0));
}
