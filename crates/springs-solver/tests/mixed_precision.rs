//! Single precision is left alone where it does not help.

use springs_solver::{Counts, Options, Route, Solver};

const SIDE: u32 = 30;

fn pairs() -> Vec<[u32; 2]> {
    let right = (0..SIDE * SIDE)
        .filter(|block| block % SIDE + 1 < SIDE)
        .map(|block| [block, block + 1]);
    let down = (0..SIDE * (SIDE - 1)).map(|block| [block, block + SIDE]);
    right.chain(down).collect()
}

fn isotropic(s: f64) -> [f64; 6] {
    [s, 0.0, 0.0, s, 0.0, s]
}

/// Solves with unit masses on a grid of springs, nothing fixed, for each of these
/// stiffnesses, and says what that took. Ones times the stiffness matrix are zero,
/// so ones are solved for.
fn solve_each(solver: &mut Solver, stiffnesses: impl Iterator<Item = f64>) -> Counts {
    let (pairs, before) = (pairs(), solver.counts());
    for stiffness in stiffnesses {
        let mut diagonal = vec![isotropic(1.0); (SIDE * SIDE) as usize];
        for &block in pairs.as_flattened() {
            for entry in [0, 3, 5] {
                diagonal[block as usize][entry] += stiffness;
            }
        }
        let off_diagonal = vec![isotropic(-stiffness); pairs.len()];
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        let mut x: Vec<f64> = (0..3 * SIDE * SIDE)
            .map(|row| 1.0 + f64::from(row).cos())
            .collect();
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        assert!((mean - 1.0).abs() < 1e-3, "{stiffness:e}: {mean}");
    }
    let after = solver.counts();
    Counts {
        factorizations: after.factorizations - before.factorizations,
        solutions: after.solutions - before.solutions,
        iterations: after.iterations - before.iterations,
    }
}

fn solver() -> Solver {
    let options = Options {
        route: Route::Mixed,
        ..Options::default()
    };
    Solver::analyze((SIDE * SIDE) as usize, &pairs(), options).unwrap()
}

/// No two matrices are the same.
fn about(stiffness: f64, n: u32) -> impl Iterator<Item = f64> {
    (0..n).map(move |k| stiffness * (1.0 + 1e-3 * f64::from(k)))
}

/// It is worth its while, and nothing else is done.
#[test]
fn it_stays_where_it_helps() {
    for stiffness in [1.0, 1e4, 1e6] {
        let counts = solve_each(&mut solver(), about(stiffness, 200));
        assert_eq!(counts.factorizations, 200, "{stiffness:e}");
        assert!(counts.iterations >= 400, "{stiffness:e}");
    }
}

/// Where it does not, both factors were made for every other matrix.
#[test]
fn it_is_tried_less_and_less_where_it_does_not_help() {
    for stiffness in [1e8, 1e10] {
        let counts = solve_each(&mut solver(), about(stiffness, 200));
        assert!(counts.factorizations <= 212, "{stiffness:e}: {counts:?}");
        assert!(counts.iterations <= 12 * 24, "{stiffness:e}: {counts:?}");
    }
}

#[test]
fn it_is_tried_again_when_it_may_help() {
    let mut solver = solver();
    solve_each(&mut solver, about(1e10, 100));
    let counts = solve_each(&mut solver, about(1.0, 300));
    assert_eq!(counts.factorizations, 300);
    assert!(counts.iterations >= 2 * 200, "{counts:?}");
}

/// A run that goes on elsewhere does the same.
#[test]
fn the_pause_is_part_of_what_a_solver_has_learned() {
    let (mut first, mut second) = (solver(), solver());
    solve_each(&mut first, about(1e10, 30));
    *second.experience() = *first.experience();
    let [first, second] =
        [&mut first, &mut second].map(|solver| solve_each(solver, about(1e10, 50)));
    assert_eq!(first, second);
}
