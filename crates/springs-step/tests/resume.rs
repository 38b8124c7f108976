//! A run that was stopped, saved and resumed gives the same bits as one that
//! never stopped.

mod common;

use common::laws::with_mixed_laws;
use common::{append, tangle};
use nalgebra::Vector3;
use springs_scene::generate::{Material, block, cloth};
use springs_scene::{BreakLimit, Method, Node, RunOptions, Scene, SpringLaw, StepControl, Tangent};
use springs_step::{Account, Frame, Islands, NodeStates, Observer, Outcome};
use std::ops::ControlFlow;

/// Remembers frames, and stops after some calls, whichever they are.
#[derive(Default)]
struct Watcher {
    frames: Vec<(usize, f64, NodeStates)>,
    accounts: Vec<Account>,
    calls_left: Option<usize>,
}

impl Watcher {
    fn count(&mut self) -> ControlFlow<()> {
        match &mut self.calls_left {
            Some(0) => ControlFlow::Break(()),
            Some(left) => {
                *left -= 1;
                ControlFlow::Continue(())
            }
            None => ControlFlow::Continue(()),
        }
    }
}

impl Observer for Watcher {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.frames
            .push((frame.index, frame.time, frame.nodes.clone()));
        self.count()
    }

    fn wants_account(&self) -> bool {
        true
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        self.accounts.push(account);
        self.count()
    }

    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        self.count()
    }
}

const INTERVALS: usize = 7;

/// Runs a scene through, and with a stop every few steps, each time in a
/// simulation made anew; frames, end and counts must agree, but for the
/// factorizations that are returned.
fn check(scene: &Scene, every: usize) -> u64 {
    check_with(scene, &RunOptions::default(), every)
}

fn check_with(scene: &Scene, options: &RunOptions, every: usize) -> u64 {
    let what = format!("{}, {}", scene.name, scene.settings.method);
    let mut through = Watcher::default();
    let mut islands = Islands::with_options(scene, options).unwrap();
    islands.run(INTERVALS, &mut through).unwrap();

    let mut watcher = Watcher::default();
    let mut resumed = Islands::with_options(scene, options).unwrap();
    let mut stops = 0;
    loop {
        watcher.calls_left = Some(every);
        if resumed.run(INTERVALS, &mut watcher).unwrap() == Outcome::Finished {
            break;
        }
        let words = resumed.save();
        resumed = Islands::with_options(scene, options).unwrap();
        resumed.restore(words).unwrap();
        stops += 1;
        assert!(stops < 10_000, "{what} gets on");
    }
    assert!(stops > 1, "{what} was stopped {stops} times");
    assert_eq!(watcher.frames, through.frames, "{what}");
    assert_eq!(watcher.accounts, through.accounts, "{what}");
    assert_eq!(resumed.nodes(), islands.nodes(), "{what}");
    assert_eq!(resumed.energy(), islands.energy(), "{what}");
    assert_eq!(resumed.ledger(), islands.ledger(), "{what}");
    assert_eq!(resumed.breaks(), islands.breaks(), "{what}");
    // A matrix that happens to equal the one before is made again after a stop.
    let [mut after, before] = [&resumed, &islands].map(|islands| islands.work().counts);
    let again = after.factorizations - before.factorizations;
    assert!(again <= stops, "{what}: {again} after {stops} stops");
    after.factorizations = before.factorizations;
    assert_eq!(after, before, "{what}");
    assert_eq!(
        resumed.trial_work().counts,
        islands.trial_work().counts,
        "{what}"
    );
    again
}

fn undamped(n_nodes: usize, seed: u64) -> Scene {
    let mut scene = tangle(n_nodes, seed);
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    scene
}

#[test]
fn every_method_in_steps_of_fixed_size() {
    for &method in Method::ALL {
        let mut scene = undamped(9, 3);
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(2e-3);
        // The last step is shorter.
        scene.settings.duration = 0.0433;
        check(&scene, 3);
    }
}

#[test]
fn springs_with_laws() {
    for &method in Method::ALL {
        let mut scene = with_mixed_laws(undamped(9, 3), 8);
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(2e-3);
        scene.settings.duration = 0.0433;
        check(&scene, 3);
    }
    // Parts, dashpots that fade, and steps by the error.
    let mut scene = with_mixed_laws(tangle(7, 5), 2);
    append(&mut scene, &with_mixed_laws(tangle(6, 6), 3));
    scene.settings.step = StepControl::Tolerance(1e-4);
    scene.settings.duration = 0.2;
    for method in [Method::Auto, Method::TrBdf2, Method::Dop853] {
        scene.settings.method = method;
        check(&scene, 3);
    }
}

