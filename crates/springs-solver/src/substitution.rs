//! Solution with the factor of a multifrontal factorization.

use crate::fronts::Fronts;
use crate::multifrontal::{Layout, Multifrontal, Real, subtract_multiple};
use crate::sharing::{largest_first, work_off};
use std::ops::Range;

/// Workspace of solutions. Like factorizations, they run subtree by subtree and
/// then through the fronts above, with the same bits for any number of threads.
pub(crate) struct Substitution<T, const D: usize> {
    /// Where each column of the top fronts is among them.
    top_index: Vec<u32>,
    /// The columns of the top fronts.
    top_columns: Vec<u32>,
    /// Their entries of x.
    top_x: Vec<T>,
    /// Per task: first what it adds to them, then what they are.
    copies: Vec<Vec<T>>,
    /// Per thread: the entries of x that a front touches.
    gathered: Vec<Vec<T>>,
}

/// Below this number of entries a second thread is not worth waking.
const WORTH_A_THREAD: usize = 600_000;

impl<T: Real, const D: usize> Substitution<T, D> {
    pub(crate) fn new(fronts: &Fronts, layout: &Layout, threads: usize) -> Self {
        let mut top_index = vec![0; fronts.first[fronts.len()] as usize];
        let mut top_columns = Vec::new();
        for &front in &layout.top {
            for column in fronts.first[front]..fronts.first[front + 1] {
                top_index[column as usize] = top_columns.len() as u32;
                top_columns.push(column);
            }
        }
        let zero = T::default();
        Self {
            top_x: vec![zero; D * top_columns.len()],
            copies: vec![vec![zero; D * top_columns.len()]; layout.tasks.len()],
            gathered: vec![vec![zero; layout.highest]; threads.max(1)],
            top_index,
            top_columns,
        }
    }
}

/// What a task, or the top, sees of x.
struct View<'a, T, const D: usize> {
    fronts: &'a Fronts,
    factor: &'a [T],
    panel_starts: &'a [usize],
    top_index: &'a [u32],
    /// Its own columns, and their entries of x.
    columns: Range<u32>,
    own: &'a mut [T],
    /// Entries of the top columns.
    top: &'a mut [T],
    gathered: &'a mut [T],
}

impl<T: Real, const D: usize> View<'_, T, D> {
    #[inline(always)]
    fn block(&mut self, row: u32) -> &mut [T; D] {
        let (own, _) = self.own.as_chunks_mut::<D>();
        let (top, _) = self.top.as_chunks_mut::<D>();
        match self.columns.contains(&row) {
            true => &mut own[(row - self.columns.start) as usize],
            false => &mut top[self.top_index[row as usize] as usize],
        }
    }

    /// Number of scalars that were gathered: columns of the front, then rows.
    #[inline(always)]
    fn gather(&mut self, front: usize) -> usize {
        let fronts = self.fronts;
        let columns = fronts.first[front]..fronts.first[front + 1];
        let mut n = 0;
        for row in columns.chain(fronts.rows(front).iter().copied()) {
            let block = *self.block(row);
            self.gathered[n..n + D].copy_from_slice(&block);
            n += D;
        }
        n
    }

    #[inline(always)]
    fn scatter(&mut self, front: usize, with_rows: bool) {
        let fronts = self.fronts;
        let columns = fronts.first[front]..fronts.first[front + 1];
        let rows = if with_rows { fronts.rows(front) } else { &[] };
        for (k, row) in columns.chain(rows.iter().copied()).enumerate() {
            let block = std::array::from_fn(|axis| self.gathered[D * k + axis]);
            *self.block(row) = block;
        }
    }

    #[inline(always)]
    fn forward(&mut self, front: usize) {
        let height = self.gather(front);
        let y = &mut self.gathered[..height];
        let panel = &self.factor[self.panel_starts[front]..self.panel_starts[front + 1]];
        for (k, column) in panel.chunks_exact(height).enumerate() {
            let value = y[k] / column[k];
            y[k] = value;
            subtract_multiple(&mut y[k + 1..], &column[k + 1..], value);
        }
        self.scatter(front, true);
    }

    #[inline(always)]
    fn backward(&mut self, front: usize) {
        let height = self.gather(front);
        let y = &mut self.gathered[..height];
        let panel = &self.factor[self.panel_starts[front]..self.panel_starts[front + 1]];
        for (k, column) in panel.chunks_exact(height).enumerate().rev() {
            y[k] = (y[k] - dot(&y[k + 1..], &column[k + 1..])) / column[k];
        }
        self.scatter(front, false);
    }

    /// One direction through a list of fronts.
    fn run(&mut self, direction: Direction, fronts: impl DoubleEndedIterator<Item = usize>) {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || match direction {
                Direction::Forward => fronts.for_each(|front| self.forward(front)),
                Direction::Backward => fronts.rev().for_each(|front| self.backward(front)),
            },
        );
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Forward,
    Backward,
}

