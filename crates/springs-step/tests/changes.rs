//! Springs, forces and anchors that are changed between steps.

mod common;

use common::laws::with_mixed_laws;
use common::tangle;
use nalgebra::Vector3;
use springs_scene::{
    BreakLimit, Method, Node, Problem, RunOptions, Scene, SpringLaw, StepControl, Tangent,
};
use springs_step::{ChangeError, NodeStates, Simulation};

const STEP: f64 = 1e-3;

fn changeable(scene: &Scene) -> Simulation {
    Simulation::changeable(scene, &RunOptions::default()).unwrap()
}

fn with_steps(mut scene: Scene, method: Method) -> Scene {
    scene.settings.method = method;
    scene.settings.step = StepControl::Fixed(STEP);
    scene.settings.duration = 10.0;
    scene
}

/// A weight of 0.5 kg on a spring of 80 N/m and 1 m along x, at rest.
fn weight(method: Method) -> Scene {
    let mut scene = Scene::default();
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 0.5,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, 80.0);
    with_steps(scene, method)
}

fn methods() -> impl Iterator<Item = Method> {
    Method::ALL
        .iter()
        .copied()
        .filter(|method| *method != Method::Auto)
}

fn steps(simulation: &mut Simulation, n: usize) {
    for _ in 0..n {
        simulation.step().unwrap();
    }
}

fn gain(simulation: &Simulation) -> f64 {
    simulation.ledger().method_gain(&simulation.energy())
}

/// Largest error against x(t) = e + (1 − e) cos ωt about the rest length e. The energy
/// account closes as far as the method keeps energy.
#[test]
fn a_rest_length_that_jumps_does_the_work_of_the_spring() {
    for method in methods() {
        let mut simulation = changeable(&weight(method));
        steps(&mut simulation, 10);
        assert!((simulation.nodes().positions[1].x - 1.0).abs() < 1e-14);
        simulation.set_rest_lengths(&[0.9]).unwrap();
        // ½ K 0.1².
        assert!((simulation.ledger().control_work - 0.4).abs() < 1e-12);
        assert!(gain(&simulation).abs() < 1e-12, "{method}");
        steps(&mut simulation, 500);
        let omega = 160_f64.sqrt();
        let expected = 0.9 + 0.1 * (omega * 0.5).cos();
        let error = simulation.nodes().positions[1].x - expected;
        let euler = matches!(
            method,
            Method::LinearlyImplicitEuler | Method::ImplicitEuler
        );
        assert!(
            error.abs() < if euler { 5e-3 } else { 2e-5 },
            "{method}: {error}"
        );
        let gain = gain(&simulation);
        assert!(
            gain.abs() < if euler { 0.1 } else { 2e-4 },
            "{method}: {gain}"
        );
    }
}

/// ½ (K′ − K) s² at the stretch s, and the frequency of the new stiffness.
#[test]
fn a_stiffness_that_jumps_does_the_work_of_the_spring() {
    let mut scene = weight(Method::Dop853);
    scene.springs[0].rest_length = 0.75;
    let mut simulation = changeable(&scene);
    simulation.set_stiffnesses(&[320.0]).unwrap();
    assert_eq!(simulation.ledger().control_work, 0.5 * 240.0 * 0.0625);
    assert_eq!(simulation.system().frequency_bound(), 1280_f64.sqrt());
    steps(&mut simulation, 300);
    let expected = 0.75 + 0.25 * (640_f64.sqrt() * 0.3).cos();
    assert!((simulation.nodes().positions[1].x - expected).abs() < 1e-12);
    assert!(gain(&simulation).abs() < 1e-12);
}

/// A constant force moves the rest position by F/K, and its work is that of loads.
#[test]
fn forces_do_the_work_of_loads() {
    for method in methods() {
        let mut simulation = changeable(&weight(method));
        let force = Vector3::new(16.0, 0.0, 0.0);
        simulation.set_forces(&[Vector3::zeros(), force]).unwrap();
        assert_eq!(simulation.set_forces_now()[1], force);
        steps(&mut simulation, 400);
        let x = simulation.nodes().positions[1].x;
        let expected = 1.2 - 0.2 * (160_f64.sqrt() * 0.4).cos();
        let euler = matches!(
            method,
            Method::LinearlyImplicitEuler | Method::ImplicitEuler
        );
        assert!(
            (x - expected).abs() < if euler { 1e-2 } else { 3e-5 },
            "{method}"
        );
        let work = simulation.ledger().load_work;
        let off = work - 16.0 * (x - 1.0);
        assert!(
            off.abs() < if euler { 0.1 } else { 1e-4 },
            "{method}: {off}"
        );
        assert_eq!(simulation.ledger().control_work, 0.0);
    }
}

