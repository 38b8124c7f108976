//! Emitters written against public API alone: a law of springs, a bending energy over
//! three nodes, and a force field on single nodes. Every method moves them at its
//! order, and each has its line in the energy ledger.

mod common;

use common::distance;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use springs_assembly::{
    Compilation, CompileError, Emitter, Evaluation, History, Lines, Loads, Projection,
    SpringBetween, Springs, System, Term, Terms, Weights, compile_with,
};
use springs_math::spring::LengthLaw;
use springs_scene::{Method, Node, RunOptions, Scene, StepControl, Tangent};
use springs_step::{Outcome, Simulation};

/// Hardens with its strain: V = ½K(l − l₀)² + ¼Q(l − l₀)⁴.
#[derive(Clone, Copy)]
struct Hardening {
    stiffness: f64,
    quartic: f64,
    rest_length: f64,
}

impl LengthLaw for Hardening {
    fn energy(&self, length: f64) -> f64 {
        let square = (length - self.rest_length).powi(2);
        (0.5 * self.stiffness + 0.25 * self.quartic * square) * square
    }

    fn tension(&self, length: f64) -> f64 {
        let stretch = length - self.rest_length;
        (self.stiffness + self.quartic * stretch * stretch) * stretch
    }

    fn stiffness(&self, length: f64) -> f64 {
        self.stiffness + 3.0 * self.quartic * (length - self.rest_length).powi(2)
    }

    fn largest_stiffness(&self) -> f64 {
        f64::INFINITY
    }

    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    fn is_convex(&self) -> bool {
        true
    }
}

/// V = ½B‖x₀ − 2x₁ + x₂‖²: resists bending, and stretching a little. Damped likewise.
#[derive(Clone, Copy)]
struct Bending {
    stiffness: f64,
    damping: f64,
}

const STENCIL: [f64; 3] = [1.0, -2.0, 1.0];

impl Bending {
    fn curvature(x: &[Vector3<f64>; 3]) -> Vector3<f64> {
        x[0] - x[1] * 2.0 + x[2]
    }

    fn matrix(factor: f64) -> [[Matrix3<f64>; 3]; 3] {
        STENCIL.map(|a| STENCIL.map(|b| Matrix3::identity() * (factor * a * b)))
    }
}

impl Term<3> for Bending {
    fn energy(&self, x: &[Vector3<f64>; 3]) -> f64 {
        0.5 * self.stiffness * Self::curvature(x).norm_squared()
    }

    fn forces(&self, x: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        STENCIL.map(|a| Self::curvature(x) * (-a * self.stiffness))
    }

    fn hessian(&self, _x: &[Vector3<f64>; 3]) -> [[Matrix3<f64>; 3]; 3] {
        Self::matrix(self.stiffness)
    }

    fn largest_stiffness(&self) -> f64 {
        6.0 * self.stiffness
    }

    fn is_damped(&self) -> bool {
        self.damping > 0.0
    }

    fn damping_forces(&self, _x: &[Vector3<f64>; 3], v: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        STENCIL.map(|a| Self::curvature(v) * (-a * self.damping))
    }

    fn damping(&self, _x: &[Vector3<f64>; 3], _v: &[Vector3<f64>; 3]) -> [[Matrix3<f64>; 3]; 3] {
        Self::matrix(self.damping)
    }

    fn largest_damping(&self) -> f64 {
        6.0 * self.damping
    }
}

/// An angle that three nodes keep: V = ½B(cos φ − c)², with blocks off the diagonal
/// that are not symmetric.
#[derive(Clone, Copy)]
struct Angle {
    stiffness: f64,
    cosine: f64,
}

impl Angle {
    /// (x₀ − x₁)·(x₂ − x₁) of vectors that are not scaled: a cosine times lengths,
    /// which is enough for a test.
    fn product(x: &[Vector3<f64>; 3]) -> f64 {
        (x[0] - x[1]).dot(&(x[2] - x[1]))
    }

