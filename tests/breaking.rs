//! Springs that break: when, in which order, and what becomes of their energy.

mod common;

use common::{METHODS, Random, append, tangle, with};
use nalgebra::Vector3;
use springs::assembly::{SpringBetween, Springs};
use springs::io::{parse_scene, scene_to_string};
use springs::math::law::{Breaking, Limit};
use springs::scene::{BreakLimit, Method, Node, RunOptions, Scene, StepControl};
use springs::step::{Account, Break, Frame, Islands, Members, Observer, Simulation};
use std::ops::ControlFlow;

/// Members and energies at each frame.
#[derive(Default)]
struct Look {
    members: Vec<(f64, Members, Vec<Vector3<f64>>)>,
    accounts: Vec<Account>,
}

impl Observer for Look {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let members = frame.members.unwrap().clone();
        let positions = frame.nodes.positions.clone();
        self.members.push((frame.time, members, positions));
        ControlFlow::Continue(())
    }

    fn wants_account(&self) -> bool {
        true
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        self.accounts.push(account);
        ControlFlow::Continue(())
    }
}

/// m = 0.5 kg on a spring with K = 50 N/m and l₀ = 1 m, from rest at l₀ with 2 m/s:
/// l = l₀ + (v/ω) sin ωt with ω = 10 rad/s.
fn thrown(limit: BreakLimit) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 0.5,
        velocity: Vector3::x() * 2.0,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, 50.0);
    scene.springs[0].breaks_at = Some(limit);
    scene.settings.duration = 0.2;
    scene
}

/// It breaks where sin ωt = 0.6, at the end of that step, and flies on with 1.6 m/s.
#[test]
fn a_spring_breaks_at_the_end_of_the_step_in_which_its_limit_is() {
    let expected = 0.6f64.asin() / 10.0;
    let (h, order_1) = (1e-4, [Method::LinearlyImplicitEuler, Method::ImplicitEuler]);
    for method in METHODS {
        for limit in [BreakLimit::Strain(0.12), BreakLimit::Force(6.0)] {
            let scene = with(&thrown(limit), method, None, h);
            let mut look = Look::default();
            let mut islands = Islands::new(&scene).unwrap();
            // Frames within steps.
            islands.run(777, &mut look).unwrap();
            let breaks = islands.breaks();
            let [one] = breaks[..] else {
                panic!("{method}: {breaks:?}");
            };
            assert_eq!(one.spring, 0);
            let error = if order_1.contains(&method) {
                2.0 * h
            } else {
                1e-6
            };
            let late = one.time - expected;
            assert!(
                (-error..h + error).contains(&late),
                "{method}: {late:e} s late"
            );
            let held = 0.5 * 50.0 * 0.12 * 0.12;
            assert!(
                (one.energy - held).abs() < 2e-3 * held + 8.0 * error,
                "{method}: {one:?}"
            );
            let ledger = islands.ledger();
            assert_eq!(ledger.broken_energy, one.energy);
            let gain = ledger.method_gain(&islands.energy());
            let allowed = if order_1.contains(&method) {
                2e-3
            } else {
                1e-6
            };
            assert!(gain.abs() < allowed, "{method}: gains {gain:e} J");
            let speed = islands.nodes().velocities[1].x;
            assert!((speed - 1.6).abs() < 2e-3, "{method}: {speed} m/s");

            for (time, members, _) in &look.members {
                let is_broken = *time >= one.time - 1e-12;
                assert_eq!(
                    !members.broken.is_empty(),
                    is_broken,
                    "{method} at {time} s"
                );
                let reaction = members.reactions[0].force.x;
                if is_broken {
                    assert_eq!((members.tensions[0], reaction), (0.0, 0.0), "{method}");
                } else {
                    let tension = 50.0 * 0.2 * (10.0 * time).sin();
                    let error = (members.tensions[0] - tension).abs();
                    assert!(error < 2e-2, "{method} at {time} s: {error:e} N");
                    assert!((reaction + members.tensions[0]).abs() < 1e-9, "{method}");
                }
            }
            // The ledger closes in every frame.
            for account in &look.accounts {
                let gain = account.ledger.method_gain(&account.energy);
                assert!(
                    gain.abs() < 2e-3,
                    "{method} at {} s: {gain:e} J",
                    account.time
                );
            }
            let peak = islands.peaks()[0];
            assert!((peak.max_tension - 6.0).abs() < 2e-2, "{method}: {peak:?}");
            assert_eq!(peak.min_tension.min(0.0), peak.min_tension);
        }
    }
}

