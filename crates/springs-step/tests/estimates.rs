//! Error estimates, trial runs and Newton's method where they are easily fooled:
//! moving frames of reference, moving anchors, massless nodes, distant nodes,
//! vibrations that steps do not resolve.

mod common;

use common::moving::{
    dumbbell, moving_scenes, pendulum, thrown_past_hook, towed, without_middle_mass,
};
use common::{after, distance, reference, solved, with};
use nalgebra::Vector3;
use springs_scene::{Method, Node, RunOptions, Scene, StepControl};
use springs_step::{Frame, Observer, Outcome, Simulation};
use std::ops::ControlFlow;

/// The same scene seen by somebody who moves along x at −`velocity`.
fn boosted(mut scene: Scene, velocity: f64) -> Scene {
    for node in &mut scene.nodes {
        node.velocity.x += velocity;
    }
    scene
}

/// Positions at the end and the steps made.
fn run(scene: &Scene, method: Method, tolerance: f64) -> (Vec<Vector3<f64>>, u64) {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.step = StepControl::Tolerance(tolerance);
    let mut simulation = Simulation::new(&scene).expect("a sound scene");
    simulation.run(1, &mut ()).expect("a run");
    let steps = simulation.work().counts.steps;
    (simulation.nodes().positions.clone(), steps)
}

/// Filtered leapfrog starts without the vibration of a stretched spring, and steps that do not
/// resolve one do not show it: trial runs agree, and are not believed where the tolerance
/// does not allow that. Against l₀ + A cos ωt + v/ω sin ωt, ω² = 2K/m.
#[test]
fn vibrations_that_are_left_out_count() {
    for (stiffness, stretch, speed) in [(1e4f64, 0.01, 0.0), (1e6, 0.0, 0.5)] {
        let mut scene = dumbbell(stiffness, stretch, 0.0);
        scene.nodes[0].velocity.x = -0.5 * speed;
        scene.nodes[1].velocity.x = 0.5 * speed;
        scene.settings.duration = 0.33;
        let angle = (2.0 * stiffness).sqrt();
        let largest = stretch.hypot(speed / angle);
        let phase = angle * scene.settings.duration;
        let expected = 1.0 + stretch * phase.cos() + speed / angle * phase.sin();
        for tolerance in [3.0 * largest, 0.3 * largest, 0.03 * largest] {
            let (x, steps) = run(&scene, Method::FilteredLeapfrog, tolerance);
            let error = 0.5 * ((x[1] - x[0]).norm() - expected).abs();
            assert!(error < tolerance, "{stiffness:e}, {tolerance:e}: {error:e}");
            let resolving = angle * scene.settings.duration;
            assert_eq!(steps as f64 > resolving, tolerance < largest, "{steps}");
        }
    }
}

/// The length of the dumbbell follows l₀ + A cos √(2K/m) t in every frame of
/// reference, with the same steps.
#[test]
fn estimates_do_not_depend_on_the_frame_of_reference() {
    for (stiffness, amplitude) in [(1e2f64, 0.05), (1e4, 0.01)] {
        let angle: f64 = (2.0 * stiffness).sqrt();
        let exact = 1.0 + amplitude * angle.cos();
        for method in [
            Method::TrBdf2,
            Method::Dop853,
            Method::Rodas4,
            Method::VelocityVerlet,
            Method::BlanesMoan4,
            Method::BlanesMoan6,
        ] {
            let mut of_rest = 0;
            for velocity in [0.0, 1e2, 1e4] {
                let scene = dumbbell(stiffness, amplitude, velocity);
                for tolerance in [1e-2, 1e-4] {
                    let (x, steps) = run(&scene, method, tolerance);
                    let error = ((x[1] - x[0]).norm() - exact).abs();
                    let what = format!("{}, {method}, {tolerance:e}: {error:e}", scene.name);
                    // Both ends may be off by the tolerance.
                    assert!(error < 2.0 * tolerance, "{what}");
                    if tolerance == 1e-4 {
                        of_rest = if velocity == 0.0 { steps } else { of_rest };
                        let ratio = steps as f64 / of_rest as f64;
                        assert!((0.9..1.1).contains(&ratio), "{what}, {steps} steps");
                    }
                }
            }
        }
    }
}

