//! Solutions that are known to lie in a plane or on a line.

use crate::block::{dot, is_symmetric, place, times};
use crate::core::{Core, Dimension};
use crate::iterative::MakeCoarse;
use crate::{Counts, Interrupt, Options, Price, SolveError, StrategyState};

/// A solver of matrices in a subspace.
pub(crate) struct Reduced<const D: usize, const P: usize, const Q: usize> {
    core: Core<D, P, Q>,
    basis: [[f64; 3]; D],
    right_hand_side: RightHandSide,
    /// The last matrix, which stands if the next is the same.
    diagonal: Vec<[f64; P]>,
    off_diagonal: Vec<[f64; Q]>,
    x: Vec<[f64; D]>,
}

/// What is solved for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum RightHandSide {
    /// The components along the basis.
    InSubspace,
    /// Every component by itself, with the same matrix.
    Anywhere,
}

impl<const D: usize, const P: usize, const Q: usize> Reduced<D, P, Q> {
    pub(crate) fn new(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        (basis, right_hand_side): ([[f64; 3]; D], RightHandSide),
        make_coarse: MakeCoarse<D, P, Q>,
    ) -> Result<Self, SolveError> {
        Ok(Self {
            core: Core::analyze(n_blocks, pairs, options, make_coarse)?,
            basis,
            right_hand_side,
            diagonal: vec![[0.0; P]; n_blocks],
            off_diagonal: vec![[0.0; Q]; pairs.len()],
            x: vec![[0.0; D]; n_blocks],
        })
    }

    /// As [`Core::memory`].
    pub(crate) fn memory(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        make_coarse: MakeCoarse<D, P, Q>,
    ) -> Result<u64, SolveError> {
        let own = 8 * ((D + P) * n_blocks + Q * pairs.len()) as u64;
        Ok(own + Core::<D, P, Q>::memory(n_blocks, pairs, options, make_coarse)?)
    }

    fn solve_in_subspace(
        &mut self,
        blocks: &mut [[f64; 3]],
        accuracy: f64,
    ) -> Result<(), SolveError> {
        for (x, block) in self.x.iter_mut().zip(&*blocks) {
            *x = self.basis.map(|vector| dot(&vector, block));
        }
        self.core.solve_in_place(&mut self.x, accuracy)?;
        for (x, block) in self.x.iter().zip(blocks) {
            *block = [0.0; 3];
            for (length, vector) in x.iter().zip(&self.basis) {
                for (entry, component) in block.iter_mut().zip(vector) {
                    *entry += length * component;
                }
            }
        }
        Ok(())
    }

    /// Solves for one component.
    fn solve_axis(
        &mut self,
        blocks: &mut [[f64; 3]],
        axis: usize,
        accuracy: f64,
    ) -> Result<(), SolveError> {
        for (x, block) in self.x.iter_mut().zip(&*blocks) {
            *x = [block[axis]; D];
        }
        self.core.solve_in_place(&mut self.x, accuracy)?;
        for (x, block) in self.x.iter().zip(blocks) {
            block[axis] = x[0];
        }
        Ok(())
    }
}

impl<const D: usize, const P: usize, const Q: usize, const N: usize> Dimension<N>
    for Reduced<D, P, Q>
{
    fn strategy_state(&mut self) -> &mut StrategyState {
        self.core.strategy_state()
    }

    fn factor_price(&self) -> Price {
        self.core.factor_price()
    }

    fn expect_uses(&mut self, uses: f64) {
        self.core.expect_uses(uses);
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.core.set_interrupt(interrupt);
    }

    fn counts(&self) -> Counts {
        self.core.counts()
    }

    fn set_positions(&mut self, positions: &[[f64; 3]]) {
        let basis = self.basis;
        self.core.set_positions(positions.iter().map(|position| {
            let mut reduced = [0.0; 3];
            for (component, vector) in reduced.iter_mut().zip(&basis) {
                *component = dot(vector, position);
            }
            reduced
        }));
    }

    fn set_matrix(&mut self, diagonal: &[[f64; 6]], upper: &[[f64; N]]) -> Result<(), SolveError> {
        let same_diagonal = reduce_all(diagonal, &self.basis, &mut self.diagonal);
        let same_upper = reduce_all(upper, &self.basis, &mut self.off_diagonal);
        if self.core.has_matrix() && same_diagonal && same_upper {
            return Ok(());
        }
        self.core.set_matrix(&self.diagonal, &self.off_diagonal)
    }

    fn solve_in_place(&mut self, rhs: &mut [[f64; 3]], accuracy: f64) -> Result<(), SolveError> {
        match self.right_hand_side {
            RightHandSide::InSubspace => self.solve_in_subspace(rhs, accuracy),
            RightHandSide::Anywhere => {
                (0..3).try_for_each(|axis| self.solve_axis(rhs, axis, accuracy))
            }
        }
    }
}

/// Reduces all blocks; whether that changes nothing.
fn reduce_all<const D: usize, const M: usize, const N: usize>(
    blocks: &[[f64; N]],
    basis: &[[f64; 3]; D],
    reduced: &mut [[f64; M]],
) -> bool {
    let mut is_same = true;
    for (kept, block) in reduced.iter_mut().zip(blocks) {
        let reduced = reduce(block, basis);
        is_same &= *kept == reduced;
        *kept = reduced;
    }
    is_same
}

/// vᵀ B w for all v and w of the basis.
fn reduce<const D: usize, const M: usize, const N: usize>(
    block: &[f64; N],
    basis: &[[f64; 3]; D],
) -> [f64; M] {
    let mut reduced = [0.0; M];
    for (column, w) in basis.iter().enumerate() {
        let image = times::<3, N>(block, w);
        let n_rows = if is_symmetric::<D, M>() {
            column + 1
        } else {
            D
        };
        for (row, v) in basis.iter().enumerate().take(n_rows) {
            reduced[place::<D, M>(row, column)] = dot(v, &image);
        }
    }
    reduced
}
