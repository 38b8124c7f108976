//! Factors of indefinite and singular matrices, and lowest eigenpairs, against dense
//! algebra.

use nalgebra::{DMatrix, DVector, Matrix3};
use springs_solver::{
    Indefinite, Inertia, Interrupt, Pencil, SolveError, Solver, all_eigenpairs, lowest_eigenpairs,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

struct Matrix {
    n: usize,
    pairs: Vec<[u32; 2]>,
    diagonal: Vec<[f64; 6]>,
    off_diagonal: Vec<[f64; 9]>,
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) as f64 / 2f64.powi(31) - 0.5
    }
}

impl Matrix {
    /// A square grid with blocks of any kind, pairs in both directions.
    fn grid(side: u32, seed: u64, diagonal: f64) -> Self {
        let mut random = Random(seed);
        let n = (side * side) as usize;
        let mut pairs = Vec::new();
        for y in 0..side {
            for x in 0..side {
                let at = y * side + x;
                if x + 1 < side {
                    pairs.push([at, at + 1]);
                }
                if y + 1 < side {
                    pairs.push([at + side, at]);
                }
            }
        }
        let own = |_| {
            let mut block = [0.0; 6].map(|_: f64| random.next());
            for entry in [0, 3, 5] {
                block[entry] += diagonal;
            }
            block
        };
        let own = (0..n).map(own).collect();
        let off = pairs.iter().map(|_| [0.0; 9].map(|_: f64| random.next()));
        Self {
            n,
            off_diagonal: off.collect(),
            diagonal: own,
            pairs,
        }
    }

    fn dense(&self) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(3 * self.n, 3 * self.n);
        for (k, b) in self.diagonal.iter().enumerate() {
            let block = Matrix3::new(b[0], b[1], b[2], b[1], b[3], b[4], b[2], b[4], b[5]);
            dense.fixed_view_mut::<3, 3>(3 * k, 3 * k).copy_from(&block);
        }
        for (pair, b) in self.pairs.iter().zip(&self.off_diagonal) {
            let [a, c] = pair.map(|block| 3 * block as usize);
            let block = Matrix3::from_row_slice(b);
            dense.fixed_view_mut::<3, 3>(a, c).copy_from(&block);
            dense
                .fixed_view_mut::<3, 3>(c, a)
                .copy_from(&block.transpose());
        }
        dense
    }

    fn factor(&self) -> (Indefinite, Inertia) {
        let mut factor = Indefinite::analyze(self.n, &self.pairs, None).unwrap();
        let inertia = factor
            .set_matrix(&self.diagonal, &self.off_diagonal)
            .unwrap();
        (factor, inertia)
    }
}

#[test]
fn inertia_and_solutions_equal_dense_ones() {
    for (seed, diagonal) in [(1, 0.0), (2, 0.0), (3, 0.5), (4, -0.7), (5, 3.0)] {
        let mut matrix = Matrix::grid(7, seed, diagonal);
        // Pivots that must be put off.
        for block in [3, 17, 30] {
            matrix.diagonal[block] = [0.0; 6];
        }
        let dense = matrix.dense();
        let (factor, inertia) = matrix.factor();
        let eigenvalues = dense.clone().symmetric_eigenvalues();
        let negative = eigenvalues.iter().filter(|value| **value < 0.0).count();
        let expected = Inertia {
            positive: 3 * matrix.n - negative,
            negative,
            zero: 0,
        };
        assert_eq!(inertia, expected);
        let b = DVector::from_fn(3 * matrix.n, |k, _| (k as f64).sin());
        let mut x = b.as_slice().to_vec();
        factor.solve_in_place(&mut x).unwrap();
        let x = DVector::from_vec(x);
        assert!((&dense * &x - b).amax() < 1e-10 * x.amax());
        let directions: Vec<_> = factor.negative_directions().collect();
        assert_eq!(directions.len(), negative);
        for direction in directions {
            let x = DVector::from_vec(direction);
            assert!(x.dot(&(&dense * &x)) < 0.0);
        }
    }
}

