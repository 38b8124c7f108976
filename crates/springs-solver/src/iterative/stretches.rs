//! The order in which sweeps go through blocks.

use std::ops::Range;

/// Consecutive stretches of blocks, of which sweeps go through all even ones and then
/// through all odd ones: no two of the same kind are coupled, so that they can be worked
/// off at once. How many there are follows from the pattern alone.
///
/// An odd one is coupled with no more than half of the even ones beside it: all that it
/// touches is in its [window](Self::windows).
#[derive(Clone, Debug)]
pub(crate) struct Stretches {
    /// Where each begins, and the end; an even and an odd one by turns, or a single one.
    bounds: Vec<usize>,
}

/// Most odd ones.
const MOST: usize = 32;
/// An even and an odd one have so many blocks together, at least.
const SHORTEST: usize = 192;

/// How many odd ones there are if it takes so many blocks for one: a power of two, which
/// is shared out evenly.
fn n_odd(n_blocks: usize, shortest: usize) -> usize {
    let most = (n_blocks / shortest).clamp(1, MOST);
    1 << most.ilog2()
}

impl Stretches {
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]]) -> Self {
        let reach = pairs.iter().map(|&[a, b]| a.abs_diff(b)).max();
        // An odd one is as long as the reach, so that those beside it are not coupled, and an
        // even one twice as long.
        let shortest = SHORTEST.max(3 * reach.unwrap_or(0) as usize);
        let n_odd = n_odd(n_blocks, shortest);
        if n_odd < 2 {
            return Self {
                bounds: vec![0, n_blocks],
            };
        }
        let begin = |turn: usize| n_blocks * turn / n_odd;
        let both = |turn| {
            [
                begin(turn),
                begin(turn) + 2 * (begin(turn + 1) - begin(turn)) / 3,
            ]
        };
        let mut bounds: Vec<usize> = (0..n_odd).flat_map(both).collect();
        bounds.push(n_blocks);
        Self { bounds }
    }

    /// The most of a kind that so many blocks can have.
    pub(crate) fn most(n_blocks: usize) -> usize {
        n_odd(n_blocks, SHORTEST)
    }

    /// How many sweeps go through at once.
    pub(crate) fn n_at_once(&self) -> usize {
        (self.bounds.len() / 2).max(1)
    }

    fn all(&self) -> impl DoubleEndedIterator<Item = Range<usize>> + ExactSizeIterator {
        self.bounds.windows(2).map(|ends| ends[0]..ends[1])
    }

    pub(crate) fn even(&self) -> impl Iterator<Item = Range<usize>> {
        self.all().step_by(2)
    }

    /// Every odd one with its window. The windows are consecutive and hold all blocks: from
    /// the middle of the even one before to that of the one behind. Where there is a single
    /// stretch, there is a window without an odd one.
    pub(crate) fn odd(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        let n_blocks = self.bounds[self.bounds.len() - 1];
        let n_windows = self.n_at_once();
        let middle = |turn: usize| {
            let even = self.bounds[2 * turn]..self.bounds[2 * turn + 1];
            even.start + even.len() / 2
        };
        (0..n_windows).map(move |turn| {
            let begin = if turn == 0 { 0 } else { middle(turn) };
            let is_last = turn + 1 == n_windows;
            let end = if is_last { n_blocks } else { middle(turn + 1) };
            let odd = match self.bounds.get(2 * turn + 2) {
                Some(&end) => self.bounds[2 * turn + 1]..end,
                None => n_blocks..n_blocks,
            };
            (odd, begin..end)
        })
    }

    /// Consecutive parts of all blocks, for what is done block by block.
    pub(crate) fn windows(&self) -> impl Iterator<Item = Range<usize>> {
        self.odd().map(|(_, window)| window)
    }

    /// Of two blocks that are coupled, the one that comes later first.
    pub(crate) fn later_first(&self, [a, b]: [u32; 2]) -> [u32; 2] {
        let key = |block: u32| {
            let begun = self
                .bounds
                .partition_point(|&begin| begin <= block as usize);
            (begun % 2 == 0, block)
        };
        if key(a) > key(b) { [a, b] } else { [b, a] }
    }
}

/// The parts of a slice that are these ranges, ascending.
pub(crate) fn parts<T>(
    slice: &mut [T],
    ranges: impl Iterator<Item = Range<usize>>,
) -> impl Iterator<Item = &mut [T]> {
    let (mut rest, mut at) = (slice, 0);
    ranges.map(move |range| {
        let (_, tail) = std::mem::take(&mut rest).split_at_mut(range.start - at);
        let (part, tail) = tail.split_at_mut(range.len());
        (rest, at) = (tail, range.end);
        part
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(n_blocks: u32, reach: u32) -> Vec<[u32; 2]> {
        let of_block = |a: u32| (1..=reach).map(move |step| [a, a + step]);
        let pairs = (0..n_blocks).flat_map(of_block);
        pairs.filter(|pair| pair[1] < n_blocks).collect()
    }

    #[test]
    fn stretches_of_one_kind_are_apart_and_windows_hold_what_odd_ones_touch() {
        for (n_blocks, reach, n_odd) in [
            (1, 1, 0),
            (383, 1, 0),
            (384, 1, 2),
            (1000, 90, 2),
            (1000, 400, 0),
            (5003, 70, 16),
            (100_000, 200, 32),
        ] {
            let pairs = line(n_blocks, reach);
            let stretches = Stretches::new(n_blocks as usize, &pairs);
            let odd: Vec<_> = stretches.odd().collect();
            let even: Vec<_> = stretches.even().collect();
            assert_eq!(odd.iter().filter(|(odd, _)| !odd.is_empty()).count(), n_odd);
            assert_eq!(even.len(), n_odd.max(1));
            let mut window_of = vec![usize::MAX; n_blocks as usize];
            for (turn, window) in stretches.windows().enumerate() {
                window_of[window].fill(turn);
            }
            let mut stretch_of = vec![usize::MAX; n_blocks as usize];
            for (turn, even) in even.into_iter().enumerate() {
                stretch_of[even].fill(2 * turn);
            }
            for (turn, (odd, _)) in odd.into_iter().enumerate() {
                stretch_of[odd].fill(2 * turn + 1);
            }
            assert!(!window_of.contains(&usize::MAX) && !stretch_of.contains(&usize::MAX));
            for pair in pairs {
                let later = stretches.later_first(pair);
                let [row, column] = later.map(|block| block as usize);
                let [of_row, of_column] = [stretch_of[row], stretch_of[column]];
                if of_row == of_column {
                    assert!(row > column);
                } else {
                    assert_eq!((of_row % 2, of_column % 2), (1, 0));
                    assert_eq!(window_of[row], window_of[column]);
                }
            }
        }
    }

    #[test]
    fn parts_are_those_of_the_slice() {
        let mut numbers = [0, 1, 2, 3, 4, 5];
        let ranges = [1..2, 2..2, 4..6];
        let parts: Vec<_> = parts(&mut numbers, ranges.into_iter()).collect();
        assert_eq!(parts, [&mut [1][..], &mut [], &mut [4, 5]]);
    }
}
