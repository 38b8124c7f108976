//! Whatever is left out changes nothing: runs with and without it agree, on
//! random scenes and with every method.

mod common;

use common::laws::{with_laws, with_mixed_laws};
use common::{Random, append, distance, tangle};
use nalgebra::{Rotation3, Vector3};
use springs_assembly::{Compilation, Motion, compile, compile_with};
use springs_scene::{Method, Node, RunOptions, Scene, StepControl, Tangent};
use springs_step::{
    Cause, Frame, Islands, LinearlyImplicitEuler, NodeStates, Observer, Outcome, Rodas4,
    Simulation, Stepper,
};
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
    run_with(scene, &RunOptions::default().with_skip(skip))
}

fn run_with(scene: &Scene, options: &RunOptions) -> NodeStates {
    let mut islands = Islands::with_options(scene, options).unwrap();
    assert_eq!(islands.run(1, &mut ()).unwrap(), Outcome::Finished);
    islands.nodes().clone()
}

/// Skipping makes no larger difference than this with any method, or than rounding does
/// at every step where two masses pass each other so near that the direction of their
/// spring is rounding: 30 times what changing the start by a unit of it does.
fn check(scene: &Scene, allowed: f64) {
    let mut scene = scene.clone();
    for method in methods() {
        scene.settings.method = method;
        let (with, without) = (run(&scene, true), run(&scene, false));
        let difference = distance(&with.positions, &without.positions);
        assert!(
            difference < allowed || difference < 30.0 * sensitivity(&scene, &without),
            "{}, {method}: {difference:e}",
            scene.name
        );
    }
}

/// By how much a run ends elsewhere if a node starts a unit of rounding elsewhere.
fn sensitivity(scene: &Scene, nodes: &NodeStates) -> f64 {
    let ends = (0..scene.nodes.len()).map(|node| {
        let mut moved = scene.clone();
        moved.nodes[node].position *= 1.0 + f64::EPSILON;
        distance(&run(&moved, false).positions, &nodes.positions)
    });
    ends.fold(0.0, f64::max)
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

#[test]
fn springs_with_laws_in_space_planes_and_lines() {
    for seed in 1..6 {
        let flat = [
            flattened(seed, |x| *x),
            flattened(seed, |x| Vector3::new(x.x, 0.0, x.z)),
            flattened(seed, |x| Vector3::new(0.0, 0.0, x.z)),
        ];
        for (dimension, scene) in [3, 2, 1].into_iter().zip(flat) {
            let scene = with_mixed_laws(scene, seed);
            assert_eq!(compile(&scene).unwrap().motion().dimension(), dimension);
            check(&scene, 1e-11);
        }
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
            let stepper = simulation.stepper();
            let is_constant = simulation.choice().has_constant_matrix(stepper.system());
            assert!(is_constant, "{method}");
            assert!(counts.solves >= 20, "{method}");
        }
    }
}

/// Filtered tensions are in the matrix whatever the rest lengths.
#[test]
fn what_is_said_to_be_constant_is_factorized_once() {
    let mut scene = stretched_tangle(12, 1);
    for spring in &mut scene.springs {
        spring.rest_length = 0.0;
    }
    for method in methods() {
        for &tangent in Tangent::ALL {
            scene.settings.method = method;
            let has_tangent = method == Method::LinearlyImplicitEuler;
            scene.settings.tangent = Some(tangent).filter(|_| has_tangent);
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.run(1, &mut ()).unwrap();
            let system = simulation.stepper().system();
            let is_constant = simulation.choice().has_constant_matrix(system);
            let factorizations = simulation.work().counts.factorizations;
            let once = factorizations == 1;
            assert_eq!(once, is_constant, "{method} {tangent}: {factorizations}");
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
            let same = scene.add_spring(b, a, 20.0);
            scene.springs[same].rest_length = scene.springs[spring].rest_length;
        }
        let n_merged = compile(&scene).unwrap().n_merged();
        assert!(n_merged >= 6, "those of the same rest length: {n_merged}");
        check(&scene, 1e-11);
        let energy = |skip: bool| {
            let options = RunOptions::default().with_skip(skip);
            let simulation = Simulation::with_options(&scene, &options).unwrap();
            simulation.energy().total()
        };
        let (merged, plain) = (energy(true), energy(false));
        assert!((merged - plain).abs() < 1e-13 * plain.abs());
    }
}

