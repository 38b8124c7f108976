//! Solutions of all strategies beside those of dense matrices, and what is refused.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use springs_solver::{Options, SolveError, Solver, Strategy, Subspace};

/// A positive definite matrix: for every pair a block B that couples as
/// [[B, −B], [−B, B]], and the identity.
fn matrix(n_blocks: usize, pairs: &[[u32; 2]]) -> (Vec<[f64; 6]>, Vec<[f64; 6]>) {
    let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; n_blocks];
    let mut off_diagonal = Vec::new();
    for (index, pair) in pairs.iter().enumerate() {
        let u = [1.0, (index as f64).sin(), (2.0 * index as f64).cos()];
        let k = 10.0 + index as f64;
        let block = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|(r, c)| k * u[r] * u[c]);
        for &end in pair {
            for (entry, value) in diagonal[end as usize].iter_mut().zip(block) {
                *entry += value;
            }
        }
        off_diagonal.push(block.map(|value| -value));
    }
    (diagonal, off_diagonal)
}

fn dense(pairs: &[[u32; 2]], diagonal: &[[f64; 6]], off_diagonal: &[[f64; 6]]) -> DMatrix<f64> {
    let n = 3 * diagonal.len();
    let mut dense = DMatrix::zeros(n, n);
    let mut put = |row: usize, column: usize, block: &[f64; 6]| {
        for r in 0..3 {
            for c in 0..3 {
                let entry = [[0, 1, 2], [1, 3, 4], [2, 4, 5]][r][c];
                dense[(3 * row + r, 3 * column + c)] = block[entry];
            }
        }
    };
    for (row, block) in diagonal.iter().enumerate() {
        put(row, row, block);
    }
    for (&[a, b], block) in pairs.iter().zip(off_diagonal) {
        put(a as usize, b as usize, block);
        put(b as usize, a as usize, block);
    }
    dense
}

fn grid(n: u32) -> Vec<[u32; 2]> {
    let mut pairs = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let node = j * n + i;
            if i + 1 < n {
                pairs.push([node + 1, node]);
            }
            if j + 1 < n {
                pairs.push([node, node + n]);
            }
        }
    }
    pairs
}

fn chain(n: u32) -> Vec<[u32; 2]> {
    (1..n).map(|node| [node - 1, node]).collect()
}

fn complete(n: u32) -> Vec<[u32; 2]> {
    (0..n).flat_map(|b| (0..b).map(move |a| [a, b])).collect()
}

fn tree(n: u32) -> Vec<[u32; 2]> {
    (1..n).map(|node| [(node - 1) / 3, node]).collect()
}

#[test]
fn solutions_equal_dense_ones() {
    let cases = [
        (1, vec![]),
        (40, chain(40)),
        (50, tree(50)),
        (64, grid(8)),
        (900, grid(30)),
        // One front of several tiles.
        (150, complete(150)),
    ];
    for (n_blocks, pairs) in cases {
        let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
        let dense = dense(&pairs, &diagonal, &off_diagonal);
        let expected = DVector::from_fn(3 * n_blocks, |row, _| (row as f64).cos());
        let mut x: Vec<f64> = (&dense * &expected).iter().copied().collect();
        let mut solver = Solver::analyze(n_blocks, &pairs, Options::default()).unwrap();
        // Twice, to see that nothing is left over from the first time.
        for _ in 0..2 {
            solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        }
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        let error = (DVector::from_vec(x) - expected).amax();
        // No eigenvalue is below 1, so this is a bound of the condition.
        let condition = dense
            .row_iter()
            .map(|row| row.lp_norm(1))
            .fold(0.0, f64::max);
        let rounding = 8.0 * f64::EPSILON * condition;
        assert!(
            error < rounding,
            "{n_blocks} blocks: {error:e} > {rounding:e}"
        );
    }
}

#[test]
fn a_non_positive_pivot_names_its_block() {
    for (n_blocks, pairs) in [(30, chain(30)), (49, grid(7))] {
        let (diagonal, off_diagonal) = matrix(n_blocks, &pairs);
        let mut solver = Solver::analyze(n_blocks, &pairs, Options::default()).unwrap();
        for block in [0, 7, n_blocks - 1] {
            for entry in [0, 3, 5] {
                for bad in [-1e9, f64::NAN] {
                    let mut diagonal = diagonal.clone();
                    diagonal[block][entry] = bad;
                    let error = solver.set_matrix(&diagonal, &off_diagonal).unwrap_err();
                    if bad < 0.0 {
                        assert_eq!(error, SolveError::NotPositiveDefinite { block });
                    }
                }
            }
        }
        assert!(solver.set_matrix(&diagonal, &off_diagonal).is_ok());
    }
}

