//! Preconditioned conjugate gradients.

use crate::rows::{Blocks, Rows};

/// What stands for the inverse of a matrix: symmetric, positive definite.
pub(crate) trait Preconditioner {
    /// `z` from the residual `r`.
    fn apply(&mut self, matrix: &Rows, r: &Blocks, z: &mut Blocks);
}

/// How a solution ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Converged,
    /// Too many iterations.
    Stalled,
    /// A direction d with dᵀA d ≤ 0, largest in this block.
    Indefinite {
        block: usize,
    },
}

/// The method of Hestenes and Stiefel (J. Res. Natl. Bur. Stand. 49, 1952) with
/// the vectors it needs.
///
/// Whoever converges to a small residual has met every eigenvalue that the
/// right-hand side excites by more than that, so a matrix that is indefinite in
/// a way that matters shows a direction of negative curvature.
pub(crate) struct ConjugateGradients {
    pub(crate) residual: Vec<[f64; 3]>,
    preconditioned: Vec<[f64; 3]>,
    direction: Vec<[f64; 3]>,
    product: Vec<[f64; 3]>,
    /// Iterations of all solutions.
    pub(crate) iterations: u64,
}

impl ConjugateGradients {
    /// Vectors of `n_blocks` blocks.
    pub(crate) fn new(n_blocks: usize) -> Self {
        let zeros = vec![[0.0; 3]; n_blocks];
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
        96 * n_blocks as u64
    }

    /// Solves A x = b for b in `residual`, to `accuracy` relative to the
    /// solution in the norm of the preconditioner; in `residual` is then that of
    /// x, but for the last correction, which the preconditioner gives.
    pub(crate) fn solve(
        &mut self,
        matrix: &Rows,
        preconditioner: &mut dyn Preconditioner,
        accuracy: f64,
        most_iterations: usize,
        x: &mut Blocks,
    ) -> Ending {
        x.fill([0.0; 3]);
        preconditioner.apply(matrix, &self.residual, &mut self.preconditioned);
        let mut product = dot(&self.residual, &self.preconditioned);
        if product == 0.0 {
            return Ending::Converged;
        }
        let first = product;
        self.direction.copy_from_slice(&self.preconditioned);
        for _ in 0..most_iterations {
            self.iterations += 1;
            matrix.multiply(&self.direction, &mut self.product);
            let curvature = dot(&self.direction, &self.product);
            // Not a number, too, is not positive.
            let is_positive = curvature > 0.0;
            if !is_positive {
                return Ending::Indefinite {
                    block: largest(&self.direction),
                };
            }
            let length = product / curvature;
            add_multiple(x, &self.direction, length);
            add_multiple(&mut self.residual, &self.product, -length);
            let last = product;
            preconditioner.apply(matrix, &self.residual, &mut self.preconditioned);
            product = dot(&self.residual, &self.preconditioned);
            if product <= accuracy * accuracy * first {
                add_multiple(x, &self.preconditioned, 1.0);
                return Ending::Converged;
            }
            let contraction = product / last;
            for (direction, preconditioned) in self.direction.iter_mut().zip(&self.preconditioned) {
                for (d, p) in direction.iter_mut().zip(preconditioned) {
                    *d = p + contraction * *d;
                }
            }
        }
        Ending::Stalled
    }

    /// The residual of x = (last x) + (last correction), from that before.
    pub(crate) fn residual_after_correction(&mut self, matrix: &Rows) -> &Blocks {
        matrix.multiply(&self.preconditioned, &mut self.product);
        add_multiple(&mut self.residual, &self.product, -1.0);
        &self.residual
    }
}

fn dot(a: &Blocks, b: &Blocks) -> f64 {
    let products = a
        .iter()
        .zip(b)
        .map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
    products.sum()
}

/// y += s·x.
fn add_multiple(y: &mut Blocks, x: &Blocks, s: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        for (y, x) in y.iter_mut().zip(x) {
            *y += s * x;
        }
    }
}

/// The block with the largest entry.
fn largest(x: &Blocks) -> usize {
    let size = |block: &[f64; 3]| block.iter().fold(0f64, |size, entry| size.max(entry.abs()));
    let sizes = x.iter().map(size).enumerate();
    sizes
        .fold((0, 0.0), |best, (block, size)| match size > best.1 {
            true => (block, size),
            false => best,
        })
        .0
}