/// Some of which break on the way.
#[test]
fn springs_that_break() {
    let brittle = |mut scene: Scene| {
        for (k, spring) in scene.springs.iter_mut().enumerate().step_by(2) {
            let more = k as f64 / 10.0;
            spring.breaks_at = Some(match k % 4 {
                0 => BreakLimit::Strain(0.4 + 0.1 * more),
                _ => BreakLimit::Force(9.0 + more),
            });
        }
        scene
    };
    let check = |scene: &Scene, every: usize| {
        check(scene, every);
        let mut islands = Islands::new(scene).unwrap();
        islands.run(INTERVALS, &mut ()).unwrap();
        let n_broken = islands.breaks().len();
        let (name, method) = (&scene.name, scene.settings.method);
        assert!(n_broken > 0, "{name}, {method}: {n_broken} broke");
    };
    for &method in Method::ALL {
        let mut scene = brittle(undamped(9, 3));
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(5e-3);
        scene.settings.duration = 0.2433;
        check(&scene, 3);
    }
    let mut scene = brittle(tangle(7, 5));
    append(&mut scene, &brittle(tangle(6, 6)));
    scene.settings.duration = 0.5;
    for step in [StepControl::Fixed(4e-3), StepControl::Tolerance(1e-3)] {
        scene.settings.step = step;
        for method in [Method::Auto, Method::TrBdf2, Method::ImplicitEuler] {
            scene.settings.method = method;
            check(&scene, 3);
        }
    }
}

#[test]
fn springs_that_yield() {
    for &method in Method::ALL {
        let mut scene = undamped(9, 3);
        scene.laws = vec![SpringLaw::Plastic {
            yields_at: 3.0,
            hardening: 1.0,
        }];
        for spring in scene.springs.iter_mut().step_by(2) {
            spring.law = Some(0);
        }
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(5e-3);
        scene.settings.duration = 0.1433;
        check(&scene, 3);
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(INTERVALS, &mut ()).unwrap();
        assert!(islands.ledger().broken_energy > 0.1, "{method}");
    }
}

#[test]
fn every_tangent() {
    for &tangent in Tangent::ALL {
        let mut scene = tangle(9, 4);
        scene.settings.method = Method::LinearlyImplicitEuler;
        scene.settings.tangent = Some(tangent);
        scene.settings.step = StepControl::Fixed(1e-2);
        scene.settings.duration = 0.3;
        check(&scene, 4);
    }
}

#[test]
fn every_method_with_a_tolerance() {
    for &method in Method::ALL {
        let mut scene = undamped(9, 5);
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(2e-3);
        scene.settings.duration = 0.2;
        check(&scene, 5);
    }
}

/// Methods change on the way.
#[test]
fn automatic_choice() {
    let mut scene = common::moving::moving_scenes()
        .into_iter()
        .find(|scene| {
            let mut scene = scene.clone();
            scene.settings.method = Method::Auto;
            scene.settings.step = StepControl::Tolerance(1e-4);
            let mut islands = Islands::new(&scene).unwrap();
            islands.run(1, &mut ()).unwrap();
            let parts = islands.parts().iter();
            parts
                .map(|part| part.simulation().switches().len())
                .sum::<usize>()
                > 0
        })
        .expect("a scene on which methods change");
    scene.settings.method = Method::Auto;
    scene.settings.step = StepControl::Tolerance(1e-4);
    check(&scene, 9);
}

/// Matrices that are made once are not counted again.
#[test]
fn constant_matrices() {
    let mut scene = undamped(8, 6);
    for spring in &mut scene.springs {
        spring.rest_length = 0.0;
    }
    scene.settings.step = StepControl::Fixed(1e-2);
    scene.settings.duration = 0.2;
    for method in [Method::LinearlyImplicitEuler, Method::ImplicitMidpoint] {
        scene.settings.method = method;
        assert_eq!(check(&scene, 4), 0, "{method}");
    }
}

/// On a line, too, whose direction is rounded otherwise wherever its nodes are.
#[test]
fn matrices_on_an_oblique_line() {
    let mut scene = Scene {
        gravity: Vector3::new(1.5, 1.0, -1.0),
        ..Scene::default()
    };
    for i in 0..6 {
        scene.add_node(Node {
            mass: 0.3 + 0.1 * f64::from(i),
            fixed: i == 0,
            ..Node::at(Vector3::new(1.5, 1.0, -1.0) * (0.1 * f64::from(i)))
        });
    }
    for i in 0..5 {
        scene.add_spring(i, i + 1, 80.0 + 7.0 * i as f64);
    }
    scene.settings.duration = 1.0;
    for method in [
        Method::LinearlyImplicitEuler,
        Method::ImplicitMidpoint,
        Method::FilteredLeapfrog,
    ] {
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(0.03);
        assert_eq!(check(&scene, 4), 0, "{method}");
    }
    scene.settings.method = Method::TrBdf2;
    scene.settings.step = StepControl::Tolerance(1e-4);
    check(&scene, 4);
}

