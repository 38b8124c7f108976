//! Equilibria, paths and modes against published figures and closed forms.

use nalgebra::Vector3;
use springs_scene::{Load, Node, OverTime, Scene, Spring};
use springs_statics::{
    Equilibrium, Options, PathEnd, Status, form_of_densities, modes, settle, trace,
};
use std::f64::consts::PI;

fn stable(scene: &Scene) -> Equilibrium {
    let equilibrium = settle(scene, &Options::default()).unwrap();
    assert_eq!(equilibrium.status, Status::Stable);
    equilibrium
}

fn load(node: usize, force: Vector3<f64>) -> Load {
    Load {
        name: String::new(),
        nodes: vec![node],
        force,
        over_time: OverTime::Constant,
    }
}

struct Cable {
    /// Of its upper end from the lower one, in m.
    x: f64,
    z: f64,
    length: f64,
    axial_stiffness: f64,
    /// In N/m.
    weight: f64,
}

/// A cable of equal segments, on the straight line between its ends.
fn cable(cable: &Cable, segments: usize) -> Scene {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    };
    let l = cable.length / segments as f64;
    for k in 0..=segments {
        let part = k as f64 / segments as f64;
        let at = Vector3::new(cable.x * part, 0.0, cable.z * part);
        let is_end = k == 0 || k == segments;
        scene.add_node(if is_end {
            Node::fixed(at)
        } else {
            Node::at(at)
        });
    }
    for k in 0..segments {
        scene.springs.push(Spring {
            mass: cable.weight * l / 9.81,
            ..Spring::between(k, k + 1, cable.axial_stiffness / l, l)
        });
    }
    scene
}

/// H at the lower end, and V at both.
fn ends(cable_: &Cable, segments: usize) -> [f64; 3] {
    let equilibrium = stable(&cable(cable_, segments));
    let reaction = |k: usize| equilibrium.reactions[k].force;
    // What holds the ends pulls against the cable: it pulls the lower end up and inward.
    [-reaction(0).x, -reaction(0).z, reaction(1).z]
}

/// Catenary of MoorPy, tests/test_catenary.py (`indata` 1 and 2, National Renewable Energy
/// Laboratory): fAH, fAV, fBV there are H, V at the lower end, −V at the upper end.
#[test]
fn elastic_catenaries_have_the_forces_of_moorpy() {
    let cases = [
        (
            Cable {
                x: 89.9,
                z: 59.2,
                length: 130.0,
                axial_stiffness: 751e6,
                weight: 881.05,
            },
            [31373.229, -26650.341, 87886.159],
        ),
        (
            Cable {
                x: 400.0,
                z: 200.0,
                length: 500.0,
                axial_stiffness: 7.51e12,
                weight: 200.0,
            },
            [43694.581, -22365.599, 77634.401],
        ),
    ];
    for (cable, expected) in cases {
        let errors = |segments: usize| -> Vec<f64> {
            let found = ends(&cable, segments);
            let pairs = found.iter().zip(expected);
            pairs
                .map(|(found, expected)| found / expected - 1.0)
                .collect()
        };
        let (coarse, fine) = (errors(50), errors(100));
        for (coarse, fine) in coarse.iter().zip(&fine) {
            assert!(fine.abs() < 1e-3, "{fine:e}");
            let order = (coarse / fine).abs().log2();
            assert!((order - 2.0).abs() < 0.1, "{coarse:e} {fine:e}: {order}");
        }
    }
}

/// Jayaraman and Knudson, Computers & Structures 14 (1981): a cable with a load between
/// its ends goes 0.859 m towards the nearer one and 5.626 m down.
#[test]
fn a_cable_with_a_point_load_sags_as_published() {
    const SEGMENTS: [usize; 2] = [40, 60];
    const LENGTHS: [f64; 2] = [125.88, 186.85];
    let axial_stiffness = 131e9 * 548.4e-6;
    let scene_of = |force: f64| {
        let mut scene = Scene {
            gravity: Vector3::new(0.0, 0.0, -9.81),
            ..Scene::default()
        };
        let total = SEGMENTS[0] + SEGMENTS[1];
        for k in 0..=total {
            let x = match k.checked_sub(SEGMENTS[0]) {
                None => 121.92 * k as f64 / SEGMENTS[0] as f64,
                Some(k) => 121.92 + 182.88 * k as f64 / SEGMENTS[1] as f64,
            };
            let at = Vector3::new(x, 0.0, 0.0);
            let is_end = k == 0 || k == total;
            scene.add_node(if is_end {
                Node::fixed(at)
            } else {
                Node::at(at)
            });
        }
        for k in 0..total {
            let part = usize::from(k >= SEGMENTS[0]);
            let l = LENGTHS[part] / SEGMENTS[part] as f64;
            scene.springs.push(Spring {
                mass: 46.12 * l / 9.81,
                ..Spring::between(k, k + 1, axial_stiffness / l, l)
            });
        }
        scene.loads = vec![load(SEGMENTS[0], Vector3::new(0.0, 0.0, -force))];
        scene
    };
    let at = |force: f64| stable(&scene_of(force)).positions[SEGMENTS[0]];
    let moved = at(35.586e3) - at(0.0);
    assert!((moved.x / -0.859 - 1.0).abs() < 5e-3, "{moved:?}");
    assert!((moved.z / -5.626 - 1.0).abs() < 5e-3, "{moved:?}");
}

