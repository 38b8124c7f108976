//! Lists of numbers, one after the other in one vector.

/// For each of some nodes a list of others.
#[derive(Clone, Debug)]
pub(crate) struct Lists {
    starts: Vec<usize>,
    items: Vec<u32>,
}

impl Lists {
    /// Of n nodes, from what belongs to what: (node, item), in the order of the
    /// items of each node.
    pub(crate) fn new(n: usize, entries: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut starts = vec![0; n + 1];
        for (node, _) in entries.clone() {
            starts[node as usize + 1] += 1;
        }
        for node in 0..n {
            starts[node + 1] += starts[node];
        }
        let (mut next, mut items) = (starts.clone(), vec![0; starts[n]]);
        for (node, item) in entries {
            let next = &mut next[node as usize];
            items[*next] = item;
            *next += 1;
        }
        Self { starts, items }
    }

    /// The neighbours of every block in the graph of these pairs.
    pub(crate) fn of_neighbours(n_blocks: usize, pairs: &[[u32; 2]]) -> Self {
        let both = |&[a, b]: &[u32; 2]| [(a, b), (b, a)];
        Self::new(n_blocks, pairs.iter().flat_map(both))
    }

    pub(crate) fn of(&self, node: usize) -> &[u32] {
        &self.items[self.starts[node]..self.starts[node + 1]]
    }

    /// In bytes.
    pub(crate) fn memory(&self) -> usize {
        size_of::<usize>() * self.starts.len() + 4 * self.items.len()
    }
}
