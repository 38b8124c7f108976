//! Conservation laws and symmetries.

mod common;

use common::{after, distance, tangle, with};
use nalgebra::Vector3;
use springs_assembly::compile;
use springs_scene::generate::{Material, cloth};
use springs_scene::{Method, Scene, Tangent};
use springs_step::{NodeStates, Simulation, Stepper};

/// A tangle that nothing outside touches.
fn free_tangle(seed: u64) -> Scene {
    let mut scene = tangle(20, seed);
    scene.gravity = Vector3::zeros();
    for node in &mut scene.nodes {
        node.fixed = false;
    }
    scene
}

/// Every method that takes dashpots, and every tangent, with steps that suit it.
fn variants() -> Vec<(Method, Option<Tangent>, f64)> {
    let tangents = Tangent::ALL
        .iter()
        .map(|&tangent| (Method::LinearlyImplicitEuler, Some(tangent), 0.01));
    let others = [
        (Method::ImplicitEuler, None, 0.01),
        (Method::TrBdf2, None, 0.01),
        (Method::ImplicitMidpoint, None, 0.01),
        (Method::FilteredLeapfrog, None, 0.005),
        (Method::VelocityVerlet, None, 1e-3),
        (Method::Dop853, None, 1e-3),
    ];
    tangents.chain(others).collect()
}

fn momentum(scene: &Scene, nodes: &NodeStates) -> Vector3<f64> {
    let masses = scene.node_masses();
    masses
        .iter()
        .zip(&nodes.velocities)
        .map(|(m, v)| v * *m)
        .sum()
}

#[test]
fn momentum_is_kept_with_dashpots() {
    for (method, tangent, h) in variants() {
        let scene = with(&free_tangle(5), method, tangent, h);
        let start = momentum(&scene, &NodeStates::of(&scene));
        let end = momentum(&scene, &after(&scene, 200));
        let scale: f64 = scene.node_masses().iter().sum::<f64>() * 0.5;
        let change = (end - start).norm() / scale;
        assert!(change < 1e-12, "{method} {tangent:?}: {change:e}");
    }
}

/// Without gravity and moving anchors the only things that change the energy
/// are dashpots and the method; neither may add any.
///
/// For linearly implicit Euler this is a law where the force is linear (zero
/// rest lengths, exact tangent). Elsewhere the loss of the method outweighs
/// terms of third order at the steps used here; the material tangent leaves out
/// real stiffness and has no such property. Velocity Verlet keeps a nearby
/// energy, so its steps are small enough for the dashpots to outweigh the
/// ripple.
#[test]
fn energy_never_rises_without_gravity() {
    for seed in 0..4 {
        let scene = free_tangle(seed);
        let euler = Method::LinearlyImplicitEuler;
        for tangent in [Tangent::Clamped, Tangent::Absolute] {
            for h in [0.02, 0.1] {
                assert_energy_falls(&with(&scene, euler, Some(tangent), h), 300, 0.0);
            }
        }
        // The others may leave out stiffness that is there, and then only do so
        // while steps are short for the vibrations.
        for tangent in [Tangent::Exact, Tangent::Filtered, Tangent::Material] {
            assert_energy_falls(&with(&scene, euler, Some(tangent), 1e-3), 1000, 0.0);
        }
        for h in [0.02, 0.1] {
            assert_energy_falls(&with(&scene, Method::ImplicitEuler, None, h), 300, 0.0);
        }
    }
    for tangent in [Tangent::Exact, Tangent::Clamped, Tangent::Absolute] {
        let mut scene = free_tangle(9);
        scene
            .springs
            .iter_mut()
            .for_each(|spring| spring.rest_length = 0.0);
        let scene = with(&scene, Method::LinearlyImplicitEuler, Some(tangent), 0.05);
        assert_energy_falls(&scene, 300, 0.0);
    }
    let scene = with(&free_tangle(2), Method::VelocityVerlet, None, 1e-5);
    assert_energy_falls(&scene, 5000, 1e-9);
}

fn assert_energy_falls(scene: &Scene, steps: usize, ripple: f64) {
    let mut scene = scene.clone();
    for spring in &mut scene.springs {
        spring.damping = spring.damping.max(0.2);
    }
    let h = match scene.settings.step {
        springs_scene::StepControl::Fixed(h) => h,
        _ => unreachable!(),
    };
    let mut stepper = Stepper::new(&scene).unwrap();
    let mut nodes = NodeStates::of(&scene);
    let energy = |stepper: &Stepper| {
        let state = stepper.state();
        stepper.system().energy(&state.x, &state.v).total()
    };
    let mut last = energy(&stepper);
    let first = last;
    for step in 1..=steps {
        stepper.step(&mut nodes, h).unwrap();
        let now = energy(&stepper);
        // Rounding of a sum over all nodes and springs.
        let allowed = (1e-13 + ripple) * first;
        assert!(
            now <= last + allowed,
            "{:?}, step {step}: rises by {:e} of {first}",
            scene.settings.tangent,
            now - last
        );
        last = now;
    }
    assert!(last < 0.9 * first, "the dashpots must have done something");
}

