//! Connections in segments that several threads can work off at once.

use crate::run::{Run, STRETCH};
use crate::sums::Parts;
use nalgebra::Vector3;
use springs_threads::{share_out, threads_here};
use std::ops::Range;

/// The connections whose first block lies in one stretch of blocks. Their second blocks
/// lie there or in the next segment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Segment {
    first_block: usize,
    /// Of the matrix; once the connections have theirs.
    first_pair: usize,
    /// In the list of runs.
    pub(crate) runs: Range<usize>,
    /// Connections in runs, other interior ones, anchored ones.
    connections: [Range<usize>; 3],
}

impl Segment {
    /// Its connections with a free end, without those in runs if these are worked off
    /// apart.
    pub(crate) fn live(&self, without_runs: bool) -> [Range<usize>; 3] {
        let [in_runs, outside, anchored] = self.connections.clone();
        let in_runs = if without_runs { 0..0 } else { in_runs };
        [in_runs, outside, anchored]
    }
}

/// Most segments, and fewest.
const MOST: usize = 64;
const FEWEST: usize = 4;
/// So many connections a segment at least, on average: fewer are not worth a thread.
const CONNECTIONS: usize = 2000;

/// How long segments are, in blocks: a number that follows from the connections alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lengths {
    n_free: usize,
    segment: usize,
}

impl Lengths {
    /// For `n_live` connections with a free end, of which the interior ones have these ends.
    /// Where some reach too far there is one segment.
    pub(crate) fn of<'a>(
        n_free: usize,
        n_live: usize,
        interior: impl Iterator<Item = &'a [u32; 2]>,
    ) -> Self {
        let reach = interior.map(|ends| ends[1] - ends[0]).max().unwrap_or(0) as usize;
        let stretch = STRETCH as usize;
        let n_stretches = n_free.div_ceil(stretch);
        let n_segments = MOST.min(n_live / CONNECTIONS).max(1);
        let stretches = reach
            .div_ceil(stretch)
            .max(n_stretches.div_ceil(n_segments))
            .max(1);
        let is_one = n_stretches.div_ceil(stretches) < FEWEST;
        let segment = if is_one {
            n_free.max(1)
        } else {
            stretches * stretch
        };
        Self { n_free, segment }
    }

    /// The end of the blocks that connections from the segment of a block on may touch.
    pub(crate) fn end_of_reach(&self, first: usize) -> usize {
        let next = first / self.segment + 1;
        ((next + 1) * self.segment).min(self.n_free)
    }
}

/// All connections with a free end, segment by segment.
///
/// All even segments touch different blocks, and so do all odd ones; so the ones are worked
/// off at once, and then the others. One thread works them off in an order in which every
/// block gets the same contributions one after the other, and which stays near in memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Segments(Vec<Segment>);

/// Segments that may be worked off one after the other, or at once.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Phase {
    /// All, one after the other.
    All,
    Even,
    Odd,
}

impl Segments {
    /// Of connections with these first ends, which are sorted by stretches of blocks: first
    /// those in runs, then up to `interior`, then up to `anchored`.
    pub(crate) fn new(
        lengths: Lengths,
        ends: &[[u32; 2]],
        runs: &[Run],
        (interior, anchored): (usize, usize),
    ) -> Self {
        let Lengths { n_free, segment } = lengths;
        let in_runs = runs.last().map_or(0, |run| run.connections.end);
        let within = |from: usize, to: usize, blocks: &Range<usize>| {
            let place = |block: usize| {
                from + ends[from..to].partition_point(|ends| (ends[0] as usize) < block)
            };
            place(blocks.start)..place(blocks.end)
        };
        let begins = (0..n_free.max(1)).step_by(segment);
        let segments = begins.map(|begin| {
            let blocks = begin..begin + segment;
            let run_at = |block: usize| runs.partition_point(|run| run.first < block);
            Segment {
                first_block: begin,
                first_pair: 0,
                runs: run_at(blocks.start)..run_at(blocks.end),
                connections: [
                    within(0, in_runs, &blocks),
                    within(in_runs, interior, &blocks),
                    within(interior, anchored, &blocks),
                ],
            }
        });
        Self(segments.collect())
    }

