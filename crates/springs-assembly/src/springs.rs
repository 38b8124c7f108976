//! Springs as emitters.

use crate::anchor_works::share_out;
use crate::connections::Connections;
use crate::linear_runs::LinearRuns;
use crate::matrix::{PairBlock, times};
use crate::run::Run;
use crate::segments::{Segment, Segments};
use crate::sums::{Linearized, Sums};
use crate::{
    BrokenSpring, Emitter, Evaluation, Linearization, MemoryUpdate, Nature, Notable, Numbering,
    OwnStiffness, PACKED, Projection, SpringNumbers, StiffnessKind, Strained,
};
use nalgebra::Vector3;
use springs_math::Separation;
use springs_math::spring::{self, LengthLaw, Spring};

/// The packed identity.
const IDENTITY: [f64; 6] = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];

/// Springs between two nodes each, with laws of one kind. Each carries its tension
/// along where a method wants it.
#[derive(Clone, Debug)]
pub struct Springs<L = Spring> {
    name: String,
    connections: Connections,
    laws: Vec<L>,
    /// Index of each in the list that they were made from.
    index: Vec<usize>,
    merged: Vec<Merged>,
    stiffness: StiffnessKind,
    /// A copy of the numbers of those in runs, if all are linear.
    linear_runs: Option<LinearRuns>,
}

/// A spring of the list that became part of another one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merged {
    /// That other one, in the order of the springs.
    pub(crate) into: usize,
    /// Its own index in the list.
    pub(crate) index: usize,
    /// Its part of the stiffness.
    pub(crate) share: f64,
}

/// A spring between two nodes of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringBetween<L> {
    /// The nodes.
    pub nodes: [usize; 2],
    /// Its law.
    pub law: L,
}

impl<L: LengthLaw + Clone> Springs<L> {
    /// Springs with laws of any kind; `name` is their line in the energy ledger.
    pub fn new(name: &str, springs: &[SpringBetween<L>]) -> Self {
        Self {
            name: name.to_owned(),
            connections: Connections::between(springs.iter().map(|spring| spring.nodes)),
            laws: springs.iter().map(|spring| spring.law.clone()).collect(),
            index: (0..springs.len()).collect(),
            merged: Vec::new(),
            stiffness: StiffnessKind::Variable,
            linear_runs: None,
        }
    }

    /// Notes the numbers of springs in runs, where the forces of all are as linear springs
    /// give them.
    fn note_runs(&mut self) {
        self.linear_runs = None;
        let are_linear = self.laws.iter().all(|law| law.as_linear().is_some());
        if are_linear && self.stiffness != StiffnessKind::Isotropic {
            let law = |index: usize| self.laws[index].as_linear().expect("all are");
            let connections = &self.connections;
            let numbers = LinearRuns::new(connections.runs(), connections.ends(), law);
            self.linear_runs = Some(numbers);
        }
    }

    /// The same, with the index of each in the list that they were made from.
    pub(crate) fn with_index(name: &str, springs: &[SpringBetween<L>], index: Vec<usize>) -> Self {
        assert_eq!(index.len(), springs.len(), "one for each");
        Self {
            index,
            ..Self::new(name, springs)
        }
    }

    /// The tension that a method carried, or that at `x`, in N.
    fn tension(&self, index: usize, x: &[Vector3<f64>], carried: Option<&[f64]>) -> f64 {
        match carried.filter(|_| index < self.connections.live().end) {
            Some(carried) => carried[index],
            None => self.tension_and_length(index, x).0,
        }
    }

    /// What every spring with a free end gives along and across, with carried tensions, in
    /// N, in place of those at `x`; springs of no length, which have no direction, are left out.
    fn each_along_and_across(
        &self,
        x: &[Vector3<f64>],
        carried: &[f64],
        mut visit: impl FnMut(usize, AlongAndAcross),
    ) {
        for index in self.connections.live() {
            let separation = Separation::of(&self.connections.difference(index, x));
            if separation.length > 0.0 {
                let law = &self.laws[index];
                let tension_per_length = carried[index] / separation.length;
                let along_and_across = AlongAndAcross {
                    separation,
                    stiffness: law.stiffness(separation.length),
                    tension_per_length: tension_per_length.min(law.largest_stiffness()),
                };
                visit(index, along_and_across);
            }
        }
    }

