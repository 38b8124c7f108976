//! Dense kernels: plain loops for narrow fronts, faer's for wide ones.

use super::registers::with_clean_registers;
use crate::Interrupt;
use crate::block::dot;
use dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization, cholesky_in_place};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as matmul_triangular};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::*;
use faer::{Accum, MatMut, MatRef, Par};
use springs_threads::in_parallel;

/// Elimination column by column, for narrow fronts; the column where it fails.
#[inline(always)]
pub(crate) fn eliminate_columns<const D: usize>(
    panel: &mut [f64],
    update: &mut [f64],
    errors: &[f64],
) -> Result<(), usize> {
    let columns = errors.len();
    let height = panel.len() / columns;
    let below = height - columns;
    for k in 0..columns {
        let (done, rest) = panel.split_at_mut((k + 1) * height);
        let pivot = done[k * height + k];
        let mut limit = errors[k];
        for j in k - k % D..k {
            let ratio = done[j * height + k] / done[j * height + j];
            limit += ratio * ratio * errors[j];
        }
        // What is not a number does not exceed it either.
        let is_positive = pivot > limit;
        if !is_positive {
            return Err(k);
        }
        let root = pivot.sqrt();
        let column = &mut done[k * height..];
        column[k] = root;
        let inverse = 1.0 / root;
        for value in &mut column[k + 1..] {
            *value *= inverse;
        }
        for (j, target) in rest.chunks_exact_mut(height).enumerate() {
            let row = k + 1 + j;
            subtract_multiple(&mut target[row..], &column[row..], column[row]);
        }
    }
    if below > 0 {
        for (j, target) in update.chunks_exact_mut(below).enumerate() {
            let target = &mut target[j..];
            for block in panel.chunks_exact(D * height) {
                let below: [&[f64]; D] = std::array::from_fn(|k| {
                    let row = &block[k * height + columns + j..(k + 1) * height];
                    &row[..target.len()]
                });
                let factors = below.map(|row| row[0]);
                for (i, y) in target.iter_mut().enumerate() {
                    *y -= dot(&factors, &below.map(|row| row[i]));
                }
            }
        }
    }
    Ok(())
}

/// Columns that are eliminated at once, and the size of the tiles of the rest.
/// It does not depend on the number of threads, so neither do the bits. Blocks
/// of one, two or three columns are not cut.
const TILE: usize = 192;
/// Below this number of operations the tiles of a front stay on one thread.
const WORTH_SHARING: f64 = 1e7;

/// Elimination by dense kernels, for wide fronts; the column where it fails. If it
/// is interrupted, what is left of the front is of no use.
pub(crate) fn eliminate_dense<const D: usize>(
    panel: &mut [f64],
    update: &mut [f64],
    errors: &[f64],
    (threads, interrupt): (usize, &Interrupt),
    stack: &mut MemStack,
) -> Result<(), usize> {
    let columns = errors.len();
    let height = panel.len() / columns;
    let below = height - columns;
    let flops = columns as f64 * (height as f64).powi(2);
    let threads = if flops > WORTH_SHARING { threads } else { 1 };
    let tiles = Tiles { threads, interrupt };
    for start in (0..columns).step_by(TILE) {
        let width = TILE.min(columns - start);
        let end = start + width;
        let (before, later) = panel.split_at_mut(end * height);
        let this = &mut before[start * height..];
        let this = MatMut::from_column_major_slice_mut(this, height, width);
        let (_, this) = this.split_at_row_mut(start);
        let (mut diagonal, mut rest) = this.split_at_row_mut(width);
        let done = with_clean_registers(|| {
            cholesky_in_place(
                diagonal.rb_mut(),
                LltRegularization::default(),
                Par::Seq,
                stack,
                Default::default(),
            )
        });
        // The kernel stops only at pivots that are not above zero.
        let n_done = match done {
            Ok(_) => width,
            Err(LltError::NonPositivePivot { index }) => index,
        };
        let diagonal = diagonal.rb();
        let is_zero = |&k: &usize| {
            let mut limit = errors[start + k];
            for j in k - k % D..k {
                let ratio = diagonal[(k, j)] / diagonal[(j, j)];
                limit += ratio * ratio * errors[start + j];
            }
            let root = diagonal[(k, k)];
            let is_positive = root * root > limit;
            !is_positive
        };
        let failed = (0..n_done).find(is_zero);
        if let Some(k) = failed.or((n_done < width).then_some(n_done)) {
            return Err(start + k);
        }
        let transposed = rest.rb_mut().transpose_mut();
        tiles.each(column_tiles(transposed), |tile| {
            with_clean_registers(|| solve_lower_triangular_in_place(diagonal, tile, Par::Seq));
        });
        let rest = rest.rb();
        let n_later = columns - end;
        let later = MatMut::from_column_major_slice_mut(later, height, n_later);
        let (_, later) = later.split_at_row_mut(end);
        tiles.each(column_tiles(later).enumerate(), |(k, tile)| {
            subtract_product(rest, k * TILE, tile);
        });
        if below > 0 {
            let rest = rest.split_at_row(n_later).1;
            let update = MatMut::from_column_major_slice_mut(&mut *update, below, below);
            tiles.each(column_tiles(update).enumerate(), |(k, tile)| {
                subtract_product(rest, k * TILE, tile);
            });
        }
    }
    Ok(())
}

/// The columns of A −= L Lᵀ from `first` on that `tile` holds, as far as they are
/// on or below the diagonal.
fn subtract_product(l: MatRef<'_, f64>, first: usize, tile: MatMut<'_, f64>) {
    let width = tile.ncols();
    let (_, tile) = tile.split_at_row_mut(first);
    let (diagonal, under) = tile.split_at_row_mut(width);
    let (of_diagonal, of_rest) = l.split_at_row(first).1.split_at_row(width);
    let minus = -1.0;
    with_clean_registers(|| {
        matmul_triangular(
            diagonal,
            BlockStructure::TriangularLower,
            Accum::Add,
            of_diagonal,
            BlockStructure::Rectangular,
            of_diagonal.transpose(),
            BlockStructure::Rectangular,
            minus,
            Par::Seq,
        );
        matmul(
            under,
            Accum::Add,
            of_rest,
            of_diagonal.transpose(),
            minus,
            Par::Seq,
        );
    });
}

fn column_tiles<'a>(mut rest: MatMut<'a, f64>) -> impl Iterator<Item = MatMut<'a, f64>> {
    std::iter::from_fn(move || {
        let size = TILE.min(rest.ncols());
        let all = std::mem::replace(
            &mut rest,
            MatMut::from_column_major_slice_mut(&mut [], 0, 0),
        );
        let (tile, tail) = all.split_at_col_mut(size);
        rest = tail;
        (size > 0).then_some(tile)
    })
}

/// How the tiles of a front are worked on.
#[derive(Clone, Copy)]
struct Tiles<'a> {
    threads: usize,
    interrupt: &'a Interrupt,
}

impl Tiles<'_> {
    /// Does every piece of work, on several threads if they are wanted; none that is
    /// left when it is interrupted.
    fn each<P: Send>(self, pieces: impl Iterator<Item = P>, work: impl Fn(P) + Sync) {
        let work = |piece| {
            if !self.interrupt.is_requested() {
                work(piece);
            }
        };
        if self.threads == 1 {
            pieces.for_each(work);
            return;
        }
        in_parallel(pieces.collect(), self.threads, work);
    }
}

/// y −= a·x.
#[inline(always)]
pub(crate) fn subtract_multiple(y: &mut [f64], x: &[f64], a: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= a * *x;
    }
}
