//! Observed order of convergence against a much finer run of another method.

mod common;

use common::{after, distance, tangle, with};
use springs::scene::{Method, Scene, Tangent};

/// log₂ of the ratio of errors for three halvings.
fn observed_orders(
    scene: &Scene,
    method: Method,
    tangent: Option<Tangent>,
    coarsest: usize,
) -> Vec<f64> {
    let duration = 0.1;
    let run = |method, tangent, steps: usize| {
        after(
            &with(scene, method, tangent, duration / steps as f64),
            steps,
        )
    };
    let reference = run(Method::VelocityVerlet, None, 200_000);
    let error = |steps| {
        let nodes = run(method, tangent, steps);
        distance(&nodes.positions, &reference.positions)
    };
    let errors: Vec<f64> = (0..4).map(|k| error(coarsest << k)).collect();
    errors
        .windows(2)
        .map(|pair| (pair[0] / pair[1]).log2())
        .collect()
}

/// With dashpots and a moving anchor, and without both.
fn scenes() -> [Scene; 2] {
    let damped = tangle(8, 3);
    let mut plain = damped.clone();
    for spring in &mut plain.springs {
        spring.damping = 0.0;
    }
    plain.nodes[1].velocity = nalgebra::Vector3::zeros();
    [damped, plain]
}

#[test]
fn linearly_implicit_euler_has_order_1_with_every_tangent() {
    for scene in scenes() {
        for &tangent in Tangent::ALL {
            let orders = observed_orders(&scene, Method::LinearlyImplicitEuler, Some(tangent), 400);
            for order in &orders {
                assert!((order - 1.0).abs() < 0.1, "{tangent}: {orders:?}");
            }
        }
    }
}

#[test]
fn velocity_verlet_has_order_2() {
    for scene in scenes() {
        let orders = observed_orders(&scene, Method::VelocityVerlet, None, 100);
        for order in &orders {
            assert!((order - 2.0).abs() < 0.1, "{orders:?}");
        }
    }
}