    fn slopes(x: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        let (a, b) = (x[0] - x[1], x[2] - x[1]);
        [b, -a - b, a]
    }
}

impl Term<3> for Angle {
    fn energy(&self, x: &[Vector3<f64>; 3]) -> f64 {
        0.5 * self.stiffness * (Self::product(x) - self.cosine).powi(2)
    }

    fn forces(&self, x: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        let pull = self.stiffness * (Self::product(x) - self.cosine);
        Self::slopes(x).map(|slope| slope * -pull)
    }

    fn hessian(&self, x: &[Vector3<f64>; 3]) -> [[Matrix3<f64>; 3]; 3] {
        let pull = self.stiffness * (Self::product(x) - self.cosine);
        let slopes = Self::slopes(x);
        // Second derivatives of the product: those of x₀·x₂ − x₀·x₁ − x₁·x₂ + x₁².
        let second = [[0.0, -1.0, 1.0], [-1.0, 2.0, -1.0], [1.0, -1.0, 0.0]];
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                slopes[i] * slopes[j].transpose() * self.stiffness
                    + Matrix3::identity() * (pull * second[i][j])
            })
        })
    }

    fn largest_stiffness(&self) -> f64 {
        f64::INFINITY
    }
}

/// A well with a quartic wall: V = ½k‖x‖² + ¼q‖x‖⁴.
#[derive(Clone, Copy)]
struct Well {
    stiffness: f64,
    quartic: f64,
}

impl Term<1> for Well {
    fn energy(&self, [x]: &[Vector3<f64>; 1]) -> f64 {
        let square = x.norm_squared();
        (0.5 * self.stiffness + 0.25 * self.quartic * square) * square
    }

    fn forces(&self, [x]: &[Vector3<f64>; 1]) -> [Vector3<f64>; 1] {
        [x * -(self.stiffness + self.quartic * x.norm_squared())]
    }

    fn hessian(&self, [x]: &[Vector3<f64>; 1]) -> [[Matrix3<f64>; 1]; 1] {
        let isotropic = self.stiffness + self.quartic * x.norm_squared();
        [[Matrix3::identity() * isotropic + x * x.transpose() * (2.0 * self.quartic)]]
    }

    fn largest_stiffness(&self) -> f64 {
        f64::INFINITY
    }
}

/// F = a sin ωt.
#[derive(Clone, Copy)]
struct Sine {
    amplitude: Vector3<f64>,
    angular_frequency: f64,
}

impl History for Sine {
    fn force(&self, time: f64) -> Vector3<f64> {
        self.amplitude * (self.angular_frequency * time).sin()
    }

    fn rate(&self, time: f64) -> Vector3<f64> {
        self.amplitude * (self.angular_frequency * (self.angular_frequency * time).cos())
    }
}

/// A rope of five nodes without springs of its own, and what holds it together.
fn rope() -> Scene {
    let mut scene = Scene::default();
    for k in 0..5 {
        let k = f64::from(k);
        scene.add_node(Node {
            mass: 0.5 + 0.1 * k,
            velocity: Vector3::new(0.3, -0.2 * k, 0.1 * k * k),
            ..Node::at(Vector3::new(0.9 * k, 0.1 * k * k, -0.05 * k))
        });
    }
    scene.nodes[0].fixed = true;
    scene.nodes[0].velocity = Vector3::new(0.2, 0.0, 0.1);
    scene.gravity = Vector3::new(0.0, 0.0, -1.0);
    scene.settings.duration = 0.5;
    scene
}