/// Springs of stiffness 1 along x between 20 nodes in a row: 20·2 directions without
/// stiffness, and one rigid motion.
#[test]
fn directions_without_stiffness_are_found_and_given() {
    let n = 20;
    let pairs: Vec<[u32; 2]> = (1..n).map(|k| [k - 1, k]).collect();
    let mut diagonal = vec![[2.0, 0.0, 0.0, 0.0, 0.0, 0.0]; n as usize];
    diagonal[0][0] = 1.0;
    diagonal[n as usize - 1][0] = 1.0;
    let matrix = Matrix {
        n: n as usize,
        off_diagonal: vec![[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]; pairs.len()],
        pairs,
        diagonal,
    };
    let (factor, inertia) = matrix.factor();
    let expected = Inertia {
        positive: 19,
        negative: 0,
        zero: 41,
    };
    assert_eq!(inertia, expected);
    let dense = matrix.dense();
    let mut all = DMatrix::zeros(60, 41);
    for (k, direction) in factor.zero_directions().enumerate() {
        let x = DVector::from_vec(direction);
        assert!((&dense * &x).amax() < 1e-14);
        all.set_column(k, &x);
    }
    assert_eq!(all.rank(1e-9), 41);
}

#[test]
fn nothing_but_numbers_is_taken() {
    let mut factor = Indefinite::analyze(1, &[], None).unwrap();
    let none: &[[f64; 6]] = &[];
    assert!(factor.set_matrix(&[[f64::NAN; 6]], none).is_err());
    assert_eq!(
        factor.solve_in_place(&mut [0.0; 3]),
        Err(SolveError::NoMatrix)
    );
}

/// A membrane with equal eigenvalues in pairs and threes, some nodes without mass.
#[test]
fn lowest_eigenpairs_equal_dense_ones() {
    let side = 8u32;
    let mut matrix = Matrix::grid(side, 1, 0.0);
    matrix.diagonal.fill([4.2, 0.0, 0.0, 4.2, 0.0, 4.2]);
    matrix
        .off_diagonal
        .fill([-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0]);
    let dense = matrix.dense();
    for massless in [0, 1] {
        let n = 3 * matrix.n;
        let mass_of = |scalar: usize| if scalar / 3 % 5 < massless { 0.0 } else { 2.0 };
        // Massless nodes follow the others: K_mm − K_ms K_ss⁻¹ K_sm.
        let massive: Vec<usize> = (0..n).filter(|&k| mass_of(k) > 0.0).collect();
        let slaves: Vec<usize> = (0..n).filter(|&k| mass_of(k) == 0.0).collect();
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
                dense[(rows[i], columns[j])]
            })
        };
        let mut condensed = part(&massive, &massive);
        if !slaves.is_empty() {
            let inverse = part(&slaves, &slaves).try_inverse().unwrap();
            condensed -= part(&massive, &slaves) * inverse * part(&slaves, &massive);
        }
        let mut expected: Vec<f64> = (condensed / 2.0).symmetric_eigenvalues().data.into();
        expected.sort_by(f64::total_cmp);

        let masses: Vec<f64> = (0..n).map(mass_of).collect();
        let all = all_eigenpairs(n, |i, j| dense[(i, j)], &masses).unwrap();
        assert_eq!(all.len(), expected.len());
        for (pair, expected) in all.iter().zip(&expected) {
            assert!((pair.value / expected - 1.0).abs() < 1e-12);
            let x = DVector::from_column_slice(&pair.vector);
            let inertia = DVector::from_fn(n, |k, _| masses[k] * x[k] * pair.value);
            assert!((&dense * &x - &inertia).amax() < 1e-12);
            assert!((x.dot(&inertia) / pair.value - 1.0).abs() < 1e-12);
        }

        let mut solver = Solver::analyze(
            matrix.n,
            &matrix.pairs,
            springs_solver::Options {
                packing: springs_solver::Packing::General,
                ..Default::default()
            },
        )
        .unwrap();
        solver
            .set_matrix(&matrix.diagonal, &matrix.off_diagonal)
            .unwrap();
        for count in [1, 5, 30, 1000] {
            let stiffness = |x: &[f64], y: &mut [f64]| {
                y.copy_from_slice((&dense * DVector::from_column_slice(x)).as_slice());
            };
            let mass = |x: &[f64], y: &mut [f64]| {
                for (k, (x, y)) in x.iter().zip(y).enumerate() {
                    *y = mass_of(k) * x;
                }
            };
            let mut pencil = Pencil {
                n,
                stiffness: &stiffness,
                mass: &mass,
                shifted_inverse: &mut |b| solver.solve_in_place(b, 1e-13),
            };
            let found = lowest_eigenpairs(&mut pencil, count, 6).unwrap();
            assert!(found.is_converged);
            let pairs = found.pairs;
            assert_eq!(pairs.len(), count.min(massive.len()));
            for (pair, expected) in pairs.iter().zip(&expected) {
                assert!((pair.value / expected - 1.0).abs() < 1e-11);
                let x = DVector::from_column_slice(&pair.vector);
                let inertia = DVector::from_fn(n, |k, _| mass_of(k) * x[k] * pair.value);
                assert!((&dense * &x - inertia).amax() < 1e-7);
            }
        }
    }
}

