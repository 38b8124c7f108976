//! How off-diagonal blocks are given.

use crate::block::transposed;

/// What the off-diagonal blocks of a matrix are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Packing {
    /// Each is symmetric itself: six numbers.
    #[default]
    Symmetric,
    /// Nine numbers.
    General,
}

/// The off-diagonal blocks of a matrix, one per pair (a, b) of the pattern, at
/// (row a, column b); the block at (b, a) is its transpose.
#[derive(Clone, Copy, Debug)]
pub enum OffDiagonal<'a> {
    /// Symmetric ones, packed as (xx, xy, xz, yy, yz, zz).
    Symmetric(&'a [[f64; 6]]),
    /// Any, row by row: (xx, xy, xz, yx, yy, yz, zx, zy, zz).
    General(&'a [[f64; 9]]),
}

impl OffDiagonal<'_> {
    /// How many blocks there are.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Symmetric(blocks) => blocks.len(),
            Self::General(blocks) => blocks.len(),
        }
    }
}

impl<'a> From<&'a [[f64; 6]]> for OffDiagonal<'a> {
    fn from(blocks: &'a [[f64; 6]]) -> Self {
        Self::Symmetric(blocks)
    }
}

impl<'a, const N: usize> From<&'a [[f64; 6]; N]> for OffDiagonal<'a> {
    fn from(blocks: &'a [[f64; 6]; N]) -> Self {
        Self::Symmetric(blocks)
    }
}

impl<'a> From<&'a Vec<[f64; 6]>> for OffDiagonal<'a> {
    fn from(blocks: &'a Vec<[f64; 6]>) -> Self {
        Self::Symmetric(blocks)
    }
}

impl<'a> From<&'a [[f64; 9]]> for OffDiagonal<'a> {
    fn from(blocks: &'a [[f64; 9]]) -> Self {
        Self::General(blocks)
    }
}

impl<'a, const N: usize> From<&'a [[f64; 9]; N]> for OffDiagonal<'a> {
    fn from(blocks: &'a [[f64; 9]; N]) -> Self {
        Self::General(blocks)
    }
}

impl<'a> From<&'a Vec<[f64; 9]>> for OffDiagonal<'a> {
    fn from(blocks: &'a Vec<[f64; 9]>) -> Self {
        Self::General(blocks)
    }
}

/// Brings general blocks to the upper triangle.
#[derive(Default)]
pub(crate) struct Upper {
    /// Pairs (a, b) with a > b.
    lower: Vec<u32>,
    /// All blocks, those transposed; none if there are no such pairs.
    blocks: Vec<[f64; 9]>,
}

impl Upper {
    pub(crate) fn new(pairs: &[[u32; 2]]) -> Self {
        let is_lower = |&(_, [a, b]): &(u32, &[u32; 2])| a > b;
        let lower = (0..).zip(pairs).filter(is_lower);
        let lower: Vec<u32> = lower.map(|(pair, _)| pair).collect();
        let n_copied = if lower.is_empty() { 0 } else { pairs.len() };
        Self {
            blocks: vec![[0.0; 9]; n_copied],
            lower,
        }
    }

    /// In bytes.
    pub(crate) fn memory(&self) -> u64 {
        (4 * self.lower.len() + 72 * self.blocks.len()) as u64
    }

    /// The blocks at (row min(a, b), column max(a, b)).
    pub(crate) fn of<'a>(&'a mut self, blocks: &'a [[f64; 9]]) -> &'a [[f64; 9]] {
        if self.lower.is_empty() {
            return blocks;
        }
        self.blocks.copy_from_slice(blocks);
        for &pair in &self.lower {
            let block = &mut self.blocks[pair as usize];
            *block = transposed::<3, 9>(block);
        }
        &self.blocks
    }
}
