//! The compiled scene: global forces and matrices for any state.

mod bounds;
mod carried;
mod changes;
mod energies;
mod memory;
mod part;
mod products;

pub use self::part::SystemPart;
pub use self::products::PreparedProducts;
use crate::guides::Guides;
use crate::prescribed::Prescribed;
use crate::{
    BlockMatrix, BlockPattern, Emitter, Evaluation, Motion, Nature, Numbering, StiffnessKind,
};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use springs_scene::Scene;
use springs_threads::{share_of_pass_here, share_out};
use std::sync::Arc;

/// A compiled scene.
///
/// `x` and `v` are global vectors of all blocks, in m and m/s, with at least
/// one entry per node; results are for the free blocks.
pub struct System {
    numbering: Numbering,
    masses: Vec<f64>,
    inverse_masses: Vec<f64>,
    emitters: Vec<Box<dyn Emitter>>,
    natures: Vec<Nature>,
    has_memory: bool,
    /// Of all emitters that are constant, on the free blocks, in N.
    constant_forces: Vec<Vector3<f64>>,
    couplings: Couplings,
    guides: Guides,
    prescribed: Arc<[Prescribed]>,
    motion: Motion,
    pattern: Arc<BlockPattern>,
    initial_positions: Vec<Vector3<f64>>,
    initial_velocities: Vec<Vector3<f64>>,
    /// In rad/s: of all nodes, and of those with a mass.
    frequency_bounds: [f64; 2],
}

/// The part of the next emitter, which is no longer among the rest of what a method
/// carried.
fn its_part<'c>(rest: &mut Option<&'c [f64]>, emitter: &dyn Emitter) -> Option<&'c [f64]> {
    let (mine, others) = (*rest)?.split_at(emitter.n_carried());
    *rest = Some(others);
    Some(mine)
}

/// What the emitters of a system couple.
#[derive(Clone, Debug, Default)]
pub(crate) struct Couplings {
    /// A free and a fixed block of one stencil each.
    pub(crate) anchored: Vec<[u32; 2]>,
    /// Blocks in stencils with a free block, ascending.
    pub(crate) coupled: Vec<u32>,
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

/// Multiplies vectors by a factor each, four of them at once.
struct Scale<'a> {
    numbers: &'a mut [f64],
    factors: &'a [f64],
}

impl WithSimd for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let (numbers, numbers_rest) = self.numbers.as_chunks_mut::<12>();
        let (factors, factors_rest) = self.factors.as_chunks::<4>();
        for (numbers, factors) in numbers.iter_mut().zip(factors) {
            let [k, l, m, n] = *factors;
            let factors = [k, k, k, l, l, l, m, m, m, n, n, n];
            for (number, factor) in numbers.iter_mut().zip(&factors) {
                *number *= factor;
            }
        }
        for (c, number) in numbers_rest.iter_mut().enumerate() {
            *number *= factors_rest[c / 3];
        }
    }
}

