//! Heat of dashpots and work of anchors in the energy ledger, against momentum
//! balances, closed forms and integrals along much finer trajectories.

mod common;

use common::{tangle, with};
use nalgebra::Vector3;
use springs_scene::{Method, Node, RunOptions, Scene, StepControl, Tangent};
use springs_step::{NodeStates, Simulation};

const METHODS: [Method; 10] = [
    Method::LinearlyImplicitEuler,
    Method::ImplicitEuler,
    Method::TrBdf2,
    Method::ImplicitMidpoint,
    Method::FilteredLeapfrog,
    Method::VelocityVerlet,
    Method::Dop853,
    Method::BlanesMoan4,
    Method::BlanesMoan6,
    Method::Rodas4,
];

fn takes_dashpots(method: Method) -> bool {
    !matches!(
        method,
        Method::BlanesMoan4 | Method::BlanesMoan6 | Method::Rodas4
    )
}

fn has_matrix(method: Method) -> bool {
    METHODS[..5].contains(&method) || method == Method::Rodas4
}

/// Every method, and every tangent of the first.
fn variants() -> Vec<(Method, Option<Tangent>)> {
    let tangents = Tangent::ALL
        .iter()
        .map(|&tangent| (METHODS[0], Some(tangent)));
    let others = METHODS[1..].iter().map(|&method| (method, None));
    tangents.chain(others).collect()
}

/// As far as a method takes them.
fn without_dashpots(mut scene: Scene, method: Method) -> Scene {
    for spring in &mut scene.springs {
        if !takes_dashpots(method) {
            spring.damping = 0.0;
        }
    }
    scene
}

fn run(scene: &Scene, method: Method, tangent: Option<Tangent>, h: f64) -> Simulation {
    run_with(scene, method, tangent, h, &RunOptions::default())
}

fn run_with(
    scene: &Scene,
    method: Method,
    tangent: Option<Tangent>,
    h: f64,
    options: &RunOptions,
) -> Simulation {
    let scene = with(&without_dashpots(scene.clone(), method), method, tangent, h);
    let mut simulation = Simulation::with_options(&scene, options).unwrap();
    simulation.run(1, &mut ()).unwrap();
    simulation
}

fn gain(simulation: &Simulation) -> f64 {
    simulation.ledger().method_gain(&simulation.energy())
}

fn momentum(scene: &Scene, nodes: &NodeStates) -> Vector3<f64> {
    let free = scene.nodes.iter().zip(scene.node_masses());
    let momenta = free
        .zip(&nodes.velocities)
        .filter(|((node, _), _)| !node.fixed);
    momenta.map(|((_, mass), v)| v * mass).sum()
}

fn two_nodes(first: Node, stiffness: f64, damping: f64) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(first);
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::x())
    });
    let index = scene.add_spring(0, 1, stiffness);
    scene.springs[index].damping = damping;
    scene
}

/// A dashpot that is far too strong for the step takes no more than there is:
/// without springs all energy is kinetic, so the heat is exactly what is missing.
#[test]
fn an_unresolved_dashpot_turns_what_it_takes_into_heat() {
    let first = Node {
        mass: 1.0,
        velocity: Vector3::x(),
        ..Node::at(Vector3::zeros())
    };
    for damping in [1e2, 1e6] {
        let mut scene = two_nodes(first, 0.0, damping);
        scene.settings.duration = 1.0;
        for method in &METHODS[..5] {
            let simulation = run(&scene, *method, None, 0.1);
            let heat = simulation.ledger().heat.sum();
            let missing = 0.5 - simulation.energy().kinetic;
            // Rounding of the first kick, which gives velocities of up to ch/m.
            let rounding = 1e-9 + f64::EPSILON * (0.1 * damping).powi(2);
            assert!(
                (heat - missing).abs() < rounding,
                "{method}: {heat} of {missing} J"
            );
            if *method != Method::ImplicitMidpoint && *method != Method::FilteredLeapfrog {
                // Half of the energy is in the common motion, and stays.
                assert!((heat - 0.25).abs() < 1e-3, "{method}: {heat} J");
            }
        }
    }
}