/// An anchor that starts at v has the weight swing about it: in its frame the weight
/// starts at −v, and x = 1 + v t − (v/ω) sin ωt.
#[test]
fn anchors_move_from_where_they_are() {
    for method in methods() {
        let mut simulation = changeable(&weight(method));
        steps(&mut simulation, 100);
        let v = Vector3::new(0.5, 0.0, 0.0);
        simulation
            .set_anchor_velocities(&[v, Vector3::zeros()])
            .unwrap();
        assert_eq!(simulation.nodes().velocities[0], v);
        steps(&mut simulation, 200);
        let omega = 160_f64.sqrt();
        let [anchor, x] = [0, 1].map(|node| simulation.nodes().positions[node].x);
        assert!((anchor - 0.1).abs() < 1e-14, "{method}: {anchor}");
        let expected = 1.1 - 0.5 / omega * (omega * 0.2).sin();
        let euler = matches!(
            method,
            Method::LinearlyImplicitEuler | Method::ImplicitEuler
        );
        assert!(
            (x - expected).abs() < if euler { 2e-3 } else { 1e-5 },
            "{method}"
        );
        simulation
            .set_anchor_velocities(&[Vector3::zeros(); 2])
            .unwrap();
        steps(&mut simulation, 100);
        assert_eq!(simulation.nodes().positions[0].x, anchor, "{method}");
        let gain = gain(&simulation);
        assert!(
            gain.abs() < if euler { 0.05 } else { 1e-4 },
            "{method}: {gain}"
        );
    }
}

/// With a tolerance, too: the controller finds the steps that the changed spring needs.
#[test]
fn error_control_goes_on_with_what_was_changed() {
    for method in [
        Method::TrBdf2,
        Method::VelocityVerlet,
        Method::Dop853,
        Method::Auto,
    ] {
        let mut scene = weight(method);
        scene.settings.step = StepControl::Tolerance(1e-5);
        scene.settings.duration = 1.0;
        let mut simulation = changeable(&scene);
        while simulation.stepper().time() < 0.25 {
            simulation.step().unwrap();
        }
        let since = simulation.stepper().time();
        simulation.set_rest_lengths(&[0.9]).unwrap();
        simulation.set_stiffnesses(&[8000.0]).unwrap();
        while simulation.step().unwrap().is_some() {}
        let omega = 16_000_f64.sqrt();
        let expected = 0.9 + 0.1 * (omega * (1.0 - since)).cos();
        let error = simulation.nodes().positions[1].x - expected;
        assert!(error.abs() < 2e-5, "{method}: {error}");
    }
}

fn end(simulation: &Simulation) -> (NodeStates, [u64; 2]) {
    let ledger = simulation.ledger();
    let numbers = [gain(simulation), ledger.control_work + ledger.load_work];
    (simulation.nodes().clone(), numbers.map(f64::to_bits))
}

/// Changes everything a little.
fn change(simulation: &mut Simulation, k: usize) {
    let scene = simulation.changed_scene().unwrap();
    let factor = 1.0 + 0.02 * (k as f64).sin();
    let lengths: Vec<f64> = scene
        .springs
        .iter()
        .map(|s| s.rest_length * factor)
        .collect();
    let own = |law: usize| scene.laws[law].own_axial_stiffness().is_some();
    let stiffness = |s: &springs_scene::Spring| {
        if s.law.is_some_and(own) {
            s.stiffness
        } else {
            s.stiffness * factor
        }
    };
    let stiffnesses: Vec<f64> = scene.springs.iter().map(stiffness).collect();
    let n = scene.nodes.len();
    let velocity = |node: &Node| {
        if node.fixed {
            Vector3::new(0.1, 0.0, 0.1 * factor)
        } else {
            Vector3::zeros()
        }
    };
    let velocities: Vec<_> = scene.nodes.iter().map(velocity).collect();
    simulation.set_stiffnesses(&stiffnesses).unwrap();
    simulation.set_rest_lengths(&lengths).unwrap();
    simulation
        .set_forces(&vec![Vector3::new(0.0, 0.01 * factor, 0.0); n])
        .unwrap();
    simulation.set_anchor_velocities(&velocities).unwrap();
}

