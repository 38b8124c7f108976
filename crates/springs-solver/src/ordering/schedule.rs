//! What of a forest is eliminated side by side.

use super::elimination::NONE;
use super::forest::Forest;
use super::lists::Lists;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Blocks that are eliminated at once.
pub(crate) const AT_ONCE: usize = 2;
/// Parts have so many blocks at least.
const PART: usize = 4096;
/// So many parts at most.
const MOST_PARTS: usize = 16;
/// Branches of a part at least, so that there is always something to be eliminated at
/// once.
const BRANCHES: usize = 4;

/// Turns of a forest, in parts that do not depend on each other but for the last one,
/// which has the blocks above all others. It follows from the forest alone.
pub(crate) struct Schedule {
    pub(crate) parts: Vec<Part>,
    pub(crate) joints: Vec<Joint>,
}

/// Blocks by turns: children before parents.
#[derive(Default)]
pub(crate) struct Part {
    pub(crate) turns: Vec<[Turn; AT_ONCE]>,
    /// Places for what children add to their parents.
    pub(crate) n_sums: usize,
}

/// A block that is eliminated. What its children add to it is at the place `sum`, and
/// what it adds to its parent goes to the place `parent`; places are taken over by
/// others once their block has been eliminated. A turn with one block only has it twice,
/// the second time without its parent.
#[derive(Clone, Copy)]
pub(crate) struct Turn {
    pub(crate) block: u32,
    pub(crate) sum: u32,
    pub(crate) parent: u32,
}

/// The sum of those without children, which stays zero.
const NO_CHILDREN: u32 = 0;
/// The place for those without parents, whose blocks add zero.
pub(crate) const NO_PARENT: u32 = 1;

/// What a part adds to a block of the last one.
pub(crate) struct Joint {
    pub(crate) part: usize,
    /// Places in the two.
    pub(crate) from: u32,
    pub(crate) to: u32,
}

impl Schedule {
    pub(crate) fn new(forest: &Forest) -> Self {
        let (n_parts, part_of) = parts(forest);
        let n_blocks = part_of.len();
        let in_order = forest.order.iter();
        let members = Lists::new(
            n_parts + 1,
            in_order.map(|&block| (part_of[block as usize], block)),
        );
        let mut planner = Planner::new(forest, &part_of);
        let mut schedule = Self {
            parts: Vec::new(),
            joints: Vec::new(),
        };
        // Places in the last part of blocks that other parts add to.
        let mut places = vec![NONE; n_blocks];
        let mut n_places = FIRST_PLACE;
        for part in 0..n_parts {
            schedule.parts.push(planner.part(members.of(part)));
            for (block, from) in planner.above.drain(..) {
                planner.places[block as usize] = NONE;
                let place = &mut places[block as usize];
                if *place == NONE {
                    *place = n_places;
                    n_places += 1;
                }
                schedule.joints.push(Joint {
                    part,
                    from,
                    to: *place,
                });
            }
        }
        planner.places = places;
        planner.free = Free::from(n_places);
        schedule.parts.push(planner.part(members.of(n_parts)));
        schedule
    }
}

/// Number of parts but the last, and the part of every block.
fn parts(forest: &Forest) -> (usize, Vec<u32>) {
    let n_blocks = forest.order.len();
    let one = || (0, vec![0; n_blocks]);
    let most = MOST_PARTS.min(n_blocks / PART);
    if most < 2 {
        return one();
    }
    let sizes = forest.sizes();
    let with_parents = |&block: &u32| Some((forest.parent(block)? as u32, block));
    let children = Lists::new(n_blocks, forest.order.iter().filter_map(with_parents));
    let size = |block: u32| (sizes[block as usize], Reverse(block));
    let roots = forest
        .order
        .iter()
        .filter(|&&block| forest.parent(block).is_none());
    let mut branches: BinaryHeap<_> = roots.map(|&root| size(root)).collect();
    let largest = n_blocks / (most * BRANCHES);
    let mut n_above = 0;
    while let Some(&(size_of_branch, Reverse(block))) = branches.peek() {
        if size_of_branch as usize <= largest {
            break;
        }
        branches.pop();
        n_above += 1;
        if n_above > largest {
            return one();
        }
        branches.extend(children.of(block as usize).iter().map(|&child| size(child)));
    }
    let n_parts = most.min(branches.len() / BRANCHES);
    if n_parts < 2 {
        return one();
    }
    let mut part_of = vec![NONE; n_blocks];
    for (_, Reverse(root)) in branches {
        part_of[root as usize] = 0;
    }
    let share = (n_blocks - n_above).div_ceil(n_parts);
    let mut dealt = 0;
    for &block in &forest.order {
        let above = forest
            .parent(block)
            .map_or(n_parts as u32, |parent| part_of[parent]);
        let part = &mut part_of[block as usize];
        if above != n_parts as u32 {
            *part = above;
        } else if *part == 0 {
            *part = (dealt / share) as u32;
            dealt += sizes[block as usize] as usize;
        } else {
            *part = n_parts as u32;
        }
    }
    (n_parts, part_of)
}

