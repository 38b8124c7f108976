//! Every method on every hard scene: it ends finite, or in an error that names
//! the step and the node. And what must hold on the way.

mod common;

use common::hard::hard_scenes;
use common::{Random, distance, tangle, with};
use nalgebra::{Rotation3, Vector3};
use springs_scene::{Method, Node, RunOptions, Scene, StepControl};
use springs_step::{Cause, Islands, NodeStates, SetupError, Stepper};

fn methods() -> impl Iterator<Item = Method> {
    Method::ALL.iter().copied()
}

/// The end of a run; `None` if the method refuses the scene.
fn run(scene: &Scene) -> Option<Result<NodeStates, springs_step::StepError>> {
    let mut islands = match Islands::new(scene) {
        Ok(islands) => islands,
        Err(SetupError::VelocityDependent { .. } | SetupError::Massless { .. }) => return None,
        Err(other) => panic!("{}: {other}", scene.name),
    };
    Some(islands.run(1, &mut ()).map(|_| islands.nodes().clone()))
}

#[test]
fn every_method_on_every_hard_scene() {
    for scene in hard_scenes() {
        for method in methods() {
            let scene = Scene {
                settings: springs_scene::Settings {
                    method,
                    ..scene.settings
                },
                ..scene.clone()
            };
            let what = format!("{}, {method}", scene.name);
            match run(&scene) {
                None => {}
                Some(Ok(nodes)) => {
                    let all = nodes.positions.iter().chain(&nodes.velocities);
                    let finite = all.flatten().all(|component| component.is_finite());
                    assert!(finite, "{what}");
                }
                Some(Err(error)) => {
                    assert!(error.node < scene.nodes.len(), "{what}: {error}");
                    assert!(error.step > 0, "{what}: {error}");
                    let suspect = error.suspect.expect("a spring at that node");
                    assert!(suspect.spring < scene.springs.len(), "{what}: {error}");
                }
            }
        }
    }
}

/// Methods for stiff scenes get through all of them at these steps. But where
/// nodes in one point are pushed apart within a step, by a million times their
/// distance, the equations of that step have no one solution, and a method that
/// insists on solving them may say so.
#[test]
fn stable_methods_finish_everything() {
    for mut scene in hard_scenes() {
        for method in [Method::ImplicitEuler, Method::TrBdf2, Method::Auto] {
            scene.settings.method = method;
            let ended = run(&scene).expect("these refuse nothing");
            let is_unsolvable = scene.name == "cloth in one point" && method != Method::Auto;
            match ended {
                Ok(_) => {}
                Err(error) if is_unsolvable => assert_eq!(error.cause, Cause::NotConverged),
                Err(error) => panic!("{}, {method}: {error}", scene.name),
            }
        }
    }
}

/// Steps that fail are made in shorter ones, if that is allowed, and say so.
#[test]
fn failing_steps_can_be_made_in_shorter_ones() {
    let mut scenes = hard_scenes();
    scenes.retain(|scene| scene.name == "cloth in one point");
    let [scene] = &mut scenes[..] else {
        panic!("one such scene");
    };
    scene.settings.method = Method::ImplicitEuler;
    assert!(run(scene).unwrap().is_err());
    let options = RunOptions::default().with_substeps(true);
    let mut islands = Islands::with_options(scene, &options).unwrap();
    islands.run(7, &mut ()).unwrap();
    let counts = islands.work().counts;
    assert!(counts.rescued_steps > 0 && counts.steps > 100, "{counts:?}");
    assert_eq!(islands.time(), scene.settings.duration);
}

/// With a tolerance they take the steps they need.
#[test]
fn tolerances_finish_everything() {
    for mut scene in hard_scenes() {
        let size = scene.size().max(1e-9);
        scene.settings.step = StepControl::Tolerance(1e-2 * size);
        scene.settings.duration *= 0.2;
        for method in [Method::TrBdf2, Method::Auto] {
            scene.settings.method = method;
            let ended = run(&scene).expect("these refuse nothing");
            assert!(
                ended.is_ok(),
                "{}, {method}: {}",
                scene.name,
                ended.unwrap_err()
            );
        }
    }
}

