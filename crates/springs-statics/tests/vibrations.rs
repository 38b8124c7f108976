//! Modes and paths beside the published ones.

use nalgebra::{DMatrix, Vector3};
use springs_assembly::{Evaluation, Weights, compile};
use springs_scene::generate::{Material, cloth};
use springs_scene::{Guide, Load, Node, OverTime, Scene, Spring};
use springs_statics::{
    Modes, Options, PathEnd, StaticsError, form_of_densities, modes, settle, trace,
};
use std::f64::consts::TAU;

fn lowest(scene: &Scene, count: usize) -> Modes {
    modes(scene, count, &Options::default()).unwrap()
}

/// A weight of mass m between two walls along x, with tension.
fn weight(stiffness: f64, rest_length: f64) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::x() * -1.0));
    scene.add_node(Node {
        mass: 0.5,
        ..Node::at(Vector3::zeros())
    });
    scene.add_node(Node::fixed(Vector3::x()));
    scene
        .springs
        .push(Spring::between(0, 1, stiffness, rest_length));
    scene
        .springs
        .push(Spring::between(1, 2, stiffness, rest_length));
    scene
}

#[test]
fn modes_that_grow_or_nothing_resists_are_counted() {
    // Along 2K, across 2K (1 − l₀) each.
    for (rest_length, negative, zero) in [(0.75, 0, 0), (1.0, 0, 2), (1.5, 2, 0)] {
        let modes = lowest(&weight(100.0, rest_length), 5);
        assert_eq!(
            (modes.n_all, modes.n_negative, modes.n_zero),
            (3, negative, zero)
        );
        let of = |stiffness: f64| stiffness.signum() * (stiffness.abs() / 0.5).sqrt() / TAU;
        let across = of(200.0 * (1.0 - rest_length));
        let expected = [across, across, of(200.0)];
        for (frequency, expected) in modes.frequencies.iter().zip(expected) {
            if zero > 0 && expected == 0.0 {
                assert_eq!(*frequency, 0.0);
            } else {
                assert!((frequency / expected - 1.0).abs() < 1e-10);
            }
        }
        // The part of a shape that iteration may leave wrong.
        assert!((modes.shapes[2][1] - Vector3::x()).norm() < 1e-8);
        assert_eq!(modes.shapes[2][0], Vector3::zeros());
    }
}

/// All modes of a hanging cloth against dense algebra, equal ones among them.
#[test]
fn modes_equal_dense_ones() {
    let mut scene = cloth(6, Material::of_cloth());
    let settled = settle(&scene, &Options::default()).unwrap();
    settled.write_to(&mut scene);
    let system = compile(&scene).unwrap();
    let mut out = system.linearization();
    let at = Evaluation::new(
        system.initial_positions(),
        system.initial_velocities(),
        Weights::STIFFNESS,
    );
    system.linearize(&at, &mut out);
    let n = 3 * system.n_free();
    let mut dense = DMatrix::zeros(n, n);
    for (row, column, value) in out.matrix.triplets() {
        let masses = system.masses();
        dense[(row, column)] = value / (masses[row / 3] * masses[column / 3]).sqrt();
    }
    let mut expected: Vec<f64> = dense.symmetric_eigenvalues().data.into();
    expected.sort_by(f64::total_cmp);
    for count in [1, 7, 40, n] {
        let modes = lowest(&scene, count);
        assert_eq!((modes.n_negative, modes.n_zero, modes.n_all), (0, 0, n));
        assert_eq!(modes.frequencies.len(), count);
        for (frequency, expected) in modes.frequencies.iter().zip(&expected) {
            let square = (TAU * frequency).powi(2);
            assert!((square - expected).abs() < 1e-9 * expected.abs().max(1.0));
        }
    }
}

