//! Solution with the factor of a multifrontal factorization.

use super::columns::{solve, solve_transposed};
use super::fronts::Fronts;
use super::layout::Layout;
use crate::storage::zeros;
use springs_threads::{in_parallel_with, largest_first, threads_here, with_threads};
use std::ops::Range;

/// Workspace of solutions. Like factorizations, they run subtree by subtree and
/// then through the fronts above, with the same bits for any number of threads.
pub(crate) struct Substitution<const D: usize> {
    /// Where each row of each front is: its index among the columns of the task,
    /// or, past those, among the rows outside that the task touches; for fronts
    /// above the tasks, among their columns.
    places: Vec<u32>,
    /// Where each column of the top fronts is among them.
    top_index: Vec<u32>,
    /// The columns of the top fronts.
    top_columns: Vec<u32>,
    /// Their entries of x.
    top_x: Vec<f64>,
    /// Of the rows outside, task by task: first what the task adds to them, then
    /// what they are. They are those of its last front.
    outside: Vec<f64>,
    /// Per thread: the entries of x that a front touches.
    gathered: Vec<Vec<f64>>,
}

/// Below this number of entries a second thread is not worth waking: where others had
/// the second core, it made solutions with 7.6e5 to 1.7e6 entries longer by a tenth to a
/// fifth, and those with 2.2e6 and more took as long as on one.
const WORTH_A_THREAD: usize = 2_000_000;
/// The same within a pool whose threads are awake.
const WORTH_SHARING: usize = 60_000;

impl<const D: usize> Substitution<D> {
    /// `None` without enough memory.
    pub(crate) fn new(fronts: &Fronts, layout: &Layout, threads: usize) -> Option<Self> {
        let mut top_index = vec![0; fronts.first[fronts.len()] as usize];
        let mut top_columns = Vec::new();
        for &front in &layout.top {
            for column in fronts.first[front]..fronts.first[front + 1] {
                top_index[column as usize] = top_columns.len() as u32;
                top_columns.push(column);
            }
        }
        let mut places = vec![0; fronts.n_rows()];
        for task in &layout.tasks {
            let columns = fronts.first[task.start]..fronts.first[task.end];
            let outside = fronts.rows(task.end - 1);
            for front in task.clone() {
                let rows = fronts.rows(front).iter();
                for (place, row) in places[fronts.row_range(front)].iter_mut().zip(rows) {
                    *place = if columns.contains(row) {
                        row - columns.start
                    } else {
                        let among = outside.binary_search(row).expect("a row of the last front");
                        columns.len() as u32 + among as u32
                    };
                }
            }
        }
        for &front in &layout.top {
            let rows = fronts.rows(front).iter();
            for (place, &row) in places[fronts.row_range(front)].iter_mut().zip(rows) {
                *place = top_index[row as usize];
            }
        }
        let mut gathered = Vec::new();
        for _ in 0..threads.max(1) {
            gathered.push(zeros(layout.highest)?);
        }
        Some(Self {
            places,
            top_x: zeros(D * top_columns.len())?,
            outside: zeros(D * n_outside(fronts, layout))?,
            gathered,
            top_index,
            top_columns,
        })
    }

    /// In bytes.
    pub(crate) fn memory(fronts: &Fronts, layout: &Layout, threads: usize) -> usize {
        let n_top: usize = layout
            .top
            .iter()
            .map(|&front| fronts.n_columns(front))
            .sum();
        let indices = fronts.n_rows() + n_top + fronts.first[fronts.len()] as usize;
        let blocks = n_top + n_outside(fronts, layout);
        4 * indices + size_of::<f64>() * (D * blocks + threads.max(1) * layout.highest)
    }
}

/// Rows outside that tasks touch: those of the last front of each.
fn n_outside(fronts: &Fronts, layout: &Layout) -> usize {
    let rows = |task: &Range<usize>| fronts.rows(task.end - 1).len();
    layout.tasks.iter().map(rows).sum()
}

