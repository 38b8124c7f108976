//! Connections between two nodes, sorted by what their ends are.

use crate::Numbering;
use crate::matrix::{PairBlock, add, times};
use crate::run::{self, Run};
use crate::segments::{Lengths, Segments};
use crate::sums::Sums;
use nalgebra::Vector3;
use std::ops::Range;

/// The connections of one batch, sorted by kind: *interior* ones join two free nodes,
/// the first before the second; *anchored* ones join a free node (the first end) to a
/// fixed one; the rest join two fixed nodes and only have energy.
///
/// Interior ones that form [runs](Run) come first, in their order.
#[derive(Clone, Debug)]
pub(crate) struct Connections {
    ends: Vec<[u32; 2]>,
    /// Pair of the matrix of each interior connection.
    pairs: Vec<u32>,
    runs: Vec<Run>,
    segments: Segments,
    interior: usize,
    anchored: usize,
    first_fixed: usize,
}

/// Where the ends of a connection are.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Interior,
    Anchored,
    Fixed,
}

impl Connections {
    /// Between nodes of the scene, in any order; blocks are unknown until
    /// [`Self::number`].
    pub(crate) fn between(nodes: impl Iterator<Item = [usize; 2]>) -> Self {
        let ends: Vec<[u32; 2]> = nodes.map(|nodes| nodes.map(|node| node as u32)).collect();
        Self {
            interior: 0,
            anchored: 0,
            first_fixed: 0,
            pairs: Vec::new(),
            runs: Vec::new(),
            segments: Segments::default(),
            ends,
        }
    }

    /// Turns nodes into blocks and sorts; gives the place that each connection had
    /// before.
    pub(crate) fn number(&mut self, numbering: &Numbering) -> Vec<usize> {
        for ends in &mut self.ends {
            *ends = ends.map(|node| numbering.block(node as usize) as u32);
            // Free blocks come before fixed ones.
            ends.sort_unstable();
        }
        let kind = |ends: &[u32; 2]| match ends.map(|block| numbering.is_fixed(block)) {
            [false, false] => Kind::Interior,
            [true, true] => Kind::Fixed,
            _ => Kind::Anchored,
        };
        let mut order: Vec<usize> = (0..self.ends.len()).collect();
        order.sort_by_key(|&index| {
            let ends = &self.ends[index];
            (kind(ends), run::key(ends))
        });
        let upto = |last: Kind| order.partition_point(|&index| kind(&self.ends[index]) <= last);
        (self.interior, self.anchored) = (upto(Kind::Interior), upto(Kind::Anchored));
        let interior = &mut order[..self.interior];
        let interior_ends = interior.iter().map(|&index| &self.ends[index]);
        let lengths = Lengths::of(numbering.n_free(), self.anchored, interior_ends);
        let end_of = |block| lengths.end_of_reach(block);
        self.runs = run::bring_to_front(interior, &self.ends, end_of);
        self.ends = order.iter().map(|&index| self.ends[index]).collect();
        let kinds = (self.interior, self.anchored);
        self.segments = Segments::new(lengths, &self.ends, &self.runs, kinds);
        self.first_fixed = numbering.n_free();
        order
    }

    /// Runs among the interior connections.
    pub(crate) fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Those with a free end, in parts that may be worked off at once.
    pub(crate) fn segments(&self) -> &Segments {
        &self.segments
    }

    pub(crate) fn place(&mut self, pairs: &[u32]) {
        assert_eq!(pairs.len(), self.interior, "one pair per interior one");
        self.pairs = pairs.to_vec();
        self.segments.place(pairs);
    }

    /// The pair of the matrix of each interior one.
    pub(crate) fn pairs(&self) -> &[u32] {
        &self.pairs
    }

    pub(crate) fn each_stencil(&self, visit: &mut dyn FnMut(&[u32])) {
        self.ends[self.live()].iter().for_each(|ends| visit(ends));
    }

    /// The blocks at its ends that are free.
    #[inline(always)]
    pub(crate) fn free_ends(&self, connection: usize) -> &[u32] {
        let ends = &self.ends[connection];
        if connection < self.interior {
            ends
        } else if connection < self.anchored {
            &ends[..1]
        } else {
            &[]
        }
    }

