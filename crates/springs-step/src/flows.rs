//! What dashpots, moving anchors and loads take and give in a step.

use crate::{Archive, State};
use nalgebra::Vector3;
use springs_assembly::{Lines, System};

/// Work of each anchor and each load of a [`System`], in J.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockWorks {
    /// Of each fixed block, in their order; empty as long as none moves.
    pub anchors: Vec<f64>,
    /// Of each load ([`System::n_loads`]); empty as long as there is none.
    pub loads: Vec<f64>,
}

impl BlockWorks {
    pub(crate) fn clear(&mut self) {
        self.anchors.fill(0.0);
        self.loads.fill(0.0);
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.anchors.clone_from(&other.anchors);
        self.loads.clone_from(&other.loads);
    }

    /// Adds those of others, times a factor.
    pub(crate) fn add_times(&mut self, other: &Self, factor: f64) {
        add_times(&mut self.anchors, &other.anchors, factor);
        add_times(&mut self.loads, &other.loads, factor);
    }

    pub(crate) fn scale(&mut self, factor: f64) {
        let all = self.anchors.iter_mut().chain(&mut self.loads);
        all.for_each(|work| *work *= factor);
    }

    /// Room for the anchors of a system.
    pub(crate) fn with_anchors(&mut self, system: &System) -> &mut [f64] {
        let n_fixed = system.numbering().n_nodes() - system.n_free();
        self.anchors.resize(n_fixed, 0.0);
        &mut self.anchors
    }

    /// Room for its loads.
    pub(crate) fn with_loads(&mut self, system: &System) -> &mut [f64] {
        self.loads.resize(system.n_loads(), 0.0);
        &mut self.loads
    }

    pub(crate) fn archive(&mut self, system: &System, archive: &mut Archive) {
        let n_fixed = system.numbering().n_nodes() - system.n_free();
        archive.reals_or_none(&mut self.anchors, n_fixed);
        archive.reals_or_none(&mut self.loads, system.n_loads());
    }
}

/// Adds numbers times a factor to as many others; to none as if these were zero.
fn add_times(sums: &mut Vec<f64>, numbers: &[f64], factor: f64) {
    if sums.len() < numbers.len() {
        sums.resize(numbers.len(), 0.0);
    }
    for (sum, number) in sums.iter_mut().zip(numbers) {
        *sum += number * factor;
    }
}

/// Energy that left or entered in a step, in J, through what acts on free nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flows {
    /// Heat produced by the damping forces of each emitter.
    pub heat: Lines,
    /// Work done by moving anchors and loads.
    pub works: BlockWorks,
}

impl Flows {
    /// Work done by moving anchors.
    pub fn anchor_work(&self) -> f64 {
        self.works.anchors.iter().sum()
    }

    /// Work done by loads.
    pub fn load_work(&self) -> f64 {
        self.works.loads.iter().sum()
    }

    pub(crate) fn clear(&mut self) {
        self.heat = Lines::default();
        self.works.clear();
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.heat = other.heat;
        self.works.copy_from(&other.works);
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.heat += other.heat;
        self.works.add_times(&other.works, 1.0);
    }

    /// Adds what flows at one instant in a time `h`, in s; next to nothing to compute in
    /// scenes without damping, moving anchors and loads.
    pub(crate) fn add_powers(
        &mut self,
        system: &System,
        h: f64,
        time: f64,
        (x, v): (&[Vector3<f64>], &[Vector3<f64>]),
    ) {
        self.heat += system.dissipation(x, v) * h;
        if system.any_anchor_moves(v) {
            let anchors = self.works.with_anchors(system);
            system.add_anchor_works(h, x, v, anchors);
            system.add_damping_anchor_works(h, x, v, anchors);
        }
        if system.has_loads() {
            let loads = self.works.with_loads(system);
            system.each_load(time, |load, block, force| {
                loads[load] += h * force.dot(&v[block]);
            });
        }
    }

    pub(crate) fn archive(&mut self, system: &System, archive: &mut Archive) {
        self.heat.iter_mut().for_each(|heat| archive.real(heat));
        self.works.archive(system, archive);
    }

    /// By the trapezoidal rule for forces: for methods that do not say.
    pub(crate) fn trapezoidal(system: &System, [before, after]: [&State; 2], h: f64) -> Self {
        let mut impulses = Impulses::new(system);
        let half = 0.5 * h;
        impulses.begin(system, &before.v);
        impulses.add(system, half, before.time, &before.x, &before.v);
        impulses.add(system, half, before.time + h, &after.x, &after.v);
        impulses.finish(system, &after.v);
        impulses.flows
    }