#[test]
fn every_route_is_as_accurate_as_asked_for() {
    let pairs = grid(30);
    for (strategy, stiffness) in [
        (Strategy::Double, 1e8),
        (Strategy::Iterative, 1.0),
        (Strategy::Iterative, 1e4),
    ] {
        let options = Options {
            strategy,
            ..Options::default()
        };
        let (mut diagonal, mut off_diagonal) = matrix(900, &pairs);
        for block in &mut off_diagonal {
            *block = block.map(|value| stiffness * value);
        }
        for block in &mut diagonal {
            let [xx, xy, xz, yy, yz, zz] = block.map(|value| stiffness * value);
            *block = [xx + 1.0, xy, xz, yy + 1.0, yz, zz + 1.0];
        }
        let expected: Vec<f64> = (0..2700).map(|row| f64::from(row).cos()).collect();
        let product =
            dense(&pairs, &diagonal, &off_diagonal) * DVector::from_column_slice(&expected);
        let mut x: Vec<f64> = product.iter().copied().collect();
        let mut solver = Solver::analyze(900, &pairs, options).unwrap();
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        let dense = dense(&pairs, &diagonal, &off_diagonal);
        let expected = DVector::from_vec(expected);
        let error = DVector::from_vec(x) - &expected;
        let norm = |x: &DVector<f64>| x.dot(&(&dense * x)).sqrt();
        let relative = norm(&error) / norm(&expected);
        assert!(
            relative < 1e-10,
            "{strategy:?}, {stiffness:e}: {relative:e}"
        );
    }
}

/// An eigenvalue far below zero, one just below, a negative diagonal.
#[test]
fn iteration_finds_indefinite_matrices() {
    let pairs = grid(20);
    let options = Options {
        strategy: Strategy::Iterative,
        ..Options::default()
    };
    let mut solver = Solver::analyze(400, &pairs, options).unwrap();
    let (sound, off_diagonal) = matrix(400, &pairs);
    let b: Vec<f64> = (0..1200).map(|row| f64::from(row).cos()).collect();
    for (shift, is_definite) in [(0.0, true), (-0.9, true), (-1.5, false), (-1e4, false)] {
        let mut diagonal = sound.clone();
        for block in &mut diagonal {
            for entry in [0, 3, 5] {
                block[entry] += shift;
            }
        }
        let mut x = b.clone();
        let solved = solver
            .set_matrix(&diagonal, &off_diagonal)
            .and_then(|()| solver.solve_in_place(&mut x, 1e-11));
        assert_eq!(solved.is_ok(), is_definite, "{shift}");
        assert!(is_definite || x == b, "b must be as it was");
    }
}

/// Iteration that takes too long is given up, for a while.
#[test]
fn stalled_iteration_falls_back_to_a_factor() {
    let side: u32 = 16;
    let at = |x, y, z| (side * x + y) * side + z;
    let mut pairs = Vec::new();
    let mut positions = Vec::new();
    for (x, y, z) in (0..side.pow(3)).map(|k| (k / side / side, k / side % side, k % side)) {
        positions.push([x, y, z].map(f64::from));
        let ends = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
        let inside = ends.into_iter().filter(|&(x, y, z)| x.max(y).max(z) < side);
        pairs.extend(inside.map(|(a, b, c)| [at(x, y, z), at(a, b, c)]));
    }
    let n_blocks = positions.len();
    let options = Options {
        positions: Some(&positions),
        strategy: Strategy::Auto,
        ..Options::default()
    };
    let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
    // Springs without any stiffness across: hardly anything holds them.
    let (mut diagonal, mut off_diagonal) = matrix(n_blocks, &pairs);
    for block in diagonal.iter_mut().chain(&mut off_diagonal) {
        *block = block.map(|entry| 1e9 * entry);
    }
    for block in &mut diagonal {
        for entry in [0, 3, 5] {
            block[entry] += 1.0 - 1e9;
        }
    }
    let b: Vec<f64> = (0..3 * n_blocks).map(|row| (row as f64).cos()).collect();
    let solve = |solver: &mut Solver| {
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        let mut x = b.clone();
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        x
    };
    let x = solve(&mut solver);
    let first = solver.counts();
    assert!(
        first.iterations > 0 && first.factorizations > 0,
        "{first:?}"
    );
    assert_eq!(solve(&mut solver), x);
    let second = solver.counts();
    assert_eq!(second.iterations, first.iterations, "no second attempt");
}