/// What a task, or the top, sees of x.
struct View<'a, const D: usize> {
    fronts: &'a Fronts,
    factor: &'a [f64],
    panel_starts: &'a [usize],
    places: &'a [u32],
    top_index: &'a [u32],
    /// Its first column; `None` for the fronts above all tasks.
    first: Option<u32>,
    /// Its own entries of x.
    own: &'a mut [f64],
    /// Entries of the rows outside.
    outside: &'a mut [f64],
    gathered: &'a mut [f64],
}

impl<const D: usize> View<'_, D> {
    /// Where the first column of a front is.
    #[inline(always)]
    fn place(&self, front: usize) -> usize {
        let column = self.fronts.first[front];
        match self.first {
            Some(first) => (column - first) as usize,
            None => self.top_index[column as usize] as usize,
        }
    }

    #[inline(always)]
    fn block(&mut self, place: u32) -> &mut [f64; D] {
        let (own, _) = self.own.as_chunks_mut::<D>();
        let (outside, _) = self.outside.as_chunks_mut::<D>();
        let (place, n_own) = (place as usize, own.len());
        if place < n_own {
            &mut own[place]
        } else {
            &mut outside[place - n_own]
        }
    }

    /// Number of scalars that were gathered: columns of the front, then rows.
    #[inline(always)]
    fn gather(&mut self, front: usize) -> usize {
        let (start, columns) = (D * self.place(front), D * self.fronts.n_columns(front));
        self.gathered[..columns].copy_from_slice(&self.own[start..start + columns]);
        let mut n = columns;
        let places = self.places;
        for &place in &places[self.fronts.row_range(front)] {
            let block = *self.block(place);
            self.gathered[n..n + D].copy_from_slice(&block);
            n += D;
        }
        n
    }

    #[inline(always)]
    fn scatter(&mut self, front: usize, with_rows: bool) {
        let (start, columns) = (D * self.place(front), D * self.fronts.n_columns(front));
        self.own[start..start + columns].copy_from_slice(&self.gathered[..columns]);
        if with_rows {
            let mut n = columns;
            let places = self.places;
            for &place in &places[self.fronts.row_range(front)] {
                let block = std::array::from_fn(|axis| self.gathered[n + axis]);
                *self.block(place) = block;
                n += D;
            }
        }
    }

    #[inline(always)]
    fn forward(&mut self, front: usize) {
        let height = self.gather(front);
        let y = &mut self.gathered[..height];
        let panel = &self.factor[self.panel_starts[front]..self.panel_starts[front + 1]];
        solve::<D>(panel, y);
        self.scatter(front, true);
    }

    #[inline(always)]
    fn backward(&mut self, front: usize) {
        let height = self.gather(front);
        let y = &mut self.gathered[..height];
        let panel = &self.factor[self.panel_starts[front]..self.panel_starts[front + 1]];
        solve_transposed::<D>(panel, y);
        self.scatter(front, false);
    }

    /// One direction through a list of fronts.
    fn run(&mut self, direction: Direction, fronts: impl DoubleEndedIterator<Item = usize>) {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            // Loops, and not `for_each`, which would not be compiled for these vectors.
            || match direction {
                Direction::Forward => {
                    for front in fronts {
                        self.forward(front);
                    }
                }
                Direction::Backward => {
                    for front in fronts.rev() {
                        self.backward(front);
                    }
                }
            },
        );
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Forward,
    Backward,
}

impl<const D: usize> Substitution<D> {
    /// Replaces b by the solution, both in order of elimination.
    pub(crate) fn solve_in_place(
        &mut self,
        fronts: &Fronts,
        layout: &Layout,
        factor: &[f64],
        x: &mut [f64],
    ) {
        let is_large = factor.len() > WORTH_A_THREAD;
        let threads = if is_large || threads_here() > 1 && factor.len() > WORTH_SHARING {
            self.gathered.len()
        } else {
            1
        };
        with_threads(threads, || {
            self.solve_on(threads, fronts, layout, factor, x)
        });
    }

