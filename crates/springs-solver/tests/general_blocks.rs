//! Off-diagonal blocks of nine numbers: solutions are those of dense matrices.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use springs_solver::{OffDiagonal, Options, Packing, SolveError, Solver, Strategy, Subspace};

type Pairs = Vec<[u32; 2]>;

/// A sequence of numbers in −1 … 1 that look random (an LCG of Knuth).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005);
        self.0 = self.0.wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / 2f64.powi(52) - 1.0
    }
}

/// Pairs in both orientations.
fn turned(pairs: Pairs) -> Pairs {
    let turn = |(k, [a, b]): (usize, [u32; 2])| if k % 3 == 1 { [b, a] } else { [a, b] };
    pairs.into_iter().enumerate().map(turn).collect()
}

fn grid(n: u32) -> Pairs {
    let right = (0..n * n).filter(|k| k % n + 1 < n).map(|k| [k, k + 1]);
    let down = (0..n * (n - 1)).map(|k| [k + n, k]);
    turned(right.chain(down).collect())
}

fn tree(n: u32) -> Pairs {
    turned(
        (1..n)
            .map(|node| [(node * 7 % n + node) / 2 % node, node])
            .collect(),
    )
}

fn complete(n: u32) -> Pairs {
    turned((0..n).flat_map(|b| (0..b).map(move |a| [a, b])).collect())
}

struct Matrix {
    diagonal: Vec<[f64; 6]>,
    off_diagonal: Vec<[f64; 9]>,
    dense: DMatrix<f64>,
}

/// The identity, and for every pair F Fᵀ with F of 6 × 4 random numbers, which are
/// components along the columns of `basis`.
fn matrix(n_blocks: usize, pairs: &[[u32; 2]], basis: &Matrix3<f64>) -> Matrix {
    let mut random = Random(n_blocks as u64);
    let mut both = SMatrix::<f64, 6, 6>::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(basis);
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(basis);
    let mut dense = DMatrix::identity(3 * n_blocks, 3 * n_blocks);
    for pair in pairs {
        // No rows for columns that are zero.
        let f = both * SMatrix::<f64, 6, 4>::from_fn(|_, _| random.next());
        let part = f * f.transpose();
        let starts = pair.map(|block| 3 * block as usize);
        for (i, row) in starts.into_iter().enumerate() {
            for (j, column) in starts.into_iter().enumerate() {
                let mut block = dense.fixed_view_mut::<3, 3>(row, column);
                block += part.fixed_view::<3, 3>(3 * i, 3 * j);
            }
        }
    }
    let block =
        |row: u32, column: u32| dense.fixed_view::<3, 3>(3 * row as usize, 3 * column as usize);
    let diagonal = (0..n_blocks as u32).map(|row| {
        let b = block(row, row);
        [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|at| b[at])
    });
    let off_diagonal = pairs.iter().map(|&[row, column]| {
        let b = block(row, column);
        std::array::from_fn(|k| b[(k / 3, k % 3)])
    });
    Matrix {
        diagonal: diagonal.collect(),
        off_diagonal: off_diagonal.collect(),
        dense,
    }
}

/// Solves for a known vector whose blocks are in the span of `basis`, and says how
/// wrong the solution is, in the norm of the matrix and relative to it.
fn relative_error(
    pairs: &[[u32; 2]],
    matrix: &Matrix,
    basis: &Matrix3<f64>,
    options: Options<'_>,
) -> f64 {
    let n_blocks = matrix.diagonal.len();
    let mut solver = Solver::analyze(n_blocks, pairs, options).unwrap();
    let mut random = Random(1);
    let mut expected = DVector::zeros(3 * n_blocks);
    for block in 0..n_blocks {
        let components = Vector3::from_fn(|_, _| random.next());
        let mut block = expected.fixed_rows_mut::<3>(3 * block);
        block.copy_from(&(basis * components));
    }
    let mut x: Vec<f64> = (&matrix.dense * &expected).iter().copied().collect();
    // Twice, to see that nothing is left over from the first time.
    for _ in 0..2 {
        solver
            .set_matrix(&matrix.diagonal, &matrix.off_diagonal)
            .unwrap();
    }
    solver.solve_in_place(&mut x, 1e-12).unwrap();
    let norm = |x: &DVector<f64>| x.dot(&(&matrix.dense * x)).sqrt();
    norm(&(DVector::from_vec(x) - &expected)) / norm(&expected)
}

fn general(strategy: Strategy, subspace: Subspace) -> Options<'static> {
    Options {
        strategy,
        subspace,
        packing: Packing::General,
        ..Options::default()
    }
}

/// The columns that span space, a plane, a line; the others are zero.
fn subspaces() -> [(Subspace, Matrix3<f64>); 3] {
    let first = Vector3::new(0.36, 0.48, -0.8);
    let second = Vector3::new(0.8, -0.6, 0.0);
    let zero = Vector3::zeros();
    [
        (Subspace::Space, Matrix3::identity()),
        (
            Subspace::Plane([first.into(), second.into()]),
            Matrix3::from_columns(&[first, second, zero]),
        ),
        (
            Subspace::Line(first.into()),
            Matrix3::from_columns(&[first, zero, zero]),
        ),
    ]
}

/// Trees, small fronts, dense ones of several tiles, one and several levels.
#[test]
fn solutions_equal_dense_ones_on_every_route_and_in_every_subspace() {
    for (n_blocks, pairs) in [
        (2, vec![[1, 0]]),
        (60, tree(60)),
        (49, grid(7)),
        (400, grid(20)),
        (80, complete(80)),
    ] {
        for (subspace, basis) in subspaces() {
            let matrix = matrix(n_blocks, &pairs, &basis);
            for strategy in [Strategy::Double, Strategy::Iterative, Strategy::Auto] {
                let options = general(strategy, subspace);
                let error = relative_error(&pairs, &matrix, &basis, options);
                // The accuracy asked for, and rounding times the root of the condition.
                assert!(
                    error < 1e-10,
                    "{n_blocks} blocks, {strategy:?}, {subspace:?}: {error:e}"
                );
            }
        }
    }
}