/// Saved after a change and in between, and restored into one that was made anew.
#[test]
fn saved_ones_go_on_with_the_same_bits() {
    let mut scenes: Vec<Scene> = methods().map(|m| with_steps(tangle(12, 3), m)).collect();
    let mut filtered = with_steps(tangle(12, 3), Method::LinearlyImplicitEuler);
    filtered.settings.tangent = Some(Tangent::Filtered);
    scenes.push(filtered);
    let laws = with_steps(with_mixed_laws(tangle(12, 3), 3), Method::TrBdf2);
    scenes.push(laws);
    let mut controlled = with_steps(tangle(12, 3), Method::Auto);
    controlled.settings.step = StepControl::Tolerance(1e-3);
    scenes.push(controlled);
    for scene in scenes {
        let Ok(mut through) = Simulation::changeable(&scene, &RunOptions::default()) else {
            continue;
        };
        let mut resumed = changeable(&scene);
        for k in 0..4 {
            change(&mut through, k);
            change(&mut resumed, k);
            for _ in 0..2 {
                let words = resumed.save();
                resumed = changeable(&scene);
                resumed.restore(words).unwrap();
                steps(&mut through, 3);
                steps(&mut resumed, 3);
            }
            let what = format!("{}, {k}", scene.settings.method);
            assert_eq!(end(&through), end(&resumed), "{what}");
        }
    }
}

/// Nothing changes the pattern, and nothing is analyzed again.
#[test]
fn the_matrix_is_analyzed_once() {
    let mut simulation = changeable(&with_steps(tangle(12, 3), Method::TrBdf2));
    for k in 0..20 {
        change(&mut simulation, k);
        steps(&mut simulation, 1);
    }
    assert_eq!(simulation.work().counts.symbolic_factorizations, 1);
}

/// A spring that broke and one that yielded stay so.
#[test]
fn what_lasts_stays() {
    let mut scene = weight(Method::TrBdf2);
    scene.add_node(Node::fixed(Vector3::new(2.0, 0.0, 0.0)));
    let other = scene.add_spring(1, 2, 80.0);
    scene.springs[other].breaks_at = Some(BreakLimit::Force(3.0));
    scene.laws.push(SpringLaw::Plastic {
        yields_at: 2.0,
        hardening: 8.0,
    });
    scene.springs[0].law = Some(0);
    let mut simulation = changeable(&scene);
    // 5 N each: the second one breaks, and the first one yields.
    simulation.set_rest_lengths(&[0.9375, 0.9375]).unwrap();
    steps(&mut simulation, 100);
    simulation.end_step();
    let yielded = simulation.system().yielded();
    assert_eq!(simulation.system().broken(), [1]);
    assert!(yielded[0].1 > 0.0);
    simulation.set_rest_lengths(&[1.0, 1.0]).unwrap();
    assert_eq!(simulation.system().broken(), [1]);
    assert_eq!(simulation.system().yielded(), yielded);
}

#[test]
fn impossible_changes_change_nothing() {
    let scene = weight(Method::TrBdf2);
    let mut simulation = changeable(&scene);
    let negative = simulation.set_rest_lengths(&[-1.0]).unwrap_err();
    assert!(
        matches!(negative, ChangeError::Problem(Problem::Negative { .. })),
        "{negative}"
    );
    assert_eq!(simulation.changed_scene(), Some(&scene));
    let message = |change: Result<(), ChangeError>| change.unwrap_err().to_string();
    let zero = Vector3::zeros();
    let nan = Vector3::new(0.0, f64::NAN, 0.0);
    insta::assert_snapshot!([
        negative.to_string(),
        message(simulation.set_stiffnesses(&[1.0, 2.0])),
        message(simulation.set_forces(&[zero, nan])),
        message(simulation.set_anchor_velocities(&[zero, Vector3::x()])),
        message(Simulation::new(&scene).unwrap().set_rest_lengths(&[1.0])),
    ].join("\n"), @r"
    the rest length of spring 0 must not be negative, but is -1
    there are 2 values for 1 springs
    the force of node 1 must be a finite number, but is NaN
    node 1 is not fixed, so its velocity cannot be prescribed
    the simulation was not made to be changed (see Simulation::changeable)
    ");
}
