//! Numbering by breadth, which brings neighbours near each other.

use super::Lists;

/// The blocks in the order of Cuthill and McKee (Proc. 24th Nat. Conf. ACM, 1969): from a
/// block at the edge of each connected part on, neighbours of what is numbered first, those
/// with few neighbours before others.
pub(crate) fn by_breadth(n_blocks: usize, pairs: &[[u32; 2]]) -> Vec<u32> {
    let neighbours = Lists::of_neighbours(n_blocks, pairs);
    let mut order = Vec::with_capacity(n_blocks);
    let mut is_numbered = vec![false; n_blocks];
    // Of the last search that passed a block.
    let mut seen = vec![0; n_blocks];
    let mut searches = 0;
    for block in 0..n_blocks as u32 {
        if is_numbered[block as usize] {
            continue;
        }
        // The last block of a search is at the edge; that of a search from there is opposite.
        let mut edge = block;
        for _ in 0..2 {
            searches += 1;
            let mut reached = vec![edge];
            spread(&neighbours, &mut reached, 0, |block| {
                std::mem::replace(&mut seen[block], searches) != searches
            });
            edge = reached[reached.len() - 1];
        }
        let begin = order.len();
        order.push(edge);
        spread(&neighbours, &mut order, begin, |block| {
            !std::mem::replace(&mut is_numbered[block], true)
        });
    }
    order
}

/// Goes on from the blocks of a list to their neighbours, which are added to it, as long as
/// there are new ones.
fn spread(
    neighbours: &Lists,
    list: &mut Vec<u32>,
    begin: usize,
    mut is_new: impl FnMut(usize) -> bool,
) {
    let mut at = begin;
    is_new(list[at] as usize);
    while at < list.len() {
        let from = list.len();
        let near = neighbours.of(list[at] as usize);
        list.extend(near.iter().filter(|&&block| is_new(block as usize)));
        list[from..].sort_by_key(|&block| (neighbours.of(block as usize).len(), block));
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reach(order: &[u32], pairs: &[[u32; 2]]) -> usize {
        let mut place = vec![0; order.len()];
        for (at, &block) in order.iter().enumerate() {
            place[block as usize] = at;
        }
        let far = |pair: &[u32; 2]| {
            let [a, b] = pair.map(|block| place[block as usize]);
            a.abs_diff(b)
        };
        pairs.iter().map(far).max().unwrap_or(0)
    }

    #[test]
    fn shuffled_chains_and_nets_come_to_their_width() {
        // Multiplication by a number without common factor shuffles.
        let shuffled = |n: u32, block: u32| block * 37 % n;
        let chain: Vec<[u32; 2]> = (1..100)
            .map(|k| [k - 1, k].map(|k| shuffled(100, k)))
            .collect();
        let order = by_breadth(100, &chain);
        assert_eq!(reach(&order, &chain), 1);
        let mut net = Vec::new();
        for (i, j) in (0..11).flat_map(|i| (0..20).map(move |j| (i, j))) {
            let node = |i: u32, j: u32| shuffled(220, 20 * i + j);
            if i > 0 {
                net.push([node(i - 1, j), node(i, j)]);
            }
            if j > 0 {
                net.push([node(i, j - 1), node(i, j)]);
            }
        }
        let order = by_breadth(220, &net);
        assert!(reach(&order, &net) <= 12);
        let mut all = order;
        all.sort_unstable();
        assert_eq!(all, Vec::from_iter(0..220));
    }

    #[test]
    fn every_part_is_numbered() {
        let order = by_breadth(6, &[[0, 3], [5, 3], [1, 4], [1, 4]]);
        assert_eq!(order.len(), 6);
        assert_eq!(reach(&order, &[[0, 3], [5, 3], [1, 4]]), 1);
    }
}