/// x = Vt − V/ω sin ωt: forces hardly change, so the error of velocities is next
/// to nothing, and that of positions is all there is.
#[test]
fn errors_of_positions_are_estimated() {
    let (omega, velocity, duration) = (1e-2f64, 100.0, 10.0);
    let exact = velocity * duration - velocity / omega * (omega * duration).sin();
    for method in [Method::TrBdf2, Method::Dop853, Method::Rodas4] {
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6] {
            let error = (run(&towed(), method, tolerance).0[1].x - exact).abs();
            assert!(error < tolerance, "{method}, {tolerance:e}: {error:e}");
        }
    }
}

/// The velocity that a short encounter leaves is wrong for all the time after it.
#[test]
fn errors_of_velocities_count_for_as_long_as_they_last() {
    for (closest, stiffness, duration) in [(1e-3, 0.3, 1.0), (1e-3, 3.0, 1.0), (1e-2, 3e-3, 10.0)] {
        let scene = thrown_past_hook(closest, stiffness, duration);
        let (exact, trusted) = common::reference(&scene);
        assert!(trusted < 1e-10);
        for method in [
            Method::VelocityVerlet,
            Method::BlanesMoan4,
            Method::BlanesMoan6,
            Method::ImplicitEuler,
            Method::LinearlyImplicitEuler,
        ] {
            let is_of_order_1 = matches!(
                method,
                Method::ImplicitEuler | Method::LinearlyImplicitEuler
            );
            for k in 2..=if is_of_order_1 { 4 } else { 6 } {
                let tolerance = 10f64.powi(-k);
                let (x, steps) = run(&scene, method, tolerance);
                let error = distance(&x, &exact);
                let what = format!("{}, {method}: {error:e} in {steps} steps", scene.name);
                assert!(error < 2.0 * tolerance, "{what}, {tolerance:e}");
            }
        }
    }
}

/// Errors of vibrations do not last: what they are weighed by does not grow with the
/// slow swing on top of them. Velocity Verlet is bound by stability here: how many steps
/// it makes depends on what vibrations rounding excites.
#[test]
fn errors_of_velocities_in_vibrations_do_not_shorten_steps() {
    for (method, most) in [(Method::BlanesMoan4, 12_000), (Method::BlanesMoan6, 3_300)] {
        let (_, steps) = run(&pendulum(1e8), method, 1e-6);
        assert!(steps < most, "{method}: {steps} steps");
    }
}

/// Two springs in a row are one of half the stiffness, also where the node
/// between them has no mass and starts out of balance.
#[test]
fn massless_nodes_may_start_out_of_balance() {
    let (two, one) = without_middle_mass();
    let exact = solved(&one, Method::Dop853, 1e-10)[1];
    for method in [
        Method::TrBdf2,
        Method::ImplicitMidpoint,
        Method::FilteredLeapfrog,
    ] {
        for tolerance in [1e-2, 1e-3, 1e-4] {
            let (x, steps) = run(&two, method, tolerance);
            let error = (x[1] - exact).norm();
            let what = format!("{method}, {tolerance:e}: {error:e} in {steps} steps");
            assert!(error < tolerance, "{what}");
            // It stays in the middle: nothing rings.
            let middle = (x[2] - 0.5 * x[1]).norm();
            assert!(
                middle < 0.1 * tolerance,
                "{what}, {middle:e} off the middle"
            );
        }
    }
}

/// A start out of balance does not cost the order.
#[test]
fn the_order_is_kept_from_a_start_out_of_balance() {
    let (two, one) = without_middle_mass();
    let exact = solved(&one, Method::Dop853, 1e-11)[1];
    for method in [Method::TrBdf2, Method::ImplicitMidpoint] {
        let error = |steps: usize| {
            let scene = with(&two, method, None, 1.0 / steps as f64);
            (after(&scene, steps).positions[1] - exact).norm()
        };
        let order = (error(200) / error(400)).log2();
        assert!((order - 2.0).abs() < 0.1, "{method}: {order}");
    }
}

