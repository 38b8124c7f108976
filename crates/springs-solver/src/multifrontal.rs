//! Numeric factorization and solution on fronts.

use crate::Interrupt;
use crate::block::{PIVOT_ROUNDING, Rounding, columns, dot, is_symmetric, rows};
use crate::fronts::Fronts;
use crate::registers::with_clean_registers;
use crate::sharing::{in_turns, largest_first, work_off};
use crate::substitution::Substitution;
use dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{
    LltError, LltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as matmul_triangular};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::*;
use faer::traits::RealField;
use faer::{Accum, MatMut, MatRef, Par};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Range, Sub, SubAssign};

/// The two kinds of floating point numbers, with the arithmetic that plain loops
/// need.
pub(crate) trait Real:
    RealField
    + Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + Mul<Output = Self>
    + Sub<Output = Self>
    + Div<Output = Self>
    + Add<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    const EPSILON: Self;

    fn of(value: f64) -> Self;

    fn root(self) -> Self;
}

impl Real for f32 {
    const EPSILON: Self = Self::EPSILON;

    fn of(value: f64) -> Self {
        value as f32
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    const EPSILON: Self = Self::EPSILON;

    fn of(value: f64) -> Self {
        value
    }

    fn root(self) -> Self {
        self.sqrt()
    }
}

/// A factorization with the fronts of one pattern.
pub(crate) struct Multifrontal<T, const D: usize> {
    pub(crate) layout: Layout,
    pub(crate) factor: Vec<T>,
    stacks: Vec<Vec<T>>,
    /// Per thread.
    desks: Vec<Desk<T>>,
    pub(crate) substitution: Substitution<T, D>,
}

/// A matrix to be factorized: the blocks of the diagonal and of the strictly
/// upper triangle, as the caller has them.
#[derive(Clone, Copy)]
pub(crate) struct Values<'a, T, const P: usize, const Q: usize> {
    pub(crate) diagonal: &'a [[T; P]],
    pub(crate) off_diagonal: &'a [[T; Q]],
    /// Of the diagonal.
    pub(crate) rounding: Rounding,
}

/// What a thread works with.
struct Desk<T> {
    /// Update of the front at work.
    update: Vec<T>,
    /// Errors of its diagonal entries.
    errors: Vec<T>,
    memory: MemBuffer,
}

/// One task with its part of the factor and its stack.
struct Piece<'a, T> {
    task: Range<usize>,
    panels: &'a mut [T],
    stack: &'a mut [T],
}

/// Subtrees are split until none is larger than this part of the whole.
const TASK: f64 = 0.2;
/// Updates of tasks, which wait for the fronts above them, are no larger than so
/// many times the entries of the factor of the task.
const LARGEST_WAITING: usize = 4;
/// Below this number of operations a second thread is not worth waking.
const WORTH_A_THREAD: f64 = 1.5e7;
/// Fronts with fewer columns or rows than this are eliminated column by column,
/// others by dense kernels.
const FEW_COLUMNS: usize = 7;
const FEW_ROWS: usize = 28;

/// Why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoFactor {
    /// The matrix is not positive definite at this column, in order of
    /// elimination.
    NotPositive {
        column: usize,
    },
    Interrupted,
}

/// Where everything is, in scalars.
pub(crate) struct Layout {
    /// Where the panel of each front begins: its columns of the factor, all
    /// rows of the front, column by column.
    pub(crate) panel_starts: Vec<usize>,
    /// Where the update of each front begins in the stack of its task.
    update_starts: Vec<usize>,
    /// Whether it is summed up there, child by child, and not in one go on the
    /// desk when all children are done.
    in_place: Vec<bool>,
    hand_on: Vec<HandOn>,
    /// Independent subtrees, then all fronts above them.
    pub(crate) tasks: Vec<Range<usize>>,
    pub(crate) top: Vec<usize>,
    /// Of the updates that wait for their parents: of each task, and of the top.
    stack_sizes: Vec<usize>,
    largest_update: usize,
    /// Columns of the widest front, and rows of the highest.
    widest: usize,
    pub(crate) highest: usize,
    /// Multiplications and additions of a factorization.
    flops: f64,
}

