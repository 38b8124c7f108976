//! Chains, trees and forests: solutions are those of dense matrices, and the bits the
//! same for any number of threads.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};
use springs_solver::{OffDiagonal, Options, Packing, SolveError, Solver, Subspace};
use springs_threads::with_threads;

type Pairs = Vec<[u32; 2]>;

/// A sequence of numbers that look random (an LCG of Knuth).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005);
        self.0 = self.0.wrapping_add(1442695040888963407);
        self.0 >> 11
    }

    /// In −1 … 1.
    fn next(&mut self) -> f64 {
        self.bits() as f64 / 2f64.powi(52) - 1.0
    }

    fn below(&mut self, n: u32) -> u32 {
        (self.bits() % u64::from(n)) as u32
    }
}

/// Pairs in both orientations, of blocks in any order.
fn shuffled(n: u32, pairs: Pairs) -> Pairs {
    let mut random = Random(u64::from(n));
    let mut names: Vec<u32> = (0..n).collect();
    for last in (1..n).rev() {
        names.swap(last as usize, random.below(last + 1) as usize);
    }
    let named = pairs
        .into_iter()
        .map(|pair| pair.map(|block| names[block as usize]));
    let mut pairs: Pairs = named.collect();
    for last in (1..pairs.len()).rev() {
        pairs.swap(last, random.below(last as u32 + 1) as usize);
    }
    for pair in pairs.iter_mut().step_by(2) {
        pair.reverse();
    }
    pairs
}

/// Forests of n blocks and more of all shapes.
fn forests(n: u32) -> Vec<(&'static str, Pairs)> {
    let mut random = Random(n.into());
    let blocks = 1..n;
    let chain: Pairs = blocks.clone().map(|b| [b - 1, b]).collect();
    let many = blocks.clone().filter(|b| b % 7 > 0).map(|b| [b - 1, b]);
    let arms = blocks.clone().map(|b| [b.saturating_sub(5), b]);
    // A long handle with a broom.
    let broom = blocks
        .clone()
        .map(|b| [if 2 * b < n { b - 1 } else { n / 2 }, b]);
    vec![
        ("shuffled chain", shuffled(n, chain.clone())),
        ("chain", chain),
        ("star", blocks.clone().map(|b| [b, 0]).collect()),
        (
            "caterpillar",
            blocks.clone().map(|b| [(b - 1) & !1, b]).collect(),
        ),
        (
            "binary tree",
            blocks.clone().map(|b| [(b - 1) / 2, b]).collect(),
        ),
        ("chains", many.collect()),
        ("arms", arms.collect()),
        ("broom", broom.filter(|[a, b]| a != b).collect()),
        (
            "random tree",
            shuffled(n, blocks.clone().map(|b| [random.below(b), b]).collect()),
        ),
        (
            "deep tree",
            blocks
                .map(|b| [b - 1 - random.below(b.min(4)), b])
                .collect(),
        ),
        ("no pairs", vec![]),
    ]
}

struct Matrix {
    diagonal: Vec<[f64; 6]>,
    off_diagonal: Vec<[f64; 9]>,
}

/// The identity times a mass, and for every pair F Fᵀ with F of 6 × 4 random numbers, which are
/// components along the columns of `basis`.
fn matrix(n_blocks: usize, pairs: &[[u32; 2]], basis: &Matrix3<f64>, mass: f64) -> Matrix {
    let mut random = Random(n_blocks as u64);
    let mut both = SMatrix::<f64, 6, 6>::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(basis);
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(basis);
    let mut diagonal = vec![[mass, 0.0, 0.0, mass, 0.0, mass]; n_blocks];
    let mut off_diagonal = Vec::new();
    for pair in pairs {
        let f = both * SMatrix::<f64, 6, 4>::from_fn(|_, _| random.next());
        let part = f * f.transpose();
        for (end, &block) in pair.iter().enumerate() {
            let places = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            for (entry, (row, column)) in diagonal[block as usize].iter_mut().zip(places) {
                *entry += part[(3 * end + row, 3 * end + column)];
            }
        }
        off_diagonal.push(std::array::from_fn(|k| part[(k / 3, 3 + k % 3)]));
    }
    Matrix {
        diagonal,
        off_diagonal,
    }
}

fn dense(pairs: &[[u32; 2]], matrix: &Matrix) -> DMatrix<f64> {
    let n = 3 * matrix.diagonal.len();
    let mut dense = DMatrix::zeros(n, n);
    for (block, entries) in matrix.diagonal.iter().enumerate() {
        for (k, place) in [0, 1, 2, 1, 3, 4, 2, 4, 5].into_iter().enumerate() {
            dense[(3 * block + k / 3, 3 * block + k % 3)] = entries[place];
        }
    }
    for ([a, b], entries) in pairs.iter().zip(&matrix.off_diagonal) {
        for (k, &entry) in entries.iter().enumerate() {
            let (row, column) = (3 * *a as usize + k / 3, 3 * *b as usize + k % 3);
            dense[(row, column)] = entry;
            dense[(column, row)] = entry;
        }
    }
    dense
}