/// A scene of nodes (position, mass; fixed without one) and springs (nodes,
/// stiffness, rest length).
fn scene_of(nodes: &[([f64; 3], f64)], springs: &[([usize; 2], f64, f64)], step: f64) -> Scene {
    let mut scene = Scene::default();
    for &(position, mass) in nodes {
        scene.add_node(Node {
            mass,
            fixed: mass == 0.0,
            ..Node::at(position.into())
        });
    }
    for &([a, b], stiffness, rest_length) in springs {
        let spring = scene.add_spring(a, b, stiffness);
        scene.springs[spring].rest_length = rest_length;
    }
    scene.settings.method = Method::LinearlyImplicitEuler;
    scene.settings.step = StepControl::Fixed(step);
    scene
}

/// How far apart runs with and without skipping end, and how many springs were
/// clamped on the way with it.
fn difference(scene: &Scene) -> (f64, u64) {
    let mut islands = Islands::new(scene).unwrap();
    islands.run(1, &mut ()).unwrap();
    let clamped = islands.work().counts.clamped_springs;
    let without = run(scene, false);
    (
        distance(&islands.nodes().positions, &without.positions),
        clamped,
    )
}

/// One of two springs between the same nodes is compressed, the other stretched:
/// Σ max(T, 0) is not max(ΣT, 0).
#[test]
fn duplicate_springs_are_clamped_one_by_one() {
    let mut scene = scene_of(
        &[([0.0; 3], 0.0), ([1.0, 0.0, 0.0], 1.0)],
        &[([0, 1], 1000.0, 2.0), ([0, 1], 1000.0, 0.1)],
        0.05,
    );
    scene.gravity = Vector3::new(0.0, 0.0, -9.81);
    scene.nodes[1].velocity = Vector3::y();
    scene.settings.duration = 0.5;
    for &tangent in Tangent::ALL {
        scene.settings.tangent = Some(tangent);
        let (difference, _) = difference(&scene);
        assert!(difference < 1e-12, "{tangent}: {difference:e}");
    }
}

/// A part that is indefinite does not clamp the springs of another.
#[test]
fn parts_are_clamped_on_demand_each_by_itself() {
    let mut scene = scene_of(
        &[
            ([0.0; 3], 0.0),
            ([1.0, 0.0, 0.1], 1.0),
            ([9.0, 0.0, 0.0], 0.0),
            ([10.0, 0.0, 0.1], 1.0),
        ],
        &[([0, 1], 1000.0, 2.0), ([2, 3], 100.0, 1.2)],
        0.1,
    );
    scene.nodes[1].velocity = Vector3::y();
    scene.nodes[3].velocity = Vector3::y();
    scene.settings.duration = 0.5;
    let (first, clamped) = difference(&scene);
    assert!(first < 1e-12, "{first:e}");
    assert!(clamped > 0);
    // So many that parts have several of them.
    let pair = scene.clone();
    for _ in 0..1200 {
        append(&mut scene, &pair);
    }
    let positions = run(&scene, true).positions;
    for copy in positions.chunks(4) {
        let off = distance(copy, &positions[..4]);
        assert!(off < 1e-12, "{off:e}");
    }
}

/// Across its plane the matrix is indefinite, in it it is not: clamping changes the
/// motion in the plane.
#[test]
fn clamping_on_demand_looks_across_a_plane() {
    let mut scene = scene_of(
        &[
            ([-1.0, 0.0, 0.0], 0.0),
            ([1.0, 0.0, 0.0], 0.0),
            ([0.0, 1.0, 0.0], 0.0),
            ([0.1, 0.0, 0.0], 1.0),
        ],
        &[
            ([0, 3], 100.0, 2.0),
            ([1, 3], 100.0, 2.0),
            ([2, 3], 500.0, 1.0),
        ],
        0.2,
    );
    scene.gravity = Vector3::new(1.0, -9.81, 0.0);
    assert!(matches!(
        compile(&scene).unwrap().motion(),
        Motion::Plane(_)
    ));
    for method in [Method::LinearlyImplicitEuler, Method::FilteredLeapfrog] {
        scene.settings.method = method;
        let (difference, clamped) = difference(&scene);
        assert!(difference < 1e-12, "{method}: {difference:e}");
        // Filtered leapfrog has no negative tension in its matrix.
        assert_eq!(clamped > 0, method == Method::LinearlyImplicitEuler);
    }
}

