//! Nested dissection by coordinates.

use super::lists::Lists;
use super::minimum_degree::minimum_degree;
use crate::SolveError;

/// Parts no larger than this are ordered by minimum degree.
const LEAF: usize = 150;

/// Orders blocks by nested dissection (George, SIAM J. Numer. Anal. 10, 1973):
/// the blocks are cut in two halves along an axis, those of one half that touch
/// the other are eliminated last, and so on in both halves. For graphs whose
/// pairs are short compared with the whole, above all in three dimensions.
pub(crate) fn nested_dissection(
    pairs: &[[u32; 2]],
    positions: &[[f64; 3]],
) -> Result<Vec<usize>, SolveError> {
    let n_blocks = positions.len();
    let mut dissection = Dissection {
        neighbours: Lists::of_neighbours(n_blocks, pairs),
        positions,
        side: vec![Side::Outside; n_blocks],
        local: vec![0; n_blocks],
        order: Vec::with_capacity(n_blocks),
    };
    dissection.dissect((0..n_blocks as u32).collect())?;
    Ok(dissection.order)
}

/// Where a block is while a part is being cut.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Outside,
    Left,
    Right,
}

struct Dissection<'a> {
    neighbours: Lists,
    positions: &'a [[f64; 3]],
    side: Vec<Side>,
    local: Vec<u32>,
    order: Vec<usize>,
}

impl Dissection<'_> {
    fn dissect(&mut self, part: Vec<u32>) -> Result<(), SolveError> {
        let cut = if part.len() > LEAF {
            self.best_cut(&part)
        } else {
            None
        };
        let Some([left, right, separator]) = cut else {
            return self.minimum_degree(&part);
        };
        drop(part);
        self.dissect(left)?;
        self.dissect(right)?;
        self.order
            .extend(separator.iter().map(|&block| block as usize));
        Ok(())
    }

    /// Left, right and separator along the axis with the smallest separator;
    /// `None` if no cut is any good.
    fn best_cut(&mut self, part: &[u32]) -> Option<[Vec<u32>; 3]> {
        let mut best: Option<[Vec<u32>; 3]> = None;
        for axis in 0..3 {
            let size = best.as_ref().map_or(part.len() / 4, |best| best[2].len());
            let cut = self.cut(part, axis);
            if cut[2].len() < size {
                best = Some(cut);
            }
        }
        best
    }

    fn cut(&mut self, part: &[u32], axis: usize) -> [Vec<u32>; 3] {
        let mut sorted = part.to_vec();
        let middle = sorted.len() / 2;
        let key = |block: &u32| self.positions[*block as usize][axis];
        let by_place = |a: &u32, b: &u32| key(a).total_cmp(&key(b)).then(a.cmp(b));
        sorted.select_nth_unstable_by(middle, by_place);
        let (left, right) = sorted.split_at(middle);
        for &block in left {
            self.side[block as usize] = Side::Left;
        }
        for &block in right {
            self.side[block as usize] = Side::Right;
        }
        let touching = |blocks: &[u32], other: Side| -> Vec<u32> {
            let touches = |block: &&u32| {
                let mut neighbours = self.neighbours.of(**block as usize).iter();
                neighbours.any(|&neighbour| self.side[neighbour as usize] == other)
            };
            blocks.iter().filter(touches).copied().collect()
        };
        let (of_left, of_right) = (touching(left, Side::Right), touching(right, Side::Left));
        let mut separator = if of_left.len() < of_right.len() {
            of_left
        } else {
            of_right
        };
        for &block in &separator {
            self.side[block as usize] = Side::Outside;
        }
        let rest = |blocks: &[u32]| -> Vec<u32> {
            let mut rest: Vec<u32> = blocks
                .iter()
                .filter(|block| self.side[**block as usize] != Side::Outside)
                .copied()
                .collect();
            rest.sort_unstable();
            rest
        };
        let (left, right) = (rest(left), rest(right));
        for &block in part {
            self.side[block as usize] = Side::Outside;
        }
        separator.sort_unstable();
        [left, right, separator]
    }

    /// Orders a part by itself.
    fn minimum_degree(&mut self, part: &[u32]) -> Result<(), SolveError> {
        for (index, &block) in part.iter().enumerate() {
            self.local[block as usize] = index as u32;
            self.side[block as usize] = Side::Left;
        }
        let mut pairs = Vec::new();
        for &block in part {
            for &neighbour in self.neighbours.of(block as usize) {
                if neighbour > block && self.side[neighbour as usize] == Side::Left {
                    pairs.push([block, neighbour].map(|block| self.local[block as usize]));
                }
            }
        }
        for &block in part {
            self.side[block as usize] = Side::Outside;
        }
        let order = minimum_degree(part.len(), &pairs)?;
        self.order
            .extend(order.iter().map(|&local| part[local] as usize));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ordering::Elimination;

    const OFFSETS: [[i32; 3]; 9] = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 1, 0],
        [1, -1, 0],
        [0, 1, 1],
        [0, 1, -1],
        [1, 0, 1],
        [1, 0, -1],
    ];

    /// A lattice of n³ blocks with edges and face diagonals.
    fn lattice(n: i32) -> (Vec<[u32; 2]>, Vec<[f64; 3]>) {
        let index = |[x, y, z]: [i32; 3]| (x + n * (y + n * z)) as u32;
        let mut pairs = Vec::new();
        let mut positions = Vec::new();
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    positions.push([f64::from(x), f64::from(y), f64::from(z)]);
                    for [dx, dy, dz] in OFFSETS {
                        let to = [x + dx, y + dy, z + dz];
                        if to.iter().all(|c| (0..n).contains(c)) {
                            pairs.push([index([x, y, z]), index(to)]);
                        }
                    }
                }
            }
        }
        (pairs, positions)
    }

    #[test]
    fn every_block_is_ordered_once() {
        let (pairs, positions) = lattice(9);
        let mut order = nested_dissection(&pairs, &positions).unwrap();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..9 * 9 * 9));
    }

    #[test]
    fn it_beats_minimum_degree_on_a_large_lattice() {
        let (pairs, positions) = lattice(14);
        let flops = |order: &[usize]| Elimination::new(order, &pairs).unwrap().size(3).flops;
        let dissected = flops(&nested_dissection(&pairs, &positions).unwrap());
        let minimum = flops(&minimum_degree(positions.len(), &pairs).unwrap());
        assert!(dissected < 0.6 * minimum, "{dissected:e} {minimum:e}");
    }

    #[test]
    fn blocks_in_one_place_are_ordered_all_the_same() {
        let pairs: Vec<[u32; 2]> = (1..500).map(|block| [block - 1, block]).collect();
        let mut order = nested_dissection(&pairs, &[[1.0; 3]; 500]).unwrap();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..500));
    }
}
