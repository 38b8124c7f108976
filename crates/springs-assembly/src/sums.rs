//! What terms add up into, whole or in parts.

use crate::Linearization;
use crate::matrix::{OffDiagonal, PairBlock};
use crate::segments::{Segment, Segments};
use nalgebra::Vector3;

/// Sums that several threads can have parts of.
pub(crate) trait Parts: Sized + Send {
    /// The parts before a block and a pair of the matrix, and from these on.
    fn split_at(self, block: usize, pair: usize) -> (Self, Self);
}

/// Vectors of the blocks from one on.
impl Parts for (usize, &mut [Vector3<f64>]) {
    fn split_at(self, block: usize, _pair: usize) -> (Self, Self) {
        let (first, vectors) = self;
        let (before, behind) = vectors.split_at_mut(block - first);
        ((first, before), (block, behind))
    }
}

/// A linearization from one block and one pair on.
pub(crate) struct Sums<'a, P> {
    pub(crate) first_block: usize,
    pub(crate) first_pair: usize,
    pub(crate) forces: &'a mut [Vector3<f64>],
    pub(crate) diagonal: &'a mut [[f64; 6]],
    pub(crate) anchor_load: &'a mut [Vector3<f64>],
    pub(crate) pairs: &'a mut [P],
}

impl<'a, P> Sums<'a, P> {
    fn all(
        forces: &'a mut [Vector3<f64>],
        diagonal: &'a mut [[f64; 6]],
        anchor_load: &'a mut [Vector3<f64>],
        pairs: &'a mut [P],
    ) -> Self {
        Self {
            first_block: 0,
            first_pair: 0,
            forces,
            diagonal,
            anchor_load,
            pairs,
        }
    }
}

impl<P: PairBlock> Parts for Sums<'_, P> {
    fn split_at(self, block: usize, pair: usize) -> (Self, Self) {
        let at = block - self.first_block;
        let (forces, forces_behind) = self.forces.split_at_mut(at);
        let (diagonal, diagonal_behind) = self.diagonal.split_at_mut(at);
        let (anchor_load, anchor_load_behind) = self.anchor_load.split_at_mut(at);
        let (pairs, pairs_behind) = self.pairs.split_at_mut(pair - self.first_pair);
        let before = Self {
            forces,
            diagonal,
            anchor_load,
            pairs,
            ..self
        };
        let behind = Self {
            first_block: block,
            first_pair: pair,
            forces: forces_behind,
            diagonal: diagonal_behind,
            anchor_load: anchor_load_behind,
            pairs: pairs_behind,
        };
        (before, behind)
    }
}

/// Terms along connections that add to a linearization with blocks of either kind off the
/// diagonal.
pub(crate) trait Linearized: Sync {
    fn segments(&self) -> &Segments;

    fn add_to<P: PairBlock>(&self, segment: &Segment, sums: &mut Sums<'_, P>);
}

impl Linearization {
    /// Adds what terms have, on the threads that are here.
    pub(crate) fn add(&mut self, terms: &impl Linearized) {
        let segments = terms.segments();
        for &phase in segments.phases() {
            let diagonal = &mut self.matrix.diagonal;
            match &mut self.matrix.off_diagonal {
                OffDiagonal::Symmetric(pairs) => {
                    let sums = Sums::all(&mut self.forces, diagonal, &mut self.anchor_load, pairs);
                    segments.work_off(phase, sums, |segment, sums| terms.add_to(segment, sums));
                }
                OffDiagonal::General(pairs) => {
                    let sums = Sums::all(&mut self.forces, diagonal, &mut self.anchor_load, pairs);
                    segments.work_off(phase, sums, |segment, sums| terms.add_to(segment, sums));
                }
            }
        }
    }
}
