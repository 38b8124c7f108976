//! Graphs without cycles.

use super::elimination::NONE;
use super::lists::Lists;

/// A graph without cycles, each of its trees with a root in its middle: no branch
/// there has more than half of the blocks.
pub(crate) struct Forest {
    /// All blocks, tree by tree, each by the distance from its root.
    pub(crate) order: Vec<u32>,
    /// Of each block, or none.
    pub(crate) parents: Vec<u32>,
    /// The pair that joins each block to its parent.
    pub(crate) pairs: Vec<u32>,
}

impl Forest {
    /// `None` if there are cycles, or pairs that stand twice or are not two blocks.
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]]) -> Option<Self> {
        let is_block = |&block: &u32| (block as usize) < n_blocks;
        if pairs.len() >= n_blocks.max(1) || !pairs.as_flattened().iter().all(is_block) {
            return None;
        }
        let both = |(pair, &[a, b]): (u32, &[u32; 2])| [(a, pair), (b, pair)];
        let mut search = Search {
            pairs,
            pairs_of: Lists::new(n_blocks, (0..).zip(pairs).flat_map(both)),
            last: vec![0; n_blocks],
            forest: Self {
                order: Vec::with_capacity(n_blocks),
                parents: vec![NONE; n_blocks],
                pairs: vec![NONE; n_blocks],
            },
        };
        let mut sizes = vec![1; n_blocks];
        for block in 0..n_blocks {
            if search.last[block] == 0 {
                let start = search.forest.order.len();
                search.tree(block as u32, 1)?;
                let middle = search.forest.middle(start, &mut sizes);
                search.forest.order.truncate(start);
                search.tree(middle, 2)?;
            }
        }
        Some(search.forest)
    }

    /// Blocks in the subtree of each block.
    pub(crate) fn sizes(&self) -> Vec<u32> {
        let mut sizes = vec![1; self.parents.len()];
        for &block in self.order.iter().rev() {
            if let Some(parent) = self.parent(block) {
                sizes[parent] += sizes[block as usize];
            }
        }
        sizes
    }

    pub(crate) fn parent(&self, block: u32) -> Option<usize> {
        let parent = self.parents[block as usize];
        (parent != NONE).then_some(parent as usize)
    }

    /// Of the tree that stands last in the order, from `start` on. `sizes` are 1 there.
    fn middle(&self, start: usize, sizes: &mut [u32]) -> u32 {
        let tree = &self.order[start..];
        for &block in tree.iter().rev() {
            // Branches below have less than half, so no more than half is above.
            if 2 * sizes[block as usize] as usize >= tree.len() {
                return block;
            }
            if let Some(parent) = self.parent(block) {
                sizes[parent] += sizes[block as usize];
            }
        }
        tree[0]
    }
}

struct Search<'a> {
    pairs: &'a [[u32; 2]],
    pairs_of: Lists,
    /// The last search that found each block.
    last: Vec<u8>,
    forest: Forest,
}

impl Search<'_> {
    /// Appends the tree of a root, breadth first, unless it is none.
    fn tree(&mut self, root: u32, number: u8) -> Option<()> {
        let Forest {
            order,
            parents,
            pairs,
        } = &mut self.forest;
        let mut next = order.len();
        order.push(root);
        self.last[root as usize] = number;
        (parents[root as usize], pairs[root as usize]) = (NONE, NONE);
        while let Some(&block) = order.get(next) {
            next += 1;
            for &pair in self.pairs_of.of(block as usize) {
                if pair == pairs[block as usize] {
                    continue;
                }
                let [a, b] = self.pairs[pair as usize];
                let other = if a == block { b } else { a };
                if self.last[other as usize] == number {
                    return None;
                }
                self.last[other as usize] = number;
                (parents[other as usize], pairs[other as usize]) = (block, pair);
                order.push(other);
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_in_the_middle() {
        // Two chains, 0-1-2-3-4 and 9-8-7, a star around 6, and 10 alone.
        let pairs = [
            [0, 1],
            [2, 1],
            [3, 2],
            [3, 4],
            [8, 9],
            [8, 7],
            [6, 5],
            [6, 11],
            [12, 6],
        ];
        let forest = Forest::new(13, &pairs).unwrap();
        let roots = (0..13).filter(|&block| forest.parent(block).is_none());
        assert!(roots.eq([2, 6, 8, 10]));
        assert_eq!(
            [1, 3, 0, 4].map(|block| forest.parents[block]),
            [2, 2, 1, 3]
        );
        assert_eq!([1, 3, 0, 4].map(|block| forest.pairs[block]), [1, 2, 0, 3]);
        assert_eq!(
            [2, 1, 6, 10].map(|block| forest.sizes()[block]),
            [5, 2, 4, 1]
        );
    }

    #[test]
    fn other_graphs_are_none() {
        for pairs in [
            vec![[0, 1], [1, 2], [2, 0]],
            vec![[0, 1], [1, 0]],
            vec![[0, 1], [0, 1]],
            vec![[2, 2]],
            vec![[0, 4]],
        ] {
            assert!(Forest::new(4, &pairs).is_none(), "{pairs:?}");
        }
        assert!(Forest::new(0, &[]).is_some());
    }
}