/// At h²K/m = 1e9 and more the masses are lost in the sums of the matrix; the
/// solutions are refined with products spring by spring.
#[test]
fn momentum_survives_extreme_stiffness() {
    let mut scene = tangle(10, 8);
    scene.gravity = Vector3::zeros();
    for node in &mut scene.nodes {
        node.fixed = false;
        // A rigid motion: any other makes forces of 1e9 N.
        let spin = Vector3::new(0.0, 0.1, 0.1);
        node.velocity = Vector3::new(0.0, 1.0, 0.0) + spin.cross(&node.position);
    }
    for spring in &mut scene.springs {
        let [a, b] = spring.nodes.map(|node| scene.nodes[node]);
        spring.rest_length = a.distance(&b);
        spring.stiffness = 1e12;
        spring.damping = 0.0;
    }
    let masses = scene.node_masses();
    let momentum = |nodes: &NodeStates| -> Vector3<f64> {
        nodes
            .velocities
            .iter()
            .zip(&masses)
            .map(|(v, m)| v * *m)
            .sum()
    };
    for method in [
        Method::LinearlyImplicitEuler,
        Method::ImplicitEuler,
        Method::TrBdf2,
        Method::FilteredLeapfrog,
    ] {
        let scene = with(&scene, method, None, 0.01);
        let mut nodes = NodeStates::of(&scene);
        let mut stepper = Stepper::new(&scene).unwrap();
        let mut refinements = 0;
        for _ in 0..20 {
            let before = momentum(&nodes);
            let work = stepper.step(&mut nodes, 0.01).unwrap();
            refinements += work.counts.refinements;
            let relative = (momentum(&nodes) - before).norm() / before.norm();
            // 3e-11 with, 1e-7 without refinement: what is left is the rounding of
            // forces of 1e6 N.
            assert!(relative < 1e-10, "{method}: {relative:e}");
        }
        assert!(refinements > 0, "{method}");
    }
}

/// A massless node between two springs: one spring of 1/K = 1/K₁ + 1/K₂. They
/// are taut from the start: what is slack holds nothing sideways.
#[test]
fn a_massless_node_in_a_series_is_one_spring() {
    let chain = |stiffnesses: &[f64]| {
        let mut scene = Scene {
            gravity: Vector3::new(0.0, 0.0, -9.81),
            ..Scene::default()
        };
        let n = stiffnesses.len();
        let rest_length = 1.0 / n as f64;
        for k in 0..=n {
            let stretched = stiffnesses[..k].iter().map(|k| rest_length + 2.0 / k);
            let position = Vector3::z() * -stretched.sum::<f64>();
            let mass = if k == n { 1.0 } else { 0.0 };
            scene.add_node(Node {
                mass,
                fixed: k == 0,
                ..Node::at(position)
            });
        }
        for (k, &stiffness) in stiffnesses.iter().enumerate() {
            scene.add_spring(k, k + 1, stiffness);
            scene.springs[k].rest_length = rest_length;
        }
        scene.settings.duration = 0.5;
        scene
    };
    for method in [
        Method::LinearlyImplicitEuler,
        Method::ImplicitEuler,
        Method::TrBdf2,
    ] {
        let run = |scene: &Scene| {
            let scene = with(scene, method, None, 5e-3);
            let nodes = super_run(&scene);
            *nodes.positions.last().unwrap()
        };
        let (two, one) = (run(&chain(&[300.0, 600.0])), run(&chain(&[200.0])));
        assert!((two - one).norm() < 1e-10, "{method}: {two} and {one}");
    }
    let refused = run(&with(
        &chain(&[300.0, 600.0]),
        Method::VelocityVerlet,
        None,
        1e-3,
    ));
    assert!(refused.is_none(), "explicit methods divide by the mass");
}

fn super_run(scene: &Scene) -> NodeStates {
    run(scene).expect("not refused").expect("a run")
}

/// Nothing holds it across its two springs: a typed error, not a number.
#[test]
fn a_massless_node_that_springs_do_not_hold_is_named() {
    let mut scene = Scene::default();
    for k in 0..3 {
        let aside = if k == 1 { 0.01 } else { 0.0 };
        let mut node = Node::at(Vector3::new(f64::from(k), aside, 0.0));
        node.fixed = k != 1;
        scene.add_node(node);
    }
    for [a, b] in [[0, 1], [1, 2]] {
        // Squeezed, so that the node is pushed out of the line.
        let spring = scene.add_spring(a, b, 100.0);
        scene.springs[spring].rest_length = 1.5;
    }
    scene.gravity = Vector3::new(0.0, 0.1, -1.0);
    let scene = with(&scene, Method::LinearlyImplicitEuler, None, 1e-2);
    let error = run(&scene).expect("not refused").unwrap_err();
    assert_eq!((error.node, error.cause), (1, Cause::NotPositiveDefinite));
}