/// Blocks K n nᵀ + T(I − n nᵀ) for n in a plane or on a line keep
/// solutions there, and those are the ones of the whole matrix.
#[test]
fn subspaces_have_the_solutions_of_the_whole() {
    let pairs = grid(6);
    let first = Vector3::new(0.36, 0.48, -0.8);
    let second = Vector3::new(0.8, -0.6, 0.0);
    let in_plane = |k: f64| first * k.cos() + second * k.sin();
    for (subspace, flat) in [
        (Subspace::Plane([first.into(), second.into()]), false),
        (Subspace::Line(first.into()), true),
        (Subspace::Isotropic, false),
    ] {
        let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; 36];
        let mut off_diagonal = Vec::new();
        for (k, pair) in (1u32..).map(f64::from).zip(&pairs) {
            let n = if flat { first } else { in_plane(k) };
            let (along, across) = match subspace {
                Subspace::Isotropic => (k, k),
                _ => (10.0 * k, k),
            };
            let block = Matrix3::identity() * across + n * n.transpose() * (along - across);
            let block = [
                block.m11, block.m12, block.m13, block.m22, block.m23, block.m33,
            ];
            for &end in pair {
                for (sum, entry) in diagonal[end as usize].iter_mut().zip(block) {
                    *sum += entry;
                }
            }
            off_diagonal.push(block.map(|entry| -entry));
        }
        let b: Vec<f64> = (0..36u32)
            .flat_map(|k| match (flat, subspace) {
                (true, _) => <[f64; 3]>::from(first * f64::from(k).sin()),
                (_, Subspace::Isotropic) => [1.0, f64::from(k), -2.0],
                _ => in_plane(f64::from(k)).into(),
            })
            .collect();
        let solve = |subspace| {
            let options = Options {
                subspace,
                ..Options::default()
            };
            let mut solver = Solver::analyze(36, &pairs, options).unwrap();
            let mut x = b.clone();
            for _ in 0..2 {
                solver.set_matrix(&diagonal, &off_diagonal).unwrap();
                x.copy_from_slice(&b);
                solver.solve_in_place(&mut x, 1e-11).unwrap();
            }
            (x, solver.counts().factorizations)
        };
        let ((whole, _), (reduced, factorizations)) = (solve(Subspace::Space), solve(subspace));
        let off = whole.iter().zip(&reduced).map(|(a, b)| (a - b).abs());
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 1e-13, "{subspace:?}: {worst:e}");
        assert_eq!(factorizations, 1, "the same matrix twice");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mut pairs = grid(60);
    // A corner where everything is coupled: a front of several tiles.
    let corner = complete(150)
        .into_iter()
        .filter(|pair| !pairs.contains(pair));
    let corner: Vec<[u32; 2]> = corner.collect();
    pairs.retain(|pair| !corner.contains(&[pair[1], pair[0]]));
    pairs.extend(corner);
    let (diagonal, off_diagonal) = matrix(3600, &pairs);
    let positions: Vec<[f64; 3]> = (0..3600)
        .map(|block| [f64::from(block % 60), f64::from(block / 60), 0.0])
        .collect();
    let solution = |strategy, threads| {
        let options = Options {
            positions: Some(&positions),
            threads,
            strategy,
            ..Options::default()
        };
        let mut solver = Solver::analyze(3600, &pairs, options).unwrap();
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        let mut x: Vec<f64> = (0..3 * 3600).map(|row| f64::from(row).sin()).collect();
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        x
    };
    for strategy in [Strategy::Double, Strategy::Iterative] {
        let alone = solution(strategy, 1);
        for threads in [2, 3, 8] {
            let together = solution(strategy, threads);
            assert_eq!(alone, together, "{strategy:?}, {threads} threads");
        }
    }
}

#[test]
fn an_empty_system_is_solved() {
    let mut solver = Solver::analyze(0, &[], Options::default()).unwrap();
    solver.set_matrix(&[], &[[0.0; 6]; 0]).unwrap();
    solver.solve_in_place(&mut [], 1e-11).unwrap();
}

#[test]
fn bad_patterns_are_refused() {
    let error = |pairs: &[[u32; 2]]| Solver::analyze(3, pairs, Options::default()).err().unwrap();
    let (pair, block, n_blocks) = (1, 3, 3);
    assert_eq!(
        error(&[[0, 1], [3, 1]]),
        SolveError::NoSuchBlock {
            pair,
            block,
            n_blocks
        }
    );
    assert_eq!(error(&[[0, 1], [2, 2]]), SolveError::RepeatedPair { pair });
    assert_eq!(error(&[[0, 1], [1, 0]]), SolveError::RepeatedPair { pair });
}
