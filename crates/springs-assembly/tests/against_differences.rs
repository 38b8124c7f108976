//! Global forces and matrices against differences of energy and force, and the
//! bookkeeping of free, fixed and moving nodes against a system without any.

use nalgebra::{DMatrix, DVector, Vector3};
use springs_assembly::{
    Compilation, Evaluation, Linearization, Motion, OwnStiffness, Projection, System, Weights,
    compile, compile_with,
};
use springs_scene::generate::{Material, block, chain, cloth, disturb};
use springs_scene::{Node, Scene};

/// Scenes with dashpots, duplicate springs, fixed and moving nodes.
fn scenes() -> Vec<Scene> {
    let mut scenes = Vec::new();
    for mut scene in [
        chain(1, Material::of_chain(1)),
        chain(11, Material::of_chain(11)),
        cloth(5, Material::of_cloth()),
        block(3, Material::of_block()),
    ] {
        disturb(&mut scene, 0.05, 4);
        let last = scene.nodes.len() - 1;
        scene.add_node(Node {
            velocity: Vector3::new(1.0, -2.0, 0.5),
            ..Node::fixed(Vector3::new(1.5, 0.2, 0.3))
        });
        scene.add_spring(last, last + 1, 700.0);
        // Twice, the other way round, and between fixed nodes.
        scene.add_spring(last + 1, last, 300.0);
        scene.add_spring(0, last + 1, 100.0);
        for (index, spring) in scene.springs.iter_mut().enumerate() {
            spring.rest_length *= 0.8 + 0.05 * (index % 7) as f64;
            spring.damping = if index % 3 == 0 {
                0.0
            } else {
                0.1 * index as f64
            };
        }
        for (index, node) in scene.nodes.iter_mut().enumerate() {
            if !node.fixed {
                node.velocity = Vector3::new(0.1 * index as f64, -0.3, 0.02 * index as f64);
            }
        }
        scenes.push(scene);
    }
    scenes
}

fn linearize(system: &System, projection: Projection, weights: Weights) -> Linearization {
    let mut out = system.linearization();
    let (x, v) = (system.initial_positions(), system.initial_velocities());
    let at = Evaluation {
        projection,
        ..Evaluation::new(x, v, weights)
    };
    system.linearize(&at, &mut out);
    out
}

fn dense(at: &Linearization) -> DMatrix<f64> {
    let n = 3 * at.forces.len();
    let mut dense = DMatrix::zeros(n, n);
    for (row, column, value) in at.matrix.triplets() {
        dense[(row, column)] += value;
    }
    dense
}

fn flat(vectors: &[Vector3<f64>]) -> DVector<f64> {
    DVector::from_iterator(3 * vectors.len(), vectors.iter().flatten().copied())
}

/// Central difference of `f` at scalar `row` of the free blocks.
fn difference<T>(x: &[Vector3<f64>], row: usize, step: f64, f: impl Fn(&[Vector3<f64>]) -> T) -> T
where
    T: std::ops::Sub<Output = T> + std::ops::Div<f64, Output = T>,
{
    let moved = |by: f64| {
        let mut x = x.to_vec();
        x[row / 3][row % 3] += by;
        f(&x)
    };
    (moved(step) - moved(-step)) / (2.0 * step)
}

#[test]
fn forces_are_minus_the_slope_of_the_energy() {
    for scene in scenes() {
        let system = compile(&scene).unwrap();
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let forces = flat(&linearize(&system, Projection::None, Weights::STIFFNESS).forces);
        for row in 0..3 * system.n_free() {
            let slope = difference(x, row, 1e-6, |x| {
                let energy = system.energy(x, v);
                energy.elastic() + energy.gravity()
            });
            assert!(
                (forces[row] + slope).abs() < 1e-5 * forces.amax(),
                "{}",
                scene.name
            );
        }
    }
}

#[test]
fn the_matrix_is_minus_the_slope_of_the_forces() {
    for scene in scenes() {
        let system = compile(&scene).unwrap();
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let forces = |x: &[Vector3<f64>], v: &[Vector3<f64>]| {
            let mut forces = vec![Vector3::zeros(); system.n_free()];
            system.forces(0.0, x, v, &mut forces);
            flat(&forces)
        };
        let at_rest = vec![Vector3::zeros(); x.len()];
        let stiffness = dense(&linearize(&system, Projection::None, Weights::STIFFNESS));
        let only_damping = Weights {
            mass: 0.0,
            damping: 1.0,
            stiffness: 0.0,
        };
        let damping = dense(&linearize(&system, Projection::None, only_damping));
        for row in 0..3 * system.n_free() {
            let column = difference(x, row, 1e-6, |x| forces(x, &at_rest));
            let error = (stiffness.column(row) + column).amax() / stiffness.amax();
            assert!(error < 1e-8, "{}, H: {error:e}", scene.name);
            // Dashpot forces are linear in velocity.
            let column = difference(v, row, 1.0, |v| forces(x, v));
            let error = (damping.column(row) + column).amax();
            assert!(
                error < 1e-9 * (1.0 + stiffness.amax()),
                "{}, D: {error:e}",
                scene.name
            );
        }
    }
}

