//! What springs and supports carry, against closed forms and balances.

mod common;

use common::{METHODS, Random, append, tangle, with};
use nalgebra::Vector3;
use springs_scene::generate::{Material, cloth};
use springs_scene::{
    Guide, Load, Method, NamedMotion, Node, OverTime, PrescribedMotion, RunOptions, Scene,
    StepControl,
};
use springs_step::{Frame, Islands, Members, Observer, Peak, properties};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

const G: f64 = 9.81;

/// One frame.
struct Seen {
    time: f64,
    velocities: Vec<Vector3<f64>>,
    members: Members,
}

struct Look(Vec<Seen>);

impl Observer for Look {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.0.push(Seen {
            time: frame.time,
            velocities: frame.nodes.velocities.clone(),
            members: frame.members.unwrap().clone(),
        });
        ControlFlow::Continue(())
    }
}

fn seen(scene: &Scene, options: &RunOptions, intervals: usize) -> (Vec<Seen>, Vec<Peak>) {
    let mut look = Look(Vec::new());
    let mut islands = Islands::with_options(scene, options).unwrap();
    islands.run(intervals, &mut look).unwrap();
    (look.0, islands.peaks())
}

fn run(scene: &Scene, intervals: usize) -> (Vec<Seen>, Vec<Peak>) {
    seen(scene, &RunOptions::default(), intervals)
}

fn weight(node: Vector3<f64>, mass: f64) -> Node {
    Node {
        mass,
        ..Node::at(node)
    }
}

/// Weights below each other at rest, the first spring made of two.
fn hanging() -> (Scene, Vec<f64>) {
    let masses = [0.4, 1.5, 0.1, 2.0];
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -G),
        ..Scene::default()
    };
    scene.add_node(Node {
        mass: 0.7,
        ..Node::fixed(Vector3::zeros())
    });
    let mut z = 0.0;
    let mut below: f64 = masses.iter().sum::<f64>() * G;
    let mut expected = Vec::new();
    for (k, mass) in masses.iter().enumerate() {
        let stiffness = 1000.0 * (k + 1) as f64;
        z -= 0.5 + below / stiffness;
        let node = scene.add_node(weight(Vector3::new(0.0, 0.0, z), *mass));
        let shares = if k == 0 { vec![0.25, 0.75] } else { vec![1.0] };
        for share in shares {
            let spring = scene.add_spring(node - 1, node, share * stiffness);
            scene.springs[spring].rest_length = 0.5;
            expected.push(share * below);
        }
        below -= mass * G;
    }
    scene.settings.duration = 0.1;
    (scene, expected)
}

#[test]
fn hanging_weights_are_carried() {
    let (scene, expected) = hanging();
    let total = (0.7 + 4.0) * G;
    for method in METHODS {
        for skips in [true, false] {
            let scene = with(&scene, method, None, 0.002);
            let options = RunOptions::default().with_skip(skips);
            let (frames, peaks) = seen(&scene, &options, 7);
            for Seen { time, members, .. } in &frames {
                for (tension, expected) in members.tensions.iter().zip(&expected) {
                    let off = (tension - expected).abs();
                    assert!(off < 1e-9, "{method} at {time}: {tension}, not {expected}");
                }
                let [reaction] = members.reactions[..] else {
                    panic!("{method}: {:?}", members.reactions);
                };
                let off = (reaction.force - Vector3::new(0.0, 0.0, total)).norm();
                assert!(reaction.node == 0 && off < 1e-9, "{method}: {reaction:?}");
            }
            assert_eq!(peaks.len(), expected.len());
            for (peak, expected) in peaks.iter().zip(&expected) {
                assert!((peak.max_tension - expected).abs() < 1e-9, "{method}");
                assert!((peak.min_tension - expected).abs() < 1e-9, "{method}");
            }
        }
    }
}