    /// Number of springs.
    fn len(&self) -> usize {
        self.laws.len()
    }

    /// Tension and length of a spring, in N and m.
    #[inline(always)]
    fn tension_and_length(&self, index: usize, x: &[Vector3<f64>]) -> (f64, f64) {
        let length = Separation::of(&self.connections.difference(index, x)).length;
        (self.laws[index].tension(length), length)
    }

    /// The force on the first end.
    #[inline(always)]
    fn force(&self, index: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        let dx = self.connections.difference(index, x);
        if self.stiffness == StiffnessKind::Isotropic {
            dx * self.laws[index].largest_stiffness()
        } else {
            spring::force(&self.laws[index], &Vector3::zeros(), &dx)
        }
    }

    fn energy_of(&self, index: usize, x: &[Vector3<f64>]) -> f64 {
        self.laws[index].energy(Separation::of(&self.connections.difference(index, x)).length)
    }

    /// Hands over the part that each spring of the list has in what a spring gives.
    fn each_part(&self, visit: &mut dyn FnMut(usize, f64), of: impl Fn(usize) -> f64) {
        let n_shared = if self.merged.is_empty() {
            0
        } else {
            self.len()
        };
        let mut own_shares = vec![1.0; n_shared];
        for part in &self.merged {
            own_shares[part.into] -= part.share;
            visit(part.index, part.share * of(part.into));
        }
        for (index, &spring) in self.index.iter().enumerate() {
            let share = own_shares.get(index).copied().unwrap_or(1.0);
            visit(spring, share * of(index));
        }
    }

    /// The block of a spring as linearized at `at`, without weight.
    fn block(&self, index: usize, at: &Evaluation<'_>) -> [f64; 6] {
        let dx = self.connections.difference(index, at.x);
        let given = at.carried.map(|tensions| tensions[index]);
        let projection = at.projection_at(self.connections.free_ends(index));
        spring::linearize(&self.laws[index], given, &dx, |across| {
            projection.apply(across)
        })
        .1
    }

    fn linearize_with<P: PairBlock>(
        &self,
        segment: &Segment,
        project: impl Fn(usize, f64) -> f64 + Copy,
        at: &Evaluation<'_>,
        sums: &mut Sums<'_, P>,
    ) {
        let weight = at.weights.stiffness;
        for index in segment
            .live(self.linear_runs.is_some())
            .into_iter()
            .flatten()
        {
            let dx = self.connections.difference(index, at.x);
            let (force, block) = spring::linearize(
                &self.laws[index],
                at.carried.map(|tensions| tensions[index]),
                &dx,
                |across| project(index, across),
            );
            let block = block.map(|entry| weight * entry);
            self.add_linearized(index, force, &block, at, sums);
        }
    }

    /// Forces, and the block K·I of every spring, whatever its state.
    fn linearize_isotropic<P: PairBlock>(
        &self,
        segment: &Segment,
        at: &Evaluation<'_>,
        sums: &mut Sums<'_, P>,
    ) {
        let weight = at.weights.stiffness;
        for index in segment.live(false).into_iter().flatten() {
            let force = self.force(index, at.x);
            let stiffness = weight * self.laws[index].largest_stiffness();
            let block = IDENTITY.map(|entry| stiffness * entry);
            self.add_linearized(index, force, &block, at, sums);
        }
    }

    #[inline(always)]
    fn add_linearized<P: PairBlock>(
        &self,
        index: usize,
        force: Vector3<f64>,
        block: &[f64; 6],
        at: &Evaluation<'_>,
        sums: &mut Sums<'_, P>,
    ) {
        let forces = (sums.first_block, &mut *sums.forces);
        self.connections.add_force(index, force, forces);
        self.connections.add_block(index, block, at.v, sums);
    }
}

