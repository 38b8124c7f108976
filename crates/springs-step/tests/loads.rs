//! Loads and drag of scenes against closed forms.

mod common;

use common::{distance, solved};
use nalgebra::Vector3;
use springs_scene::{Load, Method, Node, OverTime, Rayleigh, RunOptions, Scene, StepControl};
use springs_step::{Islands, Outcome, Simulation};
use std::f64::consts::TAU;

/// A mass on a spring along x, with a dashpot, driven by F sin(2πft).
fn driven(damping: f64, frequency: f64) -> Scene {
    let mut scene = Scene::default();
    let anchor = scene.add_node(Node::fixed(Vector3::zeros()));
    let mass = scene.add_node(Node {
        mass: 2.0,
        ..Node::at(Vector3::x())
    });
    let spring = scene.add_spring(anchor, mass, 50.0);
    scene.springs[spring].damping = damping;
    scene.loads.push(Load {
        name: String::new(),
        nodes: vec![mass],
        force: Vector3::new(0.3, 0.0, 0.0),
        over_time: OverTime::Sine {
            frequency,
            phase: 0.0,
        },
    });
    scene
}

/// When the start has died away, the amplitude is F/√((K − mω²)² + (cω)²), at the
/// tolerance asked for.
#[test]
fn a_driven_damped_oscillator_swings_as_far_as_it_should() {
    let (k, m, c, f): (f64, f64, f64, f64) = (50.0, 2.0, 4.0, 0.3);
    for frequency in [0.3, 0.8, 1.5] {
        let omega = TAU * frequency;
        let (stiff, damped) = (k - m * omega * omega, c * omega);
        let amplitude = f / stiff.hypot(damped);
        let lag = damped.atan2(stiff);
        let mut scene = driven(c, frequency);
        scene.settings.duration = 30.0;
        let exact = 1.0 + amplitude * (omega * scene.settings.duration - lag).sin();
        for (method, tolerances) in [
            (Method::Dop853, &[1e-2, 1e-4, 1e-6, 1e-8][..]),
            (Method::TrBdf2, &[1e-2, 1e-3, 1e-4]),
            (Method::VelocityVerlet, &[1e-2, 1e-4]),
            (Method::Auto, &[1e-2, 1e-4, 1e-6]),
        ] {
            for &tolerance in tolerances {
                scene.settings.method = method;
                scene.settings.step = StepControl::Tolerance(tolerance);
                let mut simulation = Simulation::new(&scene).unwrap();
                assert_eq!(simulation.run(1, &mut ()), Ok(Outcome::Finished));
                let off = (simulation.nodes().positions[1].x - exact).abs();
                assert!(
                    off < 1.5 * tolerance,
                    "{method}, {frequency} Hz, {tolerance:e}: {off:e}"
                );
            }
        }
    }
}

/// A mass that falls with drag: v = −(mg/b)(1 − e^{−bt/m}), and the heat is what is
/// missing of its energy.
#[test]
fn drag_ends_in_a_terminal_velocity() {
    let (m, b, g, t): (f64, f64, f64, f64) = (0.5, 0.7, 9.81, 2.0);
    let mut scene = Scene::default();
    scene.add_node(Node {
        mass: m,
        ..Node::at(Vector3::zeros())
    });
    scene.gravity = Vector3::new(0.0, 0.0, -g);
    scene.drag = b;
    scene.settings.duration = t;
    let fade = (-b * t / m).exp();
    let v = -m * g / b * (1.0 - fade);
    let x = -m * g / b * (t - m / b * (1.0 - fade));
    for &method in Method::ALL {
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(1e-4);
        let Ok(mut simulation) = Simulation::new(&scene) else {
            let refuse = [Method::BlanesMoan4, Method::BlanesMoan6, Method::Rodas4];
            assert!(refuse.contains(&method), "{method}");
            continue;
        };
        simulation.run(1, &mut ()).unwrap();
        let nodes = simulation.nodes();
        let off = (nodes.positions[0].z - x).abs();
        assert!(off < 3e-4, "{method}: {off:e}");
        assert!((nodes.velocities[0].z - v).abs() < 1e-3, "{method}");
        let lost = -m * g * x - 0.5 * m * v * v;
        let heat = simulation.ledger().heat.sum();
        assert!(
            (heat - lost).abs() < 2e-3 * lost,
            "{method}: {heat} J of {lost} J"
        );
    }
}