/// The first place that is not one of those above.
const FIRST_PLACE: u32 = 2;

struct Planner<'a> {
    forest: &'a Forest,
    part_of: &'a [u32],
    depths: Vec<u32>,
    /// Children that are not eliminated yet.
    waiting_for: Vec<u32>,
    /// Of the blocks that something was added to.
    places: Vec<u32>,
    free: Free,
    /// Blocks of the last part that this one adds to, with their places.
    above: Vec<(u32, u32)>,
}

impl<'a> Planner<'a> {
    fn new(forest: &'a Forest, part_of: &'a [u32]) -> Self {
        let n_blocks = part_of.len();
        let (mut depths, mut waiting_for) = (vec![0; n_blocks], vec![0; n_blocks]);
        for &block in &forest.order {
            if let Some(parent) = forest.parent(block) {
                depths[block as usize] = depths[parent] + 1;
                waiting_for[parent] += 1;
            }
        }
        Self {
            forest,
            part_of,
            depths,
            waiting_for,
            places: vec![NONE; n_blocks],
            free: Free::from(FIRST_PLACE),
            above: Vec::new(),
        }
    }

    /// Takes in turn those farthest from the root of which all children are eliminated,
    /// which takes the fewest turns (Hu, Operations Research 9, 1961).
    fn part(&mut self, blocks: &[u32]) -> Part {
        let key = |depths: &[u32], block: u32| (depths[block as usize], Reverse(block));
        let is_ready = |block: &&u32| self.waiting_for[**block as usize] == 0;
        let ready = blocks.iter().filter(is_ready);
        let mut ready: BinaryHeap<_> = ready.map(|&block| key(&self.depths, block)).collect();
        let mut turns = Vec::with_capacity(blocks.len() / AT_ONCE + 1);
        while let Some((_, Reverse(first))) = ready.pop() {
            let second = ready.pop().map(|(_, Reverse(block))| block);
            let turn = self.turn(first, second);
            for turn in &turn {
                if turn.parent == NO_PARENT {
                    continue;
                }
                let Some(parent) = self.forest.parent(turn.block) else {
                    continue;
                };
                self.waiting_for[parent] -= 1;
                let is_here = self.part_of[parent] == self.part_of[turn.block as usize];
                if self.waiting_for[parent] == 0 && is_here {
                    ready.push(key(&self.depths, parent as u32));
                }
            }
            turns.push(turn);
        }
        let n_sums = self.free.n_places as usize;
        self.free = Free::from(FIRST_PLACE);
        Part { turns, n_sums }
    }

    fn turn(&mut self, first: u32, second: Option<u32>) -> [Turn; AT_ONCE] {
        let turn = |block: u32| Turn {
            block,
            sum: match self.places[block as usize] {
                NONE => NO_CHILDREN,
                place => place,
            },
            parent: NO_PARENT,
        };
        let mut turns = [turn(first); AT_ONCE];
        if let Some(second) = second {
            turns[1] = turn(second);
            // Places side by side in their order.
            if turns[0].sum == turns[1].sum ^ 1 {
                turns.sort_unstable_by_key(|turn| turn.sum);
            }
        }
        let n_blocks = if second.is_some() { 2 } else { 1 };
        for turn in &turns[..n_blocks] {
            if turn.sum != NO_CHILDREN {
                self.free.give(turn.sum);
            }
        }
        let parents = turns.map(|turn| self.forest.parent(turn.block));
        let is_new = |parent: usize| self.places[parent] == NONE;
        if let [Some(a), Some(b)] = parents
            && n_blocks == 2
            && a != b
            && is_new(a)
            && is_new(b)
        {
            let [of_a, of_b] = self.free.take_two();
            self.put(a, of_a, turns[0].block);
            self.put(b, of_b, turns[1].block);
        }
        for (turn, parent) in turns[..n_blocks].iter_mut().zip(parents) {
            let Some(parent) = parent else {
                continue;
            };
            if self.places[parent] == NONE {
                let place = self.free.take();
                self.put(parent, place, turn.block);
            }
            turn.parent = self.places[parent];
        }
        turns
    }

    /// Gives the parent of a block a place.
    fn put(&mut self, parent: usize, place: u32, block: u32) {
        self.places[parent] = place;
        if self.part_of[parent] != self.part_of[block as usize] {
            self.above.push((parent as u32, place));
        }
    }
}

/// Places that are free, and in pairs (2k, 2k + 1) where possible.
struct Free {
    n_places: u32,
    pairs: Vec<u32>,
    /// May name places that are not single any more.
    singles: Vec<u32>,
    is_single: Vec<bool>,
}