/// An anchor of velocity V that pulls a mass by a spring does the work V·m·Δv,
/// whether the step resolves the spring or not.
#[test]
fn a_stiff_anchor_does_the_work_of_the_momentum_it_gives() {
    let anchor = Node {
        velocity: Vector3::x(),
        ..Node::fixed(Vector3::zeros())
    };
    let mut scene = two_nodes(anchor, 1e8, 0.0);
    scene.settings.duration = 0.1;
    let methods = METHODS.iter().filter(|&&method| has_matrix(method));
    for &method in methods {
        let simulation = run(&scene, method, None, 0.1);
        let given = simulation.nodes().velocities[1].x;
        let work = simulation.ledger().anchor_work;
        // Rounding of positions of 1 m, through 1e8 N/m for 0.1 s.
        assert!(
            (work - given).abs() < 1e-7,
            "{method}: {work} J of {given} J"
        );
        if method == Method::TrBdf2 {
            // What is left of the vibration, of hω = 1e3.
            assert!((work - 1.0).abs() < 1e-3, "{method}: {work} J");
        }
    }
}

/// With one fixed node, the impulse on it is what the momentum of all others
/// says. So is its work, for every method and tangent, in steps that resolve the
/// motion or not, with dashpots.
#[test]
fn the_work_of_an_anchor_is_its_velocity_times_its_impulse() {
    for (method, tangent) in variants() {
        for (seed, h) in [(3, 1e-3), (4, 1e-3), (4, 0.02)] {
            if h > 0.01 && !has_matrix(method) {
                continue;
            }
            let mut scene = without_dashpots(tangle(12, seed), method);
            scene.nodes[0].fixed = false;
            scene.nodes[0].mass = 0.05;
            scene.settings.duration = 20.0 * h;
            if method == Method::Rodas4 {
                // It refuses indefinite matrices.
                scene
                    .springs
                    .iter_mut()
                    .for_each(|spring| spring.rest_length = 0.0);
            }
            let simulation = run(&scene, method, tangent, h);
            let mass: f64 = scene.node_masses().iter().sum::<f64>() - scene.node_masses()[1];
            let gained = momentum(&scene, simulation.nodes())
                - momentum(&scene, &NodeStates::of(&scene))
                - scene.gravity * (mass * scene.settings.duration);
            let expected = gained.dot(&scene.nodes[1].velocity);
            let work = simulation.ledger().anchor_work;
            assert!(expected.abs() > 1e-4, "the anchor does something");
            assert!(
                (work - expected).abs() < 1e-10 * (1.0 + expected.abs()),
                "{method} {tangent:?}, h = {h}: {work} J, not {expected} J"
            );
        }
    }
}

/// Heat and anchor work of a fine trajectory, by Simpson's rule on the powers at
/// its steps.
fn integrals(scene: &Scene, steps: usize) -> (f64, f64) {
    let h = scene.settings.duration / steps as f64;
    let scene = with(scene, Method::Dop853, None, h);
    let options = RunOptions::default().with_skip(false);
    let mut simulation = Simulation::with_options(&scene, &options).unwrap();
    let (mut heat, mut work) = (0.0, 0.0);
    let mut add = |step: usize, nodes: &NodeStates| {
        let weight = match step {
            0 => 1.0,
            _ if step == steps => 1.0,
            _ if step % 2 == 1 => 4.0,
            _ => 2.0,
        } * h
            / 3.0;
        for spring in &scene.springs {
            let [a, b] = spring.nodes;
            let dx = nodes.positions[b] - nodes.positions[a];
            let w = nodes.velocities[b] - nodes.velocities[a];
            let (l, u) = (dx.norm(), dx.normalize());
            let rate = w.dot(&u);
            heat += weight * spring.damping * rate * rate;
            let pull = u * (spring.stiffness * (l - spring.rest_length) + spring.damping * rate);
            for (node, sign) in [(a, -1.0), (b, 1.0)] {
                if scene.nodes[node].fixed {
                    work += weight * sign * pull.dot(&scene.nodes[node].velocity);
                }
            }
        }
    };
    add(0, simulation.nodes());
    let mut step = 0;
    while simulation.step().unwrap().is_some() {
        step += 1;
        add(step, simulation.nodes());
    }
    (heat, work)
}