/// Between two springs in line and at rest, in whichever direction they lie: not
/// where rounding happens to leave something above zero.
#[test]
fn a_massless_node_in_a_line_is_named_in_every_direction() {
    for [x, y, z] in [
        [1.0, 1.0, 1.0],
        [1.0, 2.0, 3.0],
        [0.3, -0.7, 0.1],
        [0.0, 0.0, 1.0],
    ] {
        for n in [[x, y, z], [-y, x, z], [z, y, -x], [x, -z, y]].map(Vector3::from) {
            for h in [1e-3, 1e-2, 1.0 / 60.0, 0.1] {
                let mut scene = Scene::default();
                for (k, position) in [Vector3::zeros(), n, 2.0 * n, 2.0 * n + Vector3::z()]
                    .into_iter()
                    .enumerate()
                {
                    let mut node = Node::at(position);
                    node.fixed = k == 0;
                    node.mass = if k > 1 { 1.0 } else { 0.0 };
                    scene.add_node(node);
                }
                scene.nodes[2].velocity = Vector3::new(0.3, -0.2, 1.0);
                for k in 0..3 {
                    scene.add_spring(k, k + 1, 1000.0);
                }
                let scene = with(&scene, Method::LinearlyImplicitEuler, None, h);
                let error = run(&scene).expect("not refused").unwrap_err();
                let found = (error.node, error.step, error.cause);
                assert_eq!(found, (1, 1, Cause::NotPositiveDefinite), "{n:?}, {h} s");
            }
        }
    }
}

/// Turned, renumbered, shifted, and measured in other units, a scene does the
/// same.
#[test]
fn the_same_scene_looked_at_differently() {
    let mut scene = tangle(12, 9);
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    scene.settings.duration = 0.1;
    let turn = Rotation3::from_euler_angles(0.3, -1.1, 2.0);
    let mut turned = scene.clone();
    turned.gravity = turn * scene.gravity;
    for node in &mut turned.nodes {
        node.position = turn * node.position;
        node.velocity = turn * node.velocity;
    }
    let order: Vec<usize> = (0..12).map(|k| (5 * k + 3) % 12).collect();
    let mut renumbered = scene.clone();
    for (k, &node) in order.iter().enumerate() {
        renumbered.nodes[k] = scene.nodes[node];
    }
    let place = |node: usize| order.iter().position(|&other| other == node).unwrap();
    for spring in &mut renumbered.springs {
        spring.nodes = spring.nodes.map(place);
    }
    let mut shifted = scene.clone();
    let far = Vector3::new(1e6, -1e6, 1e6);
    for node in &mut shifted.nodes {
        node.position += far;
    }
    let (length, mass) = (1e6, 1e-6);
    let mut rescaled = scene.clone();
    rescaled.gravity *= length;
    for node in &mut rescaled.nodes {
        node.position *= length;
        node.velocity *= length;
        node.mass *= mass;
    }
    for spring in &mut rescaled.springs {
        spring.rest_length *= length;
        spring.stiffness *= mass;
        spring.mass *= mass;
    }
    for method in methods() {
        let run = |scene: &Scene| super_run(&with(scene, method, None, 2e-3)).positions;
        let expected = run(&scene);
        let back: Vec<_> = run(&turned).iter().map(|x| turn.inverse() * x).collect();
        assert!(distance(&back, &expected) < 1e-12, "{method}, turned");
        let positions = run(&renumbered);
        let back: Vec<_> = (0..12).map(|node| positions[place(node)]).collect();
        assert!(distance(&back, &expected) < 1e-12, "{method}, renumbered");
        let back: Vec<_> = run(&shifted).iter().map(|x| x - far).collect();
        // Coordinates of 1e6 m are 1e-10 m apart, which springs multiply: by
        // c·K/m, up to 1e3 1/s, in the velocities of a stage.
        assert!(distance(&back, &expected) < 1e-6, "{method}, shifted");
        let back: Vec<_> = run(&rescaled).iter().map(|x| x / length).collect();
        assert!(distance(&back, &expected) < 1e-10, "{method}, rescaled");
    }
}

/// Nothing to do is done at once.
#[test]
fn empty_scenes_and_scenes_that_do_not_move() {
    let mut random = Random(1);
    let mut fixed = Scene::default();
    for _ in 0..3 {
        fixed.add_node(Node::fixed(random.vector(1.0)));
    }
    fixed.add_spring(0, 1, 10.0);
    let mut single = Scene::default();
    single.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::x())
    });
    let mut instant = tangle(6, 2);
    instant.settings.duration = 0.0;
    for spring in &mut instant.springs {
        spring.damping = 0.0;
    }
    for mut scene in [Scene::default(), fixed, single, instant] {
        for method in methods() {
            scene.settings.method = method;
            for step in [
                StepControl::Fixed(0.1),
                StepControl::Tolerance(1e-3),
                StepControl::Auto,
            ] {
                scene.settings.step = step;
                let nodes = super_run(&scene);
                let start = NodeStates::of(&scene).positions;
                let moved = distance(&nodes.positions, &start);
                assert!(moved < 1e-14, "{method}, {step:?}: {moved:e}");
            }
        }
    }
}