impl Free {
    /// There are places up to this one already.
    fn from(n_places: u32) -> Self {
        Self {
            n_places: n_places.next_multiple_of(2),
            pairs: Vec::new(),
            singles: Vec::new(),
            is_single: vec![false; n_places.next_multiple_of(2) as usize],
        }
    }

    fn give(&mut self, place: u32) {
        let other = &mut self.is_single[(place ^ 1) as usize];
        if *other {
            *other = false;
            self.pairs.push(place & !1);
        } else {
            self.is_single[place as usize] = true;
            self.singles.push(place);
        }
    }

    fn take_single(&mut self) -> Option<u32> {
        loop {
            let place = self.singles.pop()?;
            if std::mem::take(&mut self.is_single[place as usize]) {
                return Some(place);
            }
        }
    }

    fn take_pair(&mut self) -> u32 {
        self.pairs.pop().unwrap_or_else(|| {
            self.n_places += 2;
            self.is_single.extend([false; 2]);
            self.n_places - 2
        })
    }

    fn take(&mut self) -> u32 {
        self.take_single().unwrap_or_else(|| {
            let place = self.take_pair();
            self.give(place + 1);
            place
        })
    }

    /// A pair, or two singles before there is more of them.
    fn take_two(&mut self) -> [u32; 2] {
        if self.pairs.is_empty()
            && let Some(a) = self.take_single()
        {
            return [a, self.take()];
        }
        let place = self.take_pair();
        [place, place + 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(n: usize, pairs: &[[u32; 2]]) -> (Forest, Schedule) {
        let forest = Forest::new(n, pairs).unwrap();
        let schedule = Schedule::new(&forest);
        (forest, schedule)
    }

    fn tree(n: u32, parent: impl Fn(u32) -> u32) -> Vec<[u32; 2]> {
        (1..n).map(|block| [parent(block), block]).collect()
    }

    /// Sizes of subtrees, as they come about if every block adds its own to its parent.
    fn sizes(n: usize, schedule: &Schedule) -> Vec<u32> {
        let mut sizes = vec![0; n];
        let mut sums: Vec<Vec<u32>> = Vec::new();
        for (index, part) in schedule.parts.iter().enumerate() {
            let mut places = vec![0; part.n_sums];
            if index + 1 == schedule.parts.len() {
                for joint in &schedule.joints {
                    places[joint.to as usize] += sums[joint.part][joint.from as usize];
                }
            }
            for turn in &part.turns {
                let taken = turn.map(|turn| places[turn.sum as usize]);
                for turn in turn {
                    places[turn.sum as usize] = 0;
                }
                let is_twice = turn[0].block == turn[1].block;
                for (turn, sum) in turn.iter().zip(taken).take(if is_twice { 1 } else { 2 }) {
                    assert_eq!(sizes[turn.block as usize], 0, "one turn a block");
                    sizes[turn.block as usize] = sum + 1;
                    if turn.parent != NO_PARENT {
                        places[turn.parent as usize] += sum + 1;
                    }
                }
            }
            sums.push(places);
        }
        sizes
    }

    #[test]
    fn what_children_add_arrives_at_their_parents() {
        for n in [1, 2, 3, 10, 1000, 30_000] {
            let scatter = |block: u32| block.wrapping_mul(2_654_435_769) >> 8;
            for (pairs, is_cut) in [
                (tree(n, |block| block - 1), false),
                (tree(n, |block| (block - 1) / 2), true),
                (tree(n, |block| (block - 1) & !1), false),
                (tree(n, |_| 0), true),
                (tree(n, |block| scatter(block) % block), true),
                (
                    tree(n, |block| block - 1 - scatter(block) % block.min(3)),
                    false,
                ),
                (tree(n, |block| block.saturating_sub(40)), true),
                (vec![], true),
            ] {
                let (forest, schedule) = schedule(n as usize, &pairs);
                assert_eq!(sizes(n as usize, &schedule), forest.sizes());
                let n_parts = schedule.parts.len();
                assert!(n_parts <= MOST_PARTS + 1);
                if n > 20_000 && is_cut {
                    assert!(n_parts > 2, "{n_parts}");
                    let turns = schedule.parts.iter().map(|part| part.turns.len());
                    let longest = turns.max().unwrap();
                    assert!(longest < n as usize / n_parts, "{longest} in {n_parts}");
                }
            }
        }
    }

    /// From both ends, with places side by side throughout.
    #[test]
    fn a_chain_takes_half_as_many_turns() {
        let (_, schedule) = schedule(2001, &tree(2001, |block| block - 1));
        let [part] = &schedule.parts[..] else {
            panic!("one part")
        };
        assert_eq!(part.turns.len(), 1001);
        assert!(part.n_sums <= 6);
        let (last, all) = part.turns.split_last().unwrap();
        assert_eq!(last[0].block, 1000);
        for turn in &all[..999] {
            let [a, b] = turn.map(|turn| turn.parent);
            assert_eq!((a % 2, b), (0, a + 1));
        }
    }
}