    fn solve_on(
        &mut self,
        threads: usize,
        fronts: &Fronts,
        layout: &Layout,
        factor: &[f64],
        x: &mut [f64],
    ) {
        self.outside.fill(0.0);
        self.run_tasks((Direction::Forward, threads), fronts, layout, factor, x);
        let (top_x, _) = self.top_x.as_chunks_mut::<D>();
        let (blocks, _) = x.as_chunks_mut::<D>();
        for (target, &column) in top_x.iter_mut().zip(&self.top_columns) {
            *target = blocks[column as usize];
        }
        let rows_outside = |task: &Range<usize>| fronts.rows(task.end - 1);
        let (outside, _) = self.outside.as_chunks_mut::<D>();
        let rows = layout.tasks.iter().flat_map(rows_outside);
        for (&row, more) in rows.zip(&*outside) {
            let target = &mut top_x[self.top_index[row as usize] as usize];
            for (target, more) in target.iter_mut().zip(more) {
                *target += *more;
            }
        }
        let mut top = View::<D> {
            fronts,
            factor,
            panel_starts: &layout.panel_starts,
            places: &self.places,
            top_index: &self.top_index,
            first: None,
            own: top_x.as_flattened_mut(),
            outside: &mut [],
            gathered: &mut self.gathered[0],
        };
        top.run(Direction::Forward, layout.top.iter().copied());
        top.run(Direction::Backward, layout.top.iter().copied());
        for (source, &column) in top_x.iter().zip(&self.top_columns) {
            blocks[column as usize] = *source;
        }
        let rows = layout.tasks.iter().flat_map(rows_outside);
        for (&row, target) in rows.zip(outside) {
            *target = top_x[self.top_index[row as usize] as usize];
        }
        self.run_tasks((Direction::Backward, threads), fronts, layout, factor, x);
    }

    fn run_tasks(
        &mut self,
        (direction, threads): (Direction, usize),
        fronts: &Fronts,
        layout: &Layout,
        factor: &[f64],
        x: &mut [f64],
    ) {
        let mut rest = x;
        let mut at = 0;
        let mut rest_outside = &mut self.outside[..];
        let tasks = layout.tasks.iter().map(|task| {
            let n_outside = D * fronts.rows(task.end - 1).len();
            let (outside, tail) = std::mem::take(&mut rest_outside).split_at_mut(n_outside);
            rest_outside = tail;
            let columns = fronts.first[task.start]..fronts.first[task.end];
            let (begin, end) = (D * columns.start as usize, D * columns.end as usize);
            let (_, tail) = std::mem::take(&mut rest).split_at_mut(begin - at);
            let (own, tail) = tail.split_at_mut(end - begin);
            (rest, at) = (tail, end);
            Task {
                fronts: task.clone(),
                first: columns.start,
                own,
                outside,
            }
        });
        let panel_starts = &layout.panel_starts;
        let (places, top_index) = (&self.places, &self.top_index);
        let run = |task: Task<'_>, gathered: &mut [f64]| {
            let mut view = View::<D> {
                fronts,
                factor,
                panel_starts,
                places,
                top_index,
                first: Some(task.first),
                own: task.own,
                outside: task.outside,
                gathered,
            };
            view.run(direction, task.fronts);
        };
        if threads == 1 {
            tasks.for_each(|task| run(task, &mut self.gathered[0]));
            return;
        }
        let size = |task: &Task<'_>| {
            (panel_starts[task.fronts.end] - panel_starts[task.fronts.start]) as f64
        };
        let tasks = largest_first(tasks, size);
        in_parallel_with(tasks, &mut self.gathered, |task, gathered| {
            run(task, gathered);
        });
    }
}

/// One subtree with its part of x.
struct Task<'a> {
    fronts: Range<usize>,
    first: u32,
    own: &'a mut [f64],
    outside: &'a mut [f64],
}
