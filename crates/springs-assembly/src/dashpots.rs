//! Dashpots along springs as emitters.

use crate::connections::Connections;
use crate::matrix::{OffDiagonal, PairBlocks};
use crate::{
    BetweenFixed, Emitter, Evaluation, Linearization, Nature, Numbering, PACKED, StiffnessKind,
};
use nalgebra::{Matrix3, Vector3};
use springs_math::Separation;
use springs_math::dashpot::{self, Dashpot};

/// Dashpots between two nodes each. Scenes without any pay nothing for them.
#[derive(Clone, Debug)]
pub struct Dashpots {
    connections: Connections,
    damping: Vec<f64>,
}

impl Dashpots {
    /// From nodes of a scene and c in N·s/m.
    pub fn new(dashpots: &[([usize; 2], f64)]) -> Self {
        Self {
            connections: Connections::between(dashpots.iter().map(|(nodes, _)| *nodes)),
            damping: dashpots.iter().map(|(_, damping)| *damping).collect(),
        }
    }

    fn dashpot(&self, index: usize) -> Dashpot {
        Dashpot {
            damping: self.damping[index],
        }
    }

    fn ends(&self, index: usize) -> [usize; 2] {
        self.connections.ends()[index].map(|block| block as usize)
    }

    fn force(&self, index: usize, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Vector3<f64> {
        let [a, b] = self.ends(index);
        dashpot::force(self.dashpot(index), [&x[a], &x[b]], [&v[a], &v[b]])
    }

    fn block(&self, index: usize, at: &Evaluation<'_>) -> [f64; 6] {
        let [a, b] = self.ends(index);
        let separation = Separation::between(&at.x[a], &at.x[b]);
        let damping = self.damping[index];
        let along = separation.along() * (damping * at.weights.damping);
        let rate = separation.direction.dot(&(at.v[b] - at.v[a]));
        if !at.velocity_stiffness || rate <= 0.0 || separation.length == 0.0 {
            return PACKED.map(|entry| along[entry]);
        }
        let across = Matrix3::identity() - separation.along();
        let stiffness = damping * rate / separation.length;
        let block = along + across * (stiffness * at.weights.stiffness);
        PACKED.map(|entry| block[entry])
    }

    fn add_interior(
        &self,
        at: &Evaluation<'_>,
        diagonal: &mut [[f64; 6]],
        pairs: &mut impl PairBlocks,
    ) {
        for index in self.connections.interior() {
            let block = self.block(index, at);
            self.connections.add_block(index, &block, diagonal, pairs);
        }
    }
}

impl Emitter for Dashpots {
    fn name(&self) -> &str {
        "dashpots"
    }

    fn nature(&self) -> Nature {
        Nature {
            n_terms: self.damping.len(),
            n_merged: 0,
            stiffness: StiffnessKind::None,
            is_constant: false,
            is_load: false,
            is_damped: !self.damping.is_empty(),
            is_central: true,
            has_symmetric_blocks: true,
        }
    }

    fn number(&mut self, numbering: &Numbering) {
        let order = self.connections.number(numbering);
        self.damping = order.iter().map(|&index| self.damping[index]).collect();
    }

    fn each_stencil(&self, visit: &mut dyn FnMut(&[u32])) {
        self.connections.each_stencil(visit);
    }

    fn place(&mut self, pairs: &[u32]) {
        self.connections.place(pairs);
    }

    fn energy(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    fn add_forces(&self, _x: &[Vector3<f64>], _forces: &mut [Vector3<f64>]) {}

    fn add_damping_forces(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) {
        for index in self.connections.live() {
            let force = self.force(index, x, v);
            self.connections.add_force(index, force, forces);
        }
    }

    fn add_damping_reactions(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        reactions: &mut [Vector3<f64>],
    ) {
        let first_fixed = x.len() - reactions.len();
        for index in self.connections.anchored() {
            let [_, anchor] = self.ends(index);
            reactions[anchor - first_fixed] -= self.force(index, x, v);
        }
    }

    fn add_forces_on_all(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        _n_free: usize,
        _carried: Option<&[f64]>,
        forces: &mut [Vector3<f64>],
    ) {
        for index in 0..self.damping.len() {
            let (force, [a, b]) = (self.force(index, x, v), self.ends(index));
            forces[a] += force;
            forces[b] -= force;
        }
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        let matrix = &mut out.matrix;
        match &mut matrix.off_diagonal {
            OffDiagonal::Symmetric(pairs) => self.add_interior(at, &mut matrix.diagonal, pairs),
            OffDiagonal::General(pairs) => self.add_interior(at, &mut matrix.diagonal, pairs),
        }
        for index in self.connections.anchored() {
            let block = self.block(index, at);
            let (diagonal, load) = (&mut matrix.diagonal, &mut out.anchor_load);
            self.connections
                .add_anchored_block(index, &block, at.v, diagonal, load);
        }
    }

    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            let block = self.block(index, at);
            self.connections
                .add_product(index, &block, 1.0, y, products);
        }
    }

    fn add_stiffness_bounds(&self, _bounds: &mut [f64]) {}

    fn add_damping_bounds(&self, bounds: &mut [f64]) {
        self.connections
            .add_to_ends(self.damping.iter().copied(), bounds);
    }

    fn dissipation(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let heat = |index| {
            let [a, b] = self.ends(index);
            dashpot::dissipation(self.dashpot(index), [&x[a], &x[b]], [&v[a], &v[b]])
        };
        self.connections.live().map(heat).sum()
    }

    fn damping_anchor_power(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let power = |index| -> f64 {
            let force = self.force(index, x, v);
            force.dot(&self.connections.second(index, v))
        };
        self.connections.anchored().map(power).sum()
    }

    /// All the work becomes heat.
    fn between_fixed(&self, start: &[Vector3<f64>], end: &[Vector3<f64>], h: f64) -> BetweenFixed {
        let heat = |index| {
            let [before, after] = [start, end].map(|x| self.connections.difference(index, x));
            dashpot::heat_of_passage(self.dashpot(index), &before, &after, h)
        };
        let heat = self.connections.between_fixed().map(heat).sum();
        BetweenFixed { work: heat, heat }
    }
}
