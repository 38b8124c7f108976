//! Dashpots along springs as emitters.

mod runs;

use self::runs::DashpotRuns;
use crate::anchor_works::share_out;
use crate::connections::Connections;
use crate::matrix::PairBlock;
use crate::segments::{Segment, Segments};
use crate::sums::{Linearized, Sums};
use crate::{
    Emitter, Evaluation, Linearization, Nature, Numbering, PACKED, SpringNumbers, StiffnessKind,
};
use nalgebra::{Matrix3, Vector3};
use springs_math::Separation;
use springs_math::dashpot::{self, Dashpot, Fading};

/// Dashpots between two nodes each. Scenes without any pay nothing for them.
#[derive(Clone, Debug)]
pub struct Dashpots {
    connections: Connections,
    damping: Vec<f64>,
    /// Empty if none of them fades.
    fading: Vec<Fading>,
    /// The spring of each; empty if none of these can break or change.
    springs: Vec<usize>,
    /// Whether it is broken.
    is_off: Vec<bool>,
    /// A copy of the numbers of those in runs, if none fades.
    in_runs: Option<DashpotRuns>,
}

/// Pieces of a passage within which a dashpot that fades does not.
const PIECES: usize = 16;

impl Dashpots {
    /// From nodes of a scene and c in N·s/m.
    pub fn new(dashpots: &[([usize; 2], f64)]) -> Self {
        Self {
            connections: Connections::between(dashpots.iter().map(|(nodes, _)| *nodes)),
            damping: dashpots.iter().map(|(_, damping)| *damping).collect(),
            fading: Vec::new(),
            springs: Vec::new(),
            is_off: Vec::new(),
            in_runs: None,
        }
    }

    /// Notes the numbers of dashpots in runs.
    fn note_runs(&mut self) {
        self.in_runs = self.fading.is_empty().then(|| {
            let (runs, ends) = (self.connections.runs(), self.connections.ends());
            DashpotRuns::new(runs, ends, |index| self.acting(index, || 0.0).0.damping)
        });
    }

    /// With where each of them acts.
    ///
    /// # Panics
    ///
    /// If that is not one for each.
    pub fn with_fading(mut self, fading: Vec<Fading>) -> Self {
        assert_eq!(fading.len(), self.damping.len(), "one for each");
        let fades = fading.iter().any(|fading| *fading != Fading::Nowhere);
        self.fading = if fades { fading } else { Vec::new() };
        self
    }

    /// With the springs that they go along, which can break or change.
    pub(crate) fn of_springs(mut self, springs: Vec<usize>) -> Self {
        assert_eq!(springs.len(), self.damping.len(), "one for each");
        self.is_off = vec![false; springs.len()];
        self.springs = springs;
        self
    }

    /// Whether its spring is broken.
    fn is_off(&self, index: usize) -> bool {
        self.is_off.get(index).is_some_and(|&is_off| is_off)
    }

    /// What acts of a dashpot at a length in m, and what its damping changes by with
    /// the length, in N·s/m².
    fn acting(&self, index: usize, length: impl FnOnce() -> f64) -> (Dashpot, f64) {
        let damping = if self.is_off(index) {
            0.0
        } else {
            self.damping[index]
        };
        let Some(fading) = self.fading.get(index) else {
            return (Dashpot { damping }, 0.0);
        };
        let (factor, slope) = fading.at(length());
        let damping_at = Dashpot {
            damping: damping * factor,
        };
        (damping_at, damping * slope)
    }

    /// What acts of a dashpot.
    fn dashpot(&self, index: usize, x: &[Vector3<f64>]) -> Dashpot {
        let length = || Separation::of(&self.connections.difference(index, x)).length;
        self.acting(index, length).0
    }

    fn ends(&self, index: usize) -> [usize; 2] {
        self.connections.ends()[index].map(|block| block as usize)
    }

    fn force(&self, index: usize, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Vector3<f64> {
        let [a, b] = self.ends(index);
        dashpot::force(self.dashpot(index, x), [&x[a], &x[b]], [&v[a], &v[b]])
    }

    fn block(&self, index: usize, at: &Evaluation<'_>) -> [f64; 6] {
        let [a, b] = self.ends(index);
        let separation = Separation::between(&at.x[a], &at.x[b]);
        let (Dashpot { damping }, slope) = self.acting(index, || separation.length);
        let mut block = separation.along() * (damping * at.weights.damping);
        let rate = separation.direction.dot(&(at.v[b] - at.v[a]));
        if at.velocity_stiffness && rate > 0.0 && separation.length != 0.0 {
            let across = Matrix3::identity() - separation.along();
            let stiffness = damping * rate / separation.length;
            block += across * (stiffness * at.weights.stiffness);
        }
        if at.velocity_stiffness && slope * rate > 0.0 {
            block += separation.along() * (slope * rate * at.weights.stiffness);
        }
        PACKED.map(|entry| block[entry])
    }

    /// The heat, in J, of a passage between fixed nodes; see
    /// [`dashpot::heat_of_passage`].
    fn heat_of_passage(&self, index: usize, [start, end]: [Vector3<f64>; 2], h: f64) -> f64 {
        if self.fading.is_empty() {
            let (dashpot, _) = self.acting(index, || 0.0);
            return dashpot::heat_of_passage(dashpot, &start, &end, h);
        }
        let pieces = PIECES as f64;
        let at = |place: f64| start + (end - start) * (place / pieces);
        let heat = |piece: usize| {
            let piece = piece as f64;
            let middle = || Separation::of(&at(piece + 0.5)).length;
            let (dashpot, _) = self.acting(index, middle);
            dashpot::heat_of_passage(dashpot, &at(piece), &at(piece + 1.0), h / pieces)
        };
        (0..PIECES).map(heat).sum()
    }
}

/// Dashpots as linearized at some state.
struct At<'a> {
    dashpots: &'a Dashpots,
    at: &'a Evaluation<'a>,
}