fn emitters(damping: f64) -> Vec<Box<dyn Emitter>> {
    let law = Hardening {
        stiffness: 20.0,
        quartic: 30.0,
        rest_length: 0.8,
    };
    let springs: Vec<_> = (1..5)
        .map(|k| SpringBetween {
            nodes: [k - 1, k],
            law,
        })
        .collect();
    let bending = Bending {
        stiffness: 3.0,
        damping,
    };
    let angle = Angle {
        stiffness: 2.0,
        cosine: -0.5,
    };
    let well = Well {
        stiffness: 0.5,
        quartic: 0.05,
    };
    let load = Sine {
        amplitude: Vector3::new(1.0, -2.0, 3.0),
        angular_frequency: 4.0,
    };
    vec![
        Box::new(Loads::new("shaking", [(3, load), (0, load)])),
        Box::new(Springs::new("hardening", &springs)),
        Box::new(Terms::new(
            "bending",
            (2..5).map(|k| ([k - 2, k - 1, k], bending)),
        )),
        Box::new(Terms::new(
            "angles",
            (2..5).map(|k| ([k, k - 1, k - 2], angle)),
        )),
        Box::new(Terms::new("well", (0..5).map(|k| ([k], well)))),
    ]
}

fn system(damping: f64) -> System {
    compiled(emitters(damping)).unwrap()
}

fn flat(vectors: &[Vector3<f64>]) -> DVector<f64> {
    DVector::from_iterator(3 * vectors.len(), vectors.iter().flatten().copied())
}

#[test]
fn forces_and_matrix_are_slopes_of_energy_and_forces() {
    let system = system(0.7);
    assert!(!system.has_symmetric_blocks());
    let (x, v) = (system.initial_positions(), system.initial_velocities());
    let n = 3 * system.n_free();
    let forces = |x: &[Vector3<f64>], v: &[Vector3<f64>]| {
        let mut forces = vec![Vector3::zeros(); system.n_free()];
        system.forces(0.0, x, v, &mut forces);
        flat(&forces)
    };
    let moved = |of: &[Vector3<f64>], row: usize, by: f64| {
        let mut of = of.to_vec();
        of[row / 3][row % 3] += by;
        of
    };
    let still = vec![Vector3::zeros(); x.len()];
    let matrix = |weights: Weights, projection| {
        let mut out = system.linearization();
        let at = Evaluation {
            projection,
            ..Evaluation::new(x, v, weights)
        };
        system.linearize(&at, &mut out);
        let mut dense = DMatrix::zeros(n, n);
        for (row, column, value) in out.matrix.triplets() {
            dense[(row, column)] += value;
        }
        (dense, out)
    };
    let (hessian, out) = matrix(Weights::STIFFNESS, Projection::None);
    let (damping, _) = matrix(Weights::of_damping(1.0), Projection::None);
    for row in 0..n {
        let [after, before] = [1e-5, -1e-5].map(|by| moved(x, row, by));
        let slope = (system.energy(&after, v).total() - system.energy(&before, v).total()) / 2e-5;
        assert!((out.forces[row / 3][row % 3] + slope).abs() < 1e-6);
        let change = (forces(&after, &still) - forces(&before, &still)) / 2e-5;
        assert!((hessian.column(row) + change).amax() < 1e-6);
        let change = forces(x, &moved(v, row, 1.0)) - forces(x, v);
        assert!((damping.column(row) + change).amax() < 1e-9);
    }
    // Products are those of the matrix, and projections make it definite.
    let y: Vec<Vector3<f64>> = (0..system.n_free())
        .map(|k| Vector3::new((k as f64).cos(), 1.0, -0.1 * k as f64))
        .collect();
    for projection in [Projection::None, Projection::Clamp, Projection::Absolute] {
        let (dense, out) = matrix(Weights::of_step(0.1), projection);
        let at = Evaluation {
            projection,
            ..Evaluation::new(x, v, Weights::of_step(0.1))
        };
        let (mut product, mut expected) = (y.clone(), y.clone());
        system.product(&at, &y, &mut product);
        out.matrix.multiply(&y, &mut expected);
        assert!((flat(&product) - flat(&expected)).amax() < 1e-12);
        assert!((dense * flat(&y) - flat(&expected)).amax() < 1e-12);
    }
    let mut fixed = vec![Vector3::zeros(); 1];
    for (_, emitter) in system.damped() {
        emitter.add_damping_reactions(x, v, &mut fixed);
    }
    let mut free = vec![Vector3::zeros(); system.n_free()];
    system.add_damping_forces(x, v, &mut free);
    let sum: Vector3<f64> = free.iter().chain(&fixed).sum();
    assert!(sum.norm() < 1e-14);
}

