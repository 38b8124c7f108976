//! Runs whose energy diverges end with an error, at once and also in their last
//! step; runs that are almost at rest do not.

mod common;

use common::{Random, append, tangle, with};
use nalgebra::Vector3;
use springs_assembly::{Compilation, compile_with};
use springs_scene::generate::{Material, chain};
use springs_scene::{Method, Node, RunOptions, Scene, StepControl};
use springs_step::{
    Account, Cause, Frame, Islands, NodeStates, Observer, Simulation, State, StepError,
};
use std::ops::ControlFlow;

/// 1 kg at 1 m/s on a spring of 1e8 N/m: 0.5 J, and hω = 1e4 for steps of 1 s.
fn stiff(method: Method, duration: f64) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        velocity: Vector3::x(),
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, 1e8);
    scene.settings.duration = duration;
    with(&scene, method, None, 1.0)
}

fn failure(scene: &Scene, options: &RunOptions) -> (StepError, Simulation) {
    let mut simulation = Simulation::with_options(scene, options).unwrap();
    let error = simulation.run(1, &mut ()).expect_err("it diverges");
    (error, simulation)
}

/// From the first step on and in the last one, by the energy of springs as well as
/// by that of motion; the step is then not made, and steps and time agree.
#[test]
fn energy_that_diverges_is_an_error_in_any_step() {
    let explicit = [
        Method::VelocityVerlet,
        Method::BlanesMoan4,
        Method::BlanesMoan6,
        Method::Dop853,
    ];
    for method in explicit {
        for duration in [1.0, 2.0, 3.0] {
            for substeps in [false, true] {
                let scene = stiff(method, duration);
                let options = RunOptions::default().with_substeps(substeps);
                let (error, simulation) = failure(&scene, &options);
                assert_eq!(error.cause, Cause::EnergyDiverged, "{method}: {error}");
                assert_eq!(error.node, 1);
                assert!(
                    error
                        .to_string()
                        .starts_with("the energy diverged at node 1 in step 1")
                );
                let steps = simulation.work().counts.steps;
                assert_eq!((error.step, error.time), (steps + 1, steps as f64));
                assert_eq!(simulation.stepper().time(), error.time);
                assert!(simulation.energy().total() < 1e4);
            }
        }
    }
}

/// 0.1 m/s times a step of 1 s is no more than a tenth of the spring; velocity Verlet
/// diverges in its first step.
#[test]
fn filtered_leapfrog_makes_no_energy_of_vibrations_that_it_does_not_resolve() {
    let mut scene = stiff(Method::FilteredLeapfrog, 1000.0);
    scene.nodes[1].velocity *= 0.1;
    let mut simulation = Simulation::new(&scene).unwrap();
    while simulation.step().unwrap().is_some() {
        let energy = simulation.energy().total();
        assert!(energy < 1.01 * 5e-3, "{energy} J of 5 mJ");
        let stretch = simulation.nodes().positions[1].x - 1.0;
        assert!(stretch.abs() < 1e-8, "{stretch:e} m");
    }
}

#[test]
fn a_step_whose_energy_diverges_changes_nothing() {
    let mut scene = stiff(Method::VelocityVerlet, 3.0);
    scene.nodes[1].velocity = Vector3::zeros();
    scene.nodes[1].position.x = 1.0 + 1e-9;
    let mut simulation = Simulation::new(&scene).unwrap();
    let before = simulation.nodes().clone();
    simulation.step().expect_err("it diverges");
    assert_eq!(*simulation.nodes(), before);
    assert_eq!(simulation.stepper().time(), 0.0);
    assert_eq!(simulation.energy(), simulation.ledger().start);
}

/// At coordinates near 1e3 m, rounding is good for more energy than slow motions
/// have.
#[test]
fn scenes_almost_at_rest_are_no_alarm() {
    let mut random = Random(11);
    for case in 0..60 {
        let mut scene = Scene::default();
        let centre = random.vector(1e3);
        for node in 0..3 {
            scene.add_node(Node {
                fixed: node == 0,
                mass: 1.0,
                ..Node::at(centre + random.vector(1.0))
            });
        }
        let stiffness = 10f64.powf(random.between(3.0, 8.0));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            scene.add_spring(a, b, stiffness);
        }
        let speed = 10f64.powf(random.between(-16.0, -9.0));
        scene.nodes[1].velocity = random.vector(speed);
        let h = 0.2 / stiffness.sqrt();
        scene.settings.duration = 2000.0 * h;
        let methods = [
            Method::TrBdf2,
            Method::VelocityVerlet,
            Method::ImplicitMidpoint,
        ];
        let scene = with(&scene, methods[case % 3], None, h);
        let mut simulation = Simulation::new(&scene).unwrap();
        if let Err(error) = simulation.run(1, &mut ()) {
            panic!("K = {stiffness:e}, v = {speed:e}: {error}");
        }
    }
}

/// Filtered leapfrog holds a weight with a stretch of about αh² times the acceleration, a
/// tenth of a millimetre here, whatever the stiffness; what comes out does not have it.
#[test]
fn springs_are_as_long_as_they_are_with_filtered_leapfrog() {
    for stiffness in [1e8, 1e12, 1e15] {
        let mut scene = common::moving::pendulum(stiffness);
        scene.settings.duration = 1.0;
        let scene = with(&scene, Method::FilteredLeapfrog, None, 0.01);
        let mut simulation = Simulation::new(&scene).unwrap();
        while simulation.step().unwrap().is_some() {
            let stretch = simulation.nodes().positions[1].norm() - 1.0;
            // (αh²·9.81 m/s²)²/2, since positions are right to first order in αh² a, and what
            // up to 3 kg·9.81 m/s² stretch it by.
            assert!(
                stretch.abs() < 5e-8 + 30.0 / stiffness,
                "{stiffness:e}: {stretch:e} m"
            );
        }
    }
}