impl System {
    pub(crate) fn new(
        scene: &Scene,
        numbering: Numbering,
        masses: Vec<f64>,
        emitters: Vec<Box<dyn Emitter>>,
        (pattern, couplings): (BlockPattern, Couplings),
        motion: Motion,
    ) -> Self {
        let ordered = |of_node: fn(&Scene, usize) -> Vector3<f64>| {
            let nodes = 0..scene.nodes.len();
            let nodes: Vec<_> = nodes.map(|node| of_node(scene, node)).collect();
            let mut blocks = vec![Vector3::zeros(); nodes.len()];
            numbering.gather(&nodes, &mut blocks);
            blocks
        };
        let natures: Vec<Nature> = emitters.iter().map(|emitter| emitter.nature()).collect();
        let initial_positions = ordered(Scene::start_position);
        let mut constant_forces = vec![Vector3::zeros(); numbering.n_free()];
        for (emitter, _) in emitters
            .iter()
            .zip(&natures)
            .filter(|(_, nature)| nature.is_constant)
        {
            emitter.add_forces(&initial_positions, &mut constant_forces);
        }
        let guides = Guides::new(scene, &numbering, &pattern);
        let mut initial_velocities = ordered(Scene::start_velocity);
        guides.project(&mut initial_velocities);
        let mut system = Self {
            frequency_bounds: [0.0; 2],
            constant_forces,
            guides,
            prescribed: Prescribed::of_scene(scene, &numbering),
            initial_positions,
            initial_velocities,
            numbering,
            inverse_masses: masses.iter().map(|mass| 1.0 / mass).collect(),
            masses,
            natures,
            has_memory: emitters.iter().any(|emitter| emitter.has_memory()),
            emitters,
            couplings,
            motion,
            pattern: Arc::new(pattern),
        };
        system.find_bounds();
        system
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

    /// All that gives forces, in the order of [`Lines`](crate::Lines).
    pub fn emitters(&self) -> impl Iterator<Item = &dyn Emitter> {
        self.emitters.iter().map(|emitter| &**emitter)
    }

    /// Those with damping forces, with their lines.
    pub fn damped(&self) -> impl Iterator<Item = (usize, &dyn Emitter)> {
        let with_natures = self.emitters().zip(&self.natures).enumerate();
        with_natures
            .filter_map(|(line, (emitter, nature))| nature.is_damped.then_some((line, emitter)))
    }

    /// Whether there are damping forces.
    pub fn is_damped(&self) -> bool {
        self.natures.iter().any(|nature| nature.is_damped)
    }

    /// Number of terms of all emitters.
    pub fn n_terms(&self) -> usize {
        self.natures.iter().map(|nature| nature.n_terms).sum()
    }

    /// How many springs of the scene became part of another one.
    pub fn n_merged(&self) -> usize {
        self.natures.iter().map(|nature| nature.n_merged).sum()
    }

    /// Where the motion stays.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// Whether every block of H is a multiple of the identity that never changes, as
    /// where all rest lengths are zero, and nothing damps.
    pub fn is_isotropic(&self) -> bool {
        self.has_stiffness_within(&[StiffnessKind::None, StiffnessKind::Isotropic])
            && !self.is_damped()
    }

    /// Whether H never changes as far as it is along a line that all motion stays on,
    /// with [`crate::Projection::Drop`].
    pub fn is_constant_along_lines(&self) -> bool {
        self.has_stiffness_within(&[
            StiffnessKind::None,
            StiffnessKind::Isotropic,
            StiffnessKind::ConstantAlongLines,
        ])
    }

    fn has_stiffness_within(&self, kinds: &[StiffnessKind]) -> bool {
        let mut natures = self.natures.iter();
        self.guides.is_empty() && natures.all(|nature| kinds.contains(&nature.stiffness))
    }

    /// Whether blocks off the diagonal are symmetric.
    pub fn has_symmetric_blocks(&self) -> bool {
        let mut natures = self.natures.iter();
        self.guides.is_empty() && natures.all(|nature| nature.has_symmetric_blocks)
    }

    /// The motions that fixed blocks follow beside constant velocities.
    pub fn prescribed(&self) -> &Arc<[Prescribed]> {
        &self.prescribed
    }

    /// Free blocks whose nodes may move in part only. All forces on them, and matrices,
    /// are those of motions that their guides let them have.
    pub fn guided(&self) -> impl Iterator<Item = usize> {
        self.guides.blocks()
    }

    /// Takes the part across the guides from vectors of the free blocks.
    ///
    /// # Panics
    ///
    /// If there are fewer vectors than free blocks.
    pub fn project_onto_guides(&self, vectors: &mut [Vector3<f64>]) {
        self.guides.project(vectors);
    }

    /// Whether all guides let nodes have a common velocity.
    pub fn may_all_have(&self, velocity: &Vector3<f64>) -> bool {
        self.guides.let_have(velocity)
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

    /// Whether there are forces that depend on time.
    pub fn has_loads(&self) -> bool {
        self.natures.iter().any(|nature| nature.is_load)
    }

    fn loads(&self) -> impl Iterator<Item = &dyn Emitter> {
        let with_natures = self.emitters().zip(&self.natures);
        with_natures.filter_map(|(emitter, nature)| nature.is_load.then_some(emitter))
    }

    /// Adds the loads at a time in s to the forces on the free blocks, in N.
    pub fn add_loads(&self, time: f64, forces: &mut [Vector3<f64>]) {
        self.loads()
            .for_each(|emitter| emitter.add_loads(time, forces));
        self.guides.project(forces);
    }

    /// How many loads there are: those of the scene, in its order, then forces that may be
    /// [set](Self::set_forces), then those of other emitters.
    pub fn n_loads(&self) -> usize {
        self.loads().map(Emitter::n_loads).sum()
    }

    /// Hands over every force of a load on a free block at a time in s, in N, with its load
    /// and its block: always in the same order. It is not projected onto guides.
    pub fn each_load(&self, time: f64, mut visit: impl FnMut(usize, usize, &Vector3<f64>)) {
        let mut first = 0;
        for emitter in self.loads() {
            emitter.each_load(time, &mut |load, block, force| {
                visit(first + load, block, force);
            });
            first += emitter.n_loads();
        }
    }

    /// The same of what they change by with time, in N/s.
    pub fn each_load_rate(&self, time: f64, mut visit: impl FnMut(usize, usize, &Vector3<f64>)) {
        let mut first = 0;
        for emitter in self.loads() {
            emitter.each_load_rate(time, &mut |load, block, rate| {
                visit(first + load, block, rate);
            });
            first += emitter.n_loads();
        }
    }

    /// Adds what they change by with time, in N/s.
    pub fn add_load_rates(&self, time: f64, rates: &mut [Vector3<f64>]) {
        self.each_load_rate(time, |_, block, rate| rates[block] += rate);
        self.guides.project(rates);
    }

    /// All forces on the free blocks, in N, at a time in s.
    ///
    /// # Panics
    ///
    /// If `forces` is shorter than the number of free blocks.
    pub fn forces(
        &self,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) {
        self.add_damping_and_loads(time, x, v, self.static_forces(x, forces));
    }

    /// The forces on the free blocks that depend on positions alone, in N.
    ///
    /// # Panics
    ///
    /// If `forces` is shorter than the number of free blocks.
    pub fn static_forces<'f>(
        &self,
        x: &[Vector3<f64>],
        forces: &'f mut [Vector3<f64>],
    ) -> &'f mut [Vector3<f64>] {
        let forces = &mut forces[..self.n_free()];
        forces.copy_from_slice(&self.constant_forces);
        for (emitter, nature) in self.emitters().zip(&self.natures) {
            if nature.n_terms > 0 {
                emitter.add_forces(x, forces);
            }
        }
        self.guides.project(forces);
        forces
    }

