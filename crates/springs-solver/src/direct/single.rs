//! A factor in single precision.

use super::failure::NoFactor;
use super::front::Values;
use super::fronts::Fronts;
use super::multifrontal::Multifrontal;
use super::storage::filled;
use crate::Interrupt;
use crate::block::{Rounding, packed};
use crate::iterative::{Preconditioner, Rows};

/// Half the bytes and twice the operations a second of a factor in double
/// precision: as a preconditioner it leaves conjugate gradients a few
/// iterations.
pub(crate) struct Single<const D: usize, const P: usize, const Q: usize> {
    factor: Multifrontal<f32, D>,
    /// The scaled matrix in single precision.
    diagonal: Vec<[f32; P]>,
    off_diagonal: Vec<[f32; Q]>,
    permuted: Vec<f32>,
    /// Powers of two that make all diagonals about one, so that the range of
    /// single precision is enough for any units.
    scales: Vec<f64>,
}

impl<const D: usize, const P: usize, const Q: usize> Single<D, P, Q> {
    /// `None` without enough memory.
    pub(crate) fn new(
        fronts: &Fronts,
        n_blocks: usize,
        n_pairs: usize,
        threads: usize,
    ) -> Option<Self> {
        Some(Self {
            factor: Multifrontal::new(fronts, threads)?,
            diagonal: filled([0.0; P], n_blocks)?,
            off_diagonal: filled([0.0; Q], n_pairs)?,
            permuted: filled(0.0, D * n_blocks)?,
            scales: filled(1.0, n_blocks)?,
        })
    }

    /// Memory beside the factor, in bytes.
    pub(crate) fn memory(n_blocks: usize, n_pairs: usize) -> u64 {
        ((8 + 4 * D + 4 * P) * n_blocks + 4 * Q * n_pairs) as u64
    }

    pub(crate) fn factorize(
        &mut self,
        fronts: &Fronts,
        matrix: &Rows<P, Q>,
        rounding: Rounding,
        interrupt: &Interrupt,
    ) -> Result<(), NoFactor> {
        let diagonal = matrix.diagonal();
        for (scale, block) in self.scales.iter_mut().zip(diagonal) {
            let diagonal = (0..D).map(|axis| block[packed::<D>(axis, axis)]);
            let largest = diagonal.fold(0.0, f64::max);
            *scale = match largest > 0.0 && largest.is_finite() {
                true => (-0.5 * largest.log2()).round().exp2(),
                false => 1.0,
            };
        }
        for ((target, block), scale) in self.diagonal.iter_mut().zip(diagonal).zip(&self.scales) {
            *target = block.map(|value| (scale * scale * value) as f32);
        }
        for (row, column, pair, block) in matrix.pairs() {
            let scale = self.scales[row] * self.scales[column];
            self.off_diagonal[pair] = block.map(|value| (scale * value) as f32);
        }
        let values = Values {
            diagonal: &self.diagonal,
            off_diagonal: &self.off_diagonal,
            rounding,
        };
        self.factor.factorize(fronts, values, interrupt)
    }
}

/// The last factor, with the order of its columns.
pub(crate) struct Substitution<'a, const D: usize, const P: usize, const Q: usize> {
    pub(crate) single: &'a mut Single<D, P, Q>,
    pub(crate) fronts: &'a Fronts,
    pub(crate) order: &'a [usize],
}

impl<const D: usize, const P: usize, const Q: usize> Preconditioner<D, P, Q>
    for Substitution<'_, D, P, Q>
{
    fn apply(&mut self, _matrix: &Rows<P, Q>, r: &[[f64; D]], z: &mut [[f64; D]]) {
        let Single {
            factor,
            permuted,
            scales,
            ..
        } = &mut *self.single;
        for (target, &block) in permuted.as_chunks_mut::<D>().0.iter_mut().zip(self.order) {
            let scale = scales[block];
            *target = r[block].map(|value| (scale * value) as f32);
        }
        factor.solve_in_place(self.fronts, permuted);
        for (source, &block) in permuted.as_chunks::<D>().0.iter().zip(self.order) {
            let scale = scales[block];
            z[block] = source.map(|value| scale * f64::from(value));
        }
    }
}
