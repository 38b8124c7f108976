//! Simulations that are asked to stop, within steps and trial runs too, and go on
//! as if nothing had been.

mod common;

use common::{append, tangle};
use nalgebra::Vector3;
use springs_scene::generate::{Material, block, cloth};
use springs_scene::{Method, Node, Scene, StepControl};
use springs_solver::Interrupt;
use springs_step::{Cause, Frame, Islands, Observer, Outcome, Patience, Simulation};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Runs a scene through while it is asked to stop at many moments; says how often
/// it did.
fn run_with_interrupts(islands: &mut Islands, flag: &Arc<AtomicBool>) -> u32 {
    islands.set_interrupt(&Interrupt::from(flag.clone()));
    let is_done = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            // Longer and longer, so that it gets on.
            for pause in 0.. {
                if is_done.load(Ordering::SeqCst) {
                    return;
                }
                thread::sleep(Duration::from_micros(200 + 97 * pause));
                flag.store(true, Ordering::SeqCst);
            }
        });
        let mut stops = 0;
        while islands.run(5, &mut ()).unwrap() == Outcome::Stopped {
            flag.store(false, Ordering::SeqCst);
            stops += 1;
        }
        is_done.store(true, Ordering::SeqCst);
        stops
    })
}

fn undamped(mut scene: Scene) -> Scene {
    for spring in &mut scene.springs {
        spring.damping = 0.0;
    }
    scene
}

/// Large enough for steps of some milliseconds, and stiff enough for several
/// iterations.
fn stiff_scenes() -> [Scene; 2] {
    let mut scenes = [
        undamped(cloth(10, Material::of_cloth())),
        undamped(block(5, Material::of_block())),
    ];
    for scene in &mut scenes {
        for spring in &mut scene.springs {
            spring.stiffness *= 100.0;
        }
        scene.settings.duration = 0.05;
    }
    scenes
}

#[test]
fn an_interrupted_step_leaves_no_trace() {
    let mut stops = 0;
    for scene in stiff_scenes() {
        for &method in Method::ALL {
            for step in [StepControl::Fixed(5e-3), StepControl::Tolerance(3e-3)] {
                let mut scene = scene.clone();
                (scene.settings.method, scene.settings.step) = (method, step);
                let mut through = Islands::new(&scene).unwrap();
                if through.run(5, &mut ()).is_err() {
                    // Too long for an explicit method.
                    continue;
                }
                let mut islands = Islands::new(&scene).unwrap();
                stops += run_with_interrupts(&mut islands, &Arc::default());
                let what = format!("{method}, {step:?}");
                assert_eq!(islands.nodes(), through.nodes(), "{what}");
                let counts = [&islands, &through].map(|islands| islands.work().counts);
                assert_eq!(counts[0], counts[1], "{what}");
            }
        }
    }
    assert!(stops > 50, "{stops} stops");
}

#[test]
fn several_parts_are_interrupted_together() {
    let mut scene = undamped(tangle(9, 1));
    for seed in 2..6 {
        append(&mut scene, &undamped(tangle(9, seed)));
    }
    scene.settings.duration = 0.5;
    for method in [Method::TrBdf2, Method::VelocityVerlet, Method::Auto] {
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(1e-4);
        let mut through = Islands::new(&scene).unwrap();
        through.run(5, &mut ()).unwrap();
        let mut islands = Islands::new(&scene).unwrap();
        run_with_interrupts(&mut islands, &Arc::default());
        assert_eq!(islands.nodes(), through.nodes(), "{method}");
        assert_eq!(islands.ledger(), through.ledger(), "{method}");
    }
}

/// Stops trial runs after so many of their steps.
struct Trials {
    steps: u64,
    most: u64,
}