/// Two springs in a row are one of half the stiffness.
#[test]
fn massless_nodes_follow_or_are_refused() {
    let mut scene = weight(100.0, 1.0);
    scene.nodes[0].position = Vector3::new(-2.0, 0.0, 0.0);
    scene.springs[0].nodes = [3, 1];
    scene.add_node(Node {
        guide: Some(Guide::Along(Vector3::x())),
        ..Node::at(Vector3::x() * -1.0)
    });
    scene.springs.push(Spring::between(0, 3, 100.0, 1.0));
    scene.nodes[1].guide = Some(Guide::Along(Vector3::x()));
    let modes = lowest(&scene, 10);
    assert_eq!(modes.n_all, 1);
    let expected = (150f64 / 0.5).sqrt() / TAU;
    assert!((modes.frequencies[0] / expected - 1.0).abs() < 1e-12);
    assert!((modes.shapes[0][3].x - 0.5).abs() < 1e-12);

    scene.nodes[3].guide = None;
    let error = springs_statics::modes(&scene, 1, &Options::default()).unwrap_err();
    assert!(
        matches!(error, StaticsError::LooseMasslessNode { node: 3 }),
        "{error}"
    );

    scene.nodes[1].mass = 0.0;
    let error = springs_statics::modes(&scene, 1, &Options::default()).unwrap_err();
    assert!(matches!(error, StaticsError::NoMass), "{error}");
}

#[test]
fn a_free_body_has_six_modes_without_frequency() {
    let mut scene = Scene::default();
    for at in [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]] {
        scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::from(at))
        });
    }
    for a in 0..4 {
        for b in a + 1..4 {
            scene.add_spring(a, b, 10.0);
        }
    }
    let modes = lowest(&scene, 12);
    assert_eq!((modes.n_all, modes.n_zero, modes.n_negative), (12, 6, 0));
    assert!(modes.frequencies[..6].iter().all(|f| *f == 0.0));
    assert!(modes.frequencies[6..].iter().all(|f| *f > 0.1));
}

#[test]
fn paths_need_loads_and_may_be_straight() {
    let mut scene = weight(100.0, 0.75);
    let error = trace(&scene, 10, &Options::default()).unwrap_err();
    assert!(matches!(error, StaticsError::NoLoads));
    scene.loads = vec![Load {
        name: String::new(),
        nodes: vec![1],
        force: Vector3::x() * 20.0,
        over_time: OverTime::Constant,
    }];
    let path = trace(&scene, 100, &Options::default()).unwrap();
    assert_eq!(path.end, PathEnd::WholeLoad);
    for point in &path.points {
        assert!((point.displacement - point.factor * 20.0 / 200.0).abs() < 1e-12);
        assert!(!point.is_limit);
    }
    assert_eq!(path.points.last().unwrap().factor, 1.0);
    let short = trace(&scene, 3, &Options::default()).unwrap();
    assert_eq!((short.end, short.points.len()), (PathEnd::MostPoints, 3));
}

#[test]
fn forms_keep_to_guides_and_need_a_hold() {
    let mut scene = weight(1.0, 1.0);
    scene.gravity = Vector3::new(0.0, 0.0, -10.0);
    // 0.5 kg at two springs of 5 N/m each.
    let form = form_of_densities(&scene, &[5.0, 5.0]).unwrap();
    assert!((form[1] - Vector3::new(0.0, 0.0, -0.5)).norm() < 1e-14);
    scene.nodes[1].guide = Some(Guide::Along(Vector3::new(0.0, 1.0, 1.0)));
    let form = form_of_densities(&scene, &[5.0, 5.0]).unwrap();
    assert!((form[1] - Vector3::new(0.0, -0.25, -0.25)).norm() < 1e-14);
    assert!(matches!(
        form_of_densities(&scene, &[5.0, -5.0]),
        Err(StaticsError::NoForm { node: 1 })
    ));
    assert!(matches!(
        form_of_densities(&scene, &[5.0]),
        Err(StaticsError::WrongNumberOfDensities {
            found: 1,
            springs: 2
        })
    ));
}