/// Steps by the error end near enough to where a spring breaks for what flies off then to
/// end within the tolerance; equal steps do not.
#[test]
fn steps_by_the_error_end_where_a_spring_breaks() {
    for method in [
        Method::Auto,
        Method::TrBdf2,
        Method::Rodas4,
        Method::Dop853,
        Method::VelocityVerlet,
        Method::FilteredLeapfrog,
        Method::ImplicitMidpoint,
    ] {
        let mut scene = thrown(BreakLimit::Strain(0.12));
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(1e-5);
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(10, &mut ()).unwrap();
        let breaks = islands.breaks();
        assert_eq!(breaks.len(), 1, "{method}");
        let ledger = islands.ledger();
        let gain = ledger.method_gain(&islands.energy());
        assert!(gain.abs() < 1e-3, "{method}: gains {gain:e} J");
        let kinetic = islands.energy().kinetic;
        assert!(
            (kinetic + ledger.broken_energy - 1.0).abs() < 1e-3,
            "{method}"
        );
    }
}

/// Emitters of one's own break as those of scenes do.
#[test]
fn springs_of_others_break_too() {
    for method in METHODS {
        let scene = with(&thrown(BreakLimit::Force(6.0)), method, None, 1e-3);
        let mut of_scene = Simulation::new(&scene).unwrap();
        of_scene.run(1, &mut ()).unwrap();
        let mut bare = scene.clone();
        bare.springs.clear();
        let between = SpringBetween {
            nodes: [0, 1],
            law: Breaking {
                law: springs::math::spring::Spring {
                    stiffness: 50.0,
                    rest_length: 1.0,
                },
                limit: Some(Limit::Tension(6.0)),
                is_broken: false,
            },
        };
        let emitter = Box::new(Springs::new("own", &[between]));
        let options = RunOptions::default();
        let mut own = Simulation::with_emitters(&bare, &options, vec![emitter]).unwrap();
        let mut look = Look::default();
        own.run(7, &mut look).unwrap();
        assert_eq!(own.nodes(), of_scene.nodes(), "{method}");
        let [own, of_scene] = [own.ledger(), of_scene.ledger()];
        assert_eq!(own.broken_energy, of_scene.broken_energy, "{method}");
        assert!(own.broken_energy > 0.3, "{method}");
    }
}

/// Its dashpot breaks with it.
#[test]
fn a_broken_spring_damps_nothing() {
    for method in [Method::LinearlyImplicitEuler, Method::TrBdf2] {
        let mut scene = thrown(BreakLimit::Force(6.0));
        scene.springs[0].damping = 0.3;
        scene.damping.stiffness = 1e-3;
        let scene = with(&scene, method, None, 1e-3);
        let mut simulation = Simulation::new(&scene).unwrap();
        let mut after = None;
        while simulation.step().unwrap().is_some() {
            if !simulation.breaks().is_empty() {
                let speed = simulation.nodes().velocities[1].x;
                let expected = *after.get_or_insert(speed);
                assert!((speed - expected).abs() < 1e-12, "{method}");
            }
        }
        assert!(after.is_some() && simulation.ledger().heat.sum() > 1e-3);
    }
}

const N: usize = 10_000;