/// Both flows of every method come to the integrals along the exact motion, and
/// the gain of the method itself to nothing, with the order of the method.
#[test]
fn flows_converge_to_their_integrals_with_the_order_of_the_method() {
    let mut base = tangle(8, 4);
    base.settings.duration = 0.25;
    let mut wrong = Vec::new();
    for (method, tangent) in variants() {
        let scene = without_dashpots(base.clone(), method);
        let (heat, work) = integrals(&scene, 8000);
        let (order, steps) = match method {
            Method::LinearlyImplicitEuler | Method::ImplicitEuler => (1.0, 8192),
            Method::BlanesMoan4 | Method::Rodas4 => (4.0, 64),
            Method::BlanesMoan6 => (6.0, 32),
            Method::Dop853 => (8.0, 16),
            _ => (2.0, 512),
        };
        let errors = |steps: usize| {
            let h = base.settings.duration / steps as f64;
            let simulation = run(&scene, method, tangent, h);
            let ledger = simulation.ledger();
            [
                (ledger.heat.sum() - heat).abs(),
                (ledger.anchor_work - work).abs(),
                gain(&simulation).abs(),
            ]
        };
        let (coarse, fine) = (errors(steps), errors(2 * steps));
        let names = ["heat", "work", "gain"];
        for ((name, coarse), fine) in names.iter().zip(coarse).zip(fine) {
            if coarse == 0.0 {
                assert!(*name == "heat" && !takes_dashpots(method));
                continue;
            }
            let observed = (coarse / fine).log2();
            if observed < order - 0.5 || fine > 0.05 * (heat + work.abs()) {
                wrong.push(format!(
                    "{method} {tangent:?}: {name} {coarse:e} → {fine:e}, order {observed:.2}"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Springs and dashpots between two fixed nodes take what their anchors give,
/// exactly and in any step, with and without what can be skipped.
#[test]
fn what_joins_moving_anchors_is_booked_exactly() {
    let mut scene = Scene::default();
    scene.add_node(Node {
        velocity: Vector3::new(0.0, 0.0, 1.0),
        ..Node::fixed(Vector3::zeros())
    });
    scene.add_node(Node::fixed(Vector3::x()));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::y())
    });
    let index = scene.add_spring(0, 1, 100.0);
    scene.springs[index].rest_length = 0.5;
    scene.settings.duration = 0.5;
    let length = 1.25f64.sqrt();
    let expected = 50.0 * ((length - 0.5).powi(2) - 0.25);
    // ∫ c (w·u)² dt with w·u = t/√(1 + t²) is t − atan t.
    let expected_heat = 3.0 * (0.5 - 0.5f64.atan());
    for skip in [false, true] {
        let options = RunOptions::default().with_skip(skip);
        for (method, tangent) in variants() {
            scene.springs[0].damping = if takes_dashpots(method) { 3.0 } else { 0.0 };
            let heat = expected_heat * scene.springs[0].damping / 3.0;
            let simulation = run_with(&scene, method, tangent, 0.5, &options);
            let ledger = simulation.ledger();
            assert!((ledger.heat.sum() - heat).abs() < 1e-13, "{method}");
            assert!(
                (ledger.anchor_work - expected - heat).abs() < 1e-12,
                "{method}"
            );
            assert!(gain(&simulation).abs() < 1e-12, "{method}");
        }
    }
}

/// Steps that are rejected are not booked: with a tolerance the flows are those
/// of the motion, too.
#[test]
fn steps_that_were_rejected_are_not_booked() {
    let mut base = tangle(8, 4);
    base.settings.duration = 0.25;
    for method in METHODS {
        if matches!(method, Method::ImplicitMidpoint | Method::FilteredLeapfrog) {
            // They take steps of one size.
            continue;
        }
        let mut scene = without_dashpots(base.clone(), method);
        let (heat, work) = integrals(&scene, 2000);
        scene.settings.method = method;
        let first_order = matches!(
            method,
            Method::LinearlyImplicitEuler | Method::ImplicitEuler
        );
        let tolerance = if first_order { 1e-4 } else { 1e-6 };
        scene.settings.step = StepControl::Tolerance(tolerance);
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let ledger = simulation.ledger();
        // Forces of up to some 100 N that are off by some 100 N/m times the error.
        let allowed = 1e3 * tolerance;
        assert!((ledger.heat.sum() - heat).abs() < allowed, "{method}");
        assert!((ledger.anchor_work - work).abs() < allowed, "{method}");
        assert!(gain(&simulation).abs() < allowed, "{method}");
    }
}
