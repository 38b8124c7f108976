//! Aggregates of blocks.

use crate::ordering::Lists;

/// A partition of the blocks of a matrix into aggregates, and the pattern of the matrix
/// between these.
pub(crate) struct Aggregates {
    /// Aggregate of each block.
    pub(crate) of_block: Vec<u32>,
    /// Blocks of each aggregate, ascending.
    pub(crate) members: Lists,
    /// How many there are.
    pub(crate) n: usize,
    /// Pairs of blocks in each aggregate.
    pub(crate) inside: Lists,
    /// Pairs of blocks of each coarse pair.
    pub(crate) between: Lists,
    /// The coarse pairs, the smaller aggregate first, in ascending order.
    pub(crate) pairs: Vec<[u32; 2]>,
}

/// Not in an aggregate yet.
const NONE: u32 = u32::MAX;

/// How far aggregates reach from their first blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reach {
    /// To their neighbours.
    Neighbours,
    /// To the neighbours of these.
    SecondNeighbours,
}

impl Aggregates {
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]], reach: Reach) -> Self {
        let neighbours = Lists::of_neighbours(n_blocks, pairs);
        let (of_block, n) = aggregate(n_blocks, &neighbours, reach);
        let mut between = Vec::new();
        let mut inside = Vec::new();
        for (pair, ends) in (0..).zip(pairs) {
            let [a, b] = ends.map(|block| of_block[block as usize]);
            if a == b {
                inside.push((a, pair));
            } else {
                between.push(([a.min(b), a.max(b)], pair));
            }
        }
        between.sort_unstable();
        let mut distinct: Vec<[u32; 2]> = Vec::new();
        let mut coarse: Vec<(u32, u32)> = Vec::with_capacity(between.len());
        for (ends, pair) in between {
            if distinct.last() != Some(&ends) {
                distinct.push(ends);
            }
            coarse.push((distinct.len() as u32 - 1, pair));
        }
        let blocks = of_block.iter().copied().zip(0..);
        Self {
            members: Lists::new(n, blocks),
            inside: Lists::new(n, inside.iter().copied()),
            between: Lists::new(distinct.len(), coarse.iter().copied()),
            of_block,
            n,
            pairs: distinct,
        }
    }

    /// In bytes.
    pub(crate) fn memory(&self) -> u64 {
        let lists = [&self.members, &self.inside, &self.between].map(Lists::memory);
        let own = 4 * self.of_block.len() + 8 * self.pairs.len();
        (own + lists.iter().sum::<usize>()) as u64
    }
}

/// Aggregate of each block, and how many there are: neighbourhoods that do not
/// overlap, then what is left joins one of them.
fn aggregate(n_blocks: usize, neighbours: &Lists, reach: Reach) -> (Vec<u32>, usize) {
    let mut aggregates = vec![NONE; n_blocks];
    let mut n_aggregates = 0;
    let is_near_free = |aggregates: &[u32], block: u32| {
        let is_free = |&block: &u32| aggregates[block as usize] == NONE;
        is_free(&block) && neighbours.of(block as usize).iter().all(is_free)
    };
    for block in 0..n_blocks as u32 {
        let near = neighbours.of(block as usize);
        let is_free = is_near_free(&aggregates, block)
            && (reach == Reach::Neighbours
                || near.iter().all(|&block| is_near_free(&aggregates, block)));
        if !is_free {
            continue;
        }
        aggregates[block as usize] = n_aggregates;
        for &block in near {
            aggregates[block as usize] = n_aggregates;
            if reach == Reach::SecondNeighbours {
                for &block in neighbours.of(block as usize) {
                    aggregates[block as usize] = n_aggregates;
                }
            }
        }
        n_aggregates += 1;
    }
    // Every block that is left has a neighbour in one of these, or one that soon is.
    while aggregates.contains(&NONE) {
        let last = aggregates.clone();
        for (block, aggregate) in aggregates.iter_mut().enumerate() {
            if *aggregate == NONE {
                let mut of_neighbours = neighbours.of(block).iter().map(|&b| last[b as usize]);
                *aggregate = of_neighbours.find(|&a| a != NONE).unwrap_or(NONE);
            }
        }
    }
    (aggregates, n_aggregates as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_in_one_aggregate() {
        let pairs = [
            [0, 1],
            [1, 2],
            [2, 3],
            [3, 4],
            [4, 5],
            [5, 6],
            [6, 7],
            [9, 10],
        ];
        let neighbours = Lists::of_neighbours(11, &pairs);
        let near = aggregate(11, &neighbours, Reach::Neighbours);
        assert_eq!(near, (vec![0, 0, 1, 1, 1, 2, 2, 2, 3, 4, 4], 5));
        let far = aggregate(11, &neighbours, Reach::SecondNeighbours);
        assert_eq!(far, (vec![0, 0, 0, 1, 1, 1, 1, 1, 2, 3, 3], 4));
    }
}