    /// Adds the forces that depend on velocities or on time to those on the free
    /// blocks, in N.
    ///
    /// # Panics
    ///
    /// If `forces` is shorter than the number of free blocks.
    pub fn add_damping_and_loads(
        &self,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) {
        self.add_damping_forces(x, v, forces);
        self.add_loads(time, forces);
    }

    /// Adds the forces that depend on velocities to those on the free blocks, in N.
    ///
    /// # Panics
    ///
    /// If `forces` is shorter than the number of free blocks.
    pub fn add_damping_forces(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) {
        for (_, emitter) in self.damped() {
            emitter.add_damping_forces(x, v, forces);
        }
        self.guides.project(forces);
    }

    /// Accelerations of the free blocks, in m/s², at a time in s: forces over masses, which must
    /// not be zero.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn accelerations(
        &self,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        accelerations: &mut [Vector3<f64>],
    ) {
        self.forces(time, x, v, accelerations);
        self.divide_by_masses(accelerations);
    }

    /// Makes accelerations, in m/s², of forces on the free blocks, in N; their masses must not be
    /// zero.
    ///
    /// # Panics
    ///
    /// If there are fewer forces than free blocks.
    pub fn divide_by_masses(&self, forces: &mut [Vector3<f64>]) {
        let scale = |(numbers, factors): (&mut [Vector3<f64>], &[f64])| {
            let numbers = bytemuck::cast_slice_mut(numbers);
            Arch::new().dispatch(Scale { numbers, factors });
        };
        let all = &mut forces[..self.n_free()];
        let factors = &self.inverse_masses[..];
        let Some(share) = share_of_pass_here(all.len()) else {
            return scale((all, factors));
        };
        share_out(all.chunks_mut(share).zip(factors.chunks(share)), scale);
    }

    /// Storage for [`Self::linearize`].
    pub fn linearization(&self) -> Linearization {
        let zeros = vec![Vector3::zeros(); self.n_free()];
        Linearization {
            forces: zeros.clone(),
            matrix: BlockMatrix::zeros(self.pattern.clone(), self.has_symmetric_blocks()),
            anchor_load: zeros,
        }
    }

    /// Forces that depend on positions alone, and system matrix, without allocating.
    ///
    /// # Panics
    ///
    /// If `out` belongs to another system, or a slice is too short.
    pub fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        out.forces.fill(Vector3::zeros());
        out.anchor_load.fill(Vector3::zeros());
        out.matrix.set_mass(at.weights.mass, &self.masses);
        self.each_with_carried(at, |line, emitter, at| {
            if self.natures[line].n_terms > 0 {
                emitter.linearize(at, out);
            }
        });
        for (force, constant) in out.forces.iter_mut().zip(&self.constant_forces) {
            *force += constant;
        }
        self.guides.project(&mut out.forces);
        self.guides.project(&mut out.anchor_load);
        self.guides.constrain(&mut out.matrix);
    }

    /// Every emitter with what is carried along for it.
    fn each_with_carried<'a>(
        &self,
        at: &Evaluation<'a>,
        mut act: impl FnMut(usize, &dyn Emitter, &Evaluation<'a>),
    ) {
        self.each_with_its(at.carried, |line, emitter, carried| {
            act(line, emitter, &Evaluation { carried, ..*at });
        });
    }

    /// The line of every emitter, the emitter, and its part of what a method carried.
    fn each_with_its<'c>(
        &self,
        carried: Option<&'c [f64]>,
        mut act: impl FnMut(usize, &dyn Emitter, Option<&'c [f64]>),
    ) {
        let mut rest = carried;
        for (line, emitter) in self.emitters().enumerate() {
            act(line, emitter, its_part(&mut rest, emitter));
        }
    }

    /// How many terms the projection of an evaluation makes a difference to.
    pub fn count_projected(&self, at: &Evaluation<'_>) -> usize {
        let mut count = 0;
        self.each_with_carried(at, |_, emitter, at| count += emitter.count_projected(at));
        count
    }
}