/// What becomes of the update of a front.
#[derive(Clone, Copy, PartialEq, Eq)]
enum HandOn {
    /// It waits on the stack.
    Wait,
    /// It is added to the front of its parent, which is in place.
    Add,
    /// Likewise, and that front has to be begun.
    BeginAndAdd,
}

impl Layout {
    /// With blocks of the given dimension; `None` if the sizes cannot be counted.
    pub(crate) fn new(fronts: &Fronts, dimension: usize) -> Option<Self> {
        let n = fronts.len();
        let mut panel_starts = vec![0usize; n + 1];
        for front in 0..n {
            let columns = dimension * fronts.n_columns(front);
            let size = columns.checked_mul(columns + dimension * fronts.rows(front).len())?;
            panel_starts[front + 1] = panel_starts[front].checked_add(size)?;
        }
        let (tasks, top) = split(fronts);
        let updates: Vec<usize> = (0..n)
            .map(|front| update_size(fronts, front, dimension))
            .collect();
        let mut list_of = vec![tasks.len(); n];
        for (task, fronts) in tasks.iter().enumerate() {
            list_of[fronts.clone()].fill(task);
        }
        let places = Places::new(fronts, &updates, &list_of);
        let mut stack_sizes = vec![0; tasks.len() + 1];
        for front in 0..n {
            if places.in_place[front] || places.hand_on[front] == HandOn::Wait {
                let size: &mut usize = &mut stack_sizes[list_of[front]];
                *size = (*size).max(places.update_starts[front] + updates[front]);
            }
        }
        let on_desk = |front: &usize| !places.in_place[*front];
        let on_desk = (0..n).filter(on_desk).map(|front| updates[front]);
        let largest_update = on_desk.max().unwrap_or(0);
        let width = |front| dimension * fronts.n_columns(front);
        let height = |front| width(front) + dimension * fronts.rows(front).len();
        Some(Self {
            panel_starts,
            update_starts: places.update_starts,
            in_place: places.in_place,
            hand_on: places.hand_on,
            tasks,
            top,
            stack_sizes,
            largest_update,
            widest: (0..n).map(width).max().unwrap_or(0),
            highest: (0..n).map(height).max().unwrap_or(0),
            flops: fronts.total_flops() * (dimension as f64).powi(3),
        })
    }

    /// Entries of the factor.
    pub(crate) fn factor_size(&self) -> usize {
        self.panel_starts[self.panel_starts.len() - 1]
    }
}

impl<T: Real, const D: usize> Multifrontal<T, D> {
    /// Of the factor and all workspace, in bytes; `None` if it cannot be counted.
    pub(crate) fn memory(fronts: &Fronts, threads: usize) -> Option<u64> {
        let layout = Layout::new(fronts, D)?;
        let stacks: usize = layout.stack_sizes.iter().sum();
        let desks = threads.max(1) * (layout.largest_update + layout.widest);
        let numbers = layout.factor_size() + stacks + desks;
        let substitution = Substitution::<T, D>::memory(fronts, &layout, threads);
        Some((size_of::<T>() * numbers + substitution) as u64)
    }

