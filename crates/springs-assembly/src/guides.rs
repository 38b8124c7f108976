//! Nodes that supports let move in part.
//!
//! With P the projection of global vectors onto what guides let free, forces are P f,
//! and a matrix A becomes P A P plus, on the diagonal and across the guides, a multiple
//! of the identity that keeps it regular: with velocities and right-hand sides that
//! lie in the range of P, solutions do, too.

use crate::matrix::PACKED;
use crate::{BlockMatrix, BlockPattern, Numbering, OffDiagonal};
use nalgebra::{Matrix3, Vector3};
use springs_scene::{Guide, Scene};

/// The guides of a system.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guides {
    /// Guided blocks and P there.
    blocks: Vec<(u32, Matrix3<f64>)>,
    /// Pairs of the pattern with a guided block, and P at both.
    pairs: Vec<(u32, [Matrix3<f64>; 2])>,
}

impl Guides {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering, pattern: &BlockPattern) -> Self {
        if scene.nodes.iter().all(|node| node.guide.is_none()) {
            return Self::default();
        }
        let mut of_block = vec![None; numbering.n_free()];
        for (block, projection) in of_block.iter_mut().enumerate() {
            let guide = scene.nodes[numbering.node(block)].guide;
            *projection = guide.as_ref().map(projection_of);
        }
        let blocks = (0u32..).zip(&of_block);
        let blocks = blocks.filter_map(|(block, projection)| Some((block, (*projection)?)));
        let pairs = (0u32..).zip(pattern.pairs()).filter_map(|(pair, ends)| {
            let of_ends = ends.map(|block| of_block[block as usize]);
            let is_guided = of_ends.iter().any(Option::is_some);
            let of_ends = of_ends.map(|projection| projection.unwrap_or_else(Matrix3::identity));
            is_guided.then_some((pair, of_ends))
        });
        Self {
            pairs: pairs.collect(),
            blocks: blocks.collect(),
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Guided blocks.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = usize> {
        self.blocks.iter().map(|(block, _)| *block as usize)
    }

    /// Takes the part across the guides from vectors of the free blocks.
    pub(crate) fn project(&self, vectors: &mut [Vector3<f64>]) {
        for (block, projection) in &self.blocks {
            let vector = &mut vectors[*block as usize];
            *vector = projection * *vector;
        }
    }

    /// Whether all of them let nodes have a common velocity.
    pub(crate) fn let_have(&self, velocity: &Vector3<f64>) -> bool {
        let mut blocks = self.blocks.iter();
        blocks.all(|(_, projection)| projection * velocity == *velocity)
    }

    /// Makes a matrix one of motions along the guides.
    pub(crate) fn constrain(&self, matrix: &mut BlockMatrix) {
        for (block, projection) in &self.blocks {
            let packed = &mut matrix.diagonal[*block as usize];
            let mut whole = Matrix3::zeros();
            for (&entry, value) in PACKED.iter().zip(&*packed) {
                whole[entry] = *value;
                whole[(entry.1, entry.0)] = *value;
            }
            let scale = match whole.trace() / 3.0 {
                mean if mean > 0.0 => mean,
                _ => 1.0,
            };
            let across = Matrix3::identity() - projection;
            let constrained = projection * whole * projection + across * scale;
            *packed = PACKED.map(|entry| constrained[entry]);
        }
        if let OffDiagonal::General(blocks) = &mut matrix.off_diagonal {
            for (pair, [first, second]) in &self.pairs {
                let rows = &mut blocks[*pair as usize];
                let constrained = first * Matrix3::from_row_slice(&*rows) * second;
                rows.copy_from_slice(constrained.transpose().as_slice());
            }
        }
    }
}

/// P of a guide.
fn projection_of(guide: &Guide) -> Matrix3<f64> {
    Matrix3::from_columns(&[Vector3::x(), Vector3::y(), Vector3::z()].map(|e| guide.free_part(&e)))
}
