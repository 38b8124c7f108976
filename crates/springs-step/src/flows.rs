//! What dashpots and moving anchors take and give in a step.

use crate::{Archive, State};
use nalgebra::Vector3;
use springs_assembly::{Lines, System};
use std::ops::{Add, AddAssign};

/// Energy that left or entered in a step, in J, through what acts on free nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flows {
    /// Heat produced by the damping forces of each emitter.
    pub heat: Lines,
    /// Work done by moving anchors.
    pub anchor_work: f64,
    /// Work done by loads.
    pub load_work: f64,
}

impl Add for Flows {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            heat: self.heat + other.heat,
            anchor_work: self.anchor_work + other.anchor_work,
            load_work: self.load_work + other.load_work,
        }
    }
}

impl AddAssign for Flows {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Flows {
    /// Heat and anchor power at one instant, in W; next to nothing to compute in
    /// scenes without damping and moving anchors.
    pub(crate) fn powers(
        system: &System,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) -> Self {
        let load_work = if system.has_loads() {
            let mut loads = vec![Vector3::zeros(); system.n_free()];
            system.add_loads(time, &mut loads);
            work_on(&loads, v)
        } else {
            0.0
        };
        Self {
            heat: system.dissipation(x, v),
            anchor_work: system.anchor_power(x, v) + system.damping_anchor_power(x, v),
            load_work,
        }
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        self.heat.iter_mut().for_each(|heat| archive.real(heat));
        archive.real(&mut self.anchor_work);
        archive.real(&mut self.load_work);
    }

    /// The same flows at another rate, or over another time.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            heat: self.heat * factor,
            anchor_work: self.anchor_work * factor,
            load_work: self.load_work * factor,
        }
    }

    /// By the trapezoidal rule for forces: for methods that do not say.
    pub(crate) fn trapezoidal(system: &System, [before, after]: [&State; 2], h: f64) -> Self {
        let mut impulses = Impulses::new(system);
        let half = 0.5 * h;
        impulses.begin(system, &before.v);
        impulses.add(system, half, before.time, &before.x, &before.v);
        impulses.add(system, half, before.time + h, &after.x, &after.v);
        impulses.flows(system, &after.v)
    }

    /// The part of the flows of a step up to a fraction of it, by the cubic that
    /// has the powers at both ends as its slopes. Where the step does not resolve
    /// what flows, the powers are limited so that the cubic is monotone (Fritsch
    /// and Carlson, SIAM J. Numer. Anal. 17, 1980).
    pub(crate) fn part(
        self,
        system: &System,
        [before, after]: [&State; 2],
        h: f64,
        fraction: f64,
    ) -> Self {
        let powers = |at: &State| Self::powers(system, at.time, &at.x, &at.v).times(h);
        let [start, end] = [before, after].map(powers);
        let cubic = |total: f64, start: f64, end: f64| {
            let limited = |slope: f64| slope.clamp(total.min(0.0) * 3.0, total.max(0.0) * 3.0);
            let (s, rest) = (fraction, 1.0 - fraction);
            let slopes = rest * limited(start) - s * limited(end);
            s * s * (3.0 - 2.0 * s) * total + s * rest * slopes
        };
        let mut heat = self.heat;
        for (line, heat) in heat.iter_mut().enumerate() {
            *heat = cubic(*heat, start.heat[line], end.heat[line]);
        }
        Self {
            heat,
            anchor_work: cubic(self.anchor_work, start.anchor_work, end.anchor_work),
            load_work: cubic(self.load_work, start.load_work, end.load_work),
        }
    }

    /// Those of what joins two fixed nodes, which no method moves: exact.
    pub(crate) fn between_fixed(
        system: &System,
        before: &[Vector3<f64>],
        after: &State,
        h: f64,
    ) -> Self {
        if !system.any_anchor_moves(&after.v) {
            return Self::default();
        }
        let (heat, anchor_work) = system.between_fixed(before, &after.x, h);
        Self {
            heat,
            anchor_work,
            load_work: 0.0,
        }
    }
}

/// Σ f·v.
pub(crate) fn work_on(forces: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
    forces.iter().zip(v).map(|(f, v)| f.dot(v)).sum()
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
    /// Of the damping forces of each damped emitter on all blocks, in N·s.
    damping: Vec<Damping>,
    /// Of loads on the free blocks, in N·s; empty without any.
    loads: Vec<Vector3<f64>>,
    /// Forces of one emitter on all blocks, in N.
    forces: Vec<Vector3<f64>>,
    /// Work of anchors against other forces, in J.
    work: f64,
    /// Work of loads that was added kick by kick, in J.
    work_of_loads: f64,
    anchors_move: bool,
}

