//! Loops of one's own: single steps of a simulation, states between them,
//! events, and methods from outside.

mod common;

use common::moving::{chain_of_20, pendulum, with_gravity};
use common::{distance, solved};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::{Method as Name, Node, RunOptions, Scene, StepControl};
use springs_step::{
    Anchors, Archive, Cause, Doubling, ErrorEstimate, Interval, Method, MethodError, NodeStates,
    Simulation, State, Work,
};

fn adaptive(scene: &Scene, method: Name, tolerance: f64) -> Simulation {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.step = StepControl::Tolerance(tolerance);
    Simulation::new(&scene).unwrap()
}

/// A thrown node passes z = 0 when t = 2 v/g, whatever the steps.
#[test]
fn a_thrown_node_comes_down_when_it_must() {
    let mut scene = with_gravity("thrown");
    scene.add_node(Node {
        mass: 0.3,
        velocity: Vector3::new(1.0, 0.0, 4.0),
        ..Node::at(Vector3::zeros())
    });
    let expected = 8.0 / 9.81;
    for method in [Name::Dop853, Name::TrBdf2, Name::VelocityVerlet] {
        let mut simulation = adaptive(&scene, method, 1e-6);
        let event = |time: f64, nodes: &NodeStates| match time {
            0.0 => -1.0,
            _ => -nodes.positions[0].z,
        };
        let (time, nodes) = simulation.run_until(event).unwrap().expect("it comes down");
        assert!((time - expected).abs() < 1e-9, "{method}: {time}");
        assert!(nodes.positions[0].z.abs() < 1e-8, "{method}");
        assert!((nodes.positions[0].x - expected).abs() < 1e-8, "{method}");
        assert!(simulation.stepper().time() >= time);
    }
}

/// The lowest point of a pendulum is an event of its velocity; it is found to
/// the tolerance, and the simulation goes on to the next one.
#[test]
fn events_are_found_to_the_tolerance() {
    let find = |method, tolerance| {
        let mut scene = pendulum(60.0);
        scene.settings.duration = 4.0;
        let mut simulation = adaptive(&scene, method, tolerance);
        let rises = |_: f64, nodes: &NodeStates| nodes.velocities[1].z;
        let first = simulation
            .run_until(rises)
            .unwrap()
            .expect("a first time")
            .0;
        let second = simulation.run_until(rises).unwrap().expect("a second").0;
        assert!(second > first);
        [first, second]
    };
    let reference = find(Name::Dop853, 1e-11);
    for (method, tolerance) in [(Name::TrBdf2, 1e-5), (Name::Dop853, 1e-5)] {
        for (time, expected) in find(method, tolerance).into_iter().zip(reference) {
            let error = (time - expected).abs();
            assert!(error < 20.0 * tolerance, "{method}: {time} for {expected}");
        }
    }
}

#[test]
fn an_event_that_does_not_happen_ends_with_the_duration() {
    let mut simulation = adaptive(&pendulum(1e4), Name::TrBdf2, 1e-3);
    assert!(simulation.run_until(|_, _| -1.0).unwrap().is_none());
    assert_eq!(simulation.stepper().time(), simulation.duration());
    assert!(simulation.step().unwrap().is_none());
}

/// States between steps are as good as the method.
#[test]
fn states_between_steps_follow_the_motion() {
    let scene = chain_of_20(1e4);
    for (method, tolerance) in [(Name::Dop853, 1e-8), (Name::TrBdf2, 1e-3)] {
        let mut simulation = adaptive(&scene, method, tolerance);
        let mut between = NodeStates::of(&scene);
        while let Some(interval) = simulation.step().unwrap() {
            if interval.start < 0.3 || interval.start > 0.5 {
                continue;
            }
            let time = interval.start + 0.37 * interval.size;
            simulation.state_at(time, &mut between).unwrap();
            let mut until_there = scene.clone();
            until_there.settings.duration = time;
            let expected = solved(&until_there, Name::Dop853, 1e-10);
            let error = distance(&between.positions, &expected);
            assert!(error < 10.0 * tolerance, "{method} at {time}: {error:e}");
            simulation.state_at(interval.end, &mut between).unwrap();
            assert_eq!(&between, simulation.nodes());
        }
    }
}

/// The last step may have been made by a run.
#[test]
fn states_within_the_last_step_of_a_run() {
    let scene = pendulum(60.0);
    let mut simulation = adaptive(&scene, Name::Dop853, 1e-8);
    simulation.step().unwrap();
    simulation.run(1, &mut ()).unwrap();
    let time = 0.999_999 * simulation.duration();
    let mut nodes = NodeStates::of(&scene);
    simulation.state_at(time, &mut nodes).unwrap();
    let moved = distance(&nodes.positions, &simulation.nodes().positions);
    assert!(moved > 1e-7 && moved < 1e-4, "{moved:e}");
}

/// Euler's symplectic method, as a user would write it.
struct SymplecticEuler(Vec<Vector3<f64>>);

impl Method for SymplecticEuler {
    fn order(&self) -> u32 {
        1
    }

    fn restart(&mut self) {}

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        system.forces(state.time, &state.x, &state.v, &mut self.0);
        work.counts.force_evaluations += 1;
        for block in 0..system.n_free() {
            state.v[block] += self.0[block] * (interval.size / system.masses()[block]);
            let v = state.v[block];
            state.x[block] += v * interval.size;
        }
        anchors.place(interval.end, &mut state.x, &mut state.v);
        Ok(None)
    }

    /// It carries nothing from step to step.
    fn archive(&mut self, _state: &mut Archive) {}

    fn accept(&mut self) {}
}

fn symplectic_euler(system: &System) -> Box<dyn Method> {
    Box::new(SymplecticEuler(vec![Vector3::zeros(); system.n_free()]))
}

#[test]
fn a_method_from_outside_runs_in_a_simulation() {
    let mut scene = pendulum(60.0);
    scene.settings.step = StepControl::Fixed(1e-4);
    let reference = solved(&scene, Name::Dop853, 1e-10);
    let options = RunOptions::default();
    let mut simulation = Simulation::with_method(&scene, &options, symplectic_euler).unwrap();
    simulation.run(10, &mut ()).unwrap();
    assert_eq!(simulation.work().counts.force_evaluations, 10_000);
    let error = distance(&simulation.nodes().positions, &reference);
    assert!(error < 2e-3, "{error:e}");

    scene.settings.step = StepControl::Tolerance(1e-2);
    let mut plain = Simulation::with_method(&scene, &options, symplectic_euler).unwrap();
    let refusal = plain.run(1, &mut ()).unwrap_err();
    assert_eq!(refusal.cause, Cause::NoEstimate);
    let doubled = |system: &System| -> Box<dyn Method> {
        Box::new(Doubling::new(system, symplectic_euler(system)))
    };
    let mut simulation = Simulation::with_method(&scene, &options, doubled).unwrap();
    simulation.run(1, &mut ()).unwrap();
    let error = distance(&simulation.nodes().positions, &reference);
    assert!(error < 0.1 && error > 1e-4, "{error:e}");
}
