//! The assembly alone: mass and stiffness of a scene, and its vibrations.
//!
//! A string of 50 springs is stretched by 1 % between two walls. Its lowest
//! frequencies come out of a dense eigenvalue problem and are set beside those
//! of an ideal string. Of the workspace only `springs-scene` and
//! `springs-assembly` are used.
//!
//! ```text
//! cargo run --example stiffness_matrix
//! ```

use nalgebra::DMatrix;
use springs_assembly::{Evaluation, Weights, compile};
use springs_scene::generate::{Material, chain};

const SEGMENTS: usize = 50;
const MASS: f64 = 1.0;
const STRETCH: f64 = 1.01;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = chain(SEGMENTS, Material::of_chain(SEGMENTS));
    scene.gravity.fill(0.0);
    scene.nodes[SEGMENTS].fixed = true;
    for node in &mut scene.nodes {
        node.position *= STRETCH;
    }

    let system = compile(&scene)?;
    let (x, v) = (system.initial_positions(), system.initial_velocities());
    let at = Evaluation::new(x, v, Weights::STIFFNESS);
    let mut out = system.linearization();
    system.linearize(&at, &mut out);
    let unbalanced = out.forces.iter().map(|f| f.norm()).fold(0.0, f64::max);
    println!("largest unbalanced force: {unbalanced:.1e} N");

    // M^-½ K M^-½ from the triplets.
    let n = 3 * system.n_free();
    let root = |scalar: usize| system.masses()[scalar / 3].sqrt();
    let mut scaled = DMatrix::zeros(n, n);
    for (row, column, value) in out.matrix.triplets() {
        scaled[(row, column)] = value / (root(row) * root(column));
    }
    let mut squares: Vec<f64> = scaled.symmetric_eigenvalues().iter().copied().collect();
    squares.sort_by(f64::total_cmp);

    // f = k/2 √(T/(m L)); each frequency stands twice, across in y and in z.
    let stiffness = scene.springs[0].stiffness;
    let tension = stiffness * (STRETCH - 1.0) / SEGMENTS as f64;
    let fundamental = 0.5 * (tension / (MASS * STRETCH)).sqrt();
    println!("mode   string of springs   ideal string");
    for mode in 1..=5 {
        let frequency = squares[2 * (mode - 1)].sqrt() / std::f64::consts::TAU;
        let ideal = mode as f64 * fundamental;
        println!("{mode:4}   {frequency:14.4} Hz   {ideal:9.4} Hz");
    }
    Ok(())
}