    pub(crate) fn ends(&self) -> &[[u32; 2]] {
        &self.ends
    }

    /// One end is free, the other is fixed.
    pub(crate) fn anchored(&self) -> Range<usize> {
        self.interior..self.anchored
    }

    /// Both ends are fixed.
    pub(crate) fn between_fixed(&self) -> Range<usize> {
        self.anchored..self.ends.len()
    }

    /// At least one end is free.
    pub(crate) fn live(&self) -> Range<usize> {
        0..self.anchored
    }

    /// Adds one value per connection to the free blocks at its ends.
    pub(crate) fn add_to_ends(&self, values: impl Iterator<Item = f64>, sums: &mut [f64]) {
        for (index, value) in values.enumerate() {
            for &block in self.free_ends(index) {
                sums[block as usize] += value;
            }
        }
    }

    /// Adds what the fixed end of each anchored connection gives against the force on its
    /// free end, or against the impulse, at the velocities `v` of all blocks; `works` are
    /// those of the fixed blocks.
    pub(crate) fn add_anchor_works(
        &self,
        force: impl Fn(usize) -> Vector3<f64>,
        v: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        for index in self.anchored() {
            let anchor = self.ends[index][1] as usize;
            works[anchor - self.first_fixed] += force(index).dot(&v[anchor]);
        }
    }

    /// How far its ends go from one state to another.
    pub(crate) fn ways(
        &self,
        connection: usize,
        start: &[Vector3<f64>],
        end: &[Vector3<f64>],
    ) -> [Vector3<f64>; 2] {
        self.ends[connection].map(|block| end[block as usize] - start[block as usize])
    }

    /// Adds a number for each end of one between fixed blocks to `sums`, which are those of
    /// the fixed blocks.
    pub(crate) fn add_to_fixed(&self, connection: usize, numbers: [f64; 2], sums: &mut [f64]) {
        for (&block, number) in self.ends[connection].iter().zip(numbers) {
            sums[block as usize - self.first_fixed] += number;
        }
    }

    /// x₁ − x₀, or the same of velocities.
    #[inline(always)]
    pub(crate) fn difference(&self, connection: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        let [a, b] = self.ends[connection];
        x[b as usize] - x[a as usize]
    }

    /// Adds the force on end 0, and its negative on end 1 if that is free; the forces are
    /// those of the blocks from `first` on.
    #[inline(always)]
    pub(crate) fn add_force(
        &self,
        connection: usize,
        force: Vector3<f64>,
        (first, forces): (usize, &mut [Vector3<f64>]),
    ) {
        let [a, b] = self.ends[connection];
        forces[a as usize - first] += force;
        if connection < self.interior {
            forces[b as usize - first] -= force;
        }
    }

    /// Adds [[B, −B], [−B, B]] on the free ends; of an anchored connection also what the
    /// velocity of its anchor brings to the right-hand side: −(−B)·v.
    #[inline(always)]
    pub(crate) fn add_block<P: PairBlock>(
        &self,
        connection: usize,
        block: &[f64; 6],
        v: &[Vector3<f64>],
        sums: &mut Sums<'_, P>,
    ) {
        let [a, b] = self.ends[connection].map(|block| block as usize);
        let first = sums.first_block;
        add(&mut sums.diagonal[a - first], block);
        if connection < self.interior {
            add(&mut sums.diagonal[b - first], block);
            let pair = self.pairs[connection] as usize - sums.first_pair;
            sums.pairs[pair].subtract_symmetric(block);
        } else {
            sums.anchor_load[a - first] += times(block, &v[b]);
        }
    }

    /// Adds weight·[[B, −B], [−B, B]] y on the free ends; fixed ends do not move. The
    /// products are those of the blocks from `first` on.
    #[inline(always)]
    pub(crate) fn add_product(
        &self,
        connection: usize,
        block: &[f64; 6],
        weight: f64,
        y: &[Vector3<f64>],
        (first, products): (usize, &mut [Vector3<f64>]),
    ) {
        let [a, b] = self.ends[connection].map(|block| block as usize);
        let is_interior = connection < self.interior;
        let difference = if is_interior { y[a] - y[b] } else { y[a] };
        let product = times(block, &difference) * weight;
        products[a - first] += product;
        if is_interior {
            products[b - first] -= product;
        }
    }
}
