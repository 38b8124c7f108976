//! Assembly and elimination of fronts.

use super::failure::NoFactor;
use super::fronts::Fronts;
use super::kernels::{eliminate_columns, eliminate_dense};
use super::layout::{HandOn, Layout, update_size};
use crate::Interrupt;
use crate::block::{Rounding, columns, is_symmetric, rows};
use dyn_stack::{MemBuffer, MemStack};

/// Fronts with fewer columns or rows than this are eliminated column by column,
/// others by dense kernels.
const FEW_COLUMNS: usize = 7;
const FEW_ROWS: usize = 28;

/// A matrix to be factorized: the blocks of the diagonal and of the strictly
/// upper triangle, as the caller has them.
#[derive(Clone, Copy)]
pub(crate) struct Values<'a, const P: usize, const Q: usize> {
    pub(crate) diagonal: &'a [[f64; P]],
    pub(crate) off_diagonal: &'a [[f64; Q]],
    /// Of the diagonal.
    pub(crate) rounding: Rounding,
}

/// What a thread works with.
pub(crate) struct Workspace {
    /// Update of the front at work.
    pub(crate) update: Vec<f64>,
    /// Errors of its diagonal entries.
    pub(crate) errors: Vec<f64>,
    pub(crate) memory: MemBuffer,
}

/// What all tasks share.
pub(crate) struct Within<'a, const D: usize, const P: usize, const Q: usize> {
    pub(crate) fronts: &'a Fronts,
    pub(crate) values: Values<'a, P, Q>,
    pub(crate) layout: &'a Layout,
    pub(crate) interrupt: &'a Interrupt,
}

