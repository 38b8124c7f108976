//! Preconditioned conjugate gradients.

use super::multilevel::{Multilevel, Step};
use super::rows::Rows;
use super::stretches::parts;
use crate::Interrupt;
use crate::block::{add_multiple, dot};
use pulp::Arch;
use springs_threads::share_out;

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
        let z = &mut self.preconditioned;
        let mut remaining = preconditioner.apply(matrix, (&mut self.residual, None), z);
        if remaining == 0.0 {
            return Ending::Converged;
        }
        let first = remaining;
        self.direction.fill([0.0; D]);
        self.product.fill([0.0; D]);
        let (mut contraction, mut length) = (0.0, 0.0);
        for _ in 0..most_iterations {
            if interrupt.is_requested() {
                return Ending::Interrupted;
            }
            self.iterations += 1;
            let change = preconditioner.change_of_last_sweep();
            let curvature = self.turn(matrix, change, (length, contraction), x);
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
            length = remaining / curvature;
            let last = remaining;
            let step = Step {
                product: &self.product,
                length,
            };
            let z = &mut self.preconditioned;
            remaining = preconditioner.apply(matrix, (&mut self.residual, Some(step)), z);
            if remaining <= accuracy * accuracy * first {
                add_multiple(x, &self.direction, length);
                add_multiple(x, &self.preconditioned, 1.0);
                return Ending::Converged;
            }
            contraction = remaining / last;
        }
        Ending::Stalled
    }

    /// Goes along the last direction by a length, in x, and turns to the next one, d, from
    /// what the preconditioner has just given; its product A d takes the change of the last
    /// sweep. Gives dᵀA d.
    fn turn<const P: usize, const Q: usize>(
        &mut self,
        matrix: &Rows<P, Q>,
        change: &[[f64; D]],
        (length, contraction): (f64, f64),
        x: &mut [[f64; D]],
    ) -> f64 {
        let windows = || matrix.stretches().windows();
        let tasks = windows()
            .zip(parts(&mut self.direction, windows()))
            .zip(parts(&mut self.product, windows()))
            .zip(parts(x, windows()));

        let (residual, preconditioned) = (&self.residual, &self.preconditioned);
        let curvatures = share_out(tasks, |(((rows, d), product), x)| {
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    let mut curvature = 0.0;
                    for (row, ((d, product), x)) in rows.zip(d.iter_mut().zip(product).zip(x)) {
                        let (z, r) = (&preconditioned[row], &residual[row]);
                        let change = matrix.lower_row(row, 0, change);
                        for axis in 0..D {
                            x[axis] += length * d[axis];
                            d[axis] = z[axis] + contraction * d[axis];
                            product[axis] = r[axis] + change[axis] + contraction * product[axis];
                        }
                        curvature += dot(d, product);
                    }
                    curvature
                },
            )
        });
        curvatures.iter().sum()
    }

    /// The residual of x = (last x) + (last correction), from that before.
    pub(crate) fn residual_after_correction<const P: usize, const Q: usize>(
        &mut self,
        matrix: &Rows<P, Q>,
        preconditioner: &Multilevel<D, P, Q>,
    ) -> &[[f64; D]] {
        let change = preconditioner.change_of_last_sweep();
        let windows = || matrix.stretches().windows();
        let tasks = windows().zip(parts(&mut self.residual, windows()));
        share_out(tasks, |(rows, residual)| {
            for (row, r) in rows.zip(residual) {
                *r = matrix.lower_row(row, 0, change).map(|entry| -entry);
            }
        });
        &self.residual
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