/// Nodes within rounding of a plane, joined by a spring that points out of it.
#[test]
fn a_short_spring_across_a_plane_pushes_out_of_it() {
    let mut scene = scene_of(
        &[
            ([1000.0, 0.0, 0.0], 0.0),
            ([1001.0, 0.0, 0.0], 1.0),
            ([1001.0, 1.0, 0.0], 1.0),
            ([1001.0, 1.0, 5e-12], 1.0),
        ],
        &[
            ([0, 1], 100.0, 1.0),
            ([1, 2], 100.0, 1.0),
            ([2, 3], 100.0, 0.2),
        ],
        0.01,
    );
    scene.settings.method = Method::TrBdf2;
    scene.settings.duration = 0.3;
    assert_eq!(compile(&scene).unwrap().motion(), Motion::Space);
    let positions = run(&scene, true).positions;
    let apart = (positions[2] - positions[3]).norm();
    assert!(apart > 0.1, "{apart:e}");
}

/// How runs with and without skipping end; errors without the words about it.
fn ends(scene: &Scene) -> [Result<NodeStates, (Cause, usize)>; 2] {
    [true, false].map(|skip| {
        let options = RunOptions::default().with_skip(skip);
        let mut islands = Islands::with_options(scene, &options).unwrap();
        let done = islands.run(1, &mut ());
        done.map_err(|error| (error.cause, error.node))?;
        Ok(islands.nodes().clone())
    })
}

/// What springs do not hold across a line or plane has no position in space, and
/// that it never leaves is no help.
#[test]
fn massless_nodes_must_be_held_in_all_directions() {
    let mut scene = scene_of(
        &[
            ([0.0; 3], 0.0),
            ([0.0, 0.0, -1.0], 1.0),
            ([0.0, 0.0, -2.0], 1.0),
        ],
        &[([0, 1], 100.0, 1.0), ([1, 2], 100.0, 1.0)],
        0.01,
    );
    scene.nodes[1].mass = 0.0;
    scene.settings.duration = 0.5;
    for bend in [0.0, 0.3] {
        scene.nodes[2].position.x = bend;
        let a = scene.nodes[1].position - scene.nodes[2].position;
        scene.springs[1].rest_length = a.norm();
        scene.gravity = Vector3::new(0.0, 0.0, -9.81);
        for method in [
            Method::LinearlyImplicitEuler,
            Method::TrBdf2,
            Method::ImplicitEuler,
        ] {
            scene.settings.method = method;
            for end in ends(&scene) {
                let expected = (Cause::NotPositiveDefinite, 1);
                assert_eq!(end.unwrap_err(), expected, "{method}");
            }
        }
    }
    // Stretched springs hold it.
    for spring in &mut scene.springs {
        spring.rest_length *= 0.9;
    }
    for bend in [0.0, 0.3] {
        scene.nodes[2].position.x = bend;
        scene.settings.method = Method::TrBdf2;
        let [with, without] = ends(&scene).map(Result::unwrap);
        let off = distance(&with.positions, &without.positions);
        assert!(off < 1e-11, "{off:e}");
    }
}

/// RODAS4 does not clamp: on a line, too, its step fails where the matrix of a
/// compressed column is indefinite across.
#[test]
fn rodas4_fails_on_a_line_as_it_does_in_space() {
    let mut scene = scene_of(
        &[([0.0; 3], 0.0), ([0.0, 0.0, 1.0], 1.0)],
        &[([0, 1], 1e4, 1.5)],
        0.1,
    );
    scene.settings.method = Method::Rodas4;
    for end in ends(&scene) {
        assert_eq!(end.unwrap_err(), (Cause::NotPositiveDefinite, 1));
    }
    scene.settings.step = StepControl::Fixed(0.01);
    let [with, without] = ends(&scene).map(Result::unwrap);
    let off = distance(&with.positions, &without.positions);
    assert!(off < 1e-11, "{off:e}");
}

/// A random scene that buckles: some springs compressed, some doubled, some parts
/// of their own, in space, in a plane or on a line, with a step that resolves
/// little.
fn buckling(seed: u64) -> Scene {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) | 1);
    let mut scene = tangle(4 + random.below(5), seed);
    if random.below(3) == 0 {
        append(&mut scene, &tangle(5, seed + 5000));
    }
    for _ in 0..random.below(4) {
        let spring = random.below(scene.springs.len());
        let [a, b] = scene.springs[spring].nodes;
        let other = scene.add_spring(b, a, random.between(5.0, 300.0));
        let stretch = [1.0, random.between(0.3, 1.6)][random.below(2)];
        scene.springs[other].rest_length = scene.springs[spring].rest_length * stretch;
    }
    let flatten = random.below(3);
    let turn = Rotation3::from_euler_angles(random.unit(), random.unit(), random.unit());
    // A turned plane is off by rounding, and what buckles out of it then grows in
    // three dimensions.
    let turned = flatten == 0;
    let flat = |x: &Vector3<f64>| {
        let flat = match flatten {
            0 => *x,
            1 => Vector3::new(x.x, 0.0, x.z),
            _ => Vector3::new(0.0, 0.0, x.z),
        };
        if turned { turn * flat } else { flat }
    };
    for node in &mut scene.nodes {
        node.position = flat(&node.position);
        node.velocity = flat(&node.velocity);
    }
    scene.gravity = flat(&scene.gravity);
    let dashpots = random.below(2) as f64;
    for spring in &mut scene.springs {
        spring.damping *= dashpots;
        spring.rest_length *= random.between(0.7, 1.5);
    }
    let step = [0.01, 0.03, 0.1][random.below(3)];
    scene.settings.step = StepControl::Fixed(step);
    scene.settings.duration = 4.0 * step;
    scene
}

