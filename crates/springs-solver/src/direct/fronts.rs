//! Symbolic factorization: which columns are eliminated together, and what
//! rows they touch.

use crate::ordering::{Elimination, Lists, NONE};

/// The fronts of a multifrontal factorization (Duff and Reid, ACM TOMS 9, 1983;
/// supernodes after Liu, Ng and Peyton, SIAM J. Matrix Anal. 14, 1993), children
/// before parents, subtrees contiguous. All in blocks.
#[derive(Clone, Debug)]
pub(crate) struct Fronts {
    /// First column of each front, and the number of columns at the end.
    pub(crate) first: Vec<u32>,
    parents: Vec<u32>,
    /// Rows below the columns of each front, ascending.
    row_starts: Vec<usize>,
    rows: Vec<u32>,
    /// Where in the parent's front (its columns, then its rows) each row is.
    relative: Vec<u32>,
    children: Lists,
    /// Block of the caller at each column.
    blocks: Vec<u32>,
    entry_starts: Vec<usize>,
    entries: Vec<Entry>,
}

/// A block of the strictly upper triangle of the caller's matrix within a front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) pair: u32,
    /// Row and column in the front, where it may be above or below the diagonal.
    pub(crate) row: u32,
    pub(crate) column: u32,
}

/// A child is merged into its parent if that leaves no larger part of zeros,
/// depending on the columns that they then have.
const RELAXED: [(usize, f64); 4] = [(2, 1.0), (6, 0.6), (16, 0.15), (usize::MAX, 0.05)];

/// A front while fronts are being merged.
struct Group {
    first: usize,
    end: usize,
    /// Rows below.
    below: usize,
    /// Blocks of the factor that are not zero.
    true_blocks: usize,
}

impl Group {
    fn columns(&self) -> usize {
        self.end - self.first
    }

    fn blocks(&self) -> usize {
        let columns = self.columns();
        columns * (columns + 1) / 2 + columns * self.below
    }
}

impl Fronts {
    pub(crate) fn new(elimination: &Elimination) -> Self {
        let groups = merged_groups(elimination);
        let n = elimination.order.len();
        let mut first: Vec<u32> = groups.iter().map(|group| group.first as u32).collect();
        first.push(n as u32);
        let mut front_of = vec![0u32; n];
        for (front, group) in groups.iter().enumerate() {
            front_of[group.first..group.end].fill(front as u32);
        }
        let last_parent = |group: &Group| match elimination.parents[group.end - 1] {
            NONE => NONE,
            column => front_of[column as usize],
        };
        let parents: Vec<u32> = groups.iter().map(last_parent).collect();
        let with_parents = (0..).zip(&parents).filter(|(_, parent)| **parent != NONE);
        let children = Lists::new(
            parents.len(),
            with_parents.map(|(front, &parent)| (parent, front)),
        );
        let mut fronts = Self {
            first,
            parents,
            row_starts: vec![0],
            rows: Vec::new(),
            relative: Vec::new(),
            children,
            blocks: elimination
                .order
                .iter()
                .map(|&block| block as u32)
                .collect(),
            entry_starts: vec![0],
            entries: Vec::new(),
        };
        fronts.fill_rows(elimination, &front_of);
        fronts.fill_entries(elimination, &front_of);
        fronts
    }

    pub(crate) fn len(&self) -> usize {
        self.parents.len()
    }

    /// Number of its columns.
    pub(crate) fn n_columns(&self, front: usize) -> usize {
        (self.first[front + 1] - self.first[front]) as usize
    }

    pub(crate) fn rows(&self, front: usize) -> &[u32] {
        &self.rows[self.row_range(front)]
    }

    /// Where they are among those of all fronts.
    pub(crate) fn row_range(&self, front: usize) -> std::ops::Range<usize> {
        self.row_starts[front]..self.row_starts[front + 1]
    }

    /// In bytes.
    pub(crate) fn memory(&self) -> u64 {
        let of_fronts = 4 * (self.first.len() + self.parents.len())
            + self.children.memory()
            + size_of::<usize>() * (self.row_starts.len() + self.entry_starts.len());
        let of_rows = 4 * (self.rows.len() + self.relative.len() + self.blocks.len());
        (of_fronts + of_rows + size_of::<Entry>() * self.entries.len()) as u64
    }

    /// How many there are of all fronts.
    pub(crate) fn n_rows(&self) -> usize {
        self.rows.len()
    }

    pub(crate) fn relative(&self, front: usize) -> &[u32] {
        &self.relative[self.row_starts[front]..self.row_starts[front + 1]]
    }

    pub(crate) fn children(&self, front: usize) -> &[u32] {
        self.children.of(front)
    }

    /// Blocks of the caller at its columns.
    pub(crate) fn blocks(&self, front: usize) -> &[u32] {
        &self.blocks[self.first[front] as usize..self.first[front + 1] as usize]
    }

    /// What the matrix has in a front below its diagonal.
    pub(crate) fn entries(&self, front: usize) -> &[Entry] {
        &self.entries[self.entry_starts[front]..self.entry_starts[front + 1]]
    }

    pub(crate) fn parent(&self, front: usize) -> Option<usize> {
        (self.parents[front] != NONE).then_some(self.parents[front] as usize)
    }