    /// The part of the flows of a step up to a fraction of it, by the cubic that
    /// has the powers at both ends as its slopes. Where the step does not resolve
    /// what flows, the powers are limited so that the cubic is monotone (Fritsch
    /// and Carlson, SIAM J. Numer. Anal. 17, 1980).
    pub(crate) fn part(&self, system: &System, ends: [&State; 2], h: f64, fraction: f64) -> Self {
        let [start, end] = ends.map(|at| {
            let mut powers = Self::default();
            powers.add_powers(system, h, at.time, (&at.x, &at.v));
            powers
        });
        let cubic = |total: f64, start: f64, end: f64| {
            let limited = |slope: f64| slope.clamp(total.min(0.0) * 3.0, total.max(0.0) * 3.0);
            let (s, rest) = (fraction, 1.0 - fraction);
            let slopes = rest * limited(start) - s * limited(end);
            s * s * (3.0 - 2.0 * s) * total + s * rest * slopes
        };
        let cubics = |totals: &[f64], start: &[f64], end: &[f64]| -> Vec<f64> {
            // None stands for zeros.
            let at = |numbers: &[f64], index: usize| numbers.get(index).copied().unwrap_or(0.0);
            let totals = totals.iter().enumerate();
            let parts = totals.map(|(k, &total)| cubic(total, at(start, k), at(end, k)));
            parts.collect()
        };
        let mut heat = self.heat;
        for (line, heat) in heat.iter_mut().enumerate() {
            *heat = cubic(*heat, start.heat[line], end.heat[line]);
        }
        let [works, start, end] = [&self.works, &start.works, &end.works];
        Self {
            heat,
            works: BlockWorks {
                anchors: cubics(&works.anchors, &start.anchors, &end.anchors),
                loads: cubics(&works.loads, &start.loads, &end.loads),
            },
        }
    }

    /// Adds those of what joins two fixed nodes, which no method moves: exact.
    pub(crate) fn add_between_fixed(
        &mut self,
        system: &System,
        before: &[Vector3<f64>],
        after: &State,
        h: f64,
    ) {
        if system.any_anchor_moves(&after.v) {
            let works = self.works.with_anchors(system);
            self.heat += system.add_works_between_fixed(before, &after.x, h, works);
        }
    }
}

/// The impulses that a method gives in a step, and what follows from them.
///
/// A method of order 1 or 2 changes the momentum of a node by Σ bᵢ h fᵢ, with its
/// own weights bᵢ and the forces fᵢ of its stages. The kinetic energy then
/// changes by exactly that impulse times the mean of the velocities before and
/// after. So the impulses of damping forces times these mean velocities are the
/// energy that they took, and the impulses on an anchor times its velocity the work
/// that it did, whether the step resolves them or not.
pub(crate) struct Impulses {
    /// Velocities of all blocks at the start of the step, in m/s, where anything is
    /// damped or loaded.
    start: Vec<Vector3<f64>>,
    /// Of each damped emitter.
    damping: Vec<Damping>,
    /// Of each force that loads bring, in their order.
    loads: Vec<LoadImpulse>,
    /// Of the step: works of anchors, and of loads kick by kick, as far as they are added;
    /// all of them when it is [finished](Self::finish).
    flows: Flows,
    anchors_move: bool,
}

/// What the damping forces of an emitter give to all blocks.
struct Damping {
    line: usize,
    /// In N, where they were last evaluated.
    forces: Vec<Vector3<f64>>,
    /// In N·s.
    impulses: Vec<Vector3<f64>>,
}

/// The impulse of a load on a block.
struct LoadImpulse {
    load: u32,
    block: u32,
    /// In N·s.
    impulse: Vector3<f64>,
}

impl Impulses {
    pub(crate) fn new(system: &System) -> Self {
        let zeros = |are_needed: bool| {
            let n_blocks = system.numbering().n_nodes();
            vec![Vector3::zeros(); if are_needed { n_blocks } else { 0 }]
        };
        let damping = system.damped().map(|(line, _)| Damping {
            line,
            forces: zeros(true),
            impulses: zeros(true),
        });
        let mut loads = Vec::new();
        system.each_load(0.0, |load, block, _| {
            loads.push(LoadImpulse {
                load: load as u32,
                block: block as u32,
                impulse: Vector3::zeros(),
            });
        });
        let mut flows = Flows::default();
        flows.works.with_loads(system);
        Self {
            damping: damping.collect(),
            start: zeros(system.is_damped() || !loads.is_empty()),
            loads,
            flows,
            anchors_move: false,
        }
    }

