//! Connections between two nodes, sorted by what their ends are.

use crate::Numbering;
use crate::matrix::times;
use crate::{BlockMatrix, Linearization};
use nalgebra::Vector3;
use springs_scene::{Scene, Spring};
use std::ops::Range;

/// The connections of one batch in three runs, each in the order of the scene:
/// *interior* ones join two free nodes; *anchored* ones join a free node (the
/// first end) to a fixed one; the rest join two fixed nodes and only have
/// energy.
#[derive(Clone, Debug)]
pub(crate) struct Connections {
    ends: Vec<[u32; 2]>,
    /// Pair of the matrix of each interior connection.
    pairs: Vec<u32>,
    interior: usize,
    anchored: usize,
}

/// The first spring of those between the same nodes and with the same `trait_of`,
/// for each spring; only among springs that have one, and itself where duplicates
/// are not to be merged.
pub(crate) fn firsts_of_pairs<T: Ord>(
    scene: &Scene,
    trait_of: impl Fn(&Spring) -> Option<T>,
) -> Vec<usize> {
    let mut firsts: Vec<usize> = (0..scene.springs.len()).collect();
    if !scene.settings.skip {
        return firsts;
    }
    let springs = scene.springs.iter().enumerate();
    let mut by_pair: Vec<([usize; 2], T, usize)> = springs
        .filter_map(|(index, spring)| {
            let [a, b] = spring.nodes;
            Some(([a.min(b), a.max(b)], trait_of(spring)?, index))
        })
        .collect();
    by_pair.sort_unstable();
    for same in by_pair.chunk_by(|a, b| (a.0, &a.1) == (b.0, &b.1)) {
        for &(_, _, index) in same {
            firsts[index] = same[0].2;
        }
    }
    firsts
}

/// Where the ends of a connection are.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Interior,
    Anchored,
    Fixed,
}

impl Connections {
    /// Sorts the springs that `wanted` picks by index; also returns their scene indices
    /// in batch order. Pairs are unknown until [`Self::set_pairs`].
    pub(crate) fn new(
        scene: &Scene,
        numbering: &Numbering,
        wanted: impl Fn(usize) -> bool,
    ) -> (Self, Vec<usize>) {
        let kind = |spring: usize| {
            let fixed = scene.springs[spring]
                .nodes
                .map(|node| scene.nodes[node].fixed);
            match fixed {
                [false, false] => Kind::Interior,
                [true, true] => Kind::Fixed,
                _ => Kind::Anchored,
            }
        };
        let mut order: Vec<usize> = (0..scene.springs.len()).filter(|&i| wanted(i)).collect();
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
            anchored: upto(Kind::Anchored),
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

    /// The free and the fixed block of each anchored connection.
    pub(crate) fn anchored_ends(&self) -> impl Iterator<Item = [usize; 2]> {
        let ends = self.ends[self.anchored()].iter();
        ends.map(|ends| ends.map(|block| block as usize))
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

    /// The second end: of an anchored connection, its fixed node.
    #[inline(always)]
    pub(crate) fn second(&self, connection: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        x[self.ends[connection][1] as usize]
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

    /// Adds [[B, −B], [−B, B]] of an interior connection.
    #[inline(always)]
    pub(crate) fn add_block(&self, connection: usize, block: &[f64; 6], matrix: &mut BlockMatrix) {
        let [a, b] = self.ends[connection];
        matrix.add_diagonal(a, block);
        matrix.add_diagonal(b, block);
        matrix.subtract_pair(self.pairs[connection], block);
    }

    /// [`Self::add_block`] of an anchored connection, and what the velocity of
    /// its anchor brings to the right-hand side: −(−B)·v.
    #[inline(always)]
    pub(crate) fn add_anchored_block(
        &self,
        connection: usize,
        block: &[f64; 6],
        v: &[Vector3<f64>],
        out: &mut Linearization,
    ) {
        let [free, anchor] = self.ends[connection];
        out.matrix.add_diagonal(free, block);
        out.anchor_load[free as usize] += times(block, &v[anchor as usize]);
    }

    /// Adds weight·[[B, −B], [−B, B]] y on the free ends; fixed ends do not move.
    #[inline(always)]
    pub(crate) fn add_product(
        &self,
        connection: usize,
        block: &[f64; 6],
        weight: f64,
        y: &[Vector3<f64>],
        products: &mut [Vector3<f64>],
    ) {
        let [a, b] = self.ends[connection].map(|block| block as usize);
        let is_interior = connection < self.interior;
        let difference = if is_interior { y[a] - y[b] } else { y[a] };
        let product = times(block, &difference) * weight;
        products[a] += product;
        if is_interior {
            products[b] -= product;
        }
    }
}