    /// Multiplications and additions of the front, with blocks of one entry.
    pub(crate) fn flops(&self, front: usize) -> f64 {
        let (columns, below) = (self.n_columns(front) as f64, self.rows(front).len() as f64);
        columns * (columns * columns / 3.0 + columns * below + below * below)
    }

    /// The same of all fronts.
    pub(crate) fn total_flops(&self) -> f64 {
        (0..self.len()).map(|front| self.flops(front)).sum()
    }

    /// Structure of each front: that of its columns and of its children.
    fn fill_rows(&mut self, elimination: &Elimination, front_of: &[u32]) {
        let graph = &elimination.graph;
        // Rows below the diagonal, by front: the transpose of the upper graph.
        let mut below: Vec<Vec<u32>> = vec![Vec::new(); self.len()];
        for column in 0..graph.n_blocks() {
            for &row in &graph.rows[graph.column(column)] {
                below[front_of[row] as usize].push(column as u32);
            }
        }
        let mut seen = vec![NONE; graph.n_blocks()];
        for (front, below) in below.into_iter().enumerate() {
            let end = self.first[front + 1];
            let mut rows = Vec::new();
            let mut add = |row: u32| {
                if row >= end && seen[row as usize] != front as u32 {
                    seen[row as usize] = front as u32;
                    rows.push(row);
                }
            };
            for row in below {
                add(row);
            }
            for &child in self.children(front) {
                for &row in self.rows(child as usize) {
                    add(row);
                }
            }
            rows.sort_unstable();
            self.rows.extend(rows);
            self.row_starts.push(self.rows.len());
        }
        self.relative = vec![0; self.rows.len()];
        for front in 0..self.len() {
            if let Some(parent) = self.parent(front) {
                for index in self.row_starts[front]..self.row_starts[front + 1] {
                    self.relative[index] = self.position(parent, self.rows[index]);
                }
            }
        }
    }

    /// Where a row of the matrix is in a front that has it.
    fn position(&self, front: usize, row: u32) -> u32 {
        let columns = self.n_columns(front) as u32;
        match row.checked_sub(self.first[front]) {
            Some(column) if column < columns => column,
            _ => {
                let below = self.rows(front).binary_search(&row);
                columns + below.expect("a row of the front") as u32
            }
        }
    }

    fn fill_entries(&mut self, elimination: &Elimination, front_of: &[u32]) {
        let (graph, order) = (&elimination.graph, &elimination.order);
        let mut entries: Vec<Vec<Entry>> = vec![Vec::new(); self.len()];
        for later in 0..graph.n_blocks() {
            for index in graph.column(later) {
                let earlier = graph.rows[index];
                let front = front_of[earlier] as usize;
                let below = self.position(front, later as u32);
                let column = earlier as u32 - self.first[front];
                let (row, column) = if order[later] < order[earlier] {
                    (below, column)
                } else {
                    (column, below)
                };
                entries[front].push(Entry {
                    pair: graph.pairs[index] as u32,
                    row,
                    column,
                });
            }
        }
        for list in entries {
            self.entries.extend(list);
            self.entry_starts.push(self.entries.len());
        }
    }
}

/// Columns with the same structure, merged further with small children where
/// that costs few zeros.
fn merged_groups(elimination: &Elimination) -> Vec<Group> {
    let (parents, counts) = (&elimination.parents, &elimination.counts);
    let n = parents.len();
    let mut groups: Vec<Group> = Vec::new();
    let mut column = 0;
    while column < n {
        let first = column;
        while column + 1 < n
            && parents[column] == column as u32 + 1
            && counts[column + 1] + 1 == counts[column]
        {
            column += 1;
        }
        column += 1;
        let mut group = Group {
            first,
            end: column,
            below: counts[column - 1] - 1,
            true_blocks: 0,
        };
        group.true_blocks = group.blocks();
        // The front before may be its last child.
        while let Some(child) = groups.last() {
            let parent = parents[child.end - 1] as usize;
            if !(group.first..group.end).contains(&parent) {
                break;
            }
            let merged = Group {
                first: child.first,
                true_blocks: child.true_blocks + group.true_blocks,
                ..group
            };
            let zeros = (merged.blocks() - merged.true_blocks) as f64;
            let columns = merged.columns();
            let allowed = RELAXED.iter().find(|(most, _)| columns <= *most);
            if zeros > allowed.map_or(0.0, |allowed| allowed.1) * merged.blocks() as f64 {
                break;
            }
            groups.pop();
            group = merged;
        }
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dense_graph_is_one_front() {
        let pairs: Vec<[u32; 2]> = (0..5).flat_map(|b| (0..b).map(move |a| [a, b])).collect();
        let elimination = Elimination::new(&[0, 1, 2, 3, 4], &pairs).unwrap();
        let fronts = Fronts::new(&elimination);
        assert_eq!(fronts.len(), 1);
        assert_eq!(fronts.n_columns(0), 5);
        assert!(fronts.rows(0).is_empty());
        assert_eq!(fronts.blocks(0).len(), 5);
        assert_eq!(fronts.entries(0).len(), 10);
    }
}