/// A pendulum whose rod no step resolves carries m (g cos θ + v²/l), as a rigid one does.
#[test]
fn rods_that_no_step_resolves_carry_what_rigid_ones_do() {
    let start = 1.0_f64;
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -G),
        ..Scene::default()
    };
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(weight(
        Vector3::new(start.sin(), 0.3, -start.cos()) - Vector3::new(0.0, 0.3, 0.0),
        2.0,
    ));
    scene.add_spring(0, 1, 1e9);
    scene.settings.duration = 1.0;
    for (method, allowed) in [
        (Method::FilteredLeapfrog, 1e-3),
        (Method::TrBdf2, 1e-2),
        (Method::ImplicitEuler, 2e-2),
        (Method::LinearlyImplicitEuler, 1e-2),
    ] {
        let scene = with(&scene, method, None, 0.004);
        let mut look = Swinging(Vec::new());
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(37, &mut look).unwrap();
        // From the rest length it vibrates until the method has damped that.
        let worst = look.0.iter().skip(4).fold(0.0, |worst: f64, frame| {
            let (expected, tension) = *frame;
            worst.max((tension - expected).abs() / (2.0 * G))
        });
        assert!(worst < allowed, "{method}: {worst:.1e} of the weight");
    }
}

/// The tension of a rigid rod and that of the spring at each frame.
struct Swinging(Vec<(f64, f64)>);

impl Observer for Swinging {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let position = frame.nodes.positions[1];
        let tension = frame.members.unwrap().tensions[0];
        let velocity = frame.nodes.velocities[1];
        let (cosine, length) = (-position.z / position.norm(), position.norm());
        let rigid = 2.0 * (G * cosine + velocity.norm_squared() / length);
        self.0.push((rigid, tension));
        ControlFlow::Continue(())
    }
}

/// A net that hangs from a shaken, a planar and a sliding support, with a load on one
/// of the fixed nodes.
fn supported() -> Scene {
    let mut scene = cloth(5, Material::of_cloth());
    scene.gravity = Vector3::new(0.0, 1.0, -G);
    for node in &mut scene.nodes {
        node.fixed = false;
    }
    scene.motions.push(NamedMotion {
        name: "shake".to_owned(),
        motion: PrescribedMotion::Sine {
            amplitude: Vector3::new(0.02, 0.0, 0.05),
            frequency: 2.0,
            phase: 0.3,
        },
    });
    let last = scene.nodes.len() - 1;
    scene.nodes[0].fixed = true;
    scene.nodes[0].motion = Some(0);
    scene.nodes[4].guide = Some(Guide::Held([false, true, false]));
    scene.nodes[last].guide = Some(Guide::Along(Vector3::new(0.0, 3.0, 4.0)));
    scene.nodes[20].fixed = true;
    scene.loads.push(Load {
        name: String::new(),
        nodes: vec![20],
        force: Vector3::new(1.0, 2.0, 3.0),
        over_time: OverTime::Constant,
    });
    scene.settings.duration = 0.5;
    scene
}

/// Newton's second law for the whole scene: weight, loads and reactions are what its
/// momentum changes by.
#[test]
fn reactions_balance_the_momentum_of_the_whole() {
    let scene = with(&supported(), Method::VelocityVerlet, None, 5e-5);
    let masses = scene.node_masses();
    let total: f64 = masses.iter().sum();
    let external = scene.gravity * total + Vector3::new(1.0, 2.0, 3.0);
    let (frames, _) = run(&scene, 10_000);
    let momentum = |frame: &Seen| -> Vector3<f64> {
        let moving = masses.iter().zip(&frame.velocities);
        moving.map(|(mass, velocity)| velocity * *mass).sum()
    };
    let mut largest: f64 = 0.0;
    for around in frames.windows(5).step_by(49) {
        let wide = momentum(&around[4]) - momentum(&around[0]);
        let narrow = momentum(&around[3]) - momentum(&around[1]);
        let rate = (narrow * 8.0 - wide) / (3.0 * (around[4].time - around[0].time));
        let reactions = &around[2].members.reactions;
        let nodes: Vec<usize> = reactions.iter().map(|reaction| reaction.node).collect();
        assert_eq!(nodes, [0, 4, 20, scene.nodes.len() - 1]);
        let sum: Vector3<f64> = reactions.iter().map(|reaction| reaction.force).sum();
        let off = (sum + external - rate).norm();
        assert!(off < 2e-5 * total * G, "{off:e} N at {}", around[2].time);
        largest = largest.max(sum.norm());
        let held = reactions[1].force.y;
        assert_eq!(reactions[1].force, Vector3::y() * held);
        let along = reactions[3].force.dot(&Vector3::new(0.0, 0.6, 0.8)).abs();
        assert!(along < 1e-12 * total * G, "{along:e} N along the guide");
    }
    assert!(largest > total * G);
}

