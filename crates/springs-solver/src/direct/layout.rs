//! Where the panels and updates of fronts are, and which of them are eliminated side
//! by side.

use super::fronts::Fronts;
use std::ops::Range;

/// Subtrees are split until none is larger than this part of the whole.
const TASK: f64 = 0.2;
/// Updates of tasks, which wait for the fronts above them, are no larger than so
/// many times the entries of the factor of the task.
const LARGEST_WAITING: usize = 4;

/// Where everything is, in scalars.
pub(crate) struct Layout {
    /// Where the panel of each front begins: its columns of the factor, all
    /// rows of the front, column by column.
    pub(crate) panel_starts: Vec<usize>,
    /// Where the update of each front begins in the stack of its task.
    pub(crate) update_starts: Vec<usize>,
    /// Whether it is summed up there, child by child, and not in one go on the
    /// workspace when all children are done.
    pub(crate) in_place: Vec<bool>,
    pub(crate) hand_on: Vec<HandOn>,
    /// Independent subtrees, then all fronts above them.
    pub(crate) tasks: Vec<Range<usize>>,
    pub(crate) top: Vec<usize>,
    /// Of the updates that wait for their parents: of each task, and of the top.
    pub(crate) stack_sizes: Vec<usize>,
    pub(crate) largest_update: usize,
    /// Columns of the widest front, and rows of the highest.
    pub(crate) widest: usize,
    pub(crate) highest: usize,
    /// Multiplications and additions of a factorization.
    pub(crate) flops: f64,
}

/// What becomes of the update of a front.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum HandOn {
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
        let in_workspace = |front: &usize| !places.in_place[*front];
        let in_workspace = (0..n).filter(in_workspace).map(|front| updates[front]);
        let largest_update = in_workspace.max().unwrap_or(0);
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

/// Scalars of the update matrix of a front: square, its lower half used.
pub(crate) fn update_size(fronts: &Fronts, front: usize, dimension: usize) -> usize {
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
