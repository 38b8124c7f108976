//! Whatever is left out changes nothing: runs with and without it agree, on
//! random scenes and with every method.

mod common;

use common::{Random, append, distance, tangle};
use nalgebra::{Rotation3, Vector3};
use springs::assembly::{Motion, compile};
use springs::scene::{Method, Node, Scene, StepControl, Tangent};
use springs::step::{Frame, Islands, NodeStates, Observer, Outcome, Simulation};
use std::ops::ControlFlow;

/// Explicit methods are stable at this step in all scenes here.
const H: f64 = 2e-3;

fn methods() -> impl Iterator<Item = Method> {
    let all = Method::ALL.iter().copied();
    all.filter(|&method| method != Method::Auto)
}

/// A tangle that every method moves, all springs stretched, so that no matrix
/// is indefinite.
fn stretched_tangle(n_nodes: usize, seed: u64) -> Scene {
    let mut scene = tangle(n_nodes, seed);
    for spring in &mut scene.springs {
        let [a, b] = spring.nodes.map(|node| scene.nodes[node].position);
        spring.rest_length = 0.9 * (a - b).norm().min(spring.rest_length);
        spring.damping = 0.0;
    }
    scene.settings.step = StepControl::Fixed(H);
    scene.settings.duration = 20.0 * H;
    scene
}

fn run(scene: &Scene, skip: bool) -> NodeStates {
    let mut scene = scene.clone();
    scene.settings.skip = skip;
    let mut islands = Islands::new(&scene).unwrap();
    assert_eq!(islands.run(1, &mut ()).unwrap(), Outcome::Finished);
    islands.nodes().clone()
}

/// The largest difference that skipping makes with any method.
fn check(scene: &Scene, allowed: f64) {
    let mut scene = scene.clone();
    for method in methods() {
        scene.settings.method = method;
        let (with, without) = (run(&scene, true), run(&scene, false));
        let difference = distance(&with.positions, &without.positions);
        assert!(
            difference < allowed,
            "{}, {method}: {difference:e}",
            scene.name
        );
    }
}

/// Flattens a scene by `flatten`, gives springs 0.9 of their length as rest
/// length, and turns and shifts everything.
fn flattened(seed: u64, flatten: fn(&Vector3<f64>) -> Vector3<f64>) -> Scene {
    let mut scene = stretched_tangle(12, seed);
    let turn = Rotation3::from_euler_angles(seed as f64, 1.0 - seed as f64, 0.3);
    let shift = Vector3::new(1.0, -2.0, 0.5);
    for node in &mut scene.nodes {
        node.position = turn * flatten(&node.position) + shift;
        node.velocity = turn * flatten(&node.velocity);
    }
    scene.gravity = turn * flatten(&scene.gravity);
    for spring in &mut scene.springs {
        let [a, b] = spring.nodes.map(|node| scene.nodes[node].position);
        spring.rest_length = 0.9 * (a - b).norm();
    }
    scene
}

#[test]
fn planes_in_any_orientation() {
    for seed in 1..6 {
        let scene = flattened(seed, |x| Vector3::new(x.x, 0.0, x.z));
        let motion = compile(&scene).unwrap().motion();
        assert!(matches!(motion, Motion::Plane(_)), "{motion:?}");
        check(&scene, 1e-11);
    }
}

/// Here masses pass through each other.
#[test]
fn lines_in_any_orientation() {
    for seed in 1..6 {
        let scene = flattened(seed, |x| Vector3::new(0.0, 0.0, x.z));
        let motion = compile(&scene).unwrap().motion();
        assert!(matches!(motion, Motion::Line(_)), "{motion:?}");
        check(&scene, 1e-11);
    }
}

#[test]
fn zero_rest_lengths() {
    for seed in 1..6 {
        let mut scene = stretched_tangle(12, seed);
        for spring in &mut scene.springs {
            spring.rest_length = 0.0;
        }
        assert!(compile(&scene).unwrap().is_isotropic());
        check(&scene, 1e-11);
        for &tangent in Tangent::ALL {
            scene.settings.method = Method::LinearlyImplicitEuler;
            scene.settings.tangent = Some(tangent);
            let (with, without) = (run(&scene, true), run(&scene, false));
            let difference = distance(&with.positions, &without.positions);
            assert!(difference < 1e-11, "{tangent}: {difference:e}");
        }
    }
}

#[test]
fn a_constant_matrix_is_factorized_once() {
    let mut net = stretched_tangle(12, 1);
    for spring in &mut net.springs {
        spring.rest_length = 0.0;
    }
    let line = flattened(2, |x| Vector3::new(0.0, 0.0, x.z));
    for mut scene in [net, line] {
        for method in [
            Method::LinearlyImplicitEuler,
            Method::ImplicitEuler,
            Method::TrBdf2,
        ] {
            scene.settings.method = method;
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.run(1, &mut ()).unwrap();
            let counts = simulation.work().counts;
            assert_eq!(counts.factorizations, 1, "{method}");
            assert!(counts.solves >= 20, "{method}");
        }
    }
}