/// Holds every account against the energy of the frame of the same time.
struct Compare<'a> {
    scene: &'a Scene,
    frame: Option<(f64, NodeStates)>,
    accounts: Vec<Account>,
}

impl Observer for Compare<'_> {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.frame = Some((frame.time, frame.nodes.clone()));
        ControlFlow::Continue(())
    }

    fn wants_account(&self) -> bool {
        self.frame.is_some()
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        let (time, nodes) = self.frame.take().expect("after a frame");
        assert_eq!(account.time, time);
        let mut scene = self.scene.clone();
        nodes.write_to(&mut scene);
        for (spring, old) in scene.springs.iter_mut().zip(&self.scene.springs) {
            spring.rest_length = old.rest_length;
        }
        let system = compile_with(&scene, Compilation::complete()).unwrap();
        let state = State {
            time,
            x: system.initial_positions().to_vec(),
            v: system.initial_velocities().to_vec(),
        };
        let (energy, expected) = (account.energy, system.energy(&state.x, &state.v));
        for (part, expected) in [
            (energy.kinetic, expected.kinetic),
            (energy.elastic(), expected.elastic()),
            (energy.gravity(), expected.gravity()),
        ] {
            let error = (part - expected).abs();
            assert!(
                error < 1e-11 * (1.0 + expected.abs()),
                "{time}: {part} {expected}"
            );
        }
        self.accounts.push(account);
        ControlFlow::Continue(())
    }
}

fn accounts(scene: &Scene, options: &RunOptions, intervals: usize) -> Vec<Account> {
    let mut observer = Compare {
        scene,
        frame: None,
        accounts: Vec::new(),
    };
    let mut islands = Islands::with_options(scene, options).unwrap();
    islands.run(intervals, &mut observer).unwrap();
    assert_eq!(observer.accounts.len(), intervals + 1);
    let last = observer.accounts[intervals];
    assert_eq!(
        (last.energy, last.ledger),
        (islands.energy(), islands.ledger())
    );
    observer.accounts
}

/// Energies and flows of several parts, each with steps of its own, are those of
/// one time; some of the parts may sleep.
#[test]
fn accounts_of_several_parts_are_of_one_time() {
    let mut scene = tangle(8, 4);
    let mut other = tangle(7, 6);
    other.nodes.iter_mut().for_each(|node| node.mass *= 30.0);
    append(&mut scene, &other);
    // A weight that comes to rest.
    let mut weight = Scene::default();
    weight.add_node(Node::fixed(Vector3::zeros()));
    weight.add_node(Node {
        mass: 0.1,
        velocity: Vector3::new(0.0, 0.0, 0.1),
        ..Node::at(Vector3::new(0.0, 0.0, -1.0))
    });
    weight.add_spring(0, 1, 1e3);
    weight.springs[0].damping = 15.0;
    append(&mut scene, &weight);
    scene.settings.duration = 0.6;
    for (method, tolerance, allowed) in [(Method::Dop853, 1e-8, 1e-5), (Method::TrBdf2, 1e-6, 2e-3)]
    {
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(tolerance);
        let [apart, together] = [true, false].map(|skip| {
            let options = RunOptions::default().with_skip(skip);
            accounts(&scene, &options, 41)
        });
        for (a, b) in apart.iter().zip(&together) {
            for (a, b) in [
                (a.energy.total(), b.energy.total()),
                (a.ledger.heat.sum(), b.ledger.heat.sum()),
                (a.ledger.anchor_work, b.ledger.anchor_work),
                (a.ledger.method_gain(&a.energy), 0.0),
            ] {
                assert!((a - b).abs() < allowed, "{method}: {a} {b}");
            }
        }
    }
    accounts(&scene, &RunOptions::default().with_sleep(1e-3), 41);
}

/// Nothing holds a straight chain across, so that its first step at any size falls far
/// beyond the lengths of its springs. What that puts into them is gone after the next
/// one, and no reason to stop.
#[test]
fn stiff_springs_that_a_step_overstretched_are_no_divergence() {
    let n = 5000;
    let method = Method::LinearlyImplicitEuler;
    let mut scene = with(&chain(n, Material::of_chain(n)), method, None, 1.0 / 60.0);
    scene.settings.duration = 0.5;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.run(1, &mut ()).expect("a run");
    // It swings down as a chain of a metre does.
    let tip = simulation.nodes().positions[n];
    assert!(tip.z < -0.3 && tip.norm() < 1.1, "{tip}");
}

/// Where a tolerance is larger than springs are long, steps that meet it may stretch
/// stiff ones to twice their length.
#[test]
fn what_a_tolerance_allows_is_no_divergence() {
    let mut scene = chain(
        100,
        Material {
            stiffness: 1e9,
            ..Material::of_chain(100)
        },
    );
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    scene.settings.duration = 0.5;
    let mut ends = Vec::new();
    for method in [Method::Auto, Method::FilteredLeapfrog] {
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(0.1);
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        ends.push(simulation.nodes().positions[100]);
    }
    scene.settings.method = Method::TrBdf2;
    scene.settings.step = StepControl::Tolerance(1e-3);
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.run(1, &mut ()).unwrap();
    for end in ends {
        let off = (end - simulation.nodes().positions[100]).norm();
        assert!(off < 0.1, "{off:e} m");
    }
}
