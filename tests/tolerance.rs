//! The tolerance against the error that a run ends with.

mod common;

use common::{distance, tangle};
use nalgebra::Vector3;
use springs::scene::generate::{Material, block, chain, cloth, disturb};
use springs::scene::{Method, Node, Scene, StepControl};
use springs::step::Simulation;

fn pendulum(stiffness: f64) -> Scene {
    let mut scene = Scene {
        name: format!("pendulum, K = {stiffness:e}"),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    };
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, stiffness);
    scene
}

fn swinging(mut scene: Scene, duration: f64) -> Scene {
    disturb(&mut scene, 1e-4, 5);
    scene.settings.duration = duration;
    scene
}

fn scenes() -> Vec<Scene> {
    let of = |stiffness, material| Material {
        stiffness,
        ..material
    };
    let mut sideways = swinging(block(3, of(200.0, Material::of_block())), 0.5);
    sideways.gravity = Vector3::new(9.81, 0.0, 0.0);
    let mut damped = tangle(6, 5);
    damped.settings.duration = 0.4;
    vec![
        pendulum(60.0),
        pendulum(1e4),
        pendulum(1e8),
        swinging(chain(20, of(2e3, Material::of_chain(20))), 0.5),
        swinging(cloth(6, of(50.0, Material::of_cloth())), 0.4),
        sideways,
        damped,
    ]
}

fn run(scene: &Scene, method: Method, tolerance: f64) -> Vec<Vector3<f64>> {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.step = StepControl::Tolerance(tolerance);
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.run(1, &mut ()).unwrap();
    simulation.nodes().positions.clone()
}

/// The error stays within ten times the tolerance and falls with it.
#[test]
fn the_error_follows_the_tolerance() {
    for scene in scenes() {
        let reference = run(&scene, Method::Dop853, 1e-11);
        let other = run(&scene, Method::Dop853, 1e-10);
        let trusted = distance(&reference, &other);
        assert!(trusted < 1e-8, "{}: {trusted:e}", scene.name);
        for method in [
            Method::TrBdf2,
            Method::Dop853,
            Method::ImplicitEuler,
            Method::ImplicitMidpoint,
            Method::FilteredLeapfrog,
            Method::VelocityVerlet,
        ] {
            let mut last = f64::INFINITY;
            for tolerance in [1e-1, 1e-2, 1e-3] {
                let error = distance(&run(&scene, method, tolerance), &reference);
                let what = format!("{}, {method}, {tolerance:e}: {error:e}", scene.name);
                assert!(error < 10.0 * tolerance, "{what}");
                // Not where the error is far below already.
                assert!(
                    error < last || error < 0.01 * tolerance,
                    "{what} after {last:e}"
                );
                last = error;
            }
        }
    }
}