    /// Takes the pair of the matrix of each interior connection. Pairs are in the order of
    /// their first blocks.
    pub(crate) fn place(&mut self, pairs: &[u32]) {
        let mut next = pairs.iter().max().map_or(0, |&last| last as usize + 1);
        for segment in self.0.iter_mut().rev() {
            let [in_runs, outside, _] = segment.connections.clone();
            let own = in_runs.chain(outside).map(|index| pairs[index] as usize);
            next = own.fold(next, usize::min);
            segment.first_pair = next;
        }
    }

    /// Does `work` on every segment; it is given sums of the blocks from one on, which are
    /// all that the segment touches.
    pub(crate) fn add_up(
        &self,
        sums: &mut [Vector3<f64>],
        work: impl Fn(&Segment, usize, &mut [Vector3<f64>]) + Send + Sync,
    ) {
        if let [segment] = &self.0[..] {
            return work(segment, 0, sums);
        }
        for &phase in self.phases() {
            self.work_off(phase, (0, &mut *sums), |segment, (first, sums)| {
                work(segment, *first, sums);
            });
        }
    }

    /// What is to be [worked off](Self::work_off) in turn.
    pub(crate) fn phases(&self) -> &'static [Phase] {
        if self.0.len() <= 1 || threads_here() <= 1 {
            &[Phase::All]
        } else {
            &[Phase::Even, Phase::Odd]
        }
    }

    /// Does `work` on the segments of a phase; it is given parts of sums that have all that
    /// the segment touches.
    pub(crate) fn work_off<S: Parts>(
        &self,
        phase: Phase,
        mut sums: S,
        work: impl Fn(&Segment, &mut S) + Send + Sync,
    ) {
        let parity = match phase {
            Phase::All => {
                // 0, 2, 1, 4, 3, …: each after the even ones beside it.
                for even in (0..=self.0.len()).step_by(2) {
                    let odd = even.checked_sub(1);
                    let both = [Some(even), odd].into_iter().flatten();
                    for segment in both.filter_map(|index| self.0.get(index)) {
                        work(segment, &mut sums);
                    }
                }
                return;
            }
            Phase::Even => 0,
            Phase::Odd => 1,
        };
        let (mut rest, mut tasks) = (sums, Vec::with_capacity(self.0.len() / 2 + 1));
        // From the last one on: each has what is left behind its first block.
        for segment in self.0[parity..].iter().step_by(2).rev() {
            let own;
            (rest, own) = rest.split_at(segment.first_block, segment.first_pair);
            tasks.push((segment, own));
        }
        share_out(tasks, |(segment, mut own)| work(segment, &mut own));
    }

    /// The sum of a number for each segment, in their order.
    pub(crate) fn sum(&self, of: impl Fn(&Segment) -> f64 + Send + Sync) -> f64 {
        if let [segment] = &self.0[..] {
            return of(segment);
        }
        share_out(self.0.iter(), of).into_iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Compilation, Emitter, Evaluation, Numbering, SpringBetween, Springs, System, Weights,
        compile_with,
    };
    use springs_math::spring::Spring;
    use springs_scene::generate::{Material, block, chain, cloth, disturb};
    use springs_scene::{Scene, SpringLaw};
    use springs_threads::with_threads;

    fn system(scene: &Scene) -> System {
        compile_with(scene, Compilation::complete()).unwrap()
    }

    /// Nodes in any order: nothing is near to anything.
    fn shuffled(scene: &Scene) -> Scene {
        let mut shuffled = scene.clone();
        let n = scene.nodes.len();
        let place = |node: usize| node * 7919 % n;
        for (node, of) in scene.nodes.iter().enumerate() {
            shuffled.nodes[place(node)] = *of;
        }
        for spring in &mut shuffled.springs {
            spring.nodes = spring.nodes.map(place);
        }
        shuffled
    }

    /// Forces, damping forces, products and linearizations, and energy.
    fn all_of(system: &System) -> (Vec<Vector3<f64>>, Vec<f64>, [f64; 2]) {
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let at = Evaluation::new(x, v, Weights::of_step(0.1));
        let mut all = Vec::new();
        let mut vectors = vec![Vector3::zeros(); system.n_free()];
        system.static_forces(x, &mut vectors);
        all.extend_from_slice(&vectors);
        system.accelerations(0.0, x, v, &mut vectors);
        all.extend_from_slice(&vectors);
        system.product(&at, v, &mut vectors);
        all.extend_from_slice(&vectors);
        let mut linearization = system.linearization();
        system.linearize(&at, &mut linearization);
        all.extend_from_slice(&linearization.forces);
        all.extend_from_slice(&linearization.anchor_load);
        let triplets = linearization.matrix.triplets();
        let entries = triplets.map(|(_, _, entry)| entry).collect();
        let energy = system.energy(x, v);
        (all, entries, [energy.kinetic, energy.potential.sum()])
    }

    #[test]
    fn bits_do_not_depend_on_threads() {
        let mut scenes = vec![
            chain(12_345, Material::of_chain(12_345)),
            cloth(67, Material::of_cloth()),
            block(17, Material::of_block()),
        ];
        scenes.push(shuffled(&scenes[1]));
        for (k, scene) in scenes.iter_mut().enumerate() {
            disturb(scene, 1e-2, 7);
            for (node, of) in scene.nodes.iter_mut().enumerate() {
                of.fixed |= node % 1013 == 5;
                of.velocity = Vector3::new((node as f64).sin(), 0.5, (node as f64).cos());
            }
            scene.laws = vec![SpringLaw::TensionOnly { blend: 1e-3 }];
            for (index, spring) in scene.springs.iter_mut().enumerate() {
                spring.damping = if index % 3 == 0 { 0.2 } else { 0.0 };
                spring.law = (k == 1 && index % 4 == 0).then_some(0);
            }
        }
        for scene in &scenes {
            let system = system(scene);
            let alone = all_of(&system);
            for threads in [2, 3, 8] {
                let together = with_threads(threads, || all_of(&system));
                assert!(alone == together, "{} {threads}", scene.name);
            }
        }
    }

    /// In a net whose springs reach at most 60 blocks, and with one that reaches far.
    #[test]
    fn segments_have_all_connections_and_touch_only_the_next() {
        let law = Spring {
            stiffness: 1.0,
            rest_length: 1.0,
        };
        let n = 10_007;
        let numbering = Numbering::new((0..n).map(|node| node % 101 == 3));
        let offsets = [1, 2, 60];
        let net = offsets.map(|offset| (0..n - offset).map(move |node| [node, node + offset]));
        let mut springs: Vec<_> = net.into_iter().flatten().collect();
        for far in [false, true] {
            if far {
                springs.push([0, n - 1]);
            }
            let between = |&nodes: &[usize; 2]| SpringBetween { nodes, law };
            let between: Vec<_> = springs.iter().map(between).collect();
            let mut emitter = Springs::new("springs", &between);
            emitter.number(&numbering);
            let connections = emitter.connections();
            let (Segments(segments), ends) = (connections.segments(), connections.ends());
            assert_eq!(segments.len() == 1, far);
            let mut found = vec![0; connections.live().end];
            for (k, segment) in segments.iter().enumerate() {
                let end = segments
                    .get(k + 2)
                    .map_or(numbering.n_free(), |segment| segment.first_block);
                let touches = segment.first_block..end;
                for run in &connections.runs()[segment.runs.clone()] {
                    let last = run.first + run.offset + run.n_slots;
                    assert!(touches.start <= run.first && last <= touches.end);
                }
                for index in segment.live(false).into_iter().flatten() {
                    found[index] += 1;
                    let free = ends[index].iter().filter(|&&end| !numbering.is_fixed(end));
                    let mut free = free.map(|&end| end as usize);
                    assert!(free.all(|end| touches.contains(&end)));
                }
            }
            assert!(found.iter().all(|&times| times == 1));
            let x = (0..n).map(|k| Vector3::new((k as f64).sin(), k as f64, 0.1));
            let x: Vec<_> = x.collect();
            let forces = |emitter: &Springs| {
                let mut forces = vec![Vector3::zeros(); numbering.n_free()];
                emitter.add_forces(&x, &mut forces);
                forces
            };
            assert!(forces(&emitter) == forces(&emitter.clone().one_by_one()));
        }
    }
}