/// Impulses of the damping forces of an emitter.
struct Damping {
    line: usize,
    impulses: Vec<Vector3<f64>>,
}

impl Impulses {
    pub(crate) fn new(system: &System) -> Self {
        let n_blocks = if system.is_damped() || system.has_loads() {
            system.numbering().n_nodes()
        } else {
            0
        };
        let zeros = vec![Vector3::zeros(); n_blocks];
        let n_loaded = if system.has_loads() {
            system.n_free()
        } else {
            0
        };
        let damping = system.damped().map(|(line, _)| Damping {
            line,
            impulses: zeros.clone(),
        });
        Self {
            damping: damping.collect(),
            start: zeros.clone(),
            loads: vec![Vector3::zeros(); n_loaded],
            forces: zeros,
            work: 0.0,
            work_of_loads: 0.0,
            anchors_move: false,
        }
    }

    /// Begins a step with the velocities `v`.
    pub(crate) fn begin(&mut self, system: &System, v: &[Vector3<f64>]) {
        let n_blocks = self.start.len();
        self.start.copy_from_slice(&v[..n_blocks]);
        self.loads.fill(Vector3::zeros());
        for damping in &mut self.damping {
            damping.impulses.fill(Vector3::zeros());
        }
        self.work = 0.0;
        self.work_of_loads = 0.0;
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
        self.add_all_but_loads(system, weight, x, v);
    }

    /// The same without loads.
    pub(crate) fn add_all_but_loads(
        &mut self,
        system: &System,
        weight: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        self.add_damping(system, weight, x, v);
        if self.anchors_move {
            self.add_anchor_work(weight * system.anchor_power(x, v));
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
        let n_free = system.n_free();
        for ((_, emitter), damping) in system.damped().zip(&mut self.damping) {
            self.forces.fill(Vector3::zeros());
            let (free, fixed) = self.forces.split_at_mut(n_free);
            emitter.add_damping_forces(x, v, free);
            emitter.add_damping_reactions(x, v, fixed);
            for (impulse, force) in damping.impulses.iter_mut().zip(&self.forces) {
                *impulse += force * weight;
            }
        }
    }

    /// Loads alone.
    pub(crate) fn add_loads(&mut self, system: &System, weight: f64, time: f64) {
        if self.loads.is_empty() {
            return;
        }
        let forces = &mut self.forces[..self.loads.len()];
        forces.fill(Vector3::zeros());
        system.add_loads(time, forces);
        for (impulse, force) in self.loads.iter_mut().zip(forces) {
            *impulse += *force * weight;
        }
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
        let forces = &mut self.forces[..self.loads.len()];
        forces.fill(Vector3::zeros());
        system.add_loads(time, forces);
        let half = 0.5 * weight;
        for (force, (v, a)) in forces.iter().zip(v.iter().zip(a)) {
            self.work_of_loads += weight * force.dot(&(v + a * half));
        }
    }

    /// Work of anchors against forces that depend on positions alone, in J.
    pub(crate) fn add_anchor_work(&mut self, work: f64) {
        self.work += work;
    }

    /// The flows of the step, which ended with the velocities `v`.
    pub(crate) fn flows(&self, system: &System, v: &[Vector3<f64>]) -> Flows {
        let n_free = system.n_free();
        let mut flows = Flows {
            heat: Lines::default(),
            anchor_work: self.work,
            load_work: self.work_of_loads,
        };
        for (impulse, (before, after)) in self.loads.iter().zip(self.start.iter().zip(v)) {
            flows.load_work += 0.5 * impulse.dot(&(before + after));
        }
        for Damping { line, impulses } in &self.damping {
            let mut taken = 0.0;
            for (impulse, (before, after)) in impulses.iter().zip(self.start.iter().zip(v)) {
                taken -= 0.5 * impulse.dot(&(before + after));
            }
            flows.heat[*line] = taken;
            if self.anchors_move {
                let fixed = impulses.iter().zip(self.start.iter().zip(v)).skip(n_free);
                for (impulse, (before, after)) in fixed {
                    flows.anchor_work -= 0.5 * impulse.dot(&(before + after));
                }
            }
        }
        flows
    }
}