fn general(subspace: Subspace) -> Options<'static> {
    Options {
        subspace,
        packing: Packing::General,
        ..Options::default()
    }
}

/// In space, in a plane and on a line, with blocks of nine numbers; masses down to 1e-6.
#[test]
fn solutions_equal_dense_ones() {
    let first = Vector3::new(0.36, 0.48, -0.8);
    let second = Vector3::new(0.8, -0.6, 0.0);
    let zero = Vector3::zeros();
    let subspaces = [
        (Subspace::Space, Matrix3::identity()),
        (
            Subspace::Plane([first.into(), second.into()]),
            Matrix3::from_columns(&[first, second, zero]),
        ),
        (
            Subspace::Line(first.into()),
            Matrix3::from_columns(&[first, zero, zero]),
        ),
    ];
    for n in [1, 2, 3, 4, 9, 40] {
        for (name, pairs) in forests(n) {
            for (subspace, basis) in subspaces {
                for mass in [1.0, 1e-6] {
                    let matrix = matrix(n as usize, &pairs, &basis, mass);
                    let dense = dense(&pairs, &matrix);
                    let mut random = Random(1);
                    let mut expected = DVector::zeros(3 * n as usize);
                    for block in 0..n as usize {
                        let components = Vector3::from_fn(|_, _| random.next());
                        let mut block = expected.fixed_rows_mut::<3>(3 * block);
                        block.copy_from(&(basis * components));
                    }
                    let mut solver =
                        Solver::analyze(n as usize, &pairs, general(subspace)).unwrap();
                    // Twice, to see that nothing is left over from the first time.
                    for _ in 0..2 {
                        solver
                            .set_matrix(&matrix.diagonal, &matrix.off_diagonal)
                            .unwrap();
                        let b = &dense * &expected;
                        let mut x: Vec<f64> = b.iter().copied().collect();
                        solver.solve_in_place(&mut x, 1e-12).unwrap();
                        let error = DVector::from_vec(x) - &expected;
                        let energy = error.dot(&(&dense * &error));
                        let relative = (energy / expected.dot(&b)).sqrt();
                        // Rounding times the root of the condition, up to 1e4.
                        assert!(
                            relative < 1e-13 / mass.sqrt(),
                            "{name} of {n}, {subspace:?}, {mass}: {relative:e}"
                        );
                    }
                }
            }
        }
    }
}

/// Forests large enough to be cut in parts; refused matrices have the same block.
#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let n = 20_000;
    for (name, pairs) in forests(n) {
        let sound = matrix(n as usize, &pairs, &Matrix3::identity(), 1.0);
        let expected: Vec<f64> = (0..3 * n).map(|row| f64::from(row).cos()).collect();
        let b = product(&pairs, &sound, &expected);
        let mut unsound = sound.diagonal.clone();
        for block in [n / 9, n / 3, n - n / 7] {
            unsound[block as usize][3] = -1e9;
        }
        let blocks = OffDiagonal::from(&sound.off_diagonal);
        let solve = || {
            let mut solver = Solver::analyze(n as usize, &pairs, general(Subspace::Space)).unwrap();
            let refused = solver.set_matrix(&unsound, blocks).unwrap_err();
            solver.set_matrix(&sound.diagonal, blocks).unwrap();
            let mut x = b.clone();
            for _ in 0..2 {
                x.copy_from_slice(&b);
                solver.solve_in_place(&mut x, 1e-12).unwrap();
            }
            (x, refused)
        };
        let alone = solve();
        let errors = alone.0.iter().zip(&expected).map(|(a, b)| (a - b).abs());
        let error = errors.fold(0.0, f64::max);
        // Rounding times the condition, which comes to the most neighbours of a block.
        let condition = sound
            .diagonal
            .iter()
            .map(|d| d[0] + d[3] + d[5])
            .fold(0.0, f64::max);
        assert!(error < 1e-15 * condition.max(100.0), "{name}: {error:e}");
        let SolveError::NotPositiveDefinite { block } = alone.1 else {
            panic!("{name}: {:?}", alone.1);
        };
        assert!(unsound[block][3] < 0.0, "{name}: {block}");
        for threads in [2, 3, 8] {
            assert!(with_threads(threads, solve) == alone, "{name}, {threads}");
        }
    }
}

fn product(pairs: &[[u32; 2]], matrix: &Matrix, x: &[f64]) -> Vec<f64> {
    let mut b = vec![0.0; x.len()];
    for (block, entries) in matrix.diagonal.iter().enumerate() {
        for (k, place) in [0, 1, 2, 1, 3, 4, 2, 4, 5].into_iter().enumerate() {
            b[3 * block + k / 3] += entries[place] * x[3 * block + k % 3];
        }
    }
    for (pair, entries) in pairs.iter().zip(&matrix.off_diagonal) {
        let [row, column] = pair.map(|block| 3 * block as usize);
        for (k, &entry) in entries.iter().enumerate() {
            b[row + k / 3] += entry * x[column + k % 3];
            b[column + k % 3] += entry * x[row + k / 3];
        }
    }
    b
}