#[test]
fn duplicate_springs() {
    for seed in 1..6 {
        let mut scene = stretched_tangle(8, seed);
        for spring in 0..6 {
            let [a, b] = scene.springs[spring].nodes;
            let other = scene.add_spring(b, a, 30.0);
            scene.springs[other].rest_length *= 0.5;
            scene.springs[other].mass = 0.01;
        }
        assert!(compile(&scene).unwrap().springs().n_merged() >= 6);
        check(&scene, 1e-11);
        let energy = |skip: bool| {
            let mut scene = scene.clone();
            scene.settings.skip = skip;
            Simulation::new(&scene).unwrap().energy().total()
        };
        let (merged, plain) = (energy(true), energy(false));
        assert!((merged - plain).abs() < 1e-13 * plain.abs());
    }
}

/// Springs between fixed nodes, also moving ones, and springs that do nothing.
#[test]
fn springs_without_effect_leave_every_bit() {
    let mut plain = stretched_tangle(10, 4);
    plain
        .springs
        .retain(|spring| spring.nodes != [0, 1] && spring.nodes != [1, 0]);
    let mut scene = plain.clone();
    scene.add_spring(0, 1, 1e3);
    scene.add_spring(4, 7, 0.0);
    let far = scene.add_node(Node::fixed(Vector3::repeat(50.0)));
    scene.add_spring(0, far, 1e5);
    for method in methods() {
        scene.settings.method = method;
        plain.settings.method = method;
        let (with, without) = (run(&scene, true), run(&plain, true));
        assert_eq!(with.positions[..10], without.positions[..10], "{method}");
    }
}

/// Several tangles, far from each other, and loose and fixed nodes, in an order
/// that mixes them.
fn archipelago() -> (Scene, Vec<Scene>) {
    let parts: Vec<Scene> = (1..8).map(|seed| stretched_tangle(6, seed)).collect();
    let mut scene = Scene {
        name: "archipelago".to_owned(),
        ..parts[0].clone()
    };
    scene.nodes.clear();
    scene.springs.clear();
    let n_parts = parts.len();
    for node in 0..6 {
        scene
            .nodes
            .extend(parts.iter().map(|part| part.nodes[node]));
    }
    for (k, part) in parts.iter().enumerate() {
        let springs = part.springs.iter().map(|spring| springs::scene::Spring {
            nodes: spring.nodes.map(|node| node * n_parts + k),
            ..*spring
        });
        scene.springs.extend(springs);
    }
    let mut random = Random(5);
    for _ in 0..3 {
        scene.add_node(Node {
            mass: 1.0,
            velocity: random.vector(1.0),
            ..Node::at(random.vector(1.0))
        });
    }
    scene.add_node(Node::fixed(Vector3::repeat(2.0)));
    (scene, parts)
}

