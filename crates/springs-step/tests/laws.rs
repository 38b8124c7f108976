//! Springs with the laws of `springs-math`, moved by methods of different kinds.

mod common;

use common::distance;
use nalgebra::Vector3;
use springs_assembly::{Emitter, SpringBetween, Springs};
use springs_math::law::{
    Bilinear, CompressionOnly, Law, Point, Polynomial, Power, StrainLimit, Table, TensionOnly,
};
use springs_math::spring::Spring;
use springs_scene::{Method, Node, RunOptions, Scene, StepControl};
use springs_step::{Outcome, Simulation};

const REST_LENGTH: f64 = 1.0;

/// Each with the order of errors in steps over its edges, all steps taken together: m + 1
/// with m continuous derivatives of V, and p + 1 for a power.
fn laws() -> Vec<(Law, f64)> {
    let rest_length = REST_LENGTH;
    let stiffness = 40.0;
    let bilinear = |blend| {
        Law::Bilinear(Bilinear {
            stiffness,
            compression: 8.0,
            rest_length,
            blend,
        })
    };
    let points = [
        (-0.3, -20.0),
        (-0.1, -2.0),
        (0.0, 0.0),
        (0.1, 4.0),
        (0.4, 30.0),
    ];
    let points = points.map(|(strain, tension)| Point { strain, tension });
    let spring = Spring::of_axial_stiffness(stiffness, rest_length);
    vec![
        (Law::Linear(spring), f64::INFINITY),
        (
            Law::TensionOnly(TensionOnly {
                stiffness,
                rest_length,
                blend: 0.2,
            }),
            4.0,
        ),
        (
            Law::CompressionOnly(CompressionOnly {
                stiffness,
                rest_length,
                blend: 0.2,
            }),
            4.0,
        ),
        (bilinear(0.2), 4.0),
        (bilinear(0.0), 2.0),
        (
            Law::StrainLimit(StrainLimit {
                spring,
                strain: 0.1,
                stiffness: 4.0 * stiffness,
                blend: 0.1,
            }),
            4.0,
        ),
        (
            Law::Polynomial(Polynomial {
                coefficients: vec![stiffness, -10.0, 100.0],
                rest_length,
            }),
            f64::INFINITY,
        ),
        (
            Law::Power(Power {
                stiffness: 100.0,
                exponent: 1.5,
                rest_length,
            }),
            2.5,
        ),
        (Law::Table(Table::new(&points, rest_length).unwrap()), 3.0),
    ]
}

/// A rope between two fixed nodes that swings and vibrates: all springs pass their rest
/// lengths.
fn rope() -> Scene {
    let mut scene = Scene::default();
    for k in 0..6 {
        let k = f64::from(k);
        scene.add_node(Node {
            mass: 1.0 + 0.1 * k,
            velocity: Vector3::new((1.3 * k).sin(), -0.5 * (0.9 * k).cos(), 0.3),
            ..Node::at(Vector3::new(1.02 * k, 0.05 * (2.0 * k).sin(), 0.0))
        });
    }
    for end in [0, 5] {
        scene.nodes[end].fixed = true;
        scene.nodes[end].velocity = Vector3::zeros();
    }
    scene.gravity = Vector3::new(0.0, 0.0, -1.0);
    scene.settings.duration = 2.0;
    scene
}

fn run(law: &Law, method: Method, step: StepControl) -> Simulation {
    let springs: Vec<_> = (1..6)
        .map(|k| SpringBetween {
            nodes: [k - 1, k],
            law: law.clone(),
        })
        .collect();
    let mut scene = rope();
    scene.settings.method = method;
    scene.settings.step = step;
    let emitters: Vec<Box<dyn Emitter>> = vec![Box::new(Springs::new("springs", &springs))];
    let mut simulation =
        Simulation::with_emitters(&scene, &RunOptions::default(), emitters).unwrap();
    assert_eq!(simulation.run(1, &mut ()), Ok(Outcome::Finished));
    simulation
}

fn off(a: &Simulation, b: &Simulation) -> f64 {
    distance(&a.nodes().positions, &b.nodes().positions)
}

#[test]
fn methods_agree_and_keep_the_energy() {
    for (law, _) in laws() {
        let fine = run(&law, Method::Dop853, StepControl::Fixed(2e-4));
        let kinetic = fine.ledger().start.kinetic;
        for (method, tolerance) in [
            (Method::Dop853, 1e-6),
            (Method::TrBdf2, 1e-4),
            (Method::Auto, 1e-4),
            (Method::FilteredLeapfrog, 1e-3),
        ] {
            let end = run(&law, method, StepControl::Tolerance(tolerance));
            let off = off(&end, &fine);
            assert!(off < 3.0 * tolerance, "{method}, {law:?}: {off:e}");
            let gain = end.ledger().method_gain(&end.energy()).abs();
            assert!(
                gain < 10.0 * tolerance * kinetic,
                "{method}, {law:?}: {gain:e} J of {kinetic} J"
            );
        }
    }
}

/// The order of a method, or of what it loses at the edges of a law, whichever is less:
/// that of the errors' root mean square over a dozen step sizes, since errors at edges
/// depend on where in a step they are.
#[test]
fn orders_are_those_of_the_method_and_the_edges() {
    for (law, edge_order) in laws() {
        let fine = run(&law, Method::Dop853, StepControl::Fixed(2e-4));
        let duration = rope().settings.duration;
        for (method, order, n_steps) in [
            (Method::LinearlyImplicitEuler, 1.0, 400),
            (Method::ImplicitEuler, 1.0, 400),
            (Method::ImplicitMidpoint, 2.0, 100),
            (Method::FilteredLeapfrog, 2.0, 200),
            (Method::VelocityVerlet, 2.0, 100),
            (Method::TrBdf2, 2.0, 100),
            (Method::BlanesMoan4, 4.0, 60),
            (Method::Rodas4, 4.0, 100),
            (Method::BlanesMoan6, 6.0, 20),
        ] {
            let error = |refinement: u32| -> f64 {
                let squares = (0..12).map(|k| {
                    let n = refinement * (n_steps + k * n_steps / 20);
                    let step = StepControl::Fixed(duration / f64::from(n));
                    off(&run(&law, method, step), &fine).powi(2)
                });
                squares.sum::<f64>().sqrt()
            };
            let rate = (error(1) / error(8)).log2() / 3.0;
            let expected = edge_order.min(order);
            assert!(
                (rate - expected).abs() < 0.45,
                "{method}, {law:?}: order {rate} instead of {expected}"
            );
        }
    }
}
