//! Filtered leapfrog follows the slow motion of very stiff springs from its first step on:
//! in steps that are thousands of times what velocity Verlet needs, positions, tensions and
//! energies are those of closed forms.

mod common;

use common::moving::pendulum;
use common::with;
use nalgebra::{Rotation3, Vector3};
use springs_scene::generate::{Material, block};
use springs_scene::{Method, Node, Scene};
use springs_step::{Frame, Islands, Observer, Simulation};
use std::f64::consts::PI;
use std::ops::ControlFlow;

fn leapfrog(scene: &Scene, h: f64) -> Simulation {
    Simulation::new(&with(scene, Method::FilteredLeapfrog, None, h)).unwrap()
}

/// The tensions of all springs at frames.
struct Tensions(Vec<Vec<f64>>);

impl Observer for Tensions {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.0.push(frame.members.unwrap().tensions.to_vec());
        ControlFlow::Continue(())
    }
}

/// 6 × 6 × 6 nodes, far more springs than hold them, that turn about an axis through their
/// centre, in frames that move or not.
#[test]
fn a_very_stiff_block_turns_as_a_rigid_one() {
    let axis = Vector3::new(0.3, -0.2, 1.0).normalize();
    let rate = 2.0;
    for along in [Vector3::zeros(), Vector3::new(30.0, -20.0, 10.0)] {
        let material = Material {
            stiffness: 1e9,
            ..Material::of_block()
        };
        let mut scene = block(6, material);
        scene.gravity = Vector3::zeros();
        let masses = scene.node_masses();
        let total: f64 = masses.iter().sum();
        let centre = scene.nodes.iter().zip(&masses);
        let centre: Vector3<f64> = centre.map(|(node, m)| node.position * (m / total)).sum();
        for node in &mut scene.nodes {
            node.fixed = false;
            node.velocity = along + axis.cross(&(node.position - centre)) * rate;
        }
        scene.settings.duration = 0.5;
        let worst = |n: usize| {
            let mut simulation = leapfrog(&scene, 0.5 / n as f64);
            while simulation.step().unwrap().is_some() {}
            let turned = Rotation3::from_scaled_axis(axis * (rate * 0.5));
            let moved = simulation.nodes().positions.iter().zip(&scene.nodes);
            let errors = moved.map(|(x, node)| {
                let expected = centre + along * 0.5 + turned * (node.position - centre);
                (x - expected).norm()
            });
            errors.fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(8), worst(16));
        assert!(coarse < 4e-3, "{coarse:e} m");
        assert!((3.5..4.5).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
    }
}

/// A ring of n masses on its way round is held by T = m ω² R/(2 sin(π/n)).
#[test]
fn a_ring_that_turns_is_held_by_its_tension() {
    let (n, radius, rate, mass) = (12, 0.5, 3.0, 0.2);
    let mut scene = Scene::default();
    for i in 0..n {
        let (sin, cos) = (2.0 * PI * f64::from(i) / f64::from(n)).sin_cos();
        scene.add_node(Node {
            mass,
            velocity: Vector3::new(-sin, cos, 0.0) * (radius * rate),
            ..Node::at(Vector3::new(cos, sin, 0.0) * radius)
        });
    }
    for i in 0..n as usize {
        scene.add_spring(i, (i + 1) % n as usize, 1e8);
    }
    scene.settings.duration = 2.0;
    let expected = mass * rate * rate * radius / (2.0 * (PI / f64::from(n)).sin());
    let mut look = Tensions(Vec::new());
    let scene = with(&scene, Method::FilteredLeapfrog, None, 0.02);
    Islands::new(&scene).unwrap().run(40, &mut look).unwrap();
    // At the start the springs are as long as they are given.
    for tension in look.0.iter().skip(1).flatten() {
        let off = (tension / expected - 1.0).abs();
        assert!(off < 3e-3, "{tension} N of {expected} N");
    }
}

/// The k-th standing wave of a taut string of n links has ω = 2 √(T/(m l)) sin(kπ/2n),
/// whatever the stiffness of the links.
#[test]
fn a_taut_string_vibrates_at_its_frequencies() {
    let (n, mass, tension, amplitude) = (20, 0.01, 50.0, 1e-5);
    for (k, stiffness) in [(1, 1e6), (2, 1e8)] {
        let link = 1.0 / f64::from(n);
        let shape = |i: i32| (PI * f64::from(k * i) / f64::from(n)).sin();
        let rate =
            2.0 * (tension / (mass * link)).sqrt() * (PI * f64::from(k) / f64::from(2 * n)).sin();
        let mut scene = Scene::default();
        for i in 0..=n {
            scene.add_node(Node {
                mass,
                fixed: i == 0 || i == n,
                velocity: Vector3::new(0.0, amplitude * rate * shape(i), 0.0),
                ..Node::at(Vector3::new(link * f64::from(i), 0.0, 0.0))
            });
        }
        for i in 0..n as usize {
            scene.add_spring(i, i + 1, stiffness);
            scene.springs[i].rest_length = link - tension / stiffness;
        }
        let period = 2.0 * PI / rate;
        scene.settings.duration = period;
        let worst = |n_steps: u32| {
            let mut simulation = leapfrog(&scene, period / f64::from(n_steps));
            let mut worst = 0.0f64;
            while simulation.step().unwrap().is_some() {
                let phase = rate * simulation.stepper().time();
                for (i, x) in (0..).zip(&simulation.nodes().positions) {
                    let off = x.y / amplitude - shape(i) * phase.sin();
                    worst = worst.max(off.abs());
                }
            }
            worst
        };
        let [coarse, fine] = [50, 100].map(worst);
        assert!(
            coarse < 0.015 && fine < 0.004,
            "{stiffness:e}: {coarse} {fine}"
        );
    }
}

/// A pendulum of 1 m from level, 20 s: m g l = 9.81 J goes to and fro.
#[test]
fn no_energy_is_in_springs_that_only_hold() {
    for stiffness in [1e6, 1e9] {
        let mut scene = pendulum(stiffness);
        scene.settings.duration = 20.0;
        let mut simulation = leapfrog(&scene, 0.01);
        while simulation.step().unwrap().is_some() {
            let energy = simulation.energy().total();
            assert!(energy.abs() < 1e-2, "{energy} J");
        }
    }
}