    /// Allocates the factor and all workspace; `None` without enough memory.
    pub(crate) fn new(fronts: &Fronts, threads: usize) -> Option<Self> {
        let layout = Layout::new(fronts, D)?;
        let scratch = cholesky_in_place_scratch::<T>(layout.widest, Par::Seq, Default::default());
        let mut stacks = Vec::new();
        for &size in &layout.stack_sizes {
            stacks.push(zeros(size)?);
        }
        let mut desks = Vec::new();
        for _ in 0..threads.max(1) {
            desks.push(Desk {
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
            desks,
            substitution,
        })
    }

    /// The same bits for any number of threads: fronts do not depend on who
    /// computes them.
    pub(crate) fn factorize<const P: usize, const Q: usize>(
        &mut self,
        fronts: &Fronts,
        values: Values<'_, T, P, Q>,
        interrupt: &Interrupt,
    ) -> Result<(), NoFactor> {
        let layout = &self.layout;
        let threads = match layout.flops > WORTH_A_THREAD {
            true => self.desks.len(),
            false => 1,
        };
        let (stacks, top_stack) = self.stacks.split_at_mut(layout.tasks.len());
        let panel_starts = &layout.panel_starts;
        let within = Within::<T, D, P, Q> {
            fronts,
            values,
            layout,
            interrupt,
        };
        let (my_desk, other_desks) = self.desks.split_first_mut().expect("one thread at least");
        let mut result = Ok(());
        if threads == 1 {
            for (task, stack) in layout.tasks.iter().zip(stacks.iter_mut()) {
                let panels = &mut self.factor[panel_starts[task.start]..panel_starts[task.end]];
                let desk = (&mut *my_desk, 1);
                let done = within.run(task.clone(), panels, stack, desk, |_| None);
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
            let flops = |piece: &Piece<'_, T>| -> f64 {
                let task = piece.task.clone();
                task.map(|front| fronts.flops(front)).sum()
            };
            let shares = largest_first(pieces.into_iter(), threads, flops);
            let desks = std::iter::once(&mut *my_desk).chain(other_desks);
            let done = work_off(shares, desks, |piece, desk| {
                within.run(piece.task, piece.panels, piece.stack, (desk, 1), |_| None)
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
        let desk = (my_desk, threads);
        within.run(
            top,
            &mut self.factor,
            &mut top_stack[0],
            desk,
            update_of_task,
        )
    }
}

/// The failure that one thread, which goes from column to column, would have met.
fn first_failure(a: Result<(), NoFactor>, b: Result<(), NoFactor>) -> Result<(), NoFactor> {
    match (a, b) {
        (
            Err(NoFactor::NotPositive { column: of_a }),
            Err(NoFactor::NotPositive { column: of_b }),
        ) => Err(NoFactor::NotPositive {
            column: of_a.min(of_b),
        }),
        (Err(NoFactor::NotPositive { .. }) | Ok(()), b @ Err(_)) => b,
        (a, _) => a,
    }
}

/// Scalars of the update matrix of a front: square, its lower half used.
fn update_size(fronts: &Fronts, front: usize, dimension: usize) -> usize {
    let below = dimension * fronts.rows(front).len();
    below * below
}

/// Where the updates of fronts are; see [`Layout`].
struct Places {
    update_starts: Vec<usize>,
    in_place: Vec<bool>,
    hand_on: Vec<HandOn>,
}

impl Places {
    /// From the size of the update of each front, and the task that it belongs to:
    /// the fronts of a task are eliminated one after the other with one stack.
    ///
    /// Either the updates of all children wait on the stack until their parent
    /// is assembled, or room for the parent is made first and each is added to
    /// it at once: whichever takes less.
    fn new(fronts: &Fronts, updates: &[usize], list_of: &[usize]) -> Self {
        let n = fronts.len();
        let children = |front: usize| {
            let all = fronts.children(front).iter().map(|&child| child as usize);
            all.filter(move |&child| list_of[child] == list_of[front])
        };
        let mut in_place = vec![false; n];
        // What the subtree of each front takes while it is at work.
        let mut needs = vec![0usize; n];
        for front in 0..n {
            let (mut waiting, mut most_waiting, mut most) = (0, 0, 0);
            for child in children(front) {
                most = most.max(needs[child]);
                most_waiting = most_waiting.max(waiting + needs[child].max(updates[child]));
                waiting += updates[child];
            }
            in_place[front] = updates[front] + most < most_waiting;
            needs[front] = if in_place[front] {
                updates[front] + most
            } else {
                most_waiting
            };
        }
        let mut update_starts = vec![0; n];
        let mut hand_on = vec![HandOn::Wait; n];
        for front in (0..n).rev() {
            let mut start = update_starts[front];
            let mut next = HandOn::BeginAndAdd;
            for child in children(front) {
                if in_place[front] {
                    update_starts[child] = start + updates[front];
                    hand_on[child] = next;
                    next = HandOn::Add;
                } else {
                    update_starts[child] = start;
                    start += updates[child];
                }
            }
        }
        Self {
            update_starts,
            in_place,
            hand_on,
        }
    }
}

/// Independent subtrees, ascending, none larger than a part of the whole, and
/// the fronts above them. Subtrees that leave a far larger update than their part of
/// the factor are no tasks of their own: all those updates would have to wait.
fn split(fronts: &Fronts) -> (Vec<Range<usize>>, Vec<usize>) {
    let n = fronts.len();
    let mut flops: Vec<f64> = (0..n).map(|front| fronts.flops(front)).collect();
    let total: f64 = flops.iter().sum();
    let mut first: Vec<usize> = (0..n).collect();
    let columns = |front| fronts.n_columns(front);
    let entries = |front| columns(front) * (columns(front) + fronts.rows(front).len());
    let mut entries: Vec<usize> = (0..n).map(entries).collect();
    let with_parents = (0..n).filter_map(|front| Some((front, fronts.parent(front)?)));
    for (front, parent) in with_parents {
        flops[parent] += flops[front];
        entries[parent] += entries[front];
        first[parent] = first[parent].min(first[front]);
    }
    let mut tasks = Vec::new();
    let mut top = Vec::new();
    for (front, &first) in first.iter().enumerate() {
        let is_small = |front: usize| flops[front] <= TASK * total;
        match fronts.parent(front) {
            _ if !is_small(front) => top.push(front),
            Some(parent) if is_small(parent) => {}
            _ if update_size(fronts, front, 1) > LARGEST_WAITING * entries[front] => {
                top.extend(first..front + 1);
            }
            _ => tasks.push(first..front + 1),
        }
    }
    (tasks, top)
}

/// What all tasks share.
struct Within<'a, T, const D: usize, const P: usize, const Q: usize> {
    fronts: &'a Fronts,
    values: Values<'a, T, P, Q>,
    layout: &'a Layout,
    interrupt: &'a Interrupt,
}

impl<T: Real, const D: usize, const P: usize, const Q: usize> Within<'_, T, D, P, Q> {
    /// Eliminates fronts one after the other: those of a task, or those above all
    /// tasks. `panels` begin with that of the first front or of all, and
    /// `finished` has the updates of children that are not among them.
    fn run<'b>(
        &self,
        list: impl Iterator<Item = usize> + Clone,
        panels: &mut [T],
        stack: &mut [T],
        (desk, threads): (&mut Desk<T>, usize),
        finished: impl Fn(usize) -> Option<&'b [T]>,
    ) -> Result<(), NoFactor>
    where
        T: 'b,
    {
        let (fronts, layout) = (self.fronts, self.layout);
        let starts = &layout.panel_starts;
        let base = match panels.len() == layout.factor_size() {
            true => 0,
            false => starts[list.clone().next().unwrap_or(0)],
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
                (&mut desk.update[..size], &*mine)
            };
            let errors = &mut desk.errors[..D * fronts.n_columns(front)];
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
                (&mut desk.memory, threads),
                update_of,
            )?;

            let hand_on = layout.hand_on[front];
            if let (Some(parent), true) = (fronts.parent(front), hand_on != HandOn::Wait) {
                let (before, mine) = stack.split_at_mut(start);
                let from = if in_place {
                    &mine[..size]
                } else {
                    &desk.update[..size]
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
                stack[start..start + size].copy_from_slice(&desk.update[..size]);
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
        panel: &mut [T],
        update: &mut [T],
        errors: &mut [T],
        (memory, threads): (&mut MemBuffer, usize),
        update_of: impl Fn(usize) -> Option<&'b [T]>,
    ) -> Result<(), NoFactor>
    where
        T: 'b,
    {
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
                match is_small {
                    true => eliminate_columns::<T, D>(panel, update, errors),
                    false => Ok(()),
                }
            },
        );
        let result = match is_small {
            true => result,
            false => {
                let stack = MemStack::new(memory);
                eliminate_dense::<T, D>(panel, update, errors, (threads, self.interrupt), stack)
            }
        };
        result.map_err(|column| NoFactor::NotPositive {
            column: fronts.first[front] as usize + column / D,
        })
    }

