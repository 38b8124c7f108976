//! Springs that yield: against closed forms and balances of energy.

mod common;

use common::{METHODS, with};
use nalgebra::Vector3;
use springs::io::{parse_scene, scene_to_string};
use springs::scene::{
    BreakLimit, Method, NamedMotion, Node, PrescribedMotion, RunOptions, Scene, SpringLaw,
};
use springs::step::{Frame, Islands, Members, Observer};
use std::ops::ControlFlow;

#[derive(Default)]
struct Look(Vec<Members>);

impl Observer for Look {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.0.push(frame.members.unwrap().clone());
        ControlFlow::Continue(())
    }
}

/// A spring with K = 100 N/m and l₀ = 1 m that yields at 5 N.
fn scene(hardening: f64, end: Node) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(end);
    scene.add_spring(0, 1, 100.0);
    scene.laws = vec![SpringLaw::Plastic {
        yields_at: 5.0,
        hardening,
    }];
    scene.springs[0].law = Some(0);
    scene
}

/// 0.5 kg with 2 m/s, 1 J: the spring takes Y²/2K = 0.125 J until it yields and Y p after,
/// so that p = 0.175 m; then it swings with a stretch of Y/K = 0.05 m about that.
fn thrown() -> Scene {
    let mut scene = scene(
        0.0,
        Node {
            mass: 0.5,
            velocity: Vector3::x() * 2.0,
            ..Node::at(Vector3::x())
        },
    );
    scene.settings.duration = 0.5;
    scene
}

#[test]
fn a_thrown_mass_stretches_its_spring_for_good() {
    for method in METHODS {
        let scene = with(&thrown(), method, None, 1e-4);
        let mut look = Look::default();
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(500, &mut look).unwrap();
        let mut end = scene.clone();
        islands.write_memory_to(&mut end);
        let error = match method {
            Method::LinearlyImplicitEuler | Method::ImplicitEuler => 1e-3,
            // Its matrix is that before the kink, in all stages of the step.
            Method::Rodas4 => 3e-5,
            _ => 1e-5,
        };
        let yielded = end.springs[0].yielded;
        assert!((yielded - 0.175).abs() < error, "{method}: {yielded} m");
        let ledger = islands.ledger();
        let taken = ledger.broken_energy;
        // It swings back to where it all but yields again.
        let back = taken - 5.0 * yielded;
        assert!((-1e-9..5.0 * error).contains(&back), "{method}: {taken} J");
        let gain = ledger.method_gain(&islands.energy());
        assert!(gain.abs() < 10.0 * error, "{method}: gains {gain:e} J");
        let total = islands.energy().total();
        assert!((total - 0.125).abs() < 10.0 * error, "{method}: {total} J");
        // Half a step of the elastic tension is predicted where methods carry it.
        let most = islands.peaks()[0].max_tension;
        assert!((5.0 - 1e-9..5.03).contains(&most), "{method}: {most} N");
        assert!(look.0[0].yielded.is_empty() && look.0[500].yielded == [0]);
    }
}

/// The end moves by A sin 2πt with A = 0.2 m. From the first turn on, p goes to and fro by
/// 2(K A − Y)/(K + H), and Y times that is lost on each way, as many times as there are turns.
#[test]
fn a_driven_spring_takes_the_area_of_its_loop() {
    for hardening in [0.0, 20.0] {
        let mut scene = scene(hardening, Node::fixed(Vector3::x()));
        scene.motions = vec![NamedMotion {
            name: "shake".to_owned(),
            motion: PrescribedMotion::Sine {
                amplitude: Vector3::x() * 0.2,
                frequency: 1.0,
                phase: 0.0,
            },
        }];
        scene.nodes[1].motion = Some(0);
        scene.settings.duration = 3.25;
        // Turns, at odd quarters of a second, are ends of steps.
        let scene = with(&scene, Method::VelocityVerlet, None, 1e-3);
        let mut islands = Islands::new(&scene).unwrap();
        islands.run(13, &mut ()).unwrap();
        let modulus = 100.0 * hardening / (100.0 - hardening);
        let first = (100.0 * 0.2 - 5.0) / (100.0 + modulus);
        let ledger = islands.ledger();
        let expected = 5.0 * (first + 6.0 * 2.0 * first);
        let taken = ledger.broken_energy;
        assert!(
            (taken - expected).abs() < 1e-9,
            "{hardening}: {taken} J, {expected} J"
        );
        let gain = ledger.method_gain(&islands.energy());
        assert!(gain.abs() < 1e-9, "{gain:e} J");
        let mut end = scene.clone();
        islands.write_memory_to(&mut end);
        assert!((end.springs[0].yielded - first).abs() < 1e-12);
    }
}

#[test]
fn a_run_goes_on_with_what_has_yielded() {
    let mut scene = with(&thrown(), Method::VelocityVerlet, None, 1e-3);
    scene.settings.duration = 0.15;
    let mut first = Islands::new(&scene).unwrap();
    first.run(3, &mut ()).unwrap();
    let mut end = scene.clone();
    first.nodes().write_to(&mut end);
    first.write_memory_to(&mut end);
    assert!(end.springs[0].yielded > 0.1);
    let text = scene_to_string(&end, &RunOptions::default());
    let (read, _) = parse_scene("final.ron", &text).unwrap();
    assert_eq!(read, end);
    let mut further = Islands::new(&read).unwrap();
    further.run(3, &mut ()).unwrap();
    scene.settings.duration = 0.3;
    let mut whole = Islands::new(&scene).unwrap();
    whole.run(3, &mut ()).unwrap();
    let [a, b] = [&whole, &further].map(|islands| islands.nodes().positions[1]);
    assert!((a - b).norm() < 1e-9, "{a}, {b}");
    let taken = first.ledger().broken_energy + further.ledger().broken_energy;
    assert!((whole.ledger().broken_energy - taken).abs() < 1e-9);
}

/// A spring yields, and then breaks.
#[test]
fn a_spring_may_yield_until_it_breaks() {
    let mut scene = thrown();
    scene.springs[0].breaks_at = Some(BreakLimit::Strain(0.1));
    let scene = with(&scene, Method::Dop853, None, 1e-4);
    let mut islands = Islands::new(&scene).unwrap();
    islands.run(3, &mut ()).unwrap();
    let breaks = islands.breaks();
    assert_eq!(breaks.len(), 1);
    // ½ Y²/K is held at last, and Y (s − Y/K) was lost before.
    let taken = islands.ledger().broken_energy;
    assert!((taken - 0.125 - 5.0 * 0.05).abs() < 2e-3, "{taken} J");
    let kinetic = islands.energy().kinetic;
    assert!((kinetic + taken - 1.0).abs() < 1e-4, "{kinetic} J");
}
