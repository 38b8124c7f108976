//! Numeric factorization and solution on fronts.

use super::failure::{NoFactor, first_failure};
use super::front::{Values, Within, Workspace};
use super::fronts::Fronts;
use super::layout::{Layout, update_size};
use super::substitution::Substitution;
use crate::Interrupt;
use crate::storage::zeros;
use dyn_stack::MemBuffer;
use faer::Par;
use faer::linalg::cholesky::llt::factor::cholesky_in_place_scratch;
use springs_threads::{in_parallel_with, largest_first, threads_here, with_threads};
use std::ops::Range;

/// A factorization with the fronts of one pattern.
pub(crate) struct Multifrontal<const D: usize> {
    layout: Layout,
    factor: Vec<f64>,
    stacks: Vec<Vec<f64>>,
    /// Per thread.
    workspaces: Vec<Workspace>,
    substitution: Substitution<D>,
}

/// One task with its part of the factor and its stack.
struct Piece<'a> {
    task: Range<usize>,
    panels: &'a mut [f64],
    stack: &'a mut [f64],
}

/// Below this number of operations a second thread is not worth waking.
const WORTH_A_THREAD: f64 = 1.5e7;
/// The same within a pool whose threads are awake.
const WORTH_SHARING: f64 = 1e6;

impl<const D: usize> Multifrontal<D> {
    /// Of the factor and all workspace, in bytes; `None` if it cannot be counted.
    pub(crate) fn memory(fronts: &Fronts, threads: usize) -> Option<u64> {
        let layout = Layout::new(fronts, D)?;
        let stacks: usize = layout.stack_sizes.iter().sum();
        let workspaces = threads.max(1) * (layout.largest_update + layout.widest);
        let numbers = layout.factor_size() + stacks + workspaces;
        let substitution = Substitution::<D>::memory(fronts, &layout, threads);
        Some((size_of::<f64>() * numbers + substitution) as u64)
    }

    /// Allocates the factor and all workspace; `None` without enough memory.
    pub(crate) fn new(fronts: &Fronts, threads: usize) -> Option<Self> {
        let layout = Layout::new(fronts, D)?;
        let scratch = cholesky_in_place_scratch::<f64>(layout.widest, Par::Seq, Default::default());
        let mut stacks = Vec::new();
        for &size in &layout.stack_sizes {
            stacks.push(zeros(size)?);
        }
        let mut workspaces = Vec::new();
        for _ in 0..threads.max(1) {
            workspaces.push(Workspace {
                update: zeros(layout.largest_update)?,
                errors: zeros(layout.widest)?,
                memory: MemBuffer::try_new(scratch).ok()?,
            });
        }
        let substitution = Substitution::new(fronts, &layout, threads)?;
        Some(Self {
            factor: zeros(layout.factor_size())?,
            layout,
            stacks,
            workspaces,
            substitution,
        })
    }

    /// The same bits for any number of threads: fronts do not depend on who
    /// computes them.
    pub(crate) fn factorize<const P: usize, const Q: usize>(
        &mut self,
        fronts: &Fronts,
        values: Values<'_, P, Q>,
        interrupt: &Interrupt,
    ) -> Result<(), NoFactor> {
        let flops = self.layout.flops;
        let is_large = flops > WORTH_A_THREAD;
        let threads = if is_large || threads_here() > 1 && flops > WORTH_SHARING {
            self.workspaces.len()
        } else {
            1
        };
        with_threads(threads, || {
            self.factorize_on(threads, fronts, values, interrupt)
        })
    }

    fn factorize_on<const P: usize, const Q: usize>(
        &mut self,
        threads: usize,
        fronts: &Fronts,
        values: Values<'_, P, Q>,
        interrupt: &Interrupt,
    ) -> Result<(), NoFactor> {
        let layout = &self.layout;
        let (stacks, top_stack) = self.stacks.split_at_mut(layout.tasks.len());
        let panel_starts = &layout.panel_starts;
        let within = Within::<D, P, Q> {
            fronts,
            values,
            layout,
            interrupt,
        };
        let mut result = Ok(());
        if threads == 1 {
            for (task, stack) in layout.tasks.iter().zip(stacks.iter_mut()) {
                let panels = &mut self.factor[panel_starts[task.start]..panel_starts[task.end]];
                let workspace = (&mut self.workspaces[0], 1);
                let done = within.run(task.clone(), panels, stack, workspace, |_| None);
                result = first_failure(result, done);
            }
        } else {
            let mut pieces = Vec::with_capacity(layout.tasks.len());
            let (mut rest, mut at) = (&mut self.factor[..], 0);
            for (task, stack) in layout.tasks.iter().zip(stacks.iter_mut()) {
                let (begin, end) = (panel_starts[task.start], panel_starts[task.end]);
                let (_, tail) = rest.split_at_mut(begin - at);
                let (panels, tail) = tail.split_at_mut(end - begin);
                pieces.push(Piece {
                    task: task.clone(),
                    panels,
                    stack,
                });
                (rest, at) = (tail, end);
            }
            let flops = |piece: &Piece<'_>| -> f64 {
                let task = piece.task.clone();
                task.map(|front| fronts.flops(front)).sum()
            };
            let pieces = largest_first(pieces.into_iter(), flops);
            let done = in_parallel_with(pieces, &mut self.workspaces, |piece, workspace| {
                within.run(
                    piece.task,
                    piece.panels,
                    piece.stack,
                    (workspace, 1),
                    |_| None,
                )
            });
            result = done.into_iter().fold(result, first_failure);
        }
        result?;

        let task_of = |front: usize| {
            let task = layout.tasks.partition_point(|task| task.end <= front);
            let is_in = layout
                .tasks
                .get(task)
                .is_some_and(|task| task.contains(&front));
            is_in.then_some(task)
        };
        let update_of_task = |front: usize| {
            let start = layout.update_starts[front];
            let size = update_size(fronts, front, D);
            task_of(front).map(|task| &stacks[task][start..start + size])
        };
        let top = layout.top.iter().copied();
        let workspace = (&mut self.workspaces[0], threads);
        within.run(
            top,
            &mut self.factor,
            &mut top_stack[0],
            workspace,
            update_of_task,
        )
    }

    /// Replaces b by the solution, both in order of elimination.
    pub(crate) fn solve_in_place(&mut self, fronts: &Fronts, x: &mut [f64]) {
        self.substitution
            .solve_in_place(fronts, &self.layout, &self.factor, x);
    }
}