impl Linearized for At<'_> {
    fn segments(&self) -> &Segments {
        self.dashpots.connections.segments()
    }

    fn add_to<P: PairBlock>(&self, segment: &Segment, sums: &mut Sums<'_, P>) {
        let Self { dashpots, at } = *self;
        for index in segment.live(false).into_iter().flatten() {
            let block = dashpots.block(index, at);
            dashpots.connections.add_block(index, &block, at.v, sums);
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
        if !self.fading.is_empty() {
            self.fading = order.iter().map(|&index| self.fading[index]).collect();
        }
        if !self.springs.is_empty() {
            self.springs = order.iter().map(|&index| self.springs[index]).collect();
        }
        self.note_runs();
    }

    fn change_springs(&mut self, springs: &[SpringNumbers]) {
        for (index, &spring) in self.springs.iter().enumerate() {
            self.damping[index] = springs[spring].damping;
            if let Some(fading) = self.fading.get_mut(index) {
                *fading = springs[spring].fading;
            }
        }
        self.note_runs();
    }

    fn follow_broken(&mut self, springs: &[usize]) {
        for (is_off, spring) in self.is_off.iter_mut().zip(&self.springs) {
            *is_off = springs.binary_search(spring).is_ok();
        }
        self.note_runs();
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
        let work = |segment: &Segment, first: usize, forces: &mut [Vector3<f64>]| {
            if let Some(numbers) = &self.in_runs {
                let runs = &self.connections.runs()[segment.runs.clone()];
                numbers.add_forces(runs, [x, v], 1.0, (first, &mut *forces));
            }
            let others = segment.live(self.in_runs.is_some());
            for index in others.into_iter().flatten() {
                let force = self.force(index, x, v);
                self.connections.add_force(index, force, (first, forces));
            }
        };
        self.connections.segments().add_up(forces, work);
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
        out.add(&At { dashpots: self, at });
    }

    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]) {
        // D y are the forces at velocities −y; where velocities bring stiffness, there is more.
        let in_runs = self.in_runs.as_ref().filter(|_| !at.velocity_stiffness);
        let work = |segment: &Segment, first: usize, products: &mut [Vector3<f64>]| {
            if let Some(numbers) = in_runs {
                let runs = &self.connections.runs()[segment.runs.clone()];
                let products = (first, &mut *products);
                numbers.add_forces(runs, [at.x, y], -at.weights.damping, products);
            }
            for index in segment.live(in_runs.is_some()).into_iter().flatten() {
                let (block, products) = (self.block(index, at), (first, &mut *products));
                self.connections
                    .add_product(index, &block, 1.0, y, products);
            }
        };
        self.connections.segments().add_up(products, work);
    }

    fn add_stiffness_bounds(&self, _bounds: &mut [f64]) {}

    fn add_damping_bounds(&self, bounds: &mut [f64]) {
        self.connections
            .add_to_ends(self.damping.iter().copied(), bounds);
    }

    fn dissipation(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let heat = |index| {
            let [a, b] = self.ends(index);
            dashpot::dissipation(self.dashpot(index, x), [&x[a], &x[b]], [&v[a], &v[b]])
        };
        self.connections.segments().sum(|segment| {
            let numbers = self.in_runs.as_ref();
            let runs = &self.connections.runs()[segment.runs.clone()];
            let along_runs = numbers.map_or(0.0, |numbers| numbers.dissipation(runs, [x, v]));
            let one_by_one = segment.live(numbers.is_some()).into_iter().flatten();
            along_runs + one_by_one.map(heat).sum::<f64>()
        })
    }

    fn add_damping_anchor_works(
        &self,
        h: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        let force = |index| self.force(index, x, v) * h;
        self.connections.add_anchor_works(force, v, works);
    }

    /// All the work becomes heat.
    fn add_works_between_fixed(
        &self,
        start: &[Vector3<f64>],
        end: &[Vector3<f64>],
        h: f64,
        works: &mut [f64],
    ) -> f64 {
        let mut total = 0.0;
        for index in self.connections.between_fixed() {
            let ways = self.connections.ways(index, start, end);
            if ways == [Vector3::zeros(); 2] {
                continue;
            }
            let ends = [start, end].map(|x| self.connections.difference(index, x));
            let heat = self.heat_of_passage(index, ends, h);
            let velocity = (ways[1] - ways[0]) / h;
            let forces = |place: f64| {
                let separation = Separation::of(&ends[0].lerp(&ends[1], place));
                let (Dashpot { damping }, _) = self.acting(index, || separation.length);
                let force = separation.direction * (damping * separation.direction.dot(&velocity));
                [force, -force]
            };
            let shares = share_out(heat, ways, forces);
            self.connections.add_to_fixed(index, shares, works);
            total += heat;
        }
        total
    }
}
