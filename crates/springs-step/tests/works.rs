//! The work of each load and each support, against closed forms and integrals along much
//! finer trajectories.

mod common;

use common::{tangle, with};
use nalgebra::Vector3;
use springs_scene::{
    Displacement, Load, Method, NamedMotion, Node, OverTime, PrescribedMotion, RunOptions, Scene,
    StepControl,
};
use springs_step::{Islands, NodeStates, Observer, Simulation, Works};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

const TAKE_DASHPOTS: [Method; 7] = [
    Method::LinearlyImplicitEuler,
    Method::ImplicitEuler,
    Method::TrBdf2,
    Method::ImplicitMidpoint,
    Method::FilteredLeapfrog,
    Method::VelocityVerlet,
    Method::Dop853,
];

fn sine(frequency: f64) -> OverTime {
    OverTime::Sine {
        frequency,
        phase: 0.3,
    }
}

/// A tangle of springs whose node 1 moves at a constant velocity, and whose node 0 is shaken
/// beside that, under two loads that have a node in common.
fn shaken(seed: u64, method: Method) -> Scene {
    let mut scene = tangle(8, seed);
    scene.settings.duration = 0.25;
    scene.motions.push(NamedMotion {
        name: "shake".to_owned(),
        motion: PrescribedMotion::Sine {
            amplitude: Vector3::new(0.0, 0.01, 0.02),
            frequency: 3.0,
            phase: 0.5,
        },
    });
    scene.nodes[0].motion = Some(0);
    // What joins two supports is shared out as if they went straight on in a step.
    let is_fixed = |node: usize| scene.nodes[node].fixed;
    scene
        .springs
        .retain(|s| !(is_fixed(s.nodes[0]) && is_fixed(s.nodes[1])));
    scene.loads = vec![
        load(&[3, 4], Vector3::new(0.0, 0.0, -2.0), sine(4.0)),
        load(&[4, 0], Vector3::new(1.0, 0.5, 0.0), OverTime::Constant),
    ];
    if !TAKE_DASHPOTS.contains(&method) {
        scene.springs.iter_mut().for_each(|s| s.damping = 0.0);
    }
    scene
}

fn load(nodes: &[usize], force: Vector3<f64>, over_time: OverTime) -> Load {
    Load {
        name: String::new(),
        nodes: nodes.to_vec(),
        force,
        over_time,
    }
}

/// Works of loads, and of supports with their nodes.
fn numbers(works: &Works) -> Vec<(usize, f64)> {
    let supports = works.supports.iter().map(|s| (s.node, s.work));
    works
        .loads
        .iter()
        .copied()
        .enumerate()
        .chain(supports)
        .collect()
}

/// The same as [`numbers`] along a fine trajectory, by Simpson's rule on forces times
/// velocities at its steps, formed here.
fn integrals(scene: &Scene, steps: usize) -> Vec<(usize, f64)> {
    let h = scene.settings.duration / steps as f64;
    let scene = with(scene, Method::Dop853, None, h);
    let options = RunOptions::default().with_skip(false);
    let mut simulation = Simulation::with_options(&scene, &options).unwrap();
    let moves = |node: &usize| {
        let node = &scene.nodes[*node];
        node.fixed && (node.velocity != Vector3::zeros() || node.motion.is_some())
    };
    let supports: Vec<usize> = (0..scene.nodes.len()).filter(moves).collect();
    let mut works = vec![0.0; scene.loads.len() + supports.len()];
    let mut add = |step: usize, nodes: &NodeStates| {
        let weight = h / 3.0
            * match step {
                0 => 1.0,
                _ if step == steps => 1.0,
                _ if step % 2 == 1 => 4.0,
                _ => 2.0,
            };
        let v = &nodes.velocities;
        for (work, load) in works.iter_mut().zip(&scene.loads) {
            let force = load.force * load.over_time.factor(step as f64 * h);
            for &node in load.nodes.iter().filter(|&&node| !scene.nodes[node].fixed) {
                *work += weight * force.dot(&v[node]);
            }
        }
        for spring in &scene.springs {
            let [a, b] = spring.nodes;
            let dx = nodes.positions[b] - nodes.positions[a];
            let (l, u) = (dx.norm(), dx.normalize());
            let rate = (v[b] - v[a]).dot(&u);
            let pull = u * (spring.stiffness * (l - spring.rest_length) + spring.damping * rate);
            for (node, sign) in [(a, -1.0), (b, 1.0)] {
                if let Ok(support) = supports.binary_search(&node) {
                    works[scene.loads.len() + support] += weight * sign * pull.dot(&v[node]);
                }
            }
        }
    };
    add(0, simulation.nodes());
    let mut step = 0;
    while simulation.step().unwrap().is_some() {
        step += 1;
        add(step, simulation.nodes());
    }
    let names = (0..scene.loads.len()).chain(supports);
    names.zip(works).collect()
}

