//! A factor in single precision, solutions in double precision.

use crate::fronts::Fronts;
use crate::multifrontal::{Multifrontal, NotPositive};

/// A preconditioner in single precision and the conjugate gradients that use it
/// (Hestenes and Stiefel, J. Res. Natl. Bur. Stand. 49, 1952).
pub(crate) struct Mixed {
    factor: Multifrontal<f32>,
    /// The scaled matrix in single precision.
    blocks: Vec<[f32; 6]>,
    permuted: Vec<f32>,
    /// Powers of two that make all diagonals about one, so that the range of
    /// single precision is enough for any units.
    scales: Vec<f64>,
    /// The matrix as it is given.
    diagonal: Vec<[f64; 6]>,
    off_diagonal: Vec<[f64; 6]>,
    rhs: Vec<[f64; 3]>,
    residual: Vec<[f64; 3]>,
    preconditioned: Vec<[f64; 3]>,
    direction: Vec<[f64; 3]>,
    product: Vec<[f64; 3]>,
}

/// Relative accuracy of solutions, in the norm of the matrix.
const ACCURACY: f64 = 1e-11;
/// More iterations than this cost more than another factorization.
const MOST_ITERATIONS: usize = 24;

impl Mixed {
    /// `None` without enough memory.
    pub(crate) fn new(
        fronts: &Fronts,
        n_blocks: usize,
        n_pairs: usize,
        threads: usize,
    ) -> Option<Self> {
        let zeros = vec![[0.0; 3]; n_blocks];
        Some(Self {
            factor: Multifrontal::new(fronts, threads)?,
            blocks: vec![[0.0; 6]; n_blocks + n_pairs],
            permuted: vec![0.0; 3 * n_blocks],
            scales: vec![1.0; n_blocks],
            diagonal: vec![[0.0; 6]; n_blocks],
            off_diagonal: vec![[0.0; 6]; n_pairs],
            rhs: zeros.clone(),
            residual: zeros.clone(),
            preconditioned: zeros.clone(),
            direction: zeros.clone(),
            product: zeros,
        })
    }

    /// Takes a matrix.
    pub(crate) fn set(
        &mut self,
        pairs: &[[u32; 2]],
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; 6]],
    ) {
        self.diagonal.copy_from_slice(diagonal);
        self.off_diagonal.copy_from_slice(off_diagonal);
        for (scale, block) in self.scales.iter_mut().zip(diagonal) {
            let largest = block[0].max(block[3]).max(block[5]);
            *scale = match largest > 0.0 && largest.is_finite() {
                true => (-0.5 * largest.log2()).round().exp2(),
                false => 1.0,
            };
        }
        let (diagonals, pair_blocks) = self.blocks.split_at_mut(diagonal.len());
        let scaled = |block: &[f64; 6], scale: f64| block.map(|value| (scale * value) as f32);
        for ((target, block), scale) in diagonals.iter_mut().zip(diagonal).zip(&self.scales) {
            *target = scaled(block, scale * scale);
        }
        for ((target, block), pair) in pair_blocks.iter_mut().zip(off_diagonal).zip(pairs) {
            let [a, b] = pair.map(|block| self.scales[block as usize]);
            *target = scaled(block, a * b);
        }
    }

    pub(crate) fn factorize(&mut self, fronts: &Fronts) -> Result<(), NotPositive> {
        self.factor.factorize(fronts, &self.blocks)
    }

    /// The matrix; it is to be given back.
    pub(crate) fn take_matrix(&mut self) -> (Vec<[f64; 6]>, Vec<[f64; 6]>) {
        let diagonal = std::mem::take(&mut self.diagonal);
        (diagonal, std::mem::take(&mut self.off_diagonal))
    }

    pub(crate) fn give_back(&mut self, diagonal: Vec<[f64; 6]>, off_diagonal: Vec<[f64; 6]>) {
        (self.diagonal, self.off_diagonal) = (diagonal, off_diagonal);
    }

    /// Replaces b by the solution; says whether it converged, else b is as it
    /// was.
    pub(crate) fn solve(
        &mut self,
        fronts: &Fronts,
        order: &[usize],
        pairs: &[[u32; 2]],
        x: &mut [[f64; 3]],
    ) -> bool {
        self.residual.copy_from_slice(x);
        let mut product = self.precondition(fronts, order);
        if product == 0.0 {
            x.fill([0.0; 3]);
            return true;
        }
        let first = product;
        self.direction.copy_from_slice(&self.preconditioned);
        self.rhs.copy_from_slice(x);
        x.fill([0.0; 3]);
        for _ in 0..MOST_ITERATIONS {
            self.multiply(pairs);
            let curvature = dot(&self.direction, &self.product);
            // Not a number, too, is not positive.
            let is_positive = curvature > 0.0;
            if !is_positive {
                break;
            }
            let length = product / curvature;
            add_multiple(x, &self.direction, length);
            add_multiple(&mut self.residual, &self.product, -length);
            let last = product;
            product = self.precondition(fronts, order);
            if product <= ACCURACY * ACCURACY * first {
                // The preconditioned residual is there: a last correction.
                add_multiple(x, &self.preconditioned, 1.0);
                return true;
            }
            let contraction = product / last;
            for (direction, preconditioned) in self.direction.iter_mut().zip(&self.preconditioned) {
                for (d, p) in direction.iter_mut().zip(preconditioned) {
                    *d = p + contraction * *d;
                }
            }
        }
        x.copy_from_slice(&self.rhs);
        false
    }

    /// `preconditioned` from `residual`, and their product.
    fn precondition(&mut self, fronts: &Fronts, order: &[usize]) -> f64 {
        let (permuted, _) = self.permuted.as_chunks_mut::<3>();
        for (target, &block) in permuted.iter_mut().zip(order) {
            let scale = self.scales[block];
            *target = self.residual[block].map(|value| (scale * value) as f32);
        }
        self.factor.solve_in_place(fronts, &mut self.permuted);
        let (permuted, _) = self.permuted.as_chunks::<3>();
        for (source, &block) in permuted.iter().zip(order) {
            let scale = self.scales[block];
            self.preconditioned[block] = source.map(|value| scale * f64::from(value));
        }
        dot(&self.residual, &self.preconditioned)
    }

    /// `product` = A · `direction`.
    fn multiply(&mut self, pairs: &[[u32; 2]]) {
        let x = &self.direction;
        for ((y, x), block) in self.product.iter_mut().zip(x).zip(&self.diagonal) {
            *y = times(block, x);
        }
        for (pair, block) in pairs.iter().zip(&self.off_diagonal) {
            let [a, b] = pair.map(|block| block as usize);
            let (of_b, of_a) = (times(block, &x[b]), times(block, &x[a]));
            for axis in 0..3 {
                self.product[a][axis] += of_b[axis];
                self.product[b][axis] += of_a[axis];
            }
        }
    }
}

/// B x for a packed symmetric block.
#[inline(always)]
fn times(b: &[f64; 6], x: &[f64; 3]) -> [f64; 3] {
    [
        b[0] * x[0] + b[1] * x[1] + b[2] * x[2],
        b[1] * x[0] + b[3] * x[1] + b[4] * x[2],
        b[2] * x[0] + b[4] * x[1] + b[5] * x[2],
    ]
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let products = a
        .iter()
        .zip(b)
        .map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
    products.sum()
}

/// y += s·x.
fn add_multiple(y: &mut [[f64; 3]], x: &[[f64; 3]], s: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        for (y, x) in y.iter_mut().zip(x) {
            *y += s * x;
        }
    }
}
