//! What equilibria are found, and what is said of them.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use springs_scene::generate::{Material, block, cloth};
use springs_scene::{Guide, Load, Node, OverTime, Scene, Spring, SpringLaw};
use springs_statics::{Equilibrium, Options, StaticsError, Status, settle};

fn settled(scene: &Scene) -> Equilibrium {
    let equilibrium = settle(scene, &Options::default()).unwrap();
    // Rounding of coordinates of 10 m at 1e4 N/m is 1e-11 N.
    assert!(equilibrium.residual <= 1e-10 * equilibrium.largest_force.max(1.0));
    equilibrium
}

fn spring(a: usize, b: usize, stiffness: f64, rest_length: f64) -> Spring {
    Spring {
        mass: 0.1,
        ..Spring::between(a, b, stiffness, rest_length)
    }
}

/// A chain along a direction, its first node fixed.
fn chain(n: usize, direction: Vector3<f64>, gravity: f64) -> Scene {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -gravity),
        ..Scene::default()
    };
    for k in 0..=n {
        let at = direction * k as f64;
        scene.add_node(if k == 0 {
            Node::fixed(at)
        } else {
            Node::at(at)
        });
        if k > 0 {
            scene.springs.push(spring(k - 1, k, 1e4, direction.norm()));
        }
    }
    scene
}

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -1.0);

struct Random(u64);

impl Random {
    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 33) as f64 / 2f64.powi(31) - 0.5
        })
    }
}

#[test]
fn a_chain_is_stable_under_its_weight_and_a_mechanism_without() {
    let hanging = settled(&chain(12, DOWN, 9.81));
    assert_eq!(hanging.status, Status::Stable);
    // Half of each spring hangs on its upper node.
    let mut weight = 0.0;
    for (k, tension) in hanging.tensions.iter().enumerate().rev() {
        weight += 0.1 * 9.81 * if k == 11 { 0.5 } else { 1.0 };
        // Residuals of a part 1e-10 of the largest tension add up.
        assert!((tension - weight).abs() < 12.0 * 1e-10 * 12.0);
    }
    let top = hanging.reactions[0].force;
    assert!((top.z / (12.0 * 0.1 * 9.81) - 1.0).abs() < 1e-10);

    for direction in [DOWN, Vector3::new(0.36, 0.48, 0.8)] {
        let loose = settled(&chain(12, direction, 0.0));
        assert!(matches!(loose.status, Status::Mechanism { .. }));
        assert_eq!((loose.zero_pivots, loose.negative_pivots), (24, 0));
        assert_eq!(loose.iterations, 0);
    }
}

#[test]
fn a_chain_that_stands_is_unstable_in_every_direction() {
    // Longer by its own weight exactly: the start is its equilibrium.
    let mut scene = chain(3, -DOWN, 9.81);
    let tensions = [2.5, 1.5, 0.5].map(|part| -part * 0.1 * 9.81);
    for (spring, tension) in scene.springs.iter_mut().zip(tensions) {
        spring.rest_length = 1.0 - tension / spring.stiffness;
    }
    let standing = settled(&scene);
    assert!(
        matches!(standing.status, Status::Unstable { .. }),
        "{standing:?}"
    );
    assert_eq!((standing.negative_pivots, standing.zero_pivots), (6, 0));

    // From a start that is none, it falls over and hangs.
    let hanging = settled(&chain(3, -DOWN, 9.81));
    assert_eq!(hanging.status, Status::Stable);
    assert!(hanging.positions[3].z < -2.9);
}

#[test]
fn a_column_pressed_along_its_axis_buckles() {
    let mut scene = chain(10, Vector3::x(), 0.0);
    // Stiff against bending by springs over two links.
    for k in 2..=10 {
        scene.springs.push(spring(k - 2, k, 1e4, 2.0));
    }
    scene.nodes[10].fixed = true;
    scene
        .nodes
        .iter_mut()
        .for_each(|node| node.position.x *= 0.8);
    let buckled = settled(&scene);
    assert!(!matches!(buckled.status, Status::Unstable { .. }));
    let sideways = buckled.positions[5];
    assert!(sideways.y.hypot(sideways.z) > 0.1, "{sideways:?}");
}

#[test]
fn cloths_and_blocks_come_to_rest_from_bad_starts() {
    let mut random = Random(7);
    let mut scenes = vec![
        cloth(12, Material::of_cloth()),
        block(5, Material::of_block()),
    ];
    for scene in &mut scenes {
        let calm = settled(scene);
        assert_eq!(calm.status, Status::Stable);
        let size = scene.size();
        for k in 0..scene.nodes.len() {
            if !scene.nodes[k].fixed {
                scene.nodes[k].position += random.vector() * size;
            }
        }
        let other = settled(scene);
        assert_eq!(other.status, Status::Stable);
        assert!(calm.iterations < 100 && other.iterations < 300);
    }
}

