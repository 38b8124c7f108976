//! Fixed nodes that follow motions.

mod common;

use common::{METHODS, after, distance, solved, with, workspace::Workspace};
use nalgebra::Vector3;
use springs::scene::{Method, NamedMotion, Node, PrescribedMotion, Scene, StepControl};
use springs::step::{Frame, Observer, Simulation, properties};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

const MASS: f64 = 0.5;
const STIFFNESS: f64 = 80.0;
const AMPLITUDE: f64 = 0.1;

fn takes_dashpots(method: Method) -> bool {
    properties(method).is_some_and(|row| row.treats_damping)
}

/// A mass on a spring without rest length, whose other end shakes: a linear system.
fn shaken(damping: f64) -> Scene {
    let mut scene = Scene::default();
    scene.motions.push(NamedMotion {
        name: "shake".to_owned(),
        motion: PrescribedMotion::Sine {
            amplitude: Vector3::new(AMPLITUDE, 0.0, 0.0),
            frequency: FREQUENCY,
            phase: 0.0,
        },
    });
    scene.add_node(Node {
        motion: Some(0),
        ..Node::fixed(Vector3::zeros())
    });
    scene.add_node(Node {
        mass: MASS,
        ..Node::at(Vector3::zeros())
    });
    let spring = scene.add_spring(0, 1, STIFFNESS);
    scene.springs[spring].damping = damping;
    scene.settings.duration = 0.8;
    scene
}

const FREQUENCY: f64 = 1.5;

/// Where the mass is without damping, from rest: the forced vibration and the free one
/// that makes up for its velocity.
fn exact(time: f64) -> f64 {
    let (omega, own) = (TAU * FREQUENCY, (STIFFNESS / MASS).sqrt());
    let forced = AMPLITUDE * own * own / (own * own - omega * omega);
    forced * ((omega * time).sin() - omega / own * (own * time).sin())
}

#[test]
fn a_shaken_mass_moves_as_in_closed_form() {
    let scene = shaken(0.0);
    for method in METHODS {
        let mut errors = Vec::new();
        for h in [0.02, 0.01] {
            let steps = (scene.settings.duration / h).round() as usize;
            let nodes = after(&with(&scene, method, None, h), steps);
            let support = nodes.positions[0].x;
            let expected = AMPLITUDE * (TAU * FREQUENCY * 0.8).sin();
            assert!((support - expected).abs() < 1e-14, "{method}: {support}");
            let speed = AMPLITUDE * TAU * FREQUENCY * (TAU * FREQUENCY * 0.8).cos();
            assert!((nodes.velocities[0].x - speed).abs() < 1e-13, "{method}");
            errors.push((nodes.positions[1].x - exact(0.8)).abs());
        }
        let order = properties(method).unwrap().order;
        let gained = (errors[0] / errors[1]).log2();
        assert!(
            gained > f64::from(order) - 0.4 || errors[1] < 1e-12,
            "{method}: {errors:?}, order {gained:.2}"
        );
    }
}

/// A net that a crane lifts and a table shakes, in space, with dashpots.
fn lifted() -> Scene {
    let mut scene = shaken(0.0);
    scene.motions.push(NamedMotion {
        name: "lift".to_owned(),
        motion: PrescribedMotion::Table(
            [
                (0.0, Vector3::zeros()),
                (0.1, Vector3::new(0.0, 0.02, 0.05)),
                (0.25, Vector3::new(0.05, 0.02, 0.2)),
                (0.6, Vector3::new(0.05, 0.0, 0.3)),
            ]
            .into(),
        ),
    });
    scene.add_node(Node {
        motion: Some(1),
        velocity: Vector3::new(0.1, 0.0, 0.0),
        ..Node::fixed(Vector3::new(0.0, 1.0, 0.5))
    });
    scene.add_node(Node {
        mass: 0.2,
        ..Node::at(Vector3::new(0.5, 0.5, 0.1))
    });
    for (nodes, stiffness) in [
        ([1, 2], 60.0),
        ([1, 3], 90.0),
        ([2, 3], 120.0),
        ([0, 3], 40.0),
    ] {
        let spring = scene.add_spring(nodes[0], nodes[1], stiffness);
        scene.springs[spring].damping = 0.3;
    }
    scene.add_spring(0, 2, 25.0);
    scene.gravity = Vector3::new(0.0, 0.0, -9.81);
    scene
}

fn without_dashpots(mut scene: Scene, method: Method) -> Scene {
    if !takes_dashpots(method) {
        scene
            .springs
            .iter_mut()
            .for_each(|spring| spring.damping = 0.0);
    }
    scene
}

