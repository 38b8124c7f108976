//! Chains, trees and forests: elimination without fill.

use crate::fronts::Elimination;
use crate::multifrontal::NotPositive;

/// No parent.
const ROOT: u32 = u32::MAX;

/// A factorization of a matrix whose graph is a forest: every column of the
/// factor has one block below the diagonal at most, that of its parent.
pub(crate) struct Tree {
    /// By column, in order of elimination.
    columns: Vec<Column>,
    /// Block of the caller of each column.
    order: Vec<usize>,
    x: Vec<[f64; 3]>,
}

#[derive(Clone, Copy)]
struct Column {
    parent: u32,
    /// Pair of the caller that joins it to its parent.
    pair: u32,
    /// Diagonal block until it is eliminated, packed; then its lower Cholesky
    /// factor by columns, with the inverse of each diagonal entry.
    diagonal: [f64; 6],
    /// Block of the factor in the row of the parent, row by row.
    below: [[f64; 3]; 3],
}

impl Tree {
    /// `None` if the elimination has fill.
    pub(crate) fn new(elimination: &Elimination) -> Option<Self> {
        let n = elimination.order.len();
        let graph = &elimination.graph;
        let mut columns = vec![
            Column {
                parent: ROOT,
                pair: 0,
                diagonal: [0.0; 6],
                below: [[0.0; 3]; 3],
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
            x: vec![[0.0; 3]; n],
        })
    }

    /// In bytes.
    pub(crate) fn memory(&self) -> u64 {
        (self.columns.len() * (size_of::<Column>() + size_of::<usize>() + 24)) as u64
    }

    pub(crate) fn factorize(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; 6]],
    ) -> Result<(), NotPositive> {
        for (column, &block) in self.columns.iter_mut().zip(&self.order) {
            column.diagonal = diagonal[block];
        }
        for index in 0..self.columns.len() {
            let column = &mut self.columns[index];
            let Some(factor) = cholesky(&column.diagonal) else {
                return Err(NotPositive { column: index });
            };
            column.diagonal = factor;
            if column.parent == ROOT {
                continue;
            }
            let [xx, xy, xz, yy, yz, zz] = off_diagonal[column.pair as usize];
            // Symmetric, so its rows are those of the block below.
            let below = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|row| forward(&factor, row));
            column.below = below;
            let [a, b, c] = below;
            let parent = column.parent as usize;
            let parent = &mut self.columns[parent].diagonal;
            let update = [
                dot(a, a),
                dot(a, b),
                dot(a, c),
                dot(b, b),
                dot(b, c),
                dot(c, c),
            ];
            for (entry, update) in parent.iter_mut().zip(update) {
                *entry -= update;
            }
        }
        Ok(())
    }

    pub(crate) fn solve_in_place(&mut self, rhs: &mut [[f64; 3]]) {
        for (x, &block) in self.x.iter_mut().zip(&self.order) {
            *x = rhs[block];
        }
        for (index, column) in self.columns.iter().enumerate() {
            let y = forward(&column.diagonal, self.x[index]);
            self.x[index] = y;
            if column.parent != ROOT {
                let above = &mut self.x[column.parent as usize];
                for (above, row) in above.iter_mut().zip(column.below) {
                    *above -= dot(row, y);
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
            let x = backward(&column.diagonal, y);
            self.x[index] = x;
            rhs[self.order[index]] = x;
        }
    }
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// L of a packed symmetric block by columns, diagonal entries inverted; `None`
/// if it is not positive definite.
#[inline(always)]
fn cholesky(a: &[f64; 6]) -> Option<[f64; 6]> {
    let [xx, xy, xz, yy, yz, zz] = *a;
    // What is not a number is not positive.
    let inverse_root = |pivot: f64| (pivot > 0.0).then(|| 1.0 / pivot.sqrt());
    let i0 = inverse_root(xx)?;
    let (l10, l20) = (xy * i0, xz * i0);
    let i1 = inverse_root(yy - l10 * l10)?;
    let l21 = (yz - l20 * l10) * i1;
    let i2 = inverse_root(zz - l20 * l20 - l21 * l21)?;
    Some([i0, l10, l20, i1, l21, i2])
}

/// L⁻¹ b.
#[inline(always)]
fn forward(l: &[f64; 6], b: [f64; 3]) -> [f64; 3] {
    let [i0, l10, l20, i1, l21, i2] = *l;
    let y0 = b[0] * i0;
    let y1 = (b[1] - l10 * y0) * i1;
    [y0, y1, (b[2] - l20 * y0 - l21 * y1) * i2]
}

/// L⁻ᵀ y.
#[inline(always)]
fn backward(l: &[f64; 6], y: [f64; 3]) -> [f64; 3] {
    let [i0, l10, l20, i1, l21, i2] = *l;
    let x2 = y[2] * i2;
    let x1 = (y[1] - l21 * x2) * i1;
    [(y[0] - l10 * x1 - l20 * x2) * i0, x1, x2]
}
