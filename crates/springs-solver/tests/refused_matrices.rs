//! A solver answers from the last matrix that it took, and from no other.

use springs_solver::{Options, SolveError, Solver, Strategy, Subspace};

const ROUTES: [Strategy; 3] = [Strategy::Double, Strategy::Iterative, Strategy::Auto];

const SUBSPACES: [Subspace; 4] = [
    Subspace::Space,
    Subspace::Plane([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    Subspace::Line([1.0, 0.0, 0.0]),
    Subspace::Isotropic,
];

fn identity(s: f64) -> [f64; 6] {
    [s, 0.0, 0.0, s, 0.0, s]
}

/// A tree and a cycle of six blocks.
fn graphs() -> [Vec<[u32; 2]>; 2] {
    let chain: Vec<[u32; 2]> = (1..6).map(|block| [block - 1, block]).collect();
    let mut cycle = chain.clone();
    cycle.push([5, 0]);
    [chain, cycle]
}

fn in_all_ways(check: impl Fn(Solver, usize)) {
    for pairs in graphs() {
        for strategy in ROUTES {
            for subspace in SUBSPACES {
                let options = Options {
                    strategy,
                    subspace,
                    ..Options::default()
                };
                check(Solver::analyze(6, &pairs, options).unwrap(), pairs.len());
            }
        }
    }
}

#[test]
fn without_a_matrix_there_is_no_solution() {
    in_all_ways(|mut solver, _| {
        let solved = solver.solve_in_place(&mut [1.0; 18], 1e-11);
        assert_eq!(solved, Err(SolveError::NoMatrix));
    });
}

#[test]
fn a_refused_matrix_is_not_solved_with() {
    in_all_ways(|mut solver, n_pairs| {
        let off_diagonal = vec![identity(-1.0); n_pairs];
        let (sound, bad) = ([identity(3.0); 6], [identity(-3.0); 6]);
        let solution = |solver: &mut Solver| {
            let mut x = [1.0; 18];
            solver.solve_in_place(&mut x, 1e-11).map(|()| x)
        };
        solver.set_matrix(&sound, &off_diagonal).unwrap();
        let first = solution(&mut solver).unwrap();
        let refused = solver.set_matrix(&bad, &off_diagonal);
        assert!(matches!(
            refused,
            Err(SolveError::NotPositiveDefinite { .. })
        ));
        assert_eq!(solution(&mut solver), Err(SolveError::NoMatrix));
        // The refused one is looked at again, and the sound one taken again.
        assert!(solver.set_matrix(&bad, &off_diagonal).is_err());
        solver.set_matrix(&sound, &off_diagonal).unwrap();
        assert_eq!(solution(&mut solver), Ok(first));
    });
}

/// Iteration may find only while it solves that a matrix is not definite.
#[test]
fn what_a_solution_found_out_is_remembered() {
    let mut pairs: Vec<[u32; 2]> = (1..400).map(|block| [block - 1, block]).collect();
    pairs.push([399, 0]);
    let options = Options {
        strategy: Strategy::Iterative,
        ..Options::default()
    };
    let mut solver = Solver::analyze(400, &pairs, options).unwrap();
    // Eigenvalues 1.5 + 2 cos φ; the lowest, −0.5, is that of a vector with
    // alternating signs, which aggregates do not show.
    let signs = |block: usize| if block.is_multiple_of(2) { 1.0 } else { -1.0 };
    let off_diagonal = vec![identity(1.0); 400];
    solver
        .set_matrix(&[identity(1.5); 400], &off_diagonal)
        .unwrap();
    let b: Vec<f64> = (0..1200).map(|row| signs(row / 3)).collect();
    let mut solution = || solver.solve_in_place(&mut b.clone(), 1e-11);
    assert!(matches!(
        solution(),
        Err(SolveError::NotPositiveDefinite { .. })
    ));
    assert_eq!(solution(), Err(SolveError::NoMatrix));
}
