//! Chains, trees and forests: elimination without fill.

use super::failure::NoFactor;
use crate::block::{
    Rounding, add, backward, cholesky, columns, dot, forward, is_symmetric, packed, rows,
};
use crate::ordering::Elimination;

/// No parent.
const ROOT: u32 = u32::MAX;

/// A factorization of a matrix whose graph is a forest: every column of the
/// factor has one block below the diagonal at most, that of its parent.
pub(crate) struct Tree<const D: usize, const P: usize> {
    /// By column, in order of elimination.
    columns: Vec<Column<D, P>>,
    /// Block of the caller of each column.
    order: Vec<usize>,
    x: Vec<[f64; D]>,
}

#[derive(Clone, Copy)]
struct Column<const D: usize, const P: usize> {
    parent: u32,
    /// Pair of the caller that joins it to its parent.
    pair: u32,
    /// Diagonal block until it is eliminated, packed; then its lower Cholesky
    /// factor by columns, with the inverse of each diagonal entry.
    diagonal: [f64; P],
    /// Block of the factor in the row of the parent, row by row.
    below: [[f64; D]; D],
}

impl<const D: usize, const P: usize> Tree<D, P> {
    /// `None` if the elimination has fill.
    pub(crate) fn new(elimination: &Elimination) -> Option<Self> {
        let n = elimination.order.len();
        let graph = &elimination.graph;
        let mut columns = vec![
            Column {
                parent: ROOT,
                pair: 0,
                diagonal: [0.0; P],
                below: [[0.0; D]; D],
            };
            n
        ];
        for parent in 0..n {
            for index in graph.column(parent) {
                let column = &mut columns[graph.rows[index]];
                if column.parent != ROOT {
                    return None;
                }
                column.parent = parent as u32;
                column.pair = graph.pairs[index] as u32;
            }
        }
        Some(Self {
            columns,
            order: elimination.order.clone(),
            x: vec![[0.0; D]; n],
        })
    }

    /// In bytes.
    pub(crate) fn memory(&self) -> u64 {
        (self.columns.len() * (size_of::<Column<D, P>>() + size_of::<usize>() + 8 * D)) as u64
    }

    pub(crate) fn factorize<const Q: usize>(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
        rounding: Rounding,
    ) -> Result<(), NoFactor> {
        for (column, &block) in self.columns.iter_mut().zip(&self.order) {
            column.diagonal = diagonal[block];
        }
        for index in 0..self.columns.len() {
            let column = &mut self.columns[index];
            let before = &diagonal[self.order[index]];
            let errors = rounding.diagonal_errors(before);
            let Some(factor) = cholesky::<D, P>(&column.diagonal, &errors) else {
                return Err(NoFactor::NotPositive { column: index });
            };
            column.diagonal = factor;
            if column.parent == ROOT {
                continue;
            }
            let parent = column.parent as usize;
            let block = &off_diagonal[column.pair as usize];
            // The upper triangle has the block in the row of the smaller one.
            let is_below = is_symmetric::<D, Q>() || self.order[parent] < self.order[index];
            let below = if is_below {
                rows::<D, Q>(block)
            } else {
                columns::<D, Q>(block)
            };
            let below = below.map(|row| forward::<D, P>(&factor, row));
            column.below = below;
            let mut update = [0.0; P];
            for row in 0..D {
                for column in row..D {
                    update[packed::<D>(row, column)] = -dot(&below[row], &below[column]);
                }
            }
            add(&mut self.columns[parent].diagonal, update);
        }
        Ok(())
    }

    pub(crate) fn solve_in_place(&mut self, rhs: &mut [[f64; D]]) {
        for (x, &block) in self.x.iter_mut().zip(&self.order) {
            *x = rhs[block];
        }
        for (index, column) in self.columns.iter().enumerate() {
            let y = forward::<D, P>(&column.diagonal, self.x[index]);
            self.x[index] = y;
            if column.parent != ROOT {
                let above = &mut self.x[column.parent as usize];
                for (above, row) in above.iter_mut().zip(column.below) {
                    *above -= dot(&row, &y);
                }
            }
        }
        for (index, column) in self.columns.iter().enumerate().rev() {
            let mut y = self.x[index];
            if column.parent != ROOT {
                let above = self.x[column.parent as usize];
                for (row, above) in column.below.iter().zip(above) {
                    for (y, entry) in y.iter_mut().zip(row) {
                        *y -= entry * above;
                    }
                }
            }
            let x = backward::<D, P>(&column.diagonal, y);
            self.x[index] = x;
            rhs[self.order[index]] = x;
        }
    }
}