/// The expanded octahedron (Motro, Tensegrity, 2003): cables and struts are as √6/4, their
/// force densities as −3/2, whatever they are made of.
#[test]
fn the_expanded_octahedron_has_its_ratios() {
    let mut scene = Scene::default();
    // Struts along each axis in pairs, a little off their places.
    for axis in 0..3 {
        for side in [1.0, -1.0] {
            let ends = [1.0, -1.0].map(|end| {
                let mut at = Vector3::zeros();
                at[axis] = 0.47 * end + 0.02 * side;
                at[(axis + 1) % 3] = 0.2 * side + 0.01 * end;
                scene.add_node(Node::at(at))
            });
            scene
                .springs
                .push(Spring::between(ends[0], ends[1], 100.0, 1.05));
        }
    }
    let struts = scene.springs.len();
    // Each end to both ends of the strut that lies on its side of the middle.
    for axis in 0..3 {
        for strut in 0..2 {
            for end in 0..2 {
                let other = 4 * ((axis + 2) % 3) + 2 * end;
                for other_end in 0..2 {
                    let from = 4 * axis + 2 * strut + end;
                    scene
                        .springs
                        .push(Spring::between(from, other + other_end, 10.0, 0.5));
                }
            }
        }
    }
    assert_eq!(scene.springs.len() - struts, 24);
    let equilibrium = settle(&scene, &Options::default()).unwrap();
    let length = |k: usize| {
        let [a, b] = scene.springs[k].nodes;
        (equilibrium.positions[b] - equilibrium.positions[a]).norm()
    };
    let density = |k: usize| equilibrium.tensions[k] / length(k);
    for cable in struts..scene.springs.len() {
        assert!((length(cable) / length(0) - 6f64.sqrt() / 4.0).abs() < 1e-10);
        assert!((density(0) / density(cable) + 1.5).abs() < 1e-10);
    }
    // Rigid motions are all that is left.
    assert!(matches!(equilibrium.status, Status::Mechanism { .. }));
    let pivots = (equilibrium.zero_pivots, equilibrium.negative_pivots);
    assert_eq!(pivots, (6, 0));
}

/// The triplex prism: struts join corners of two triangles that are turned by 150°, force
/// densities of vertical and horizontal cables are as √3 (Connelly and Terrell, 1995).
#[test]
fn the_triplex_prism_is_twisted_by_150_degrees() {
    let mut scene = Scene::default();
    let corner = |k: usize, turned: f64, z: f64| {
        let angle = 2.0 * PI * k as f64 / 3.0 + turned;
        Vector3::new(angle.cos(), angle.sin(), z)
    };
    let lower: Vec<_> = (0..3)
        .map(|k| scene.add_node(Node::fixed(corner(k, 0.0, 0.0))))
        .collect();
    let upper: Vec<_> = (0..3)
        .map(|k| scene.add_node(Node::at(corner(k, 2.4, 1.3))))
        .collect();
    // q_h = 1 between upper nodes; the radius is 1 then as below.
    for k in 0..3 {
        scene
            .springs
            .push(Spring::between(upper[k], upper[(k + 1) % 3], 1.0, 0.0));
        scene
            .springs
            .push(Spring::between(lower[k], upper[k], 3f64.sqrt(), 0.0));
    }
    let length = 2.0;
    for k in 0..3 {
        // Pushes with q = −√3 at its length.
        let stiffness = 1e3;
        let rest_length = length * (1.0 + 3f64.sqrt() / stiffness);
        scene.springs.push(Spring::between(
            lower[k],
            upper[(k + 1) % 3],
            stiffness,
            rest_length,
        ));
    }
    let equilibrium = settle(&scene, &Options::default()).unwrap();
    for k in 0..3 {
        let at = equilibrium.positions[upper[k]];
        let below = equilibrium.positions[lower[k]];
        let along_strut = equilibrium.positions[upper[(k + 1) % 3]];
        let twist = along_strut.y.atan2(along_strut.x) - below.y.atan2(below.x);
        let twist = twist.rem_euclid(2.0 * PI);
        assert!((twist - 150f64.to_radians()).abs() < 1e-10, "{twist}");
        let horizontal = equilibrium.tensions[2 * k] / {
            let [a, b] = scene.springs[2 * k].nodes;
            (equilibrium.positions[a] - equilibrium.positions[b]).norm()
        };
        let vertical = equilibrium.tensions[2 * k + 1] / (at - below).norm();
        assert!((vertical / horizontal - 3f64.sqrt()).abs() < 1e-10);
    }
}