/// An inverse that is off by a little cannot lead to precise pairs: what is found says so.
#[test]
fn stalled_iteration_gives_what_has_converged() {
    // Three are found in the first steps: the others stay in the noise.
    let n = 40;
    let value_of = |k: usize| match k {
        0..3 => 1e-9 * (k + 1) as f64,
        _ => 1.0 + k as f64,
    };
    let stiffness = |x: &[f64], y: &mut [f64]| {
        for (k, (x, y)) in x.iter().zip(y).enumerate() {
            *y = value_of(k) * x;
        }
    };
    let mass = |x: &[f64], y: &mut [f64]| y.copy_from_slice(x);
    let mut turn = 0u32;
    let mut noisy = |b: &mut [f64]| {
        for (k, b) in b.iter_mut().enumerate() {
            turn = turn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *b = *b / value_of(k)
                * if k < 3 {
                    1.0
                } else {
                    1.0 + 1e-12 * f64::from(turn)
                };
        }
        Ok(())
    };
    let mut pencil = Pencil {
        n,
        stiffness: &stiffness,
        mass: &mass,
        shifted_inverse: &mut noisy,
    };
    let found = lowest_eigenpairs(&mut pencil, 20, 4).unwrap();
    assert!(!found.is_converged);
    assert!(found.pairs.len() < 20);
    for (k, pair) in found.pairs.iter().take(3).enumerate() {
        assert!(
            (pair.value / value_of(k) - 1.0).abs() < 1e-9,
            "{k}: {}",
            pair.value
        );
    }
}

#[test]
fn unknowns_without_mass_must_be_held() {
    let error = all_eigenpairs(2, |i, j| f64::from(i == j && i == 0), &[1.0, 0.0]).unwrap_err();
    assert_eq!(error, SolveError::NotPositiveDefinite { block: 1 });
}

/// Asked before or on the way, it ends, and has no matrix then.
#[test]
fn a_long_factorization_can_be_interrupted() {
    let matrix = Matrix::grid(12, 1, 0.0);
    let flag = Arc::new(AtomicBool::new(true));
    let mut factor = Indefinite::analyze(matrix.n, &matrix.pairs, None).unwrap();
    factor.set_interrupt(&Interrupt::from(flag.clone()));
    let blocks = &matrix.off_diagonal;
    let taken = factor.set_matrix(&matrix.diagonal, blocks);
    assert_eq!(taken, Err(SolveError::Interrupted));
    let mut b = vec![1.0; 3 * matrix.n];
    assert_eq!(factor.solve_in_place(&mut b), Err(SolveError::NoMatrix));
    flag.store(false, Ordering::Relaxed);
    factor.set_matrix(&matrix.diagonal, blocks).unwrap();
    factor.solve_in_place(&mut b).unwrap();
}