/// A fixed mass that nothing holds but its support.
#[test]
fn a_moving_mass_is_carried_and_accelerated() {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -G),
        ..Scene::default()
    };
    scene.motions.push(NamedMotion {
        name: "shake".to_owned(),
        motion: PrescribedMotion::Sine {
            amplitude: Vector3::x(),
            frequency: 1.5,
            phase: 0.0,
        },
    });
    scene.add_node(Node {
        mass: 3.0,
        motion: Some(0),
        ..Node::fixed(Vector3::zeros())
    });
    let (frames, peaks) = run(&scene, 11);
    assert!(peaks.is_empty());
    for Seen { time, members, .. } in frames {
        let omega = TAU * 1.5;
        let expected = Vector3::new(-3.0 * omega * omega * (omega * time).sin(), 0.0, 3.0 * G);
        let off = (members.reactions[0].force - expected).norm();
        assert!(off < 1e-11, "{time}: {:?}", members.reactions);
    }
}

/// Peaks are found at the ends of steps: K A, between frames.
#[test]
fn peaks_are_found_between_frames() {
    let (mass, stiffness, amplitude) = (0.5, 200.0, 0.01);
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(weight(Vector3::new(1.0 + amplitude, 0.0, 0.0), mass));
    let spring = scene.add_spring(0, 1, stiffness);
    scene.springs[spring].rest_length = 1.0;
    let period = TAU * (mass / stiffness).sqrt();
    scene.settings.duration = 0.9 * period;
    for method in METHODS {
        let order = properties(method).unwrap().order;
        let h = period / if order == 1 { 40_000.0 } else { 1000.0 };
        let (_, peaks) = run(&with(&scene, method, None, h), 1);
        let [peak] = peaks[..] else {
            panic!("{peaks:?}")
        };
        let expected = stiffness * amplitude;
        assert!(
            (peak.max_tension - expected).abs() < 1e-3 * expected,
            "{method}: {peak:?}"
        );
        assert_eq!(peak.time_of_max, 0.0, "{method}");
        assert!(
            (peak.min_tension + expected).abs() < 1e-3 * expected,
            "{method}: {peak:?}"
        );
        assert!(
            (peak.time_of_min - period / 2.0).abs() < 0.01 * period,
            "{method}: {peak:?}"
        );
    }
}

/// Parts, sleepers and frames of theirs give what the whole gives.
#[test]
fn parts_carry_what_the_whole_does() {
    let mut random = Random(5);
    for method in [
        Method::LinearlyImplicitEuler,
        Method::TrBdf2,
        Method::FilteredLeapfrog,
        Method::VelocityVerlet,
    ] {
        let mut scene = tangle(12, 3);
        append(&mut scene, &tangle(7, 8));
        append(&mut scene, &hanging().0);
        let shared = scene.add_node(Node {
            mass: 0.2,
            ..Node::fixed(random.vector(1.0))
        });
        scene.add_spring(shared, 3, 30.0);
        scene.add_spring(shared, 15, 50.0);
        for spring in &mut scene.springs {
            spring.damping = 0.0;
        }
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(0.002);
        scene.settings.duration = 0.1;
        let whole = seen(&scene, &RunOptions::default().with_skip(false), 9);
        let parts = run(&scene, 9);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-8 * (1.0 + b.abs());
        for (part, whole) in parts.0.iter().zip(&whole.0) {
            let (part, whole) = (&part.members, &whole.members);
            for (a, b) in part.tensions.iter().zip(&whole.tensions) {
                assert!(near(*a, *b), "{method}: {a}, {b}");
            }
            assert_eq!(part.reactions.len(), whole.reactions.len());
            for (a, b) in part.reactions.iter().zip(&whole.reactions) {
                assert_eq!(a.node, b.node);
                for axis in 0..3 {
                    assert!(near(a.force[axis], b.force[axis]), "{method}: {a:?}, {b:?}");
                }
            }
        }
        for (part, whole) in parts.1.iter().zip(&whole.1) {
            assert!(near(part.max_tension, whole.max_tension), "{method}");
            assert!(near(part.min_tension, whole.min_tension), "{method}");
        }
    }
}