    /// Begins a step with the velocities `v`.
    pub(crate) fn begin(&mut self, system: &System, v: &[Vector3<f64>]) {
        let n_blocks = self.start.len();
        self.start.copy_from_slice(&v[..n_blocks]);
        for load in &mut self.loads {
            load.impulse = Vector3::zeros();
        }
        for damping in &mut self.damping {
            damping.impulses.fill(Vector3::zeros());
        }
        self.flows.clear();
        self.anchors_move = system.any_anchor_moves(v);
    }

    /// Whether anchors do work.
    pub(crate) fn anchors_move(&self) -> bool {
        self.anchors_move
    }

    /// Forces at a state and a time in s act for a time `weight` = bᵢ h, in s.
    pub(crate) fn add(
        &mut self,
        system: &System,
        weight: f64,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        self.add_loads(system, weight, time);
        self.add_damping(system, weight, x, v);
        self.add_anchor_works(system, weight, x, v);
    }

    /// Works of anchors against forces that depend on positions alone.
    pub(crate) fn add_anchor_works(
        &mut self,
        system: &System,
        weight: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        if self.anchors_move {
            system.add_anchor_works(weight, x, v, self.anchor_works(system));
        }
    }

    /// Those that damp alone.
    pub(crate) fn add_damping(
        &mut self,
        system: &System,
        weight: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        self.evaluate_damping(system, x, v);
        self.add_evaluated(weight);
    }

    /// Evaluates forces that damp, to be [added](Self::add_evaluated).
    pub(crate) fn evaluate_damping(
        &mut self,
        system: &System,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        let n_free = system.n_free();
        for ((_, emitter), damping) in system.damped().zip(&mut self.damping) {
            damping.forces.fill(Vector3::zeros());
            let (free, fixed) = damping.forces.split_at_mut(n_free);
            emitter.add_damping_forces(x, v, free);
            emitter.add_damping_reactions(x, v, fixed);
        }
    }

    /// Those of the last evaluation on all blocks, in N, of one damped emitter after the
    /// other.
    pub(crate) fn evaluated(&self) -> impl Iterator<Item = &[Vector3<f64>]> {
        self.damping.iter().map(|damping| &damping.forces[..])
    }

    /// The forces that damp of the last evaluation act for a time `weight` = bᵢ h, in s.
    pub(crate) fn add_evaluated(&mut self, weight: f64) {
        for Damping {
            forces, impulses, ..
        } in &mut self.damping
        {
            for (impulse, force) in impulses.iter_mut().zip(forces) {
                *impulse += *force * weight;
            }
        }
    }

    /// Loads alone.
    pub(crate) fn add_loads(&mut self, system: &System, weight: f64, time: f64) {
        if self.loads.is_empty() {
            return;
        }
        let mut loads = self.loads.iter_mut();
        system.each_load(time, |_, _, force| {
            if let Some(load) = loads.next() {
                load.impulse += force * weight;
            }
        });
    }

    /// The work of loads at a time in s during a kick of `weight` in s by the
    /// accelerations `a`, from the velocities `v`: exact, whatever else acts.
    pub(crate) fn add_kick(
        &mut self,
        system: &System,
        weight: f64,
        time: f64,
        (v, a): (&[Vector3<f64>], &[Vector3<f64>]),
    ) {
        if self.loads.is_empty() {
            return;
        }
        let (half, works) = (0.5 * weight, &mut self.flows.works.loads);
        system.each_load(time, |load, block, force| {
            works[load] += weight * force.dot(&(v[block] + a[block] * half));
        });
    }

    /// Works of anchors against forces that depend on positions alone, in J, to be added to:
    /// one for each fixed block.
    pub(crate) fn anchor_works(&mut self, system: &System) -> &mut [f64] {
        self.flows.works.with_anchors(system)
    }

    /// The step ended with the velocities `v`.
    pub(crate) fn finish(&mut self, system: &System, v: &[Vector3<f64>]) {
        let mean = |block: usize| (self.start[block] + v[block]) * 0.5;
        let works = &mut self.flows.works;
        for load in &self.loads {
            works.loads[load.load as usize] += load.impulse.dot(&mean(load.block as usize));
        }
        let n_free = system.n_free();
        for Damping { line, impulses, .. } in &self.damping {
            let blocks = impulses.iter().enumerate();
            let taken = blocks.clone().map(|(k, impulse)| -impulse.dot(&mean(k)));
            self.flows.heat[*line] = taken.sum();
            if self.anchors_move {
                let anchors = works.with_anchors(system).iter_mut();
                for (work, (k, impulse)) in anchors.zip(blocks.skip(n_free)) {
                    *work -= impulse.dot(&mean(k));
                }
            }
        }
    }

    /// Those of the last step.
    pub(crate) fn flows(&self) -> &Flows {
        &self.flows
    }
}