/// N springs with K = 1 N/m side by side, with limits evenly on 0 … 1 m of stretch in a
/// random order, between a fixed node and one that a stiff spring pulls; the end of that
/// moves at 0.25 m/s.
fn bundle() -> Scene {
    let (pull, stiff, speed) = (0.25, 1e5, 0.25 * 1e5 / (1e5 + N as f64));
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        velocity: Vector3::x() * speed,
        ..Node::at(Vector3::x())
    });
    scene.add_node(Node {
        velocity: Vector3::x() * pull,
        ..Node::fixed(Vector3::x() * 2.0)
    });
    let mut limits: Vec<f64> = (0..N).map(|i| (i as f64 + 0.5) / N as f64).collect();
    let mut random = Random(7);
    for last in (1..N).rev() {
        limits.swap(last, random.below(last + 1));
    }
    for (index, limit) in limits.into_iter().enumerate() {
        let spring = scene.add_spring(0, 1, 1.0);
        scene.springs[spring].breaks_at = Some(match index % 2 {
            0 => BreakLimit::Strain(limit),
            _ => BreakLimit::Force(limit),
        });
    }
    scene.add_spring(1, 2, stiff);
    scene.settings.duration = 4.2;
    scene
}

/// The force of a bundle in which all springs have the same length and uniform limits is
/// F = N K u (1 − u/X): N K X/4 at u = X/2 at most (Pradhan, Hansen, Chakrabarti, Rev. Mod.
/// Phys. 82, 2010, III.A). All of it takes N K X²/6 of work, which is what the springs held.
#[test]
fn a_bundle_of_springs_has_its_published_strength() {
    let scene = bundle();
    let limit = |one: &Break| scene.springs[one.spring].breaks_at.unwrap().value();
    let mut orders = Vec::new();
    for method in [
        Method::LinearlyImplicitEuler,
        Method::TrBdf2,
        Method::FilteredLeapfrog,
        Method::VelocityVerlet,
    ] {
        let scene = with(&scene, method, None, 4e-3);
        let mut runs = [1, 8].map(|threads| {
            let options = RunOptions::default().with_threads(threads);
            let mut look = Look::default();
            let mut islands = Islands::with_options(&scene, &options).unwrap();
            islands.run(1050, &mut look).unwrap();
            (islands, look)
        });
        let [(one, look), (eight, _)] = &mut runs;
        assert_eq!(one.breaks(), eight.breaks(), "{method}");
        assert_eq!(one.nodes(), eight.nodes(), "{method}");
        assert_eq!(one.ledger(), eight.ledger(), "{method}");

        let force = |members: &Members| -members.reactions[0].force.x;
        let strongest = look.members.iter();
        let strongest = strongest.max_by(|a, b| force(&a.1).total_cmp(&force(&b.1)));
        let (_, members, positions) = strongest.unwrap();
        let (peak, at) = (force(members), positions[1].x - 1.0);
        assert!((peak - 2500.0).abs() < 25.0, "{method}: {peak} N");
        // F is within 1 % of its peak for u within 10 % of X/2.
        assert!((at - 0.5).abs() < 0.05, "{method}: at {at} m");

        let breaks = one.breaks();
        assert_eq!(breaks.len(), N, "{method}");
        let mut latest = 0.0;
        for same in breaks.chunk_by(|a, b| a.time == b.time) {
            let mut limits: Vec<f64> = same.iter().map(limit).collect();
            limits.sort_by(f64::total_cmp);
            assert!(limits[0] > latest, "{method}");
            assert!(same.is_sorted_by_key(|one| one.spring), "{method}");
            latest = *limits.last().unwrap();
        }
        let mut order: Vec<f64> = breaks.iter().map(limit).collect();
        order.sort_by(f64::total_cmp);
        orders.push(order);

        let ledger = one.ledger();
        let held: f64 = breaks.iter().map(|one| one.energy).sum();
        assert!(
            (ledger.broken_energy - held).abs() < 1e-9 * held,
            "{method}"
        );
        let work = N as f64 / 6.0;
        assert!((held - work).abs() < 5e-3 * work, "{method}: {held} J");
        assert!(
            (ledger.anchor_work - work).abs() < 1e-2 * work,
            "{method}: {ledger:?}"
        );
        let gain = ledger.method_gain(&one.energy());
        let allowed = match method {
            Method::LinearlyImplicitEuler => 1e-2,
            _ => 1e-3,
        };
        assert!(gain.abs() < allowed * work, "{method}: gains {gain} J");
    }
    assert!(orders.iter().all(|order| *order == orders[0]));
}