/// Scenes in a plane, on a line and with zero rest lengths, with springs of one and of
/// several rest lengths between the same nodes: what methods may leave out of their
/// systems there is in the matrix.
#[test]
fn nothing_is_left_out_of_the_matrix() {
    let mut scenes = Vec::new();
    for mut scene in [
        chain(7, Material::of_chain(7)),
        cloth(4, Material::of_cloth()),
    ] {
        scene.gravity.fill(0.0);
        for node in &mut scene.nodes {
            node.position *= 1.02;
        }
        let spring = scene.springs[1];
        for factor in [1.0, 0.5, 1.3] {
            let [a, b] = spring.nodes;
            let other = scene.add_spring(b, a, 200.0);
            scene.springs[other].rest_length = factor * spring.rest_length;
        }
        let mut net = scene.clone();
        net.springs
            .iter_mut()
            .for_each(|spring| spring.rest_length = 0.0);
        scenes.extend([scene, net]);
    }
    for scene in scenes {
        let system = compile(&scene).unwrap();
        assert!(system.n_merged() > 0);
        assert_ne!(system.motion(), Motion::Space);
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let stiffness = dense(&linearize(&system, Projection::None, Weights::STIFFNESS));
        let forces = |x: &[Vector3<f64>]| {
            let mut forces = vec![Vector3::zeros(); system.n_free()];
            system.forces(0.0, x, v, &mut forces);
            flat(&forces)
        };
        for row in 0..3 * system.n_free() {
            let column = difference(x, row, 1e-6, forces);
            let error = (stiffness.column(row) + column).amax() / stiffness.amax();
            assert!(error < 1e-8, "{}, {row}: {error:e}", scene.name);
        }
        // Every projection gives what it gives with each spring by itself.
        let each = compile_with(&scene, Compilation::complete()).unwrap();
        for projection in [
            Projection::None,
            Projection::Clamp,
            Projection::Absolute,
            Projection::Drop,
        ] {
            let merged = dense(&linearize(&system, projection, Weights::STIFFNESS));
            let reference = dense(&linearize(&each, projection, Weights::STIFFNESS));
            let error = (merged - &reference).amax() / reference.amax();
            assert!(error < 1e-14, "{}, {projection:?}: {error:e}", scene.name);
        }
    }
}

/// Fixing nodes takes their rows and columns out of the matrix of the same
/// scene with all nodes free, and moving anchors multiply theirs.
#[test]
fn fixed_nodes_are_partitioned_out() {
    let weights = Weights {
        mass: 2.0,
        damping: 0.1,
        stiffness: 0.01,
    };
    for scene in scenes() {
        let system = compile(&scene).unwrap();
        let mut all_free = scene.clone();
        all_free
            .nodes
            .iter_mut()
            .for_each(|node| node.fixed = false);
        let whole = compile(&all_free).unwrap();
        for projection in [
            Projection::None,
            Projection::Clamp,
            Projection::Absolute,
            Projection::Drop,
        ] {
            let at = linearize(&system, projection, weights);
            let reference = linearize(&whole, projection, weights);
            let matrix = dense(&reference);
            let scalars = |fixed: bool| -> Vec<usize> {
                let nodes = (0..scene.nodes.len()).filter(|&node| scene.nodes[node].fixed == fixed);
                nodes.flat_map(|node| 3 * node..3 * node + 3).collect()
            };
            let (free, fixed) = (scalars(false), scalars(true));
            let rows = matrix.select_rows(&free);
            let scale = matrix.amax();
            let error = (dense(&at) - rows.select_columns(&free)).amax();
            assert!(error < 1e-14 * scale, "{}: {error:e}", scene.name);
            let velocities = flat(whole.initial_velocities()).select_rows(&fixed);
            let load = -(rows.select_columns(&fixed) * velocities);
            let error = (flat(&at.anchor_load) - load).amax();
            assert!(error < 1e-13 * scale, "{}: {error:e}", scene.name);
            let forces = flat(&reference.forces).select_rows(&free);
            assert!((flat(&at.forces) - &forces).amax() < 1e-14 * forces.amax().max(scale));
        }
    }
}

