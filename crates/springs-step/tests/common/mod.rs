//! What several tests need.

// Every test binary takes what it needs.
#![allow(dead_code, unreachable_pub)]

pub mod hard;
pub mod laws;
pub mod moving;

use nalgebra::Vector3;
use springs_scene::{Method, Node, Scene, Spring, StepControl, Tangent};
use springs_step::{NodeStates, Simulation, Stepper};

/// Every one, apart from the choice among them.
pub const METHODS: [Method; 10] = [
    Method::LinearlyImplicitEuler,
    Method::ImplicitEuler,
    Method::TrBdf2,
    Method::ImplicitMidpoint,
    Method::FilteredLeapfrog,
    Method::Rodas4,
    Method::VelocityVerlet,
    Method::BlanesMoan4,
    Method::BlanesMoan6,
    Method::Dop853,
];

/// Numbers in [0, 1) that are the same everywhere (xorshift64*).
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-size, size))
    }
}

/// A connected tangle: mixed masses, rest lengths, stiffnesses and dashpots,
/// duplicate springs, springs between fixed nodes, two fixed nodes of which the
/// second moves.
pub fn tangle(n_nodes: usize, seed: u64) -> Scene {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut scene = Scene {
        name: format!("tangle {seed}"),
        gravity: Vector3::new(0.3, -0.2, -9.81),
        ..Scene::default()
    };
    for _ in 0..n_nodes {
        scene.add_node(Node {
            velocity: random.vector(0.5),
            mass: random.between(0.01, 0.1),
            ..Node::at(random.vector(1.0))
        });
    }
    scene.nodes[0].fixed = true;
    scene.nodes[0].velocity = Vector3::zeros();
    scene.nodes[1].fixed = true;
    let join = |scene: &mut Scene, random: &mut Random, a: usize, b: usize| {
        let index = scene.add_spring(a, b, random.between(5.0, 300.0));
        let stretch = random.between(0.6, 1.3);
        let spring: &mut Spring = &mut scene.springs[index];
        spring.rest_length *= stretch;
        spring.mass = random.between(0.0, 0.05);
        spring.damping = (random.unit() - 0.5).max(0.0);
    };
    for node in 1..n_nodes {
        let other = random.below(node);
        join(&mut scene, &mut random, node, other);
    }
    for _ in 0..2 * n_nodes {
        let (a, b) = (random.below(n_nodes), random.below(n_nodes));
        if a != b {
            join(&mut scene, &mut random, a, b);
        }
    }
    join(&mut scene, &mut random, 0, 1);
    scene
}

/// Adds a copy of another scene, whose nodes come after those that are there.
pub fn append(scene: &mut Scene, other: &Scene) {
    let first = scene.nodes.len();
    let first_law = scene.laws.len();
    scene.nodes.extend(&other.nodes);
    scene.laws.extend(other.laws.iter().cloned());
    scene
        .springs
        .extend(other.springs.iter().map(|spring| Spring {
            nodes: spring.nodes.map(|node| node + first),
            law: spring.law.map(|law| law + first_law),
            ..*spring
        }));
}

/// The scene with other settings.
pub fn with(scene: &Scene, method: Method, tangent: Option<Tangent>, step: f64) -> Scene {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.tangent = tangent;
    scene.settings.step = StepControl::Fixed(step);
    scene
}

/// The scene after `steps` steps of its settings.
pub fn after(scene: &Scene, steps: usize) -> NodeStates {
    let StepControl::Fixed(h) = scene.settings.step else {
        panic!("a fixed step");
    };
    let mut nodes = NodeStates::of(scene);
    let mut stepper = Stepper::new(scene).expect("a sound scene");
    for _ in 0..steps {
        stepper.step(&mut nodes, h).expect("a step");
    }
    nodes
}

/// Positions at the end of a run with a tolerance in m.
pub fn solved(scene: &Scene, method: Method, tolerance: f64) -> Vec<Vector3<f64>> {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.step = StepControl::Tolerance(tolerance);
    let mut simulation = Simulation::new(&scene).expect("a scene that the method can move");
    simulation.run(1, &mut ()).expect("a run");
    simulation.nodes().positions.clone()
}

/// A solution to measure errors against, and how far it can be trusted, in m.
pub fn reference(scene: &Scene) -> (Vec<Vector3<f64>>, f64) {
    let [best, other] = [1e-11, 1e-10].map(|tolerance| solved(scene, Method::Dop853, tolerance));
    let trusted = distance(&best, &other);
    (best, trusted)
}

/// How many times larger a small disturbance of velocities is at the end than
/// it would be in free flight: what no estimate of single steps can know.
pub fn growth(scene: &Scene, reference: &[Vector3<f64>]) -> f64 {
    const DISTURBANCE: f64 = 1e-6;
    let mut random = Random(7);
    let mut disturbed = scene.clone();
    for node in disturbed.nodes.iter_mut().filter(|node| !node.fixed) {
        node.velocity += random.vector(DISTURBANCE);
    }
    let apart = distance(&solved(&disturbed, Method::Dop853, 1e-10), reference);
    apart / (DISTURBANCE * scene.settings.duration)
}

/// Largest difference of two lists of vectors.
pub fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().zip(b);
    pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// Largest length in a list of vectors.
pub fn largest(a: &[Vector3<f64>]) -> f64 {
    a.iter().map(|a| a.norm()).fold(0.0, f64::max)
}