    /// The errors of the diagonal of a front.
    #[inline(always)]
    fn set_errors(&self, front: usize, errors: &mut [T]) {
        let epsilon = T::of(PIVOT_ROUNDING) * T::EPSILON;
        let (errors, _) = errors.as_chunks_mut::<D>();
        for (errors, &block) in errors.iter_mut().zip(self.fronts.blocks(front)) {
            let block = &self.values.diagonal[block as usize];
            *errors = self.values.rounding.diagonal_errors(block, epsilon);
        }
    }

    /// The entries of the matrix in a front.
    #[inline(always)]
    fn assemble(&self, front: usize, panel: &mut [T], update: &mut [T]) {
        let height = panel.len() / (D * self.fronts.n_columns(front));
        panel.fill(T::default());
        update.fill(T::default());
        let mut put = |row: usize, column: usize, columns: [[T; D]; D]| {
            for (k, values) in columns.iter().enumerate() {
                let start = (D * column + k) * height + D * row;
                panel[start..start + D].copy_from_slice(values);
            }
        };
        for (column, &block) in self.fronts.blocks(front).iter().enumerate() {
            let block = &self.values.diagonal[block as usize];
            put(column, column, rows::<T, D, P>(block));
        }
        for entry in self.fronts.entries(front) {
            let block = &self.values.off_diagonal[entry.pair as usize];
            let (row, column) = (entry.row as usize, entry.column as usize);
            if is_symmetric::<D, Q>() {
                put(row.max(column), row.min(column), rows::<T, D, Q>(block));
            } else if row > column {
                put(row, column, columns::<T, D, Q>(block));
            } else {
                // Of the transpose below the diagonal.
                put(column, row, rows::<T, D, Q>(block));
            }
        }
    }