/// A block at (a, b) and its transpose at (b, a) are one matrix.
#[test]
fn a_turned_pair_has_the_transposed_block() {
    for (n_blocks, pairs) in [(60, tree(60)), (100, grid(10))] {
        let mut matrix = matrix(n_blocks, &pairs, &Matrix3::identity());
        let solution = |pairs: &[[u32; 2]], matrix: &Matrix, strategy| {
            let options = general(strategy, Subspace::Space);
            let mut solver = Solver::analyze(n_blocks, pairs, options).unwrap();
            let (diagonal, blocks) = (&matrix.diagonal, &matrix.off_diagonal);
            solver.set_matrix(diagonal, blocks).unwrap();
            let mut x: Vec<f64> = (0..3 * n_blocks).map(|row| (row as f64).sin()).collect();
            solver.solve_in_place(&mut x, 1e-12).unwrap();
            x
        };
        let strategies = [Strategy::Double, Strategy::Iterative];
        let before = strategies.map(|strategy| solution(&pairs, &matrix, strategy));
        let turned: Pairs = pairs.iter().map(|&[a, b]| [b, a]).collect();
        for block in &mut matrix.off_diagonal {
            let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *block;
            *block = [xx, yx, zx, xy, yy, zy, xz, yz, zz];
        }
        assert_eq!(
            before,
            strategies.map(|strategy| solution(&turned, &matrix, strategy))
        );
    }
}

/// Symmetric blocks may be given either way.
#[test]
fn nine_numbers_of_symmetric_blocks_give_the_same_bits() {
    for (n_blocks, pairs) in [(60, tree(60)), (400, grid(20)), (80, complete(80))] {
        let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; n_blocks];
        let mut six = Vec::new();
        for (k, pair) in pairs.iter().enumerate() {
            let n = SVector::<f64, 3>::new(1.0, (k as f64).sin(), (2.0 * k as f64).cos());
            let b = n * n.transpose() * (1.0 + k as f64);
            let b = [b.m11, b.m12, b.m13, b.m22, b.m23, b.m33];
            for &end in pair {
                for (sum, entry) in diagonal[end as usize].iter_mut().zip(b) {
                    *sum += entry;
                }
            }
            six.push(b.map(|entry| -entry));
        }
        let nine = |&[xx, xy, xz, yy, yz, zz]: &[f64; 6]| [xx, xy, xz, xy, yy, yz, xz, yz, zz];
        let nine: Vec<[f64; 9]> = six.iter().map(nine).collect();
        for strategy in [Strategy::Double, Strategy::Iterative] {
            let [first, second] =
                [OffDiagonal::from(&six), OffDiagonal::from(&nine)].map(|blocks| {
                    let packing = match blocks {
                        OffDiagonal::Symmetric(_) => Packing::Symmetric,
                        OffDiagonal::General(_) => Packing::General,
                    };
                    let options = Options {
                        packing,
                        strategy,
                        ..Options::default()
                    };
                    let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
                    solver.set_matrix(&diagonal, blocks).unwrap();
                    let mut x: Vec<f64> = (0..3 * n_blocks).map(|row| (row as f64).cos()).collect();
                    solver.solve_in_place(&mut x, 1e-11).unwrap();
                    x
                });
            assert_eq!(first, second, "{n_blocks} blocks, {strategy:?}");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let pairs = grid(30);
    let matrix = matrix(900, &pairs, &Matrix3::identity());
    for strategy in [Strategy::Double, Strategy::Iterative] {
        let [alone, together] = [1, 3].map(|threads| {
            let options = Options {
                threads,
                ..general(strategy, Subspace::Space)
            };
            let mut solver = Solver::analyze(900, &pairs, options).unwrap();
            let (diagonal, blocks) = (&matrix.diagonal, &matrix.off_diagonal);
            solver.set_matrix(diagonal, blocks).unwrap();
            let mut x: Vec<f64> = (0..2700).map(|row| f64::from(row).sin()).collect();
            solver.solve_in_place(&mut x, 1e-11).unwrap();
            x
        });
        assert_eq!(alone, together, "{strategy:?}");
    }
}

#[test]
fn indefinite_matrices_are_found() {
    let pairs = grid(7);
    let sound = matrix(49, &pairs, &Matrix3::identity());
    for strategy in [Strategy::Double, Strategy::Iterative] {
        let options = general(strategy, Subspace::Space);
        let mut solver = Solver::analyze(49, &pairs, options).unwrap();
        let mut diagonal = sound.diagonal.clone();
        diagonal[20][3] = -1e9;
        let refused = solver.set_matrix(&diagonal, &sound.off_diagonal);
        assert_eq!(refused, Err(SolveError::NotPositiveDefinite { block: 20 }));
    }
}

#[test]
#[should_panic(expected = "packing of the options")]
fn blocks_of_another_packing_are_refused() {
    let mut solver = Solver::analyze(2, &[[0, 1]], Options::default()).unwrap();
    let _ = solver.set_matrix(&[[1.0; 6]; 2], &[[0.0; 9]]);
}

#[test]
#[should_panic(expected = "multiples of the identity")]
fn general_blocks_are_no_multiples_of_the_identity() {
    let options = general(Strategy::Double, Subspace::Isotropic);
    let _ = Solver::analyze(2, &[[0, 1]], options);
}