#[test]
fn every_island_makes_its_own_run() {
    let (mut scene, parts) = archipelago();
    check(&scene, 1e-11);
    for method in methods() {
        scene.settings.method = method;
        let together = run(&scene, true);
        for (k, part) in parts.iter().enumerate() {
            let mut part = part.clone();
            part.settings.method = method;
            let alone = run(&part, true);
            for node in 0..6 {
                let here = together.positions[node * parts.len() + k];
                assert_eq!(here, alone.positions[node], "{method}");
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let (part, _) = archipelago();
    let mut scene = part.clone();
    // So many islands that a second thread is worth waking.
    for _ in 0..12 {
        append(&mut scene, &part);
    }
    assert!(scene.springs.len() > 1000);
    for step in [StepControl::Fixed(H), StepControl::Tolerance(1e-4)] {
        scene.settings.step = step;
        scene.settings.method = Method::Auto;
        let run = |threads| {
            let mut scene = scene.clone();
            scene.settings.threads = threads;
            run(&scene, true)
        };
        let alone = run(1);
        for threads in [2, 3, 8] {
            assert_eq!(alone, run(threads), "{threads} threads");
        }
    }
}

/// With a tolerance each island takes steps of its own, and keeps the tolerance.
#[test]
fn islands_have_steps_of_their_own() {
    let (mut scene, _) = archipelago();
    scene.settings.duration = 0.2;
    scene.settings.method = Method::Auto;
    // One of them is much stiffer than the others.
    for spring in &mut scene.springs {
        if spring.nodes[0] % 7 == 3 {
            spring.stiffness *= 1e2;
        }
    }
    let fine = {
        let mut scene = scene.clone();
        scene.settings.method = Method::Dop853;
        scene.settings.step = StepControl::Tolerance(1e-9);
        run(&scene, true)
    };
    scene.settings.step = StepControl::Tolerance(1e-3);
    let mut islands = Islands::new(&scene).unwrap();
    islands.run(1, &mut ()).unwrap();
    // The stiff one makes errors grow, whatever it runs with.
    let off = islands.nodes().positions.iter().zip(&fine.positions);
    let soft = off.enumerate().filter(|(node, _)| node % 7 != 3);
    let error = soft.map(|(_, (a, b))| (a - b).norm()).fold(0.0, f64::max);
    assert!(error < 2e-3, "{error:e}");
    let steps: Vec<u64> = islands
        .parts()
        .iter()
        .map(|part| part.simulation().work().counts.steps)
        .collect();
    assert!(steps.len() >= 9, "seven tangles, loose nodes, fixed nodes");
    assert!(steps.iter().max() > steps.iter().min(), "{steps:?}");
}

#[test]
fn what_is_exactly_at_rest_sleeps_from_the_start() {
    let (mut scene, _) = archipelago();
    scene.gravity = Vector3::zeros();
    // The island of node 2 is released from its rest lengths.
    for node in scene.nodes.iter_mut().skip(2).step_by(7) {
        node.velocity = Vector3::zeros();
    }
    for spring in scene
        .springs
        .iter_mut()
        .filter(|spring| spring.nodes[0] % 7 == 2)
    {
        let [a, b] = spring.nodes.map(|node| scene.nodes[node].position);
        spring.rest_length = Node::at(a).distance(&Node::at(b));
    }
    let islands = Islands::new(&scene).unwrap();
    let asleep = islands
        .parts()
        .iter()
        .filter(|part| part.asleep_since().is_some());
    let asleep: Vec<usize> = asleep
        .flat_map(|part| part.island().nodes.clone())
        .collect();
    assert!(asleep.contains(&16), "{asleep:?}");
    assert!(
        asleep.iter().all(|&node| node % 7 == 2 || node == 45),
        "{asleep:?}"
    );
    check(&scene, 1e-11);
}

/// Where nothing moves at all, the steps that were asked for are made.
#[test]
fn a_scene_at_rest_makes_its_steps() {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, 100.0);
    scene.settings.step = StepControl::Fixed(0.1);
    for &method in Method::ALL {
        scene.settings.method = method;
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(1, &mut ()).unwrap();
        assert_eq!(islands.work().counts.steps, 10, "{method}");
        let start = NodeStates::of(&scene).positions;
        let moved = distance(&islands.nodes().positions, &start);
        assert!(moved < 1e-14, "{method}: {moved:e}");
    }
}

/// Damped tangles come to rest; the bound on how far they could still go holds.
#[test]
fn sleepers_are_no_further_from_rest_than_was_asked() {
    let (mut scene, _) = archipelago();
    for node in scene.nodes.iter_mut().filter(|node| node.fixed) {
        node.velocity = Vector3::zeros();
    }
    for spring in &mut scene.springs {
        spring.damping = 2.0;
    }
    // Swinging, which no dashpot sees, is damped by the method.
    scene.settings.duration = 60.0;
    scene.settings.step = StepControl::Fixed(0.1);
    scene.settings.method = Method::ImplicitEuler;
    let awake = run(&scene, true);
    let reach = 1e-4;
    scene.settings.sleep = Some(reach);
    let mut islands = Islands::new(&scene).unwrap();
    islands.run(1, &mut ()).unwrap();
    let asleep = islands
        .parts()
        .iter()
        .filter(|part| part.asleep_since().is_some());
    let nodes: Vec<usize> = asleep
        .flat_map(|part| part.island().nodes.clone())
        .collect();
    assert!(nodes.len() > 20, "{nodes:?}");
    for node in nodes {
        let off = (islands.nodes().positions[node] - awake.positions[node]).norm();
        assert!(off <= reach, "node {node}: {off:e}");
    }
}

/// Remembers the frames it sees.
#[derive(Default)]
struct Frames(Vec<(f64, NodeStates)>);

impl Observer for Frames {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        assert_eq!(frame.index, self.0.len());
        self.0.push((frame.time, frame.nodes.clone()));
        ControlFlow::Continue(())
    }
}

#[test]
fn frames_of_islands_are_those_of_the_whole() {
    let (mut scene, _) = archipelago();
    scene.settings.method = Method::VelocityVerlet;
    let frames = |skip| {
        let mut scene = scene.clone();
        scene.settings.skip = skip;
        let mut frames = Frames::default();
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(7, &mut frames).unwrap();
        frames.0
    };
    let (with, without) = (frames(true), frames(false));
    assert_eq!(with.len(), 8);
    for ((time, with), (expected_time, without)) in with.iter().zip(&without) {
        assert_eq!(time, expected_time);
        assert!(distance(&with.positions, &without.positions) < 1e-12);
    }
}

/// One island explodes: its node is named as the scene names it, and all others
/// are where it stopped.
#[test]
fn a_failing_island_stops_the_others_at_its_time() {
    let (mut scene, _) = archipelago();
    scene.settings.method = Method::VelocityVerlet;
    scene.settings.duration = 1.0;
    for spring in &mut scene.springs {
        if spring.nodes[0] % 7 == 3 {
            spring.stiffness *= 1e6;
        }
    }
    let mut islands = Islands::new(&scene).unwrap();
    let error = islands.run(1, &mut ()).unwrap_err();
    assert_eq!(error.node % 7, 3, "{error}");
    assert!(error.time > 0.0 && error.time < 1.0, "{error}");
    assert_eq!(islands.time(), error.time);
    for part in islands.parts() {
        let time = part.simulation().stepper().time();
        assert!((time - error.time).abs() < 1.5 * H, "{time}");
    }
}
