//! Preconditioned conjugate gradients.

use super::multilevel::Multilevel;
use super::rows::Rows;
use crate::Interrupt;
use crate::block::dot;

/// How a solution ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Converged,
    /// Too many iterations, or rounding is all there is.
    Stalled,
    Interrupted,
    /// A direction d with dᵀA d ≤ 0, largest in this block.
    Indefinite {
        block: usize,
    },
}

/// When a solution ends.
#[derive(Clone, Copy)]
pub(crate) struct Until<'a> {
    /// Relative to the solution in the norm of the preconditioner.
    pub(crate) accuracy: f64,
    pub(crate) most_iterations: usize,
    pub(crate) interrupt: &'a Interrupt,
}

/// The method of Hestenes and Stiefel (J. Res. Natl. Bur. Stand. 49, 1952) with
/// the vectors it needs.
///
/// Whoever converges to a small residual has met every eigenvalue that the
/// right-hand side excites by more than that, so a matrix that is indefinite in
/// a way that matters shows a direction of negative curvature.
pub(crate) struct ConjugateGradients<const D: usize> {
    pub(crate) residual: Vec<[f64; D]>,
    preconditioned: Vec<[f64; D]>,
    direction: Vec<[f64; D]>,
    /// A times the direction.
    product: Vec<[f64; D]>,
    /// Iterations of all solutions.
    pub(crate) iterations: u64,
}

impl<const D: usize> ConjugateGradients<D> {
    /// Vectors of `n_blocks` blocks.
    pub(crate) fn new(n_blocks: usize) -> Self {
        let zeros = vec![[0.0; D]; n_blocks];
        Self {
            residual: zeros.clone(),
            preconditioned: zeros.clone(),
            direction: zeros.clone(),
            product: zeros,
            iterations: 0,
        }
    }

    /// Memory of the vectors, in bytes.
    pub(crate) fn memory(n_blocks: usize) -> u64 {
        (32 * D * n_blocks) as u64
    }

    /// Solves A x = b for b in `residual`, to the accuracy asked for; in
    /// `residual` is then that of x, but for the last correction, which the
    /// preconditioner gives.
    pub(crate) fn solve<const P: usize, const Q: usize>(
        &mut self,
        matrix: &Rows<P, Q>,
        preconditioner: &mut Multilevel<D, P, Q>,
        Until {
            accuracy,
            most_iterations,
            interrupt,
        }: Until<'_>,
        x: &mut [[f64; D]],
    ) -> Ending {
        x.fill([0.0; D]);
        preconditioner.apply(matrix, &self.residual, &mut self.preconditioned);
        let mut remaining = product(&self.residual, &self.preconditioned);
        if remaining == 0.0 {
            return Ending::Converged;
        }
        let first = remaining;
        self.direction.fill([0.0; D]);
        self.product.fill([0.0; D]);
        let mut contraction = 0.0;
        for _ in 0..most_iterations {
            if interrupt.is_requested() {
                return Ending::Interrupted;
            }
            self.iterations += 1;
            let curvature = self.turn(matrix, preconditioner, contraction);
            // Not a number, too, is not positive.
            let is_positive = curvature > 0.0;
            if !is_positive {
                // Products carried from direction to direction gather rounding.
                return if matrix.quadratic_form(&self.direction) > 0.0 {
                    Ending::Stalled
                } else {
                    Ending::Indefinite {
                        block: largest(&self.direction),
                    }
                };
            }
            let length = remaining / curvature;
            add_multiple(x, &self.direction, length);
            add_multiple(&mut self.residual, &self.product, -length);
            let last = remaining;
            preconditioner.apply(matrix, &self.residual, &mut self.preconditioned);
            remaining = product(&self.residual, &self.preconditioned);
            if remaining <= accuracy * accuracy * first {
                add_multiple(x, &self.preconditioned, 1.0);
                return Ending::Converged;
            }
            contraction = remaining / last;
        }
        Ending::Stalled
    }

    /// The next direction d, from what the preconditioner has just given and the last one,
    /// with its product A d; gives dᵀA d.
    fn turn<const P: usize, const Q: usize>(
        &mut self,
        matrix: &Rows<P, Q>,
        preconditioner: &mut Multilevel<D, P, Q>,
        contraction: f64,
    ) -> f64 {
        let change = preconditioner.change_of_last_sweep(&self.preconditioned);
        let mut curvature = 0.0;
        for (row, d) in self.direction.iter_mut().enumerate() {
            let (z, r) = (&self.preconditioned[row], &self.residual[row]);
            let (change, product) = (matrix.lower_row(row, change), &mut self.product[row]);
            for axis in 0..D {
                d[axis] = z[axis] + contraction * d[axis];
                product[axis] = r[axis] + change[axis] + contraction * product[axis];
            }
            curvature += dot(d, product);
        }
        curvature
    }

    /// The residual of x = (last x) + (last correction), from that before.
    pub(crate) fn residual_after_correction<const P: usize, const Q: usize>(
        &mut self,
        matrix: &Rows<P, Q>,
        preconditioner: &mut Multilevel<D, P, Q>,
    ) -> &[[f64; D]] {
        let change = preconditioner.change_of_last_sweep(&self.preconditioned);
        for (row, r) in self.residual.iter_mut().enumerate() {
            *r = matrix.lower_row(row, change).map(|entry| -entry);
        }
        &self.residual
    }
}

fn product<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(a, b)).sum()
}

/// y += s·x.
fn add_multiple<const D: usize>(y: &mut [[f64; D]], x: &[[f64; D]], s: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        for (y, x) in y.iter_mut().zip(x) {
            *y += s * x;
        }
    }
}

/// The block with the largest entry.
fn largest<const D: usize>(x: &[[f64; D]]) -> usize {
    let mut largest = (0, 0.0);
    for (block, entries) in x.iter().enumerate() {
        let size = entries
            .iter()
            .fold(0f64, |size, entry| size.max(entry.abs()));
        if size > largest.1 {
            largest = (block, size);
        }
    }
    largest.0
}