#[test]
fn cables_come_to_rest_from_bad_starts() {
    let mut random = Random(3);
    for stiffness in [1e3, 1e6, 1e9] {
        let mut scene = chain(40, Vector3::x() * 0.25, 9.81);
        scene
            .springs
            .iter_mut()
            .for_each(|spring| spring.stiffness = stiffness);
        scene.nodes[40].fixed = true;
        scene.nodes[40].position = Vector3::new(6.0, 0.0, 1.0);
        let mut lowest = Vec::new();
        for spread in [0.0, 1.0, 10.0] {
            let mut start = scene.clone();
            for node in start.nodes.iter_mut().filter(|node| !node.fixed) {
                node.position += random.vector() * spread;
            }
            let equilibrium = settle(&start, &Options::default()).unwrap();
            assert!(equilibrium.iterations < 100);
            assert_eq!(equilibrium.status, Status::Stable);
            let z = equilibrium.positions.iter().map(|x| x.z);
            lowest.push(z.fold(0.0, f64::min));
        }
        assert!((lowest[0] - lowest[1]).abs() < 1e-8, "{lowest:?}");
        assert!((lowest[0] - lowest[2]).abs() < 1e-8, "{lowest:?}");
    }
}

#[test]
fn nothing_that_falls_is_called_an_equilibrium() {
    let mut scene = chain(3, DOWN, 9.81);
    scene.nodes[0].fixed = false;
    let error = settle(&scene, &Options::default()).unwrap_err();
    assert!(matches!(error, StaticsError::CarriedOff { .. }), "{error}");

    // Without weight it may be anywhere: six rigid motions and those of the hinges.
    scene.gravity = Vector3::zeros();
    let free = settled(&scene);
    assert!(matches!(free.status, Status::Mechanism { .. }));
    assert_eq!(free.zero_pivots, 12 - 3);
}

#[test]
fn what_guides_hold_is_no_pivot() {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    };
    scene.add_node(Node::fixed(Vector3::zeros()));
    let slider = scene.add_node(Node {
        guide: Some(Guide::Along(Vector3::new(1.0, 0.0, 1.0))),
        mass: 1.0,
        ..Node::at(Vector3::new(1.0, 0.0, 1.0))
    });
    let held = scene.add_node(Node {
        guide: Some(Guide::Held([true, true, false])),
        mass: 2.0,
        ..Node::at(Vector3::new(1.0, 0.5, 0.0))
    });
    scene.springs.push(spring(0, slider, 100.0, 1.5));
    scene.springs.push(spring(slider, held, 200.0, 1.0));
    let equilibrium = settled(&scene);
    assert_eq!(equilibrium.status, Status::Stable);
    let at = equilibrium.positions[slider];
    assert!((at.x - at.z).abs() < 1e-12 && at.y == 0.0);
    let (x, y) = (equilibrium.positions[held].x, equilibrium.positions[held].y);
    assert_eq!((x, y), (1.0, 0.5));
    // Supports carry the weight between them: nodes, and half of each spring.
    let sum: Vector3<f64> = equilibrium.reactions.iter().map(|one| one.force).sum();
    assert!((sum.z / (3.2 * 9.81) - 1.0).abs() < 1e-9, "{sum:?}");
    assert!(sum.x.abs() < 1e-9 && sum.y.abs() < 1e-9);

    // With nothing that holds it along its guide it is a mechanism of one motion.
    let mut loose = Scene::default();
    loose.add_node(Node::fixed(Vector3::zeros()));
    let along = Vector3::new(0.0, 3.0, 4.0);
    loose.add_node(Node {
        guide: Some(Guide::Along(along)),
        ..Node::at(Vector3::x())
    });
    loose.springs.push(spring(0, 1, 1e3, 1.0));
    let equilibrium = settled(&loose);
    assert_eq!(equilibrium.status, Status::Mechanism { nodes: vec![1] });
    assert_eq!(equilibrium.zero_pivots, 1);
}

#[test]
fn loads_are_those_of_time_zero_and_damping_does_nothing() {
    let mut scene = chain(1, DOWN, 0.0);
    scene.springs[0].damping = 5.0;
    scene.drag = 3.0;
    scene.loads = vec![Load {
        name: String::new(),
        nodes: vec![1],
        force: DOWN * 10.0,
        over_time: OverTime::Table(vec![[0.0, 0.5], [1.0, 7.0]]),
    }];
    let equilibrium = settled(&scene);
    assert!((equilibrium.tensions[0] - 5.0).abs() < 1e-9);
    assert_eq!(equilibrium.status, Status::Stable);
}

