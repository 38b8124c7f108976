//! Connections between two nodes, sorted by what their ends are.

use crate::Numbering;
use crate::matrix::times;
use crate::{BlockMatrix, Linearization};
use nalgebra::Vector3;
use springs_scene::{Scene, Spring};
use std::ops::Range;

/// The connections of one batch in four runs, each in the order of the scene:
/// *interior* ones join two free nodes; *anchored* ones join a free node (the
/// first end) to a fixed one, which stands still or moves; the rest join two
/// fixed nodes and only have energy.
#[derive(Clone, Debug)]
pub(crate) struct Connections {
    ends: Vec<[u32; 2]>,
    /// Pair of the matrix of each interior connection.
    pairs: Vec<u32>,
    interior: usize,
    anchored: usize,
    anchored_moving: usize,
}

/// Where the ends of a connection are.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Interior,
    AnchoredStill,
    AnchoredMoving,
    Fixed,
}

impl Connections {
    /// Sorts the springs that `wanted` picks; also returns their scene indices
    /// in batch order. Pairs are unknown until [`Self::set_pairs`].
    pub(crate) fn new(
        scene: &Scene,
        numbering: &Numbering,
        wanted: impl Fn(&Spring) -> bool,
    ) -> (Self, Vec<usize>) {
        let kind = |spring: usize| {
            let [a, b] = scene.springs[spring].nodes.map(|node| &scene.nodes[node]);
            let moving = a.is_moving_anchor() || b.is_moving_anchor();
            match (a.fixed, b.fixed) {
                (false, false) => Kind::Interior,
                (true, true) => Kind::Fixed,
                _ if moving => Kind::AnchoredMoving,
                _ => Kind::AnchoredStill,
            }
        };
        let springs = scene.springs.iter().enumerate();
        let wanted = springs.filter_map(|(index, spring)| wanted(spring).then_some(index));
        let mut order: Vec<usize> = wanted.collect();
        order.sort_by_key(|&spring| kind(spring));
        let upto = |last: Kind| order.partition_point(|&spring| kind(spring) <= last);
        let ends = order.iter().map(|&spring| {
            let [a, b] = scene.springs[spring].nodes;
            let ends = match scene.nodes[a].fixed {
                true => [b, a],
                false => [a, b],
            };
            ends.map(|node| numbering.block(node) as u32)
        });
        let connections = Self {
            ends: ends.collect(),
            pairs: Vec::new(),
            interior: upto(Kind::Interior),
            anchored: upto(Kind::AnchoredMoving),
            anchored_moving: upto(Kind::AnchoredStill),
        };
        (connections, order)
    }

    pub(crate) fn set_pairs(&mut self, pairs: &[u32]) {
        assert_eq!(pairs.len(), self.interior, "one pair per interior one");
        self.pairs = pairs.to_vec();
    }

    pub(crate) fn len(&self) -> usize {
        self.ends.len()
    }

    pub(crate) fn ends(&self) -> &[[u32; 2]] {
        &self.ends
    }

    /// Both ends are free.
    pub(crate) fn interior(&self) -> Range<usize> {
        0..self.interior
    }

    /// One end is free, the other is fixed.
    pub(crate) fn anchored(&self) -> Range<usize> {
        self.interior..self.anchored
    }

    /// One end is free, the other is fixed and moves.
    pub(crate) fn anchored_moving(&self) -> Range<usize> {
        self.anchored_moving..self.anchored
    }

    /// At least one end is free.
    pub(crate) fn live(&self) -> Range<usize> {
        0..self.anchored
    }

    /// Adds one value per connection to the free blocks at its ends.
    pub(crate) fn add_to_ends(&self, values: &[f64], sums: &mut [f64]) {
        for (index, (ends, value)) in self.ends.iter().zip(values).enumerate() {
            let free_ends = match () {
                _ if index < self.interior => &ends[..],
                _ if index < self.anchored => &ends[..1],
                _ => &[],
            };
            for &block in free_ends {
                sums[block as usize] += value;
            }
        }
    }

    /// x₁ − x₀, or the same of velocities.
    #[inline(always)]
    pub(crate) fn difference(&self, connection: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        let [a, b] = self.ends[connection];
        x[b as usize] - x[a as usize]
    }

    /// Adds the force on end 0, and its negative on end 1 if that is free.
    #[inline(always)]
    pub(crate) fn add_force(
        &self,
        connection: usize,
        force: Vector3<f64>,
        forces: &mut [Vector3<f64>],
    ) {
        let [a, b] = self.ends[connection];
        forces[a as usize] += force;
        if connection < self.interior {
            forces[b as usize] -= force;
        }
    }

    /// Adds [[B, −B], [−B, B]] as far as it stands in rows and columns of free
    /// blocks.
    #[inline(always)]
    pub(crate) fn add_block(&self, connection: usize, block: &[f64; 6], matrix: &mut BlockMatrix) {
        let [a, b] = self.ends[connection];
        matrix.add_diagonal(a, block);
        if connection < self.interior {
            matrix.add_diagonal(b, block);
            matrix.subtract_pair(self.pairs[connection], block);
        }
    }

    /// [`Self::add_block`], and what a moving anchor brings to the right-hand
    /// side: −(−B)·v of the anchor.
    #[inline(always)]
    pub(crate) fn add_block_and_load(
        &self,
        connection: usize,
        block: &[f64; 6],
        v: &[Vector3<f64>],
        out: &mut Linearization,
    ) {
        self.add_block(connection, block, &mut out.matrix);
        if self.anchored_moving().contains(&connection) {
            let [free, anchor] = self.ends[connection].map(|block| block as usize);
            out.anchor_load[free] += times(block, &v[anchor]);
        }
    }
}