impl Observer for Trials {
    fn trial(&mut self, steps: u64) -> ControlFlow<()> {
        self.steps = steps;
        if steps >= self.most {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

#[test]
fn trial_runs_belong_to_the_first_run_and_can_be_stopped() {
    let mut scene = undamped(tangle(9, 7));
    scene.settings.duration = 0.3;
    scene.settings.step = StepControl::Tolerance(1e-3);
    for method in [
        Method::Auto,
        Method::ImplicitMidpoint,
        Method::FilteredLeapfrog,
    ] {
        scene.settings.method = method;
        let mut through = Islands::new(&scene).unwrap();
        assert!(through.needs_trials(), "{method}");
        assert_eq!(through.trial_work().counts, Default::default(), "{method}");
        through.run(3, &mut ()).unwrap();
        assert!(!through.needs_trials() && through.trial_work().counts.force_evaluations > 0);

        let mut islands = Islands::new(&scene).unwrap();
        for most in [1, 3] {
            let mut trials = Trials { steps: 0, most };
            assert_eq!(islands.run(3, &mut trials), Ok(Outcome::Stopped));
            assert_eq!(trials.steps, most, "{method}");
            assert!(islands.needs_trials() && islands.time() == 0.0, "{method}");
            // What is saved then makes them itself.
            let words = islands.save();
            islands = Islands::new(&scene).unwrap();
            islands.restore(words).unwrap();
        }
        islands.run(3, &mut ()).unwrap();
        assert_eq!(islands.nodes(), through.nodes(), "{method}");
        let reasons = [&islands, &through].map(|islands| {
            let choice = islands.largest().simulation().choice();
            (choice.method, choice.reason.clone())
        });
        assert_eq!(reasons[0], reasons[1]);
    }
}

/// Counts steps, and stops after the first.
#[derive(Default)]
struct FirstStep {
    trials: u64,
}

impl Observer for FirstStep {
    fn trial(&mut self, steps: u64) -> ControlFlow<()> {
        self.trials = steps;
        ControlFlow::Continue(())
    }

    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        ControlFlow::Break(())
    }
}

#[test]
fn what_trial_runs_settled_is_saved() {
    for method in [Method::Auto, Method::ImplicitMidpoint] {
        let mut scene = undamped(tangle(9, 8));
        scene.settings.duration = 0.3;
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(1e-3);
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(3, &mut FirstStep::default()).unwrap();
        let words = islands.save();
        let mut resumed = Islands::new(&scene).unwrap();
        resumed.restore(words).unwrap();
        assert!(!resumed.needs_trials());
        let mut again = FirstStep::default();
        resumed.run(3, &mut again).unwrap();
        assert_eq!(again.trials, 0, "{method}");
        assert_eq!(resumed.trial_work().counts, islands.trial_work().counts);
    }
}

/// A mass so fast that no step can be made.
#[test]
fn trial_runs_that_always_fail_are_given_up() {
    let mut scene = undamped(tangle(4, 1));
    scene.nodes[1].velocity.x = 1e20;
    scene.settings.method = Method::FilteredLeapfrog;
    scene.settings.step = StepControl::Tolerance(1e-3);
    let mut simulation = Simulation::new(&scene).unwrap();
    let mut trials = Trials {
        steps: 0,
        most: u64::MAX,
    };
    let error = simulation.run(1, &mut trials).unwrap_err();
    assert_eq!(error.cause, Cause::NotReached);
    assert!(trials.steps < 1_000_000, "{} steps", trials.steps);
    assert!(error.to_string().contains("equal steps"), "{error}");
}

/// One step with 6e10 frames in it.
#[test]
fn frames_within_one_step_are_interrupted() {
    let mut scene = Scene::default();
    scene.nodes.push(Node {
        mass: 1.0,
        ..Node::at(Vector3::zeros())
    });
    scene.settings.method = Method::TrBdf2;
    scene.settings.step = StepControl::Fixed(1e9);
    scene.settings.duration = 1e9;
    let flag = Arc::new(AtomicBool::new(false));
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.set_interrupt(&Interrupt::from(flag.clone()));
    let raise = thread::spawn(move || {
        thread::sleep(Duration::from_millis(20));
        flag.store(true, Ordering::SeqCst);
    });
    let outcome = simulation.run(60_000_000_000, &mut ());
    assert_eq!(outcome, Ok(Outcome::Stopped));
    raise.join().unwrap();
}

/// Three nodes on two pendulums that are not coupled.
fn two_pendulums() -> Scene {
    let mut scene = Scene::default();
    scene.gravity.z = -9.81;
    scene.nodes.push(Node::fixed(Vector3::zeros()));
    for (x, z, stiffness) in [(1.0, 0.0, 100.0), (-1.0, 0.5, 50.0)] {
        scene.nodes.push(Node {
            mass: 1.0,
            ..Node::at(Vector3::new(x, 0.0, z))
        });
        let node = scene.nodes.len() - 1;
        scene.add_spring(0, node, stiffness);
    }
    scene
}

/// Wants to be told every hundred steps, or every so many seconds.
struct Every {
    steps: u64,
    seconds: f64,
    last: (f64, u64),
    most: (f64, u64),
}

impl Observer for Every {
    fn patience(&self) -> Patience {
        Patience {
            steps: self.last.1.saturating_add(self.steps),
            time: self.last.0 + self.seconds,
        }
    }

    fn step(&mut self, time: f64, steps: u64) -> ControlFlow<()> {
        self.most.0 = self.most.0.max(time - self.last.0);
        self.most.1 = self.most.1.max(steps - self.last.1);
        self.last = (time, steps);
        ControlFlow::Continue(())
    }
}

#[test]
fn observers_of_several_parts_are_called_when_they_want_to() {
    let mut scene = two_pendulums();
    scene.settings.method = Method::TrBdf2;
    scene.settings.step = StepControl::Fixed(1e-3);
    scene.settings.duration = 3.0;
    for (steps, seconds) in [(7, f64::INFINITY), (u64::MAX, 0.01)] {
        let mut every = Every {
            steps,
            seconds,
            last: (0.0, 0),
            most: (0.0, 0),
        };
        let mut islands = Islands::new(&scene).unwrap();
        assert_eq!(islands.parts().len(), 2);
        islands.run(1, &mut every).unwrap();
        assert!(every.most.1 <= steps, "{:?}", every.most);
        assert!(every.most.0 <= seconds + 1.001e-3, "{:?}", every.most);
    }
}

/// Stops after some frames.
struct SomeFrames(usize);

impl Observer for SomeFrames {
    fn frame(&mut self, _frame: Frame<'_>) -> ControlFlow<()> {
        self.0 -= 1;
        if self.0 == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// One part fails late; the others come back to its time without beginning again.
#[test]
fn parts_come_back_to_the_time_of_one_that_failed() {
    let mut scene = two_pendulums();
    // Stable for small vibrations only, which grow.
    scene.settings.method = Method::VelocityVerlet;
    scene.settings.step = StepControl::Fixed(1e-3);
    scene.settings.duration = 20.0;
    scene.springs[1].stiffness = 4.001e6;
    let mut islands = Islands::new(&scene).unwrap();
    islands.run(1, &mut SomeFrames(1)).unwrap();
    let error = islands.run(1, &mut ()).unwrap_err();
    assert_eq!(error.node, 2, "{error}");
    assert_eq!(islands.time(), error.time);
    // The other one is where it is when it is alone.
    let mut alone = scene.clone();
    alone.springs.truncate(1);
    alone.nodes.truncate(2);
    alone.settings.duration = error.time;
    let mut expected = Islands::new(&alone).unwrap();
    expected.run(1, &mut ()).unwrap();
    assert_eq!(islands.nodes().positions[1], expected.nodes().positions[1]);
}

/// A column between two anchors buckles while they close in, where RODAS4 has no
/// step; the mass beside it began its last step at that very time.
#[test]
fn parts_whose_step_begins_where_another_one_fails_stay_there() {
    let mut scene = Scene::default();
    for (x, velocity) in [(0.0, 0.0), (1.0, 0.0), (2.0, -0.5)] {
        scene.add_node(Node {
            fixed: x != 1.0,
            mass: 1.0,
            velocity: velocity * Vector3::x(),
            ..Node::at(x * Vector3::x())
        });
    }
    scene.add_spring(0, 1, 1e4);
    scene.add_spring(1, 2, 1e4);
    scene.add_node(Node {
        mass: 1.0,
        velocity: Vector3::y(),
        ..Node::at(5.0 * Vector3::x())
    });
    scene.settings.method = Method::Rodas4;
    scene.settings.step = StepControl::Fixed(0.0625);
    let mut islands = Islands::new(&scene).unwrap();
    assert_eq!(islands.parts().len(), 2);
    let error = islands.run(1, &mut ()).unwrap_err();
    assert_eq!(error.cause, Cause::NotPositiveDefinite);
    assert_eq!(islands.time(), error.time);
    let flown = islands.nodes().positions[3].y;
    assert!(
        (flown - error.time).abs() < 1e-14,
        "{flown} at {}",
        error.time
    );
    let words = islands.save();
    assert_eq!(Islands::new(&scene).unwrap().restore(words), Ok(()));
}
