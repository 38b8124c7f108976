//! Nodes that may move in part: along axes or a direction.

mod common;

use common::{METHODS, after, distance, tangle, with};
use nalgebra::{Rotation3, Vector3};
use springs_scene::{Guide, Load, Method, Node, OverTime, Scene, StepControl};
use springs_step::{Islands, Simulation};

/// A bead on a wire along `direction`, a height of 0.6 m under a hook, on a spring of
/// 1 m and 40 N/m.
fn bead(direction: Vector3<f64>, guide: Guide) -> Scene {
    let mut scene = Scene::default();
    let up = direction.cross(&Vector3::new(0.3, 0.2, 0.9)).normalize();
    scene.add_node(Node::fixed(up * 0.6));
    scene.add_node(Node {
        mass: 0.5,
        guide: Some(guide),
        ..Node::at(direction * 0.3)
    });
    let spring = scene.add_spring(0, 1, 40.0);
    scene.springs[spring].rest_length = 1.0;
    scene.gravity = Vector3::new(0.0, 0.0, -9.81);
    scene.settings.duration = 1.0;
    scene
}

/// Where the bead of [`bead`] is along its wire: an equation of one number, solved by
/// the classical Runge–Kutta method in 20 000 steps.
fn along_the_wire(direction: &Vector3<f64>) -> f64 {
    let gravity = direction.z * -9.81;
    let acceleration = |s: f64| {
        let length = (s * s + 0.36).sqrt();
        gravity - 40.0 * (length - 1.0) * (s / length) / 0.5
    };
    let n = 20_000;
    let h = 1.0 / f64::from(n);
    let (mut s, mut v) = (0.3, 0.0);
    for _ in 0..n {
        let (k1, l1) = (v, acceleration(s));
        let (k2, l2) = (v + 0.5 * h * l1, acceleration(s + 0.5 * h * k1));
        let (k3, l3) = (v + 0.5 * h * l2, acceleration(s + 0.5 * h * k2));
        let (k4, l4) = (v + h * l3, acceleration(s + h * k3));
        s += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        v += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
    }
    s
}

#[test]
fn a_bead_on_a_wire_moves_as_its_equation_says() {
    for (direction, guide) in [
        (Vector3::x(), Guide::Held([false, true, true])),
        (
            Vector3::new(2.0, -1.0, 0.5).normalize(),
            Guide::Along(Vector3::new(4.0, -2.0, 1.0)),
        ),
    ] {
        let scene = bead(direction, guide);
        let exact = direction * along_the_wire(&direction);
        for method in METHODS {
            let mut errors = Vec::new();
            for h in [0.02, 0.01] {
                let nodes = after(&with(&scene, method, None, h), (1.0 / h).round() as usize);
                let at = nodes.positions[1];
                let across = (at - direction * direction.dot(&at)).norm();
                assert!(across < 1e-14, "{method}: {across:e} m off the wire");
                errors.push((at - exact).norm());
            }
            let order = springs_step::properties(method).unwrap().order;
            let gained = (errors[0] / errors[1]).log2();
            let expected = f64::from(order) - 0.5;
            assert!(
                gained > expected || errors[1] < 1e-11,
                "{method}: {errors:?}, order {gained:.2}"
            );
        }
    }
}

/// A wheel on each of two rails and a net between them: the same in every frame.
fn between_rails() -> Scene {
    let mut scene = tangle(8, 12);
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    for (node, guide) in [
        (2, Guide::Along(Vector3::new(1.0, 0.0, 0.0))),
        (4, Guide::Held([true, false, false])),
        (6, Guide::Along(Vector3::new(0.0, 3.0, 0.0))),
    ] {
        scene.nodes[node].guide = Some(guide);
        scene.nodes[node].fixed = false;
        scene.nodes[node].velocity = Vector3::zeros();
    }
    scene.loads.push(Load {
        name: String::new(),
        nodes: vec![2, 4],
        force: Vector3::new(0.4, 0.2, -0.3),
        over_time: OverTime::Sine {
            frequency: 2.0,
            phase: 30.0,
        },
    });
    scene.settings.duration = 0.2;
    scene
}

#[test]
fn guides_turn_with_the_scene() {
    let scene = between_rails();
    let turn = Rotation3::from_euler_angles(0.3, -0.7, 1.1);
    let mut turned = scene.clone();
    for node in &mut turned.nodes {
        node.position = turn * node.position;
        node.velocity = turn * node.velocity;
        node.guide = match node.guide {
            Some(Guide::Along(direction)) => Some(Guide::Along(turn * direction)),
            // A plane has no guide in another frame.
            other => other.filter(|_| false),
        };
    }
    let mut plain = scene.clone();
    plain.nodes[4].guide = None;
    turned.gravity = turn * turned.gravity;
    turned.loads[0].force = turn * turned.loads[0].force;
    for method in METHODS {
        let steps = |scene: &Scene| after(&with(scene, method, None, 0.002), 100).positions;
        let expected: Vec<_> = steps(&plain).iter().map(|at| turn * at).collect();
        let off = distance(&steps(&turned), &expected);
        assert!(off < 1e-10, "{method}: {off:e} m");
    }
}

/// All that a guide does is to hold: with every method the ledger closes, tolerances
/// are kept, and a support does no work.
#[test]
fn the_ledger_closes_and_tolerances_hold() {
    let mut scene = between_rails();
    scene.settings.method = Method::Dop853;
    scene.settings.step = StepControl::Tolerance(1e-11);
    let mut reference = Simulation::new(&scene).unwrap();
    reference.run(1, &mut ()).unwrap();
    let held = reference.nodes().positions[4].x - scene.nodes[4].position.x;
    assert_eq!(held, 0.0);
    for method in METHODS {
        let tolerance =
            if method == Method::LinearlyImplicitEuler || method == Method::ImplicitEuler {
                1e-3
            } else {
                1e-5
            };
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(tolerance);
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(3, &mut ()).unwrap();
        let off = distance(&islands.nodes().positions, &reference.nodes().positions);
        assert!(off < 2.0 * tolerance, "{method}: {off:e} m");
        let energy = islands.energy();
        let gain = islands.ledger().method_gain(&energy).abs();
        assert!(gain < 300.0 * tolerance, "{method}: {gain:e} J");
    }
}

/// A stiff net whose edge slides: steps far beyond its vibrations stay right.
#[test]
fn stiff_springs_on_guides_do_not_lock() {
    let end = |stiffness: f64| {
        let mut scene = bead(Vector3::x(), Guide::Held([false, true, true]));
        // A pendulum below a bead that slides.
        let bob = scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::new(1.3, 0.0, 0.0))
        });
        scene.add_spring(1, bob, stiffness);
        let mut scene = with(&scene, Method::TrBdf2, None, 0.01);
        scene.settings.duration = 1.0;
        after(&scene, 100).positions[bob]
    };
    let apart = (end(1e5) - end(1e9)).norm();
    assert!(apart < 5e-3, "{apart:e} m");
}
