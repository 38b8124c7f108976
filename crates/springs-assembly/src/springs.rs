//! Springs as force emitters.

use crate::batch::{Connections, firsts_of_pairs};
use crate::matrix::times;
use crate::{Evaluation, ForceEmitter, Linearization, Numbering, Projection};
use nalgebra::Vector3;
use springs_math::{Separation, spring};
use springs_scene::{Scene, Spring};

/// The packed identity.
const IDENTITY: [f64; 6] = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];

/// All springs that have a stiffness; those of one rest length between the same
/// two nodes are one, unless the scene says otherwise: K = ΣK. Their tensions are
/// in proportion to their stiffnesses, so that this is exact with every
/// [`Projection`].
#[derive(Clone, Debug)]
pub struct Springs {
    pub(crate) connections: Connections,
    stiffness: Vec<f64>,
    rest_length: Vec<f64>,
    scene_index: Vec<usize>,
    /// Springs that became part of another one between the same nodes.
    n_merged: usize,
    /// Whether the Hessian of every spring with a free end is K·I: all their rest
    /// lengths are zero.
    is_isotropic: bool,
}

impl Springs {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let is_stiff = |spring: &Spring| spring.stiffness > 0.0;
        // Rest lengths are not negative, so their bits are in their order.
        let firsts = firsts_of_pairs(scene, |spring| {
            is_stiff(spring).then_some((spring.rest_length + 0.0).to_bits())
        });
        let mut sums = vec![0.0; scene.springs.len()];
        let mut n_merged = 0;
        for (index, (spring, &first)) in scene.springs.iter().zip(&firsts).enumerate() {
            sums[first] += spring.stiffness;
            n_merged += usize::from(first != index);
        }
        let (connections, order) = Connections::new(scene, numbering, |index| {
            is_stiff(&scene.springs[index]) && firsts[index] == index
        });
        let rest_length = |&index: &usize| scene.springs[index].rest_length;
        let mut springs = Self {
            n_merged,
            connections,
            stiffness: order.iter().map(|&index| sums[index]).collect(),
            rest_length: order.iter().map(rest_length).collect(),
            scene_index: order,
            is_isotropic: false,
        };
        let mut live = springs.connections.live();
        springs.is_isotropic =
            scene.settings.skip && live.all(|index| springs.rest_length[index] == 0.0);
        springs
    }

    pub(crate) fn is_isotropic(&self) -> bool {
        self.is_isotropic
    }

    /// How many springs became part of another one between the same nodes.
    pub fn n_merged(&self) -> usize {
        self.n_merged
    }

    /// Number of springs in the batch.
    pub fn len(&self) -> usize {
        self.connections.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index in the scene of the spring at `index` of the batch.
    ///
    /// # Panics
    ///
    /// If there is no such spring.
    pub fn scene_index(&self, index: usize) -> usize {
        self.scene_index[index]
    }

    /// The free block at an end of the spring at `index` of the batch; the first,
    /// if both are free.
    ///
    /// # Panics
    ///
    /// If there is no such spring.
    pub fn free_block(&self, index: usize) -> Option<usize> {
        let first = self.connections.ends()[index][0] as usize;
        self.connections.live().contains(&index).then_some(first)
    }

    fn material(&self, index: usize) -> spring::Spring {
        spring::Spring {
            stiffness: self.stiffness[index],
            rest_length: self.rest_length[index],
        }
    }

    /// T = K(l − l₀) of one spring and its length, in N and m.
    #[inline(always)]
    fn tension_and_length(&self, index: usize, x: &[Vector3<f64>]) -> (f64, f64) {
        let length = Separation::of(&self.connections.difference(index, x)).length;
        (spring::tension(self.material(index), length), length)
    }

    fn linearize_with(
        &self,
        project: impl Fn(f64) -> f64 + Copy,
        at: &Evaluation<'_>,
        out: &mut Linearization,
    ) {
        let weight = at.weights.stiffness;
        for index in self.connections.live() {
            let dx = self.connections.difference(index, at.x);
            let (force, block) = spring::linearize(
                self.material(index),
                at.tensions.map(|tensions| tensions[index]),
                &dx,
                project,
            );
            let block = block.map(|entry| weight * entry);
            self.add_linearized(index, force, &block, at, out);
        }
    }

    /// Forces, and the block K·I of every spring, whatever its state.
    fn linearize_isotropic(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        let weight = at.weights.stiffness;
        for index in self.connections.live() {
            let force = self.force(index, at.x);
            let stiffness = weight * self.stiffness[index];
            let block = IDENTITY.map(|entry| stiffness * entry);
            self.add_linearized(index, force, &block, at, out);
        }
    }

    #[inline(always)]
    fn add_linearized(
        &self,
        index: usize,
        force: Vector3<f64>,
        block: &[f64; 6],
        at: &Evaluation<'_>,
        out: &mut Linearization,
    ) {
        self.connections.add_force(index, force, &mut out.forces);
        match index < self.connections.interior().end {
            true => self.connections.add_block(index, block, &mut out.matrix),
            false => self.connections.add_anchored_block(index, block, at.v, out),
        }
    }

    /// The force on the first end.
    #[inline(always)]
    fn force(&self, index: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        let dx = self.connections.difference(index, x);
        if self.is_isotropic {
            dx * self.stiffness[index]
        } else {
            spring::force(self.material(index), &Vector3::zeros(), &dx)
        }
    }

    /// T = K(l − l₀) of every spring with a free end, in N; zero for the rest.
    ///
    /// # Panics
    ///
    /// If `tensions` does not have one entry per spring of the batch.
    pub fn tensions(&self, x: &[Vector3<f64>], tensions: &mut [f64]) {
        assert_eq!(tensions.len(), self.len(), "one entry per spring");
        for index in self.connections.live() {
            tensions[index] = self.tension_and_length(index, x).0;
        }
    }

    /// The tensions predicted for positions x + h·v, in N: T = K(l − l₀) at `x`
    /// plus K times the linear change of the length.
    ///
    /// # Panics
    ///
    /// If `tensions` does not have one entry per spring of the batch.
    pub fn predict_tensions(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        h: f64,
        tensions: &mut [f64],
    ) {
        self.tensions(x, tensions);
        for (index, tension) in tensions
            .iter_mut()
            .enumerate()
            .take(self.connections.live().end)
        {
            let u = Separation::of(&self.connections.difference(index, x)).direction;
            let change = h * u.dot(&self.connections.difference(index, v));
            *tension += self.stiffness[index] * change;
        }
    }

    /// The spring with a free end that pulls or pushes most at a block, with its
    /// length in m; what is not a number pulls most.
    pub fn most_strained_at(&self, block: usize, x: &[Vector3<f64>]) -> Option<(usize, f64)> {
        let ends = self.connections.ends();
        let here = |index: &usize| ends[*index].contains(&(block as u32));
        let strained = self.connections.live().filter(here).map(|index| {
            let (tension, length) = self.tension_and_length(index, x);
            (index, tension.abs(), length)
        });
        let most = strained.max_by(|a, b| a.1.total_cmp(&b.1));
        most.map(|(index, _, length)| (index, length))
    }

    /// Elastic energy, in J, of the springs with a free end: the part that forces
    /// on free nodes come from.
    pub fn energy_on_free_blocks(&self, x: &[Vector3<f64>]) -> f64 {
        let live = self.connections.live();
        live.map(|index| self.energy_of(index, x)).sum()
    }

    /// The largest coordinate, in m, of an end of a spring with a free end: what
    /// rounding of lengths is in proportion to.
    pub fn largest_coordinate(&self, x: &[Vector3<f64>]) -> f64 {
        let ends = self.connections.ends()[self.connections.live()].iter();
        let coordinates = ends.flatten().map(|&block| x[block as usize].amax());
        coordinates.fold(0.0, f64::max)
    }

    fn energy_of(&self, index: usize, x: &[Vector3<f64>]) -> f64 {
        let dx = self.connections.difference(index, x);
        spring::energy(self.material(index), &Vector3::zeros(), &dx)
    }

    /// K of a spring of the batch, in N/m.
    ///
    /// # Panics
    ///
    /// If there is no such spring.
    pub fn stiffness(&self, index: usize) -> f64 {
        self.stiffness[index]
    }

    /// How many springs with a free end have a negative tension: their own, or
    /// the given one.
    pub fn count_compressed(&self, x: &[Vector3<f64>], tensions: Option<&[f64]>) -> usize {
        let is_compressed = |index: &usize| {
            let (own, length) = self.tension_and_length(*index, x);
            tensions.map_or(own, |given| given[*index]) < 0.0 && length > 0.0
        };
        self.connections.live().filter(is_compressed).count()
    }

    /// Adds the stiffness of each spring, in N/m, to its free blocks.
    pub(crate) fn add_stiffness_sums(&self, sums: &mut [f64]) {
        self.connections.add_to_ends(&self.stiffness, sums);
    }

    /// Power, in W, that anchors give to move against their springs to free
    /// nodes: Σ f·v, where f is the force on the free node and v the velocity of
    /// the anchor.
    pub fn anchor_power(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let power = |index| -> f64 { self.force(index, x).dot(&self.connections.second(index, v)) };
        self.connections.anchored().map(power).sum()
    }

    /// What [`Self::anchor_power`] changes by, in W, when the nodes move on by
    /// `y`, in m, and forces change by `stiffness`·H y as linearized at `at`.
    pub fn anchor_power_change(&self, at: &Evaluation<'_>, y: &[Vector3<f64>]) -> f64 {
        let change = |index| -> f64 {
            let force = times(
                &self.block(index, at),
                &self.connections.difference(index, y),
            );
            force.dot(&self.connections.second(index, at.v))
        };
        let sum: f64 = self.connections.anchored().map(change).sum();
        at.weights.stiffness * sum
    }

    /// Work, in J, that moving anchors do on the springs between them when they
    /// go from `start` to `end`: Σ (T₀ + T₁)/2·(l₁ − l₀), the exact change of the
    /// energy of these springs.
    pub fn work_between_fixed(&self, start: &[Vector3<f64>], end: &[Vector3<f64>]) -> f64 {
        let work = |index| {
            let [before, after] = [start, end].map(|x| self.connections.difference(index, x));
            let [(t0, l0), (t1, l1)] = [start, end].map(|x| self.tension_and_length(index, x));
            // l₁² − l₀² over l₁ + l₀, without the rounding of a difference of lengths.
            let stretch =
                (after - before).dot(&(after + before)) / (l0 + l1).max(f64::MIN_POSITIVE);
            0.5 * (t0 + t1) * stretch
        };
        self.connections.between_fixed().map(work).sum()
    }

    /// The energy, in J, of the springs whose length differs from the rest length
    /// by more than a part `strain` of it.
    pub fn energy_beyond(&self, strain: f64, x: &[Vector3<f64>]) -> f64 {
        let energy = |index: usize| {
            let (_, length) = self.tension_and_length(index, x);
            let change = length - self.rest_length[index];
            if change.abs() > strain * self.rest_length[index] {
                0.5 * self.stiffness[index] * change * change
            } else {
                0.0
            }
        };
        (0..self.len()).map(energy).sum()
    }

    /// The energy, in J, that rounding of coordinates is good for: Σ K(ε‖x‖)²,
    /// with the largest coordinate of the ends of each spring.
    pub fn energy_of_rounding(&self, x: &[Vector3<f64>]) -> f64 {
        let energy = |index: usize| {
            let [a, b] = self.connections.ends()[index].map(|block| x[block as usize].amax());
            self.stiffness[index] * (f64::EPSILON * a.max(b)).powi(2)
        };
        (0..self.len()).map(energy).sum()
    }

    /// The block of a spring as linearized at `at`, without weight.
    fn block(&self, index: usize, at: &Evaluation<'_>) -> [f64; 6] {
        let dx = self.connections.difference(index, at.x);
        let given = at.tensions.map(|tensions| tensions[index]);
        let project = |across| at.projection.apply(across);
        spring::linearize(self.material(index), given, &dx, project).1
    }
}

impl ForceEmitter for Springs {
    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        (0..self.len()).map(|index| self.energy_of(index, x)).sum()
    }

    fn add_forces(&self, x: &[Vector3<f64>], _v: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            self.connections
                .add_force(index, self.force(index, x), forces);
        }
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        if self.is_isotropic && at.projection != Projection::Drop && at.tensions.is_none() {
            return self.linearize_isotropic(at, out);
        }
        // One loop for each, without a choice inside.
        match at.projection {
            Projection::None => self.linearize_with(|a| Projection::None.apply(a), at, out),
            Projection::Clamp => self.linearize_with(|a| Projection::Clamp.apply(a), at, out),
            Projection::Absolute => self.linearize_with(|a| Projection::Absolute.apply(a), at, out),
            Projection::Drop => self.linearize_with(|a| Projection::Drop.apply(a), at, out),
        }
    }

    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            let block = self.block(index, at);
            self.connections
                .add_product(index, &block, at.weights.stiffness, y, products);
        }
    }
}