/// The arch of least load path over a span d under an even load (Jiang et al., Structural
/// and Multidisciplinary Optimization 58, 2018): rise √3 d/4, load path d²/√3 per load.
#[test]
fn the_arch_of_least_load_path_has_its_rise() {
    const D: f64 = 10.0;
    const N: usize = 101;
    let mut scene = Scene::default();
    for k in 0..N {
        let at = Vector3::new(D * k as f64 / (N - 1) as f64, 0.0, 0.0);
        let is_end = k == 0 || k == N - 1;
        scene.add_node(if is_end {
            Node::fixed(at)
        } else {
            Node::at(at)
        });
    }
    let step = D / (N - 1) as f64;
    for k in 1..N {
        scene.springs.push(Spring::between(k - 1, k, 1.0, 1.0));
        if k < N - 1 {
            scene.loads.push(load(k, Vector3::new(0.0, 0.0, -step)));
        }
    }
    // The load path Σ |T| l of arches with equal densities q: the least over q.
    let path_of = |q: f64| {
        let form = form_of_densities(&scene, &vec![q; N - 1]).unwrap();
        let squares = form
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).norm_squared());
        let path: f64 = squares.sum::<f64>() * q.abs();
        (path, form[N / 2].z)
    };
    let (mut low, mut high) = (-100.0f64, -1.0f64);
    while high - low > 1e-9 {
        let third = (high - low) / 3.0;
        if path_of(low + third).0 < path_of(high - third).0 {
            high -= third;
        } else {
            low += third;
        }
    }
    let (path, rise) = path_of(low);
    assert!(
        (rise / (3f64.sqrt() * D / 4.0) - 1.0).abs() < 1e-3,
        "{rise}"
    );
    assert!((path / (D * D / 3f64.sqrt()) - 1.0).abs() < 1e-2, "{path}");
}

/// von Mises's truss, one half of it: P = 2K(l₀^⅔ − b^⅔)^{3/2} is the most that it bears.
#[test]
fn the_two_bar_truss_snaps_through_at_its_limit() {
    let (k, b, h) = (100.0, 1.0f64, 0.3f64);
    let l = b.hypot(h);
    let mut scene = Scene::default();
    for x in [-b, b] {
        scene.add_node(Node::fixed(Vector3::new(x, 0.0, 0.0)));
    }
    let top = scene.add_node(Node {
        guide: Some(springs_scene::Guide::Held([false, true, false])),
        ..Node::at(Vector3::new(0.0, 0.0, h))
    });
    scene.springs.push(Spring::between(0, top, k, l));
    scene.springs.push(Spring::between(1, top, k, l));
    scene.loads = vec![load(top, Vector3::new(0.0, 0.0, -1.2))];
    let path = trace(&scene, 1000, &Options::default()).unwrap();
    assert_eq!(path.end, PathEnd::WholeLoad);
    let limits: Vec<_> = path.points.iter().filter(|point| point.is_limit).collect();
    assert_eq!(limits.len(), 2);
    let expected = 2.0 * k * (l.powf(2.0 / 3.0) - b.powf(2.0 / 3.0)).powf(1.5);
    assert!((expected - 0.994992).abs() < 1e-6);
    for (limit, sign) in limits.iter().zip([1.0, -1.0]) {
        let load = 1.2 * limit.factor;
        assert!((load / (sign * expected) - 1.0).abs() < 1e-9, "{load}");
    }
    for point in &path.points {
        // The closed form of the whole path.
        let z = h - point.displacement;
        let bar = b.hypot(z);
        let load = 2.0 * k * (l - bar) * z / bar;
        assert!((1.2 * point.factor - load).abs() < 1e-9);
        let is_between = point.displacement > limits[0].displacement
            && point.displacement < limits[1].displacement;
        if !point.is_limit {
            assert_eq!(point.negative_pivots, usize::from(is_between));
        }
    }
    assert!(path.points.last().unwrap().displacement > 2.0 * h);
}

/// A chain between walls along x: ω = 2√(K/m) sin(jπ/(2(N + 1))).
#[test]
fn a_chain_has_its_frequencies() {
    let (n, k, m) = (40, 50.0, 0.2);
    let mut scene = Scene::default();
    for i in 0..n + 2 {
        let at = Vector3::new(i as f64, 0.0, 0.0);
        scene.add_node(if i == 0 || i == n + 1 {
            Node::fixed(at)
        } else {
            Node {
                mass: m,
                guide: Some(springs_scene::Guide::Along(Vector3::new(1.0, 0.0, 0.0))),
                ..Node::at(at)
            }
        });
    }
    for i in 0..n + 1 {
        scene.springs.push(Spring::between(i, i + 1, k, 1.0));
    }
    for count in [3, 20, n, n + 100] {
        let modes = modes(&scene, count, &Options::default()).unwrap();
        assert_eq!(modes.frequencies.len(), count.min(n));
        assert_eq!((modes.n_all, modes.n_negative, modes.n_zero), (n, 0, 0));
        for (j, frequency) in (1..).zip(&modes.frequencies) {
            let omega = 2.0 * (k / m).sqrt() * (j as f64 * PI / (2 * (n + 1)) as f64).sin();
            assert!((frequency * 2.0 * PI / omega - 1.0).abs() < 1e-10);
            let shape = &modes.shapes[j - 1];
            assert!(shape.iter().all(|u| u.y == 0.0 && u.z == 0.0));
        }
    }
}