/// A uniformly moving anchor is a standing one seen from a moving frame.
#[test]
fn moving_anchors_are_standing_anchors_in_a_moving_frame() {
    let w = Vector3::new(0.7, -1.1, 0.4);
    for (method, tangent, h) in variants() {
        let mut standing = tangle(15, 11);
        standing.nodes[1].velocity = Vector3::zeros();
        let standing = with(&standing, method, tangent, h);
        let mut moving = standing.clone();
        for node in &mut moving.nodes {
            node.velocity += w;
        }
        let steps = 100;
        // Velocities feel rounding of positions through the fastest vibration.
        let fastest = compile(&standing).unwrap().frequency_bound();
        let (standing, mut moving) = (after(&standing, steps), after(&moving, steps));
        for (x, v) in moving.positions.iter_mut().zip(&mut moving.velocities) {
            *x -= w * (steps as f64 * h);
            *v -= w;
        }
        let x = distance(&standing.positions, &moving.positions);
        let v = distance(&standing.velocities, &moving.velocities);
        // Stages of converged methods are solved to 1e-13 of the velocities, a
        // hundred times, and the motion lets differences grow.
        let solved = matches!(
            method,
            Method::ImplicitEuler | Method::TrBdf2 | Method::ImplicitMidpoint
        );
        let allowed = if solved { 1e-10 } else { 1e-12 };
        assert!(
            x < allowed && v < allowed * fastest,
            "{method} {tangent:?}: {x:e} {v:e}"
        );
    }
}

/// The books balance: work of the anchors, heat and the method's own loss add
/// up to the change of energy, and the last goes to zero with the step.
#[test]
fn the_ledger_closes() {
    for (method, tangent, h) in variants() {
        if method == Method::Dop853 {
            // Its own loss is at rounding here; tests/ledger.rs has its order.
            continue;
        }
        let gain = |h: f64| {
            let mut scene = with(&tangle(12, 4), method, tangent, h);
            scene.settings.duration = 0.5;
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.run(1, &mut ()).unwrap();
            let ledger = simulation.ledger();
            assert!(ledger.heat.sum() > 0.0 && ledger.anchor_work != 0.0);
            ledger.method_gain(&simulation.energy()).abs() / ledger.start.total().abs()
        };
        let order = match method {
            Method::LinearlyImplicitEuler | Method::ImplicitEuler => 1.0,
            _ => 2.0,
        };
        let (coarse, fine) = (gain(h / 64.0), gain(h / 256.0));
        let observed = (coarse / fine).log2() / 2.0;
        assert!(
            (observed - order).abs() < 0.1,
            "{method} {tangent:?}: {observed}"
        );
    }
}

/// Springs between fixed nodes change nothing but the energy.
#[test]
fn springs_between_fixed_nodes_do_not_touch_the_motion() {
    for (method, tangent, h) in variants() {
        let without = {
            let mut scene = with(&tangle(15, 6), method, tangent, h);
            scene.springs.pop();
            scene
        };
        let mut with_it = without.clone();
        with_it.add_spring(0, 1, 1e5);
        assert_eq!(after(&without, 50), after(&with_it, 50));
        let energy = |scene: &Scene| {
            let system = compile(scene).unwrap();
            let (x, v) = (system.initial_positions(), system.initial_velocities());
            system.energy(x, v).elastic()
        };
        with_it.springs.last_mut().unwrap().rest_length *= 0.5;
        assert!(energy(&with_it) > energy(&without) + 1.0);
    }
}

#[test]
fn repeated_runs_and_fixed_nodes_are_bit_identical() {
    let scene = cloth(12, Material::of_cloth());
    for (method, tangent, h) in variants() {
        let scene = with(&scene, method, tangent, h);
        let (first, second) = (after(&scene, 30), after(&scene, 30));
        assert_eq!(first, second);
        for node in [0, 11] {
            assert_eq!(first.positions[node], scene.nodes[node].position);
        }
    }
}

/// The user may take hold of an anchor between steps.
#[test]
fn an_anchor_set_in_motion_pulls_like_one_that_always_moved() {
    let w = Vector3::new(0.4, 0.1, -0.3);
    for (method, tangent, h) in variants() {
        let mut moving = with(&tangle(10, 3), method, tangent, h);
        moving.nodes[0].velocity = w;
        let mut standing = moving.clone();
        standing.nodes[0].velocity = Vector3::zeros();
        let mut stepper = Stepper::new(&standing).unwrap();
        let mut nodes = NodeStates::of(&standing);
        nodes.velocities[0] = w;
        for _ in 0..20 {
            stepper.step(&mut nodes, h).unwrap();
        }
        let expected = after(&moving, 20);
        let x = distance(&nodes.positions, &expected.positions);
        assert!(x < 1e-12, "{method} {tangent:?}: {x:e}");
    }
}

/// Stopped and gone on, the run is the same.
#[test]
fn a_simulation_goes_on_after_a_stop() {
    struct Stop(f64, Vec<f64>);
    impl springs_step::Observer for Stop {
        fn frame(&mut self, frame: springs_step::Frame<'_>) -> std::ops::ControlFlow<()> {
            self.1.push(frame.time);
            std::ops::ControlFlow::Continue(())
        }
        fn step(&mut self, time: f64, _steps: u64) -> std::ops::ControlFlow<()> {
            if time < self.0 {
                std::ops::ControlFlow::Continue(())
            } else {
                std::ops::ControlFlow::Break(())
            }
        }
    }
    let scene = with(
        &cloth(5, Material::of_cloth()),
        Method::ImplicitEuler,
        None,
        0.01,
    );
    let mut whole = Simulation::new(&scene).unwrap();
    whole.run(10, &mut ()).unwrap();
    let mut parts = Simulation::new(&scene).unwrap();
    let mut observer = Stop(0.35, Vec::new());
    parts.run(10, &mut observer).unwrap();
    observer.0 = f64::INFINITY;
    parts.run(10, &mut observer).unwrap();
    assert_eq!(parts.nodes(), whole.nodes());
    let times: Vec<f64> = (0..=10).map(|k| k as f64 / 10.0).collect();
    assert_eq!(observer.1, times);
}
