//! Observed order of convergence against a much finer run of another method.

mod common;

use common::{after, distance, tangle, with};
use springs_scene::{Method, Scene, Tangent};
use springs_step::NodeStates;

/// Runs a method over a fifth of a second.
fn run(scene: &Scene, method: Method, tangent: Option<Tangent>, steps: usize) -> NodeStates {
    after(
        &with(scene, method, tangent, DURATION / steps as f64),
        steps,
    )
}

const DURATION: f64 = 0.2;

/// log₂ of the ratio of errors for three halvings.
fn observed_orders(
    scene: &Scene,
    (method, tangent): (Method, Option<Tangent>),
    coarsest: usize,
    reference: &NodeStates,
) -> Vec<f64> {
    let error = |steps| {
        let nodes = run(scene, method, tangent, steps);
        distance(&nodes.positions, &reference.positions)
    };
    let errors: Vec<f64> = (0..4).map(|k| error(coarsest << k)).collect();
    let orders = errors.windows(2).map(|pair| (pair[0] / pair[1]).log2());
    orders.collect()
}

/// With dashpots and a moving anchor, and without dashpots.
fn scenes() -> [Scene; 2] {
    let damped = tangle(6, 5);
    let mut plain = damped.clone();
    for spring in &mut plain.springs {
        spring.damping = 0.0;
    }
    [damped, plain]
}

/// Each method against a fine run of two others that agree with each other.
#[test]
fn every_method_has_its_order() {
    let euler = Method::LinearlyImplicitEuler;
    let tangents = Tangent::ALL
        .iter()
        .map(|&tangent| (euler, Some(tangent), 1.0, 3200));
    let methods = [
        (Method::ImplicitEuler, None, 1.0, 3200),
        (Method::TrBdf2, None, 2.0, 200),
        (Method::ImplicitMidpoint, None, 2.0, 200),
        (Method::VelocityVerlet, None, 2.0, 200),
        (Method::FilteredLeapfrog, None, 2.0, 200),
        (Method::BlanesMoan4, None, 4.0, 40),
        (Method::BlanesMoan6, None, 6.0, 14),
        (Method::Dop853, None, 8.0, 10),
        (Method::Rodas4, None, 4.0, 40),
    ];
    for scene in scenes() {
        let reference = run(&scene, Method::Dop853, None, 2000);
        let other = run(&scene, Method::VelocityVerlet, None, 200_000);
        let trusted = distance(&reference.positions, &other.positions);
        assert!(trusted < 1e-9, "{trusted:e}");
        let damped = scene.springs.iter().any(|spring| spring.damping > 0.0);
        for (method, tangent, order, coarsest) in tangents.clone().chain(methods) {
            if WITHOUT_DASHPOTS.contains(&method) && damped {
                continue;
            }
            let observed = observed_orders(&scene, (method, tangent), coarsest, &reference);
            let off = observed
                .iter()
                .map(|o| (o - order).abs())
                .fold(0.0, f64::max);
            assert!(off < 0.1, "{method} {tangent:?}: {observed:?}, not {order}");
        }
    }
}

const WITHOUT_DASHPOTS: [Method; 3] = [Method::BlanesMoan4, Method::BlanesMoan6, Method::Rodas4];

#[test]
fn methods_that_cannot_treat_dashpots_refuse_them() {
    for method in WITHOUT_DASHPOTS {
        let scene = with(&tangle(8, 3), method, None, 0.01);
        let error = springs_step::Stepper::new(&scene).err().unwrap();
        assert!(
            error.to_string().contains("cannot treat dashpots"),
            "{error}"
        );
    }
}
