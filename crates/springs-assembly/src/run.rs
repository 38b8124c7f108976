//! Runs of connections whose ends both go on block by block.

use std::ops::Range;

/// Connections that join the blocks `first` + i and `first` + `offset` + i, with i
/// ascending up to `n_slots`; a few i may have none.
///
/// The rows of a cloth, the lines of a block and chains are such runs. Along them
/// vectors are read in order, several connections at once and without an index.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// Those that are there, in ascending order of i.
    pub(crate) connections: Range<usize>,
    pub(crate) first: usize,
    pub(crate) offset: usize,
    /// A multiple of [`LANES`]; the blocks of all of them are free ones.
    pub(crate) n_slots: usize,
    /// Slots of the runs before it.
    pub(crate) first_slot: usize,
}

/// Slots that are worked off at once.
pub(crate) const LANES: usize = 8;

/// Runs end at multiples of so many first blocks, so that those of one stretch of
/// blocks follow one another while the vectors are in the cache.
pub(crate) const STRETCH: u32 = 1024;

/// Most slots without a connection between two with one.
const WIDEST_GAP: u32 = 4;

/// The order in which runs show.
pub(crate) fn key(&[first, second]: &[u32; 2]) -> (u32, u32, u32) {
    (first / STRETCH, second - first, first)
}

/// Brings those interior connections that form runs to the front of an order that is
/// sorted by [`key`]. Slots of a run that begins at a block end before `end_of` it.
pub(crate) fn bring_to_front(
    order: &mut [usize],
    ends: &[[u32; 2]],
    end_of: impl Fn(usize) -> usize,
) -> Vec<Run> {
    let goes_on = |&before: &usize, &next: &usize| {
        let (before, next) = (key(&ends[before]), key(&ends[next]));
        let gap = next.2.checked_sub(before.2 + 1);
        (before.0, before.1) == (next.0, next.1) && gap.is_some_and(|gap| gap <= WIDEST_GAP)
    };
    let mut runs: Vec<Run> = Vec::new();
    let (mut inside, mut outside) = (Vec::with_capacity(order.len()), Vec::new());
    for together in order.chunk_by(goes_on) {
        let begin = inside.len();
        let first_slot = runs.last().map_or(0, |run| run.first_slot + run.n_slots);
        let n_inside = match run_of(together, (begin, first_slot), ends, &end_of) {
            Some(run) => {
                let n_inside = run.connections.len();
                runs.push(run);
                n_inside
            }
            None => 0,
        };
        inside.extend_from_slice(&together[..n_inside]);
        outside.extend_from_slice(&together[n_inside..]);
    }
    inside.append(&mut outside);
    order.copy_from_slice(&inside);
    runs
}

/// A run of as many of these as find room, if most of its slots are taken.
fn run_of(
    together: &[usize],
    (begin, first_slot): (usize, usize),
    ends: &[[u32; 2]],
    end_of: &impl Fn(usize) -> usize,
) -> Option<Run> {
    let first_of = |connection: usize| ends[connection][0] as usize;
    let [first, second] = ends[together[0]].map(|block| block as usize);
    let n_wanted = first_of(together[together.len() - 1]) + 1 - first;
    let n_rounded = n_wanted.next_multiple_of(LANES);
    let n_slots = if second + n_rounded <= end_of(first) {
        n_rounded
    } else {
        n_wanted / LANES * LANES
    };
    let n_inside = together.partition_point(|&connection| first_of(connection) < first + n_slots);
    (n_inside >= LANES && 3 * n_inside >= 2 * n_slots).then(|| Run {
        connections: begin..begin + n_inside,
        first,
        offset: second - first,
        n_slots,
        first_slot,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs_of(mut ends: Vec<[u32; 2]>, n_free: usize) -> (Vec<[u32; 2]>, Vec<Run>) {
        ends.sort_by_key(key);
        let mut order: Vec<usize> = (0..ends.len()).collect();
        let runs = bring_to_front(&mut order, &ends, |_| n_free);
        (order.iter().map(|&index| ends[index]).collect(), runs)
    }

    #[test]
    fn every_connection_of_a_run_is_in_its_slot_and_none_is_lost() {
        // A cloth of 20 by 9, links along both directions, and some links between.
        let mut ends = Vec::new();
        for node in 0..180_u32 {
            if node % 20 != 19 {
                ends.push([node, node + 1]);
            }
            if node < 160 {
                ends.push([node, node + 20]);
            }
        }
        ends.extend([[3, 90], [5, 90], [3, 90]]);
        let (sorted, runs) = runs_of(ends.clone(), 180);
        let mut all = sorted.clone();
        all.sort_unstable();
        ends.sort_unstable();
        assert_eq!(all, ends);
        let offsets: Vec<usize> = runs.iter().map(|run| run.offset).collect();
        assert_eq!(offsets, [1, 20]);
        let mut next = 0;
        for run in &runs {
            assert_eq!(run.connections.start, next);
            next = run.connections.end;
            assert_eq!(run.n_slots % LANES, 0);
            assert!(run.first + run.offset + run.n_slots <= 180);
            for ends in &sorted[run.connections.clone()] {
                let slot = ends[0] as usize - run.first;
                assert!(slot < run.n_slots);
                assert_eq!((ends[1] - ends[0]) as usize, run.offset);
            }
        }
        // Nine rows of 19, without what does not fill the last lanes.
        assert!(runs[0].connections.len() > 160);
        assert_eq!(runs[1].connections.len(), 160);
    }

    #[test]
    fn few_or_scattered_connections_are_no_run() {
        let few = (0..7).map(|node| [node, node + 1]).collect();
        assert!(runs_of(few, 100).1.is_empty());
        let scattered = (0..50).map(|node| [3 * node, 3 * node + 1]).collect();
        assert!(runs_of(scattered, 1000).1.is_empty());
        let twice = (0..50).flat_map(|node| [[node, node + 1]; 2]).collect();
        assert!(runs_of(twice, 1000).1.is_empty());
    }
}