fn end(method: Method, h: f64, damping: f64) -> Option<Vec<Vector3<f64>>> {
    let mut scene = rope();
    scene.settings.method = method;
    scene.settings.step = StepControl::Fixed(h);
    let mut simulation =
        Simulation::with_emitters(&scene, &RunOptions::default(), emitters(damping)).ok()?;
    assert_eq!(simulation.run(1, &mut ()), Ok(Outcome::Finished));
    Some(simulation.nodes().positions.clone())
}

#[test]
fn every_method_has_its_order() {
    for damping in [0.0, 0.7] {
        let mut scene = rope();
        scene.settings.method = Method::Dop853;
        scene.settings.step = StepControl::Tolerance(1e-12);
        let mut reference =
            Simulation::with_emitters(&scene, &RunOptions::default(), emitters(damping)).unwrap();
        reference.run(1, &mut ()).unwrap();
        let reference = &reference.nodes().positions;
        for &method in Method::ALL.iter().filter(|method| **method != Method::Auto) {
            let (order, h) = match method {
                Method::LinearlyImplicitEuler | Method::ImplicitEuler => (1, 2e-3),
                Method::BlanesMoan4 | Method::Rodas4 => (4, 2e-2),
                Method::BlanesMoan6 => (6, 0.1),
                Method::Dop853 => (8, 0.25),
                _ => (2, 5e-3),
            };
            let Some(coarse) = end(method, h, damping) else {
                let refuses = [Method::BlanesMoan4, Method::BlanesMoan6, Method::Rodas4];
                assert!(damping > 0.0 && refuses.contains(&method), "{method}");
                continue;
            };
            let fine = end(method, 0.5 * h, damping).unwrap();
            let [coarse, fine] = [coarse, fine].map(|end| distance(&end, reference));
            let rate = (coarse / fine).log2();
            // Explicit methods with dashpots may be better than their order.
            assert!(
                rate > f64::from(order) - 0.25,
                "{method}, {damping}: {coarse:e}, {fine:e}, order {rate}"
            );
        }
    }
}

#[test]
fn every_tangent_converges() {
    let expected = end(Method::TrBdf2, 1e-4, 0.0).unwrap();
    for &tangent in Tangent::ALL {
        let mut scene = rope();
        scene.settings.method = Method::LinearlyImplicitEuler;
        scene.settings.tangent = Some(tangent);
        scene.settings.step = StepControl::Fixed(2e-4);
        let mut simulation =
            Simulation::with_emitters(&scene, &RunOptions::default(), emitters(0.0)).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let off = distance(&simulation.nodes().positions, &expected);
        assert!(off < 2e-3, "{tangent}: {off:e}");
    }
}

/// A tolerance holds, and what the method itself gains or loses falls with it: each
/// emitter has its line, and heat and anchor work close the ledger.
#[test]
fn tolerances_hold_and_the_ledger_closes() {
    let reference = end(Method::Dop853, 1e-3, 0.7).unwrap();
    for method in [
        Method::Auto,
        Method::TrBdf2,
        Method::Dop853,
        Method::VelocityVerlet,
    ] {
        let mut scene = rope();
        scene.settings.method = method;
        let mut gains = Vec::new();
        for tolerance in [1e-3, 1e-5] {
            scene.settings.step = StepControl::Tolerance(tolerance);
            let mut simulation =
                Simulation::with_emitters(&scene, &RunOptions::default(), emitters(0.7)).unwrap();
            simulation.run(1, &mut ()).unwrap();
            let off = distance(&simulation.nodes().positions, &reference);
            assert!(off < 3.0 * tolerance, "{method}: {off:e} of {tolerance:e}");
            let (ledger, now) = (simulation.ledger(), simulation.energy());
            for line in Lines::OTHERS + 1..Lines::OTHERS + 5 {
                assert_ne!(now.potential[line], ledger.start.potential[line]);
            }
            assert!(ledger.heat[Lines::OTHERS + 2] > 1e-3);
            assert_eq!(ledger.heat.sum(), ledger.heat[Lines::OTHERS + 2]);
            assert!(ledger.anchor_work != 0.0 && ledger.load_work != 0.0);
            gains.push(ledger.method_gain(&now).abs());
        }
        assert!(gains[1] < 1e-7 + 0.1 * gains[0], "{method}: {gains:?}");
    }
}