/// A tangle whose springs break one after the other.
fn brittle(n_nodes: usize, seed: u64) -> Scene {
    let mut scene = tangle(n_nodes, seed);
    let mut random = Random(seed + 3);
    for spring in scene.springs.iter_mut().step_by(2) {
        spring.breaks_at = Some(match random.below(3) {
            0 => BreakLimit::Strain(random.between(0.35, 0.8)),
            _ => BreakLimit::Force(random.between(5.0, 30.0)),
        });
    }
    scene
}

/// Parts break the springs that the whole does, at the same times.
#[test]
fn parts_break_what_the_whole_does() {
    for method in [Method::LinearlyImplicitEuler, Method::TrBdf2] {
        let mut scene = brittle(9, 1);
        append(&mut scene, &brittle(12, 2));
        scene.settings.duration = 0.5;
        let scene = with(&scene, method, None, 1e-3);
        let [whole, parts] = [false, true].map(|skip| {
            let options = RunOptions::default().with_skip(skip);
            let mut islands = Islands::with_options(&scene, &options).unwrap();
            islands.run(10, &mut ()).unwrap();
            assert_eq!(islands.parts().len() > 1, skip);
            let broken = islands.breaks();
            let broken: Vec<_> = broken.iter().map(|one| (one.spring, one.time)).collect();
            assert!(broken.len() > 5, "{broken:?}");
            broken
        });
        for (a, b) in whole.iter().zip(&parts) {
            assert_eq!(a.0, b.0, "{method}");
            assert!((a.1 - b.1).abs() < 1e-9, "{method}");
        }
    }
}

/// What is broken is written, and stays so.
#[test]
fn a_run_goes_on_from_the_scene_that_it_ended_with() {
    let mut scene = with(&brittle(12, 2), Method::VelocityVerlet, None, 1e-3);
    scene
        .springs
        .iter_mut()
        .for_each(|spring| spring.damping = 0.0);
    scene.settings.duration = 0.5;
    let mut first = Islands::new(&scene).unwrap();
    first.run(3, &mut ()).unwrap();
    let mut end = scene.clone();
    first.nodes().write_to(&mut end);
    first.write_memory_to(&mut end);
    let broken: Vec<usize> = first.breaks().iter().map(|one| one.spring).collect();
    assert!(broken.len() > 1, "{broken:?}");
    assert!(broken.iter().all(|&spring| end.springs[spring].broken));
    let text = scene_to_string(&end, &RunOptions::default());
    let (read, _) = parse_scene("final.ron", &text).unwrap();
    assert_eq!(read, end);

    let mut further = Islands::new(&read).unwrap();
    let mut look = Look::default();
    further.run(3, &mut look).unwrap();
    let marked = end.springs.iter().enumerate();
    let marked = marked.filter(|(_, spring)| spring.broken);
    let marked: Vec<usize> = marked.map(|(index, _)| index).collect();
    assert_eq!(look.members[0].1.broken, marked);
    // The same as in one go.
    scene.settings.duration = 1.0;
    let mut whole = Islands::new(&scene).unwrap();
    whole.run(6, &mut ()).unwrap();
    let mut both = broken;
    assert!(!further.breaks().is_empty());
    both.extend(further.breaks().iter().map(|one| one.spring));
    let whole_breaks: Vec<usize> = whole.breaks().iter().map(|one| one.spring).collect();
    assert_eq!(whole_breaks, both);
    let ends = whole
        .nodes()
        .positions
        .iter()
        .zip(&further.nodes().positions);
    for (a, b) in ends {
        assert!((a - b).norm() < 1e-9);
    }
}