/// Random networks, some of their nodes guided or massless, from random starts: what is said
/// of an equilibrium is what dense algebra says.
#[test]
fn random_networks_are_judged_as_dense_algebra_judges_them() {
    let (mut statuses, mut lost) = ([0; 3], 0);
    for seed in 0..300 {
        let mut random = Random(seed);
        let mut unit = move || random.vector().x + 0.5;
        let mut scene = Scene {
            gravity: Vector3::new(0.0, 0.0, if unit() < 0.7 { -9.81 } else { 0.0 }),
            ..Scene::default()
        };
        let n = 3 + (unit() * 8.0) as usize;
        for _ in 0..n {
            let at = Vector3::new(unit(), unit(), unit()) * 3.0;
            let guide = match unit() {
                x if x < 0.1 => Some(Guide::Along(Vector3::new(unit(), unit(), 1.0))),
                x if x < 0.2 => Some(Guide::Held([true, false, unit() < 0.5])),
                _ => None,
            };
            let is_fixed = unit() < 0.25;
            scene.add_node(Node {
                fixed: is_fixed,
                guide: guide.filter(|_| !is_fixed),
                mass: if unit() < 0.8 { unit() } else { 0.0 },
                ..Node::at(at)
            });
        }
        for b in 1..n {
            // Everything hangs together, and some more.
            scene
                .springs
                .push(spring((unit() * b as f64) as usize, b, 1e3, unit()));
            let a = (unit() * n as f64) as usize;
            if unit() < 0.6 && a != b {
                let stiffness = 10f64.powf(2.0 + 4.0 * unit());
                scene.springs.push(spring(a, b, stiffness, 2.0 * unit()));
            }
        }
        let equilibrium = match settle(&scene, &Options::default()) {
            Ok(equilibrium) => equilibrium,
            Err(StaticsError::CarriedOff { .. }) => {
                lost += 1;
                assert!(!scene.nodes.iter().any(|node| node.fixed), "{seed}");
                continue;
            }
            Err(error) => panic!("{seed}: {error}"),
        };
        assert!(equilibrium.residual <= 1e-10 * equilibrium.largest_force.max(100.0));
        let (negative, zero) = dense_inertia(&scene, &equilibrium);
        let pivots = (equilibrium.negative_pivots, equilibrium.zero_pivots);
        assert_eq!(pivots, (negative, zero), "{seed}");
        statuses[match equilibrium.status {
            Status::Stable => 0,
            Status::Unstable { .. } => 1,
            Status::Mechanism { .. } => 2,
        }] += 1;
    }
    // Nothing that is fixed is carried off, and no symmetry leads to unstable ones.
    assert!(
        statuses[0] > 100 && statuses[2] > 50 && lost > 10,
        "{statuses:?}"
    );
    assert_eq!(statuses[1], 0);
}

/// Negative and zero eigenvalues of the stiffness on what guides let free.
fn dense_inertia(scene: &Scene, equilibrium: &Equilibrium) -> (usize, usize) {
    let mut there = scene.clone();
    equilibrium.write_to(&mut there);
    let n = there.nodes.len();
    let mut whole = DMatrix::zeros(3 * n, 3 * n);
    for spring in &there.springs {
        let [a, b] = spring.nodes;
        let d = there.nodes[b].position - there.nodes[a].position;
        let l = d.norm();
        let along = d * d.transpose() / (l * l);
        let across = Matrix3::identity() - along;
        let block = (along + across * (1.0 - spring.rest_length / l)) * spring.stiffness;
        for (i, j, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            let mut part = whole.fixed_view_mut::<3, 3>(3 * i, 3 * j);
            part += block * sign;
        }
    }
    // A basis of what may move.
    let mut columns = Vec::new();
    for (k, node) in there
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, node)| !node.fixed)
    {
        let mut add = |direction: Vector3<f64>| {
            let mut column = DVector::zeros(3 * n);
            column.fixed_rows_mut::<3>(3 * k).copy_from(&direction);
            columns.push(column);
        };
        match node.guide {
            None => (0..3).for_each(|axis| add(Vector3::ith(axis, 1.0))),
            Some(Guide::Along(direction)) => add(direction.normalize()),
            Some(Guide::Held(held)) => {
                let free = (0..3).filter(|&axis| !held[axis]);
                free.for_each(|axis| add(Vector3::ith(axis, 1.0)));
            }
        }
    }
    if columns.is_empty() {
        return (0, 0);
    }
    let basis = DMatrix::from_columns(&columns);
    let eigenvalues = (basis.transpose() * whole * &basis).symmetric_eigenvalues();
    let limit = 1e-9 * eigenvalues.amax();
    let below = eigenvalues.iter().filter(|value| **value < -limit);
    let zero = eigenvalues.iter().filter(|value| value.abs() <= limit);
    (below.count(), zero.count())
}