/// A free mass under F = a sin ωt from rest: x = a/(mω²)(ωt − sin ωt), and the work of
/// the load is its kinetic energy.
#[test]
fn a_load_moves_a_free_mass_and_does_its_work() {
    let (m, omega) = (2.0, 4.0);
    let amplitude = Vector3::new(1.0, -2.0, 3.0);
    let load = Sine {
        amplitude,
        angular_frequency: omega,
    };
    let mut scene = Scene::default();
    scene.add_node(Node {
        mass: m,
        ..Node::at(Vector3::zeros())
    });
    let t = scene.settings.duration;
    let x = amplitude / (m * omega * omega) * (omega * t - (omega * t).sin());
    let v = amplitude / (m * omega) * (1.0 - (omega * t).cos());
    for &method in Method::ALL {
        scene.settings.method = method;
        scene.settings.step = StepControl::Tolerance(1e-4);
        let loads: Vec<Box<dyn Emitter>> = vec![Box::new(Loads::new("load", [(0, load)]))];
        let mut simulation =
            Simulation::with_emitters(&scene, &RunOptions::default(), loads).unwrap();
        simulation.run(1, &mut ()).unwrap();
        let off = (simulation.nodes().positions[0] - x).norm();
        assert!(off < 3e-4, "{method}: {off:e}");
        let off = (simulation.nodes().velocities[0] - v).norm();
        assert!(off < 3e-3, "{method}: {off:e}");
        let kinetic = simulation.energy().kinetic;
        let work = simulation.ledger().load_work;
        assert!(
            (work - kinetic).abs() < 1e-3 * kinetic,
            "{method}: {work} J of {kinetic} J"
        );
    }
}

#[test]
fn stiff_terms_are_no_trouble_for_implicit_methods() {
    let stiff = || -> Vec<Box<dyn Emitter>> {
        let bending = Bending {
            stiffness: 1e7,
            damping: 0.0,
        };
        let mut all = emitters(0.0);
        all.push(Box::new(Terms::new("rod", [([1, 2, 3], bending)])));
        all
    };
    for method in [Method::ImplicitEuler, Method::TrBdf2, Method::Auto] {
        let mut scene = rope();
        scene.settings.method = method;
        scene.settings.step = StepControl::Fixed(1e-2);
        let mut simulation =
            Simulation::with_emitters(&scene, &RunOptions::default(), stiff()).unwrap();
        assert_eq!(
            simulation.run(1, &mut ()),
            Ok(Outcome::Finished),
            "{method}"
        );
        let x = &simulation.nodes().positions;
        let curvature = (x[1] - x[2] * 2.0 + x[3]).norm();
        assert!(curvature < 1e-3, "{method}: {curvature:e}");
    }
}

fn compiled(emitters: Vec<Box<dyn Emitter>>) -> Result<System, CompileError> {
    compile_with(&rope(), Compilation::with_emitters(emitters))
}

#[test]
fn there_may_be_too_many_emitters() {
    let many = || {
        (0..Lines::MOST)
            .map(|_| -> Box<dyn Emitter> { Box::new(Terms::<1, Well>::new("nothing", [])) })
    };
    assert!(compiled(many().collect()).is_err());
    assert!(compiled(many().take(Lines::MOST - Lines::OTHERS).collect()).is_ok());
}