/// Skipping makes no difference where matrices are indefinite, with any method
/// and tangent: the same causes of failure, or the same positions.
#[test]
fn random_scenes_that_buckle() {
    let mut clamped = 0;
    for seed in 0..700 {
        let mut scene = buckling(seed);
        if seed % 5 == 4 {
            // Whether Newton's method finds an end of a long step is a matter of luck.
            scene = with_mixed_laws(scene, seed);
            scene.settings.step = StepControl::Fixed(0.01);
            scene.settings.duration = 0.04;
        }
        let step = scene.settings.step;
        for method in methods() {
            for &tangent in Tangent::ALL {
                scene.settings.method = method;
                scene.settings.tangent = None;
                scene.settings.step = step;
                if method == Method::LinearlyImplicitEuler {
                    scene.settings.tangent = Some(tangent);
                } else if tangent != Tangent::Exact {
                    continue;
                }
                let Ok(islands) = Islands::new(&scene) else {
                    // Dashpots, which it does not treat.
                    continue;
                };
                if !islands.largest().simulation().choice().has_matrix() {
                    scene.settings.step = StepControl::Fixed(1e-3);
                }
                let name = format!("{}, {method} {tangent}", scene.name);
                // Newton's method leaves up to 1e3 times its rounding.
                let allowed = match method {
                    Method::ImplicitEuler | Method::TrBdf2 | Method::ImplicitMidpoint => 1e-7,
                    _ => 1e-9,
                };
                match ends(&scene) {
                    [Ok(with), Ok(without)] => {
                        let off = distance(&with.positions, &without.positions);
                        let extent = common::largest(&without.positions).max(1.0);
                        assert!(off < allowed * extent, "{name}: {off:e} of {extent:e}");
                    }
                    ends => {
                        let causes = ends.map(|end| end.err().map(|(cause, _)| cause));
                        // The watch on energy looks at each part.
                        let is_watched = causes.contains(&Some(Cause::EnergyDiverged));
                        assert!(is_watched || causes[0] == causes[1], "{name}: {causes:?}");
                    }
                }
                let mut islands = Islands::new(&scene).unwrap();
                let _ = islands.run(1, &mut ());
                clamped += u64::from(islands.work().counts.clamped_springs > 0);
            }
        }
    }
    assert!(clamped > 700, "{clamped} runs with clamped springs");
}

/// With a matrix that does not change, a new velocity of an anchor counts from the
/// next step on.
#[test]
fn an_anchor_may_get_another_velocity_between_steps() {
    let mut scene = stretched_tangle(8, 3);
    for spring in &mut scene.springs {
        spring.rest_length = 0.0;
    }
    for (method, tangent) in [
        (Method::LinearlyImplicitEuler, Some(Tangent::Exact)),
        (Method::Rodas4, None),
    ] {
        scene.settings.method = method;
        scene.settings.tangent = tangent;
        let end = |skip: bool| {
            let compilation = Compilation {
                is_complete: !skip,
                ..Compilation::default()
            };
            let system = compile_with(&scene, compilation).unwrap();
            let options = RunOptions::default();
            let own: Box<dyn springs_step::Method> = match tangent {
                Some(tangent) => {
                    Box::new(LinearlyImplicitEuler::new(&system, tangent, &options).unwrap())
                }
                None => Box::new(Rodas4::new(&system, &options).unwrap()),
            };
            let mut stepper = Stepper::with_method(system, own);
            let mut nodes = NodeStates::of(&scene);
            for step in 0..4 {
                nodes.velocities[1] = Vector3::new(1.0, 0.0, -3.0) * f64::from(step);
                stepper.step(&mut nodes, 0.05).unwrap();
            }
            nodes.positions
        };
        let off = distance(&end(true), &end(false));
        assert!(off < 1e-12, "{method}: {off:e}");
    }
}