fn run(scene: &Scene) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.run(1, &mut ()).unwrap();
    simulation
}

fn assert_sums(works: &Works, (loads, anchors): (f64, f64), of: &str) {
    let own: f64 = works.loads.iter().sum::<f64>() + works.set_forces;
    let own = own + works.other_loads.iter().sum::<f64>();
    let size: f64 = works.loads.iter().map(|w| w.abs()).sum();
    assert!(
        (own - loads).abs() <= 1e-12 * (1e-9 + size),
        "{of}: {own} of {loads} J"
    );
    let own: f64 = works.supports.iter().map(|s| s.work).sum();
    let size: f64 = works.supports.iter().map(|s| s.work.abs()).sum();
    assert!(
        (own - anchors).abs() <= 1e-12 * (1e-9 + size),
        "{of}: {own} of {anchors} J"
    );
}

/// Each work comes to its integral along the exact motion with the order of the method, and
/// all of them together are what the ledger has.
#[test]
fn works_converge_to_their_integrals_with_the_order_of_the_method() {
    let mut wrong = Vec::new();
    for &method in Method::ALL.iter().filter(|&&method| method != Method::Auto) {
        let scene = shaken(4, method);
        let exact = integrals(&scene, 4000);
        let (order, steps) = match method {
            Method::LinearlyImplicitEuler | Method::ImplicitEuler => (1.0, 4096),
            Method::BlanesMoan4 | Method::Rodas4 => (4.0, 64),
            // Kicks change energies exactly, and the work of a load alone with order 4.
            Method::BlanesMoan6 => (4.0, 32),
            // Of order 8 where steps are shorter, and rounding then.
            Method::Dop853 => (7.0, 16),
            _ => (2.0, 256),
        };
        let errors = |steps: usize| -> Vec<f64> {
            let h = scene.settings.duration / steps as f64;
            let simulation = run(&with(&scene, method, None, h));
            let (works, ledger) = (simulation.works(), simulation.ledger());
            let totals = (ledger.load_work, ledger.anchor_work);
            assert_sums(&works, totals, &method.to_string());
            let found = numbers(&works);
            assert_eq!(found.len(), 4, "{method}: {found:?}");
            let pairs = found.iter().zip(&exact);
            let error = |(a, b): (&(usize, f64), &(usize, f64))| {
                assert_eq!(a.0, b.0);
                (a.1 - b.1).abs()
            };
            pairs.map(error).collect()
        };
        let (coarse, fine) = (errors(steps), errors(2 * steps));
        let largest = exact
            .iter()
            .fold(0.0, |most: f64, (_, work)| most.max(work.abs()));
        for (k, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
            let observed = (coarse / fine).log2();
            if observed < order - 0.6 || *fine > 0.01 * largest {
                wrong.push(format!(
                    "{method}: {:?} {coarse:e} → {fine:e}, order {observed:.2}",
                    exact[k]
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A mass that two loads push apart from rest: x = (F₁ + F₂)t²/2m, so that each does F·x.
/// Two anchors pull at two masses of their own.
#[test]
fn loads_and_supports_are_told_apart() {
    let mut scene = Scene::default();
    let mass = |at: f64| Node {
        mass: 2.0,
        ..Node::at(Vector3::x() * at)
    };
    scene.add_node(mass(0.0));
    for (at, velocity) in [(3.0, 1.0), (6.0, -2.0)] {
        scene.add_node(Node {
            velocity: Vector3::x() * velocity,
            ..Node::fixed(Vector3::x() * at)
        });
        scene.add_node(mass(at + 1.0));
    }
    scene.add_node(Node::fixed(Vector3::y()));
    scene.add_spring(1, 2, 1e3);
    scene.add_spring(3, 4, 1e3);
    scene.loads = vec![
        load(&[0], Vector3::x() * 3.0, OverTime::Constant),
        load(&[0], Vector3::x() * -1.0, OverTime::Constant),
        load(&[3], Vector3::x() * 9.0, OverTime::Constant),
    ];
    scene.settings.step = StepControl::Tolerance(1e-9);
    scene.settings.duration = 0.5;
    for method in [Method::TrBdf2, Method::Dop853, Method::Auto] {
        scene.settings.method = method;
        for skip in [false, true] {
            let options = RunOptions::default().with_skip(skip);
            let mut islands = Islands::with_options(&scene, &options).unwrap();
            assert_eq!(islands.parts().len() > 1, skip);
            islands.run(1, &mut ()).unwrap();
            let (works, ledger) = (islands.works(), islands.ledger());
            assert_sums(&works, (ledger.load_work, ledger.anchor_work), "sum");
            let x = 0.5 * 2.0 / 2.0 * 0.25;
            assert!((works.loads[0] - 3.0 * x).abs() < 1e-6, "{works:?}");
            assert!((works.loads[1] + x).abs() < 1e-6, "{works:?}");
            // What holds node 3 takes the load there.
            assert_eq!(works.loads[2], 0.0);
            // Each gives its velocity times the momentum of its mass.
            let nodes: Vec<usize> = works.supports.iter().map(|s| s.node).collect();
            assert_eq!(nodes, [1, 3]);
            for (support, velocity) in works.supports.iter().zip([1.0, -2.0]) {
                let momentum = 2.0 * islands.nodes().velocities[support.node + 1].x;
                let expected = velocity * momentum;
                assert!(
                    (support.work - expected).abs() < 1e-5,
                    "{method}: {works:?}"
                );
            }
        }
    }
}

/// Between two anchors that both move, each has its own part: a spring of 0.5 m at rest
/// whose ends go along it, and one across to that.
#[test]
fn anchors_that_pull_at_each_other_have_works_of_their_own() {
    let mut scene = Scene::default();
    let anchor = |x: f64, velocity: Vector3<f64>| Node {
        velocity,
        ..Node::fixed(Vector3::x() * x)
    };
    scene.add_node(anchor(0.0, Vector3::x()));
    scene.add_node(anchor(0.5, Vector3::x() * 3.0));
    scene.add_node(anchor(0.5, Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::y() * 9.0)
    });
    let spring = scene.add_spring(0, 1, 100.0);
    scene.add_spring(1, 2, 40.0);
    scene.springs[spring].damping = 5.0;
    scene.settings.duration = 0.5;
    scene.settings.step = StepControl::Fixed(0.125);
    for method in TAKE_DASHPOTS {
        scene.settings.method = method;
        let simulation = run(&scene);
        let works = simulation.works();
        // T = 100·2t + 5·2 until 1/2 s; its ends go at 1 and 3 m/s. And ½·40·1.5².
        let impulse = 100.0 * 0.25 + 10.0 * 0.5;
        let expected = [(0, -impulse), (1, 3.0 * impulse + 45.0)];
        for (found, (node, work)) in works.supports.iter().zip(expected) {
            assert_eq!(found.node, node);
            assert!((found.work - work).abs() < 1e-10, "{method}: {works:?}");
        }
        let total = simulation.ledger().anchor_work;
        assert_sums(&works, (0.0, total), &method.to_string());
    }
}

/// Stops after so many frames.
struct Until(usize);

impl Observer for Until {
    fn frame(&mut self, _frame: springs_step::Frame<'_>) -> ControlFlow<()> {
        self.0 -= 1;
        match self.0 {
            0 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }
}

/// Two scenes that are not coupled, so that there are parts.
fn two_parts(method: Method) -> Scene {
    let mut scene = shaken(4, method);
    let (other, n) = (shaken(5, method), scene.nodes.len());
    scene.nodes.extend(other.nodes);
    for mut spring in other.springs {
        spring.nodes = spring.nodes.map(|node| node + n);
        scene.springs.push(spring);
    }
    for mut load in other.loads {
        load.nodes.iter_mut().for_each(|node| *node += n);
        scene.loads.push(load);
    }
    // One load acts on both.
    scene.loads.push(load(&[2, n + 2], Vector3::z(), sine(1.0)));
    scene
}

/// A run that is stopped and goes on from what it saved gives the same bits on any number
/// of threads, and at the stop already what it did so far.
#[test]
fn works_are_saved_and_do_not_depend_on_threads() {
    for method in [
        Method::TrBdf2,
        Method::VelocityVerlet,
        Method::FilteredLeapfrog,
    ] {
        let mut scene = two_parts(method);
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(1.0 / 1024.0);
        let begun = |threads: usize| {
            let options = RunOptions::default().with_threads(threads);
            Islands::with_options(&scene, &options).unwrap()
        };
        let mut whole = begun(1);
        whole.run(7, &mut ()).unwrap();
        let mut first = begun(2);
        first.run(7, &mut Until(4)).unwrap();
        let (works, ledger) = (first.works(), first.ledger());
        assert_sums(&works, (ledger.load_work, ledger.anchor_work), "on the way");
        assert_ne!(works, whole.works());
        let mut second = begun(2);
        second.restore(first.save()).unwrap();
        assert_eq!(second.works(), works);
        second.run(7, &mut ()).unwrap();
        assert_eq!(second.works(), whole.works(), "{method}");
        let ledger = whole.ledger();
        assert_sums(
            &whole.works(),
            (ledger.load_work, ledger.anchor_work),
            "whole",
        );
        assert_eq!(whole.works().loads.len(), 5);
        assert_eq!(whole.works().supports.len(), 4);
    }
}

/// Forces that are set between steps are one more load.
#[test]
fn forces_that_are_set_have_a_line_of_their_own() {
    let mut scene = Scene::default();
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::zeros())
    });
    scene.loads = vec![load(&[0], Vector3::x(), OverTime::Constant)];
    scene.settings.step = StepControl::Fixed(0.125);
    scene.settings.method = Method::TrBdf2;
    let mut simulation = Simulation::changeable(&scene, &RunOptions::default()).unwrap();
    simulation.set_forces(&[Vector3::x() * 3.0]).unwrap();
    while simulation.step().unwrap().is_some() {}
    let (works, x) = (simulation.works(), simulation.nodes().positions[0].x);
    assert!((x - 2.0).abs() < 1e-12);
    assert!((works.loads[0] - 2.0).abs() < 1e-12 && (works.set_forces - 6.0).abs() < 1e-12);
    assert!(works.other_loads.is_empty() && works.supports.is_empty());
}

/// What a motion says at any time is where the support is.
#[test]
fn a_shaken_support_gives_what_its_spring_takes() {
    // A massless end: a spring of 100 N/m between a shaken anchor and a mass so heavy that it
    // stands. The work is the energy of the spring.
    let (amplitude, frequency) = (0.1, 1.25);
    let mut scene = Scene::default();
    let motion = PrescribedMotion::Sine {
        amplitude: Vector3::x() * amplitude,
        frequency,
        phase: 0.0,
    };
    let Displacement { displacement, .. } = motion.at(0.2);
    assert!((displacement.x - amplitude * (TAU * frequency * 0.2).sin()).abs() < 1e-15);
    scene.motions.push(NamedMotion {
        name: "shake".to_owned(),
        motion,
    });
    scene.add_node(Node {
        motion: Some(0),
        ..Node::fixed(Vector3::zeros())
    });
    scene.add_node(Node {
        mass: 1e12,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, 100.0);
    scene.settings.duration = 0.2;
    scene.settings.step = StepControl::Fixed(0.2 / 256.0);
    for method in [
        Method::TrBdf2,
        Method::Dop853,
        Method::Rodas4,
        Method::FilteredLeapfrog,
    ] {
        scene.settings.method = method;
        let work = run(&scene).works().supports[0].work;
        let expected = 50.0 * amplitude * amplitude;
        assert!(
            (work - expected).abs() < 1e-4 * expected,
            "{method}: {work}"
        );
    }
}