/// Steps that do not divide the duration are made equal: what the springs hold
/// would be let go by a shorter last one, which kicks the masses.
#[test]
fn filtered_leapfrog_keeps_its_step() {
    let velocity_at = |duration: f64| {
        let mut scene = with(&pendulum(1e8), Method::FilteredLeapfrog, None, 0.01);
        scene.settings.duration = duration;
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        simulation.nodes().velocities[1]
    };
    let whole = velocity_at(1.0);
    for duration in [1.0001, 1.001, 1.005] {
        // The pendulum itself changes its velocity by 10 m/s² at most.
        let change = (velocity_at(duration) - whole).norm();
        assert!(
            change < 0.01 + 10.0 * (duration - 1.0),
            "{duration}: {change}"
        );
    }
}

/// Newton's method ends by the rounding of what the springs join. A standing node
/// far away, which nothing holds, changes no bit.
#[test]
fn distant_nodes_without_springs_change_nothing() {
    let run = |scene: &Scene, method| {
        let nodes = after(&with(scene, method, None, 0.01), 50);
        (nodes.positions[1], nodes.velocities[1])
    };
    let alone = pendulum(1e5);
    for distance in [1e9, 1e12] {
        let mut scene = alone.clone();
        scene.add_node(Node::fixed(Vector3::new(distance, 0.0, 0.0)));
        for method in [Method::TrBdf2, Method::ImplicitEuler] {
            assert_eq!(run(&scene, method), run(&alone, method), "{method}");
        }
    }
}

/// Nor does a stretched spring between fixed nodes, whatever its energy.
#[test]
fn springs_between_fixed_nodes_change_nothing() {
    let run = |scene: &Scene| {
        let nodes = after(&with(scene, Method::ImplicitEuler, None, 1.0), 20);
        (nodes.positions[1], nodes.velocities[1])
    };
    let alone = pendulum(1e3);
    let mut scene = alone.clone();
    let a = scene.add_node(Node::fixed(Vector3::new(5.0, 0.0, 0.0)));
    let b = scene.add_node(Node::fixed(Vector3::new(7.0, 0.0, 0.0)));
    let spring = scene.add_spring(a, b, 1e12);
    scene.springs[spring].rest_length = 1.0;
    assert_eq!(run(&scene), run(&alone));
}

/// Largest distance of node 1 from (1, 0, 0) in the frames.
struct Reach(f64);

impl Observer for Reach {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let distance = (frame.nodes.positions[1] - Vector3::x()).norm();
        self.0 = self.0.max(distance);
        ControlFlow::Continue(())
    }
}

/// A mass that swings by 1 mm on a very stiff spring is never further off, also
/// between steps that do not resolve that.
#[test]
fn frames_between_long_steps_stay_where_the_motion_is() {
    for method in [Method::ImplicitMidpoint, Method::FilteredLeapfrog] {
        let mut scene = with(&Scene::default(), method, None, 0.05);
        scene.settings.duration = 2.0;
        scene.add_node(Node::fixed(Vector3::zeros()));
        scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::new(1.001, 0.0, 0.0))
        });
        scene.add_spring(0, 1, 1e8);
        scene.springs[0].rest_length = 1.0;
        let mut reach = Reach(0.0);
        let mut simulation = Simulation::new(&scene).unwrap();
        assert_eq!(simulation.run(999, &mut reach), Ok(Outcome::Finished));
        assert!(reach.0 < 1.01e-3, "{method}: {:e}", reach.0);
    }
}

/// A light line with a heavy bob: trial runs that are compared at the end only
/// agree while both miss its vibration.
#[test]
fn trial_runs_do_not_agree_by_accident() {
    let mut scene = common::moving::with_gravity("heavy bob on a light line");
    scene.add_node(Node::fixed(Vector3::zeros()));
    for k in 1..=6 {
        let last = k == 6;
        scene.add_node(Node {
            mass: if last { 1.0 } else { 1e-3 },
            velocity: Vector3::new(0.0, if last { 0.4 } else { 0.0 }, 0.0),
            ..Node::at(Vector3::new(0.1 * f64::from(k), 0.0, -0.02 * f64::from(k)))
        });
        scene.add_spring(k as usize - 1, k as usize, 2e4);
    }
    scene.settings.duration = 0.6;
    let (exact, trusted) = common::reference(&scene);
    assert!(trusted < 1e-8);
    for method in [Method::ImplicitMidpoint, Method::FilteredLeapfrog] {
        for tolerance in [1e-2, 1e-3, 1e-4] {
            let error = distance(&solved(&scene, method, tolerance), &exact);
            assert!(
                error < 3.0 * tolerance,
                "{method}, {tolerance:e}: {error:e}"
            );
        }
    }
}

