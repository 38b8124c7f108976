//! What `Auto` chooses, and that it is right.

mod common;

use common::moving::{moving_scenes, pendulum, thrown};
use common::{distance, growth, reference};
use springs_scene::generate::{Material, chain, cloth};
use springs_scene::{Method, Node, Scene, StepControl, Vector3};
use springs_step::Simulation;

fn auto(scene: &Scene, tolerance: f64) -> Simulation {
    let mut scene = scene.clone();
    scene.settings.method = Method::Auto;
    scene.settings.step = StepControl::Tolerance(tolerance);
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.run(1, &mut ()).unwrap();
    simulation
}

fn is_explicit(method: Method) -> bool {
    matches!(
        method,
        Method::VelocityVerlet | Method::BlanesMoan4 | Method::BlanesMoan6 | Method::Dop853
    )
}

#[test]
fn soft_scenes_are_explicit_and_stiff_ones_implicit() {
    let soft = auto(&cloth(8, Material::of_cloth()), 1e-3);
    assert!(is_explicit(soft.choice().method), "{:?}", soft.choice());
    assert_eq!(soft.work().counts.symbolic_factorizations, 0);
    for stiffness in [1e8, 1e10] {
        let stiff = auto(&pendulum(stiffness), 1e-2);
        assert!(!is_explicit(stiff.choice().method), "{:?}", stiff.choice());
        assert!(stiff.work().counts.steps < 200);
        assert!(!stiff.choice().reason.is_empty());
    }
}

/// Vibrations of very stiff springs that nobody asked for are left behind, neither followed
/// through at the start nor taken for a reason to go on in explicit steps.
#[test]
fn vibrations_of_very_stiff_springs_are_not_followed() {
    for (scene, most) in [(pendulum(1e8), 500), (thrown(1e8), 100)] {
        for tolerance in [1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4] {
            let simulation = auto(&scene, tolerance);
            let (choice, steps) = (simulation.choice(), simulation.work().counts.steps);
            assert!(steps < most, "{tolerance:e}: {steps} steps, {choice:?}");
        }
    }
}

#[test]
fn it_is_never_wrong_by_much() {
    for scene in moving_scenes() {
        let (reference, _) = reference(&scene);
        let growth = growth(&scene, &reference).max(1.0);
        for tolerance in [1e-1, 1e-2, 1e-3, 1e-4] {
            let simulation = auto(&scene, tolerance);
            let error = distance(&simulation.nodes().positions, &reference);
            assert!(
                error < 10.0 * growth * tolerance,
                "{}, {tolerance:e}: {error:e} by {}",
                scene.name,
                simulation.choice().method
            );
        }
    }
}

/// A chain that hangs still is hit by a weight on a slack line.
fn struck() -> Scene {
    let mut scene = chain(30, Material::of_chain(30));
    let length = scene.nodes[1].position.norm();
    for (i, node) in scene.nodes.iter_mut().enumerate() {
        node.position = Vector3::new(0.0, 0.0, -length * i as f64);
    }
    for spring in &mut scene.springs {
        spring.damping = 2.0;
    }
    let weight = scene.add_node(Node {
        mass: 0.2,
        velocity: Vector3::new(-6.0, 0.0, 0.0),
        ..Node::at(Vector3::new(0.6, 0.0, -0.5))
    });
    let line = scene.add_spring(15, weight, 50.0);
    scene.springs[line].rest_length = 0.8;
    scene.settings.duration = 2.0;
    scene
}

/// Methods change as the scene does, in the same way every time: velocity Verlet
/// until the weight strikes, then DOP853.
#[test]
fn the_choice_is_reviewed() {
    let [first, again] = [auto(&struck(), 1e-3), auto(&struck(), 1e-3)];
    assert!(!first.switches().is_empty());
    assert_eq!(first.switches(), again.switches());
    assert_eq!(first.nodes(), again.nodes(), "to the last bit");
}

#[test]
fn nothing_to_do_is_done() {
    let mut scene = pendulum(60.0);
    scene.settings.duration = 0.0;
    let simulation = auto(&scene, 1e-3);
    assert_eq!(simulation.work().counts.steps, 0);
}