#[test]
fn spring_forces_sum_to_zero_without_fixed_nodes() {
    for mut scene in scenes() {
        scene.nodes.iter_mut().for_each(|node| node.fixed = false);
        let system = compile(&scene).unwrap();
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let mut forces = vec![Vector3::zeros(); system.n_free()];
        for emitter in system
            .emitters()
            .filter(|emitter| emitter.name() != "gravity")
        {
            emitter.add_forces(x, &mut forces);
            emitter.add_damping_forces(x, v, &mut forces);
        }
        let largest = forces.iter().map(|f| f.norm()).fold(0.0, f64::max);
        let sum: Vector3<f64> = forces.iter().sum();
        assert!(sum.norm() < 1e-13 * largest * forces.len() as f64);
    }
}

/// Forces alone and forces of the fused pass differ by those of the dashpots.
#[test]
fn the_fused_pass_has_the_forces_that_do_not_depend_on_velocities() {
    for scene in scenes() {
        let system = compile(&scene).unwrap();
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let fused = linearize(&system, Projection::None, Weights::of_step(0.01));
        let mut forces = vec![Vector3::zeros(); system.n_free()];
        system.forces(0.0, x, v, &mut forces);
        let mut dashpots = vec![Vector3::zeros(); system.n_free()];
        system.add_damping_forces(x, v, &mut dashpots);
        for ((all, dashpots), fused) in forces.iter().zip(&dashpots).zip(&fused.forces) {
            assert!((all - dashpots - fused).norm() < 1e-12 * (1.0 + all.norm()));
        }
    }
}

/// Term by term, a product is that of the assembled matrix; and uniform motion
/// of what nothing holds gives its momentum, to the last bit.
#[test]
fn products_term_by_term_are_those_of_the_matrix() {
    let projections = [
        Projection::None,
        Projection::Clamp,
        Projection::Absolute,
        Projection::Drop,
    ];
    for scene in scenes() {
        let system = compile(&scene).unwrap();
        let n_free = system.n_free();
        let tensions: Vec<f64> = (0..system.n_carried()).map(|k| (k as f64).sin()).collect();
        let y: Vec<Vector3<f64>> = (0..n_free)
            .map(|k| Vector3::new((k as f64).cos(), 1.0, -0.1 * k as f64))
            .collect();
        for (projection, carried) in projections
            .iter()
            .flat_map(|&projection| [(projection, None), (projection, Some(&*tensions))])
        {
            let (x, v) = (system.initial_positions(), system.initial_velocities());
            let at = Evaluation {
                projection,
                carried,
                velocity_stiffness: true,
                ..Evaluation::new(x, v, Weights::of_step(0.1))
            };
            let mut out = system.linearization();
            system.linearize(&at, &mut out);
            let (mut expected, mut product) = (y.clone(), y.clone());
            out.matrix.multiply(&y, &mut expected);
            system.product(&at, &y, &mut product);
            let off = (flat(&product) - flat(&expected)).amax();
            assert!(
                off < 1e-12 * flat(&expected).amax(),
                "{projection:?}: {off:e}"
            );
        }
    }

    let mut free = scenes().swap_remove(2);
    for node in &mut free.nodes {
        node.fixed = false;
    }
    for spring in &mut free.springs {
        spring.stiffness *= 1e12;
    }
    let system = compile(&free).unwrap();
    let (x, v) = (system.initial_positions(), system.initial_velocities());
    let at = Evaluation::new(x, v, Weights::of_step(0.1));
    let uniform = vec![Vector3::new(1.0, -2.0, 0.5); system.n_free()];
    let mut product = uniform.clone();
    system.product(&at, &uniform, &mut product);
    for ((p, v), m) in product.iter().zip(&uniform).zip(system.masses()) {
        assert_eq!(*p, v * *m);
    }
}

#[test]
fn tensions_and_compression_follow_the_springs() {
    let mut scene = chain(9, Material::of_chain(9));
    for spring in &mut scene.springs[..4] {
        spring.rest_length *= 1.5;
    }
    let system = compile(&scene).unwrap();
    let (x, v) = (system.initial_positions(), system.initial_velocities());
    let mut tensions = vec![0.0; system.n_carried()];
    system.carried(x, &mut tensions);
    let expected = scene.springs.iter();
    let expected = expected.map(|spring| spring.stiffness * (1.0 / 9.0 - spring.rest_length));
    let mut expected: Vec<f64> = expected.collect();
    let mut sorted = tensions.clone();
    sorted.sort_by(f64::total_cmp);
    expected.sort_by(f64::total_cmp);
    for (tension, expected) in sorted.iter().zip(&expected) {
        assert!((tension - expected).abs() < 1e-9);
    }
    let clamped = Evaluation {
        projection: Projection::Clamp,
        ..Evaluation::new(x, v, Weights::STIFFNESS)
    };
    assert_eq!(system.count_projected(&clamped), 4);
    tensions.fill(-1.0);
    let carried = Evaluation {
        carried: Some(&tensions),
        ..clamped
    };
    assert_eq!(system.count_projected(&carried), 9);
    let nowhere = vec![false; system.n_free()];
    let elsewhere = Evaluation {
        projected: Some(&nowhere),
        ..carried
    };
    assert_eq!(system.count_projected(&elsewhere), 0);

    // Along the springs the prediction is exact.
    let v: Vec<_> = x.iter().map(|x| x * 0.1).collect();
    let h = 0.5;
    system.predict_carried(x, &v, h, &mut tensions);
    let moved: Vec<_> = x.iter().zip(&v).map(|(x, v)| x + v * h).collect();
    let mut expected = vec![0.0; system.n_carried()];
    system.carried(&moved, &mut expected);
    for (predicted, expected) in tensions.iter().zip(&expected) {
        assert!((predicted - expected).abs() < 1e-9);
    }
}