impl<L: LengthLaw + Clone + Send + Sync> Springs<L> {
    /// What is in runs, where their kernels can be used.
    fn plain_runs(&self, at: &Evaluation<'_>) -> Option<&LinearRuns> {
        let is_plain = at.carried.is_none() && at.projected.is_none();
        self.linear_runs.as_ref().filter(|_| is_plain)
    }

    /// Adds products, in runs by what does that if there is something, and spring by spring
    /// elsewhere.
    fn add_products_with(
        &self,
        in_runs: Option<impl Fn(&[Run], (usize, &mut [Vector3<f64>])) + Send + Sync>,
        at: &Evaluation<'_>,
        y: &[Vector3<f64>],
        products: &mut [Vector3<f64>],
    ) {
        let (runs, weight) = (self.connections.runs(), at.weights.stiffness);
        let work = |segment: &Segment, first: usize, products: &mut [Vector3<f64>]| {
            if let Some(add) = &in_runs {
                add(&runs[segment.runs.clone()], (first, products));
            }
            for index in segment.live(in_runs.is_some()).into_iter().flatten() {
                let (block, products) = (self.block(index, at), (first, &mut *products));
                self.connections
                    .add_product(index, &block, weight, y, products);
            }
        };
        self.connections.segments().add_up(products, work);
    }
}

/// What a spring gives along itself and across, in N/m.
struct AlongAndAcross {
    separation: Separation<3>,
    /// Along.
    stiffness: f64,
    /// T/l, across.
    tension_per_length: f64,
}

/// Springs as linearized at some state.
struct At<'a, L> {
    springs: &'a Springs<L>,
    at: &'a Evaluation<'a>,
}

impl<L: LengthLaw + Clone + Send + Sync> Linearized for At<'_, L> {
    fn segments(&self) -> &Segments {
        self.springs.connections.segments()
    }

    fn add_to<P: PairBlock>(&self, segment: &Segment, sums: &mut Sums<'_, P>) {
        let Self { springs, at } = *self;
        let is_isotropic = springs.stiffness == StiffnessKind::Isotropic;
        if is_isotropic && at.projection != Projection::Drop && at.carried.is_none() {
            return springs.linearize_isotropic(segment, at, sums);
        }
        let connections = &springs.connections;
        if let Some(numbers) = &springs.linear_runs {
            let runs = &connections.runs()[segment.runs.clone()];
            numbers.linearize((runs, connections.pairs()), at, sums);
        }
        if at.projected.is_some() {
            let project = |index: usize, across: f64| {
                let projection = at.projection_at(connections.free_ends(index));
                projection.apply(across)
            };
            return springs.linearize_with(segment, project, at, sums);
        }
        // One loop for each, without a choice inside.
        use Projection::{Absolute, Clamp, Drop, None};
        match at.projection {
            None => springs.linearize_with(segment, |_, across| None.apply(across), at, sums),
            Clamp => springs.linearize_with(segment, |_, across| Clamp.apply(across), at, sums),
            Absolute => {
                springs.linearize_with(segment, |_, across| Absolute.apply(across), at, sums);
            }
            Drop => springs.linearize_with(segment, |_, across| Drop.apply(across), at, sums),
        }
    }
}

#[cfg(test)]
impl<L> Springs<L> {
    /// The same, worked off one by one.
    pub(crate) fn one_by_one(self) -> Self {
        Self {
            linear_runs: None,
            ..self
        }
    }

    pub(crate) fn connections(&self) -> &Connections {
        &self.connections
    }

    /// The other ends of all springs at a block.
    pub(crate) fn connections_of(&self, block: usize) -> Vec<u32> {
        let ends = self.connections.ends().iter();
        let here = ends.filter(|ends| ends.contains(&(block as u32)));
        here.flatten().copied().collect()
    }
}