/// Work of loads closes the ledger for every kind, and what is left out changes
/// nothing: parts, planes and lines.
#[test]
fn the_ledger_closes_and_skipping_changes_nothing() {
    let histories = [
        OverTime::Constant,
        OverTime::Ramp { from: 0.2, to: 0.9 },
        OverTime::Table(vec![[0.1, 0.0], [0.5, 1.5], [0.8, -0.5]]),
    ];
    for over_time in histories {
        let mut scene = driven(0.5, 1.0);
        scene.loads[0].over_time = over_time.clone();
        // A second part, which only its own load moves.
        let anchor = scene.add_node(Node::fixed(Vector3::new(5.0, 0.0, 0.0)));
        let mass = scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::new(6.0, 0.0, 0.0))
        });
        scene.add_spring(anchor, mass, 80.0);
        scene.loads.push(Load {
            name: String::new(),
            nodes: vec![mass, anchor],
            force: Vector3::new(0.0, 1.0, 0.0),
            over_time,
        });
        scene.settings.step = StepControl::Tolerance(1e-5);
        let whole = {
            let mut scene = scene.clone();
            scene.settings.method = Method::TrBdf2;
            scene.settings.step = StepControl::Tolerance(1e-6);
            let options = RunOptions::default().with_skip(false);
            let mut simulation = Simulation::with_options(&scene, &options).unwrap();
            simulation.run(1, &mut ()).unwrap();
            simulation.nodes().positions.clone()
        };
        let mut islands = Islands::new(&scene).unwrap();
        assert_eq!(islands.parts().len(), 2);
        islands.run(7, &mut ()).unwrap();
        let off = distance(&islands.nodes().positions, &whole);
        assert!(off < 3e-5, "{off:e}");
        assert!(islands.nodes().positions[3].y.abs() > 1e-3);
        let (ledger, now) = (islands.ledger(), islands.energy());
        assert!(ledger.load_work > 1e-4, "{ledger:?}");
        let gain = ledger.method_gain(&now).abs();
        assert!(gain < 1e-2 * ledger.load_work, "{gain:e} J, {ledger:?}");
    }
}

/// What a run leaves goes on with its loads where they are.
#[test]
fn a_scene_goes_on_with_its_loads() {
    let mut scene = driven(0.5, 1.3);
    scene.settings.method = Method::Dop853;
    scene.settings.step = StepControl::Tolerance(1e-10);
    scene.settings.duration = 1.1;
    let mut through = scene.clone();
    through.settings.duration = 2.2;
    let through = solved(&through, Method::Dop853, 1e-10);
    let mut first = Islands::new(&scene).unwrap();
    first.run(1, &mut ()).unwrap();
    first.nodes().write_to(&mut scene);
    for load in &mut scene.loads {
        load.over_time = load.over_time.after(1.1);
    }
    let second = solved(&scene, Method::Dop853, 1e-10);
    assert!(distance(&second, &through) < 1e-8);
}

/// A free vibration of a mass on a spring along x: Rayleigh damping decays with
/// ζ = (α/ω + βω)/2, and a node's own drag goes before that of the scene.
#[test]
fn rayleigh_damping_and_own_drag_decay_as_they_should() {
    let (k, m): (f64, f64) = (50.0, 2.0);
    let omega = (k / m).sqrt();
    for (alpha, beta, own, scene_drag) in [
        (0.6, 0.0, None, 0.0),
        (0.0, 0.03, None, 0.0),
        (0.2, 0.01, Some(0.5), 9.0),
        (0.0, 0.0, Some(0.0), 9.0),
    ] {
        let mut scene = driven(0.0, 1.0);
        scene.loads.clear();
        scene.nodes[1].position.x = 1.1;
        scene.nodes[1].drag = own;
        scene.drag = scene_drag;
        scene.damping = Rayleigh {
            mass: alpha,
            stiffness: beta,
        };
        scene.settings.duration = 3.0;
        let drag = own.unwrap_or(scene_drag);
        let zeta = (alpha / omega + beta * omega + drag / (m * omega)) / 2.0;
        let (decay, damped) = (zeta * omega, omega * (1.0 - zeta * zeta).sqrt());
        let t: f64 = 3.0;
        let exact =
            0.1 * (-decay * t).exp() * ((damped * t).cos() + decay / damped * (damped * t).sin());
        for method in [Method::Dop853, Method::TrBdf2, Method::VelocityVerlet] {
            let tolerance = 1e-5;
            let off = (solved(&scene, method, tolerance)[1].x - 1.0 - exact).abs();
            assert!(
                off < tolerance,
                "{method}, α {alpha}, β {beta}, {own:?}: {off:e}"
            );
        }
    }
}

