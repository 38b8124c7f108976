//! The compiled scene: global forces and matrices for any state.

use crate::{
    BlockMatrix, BlockPattern, Dashpots, Evaluation, ForceEmitter, Gravity, Motion, Numbering,
    Springs,
};
use nalgebra::Vector3;
use springs_scene::{Scene, Solution};
use std::num::NonZeroUsize;
use std::ops::Add;
use std::sync::{Arc, LazyLock};

/// Asked for once: the answer takes longer than a small scene.
static MACHINE_THREADS: LazyLock<usize> =
    LazyLock::new(|| std::thread::available_parallelism().map_or(1, NonZeroUsize::get));

/// Threads for a setting of so many, where 0 means as many as the machine has.
pub fn machine_threads(asked: usize) -> usize {
    match asked {
        0 => *MACHINE_THREADS,
        asked => asked,
    }
}

/// A compiled scene.
///
/// `x` and `v` are global vectors of all blocks, in m and m/s, with at least
/// one entry per node; results are for the free blocks.
#[derive(Clone, Debug)]
pub struct System {
    numbering: Numbering,
    masses: Vec<f64>,
    inverse_masses: Vec<f64>,
    batches: Batches,
    motion: Motion,
    pattern: Arc<BlockPattern>,
    threads: usize,
    solution: Solution,
    initial_positions: Vec<Vector3<f64>>,
    initial_velocities: Vec<Vector3<f64>>,
}

/// All that gives forces.
#[derive(Clone, Debug)]
pub(crate) struct Batches {
    pub(crate) springs: Springs,
    pub(crate) dashpots: Dashpots,
    pub(crate) gravity: Gravity,
}

/// Forces and system matrix at one state, filled by [`System::linearize`].
#[derive(Clone, Debug)]
pub struct Linearization {
    /// Forces that do not depend on velocities, on the free blocks, in N.
    pub forces: Vec<Vector3<f64>>,
    /// A = `mass`·M + `damping`·D + `stiffness`·H of the free blocks.
    pub matrix: BlockMatrix,
    /// −A·v of the moving anchors' columns, on the free blocks: what the
    /// elimination of prescribed velocities brings to the right-hand side.
    /// Zero without moving anchors.
    pub anchor_load: Vec<Vector3<f64>>,
}

/// Mechanical energy, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// ½ Σ m v² of the free nodes.
    pub kinetic: f64,
    /// ½ Σ K(l − l₀)² of all springs.
    pub elastic: f64,
    /// −Σ m g·x of the free nodes.
    pub gravity: f64,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.gravity
    }
}

impl Add for Energy {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            kinetic: self.kinetic + other.kinetic,
            elastic: self.elastic + other.elastic,
            gravity: self.gravity + other.gravity,
        }
    }
}

impl System {
    pub(crate) fn new(
        scene: &Scene,
        numbering: Numbering,
        masses: Vec<f64>,
        batches: Batches,
        pattern: BlockPattern,
        motion: Motion,
    ) -> Self {
        let ordered = |of_node: fn(&springs_scene::Node) -> Vector3<f64>| {
            let nodes: Vec<_> = scene.nodes.iter().map(of_node).collect();
            let mut blocks = vec![Vector3::zeros(); nodes.len()];
            numbering.gather(&nodes, &mut blocks);
            blocks
        };
        Self {
            initial_positions: ordered(|node| node.position),
            initial_velocities: ordered(|node| node.velocity),
            numbering,
            inverse_masses: masses.iter().map(|mass| 1.0 / mass).collect(),
            masses,
            batches,
            motion,
            pattern: Arc::new(pattern),
            threads: machine_threads(scene.settings.threads),
            solution: scene.settings.solution,
        }
    }

    /// Threads that may be used on the system.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// How precisely linear systems are to be solved.
    pub fn solution(&self) -> Solution {
        self.solution
    }

    /// Which node is which block.
    pub fn numbering(&self) -> &Numbering {
        &self.numbering
    }

    /// Number of free blocks; the unknowns are three times as many.
    pub fn n_free(&self) -> usize {
        self.numbering.n_free()
    }

    /// Lumped mass of each free block, in kg.
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// The springs that have a stiffness.
    pub fn springs(&self) -> &Springs {
        &self.batches.springs
    }

    /// The springs that have a damping.
    pub fn dashpots(&self) -> &Dashpots {
        &self.batches.dashpots
    }

    /// Where the motion stays.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Whether every block of H is a multiple of the identity that never
    /// changes: all rest lengths are zero, and there are no dashpots.
    pub fn is_isotropic(&self) -> bool {
        self.batches.springs.is_isotropic() && self.batches.dashpots.is_empty()
    }

    /// Which blocks of the matrices are stored.
    pub fn pattern(&self) -> &BlockPattern {
        &self.pattern
    }

    /// Positions of all blocks in the scene, in m.
    pub fn initial_positions(&self) -> &[Vector3<f64>] {
        &self.initial_positions
    }

    /// Velocities of all blocks in the scene, in m/s.
    pub fn initial_velocities(&self) -> &[Vector3<f64>] {
        &self.initial_velocities
    }

    /// All but gravity, whose forces are the same everywhere.
    fn emitters(&self) -> [&dyn ForceEmitter; 2] {
        [&self.batches.springs, &self.batches.dashpots]
    }

    /// All forces on the free blocks, in N.
    ///
    /// # Panics
    ///
    /// If `forces` is shorter than the number of free blocks.
    pub fn forces(&self, x: &[Vector3<f64>], v: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        let forces = &mut forces[..self.n_free()];
        self.batches.gravity.set_forces(forces);
        for emitter in self.emitters() {
            emitter.add_forces(x, v, forces);
        }
    }