/// A weight on a damped vertical thread comes to rest there.
#[test]
fn parts_on_a_line_fall_asleep() {
    let mut scene = scene_of(
        &[
            ([0.0; 3], 0.0),
            ([0.0, 0.0, -1.0], 1.0),
            ([0.0, 0.0, -2.0], 1.0),
        ],
        &[([0, 1], 100.0, 1.0), ([1, 2], 100.0, 1.0)],
        0.05,
    );
    scene.gravity = Vector3::new(0.0, 0.0, -9.81);
    for spring in &mut scene.springs {
        spring.damping = 10.0;
    }
    scene.settings.method = Method::ImplicitEuler;
    scene.settings.duration = 60.0;
    let options = RunOptions::default().with_sleep(1e-6);
    let mut islands = Islands::with_options(&scene, &options).unwrap();
    islands.run(1, &mut ()).unwrap();
    assert!(islands.parts()[0].asleep_since().is_some());
    // m g/K for each weight below.
    let low = islands.nodes().positions[2].z;
    assert!((low + 2.0 + 0.0981 * 3.0).abs() < 1e-6, "{low}");
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
        let springs = part.springs.iter().map(|spring| springs_scene::Spring {
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
    islands_are_whole(|scene| scene);
}

#[test]
fn islands_have_their_laws() {
    // By what springs are, so that parts have the same.
    islands_are_whole(|scene| {
        let kinds = scene.springs.iter().map(|spring| {
            let kind = (spring.rest_length * 1e4) as usize % 8;
            (kind < 7).then_some(kind)
        });
        let kinds = kinds.collect::<Vec<_>>();
        with_laws(scene, 50.0, |spring| kinds[spring])
    });
}

/// Checks that parts of a scene, changed alike, move as they do alone.
fn islands_are_whole(change: impl Fn(Scene) -> Scene) {
    let (scene, parts) = archipelago();
    let mut scene = change(scene);
    let parts: Vec<Scene> = parts.into_iter().map(change).collect();
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
            let options = RunOptions::default().with_threads(threads);
            run_with(&scene, &options)
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
    let options = RunOptions::default().with_sleep(reach);
    let mut islands = Islands::with_options(&scene, &options).unwrap();
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

/// With adaptive steps, too, whose ends lie beyond the time at which a part falls
/// asleep.
#[test]
fn what_falls_asleep_stands_still() {
    // Masses that three damped springs hold, so that all motion dies away.
    let mut scene = Scene::default();
    for part in 0..4 {
        let at = |x: f64, y: f64, z: f64| Vector3::new(x + 5.0 * f64::from(part), y, z);
        let mass = scene.add_node(Node {
            mass: 1.0,
            ..Node::at(at(0.1, 0.2, 0.3))
        });
        for anchor in [at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0), at(0.0, 0.0, 1.0)] {
            let anchor = scene.add_node(Node::fixed(anchor));
            let spring = scene.add_spring(mass, anchor, 100.0);
            scene.springs[spring].damping = 2.0 + f64::from(part);
        }
    }
    scene.gravity.z = -9.81;
    scene.settings.duration = 20.0;
    scene.settings.method = Method::TrBdf2;
    let options = RunOptions::default().with_sleep(1e-3);
    for step in [StepControl::Fixed(0.03), StepControl::Tolerance(1e-2)] {
        scene.settings.step = step;
        let mut frames = Frames::default();
        let mut islands = Islands::with_options(&scene, &options).unwrap();
        islands.run(100, &mut frames).unwrap();
        let fell_asleep = |part: &&springs_step::Part| part.asleep_since() > Some(0.0);
        let mut n_asleep = 0;
        for part in islands.parts().iter().filter(fell_asleep) {
            let since = part.asleep_since().unwrap();
            let after = frames.0.iter().filter(|(time, _)| *time > since);
            for (time, nodes) in after {
                for &node in &part.island().nodes {
                    let what = format!("node {node}, asleep since {since}, at {time}");
                    assert_eq!(nodes.velocities[node], Vector3::zeros(), "{what}");
                    let end = islands.nodes().positions[node];
                    assert_eq!(nodes.positions[node], end, "{what}");
                }
            }
            n_asleep += 1;
        }
        assert!(n_asleep > 2, "{n_asleep} parts, {step:?}");
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
        let options = RunOptions::default().with_skip(skip);
        let mut frames = Frames::default();
        let mut islands = Islands::with_options(&scene, &options).unwrap();
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
            spring.stiffness *= 300.0;
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