#[test]
fn bounds_are_those_of_the_stiffest_node() {
    let mut scene = chain(2, Material::of_chain(2));
    scene.springs[1].damping = 3.0;
    let system = compile(&scene).unwrap();
    // The free end has ¼ kg and one spring of 2e4 N/m, the middle ½ kg and two.
    assert!((system.frequency_bound() - (2.0 * 4e4 / 0.5f64).sqrt()).abs() < 1e-9);
    assert!((system.damping_rate_bound() - 2.0 * 3.0 / 0.25).abs() < 1e-12);
}

/// What is given against a move of one block is the diagonal of the matrix.
#[test]
fn own_stiffness_is_the_diagonal_of_the_matrix() {
    for scene in scenes() {
        let system = compile(&scene).unwrap();
        let x = system.initial_positions();
        let tensions: Vec<f64> = (0..system.n_carried())
            .map(|index| 3.0 * (1.7 * index as f64).sin())
            .collect();
        let mut own = vec![OwnStiffness::default(); system.n_free()];
        system.own_stiffness(x, &tensions, &mut own);
        for (is_across, carried) in [
            (false, vec![0.0; tensions.len()]),
            (true, tensions.iter().map(|t| t.max(0.0)).collect()),
        ] {
            let at = Evaluation {
                carried: Some(&carried),
                ..Evaluation::new(x, system.initial_velocities(), Weights::STIFFNESS)
            };
            let mut out = system.linearization();
            system.linearize(&at, &mut out);
            for (own, diagonal) in own.iter().zip(out.matrix.diagonal()) {
                let across = f64::from(u8::from(is_across));
                let largest = diagonal.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
                for (entry, expected) in diagonal.iter().enumerate() {
                    let off = own.along[entry] + across * own.across[entry] - expected;
                    assert!(off.abs() < 1e-12 * largest, "{own:?} {diagonal:?}");
                }
            }
        }
    }
}

/// Of one spring, along itself, with its tension carried; fixed ends get theirs, too.
#[test]
fn turning_forces_are_minus_the_slope_of_the_hessian_times_the_velocities() {
    for fixed in [false, true] {
        let mut scene = Scene::default();
        let (d, v) = (Vector3::new(0.3, -0.5, 0.8), Vector3::new(1.1, 0.7, -0.4));
        for (position, velocity, fixed) in [(Vector3::zeros(), v * 0.2, false), (d, v, fixed)] {
            scene.add_node(Node {
                mass: 1.0,
                velocity,
                fixed,
                ..Node::at(position)
            });
        }
        scene.add_spring(0, 1, 40.0);
        let system = compile(&scene).unwrap();
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let tensions = [3.0];
        // Of the whole Hessian: fixed ends move, too.
        let product = |time: f64| {
            let moved: Vec<_> = x.iter().zip(v).map(|(x, v)| x + v * time).collect();
            let d = moved[1] - moved[0];
            let (length, u) = (d.norm(), d.normalize());
            let speed = v[1] - v[0];
            let along = u * u.dot(&speed);
            -(along * 40.0 + (speed - along) * (tensions[0] / length))
        };
        let step = 1e-5;
        let slope = (product(step) - product(-step)) / (2.0 * step);
        let u = (x[1] - x[0]).normalize();
        let mut forces = vec![Vector3::repeat(7.0); 2];
        system.turning_forces(x, v, &tensions, 0.3, &mut forces);
        // −H v on the first end is what `product` is the opposite of.
        let expected = u * (-0.3 * slope.dot(&u));
        assert!(
            (forces[0] - expected).norm() < 1e-8,
            "{forces:?} {expected}"
        );
        assert_eq!(forces[1], -forces[0]);
    }
}