impl Springs<Spring> {
    /// The linear springs of a scene that have a stiffness, with their indices there,
    /// and those that became part of one of them.
    pub(crate) fn of_scene(
        springs: &[SpringBetween<Spring>],
        index: Vec<usize>,
        merged: Vec<Merged>,
    ) -> Self {
        Self {
            merged,
            stiffness: StiffnessKind::ConstantAlongLines,
            ..Self::with_index("elastic", springs, index)
        }
    }

    /// Where the rest lengths of all springs with a free end are zero, the Hessian of
    /// each is K·I, which methods may rely on.
    pub(crate) fn find_isotropy(&mut self) {
        let mut live = self.connections.live();
        if live.all(|index| self.laws[index].rest_length == 0.0) {
            self.stiffness = StiffnessKind::Isotropic;
            self.note_runs();
        }
    }
}

impl<L: LengthLaw + Clone + Send + Sync + 'static> Emitter for Springs<L> {
    fn name(&self) -> &str {
        &self.name
    }

    fn nature(&self) -> Nature {
        Nature {
            n_terms: self.len(),
            n_merged: self.merged.len(),
            stiffness: if self.laws.is_empty() {
                StiffnessKind::None
            } else {
                self.stiffness
            },
            is_constant: false,
            is_load: false,
            is_damped: false,
            is_central: true,
            has_symmetric_blocks: true,
        }
    }

    fn number(&mut self, numbering: &Numbering) {
        let order = self.connections.number(numbering);
        self.laws = order
            .iter()
            .map(|&index| self.laws[index].clone())
            .collect();
        self.index = order.iter().map(|&index| self.index[index]).collect();
        let mut place = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            place[old] = new;
        }
        for part in &mut self.merged {
            part.into = place[part.into];
        }
        self.note_runs();
    }

    fn each_stencil(&self, visit: &mut dyn FnMut(&[u32])) {
        self.connections.each_stencil(visit);
    }

    fn place(&mut self, pairs: &[u32]) {
        self.connections.place(pairs);
    }

    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let between_fixed = self.connections.between_fixed();
        let between_fixed = between_fixed.map(|index| self.energy_of(index, x));
        self.energy_on_free_blocks(x) + between_fixed.sum::<f64>()
    }

    fn energy_on_free_blocks(&self, x: &[Vector3<f64>]) -> f64 {
        let runs = self.connections.runs();
        self.connections.segments().sum(|segment| {
            let numbers = self.linear_runs.as_ref();
            let runs = &runs[segment.runs.clone()];
            let along_runs = numbers.map_or(0.0, |numbers| numbers.energy(runs, x));
            let one_by_one = segment.live(numbers.is_some()).into_iter().flatten();
            along_runs
                + one_by_one
                    .map(|index| self.energy_of(index, x))
                    .sum::<f64>()
        })
    }

    fn add_forces(&self, x: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        let runs = self.connections.runs();
        let work = |segment: &Segment, first: usize, forces: &mut [Vector3<f64>]| {
            let numbers = self.linear_runs.as_ref();
            if let Some(numbers) = numbers {
                numbers.add_forces(&runs[segment.runs.clone()], x, (first, forces));
            }
            for index in segment.live(numbers.is_some()).into_iter().flatten() {
                let force = self.force(index, x);
                self.connections.add_force(index, force, (first, forces));
            }
        };
        self.connections.segments().add_up(forces, work);
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        out.add(&At { springs: self, at });
    }

    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]) {
        let numbers = self.plain_runs(at);
        let add_in_runs = numbers.map(|numbers| {
            let factors = (at.projection, at.weights.stiffness);
            move |runs: &[Run], (first, products): (usize, &mut [Vector3<f64>])| {
                numbers.add_products(runs, at.x, factors, y, (first, products));
            }
        });
        self.add_products_with(add_in_runs, at, y, products);
    }

    fn prepare_products(&self, at: &Evaluation<'_>, numbers: &mut Vec<f64>) {
        let begin = numbers.len();
        if let Some(in_runs) = self.plain_runs(at) {
            let factors = (at.projection, at.weights.stiffness);
            if !in_runs.prepare(self.connections.runs(), at.x, factors, numbers) {
                numbers.truncate(begin);
            }
        }
    }

    fn add_prepared_products(
        &self,
        at: &Evaluation<'_>,
        numbers: &[f64],
        y: &[Vector3<f64>],
        products: &mut [Vector3<f64>],
    ) {
        let in_runs = self.linear_runs.as_ref().filter(|_| !numbers.is_empty());
        let Some(in_runs) = in_runs else {
            return self.add_products(at, y, products);
        };
        let add_in_runs = |runs: &[Run], (first, products): (usize, &mut [Vector3<f64>])| {
            in_runs.add_prepared(runs, numbers, y, (first, products));
        };
        self.add_products_with(Some(add_in_runs), at, y, products);
    }

    fn add_stiffness_bounds(&self, bounds: &mut [f64]) {
        let stiffnesses = self.laws.iter().map(LengthLaw::largest_stiffness);
        self.connections.add_to_ends(stiffnesses, bounds);
    }

    fn add_anchor_works(&self, h: f64, x: &[Vector3<f64>], v: &[Vector3<f64>], works: &mut [f64]) {
        let force = |index| self.force(index, x) * h;
        self.connections.add_anchor_works(force, v, works);
    }

    fn add_anchor_work_changes(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], works: &mut [f64]) {
        let force = |index| {
            let difference = self.connections.difference(index, y);
            times(&self.block(index, at), &difference) * at.weights.stiffness
        };
        self.connections.add_anchor_works(force, at.v, works);
    }

    /// (T₀ + T₁)/2·(l₁ − l₀) of each, which for the linear law is the exact change of
    /// energy, without the rounding of a difference of energies.
    fn add_works_between_fixed(
        &self,
        start: &[Vector3<f64>],
        end: &[Vector3<f64>],
        _h: f64,
        works: &mut [f64],
    ) -> f64 {
        let is_linear = self.stiffness != StiffnessKind::Variable;
        for index in self.connections.between_fixed() {
            let ways = self.connections.ways(index, start, end);
            if ways == [Vector3::zeros(); 2] {
                continue;
            }
            let [before, after] = [start, end].map(|x| self.connections.difference(index, x));
            let work = if is_linear {
                let [(t0, l0), (t1, l1)] = [start, end].map(|x| self.tension_and_length(index, x));
                // l₁² − l₀² over l₁ + l₀, without the rounding of a difference of lengths.
                let stretch =
                    (after - before).dot(&(after + before)) / (l0 + l1).max(f64::MIN_POSITIVE);
                0.5 * (t0 + t1) * stretch
            } else {
                self.energy_of(index, end) - self.energy_of(index, start)
            };
            let forces = |place: f64| {
                let dx = before.lerp(&after, place);
                let force = spring::force(&self.laws[index], &Vector3::zeros(), &dx);
                [force, -force]
            };
            let shares = share_out(work, ways, forces);
            self.connections.add_to_fixed(index, shares, works);
        }
        0.0
    }

    fn n_carried(&self) -> usize {
        self.len()
    }

    fn each_carried_term(&self, visit: &mut dyn FnMut(&[u32], f64)) {
        for (index, law) in self.laws.iter().enumerate() {
            visit(self.connections.free_ends(index), law.largest_stiffness());
        }
    }

    fn add_own_stiffness(&self, x: &[Vector3<f64>], carried: &[f64], own: &mut [OwnStiffness]) {
        self.each_along_and_across(x, carried, |index, spring| {
            let u = spring.separation.direction;
            let projection = PACKED.map(|(row, column)| u[row] * u[column]);
            let along = spring.stiffness.max(0.0);
            let across = spring.tension_per_length.max(0.0);
            for &block in self.connections.free_ends(index) {
                let own = &mut own[block as usize];
                for entry in 0..6 {
                    own.along[entry] += along * projection[entry];
                    own.across[entry] += across * (IDENTITY[entry] - projection[entry]);
                }
            }
        });
    }

    /// A spring whose ends pass each other with v⊥ turns by v⊥/l a second, and K u uᵀ and
    /// T/l (I − u uᵀ) with it: (K − T/l) v⊥²/l along u.
    fn add_turning_forces(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        carried: &[f64],
        scale: f64,
        forces: &mut [Vector3<f64>],
    ) {
        self.each_along_and_across(x, carried, |index, spring| {
            let Separation { length, direction } = spring.separation;
            let speed = self.connections.difference(index, v);
            let passing = speed - direction * direction.dot(&speed);
            let stiffness = spring.stiffness - spring.tension_per_length;
            let force = direction * (scale * stiffness * passing.norm_squared() / length);
            let ends = self.connections.ends()[index];
            forces[ends[0] as usize] += force;
            forces[ends[1] as usize] -= force;
        });
    }

    fn part(&self, numbering: &Numbering, kept: &[bool]) -> Option<(Box<dyn Emitter>, Vec<u32>)> {
        let kept: Vec<usize> = self
            .connections
            .live()
            .filter(|&index| kept[index])
            .collect();
        let ends = self.connections.ends();
        let springs = kept.iter().map(|&index| SpringBetween {
            nodes: ends[index].map(|block| numbering.node(block as usize)),
            law: self.laws[index].clone(),
        });
        let springs: Vec<_> = springs.collect();
        let mut part = Self {
            stiffness: self.stiffness,
            ..Self::with_index(&self.name, &springs, kept)
        };
        part.number(numbering);
        let of_whole = part.index.iter().map(|&index| index as u32).collect();
        Some((Box::new(part), of_whole))
    }

    fn add_forces_on_all(
        &self,
        x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _n_free: usize,
        carried: Option<&[f64]>,
        forces: &mut [Vector3<f64>],
    ) {
        for (index, ends) in self.connections.ends().iter().enumerate() {
            let direction = Separation::of(&self.connections.difference(index, x)).direction;
            let force = direction * self.tension(index, x, carried);
            forces[ends[0] as usize] += force;
            forces[ends[1] as usize] -= force;
        }
    }

    fn each_tension(
        &self,
        x: &[Vector3<f64>],
        carried: Option<&[f64]>,
        visit: &mut dyn FnMut(usize, f64),
    ) {
        self.each_part(visit, |index| self.tension(index, x, carried));
    }

    fn each_energy(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(usize, f64)) {
        self.each_part(visit, |index| self.energy_of(index, x));
    }

    fn change_springs(&mut self, springs: &[SpringNumbers]) {
        for (law, &index) in self.laws.iter_mut().zip(&self.index) {
            law.set_spring(springs[index].spring);
        }
        self.note_runs();
    }

    fn has_memory(&self) -> bool {
        self.laws.iter().any(LengthLaw::has_memory)
    }

    fn update_memory(
        &mut self,
        x: &[Vector3<f64>],
        carried: Option<&[f64]>,
        update: &mut MemoryUpdate,
    ) {
        let n_live = self.connections.live().end;
        for index in 0..self.len() {
            let length = Separation::of(&self.connections.difference(index, x)).length;
            let carried = carried.filter(|_| index < n_live);
            let law = &mut self.laws[index];
            let was_broken = law.is_broken();
            let energy = law.update_memory(length, carried.map(|carried| carried[index]));
            if law.is_broken() && !was_broken {
                let spring = self.index[index];
                update.broken.push(BrokenSpring { spring, energy });
                update.is_abrupt = true;
            } else {
                update.other_energy += energy;
            }
        }
    }

    fn each_breaking(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(&[u32], f64)) {
        for (index, law) in self.laws.iter().enumerate() {
            let (tension, length) = self.tension_and_length(index, x);
            if LengthLaw::would_break(law, length) {
                visit(self.connections.free_ends(index), tension);
            }
        }
    }

    fn each_memory(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        for law in &mut self.laws {
            law.each_memory(visit);
        }
    }

    fn each_broken(&self, visit: &mut dyn FnMut(usize)) {
        let springs = self.index.iter().zip(&self.laws);
        let broken = springs.filter(|(_, law)| law.is_broken());
        let mut broken: Vec<usize> = broken.map(|(&spring, _)| spring).collect();
        broken.sort_unstable();
        broken.into_iter().for_each(visit);
    }

    fn each_yielded(&self, visit: &mut dyn FnMut(usize, f64)) {
        for (&spring, law) in self.index.iter().zip(&self.laws) {
            let elongation = LengthLaw::elongation(law);
            if elongation != 0.0 {
                visit(spring, elongation);
            }
        }
    }

    fn clear_broken(&self, carried: &mut [f64]) {
        let broken = carried.iter_mut().zip(&self.laws);
        let broken = broken.filter(|(_, law)| law.is_broken());
        broken.for_each(|(carried, _)| *carried = 0.0);
    }

    /// Tensions of the springs with a free end, in N; zero for the rest.
    fn carried(&self, x: &[Vector3<f64>], tensions: &mut [f64]) {
        assert_eq!(tensions.len(), self.len(), "one entry per spring");
        for index in self.connections.live() {
            tensions[index] = self.tension_and_length(index, x).0;
        }
    }

    /// The tension at `x` plus the stiffness times the linear change of the length.
    fn predict_carried(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        h: f64,
        tensions: &mut [f64],
    ) {
        assert_eq!(tensions.len(), self.len(), "one entry per spring");
        for index in self.connections.live() {
            let Separation { length, direction } =
                Separation::of(&self.connections.difference(index, x));
            let change = h * direction.dot(&self.connections.difference(index, v));
            let law = &self.laws[index];
            tensions[index] = law.tension(length) + law.stiffness(length) * change;
        }
    }

    fn count_projected(&self, at: &Evaluation<'_>) -> usize {
        let is_projected = |index: &usize| {
            let (own, length) = self.tension_and_length(*index, at.x);
            let tension = at.carried.map_or(own, |carried| carried[*index]);
            let law = &self.laws[*index];
            let is_negative = tension < 0.0 && length > 0.0 || law.stiffness(length) < 0.0;
            is_negative && at.projection_at(self.connections.free_ends(*index)) != Projection::None
        };
        self.connections.live().filter(is_projected).count()
    }

    fn energy_beyond(&self, notable: Notable, x: &[Vector3<f64>]) -> f64 {
        let energy = |index: usize| {
            let (_, length) = self.tension_and_length(index, x);
            let rest_length = self.laws[index].rest_length();
            if notable.contains(length, rest_length) {
                self.laws[index].energy(length)
            } else {
                0.0
            }
        };
        (0..self.len()).map(energy).sum()
    }

    /// Σ K(ε‖x‖)², with the largest coordinate of the ends of each spring.
    fn energy_of_rounding(&self, x: &[Vector3<f64>]) -> f64 {
        let energy = |index: usize| {
            let [a, b] = self.connections.ends()[index].map(|block| x[block as usize].amax());
            let (_, length) = self.tension_and_length(index, x);
            self.laws[index].stiffness(length) * (f64::EPSILON * a.max(b)).powi(2)
        };
        (0..self.len()).map(energy).sum()
    }

    fn most_strained_at(&self, block: usize, x: &[Vector3<f64>]) -> Option<Strained> {
        let ends = self.connections.ends();
        let here = |index: &usize| ends[*index].contains(&(block as u32));
        let strained = self.connections.live().filter(here).map(|index| {
            let (tension, length) = self.tension_and_length(index, x);
            Strained {
                spring: self.index[index],
                tension,
                length,
                stiffness: self.laws[index].stiffness(length),
            }
        });
        strained.max_by(|a, b| a.tension.abs().total_cmp(&b.tension.abs()))
    }
}
