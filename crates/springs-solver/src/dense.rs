//! All eigenpairs of K x = λ M x by dense matrices.

use crate::{Eigenpair, SolveError};
use faer::linalg::solvers::Solve as _;
use faer::{Mat, Side};

/// All eigenpairs of K x = λ M x that have a finite eigenvalue, in ascending order, for a
/// dense symmetric K of n × n entries and a diagonal M that is nowhere negative: as many as M
/// has entries above zero. It takes n² numbers and time in proportion to n³. Eigenvalues are
/// precise up to rounding of the largest.
///
/// Unknowns without mass are eliminated first.
///
/// # Errors
///
/// [`SolveError::NotPositiveDefinite`], with the index of an unknown, if K does not hold the
/// unknowns without mass; [`SolveError::NotConverged`] if entries are not numbers.
///
/// # Panics
///
/// If there are not n masses.
pub fn all_eigenpairs(
    n: usize,
    stiffness: impl Fn(usize, usize) -> f64,
    masses: &[f64],
) -> Result<Vec<Eigenpair>, SolveError> {
    assert_eq!(masses.len(), n, "a mass for each unknown");
    let (heavy, massless): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| masses[k] > 0.0);
    let part = |rows: &[usize], columns: &[usize]| {
        Mat::from_fn(rows.len(), columns.len(), |i, j| {
            stiffness(rows[i], columns[j])
        })
    };
    let mut condensed = part(&heavy, &heavy);
    // What massless unknowns do per heavy one, but for the sign.
    let mut following = Mat::zeros(0, heavy.len());
    if let Some(&first) = massless.first() {
        let factor = part(&massless, &massless).llt(Side::Lower);
        let factor = factor.map_err(|_| SolveError::NotPositiveDefinite { block: first })?;
        let coupling = part(&massless, &heavy);
        following = factor.solve(&coupling);
        condensed -= coupling.transpose() * &following;
    }
    let roots: Vec<f64> = heavy.iter().map(|&k| masses[k].sqrt()).collect();
    let scaled = Mat::from_fn(heavy.len(), heavy.len(), |i, j| {
        condensed[(i, j)] / (roots[i] * roots[j])
    });
    let (values, vectors) = symmetric_eigenpairs(scaled)?;
    let pairs = (0..heavy.len()).map(|pair| {
        let of_heavy = Mat::from_fn(heavy.len(), 1, |i, _| vectors[(i, pair)] / roots[i]);
        let of_massless = &following * &of_heavy;
        let mut vector = vec![0.0; n];
        for (i, &k) in heavy.iter().enumerate() {
            vector[k] = of_heavy[(i, 0)];
        }
        for (i, &k) in massless.iter().enumerate() {
            vector[k] = -of_massless[(i, 0)];
        }
        Eigenpair {
            value: values[pair],
            vector,
        }
    });
    Ok(pairs.collect())
}

/// Eigenvalues, ascending, and orthonormal eigenvectors of a symmetric matrix.
///
/// # Errors
///
/// [`SolveError::NotConverged`] if entries are not numbers.
pub(crate) fn symmetric_eigenpairs(
    mut matrix: Mat<f64>,
) -> Result<(Vec<f64>, Mat<f64>), SolveError> {
    // faer deflates by absolute sizes: entries far from 1 would lose digits.
    let size = matrix.norm_max();
    let scale = if size > 0.0 { size } else { 1.0 };
    matrix.col_iter_mut().for_each(|column| {
        column.iter_mut().for_each(|entry| *entry /= scale);
    });
    let solved = matrix.self_adjoint_eigen(Side::Lower);
    let solved = solved.map_err(|_| SolveError::NotConverged)?;
    let values = solved.S().column_vector();
    let values = values.iter().map(|value| value * scale).collect();
    Ok((values, solved.U().to_owned()))
}