/// Tolerances are kept, and the work of the moving nodes is that of a far finer run.
#[test]
fn tolerances_and_work_of_moving_nodes() {
    for method in METHODS {
        let scene = without_dashpots(lifted(), method);
        let run = |method, tolerance| {
            let mut scene = scene.clone();
            scene.settings.method = method;
            scene.settings.step = StepControl::Tolerance(tolerance);
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.run(1, &mut ()).unwrap();
            simulation
        };
        let fine = run(Method::Dop853, 1e-11);
        let first_order = properties(method).unwrap().order == 1;
        let tolerance = if first_order { 1e-3 } else { 1e-5 };
        let simulation = run(method, tolerance);
        let off = distance(&simulation.nodes().positions, &fine.nodes().positions);
        assert!(off < 2.0 * tolerance, "{method}: {off:e} m");
        let (ledger, expected) = (simulation.ledger(), fine.ledger());
        assert!(expected.anchor_work.abs() > 0.1, "{expected:?}");
        // Forces of some 50 N.
        let allowed = 200.0 * tolerance;
        let work = (ledger.anchor_work - expected.anchor_work).abs();
        assert!(
            work < allowed,
            "{method}: {work:e} J of {}",
            expected.anchor_work
        );
        let gain = ledger.method_gain(&simulation.energy()).abs();
        assert!(gain < allowed, "{method}: {gain:e} J");
    }
}

/// Frames between steps have the moving nodes exactly where they belong.
#[test]
fn frames_have_moving_nodes_in_their_places() {
    struct Look(Scene);
    impl Observer for Look {
        fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
            for node in [0, 2] {
                let start = &self.0.nodes[node];
                let moved = self.0.displacement(node, frame.time).unwrap();
                let expected = start.position + start.velocity * frame.time + moved.displacement;
                let off = (frame.nodes.positions[node] - expected).norm();
                assert!(off < 1e-14, "node {node} at {}: {off:e}", frame.time);
                let velocity = start.velocity + moved.velocity;
                let off = (frame.nodes.velocities[node] - velocity).norm();
                assert!(off < 1e-13, "node {node} at {}: {off:e}", frame.time);
            }
            ControlFlow::Continue(())
        }
    }
    for method in [Method::TrBdf2, Method::VelocityVerlet, Method::Dop853] {
        let mut scene = lifted();
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(0.013);
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(37, &mut Look(scene)).unwrap();
    }
}

/// Steps far longer than the vibration of a stiff spring follow its moving end.
#[test]
fn stiff_springs_follow_without_locking() {
    let end = |method, stiffness: f64| {
        let mut scene = shaken(0.0);
        scene.springs[0].stiffness = stiffness;
        // Nothing to vibrate: it starts with its end.
        scene.nodes[1].velocity.x = AMPLITUDE * TAU * FREQUENCY;
        after(&with(&scene, method, None, 0.01), 80).positions[1].x
    };
    let support = AMPLITUDE * (TAU * FREQUENCY * 0.8).sin();
    for method in [
        Method::LinearlyImplicitEuler,
        Method::ImplicitEuler,
        Method::TrBdf2,
        Method::FilteredLeapfrog,
    ] {
        let off = (end(method, 1e9) - support).abs();
        assert!(off < 1e-3, "{method}: {off:e} m");
    }
}

/// What a run leaves goes on as if it had not been stopped, from files, too.
#[test]
fn a_scene_goes_on_with_its_motions() {
    let workspace = Workspace::new();
    std::fs::write(
        workspace.path("crane.csv"),
        "time,x,y,z\n0,0,0,0\n0.5, 0.1,0,0.2\n\n1.5,0,0,0.4\n",
    )
    .unwrap();
    let text = r#"Scene(version: 1, gravity: (0, 0, -9.81),
        motions: {"crane": Csv("crane.csv"), "shake": Sine(amplitude: (0, 0.1, 0), frequency: 2, phase: 0.3)},
        nodes: [
            (position: (0, 0, 0), fixed: true, motion: "crane"),
            (position: (1, 0, 0), fixed: true, motion: "shake", velocity: (0, 0, -0.1)),
            (position: (0.5, 0, -0.5), mass: 1),
        ],
        springs: [(nodes: (0, 2), stiffness: 100), (nodes: (1, 2), stiffness: 100)],
        simulation: (method: Dop853, tolerance: 1e-10, duration: 0.7),
    )"#;
    std::fs::write(workspace.path("a.ron"), text).unwrap();
    workspace.expect(0, "run a.ron --duration 1.2 --out through --quiet");
    workspace.expect(0, "run a.ron --out first --quiet");
    workspace.expect(0, "run first/final.ron --duration 0.5 --out second --quiet");
    let nodes = |run: &str| {
        let path = workspace.path(&format!("{run}/final.ron"));
        let (scene, _) = springs::io::read_scene(&path).unwrap();
        let nodes = 0..scene.nodes.len();
        nodes
            .map(|node| scene.start_position(node))
            .collect::<Vec<_>>()
    };
    let off = distance(&nodes("second"), &nodes("through"));
    assert!(off < 1e-8, "{off:e}");
    let (scene, _) = springs::io::read_scene(&workspace.path("a.ron")).unwrap();
    let end = solved(&scene, Method::TrBdf2, 1e-5);
    assert!(distance(&end, &nodes("first")) < 1e-5);
}