/// Several parts, and frames between their steps.
#[test]
fn islands() {
    let mut scene = undamped(6, 1);
    append(&mut scene, &undamped(7, 2));
    scene.settings.method = Method::Auto;
    scene.settings.duration = 0.4;
    for step in [StepControl::Fixed(1e-3), StepControl::Tolerance(1e-4)] {
        scene.settings.step = step;
        check(&scene, 11);
    }
}

/// Parts that fall asleep on the way, beside one that does not.
#[test]
fn parts_that_fall_asleep() {
    let mut scene = undamped(6, 1);
    for (first, damping) in [(10.0, 2.0), (20.0, 4.0)] {
        let at = |x: f64, y: f64, z: f64| Vector3::new(first + x, y, z);
        let mass = scene.add_node(Node {
            mass: 1.0,
            ..Node::at(at(0.1, 0.2, 0.3))
        });
        for anchor in [at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0), at(0.0, 0.0, 1.0)] {
            let anchor = scene.add_node(Node::fixed(anchor));
            let spring = scene.add_spring(mass, anchor, 100.0);
            scene.springs[spring].damping = damping;
        }
    }
    scene.settings.method = Method::TrBdf2;
    scene.settings.duration = 8.0;
    let options = RunOptions::default().with_sleep(1e-2);
    for step in [StepControl::Fixed(2e-2), StepControl::Tolerance(1e-2)] {
        scene.settings.step = step;
        let mut islands = Islands::with_options(&scene, &options).unwrap();
        islands.run(INTERVALS, &mut ()).unwrap();
        let asleep = islands.parts().iter();
        let asleep = asleep
            .filter(|part| part.asleep_since() > Some(0.0))
            .count();
        assert_eq!(asleep, 2, "{step:?}");
        check_with(&scene, &options, 60);
    }
}

/// The strategy of the solver depends on the matrices before.
#[test]
fn large_scenes_with_iterative_solvers() {
    let mut scenes = [
        cloth(48, Material::of_cloth()),
        block(11, Material::of_block()),
    ];
    for scene in &mut scenes {
        scene.settings.method = Method::LinearlyImplicitEuler;
        scene.settings.step = StepControl::Fixed(1.0 / 60.0);
        scene.settings.duration = 0.4;
        check(scene, 5);
    }
}

/// Stages that are solved only after their first correction failed: a massless node is drawn
/// to the other one, until steps get too small.
#[test]
fn steps_that_fail() {
    let mut scene = Scene::default();
    for (z, mass) in [(0.0, 0.0), (-2.0, 7.430033485354642)] {
        scene.add_node(Node {
            mass,
            ..Node::at(Vector3::new(0.0, 0.0, z))
        });
    }
    scene.add_spring(0, 1, 0.1);
    scene.springs[0].rest_length = 1e-5;
    scene.settings.duration = 0.01;
    for stop in 1..12 {
        let mut islands = Islands::new(&scene).unwrap();
        let mut watcher = Watcher {
            calls_left: Some(stop),
            ..Watcher::default()
        };
        assert_eq!(islands.run(1, &mut watcher), Ok(Outcome::Stopped));
        let mut resumed = Islands::new(&scene).unwrap();
        resumed.restore(islands.save()).unwrap();
        let [through, again] = [&mut islands, &mut resumed].map(|islands| {
            let error = islands.run(1, &mut Watcher::default()).unwrap_err();
            let counts = islands.work().counts;
            let matrices = (counts.linearizations, counts.solves, counts.clamped_springs);
            (error, islands.nodes().clone(), matrices)
        });
        assert_eq!(through, again, "after {stop}");
    }
}

#[test]
fn the_state_of_another_scene_is_refused() {
    let scene = undamped(9, 3);
    let words = Islands::new(&scene).unwrap().save();
    let other = undamped(10, 3);
    assert!(
        Islands::new(&other)
            .unwrap()
            .restore(words.clone())
            .is_err()
    );
    for length in [0, 1, words.len() / 2, words.len() - 1] {
        let mut islands = Islands::new(&scene).unwrap();
        assert!(islands.restore(words[..length].to_vec()).is_err());
    }
    assert!(Islands::new(&scene).unwrap().restore(words).is_ok());
}