impl<const D: usize, const P: usize, const Q: usize> Within<'_, D, P, Q> {
    /// Eliminates fronts one after the other: those of a task, or those above all
    /// tasks. `panels` begin with that of the first front or of all, and
    /// `finished` has the updates of children that are not among them.
    pub(crate) fn run<'b>(
        &self,
        list: impl Iterator<Item = usize> + Clone,
        panels: &mut [f64],
        stack: &mut [f64],
        (workspace, threads): (&mut Workspace, usize),
        finished: impl Fn(usize) -> Option<&'b [f64]>,
    ) -> Result<(), NoFactor> {
        let (fronts, layout) = (self.fronts, self.layout);
        let starts = &layout.panel_starts;
        let base = if panels.len() == layout.factor_size() {
            0
        } else {
            starts[list.clone().next().unwrap_or(0)]
        };
        let panel_of = |front: usize| starts[front] - base..starts[front + 1] - base;
        let size_of = |front: usize| update_size(fronts, front, D);
        for front in list {
            if self.interrupt.is_requested() {
                return Err(NoFactor::Interrupted);
            }
            let (start, size) = (layout.update_starts[front], size_of(front));
            let in_place = layout.in_place[front];
            let (waiting, mine) = stack.split_at_mut(if in_place { start } else { 0 });
            let (update, waiting) = if in_place {
                (&mut mine[..size], &*waiting)
            } else {
                (&mut workspace.update[..size], &*mine)
            };
            let errors = &mut workspace.errors[..D * fronts.n_columns(front)];
            let panel = &mut panels[panel_of(front)];
            let update_of = |child: usize| {
                let waits = || {
                    let start = layout.update_starts[child];
                    (!in_place).then(|| &waiting[start..start + size_of(child)])
                };
                finished(child).or_else(waits)
            };
            self.eliminate(
                front,
                panel,
                update,
                errors,
                (&mut workspace.memory, threads),
                update_of,
            )?;

            let hand_on = layout.hand_on[front];
            if let (Some(parent), true) = (fronts.parent(front), hand_on != HandOn::Wait) {
                let (before, mine) = stack.split_at_mut(start);
                let from = if in_place {
                    &mine[..size]
                } else {
                    &workspace.update[..size]
                };
                let update = &mut before[layout.update_starts[parent]..][..size_of(parent)];
                let panel = &mut panels[panel_of(parent)];
                pulp::Arch::new().dispatch(
                    #[inline(always)]
                    || {
                        if hand_on == HandOn::BeginAndAdd {
                            self.assemble(parent, panel, update);
                        }
                        self.add_update(front, from, parent, panel, update);
                    },
                );
            } else if !in_place {
                stack[start..start + size].copy_from_slice(&workspace.update[..size]);
            }
        }
        Ok(())
    }

    /// Assembles and eliminates one front: its columns of the factor go into
    /// `panel`, what they leave for the parent into `update`. A front in place
    /// has been begun, and `update_of` knows only children that were not added.
    fn eliminate<'b>(
        &self,
        front: usize,
        panel: &mut [f64],
        update: &mut [f64],
        errors: &mut [f64],
        (memory, threads): (&mut MemBuffer, usize),
        update_of: impl Fn(usize) -> Option<&'b [f64]>,
    ) -> Result<(), NoFactor> {
        let fronts = self.fronts;
        let (columns, height) = (errors.len(), panel.len() / errors.len());
        let is_small = columns < FEW_COLUMNS || height < FEW_ROWS;
        let result = pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                if !self.layout.in_place[front] {
                    self.assemble(front, panel, update);
                }
                self.set_errors(front, errors);
                for &child in fronts.children(front) {
                    let child = child as usize;
                    if let Some(from) = update_of(child) {
                        self.add_update(child, from, front, panel, update);
                    }
                }
                if is_small {
                    eliminate_columns::<D>(panel, update, errors)
                } else {
                    Ok(())
                }
            },
        );
        let result = if is_small {
            result
        } else {
            let stack = MemStack::new(memory);
            eliminate_dense::<D>(panel, update, errors, (threads, self.interrupt), stack)
        };
        result.map_err(|column| NoFactor::NotPositive {
            column: fronts.first[front] as usize + column / D,
        })
    }

    /// The errors of the diagonal of a front.
    #[inline(always)]
    fn set_errors(&self, front: usize, errors: &mut [f64]) {
        let (errors, _) = errors.as_chunks_mut::<D>();
        for (errors, &block) in errors.iter_mut().zip(self.fronts.blocks(front)) {
            let block = &self.values.diagonal[block as usize];
            *errors = self.values.rounding.diagonal_errors(block);
        }
    }

    /// The entries of the matrix in a front.
    #[inline(always)]
    fn assemble(&self, front: usize, panel: &mut [f64], update: &mut [f64]) {
        let height = panel.len() / (D * self.fronts.n_columns(front));
        panel.fill(0.0);
        update.fill(0.0);
        let mut put = |row: usize, column: usize, columns: [[f64; D]; D]| {
            for (k, values) in columns.iter().enumerate() {
                let start = (D * column + k) * height + D * row;
                panel[start..start + D].copy_from_slice(values);
            }
        };
        for (column, &block) in self.fronts.blocks(front).iter().enumerate() {
            let block = &self.values.diagonal[block as usize];
            put(column, column, rows::<D, P>(block));
        }
        for entry in self.fronts.entries(front) {
            let block = &self.values.off_diagonal[entry.pair as usize];
            let (row, column) = (entry.row as usize, entry.column as usize);
            if is_symmetric::<D, Q>() {
                put(row.max(column), row.min(column), rows::<D, Q>(block));
            } else if row > column {
                put(row, column, columns::<D, Q>(block));
            } else {
                // Of the transpose below the diagonal.
                put(column, row, rows::<D, Q>(block));
            }
        }
    }

    /// Adds the update of a child to a front.
    #[inline(always)]
    fn add_update(
        &self,
        child: usize,
        from: &[f64],
        front: usize,
        panel: &mut [f64],
        update: &mut [f64],
    ) {
        let fronts = self.fronts;
        let (n_columns, below) = (fronts.n_columns(front), D * fronts.rows(front).len());
        let height = D * n_columns + below;
        let relative = fronts.relative(child);
        let size = D * relative.len();
        for (column, &target) in relative.iter().enumerate() {
            let target = target as usize;
            for k in 0..D {
                let scalar = D * column + k;
                let source = &from[scalar * size + D * column..(scalar + 1) * size];
                // A whole column of the front, from the row `offset` on.
                let (into, offset) = match target.checked_sub(n_columns) {
                    None => (&mut panel[(D * target + k) * height..][..height], 0),
                    Some(below_column) => {
                        let start = (D * below_column + k) * below;
                        (&mut update[start..start + below], n_columns)
                    }
                };
                let (into, _) = into.as_chunks_mut::<D>();
                let (source, _) = source.as_chunks::<D>();
                for (&row, values) in relative[column..].iter().zip(source) {
                    let target = &mut into[row as usize - offset];
                    for (target, value) in target.iter_mut().zip(values) {
                        *target += *value;
                    }
                }
            }
        }
    }
}