/// Two springs pull a mass from both sides, beyond their limits; nothing moves until
/// they are found out to be broken at the start.
#[test]
fn what_is_beyond_its_limit_at_the_start_is_broken_there() {
    let mut scene = Scene {
        gravity: Vector3::z() * -9.81,
        ..Scene::default()
    };
    let middle = scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::zeros())
    });
    for x in [-1.0, 1.0] {
        let end = scene.add_node(Node::fixed(Vector3::x() * x));
        let spring = scene.add_spring(middle, end, 10.0);
        scene.springs[spring].rest_length = 0.5;
        scene.springs[spring].breaks_at = Some(BreakLimit::Strain(0.9));
    }
    scene.settings.duration = 0.1;
    let mut islands = Islands::new(&scene).unwrap();
    assert_eq!(islands.energy().total(), 0.0);
    islands.run(1, &mut ()).unwrap();
    let fallen = islands.nodes().positions[middle].z;
    assert!((fallen + 0.5 * 9.81 * 0.01).abs() < 1e-4, "{fallen}");
}

/// A spring so stiff that no step resolves it breaks by the tension that the method
/// carries, not by its length: under 1.5 of its weight it holds, under 0.5 it does not.
#[test]
fn unresolved_springs_break_by_their_tension() {
    for method in [
        Method::LinearlyImplicitEuler,
        Method::ImplicitEuler,
        Method::FilteredLeapfrog,
    ] {
        for (part, breaks) in [(2.5, false), (0.5, true)] {
            for by_strain in [false, true] {
                let (mut scene, weight, stiffness) = (Scene::default(), 9.81, 1e9);
                scene.gravity = Vector3::z() * -9.81;
                scene.add_node(Node::fixed(Vector3::zeros()));
                for node in 0..3 {
                    scene.add_node(Node {
                        mass: 1.0,
                        ..Node::at(Vector3::x() * f64::from(node + 1) / 3.0)
                    });
                }
                for node in 0..3 {
                    scene.add_spring(node, node + 1, stiffness);
                }
                // A pendulum that falls from the side has up to five weights in its
                // first link while it passes below.
                let force = 3.0 * weight * part;
                scene.springs[0].breaks_at = Some(if by_strain {
                    BreakLimit::Strain(force / (stiffness / 3.0))
                } else {
                    BreakLimit::Force(force)
                });
                scene.settings.duration = 0.35;
                let scene = with(&scene, method, None, 2e-3);
                let mut islands = Islands::new(&scene).unwrap();
                islands.run(1, &mut ()).unwrap();
                let n_broken = islands.breaks().len();
                assert_eq!(n_broken, usize::from(breaks), "{method}, {force} N");
            }
        }
    }
}

/// Where a thin line beside a stiff rod breaks, the rod goes on with the tension that it had.
/// So far from the origin rounding makes 2 kN of its length.
#[test]
fn the_others_keep_their_tensions_when_one_breaks() {
    let origin = Vector3::x() * 1e4;
    for method in [Method::ImplicitEuler, Method::TrBdf2] {
        let mut scene = Scene {
            gravity: Vector3::z() * -9.81,
            ..Scene::default()
        };
        scene.add_node(Node::fixed(origin));
        scene.add_node(Node {
            mass: 1.0,
            ..Node::at(origin + Vector3::x())
        });
        scene.add_node(Node::fixed(origin + Vector3::z()));
        scene.add_spring(0, 1, 1e15);
        let line = scene.add_spring(2, 1, 1e-3);
        scene.springs[line].breaks_at = Some(BreakLimit::Strain(0.2));
        scene.settings.duration = 0.6;
        let scene = with(&scene, method, None, 2e-3);
        let mut look = Look::default();
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(300, &mut look).unwrap();
        assert_eq!(islands.breaks().len(), 1);
        // Of a rigid rod it is 3 m g cos θ. Methods are late, but evenly.
        let late = look.members.iter().map(|(_, members, x)| {
            let rigid = -3.0 * 9.81 * x[1].z;
            members.tensions[0] - rigid
        });
        let late: Vec<f64> = late.collect();
        for (pair, (time, ..)) in late.windows(2).zip(&look.members) {
            let jump = (pair[1] - pair[0]).abs();
            // By up to 5e-3 N a step, and one rounding of a velocity, K h ε v, is 2e-3 N.
            assert!(jump < 1e-2, "{method} at {time}: {jump}");
        }
    }
}