/// In a moving frame of reference the anchor moves, too.
#[test]
fn a_pendulum_in_a_moving_frame_swings_alike() {
    let still = run(&pendulum(60.0), Method::TrBdf2, 1e-4).0[1];
    for velocity in [30.0, 1e3, 1e4] {
        let moving = run(&boosted(pendulum(60.0), velocity), Method::TrBdf2, 1e-4).0[1];
        let seen = moving - Vector3::new(velocity, 0.0, 0.0);
        assert!((seen - still).norm() < 1e-5, "{velocity}");
    }
}

/// Without settings the tolerance goes by the size of each part, not by how far
/// the parts are from each other.
#[test]
fn the_default_tolerance_is_that_of_each_part() {
    use springs_step::{Islands, Pace};
    let mut scene = pendulum(1e3);
    let mut far = scene.clone();
    for node in &mut far.nodes {
        node.position.y += 1e3;
    }
    common::append(&mut scene, &far);
    let islands = Islands::new(&scene).expect("a sound scene");
    assert_eq!(islands.parts().len(), 2);
    for part in islands.parts() {
        assert_eq!(part.simulation().choice().pace, Pace::Tolerance(1e-3));
    }
}

/// Rounding of times does not keep a run of several parts from its end: 10¹²
/// steps of parts that sleep, and a duration of next to nothing.
#[test]
fn rounds_come_to_an_end() {
    use springs_step::Islands;
    let mut scene = common::moving::with_gravity("two at rest");
    for (x, stiffness) in [(0.0, 100.0), (5.0, 50.0)] {
        let sag = 9.81 / stiffness;
        let hook = scene.add_node(Node::fixed(Vector3::new(x, 0.0, 0.0)));
        let bob = scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::new(x + 1e-6, 1e-6, -1.0 - sag - 1e-7))
        });
        let spring = scene.add_spring(hook, bob, stiffness);
        scene.springs[spring].rest_length = 1.0;
    }
    scene.settings.method = Method::TrBdf2;
    let options = RunOptions::default().with_sleep(0.01);
    for (step, duration) in [(1e-6, 1e6), (1e-3, 5e-324)] {
        scene.settings.step = StepControl::Fixed(step);
        scene.settings.duration = duration;
        let mut islands = Islands::with_options(&scene, &options).expect("a sound scene");
        assert_eq!(islands.run(1, &mut ()), Ok(Outcome::Finished));
        assert_eq!(islands.time(), duration);
    }
}

/// Small vibrations under large slow errors: coarse runs miss them all together, and
/// their errors fall as the order says until finer runs see them.
#[test]
fn coarse_runs_that_miss_a_vibration_are_not_extrapolated() {
    let named = |name: &str, tolerances: &[f64]| (name.to_owned(), tolerances.to_vec());
    for (name, tolerances) in [
        named("chain of 20, K = 1e6", &[1e-4, 1e-5]),
        named("cloth 6, K = 1e5", &[1e-3, 1e-4]),
        named("pulled chain", &[1e-3, 1e-4]),
        named("net without rest lengths", &[1e-2, 1e-3]),
    ] {
        let scene = moving_scenes().into_iter().find(|scene| scene.name == name);
        let scene = scene.expect("a scene of this name");
        let (reference, _) = reference(&scene);
        for method in [Method::ImplicitMidpoint, Method::FilteredLeapfrog] {
            for &tolerance in &tolerances {
                let (x, steps) = run(&scene, method, tolerance);
                let off = distance(&x, &reference) / tolerance;
                assert!(
                    off < 2.5,
                    "{name}, {method}, {tolerance:e}: {off}, {steps} steps"
                );
            }
        }
    }
}