    /// Accelerations of the free blocks, in m/s²: forces over masses, which must
    /// not be zero.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn accelerations(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        accelerations: &mut [Vector3<f64>],
    ) {
        self.forces(x, v, accelerations);
        for (a, inverse) in accelerations.iter_mut().zip(&self.inverse_masses) {
            *a *= *inverse;
        }
    }

    /// Storage for [`Self::linearize`].
    pub fn linearization(&self) -> Linearization {
        let zeros = vec![Vector3::zeros(); self.n_free()];
        Linearization {
            forces: zeros.clone(),
            matrix: BlockMatrix::zeros(self.pattern.clone()),
            anchor_load: zeros,
        }
    }

    /// Forces and system matrix, without allocating.
    ///
    /// # Panics
    ///
    /// If `out` belongs to another system, or a slice is too short.
    pub fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        out.forces.fill(Vector3::zeros());
        out.anchor_load.fill(Vector3::zeros());
        out.matrix.set_mass(at.weights.mass, &self.masses);
        for emitter in self.emitters() {
            emitter.linearize(at, out);
        }
        self.batches.gravity.linearize(at, out);
    }

    /// The product of the system matrix at `at` and `y` on the free blocks, term
    /// by term instead of through the assembled matrix: what is lost there in
    /// sums of stiffnesses far above the masses is kept here.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn product(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], product: &mut [Vector3<f64>]) {
        for (p, (mass, y)) in product.iter_mut().zip(self.masses.iter().zip(y)) {
            *p = y * (at.weights.mass * mass);
        }
        for emitter in self.emitters() {
            emitter.add_products(at, y, product);
        }
    }

    /// Mechanical energy, in J.
    pub fn energy(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Energy {
        let (kinetic, gravity) = self.kinetic_and_gravity_energy(x, v);
        Energy {
            kinetic,
            elastic: self.batches.springs.energy(x),
            gravity,
        }
    }

    /// The parts of [`Self::energy`] that cost no look at any spring.
    pub fn kinetic_and_gravity_energy(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> (f64, f64) {
        let masses_and_velocities = self.masses.iter().zip(v);
        let kinetic = masses_and_velocities.map(|(mass, v)| 0.5 * mass * v.norm_squared());
        (kinetic.sum(), self.gravity_energy(x))
    }

    /// The gravity in [`Self::energy`].
    pub fn gravity_energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.batches.gravity.energy(x)
    }

    /// Whether any of the velocities `v` of fixed blocks is not zero.
    pub fn any_anchor_moves(&self, v: &[Vector3<f64>]) -> bool {
        v[self.n_free()..].iter().any(|v| *v != Vector3::zeros())
    }

    /// Power, in W, that moving anchors give to what joins them to free nodes.
    /// What they do between each other is [`Springs::work_between_fixed`] and
    /// [`Dashpots::heat_between_fixed`].
    pub fn anchor_power(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        if self.any_anchor_moves(v) {
            self.batches.springs.anchor_power(x, v) + self.batches.dashpots.anchor_power(x, v)
        } else {
            0.0
        }
    }

    /// A bound on the angular frequency of every motion in every
    /// configuration, in rad/s: ω² ≤ max (2/m) Σ K over the springs of a node
    /// (Gershgorin). Infinite if a massless node has a spring, zero without
    /// springs.
    pub fn frequency_bound(&self) -> f64 {
        let bound = self.largest_per_mass(|sums| self.batches.springs.add_stiffness_sums(sums));
        (2.0 * bound).sqrt()
    }

    /// As [`Self::frequency_bound`], over the nodes that have a mass; in rad/s.
    pub fn frequency_bound_of_massive_nodes(&self) -> f64 {
        let bound = self.largest_per_mass(|sums| {
            self.batches.springs.add_stiffness_sums(sums);
            let of_masses = sums.iter_mut().zip(&self.masses);
            of_masses
                .filter(|(_, mass)| **mass == 0.0)
                .for_each(|(sum, _)| *sum = 0.0);
        });
        (2.0 * bound).sqrt()
    }

    /// The free and the fixed block of every spring and dashpot that joins one of
    /// each.
    pub fn anchored(&self) -> impl Iterator<Item = [usize; 2]> {
        let springs = self.batches.springs.connections.anchored_ends();
        springs.chain(self.batches.dashpots.connections.anchored_ends())
    }

    /// The step size, in s, up to which velocity Verlet is stable at a free
    /// block, whatever the configuration: 2/ω with ω² = (2/m) Σ K.
    ///
    /// # Panics
    ///
    /// If there is no such block.
    pub fn stable_step_at(&self, block: usize) -> f64 {
        let mut sums = vec![0.0; self.n_free()];
        self.batches.springs.add_stiffness_sums(&mut sums);
        2.0 / (2.0 * sums[block] / self.masses[block]).sqrt()
    }

    /// A bound on the decay rate that dashpots give to any motion in any
    /// configuration, in 1/s: max (2/m) Σ c over the dashpots of a node.
    pub fn damping_rate_bound(&self) -> f64 {
        2.0 * self.largest_per_mass(|sums| self.batches.dashpots.add_damping_sums(sums))
    }

    /// The largest sum per mass over the free blocks; 0/0 counts as 0.
    fn largest_per_mass(&self, add_sums: impl FnOnce(&mut [f64])) -> f64 {
        let mut sums = vec![0.0; self.n_free()];
        add_sums(&mut sums);
        let ratios = sums.iter().zip(&self.masses).map(
            |(&sum, &mass)| {
                if sum == 0.0 { 0.0 } else { sum / mass }
            },
        );
        ratios.fold(0.0, f64::max)
    }
}
