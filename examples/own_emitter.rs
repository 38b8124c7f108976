//! An energy of one's own: a rod that resists bending, held at one end and loaded at
//! the other.
//!
//! ```text
//! cargo run --example own_emitter
//! ```
//!
//! A chain of springs alone bends like a string. The kernel below adds
//! ½ EI/h³ ‖x₀ − 2x₁ + x₂‖² for every three nodes in a row, a distance h apart, and
//! nothing else has to know of it. Drag lets the rod come to rest; its end then hangs
//! F L³/(3 EI) deep (Euler and Bernoulli, for small deflections).

use springs::assembly::{Emitter, Term, Terms};
use springs::scene::{Load, Node, OverTime, RunOptions, Scene, StepControl, Vector3};
use springs::step::Simulation;

type Matrix3 = nalgebra::Matrix3<f64>;

/// The bending energy of three nodes in a row.
struct Bending {
    /// EI/h³, in N/m.
    stiffness: f64,
}

/// x₀ − 2x₁ + x₂.
const CURVATURE: [f64; 3] = [1.0, -2.0, 1.0];

impl Bending {
    fn curvature(x: &[Vector3<f64>; 3]) -> Vector3<f64> {
        x[0] - x[1] * 2.0 + x[2]
    }
}

impl Term<3> for Bending {
    fn energy(&self, x: &[Vector3<f64>; 3]) -> f64 {
        0.5 * self.stiffness * Self::curvature(x).norm_squared()
    }

    fn forces(&self, x: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        CURVATURE.map(|weight| Self::curvature(x) * (-weight * self.stiffness))
    }

    fn hessian(&self, _x: &[Vector3<f64>; 3]) -> [[Matrix3; 3]; 3] {
        let block = |a: f64, b: f64| Matrix3::identity() * (self.stiffness * a * b);
        CURVATURE.map(|a| CURVATURE.map(|b| block(a, b)))
    }

    fn largest_stiffness(&self) -> f64 {
        // Of the matrix (1, −2, 1)ᵀ(1, −2, 1).
        6.0 * self.stiffness
    }
}

/// Depth of the end of a rod of `n` pieces.
fn depth(n: usize, (length, bending_stiffness, force): (f64, f64, f64)) -> f64 {
    let h = length / n as f64;
    let mut scene = Scene::default();
    // Two fixed nodes hold the direction, too.
    for k in 0..n + 2 {
        scene.add_node(Node {
            mass: h,
            fixed: k < 2,
            ..Node::at(Vector3::x() * (h * (k as f64 - 1.0)))
        });
        if k > 1 {
            scene.add_spring(k - 1, k, 1e5 / h);
        }
    }
    scene.loads.push(Load {
        name: String::new(),
        nodes: vec![n + 1],
        force: Vector3::new(0.0, 0.0, -force),
        over_time: OverTime::Constant,
    });
    scene.drag = 4.0 * h;
    scene.settings.duration = 20.0;
    scene.settings.step = StepControl::Tolerance(1e-4);
    let stiffness = bending_stiffness / h.powi(3);
    let rows = (0..n).map(|k| {
        // Half of what the first three stand for is in the wall.
        let share = if k == 0 { 2.0 } else { 1.0 };
        let stiffness = share * stiffness;
        ([k, k + 1, k + 2], Bending { stiffness })
    });
    let emitters: Vec<Box<dyn Emitter>> = vec![Box::new(Terms::new("bending", rows))];
    let mut simulation =
        Simulation::with_emitters(&scene, &RunOptions::default(), emitters).expect("a sound scene");
    simulation.run(1, &mut ()).expect("a run");
    -simulation.nodes().positions[n + 1].z
}

fn main() {
    let (length, bending_stiffness, force): (f64, f64, f64) = (1.0, 2.0, 0.1);
    let exact = force * length.powi(3) / (3.0 * bending_stiffness);
    println!("F L³/(3 EI) = {exact:.5} m");
    for n in [4, 8, 16] {
        let depth = depth(n, (length, bending_stiffness, force));
        let off = 100.0 * (depth / exact - 1.0);
        println!("{n:>3} pieces: {depth:.5} m, {off:+.1} %");
    }
}