/// A mass on a spring at rest, and a force in the midst of the run.
fn pushed_late(over_time: OverTime) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 2.0,
        ..Node::at(Vector3::x())
    });
    let spring = scene.add_spring(0, 1, 200.0);
    scene.springs[spring].rest_length = 1.0;
    scene.loads.push(Load {
        name: String::new(),
        nodes: vec![1],
        force: Vector3::new(4000.0, 0.0, 0.0),
        over_time,
    });
    scene.settings.duration = 3.0;
    scene
}

/// A push of 4 N·s within 2 ms, 2 s after the start: an amplitude of p/√(Km) = 0.2 m,
/// and an energy of p²/2m = 4 J.
#[test]
fn nothing_that_happens_between_long_steps_is_passed_over() {
    let push = OverTime::Table(vec![[2.0, 0.0], [2.001, 1.0], [2.002, 0.0]]);
    for method in [
        Method::Auto,
        Method::TrBdf2,
        Method::ImplicitMidpoint,
        Method::FilteredLeapfrog,
        Method::Rodas4,
        Method::VelocityVerlet,
        Method::BlanesMoan4,
        Method::BlanesMoan6,
        Method::Dop853,
    ] {
        let mut scene = pushed_late(push.clone());
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(1e-3);
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        // Pushed in the mean at 2.001 s.
        let expected = 1.0 + 0.2 * (10.0_f64 * 0.999).sin();
        let off = (simulation.nodes().positions[1].x - expected).abs();
        assert!(off < 1e-3, "{method}: {off:e} m");
        let work = simulation.ledger().load_work;
        assert!((work - 4.0).abs() < 0.05, "{method}: {work} J");
    }
}

/// The work of loads is what they did in each kick, not the mean over a step.
#[test]
fn the_work_of_loads_is_that_of_every_stage() {
    for (method, allowed) in [(Method::BlanesMoan4, 1e-3), (Method::BlanesMoan6, 1e-4)] {
        let mut scene = pushed_late(OverTime::Sine {
            frequency: 1.0,
            phase: 0.3,
        });
        scene.loads[0].force.x = 4.0;
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(0.1);
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let gain = simulation.ledger().method_gain(&simulation.energy());
        let moved = simulation.energy().total();
        assert!(moved > 0.05, "{moved} J");
        assert!(
            gain.abs() < allowed * moved,
            "{method}: {gain:e} of {moved} J"
        );
    }
}

/// A load that jumps is one that rises within a moment: steps that are chosen from the error
/// end at both times, and none of them sees the jump within. Force F from T on gives
/// x = F (t − T)²/2m.
#[test]
fn a_load_that_rises_within_a_moment_is_met_exactly() {
    let (mass, force, jump) = (2.0, 3.0, 0.5);
    let mut scene = Scene::default();
    scene.add_node(Node {
        mass,
        ..Node::at(Vector3::zeros())
    });
    scene.loads.push(Load {
        name: String::new(),
        nodes: vec![0],
        force: Vector3::x() * force,
        over_time: OverTime::Table(vec![[jump, 0.0], [jump + 1e-9, 1.0]]),
    });
    scene.settings.step = StepControl::Tolerance(1e-7);
    for method in [
        Method::TrBdf2,
        Method::VelocityVerlet,
        Method::BlanesMoan4,
        Method::BlanesMoan6,
        Method::Dop853,
        Method::Rodas4,
    ] {
        scene.settings.method = method;
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let (x, steps) = (
            simulation.nodes().positions[0].x,
            simulation.stepper().steps(),
        );
        let expected = force * (1.0 - jump).powi(2) / (2.0 * mass);
        // What is missing of the force within the moment.
        assert!((x - expected).abs() < 1e-9, "{method}: {x} m");
        assert!(steps < 20, "{method}: {steps} steps");
    }
}