    /// Adds the update of a child to a front.
    #[inline(always)]
    fn add_update(
        &self,
        child: usize,
        from: &[T],
        front: usize,
        panel: &mut [T],
        update: &mut [T],
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

/// Elimination column by column, for narrow fronts; the column where it fails.
#[inline(always)]
fn eliminate_columns<T: Real, const D: usize>(
    panel: &mut [T],
    update: &mut [T],
    errors: &[T],
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
        let root = pivot.root();
        let column = &mut done[k * height..];
        column[k] = root;
        let inverse = T::of(1.0) / root;
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
                let below: [&[T]; D] = std::array::from_fn(|k| {
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
fn eliminate_dense<T: Real, const D: usize>(
    panel: &mut [T],
    update: &mut [T],
    errors: &[T],
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
fn subtract_product<T: Real>(l: MatRef<'_, T>, first: usize, tile: MatMut<'_, T>) {
    let width = tile.ncols();
    let (_, tile) = tile.split_at_row_mut(first);
    let (diagonal, under) = tile.split_at_row_mut(width);
    let (of_diagonal, of_rest) = l.split_at_row(first).1.split_at_row(width);
    let minus = T::of(-1.0);
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

fn column_tiles<'a, T: Real + 'a>(mut rest: MatMut<'a, T>) -> impl Iterator<Item = MatMut<'a, T>> {
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
    /// Does every piece of work, in turns on several threads if they are wanted;
    /// none that is left when it is interrupted.
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
        let shares = in_turns(pieces, self.threads);
        work_off(shares, 0..self.threads, |piece, _| work(piece));
    }
}

/// y −= a·x.
#[inline(always)]
pub(crate) fn subtract_multiple<T: Real>(y: &mut [T], x: &[T], a: T) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= a * *x;
    }
}

/// Zeroed storage, or `None` if there is not enough memory.
pub(crate) fn zeros<T: Real>(length: usize) -> Option<Vec<T>> {
    filled(T::default(), length)
}

/// Storage full of one value, likewise.
pub(crate) fn filled<V: Clone>(value: V, length: usize) -> Option<Vec<V>> {
    let mut values = Vec::new();
    values.try_reserve_exact(length).ok()?;
    values.resize(length, value);
    Some(values)
}