impl<T: Real, const D: usize, const P: usize> Multifrontal<T, D, P> {
    /// Replaces b by the solution, both in order of elimination.
    pub(crate) fn solve_in_place(&mut self, fronts: &Fronts, x: &mut [T]) {
        for copy in &mut self.substitution.copies {
            copy.fill(T::default());
        }
        self.run_tasks(Direction::Forward, fronts, x);
        let work = &mut self.substitution;
        let (top_x, _) = work.top_x.as_chunks_mut::<D>();
        let (blocks, _) = x.as_chunks_mut::<D>();
        for (k, (target, &column)) in top_x.iter_mut().zip(&work.top_columns).enumerate() {
            let mut sum = blocks[column as usize];
            for copy in &work.copies {
                for (axis, sum) in sum.iter_mut().enumerate() {
                    *sum += copy[D * k + axis];
                }
            }
            *target = sum;
        }
        let mut top = View::<T, D> {
            fronts,
            factor: &self.factor,
            panel_starts: &self.layout.panel_starts,
            top_index: &work.top_index,
            columns: 0..0,
            own: &mut [],
            top: &mut work.top_x,
            gathered: &mut work.gathered[0],
        };
        top.run(Direction::Forward, self.layout.top.iter().copied());
        top.run(Direction::Backward, self.layout.top.iter().copied());
        let (top_x, _) = work.top_x.as_chunks::<D>();
        for (source, &column) in top_x.iter().zip(&work.top_columns) {
            blocks[column as usize] = *source;
        }
        for copy in &mut work.copies {
            copy.copy_from_slice(&work.top_x);
        }
        self.run_tasks(Direction::Backward, fronts, x);
    }

    fn run_tasks(&mut self, direction: Direction, fronts: &Fronts, x: &mut [T]) {
        let work = &mut self.substitution;
        let threads = match self.factor.len() > WORTH_A_THREAD {
            true => work.gathered.len(),
            false => 1,
        };
        let mut rest = x;
        let mut at = 0;
        let tasks = self
            .layout
            .tasks
            .iter()
            .zip(&mut work.copies)
            .map(|(task, top)| {
                let columns = fronts.first[task.start]..fronts.first[task.end];
                let (begin, end) = (D * columns.start as usize, D * columns.end as usize);
                let (_, tail) = std::mem::take(&mut rest).split_at_mut(begin - at);
                let (own, tail) = tail.split_at_mut(end - begin);
                (rest, at) = (tail, end);
                Task {
                    fronts: task.clone(),
                    columns,
                    own,
                    top,
                }
            });
        let (factor, panel_starts) = (&self.factor, &self.layout.panel_starts);
        let top_index = &work.top_index;
        let run = |task: Task<'_, T>, gathered: &mut [T]| {
            let mut view = View::<T, D> {
                fronts,
                factor,
                panel_starts,
                top_index,
                columns: task.columns,
                own: task.own,
                top: task.top,
                gathered,
            };
            view.run(direction, task.fronts);
        };
        if threads == 1 {
            tasks.for_each(|task| run(task, &mut work.gathered[0]));
            return;
        }
        let size = |task: &Task<'_, T>| {
            (panel_starts[task.fronts.end] - panel_starts[task.fronts.start]) as f64
        };
        let shares = largest_first(tasks, threads, size);
        work_off(shares, work.gathered.iter_mut(), |task, gathered| {
            run(task, gathered);
        });
    }
}

/// One subtree with its part of x.
struct Task<'a, T> {
    fronts: Range<usize>,
    columns: Range<u32>,
    own: &'a mut [T],
    top: &'a mut Vec<T>,
}

/// xᵀy, in lanes so that the order of the sum is that of the vector unit.
#[inline(always)]
fn dot<T: Real>(x: &[T], y: &[T]) -> T {
    const LANES: usize = 16;
    let mut sums = [T::default(); LANES];
    let (xs, x_rest) = x.as_chunks::<LANES>();
    let (ys, y_rest) = y.as_chunks::<LANES>();
    for (x, y) in xs.iter().zip(ys) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let mut sum = T::default();
    for lane in sums {
        sum += lane;
    }
    for (x, y) in x_rest.iter().zip(y_rest) {
        sum += *x * *y;
    }
    sum
}
