//! Iteration is compared with a factor for all right-hand sides of a matrix.

use springs_solver::{Options, Solver, Strategy};

/// A cube of blocks, each joined with its neighbours.
fn cube(side: u32) -> (Vec<[f64; 3]>, Vec<[u32; 2]>) {
    let at = |x, y, z| (side * x + y) * side + z;
    let (mut positions, mut pairs) = (Vec::new(), Vec::new());
    for (x, y, z) in (0..side.pow(3)).map(|k| (k / side / side, k / side % side, k % side)) {
        positions.push([x, y, z].map(f64::from));
        let ends = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
        let inside = ends.into_iter().filter(|&(x, y, z)| x.max(y).max(z) < side);
        pairs.extend(inside.map(|(a, b, c)| [at(x, y, z), at(a, b, c)]));
    }
    (positions, pairs)
}

/// Factorizations for ten matrices, none like another, each solved for so many
/// right-hand sides.
fn factorizations(side: u32, stiffness: f64, n_solutions: u32) -> u64 {
    let (positions, pairs) = cube(side);
    let options = Options {
        positions: Some(&positions),
        strategy: Strategy::Auto,
        ..Options::default()
    };
    let isotropic = |s: f64| [s, 0.0, 0.0, s, 0.0, s];
    let mut solver = Solver::analyze(positions.len(), &pairs, options).unwrap();
    for k in 0..10 {
        let stiffness = stiffness * (1.0 + 1e-3 * f64::from(k));
        let mut diagonal = vec![isotropic(1.0); positions.len()];
        for &block in pairs.as_flattened() {
            for entry in [0, 3, 5] {
                diagonal[block as usize][entry] += stiffness;
            }
        }
        let off_diagonal = vec![isotropic(-stiffness); pairs.len()];
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        for phase in 0..n_solutions {
            let row = |row: u32| f64::from(row + phase).cos();
            let mut x: Vec<f64> = (0..3 * side.pow(3)).map(row).collect();
            solver.solve_in_place(&mut x, 1e-11).unwrap();
        }
    }
    solver.counts().factorizations
}

/// A factor and six substitutions cost more than 60 iterations here, though a
/// factor and one cost less.
#[test]
fn substitutions_count_as_often_as_they_would_be_made() {
    assert_eq!(factorizations(12, 1.0, 6), 0);
    assert_eq!(factorizations(12, 1e3, 6), 0);
}

/// 19 iterations are cheap, six times as many are not: those for the first matrix are given
/// up, and the others are not tried.
#[test]
fn iterations_count_for_all_solutions() {
    assert_eq!(factorizations(10, 100.0, 1), 0);
    assert_eq!(factorizations(10, 100.0, 6), 10);
}