#[test]
fn nothing_free_is_stable() {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    let equilibrium = settled(&scene);
    assert_eq!(equilibrium.status, Status::Stable);
    assert_eq!(settled(&Scene::default()).status, Status::Stable);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let scene = cloth(20, Material::of_cloth());
    let of = |threads| settle(&scene, &Options::default().with_threads(threads)).unwrap();
    assert_eq!(of(1), of(4));
}

/// A weight on two cables that cannot push: one is too long, and a massless node is loose on
/// it.
#[test]
fn slack_cables_carry_nothing_and_are_mechanisms() {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -10.0),
        laws: vec![SpringLaw::TensionOnly { blend: 1e-3 }],
        ..Scene::default()
    };
    for x in [0.0, 1.0] {
        scene.add_node(Node::fixed(Vector3::x() * x));
    }
    scene.add_node(Node {
        mass: 3.0,
        ..Node::at(Vector3::new(0.7, 0.0, 0.6))
    });
    let between = scene.add_node(Node::at(Vector3::new(0.9, 0.1, -0.2)));
    for (a, b, rest_length) in [(0, 2, 1.0), (2, between, 0.9), (between, 1, 0.9)] {
        scene.springs.push(Spring {
            mass: 0.0,
            law: Some(0),
            ..spring(a, b, 1e5, rest_length)
        });
    }
    let equilibrium = settle(&scene, &Options::default()).unwrap();
    let weight = equilibrium.positions[2];
    assert!(
        (weight - Vector3::new(0.0, 0.0, -1.0003)).norm() < 1e-3,
        "{weight:?}"
    );
    assert!((equilibrium.tensions[0] / 30.0 - 1.0).abs() < 1e-9);
    assert!(
        equilibrium.tensions[1..]
            .iter()
            .all(|tension| tension.abs() < 1e-6)
    );
    assert_eq!(
        equilibrium.status,
        Status::Mechanism {
            nodes: vec![between]
        }
    );
    // Along cables that are about to pull it may have some stiffness.
    assert!(equilibrium.zero_pivots >= 2 && equilibrium.negative_pivots == 0);
}

/// Springs that only pull, slack at the start: lines longer than the distance of their
/// ends, and flat nets.
#[test]
fn slack_springs_that_only_pull_become_taut() {
    for rest_length in [0.9, 1.0, 1.02, 1.1, 1.3] {
        for n_lines in [1, 6] {
            let mut scene = Scene {
                gravity: Vector3::new(0.0, 0.0, -9.81),
                laws: vec![SpringLaw::TensionOnly { blend: 1e-6 }],
                ..Scene::default()
            };
            let n = 8;
            for line in 0..n_lines {
                for k in 0..n {
                    let at = Vector3::new(k as f64, line as f64, 0.0);
                    let is_edge = k == 0 || k + 1 == n;
                    let node = scene.add_node(Node {
                        mass: 1.0,
                        fixed: is_edge,
                        ..Node::at(at)
                    });
                    let behind = (k > 0).then(|| node - 1);
                    let beside = (line > 0).then(|| node.wrapping_sub(n));
                    for other in behind.into_iter().chain(beside) {
                        scene.springs.push(Spring {
                            law: Some(0),
                            mass: 0.0,
                            ..spring(other, node, 1e5, rest_length)
                        });
                    }
                }
            }
            let equilibrium = settled(&scene);
            assert_eq!(
                equilibrium.status,
                Status::Stable,
                "{rest_length}, {n_lines}"
            );
            let carried: f64 = equilibrium.reactions.iter().map(|one| one.force.z).sum();
            let weight = 9.81 * scene.node_masses().iter().sum::<f64>();
            assert!(
                (carried - weight).abs() < 1e-6 * weight,
                "{carried}, not {weight} N"
            );
            assert!(equilibrium.tensions.iter().all(|tension| *tension >= 0.0));
        }
    }
}

/// What `settle` finds is what its system does; only the weight of fixed nodes is added.
#[test]
fn a_system_settles_as_its_scene_does() {
    let scene = chain(5, DOWN, 9.81);
    let of_scene = settled(&scene);
    let system = springs_assembly::compile(&scene).unwrap();
    let of_system = springs_statics::settle_system(&system, &Options::default()).unwrap();
    assert_eq!(of_system.positions, of_scene.positions);
    assert_eq!(of_system.tensions, of_scene.tensions);
    let weight = 9.81 * scene.node_masses()[0];
    let [on_system, on_scene] = [&of_system, &of_scene].map(|one| one.reactions[0].force.z);
    assert!(
        (on_scene - on_system - weight).abs() < 1e-12,
        "{on_scene}, {on_system}"
    );
    // Hung up at its equilibrium, it is there already.
    let mut hung = scene.clone();
    of_scene.write_to(&mut hung);
    assert!(settled(&hung).was_balanced && !of_scene.was_balanced);
}
