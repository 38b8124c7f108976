//! Energies of a system, and the work of what holds it.

use super::System;
use crate::{Emitter, Energy, Evaluation, Lines, Notable, Strained};
use nalgebra::Vector3;

impl System {
    /// Mechanical energy, in J.
    pub fn energy(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Energy {
        Energy {
            kinetic: self.kinetic_energy(v),
            potential: self.lines(|emitter| emitter.energy(x)),
        }
    }

    /// A number for each emitter.
    fn lines(&self, mut of: impl FnMut(&dyn Emitter) -> f64) -> Lines {
        let mut lines = Lines::default();
        for (line, emitter) in lines.iter_mut().zip(self.emitters()) {
            *line = of(emitter);
        }
        lines
    }

    /// ½ Σ m v² of the free blocks, in J.
    pub fn kinetic_energy(&self, v: &[Vector3<f64>]) -> f64 {
        let masses_and_velocities = self.masses.iter().zip(v);
        let kinetic = masses_and_velocities.map(|(mass, v)| 0.5 * mass * v.norm_squared());
        kinetic.sum()
    }

    /// Potential energy that forces on free blocks come from, in J.
    pub fn potential_on_free_blocks(&self, x: &[Vector3<f64>]) -> Lines {
        self.lines(|emitter| emitter.energy_on_free_blocks(x))
    }

    /// Potential energy, in J, of terms that are notably strained, and all
    /// of those for which that has no meaning.
    pub fn energy_beyond(&self, notable: Notable, x: &[Vector3<f64>]) -> Lines {
        self.lines(|emitter| emitter.energy_beyond(notable, x))
    }

    /// The energy, in J, that rounding of coordinates is good for.
    pub fn energy_of_rounding(&self, x: &[Vector3<f64>]) -> f64 {
        self.lines(|emitter| emitter.energy_of_rounding(x)).sum()
    }

    /// Heat that damping forces produce, in W.
    pub fn dissipation(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Lines {
        let mut heat = Lines::default();
        for (line, emitter) in self.damped() {
            heat[line] = emitter.dissipation(x, v);
        }
        heat
    }

    /// The largest coordinate, in m, of blocks that something couples with a free one:
    /// what rounding of lengths is in proportion to.
    pub fn largest_coordinate(&self, x: &[Vector3<f64>]) -> f64 {
        let coupled = self.couplings.coupled.iter();
        let coordinates = coupled.map(|&block| x[block as usize].amax());
        coordinates.fold(0.0, f64::max)
    }

    /// The spring that pulls or pushes most at a block.
    pub fn most_strained_at(&self, block: usize, x: &[Vector3<f64>]) -> Option<Strained> {
        let strained = self
            .emitters()
            .filter_map(|emitter| emitter.most_strained_at(block, x));
        strained.max_by(|a, b| a.tension.abs().total_cmp(&b.tension.abs()))
    }

    /// Whether any of the velocities `v` of fixed blocks is not zero, or will not stay so.
    pub fn any_anchor_moves(&self, v: &[Vector3<f64>]) -> bool {
        !self.prescribed.is_empty() || v[self.n_free()..].iter().any(|v| *v != Vector3::zeros())
    }

    /// Adds to `works`, in J, what each fixed block gives in a time `h`, in s, against
    /// forces on it that do not depend on velocities: one entry for each, in their order.
    /// What they do between each other is [`Self::add_works_between_fixed`].
    pub fn add_anchor_works(
        &self,
        h: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        for emitter in self.emitters() {
            emitter.add_anchor_works(h, x, v, works);
        }
    }

    /// The same against damping forces.
    pub fn add_damping_anchor_works(
        &self,
        h: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        for (_, emitter) in self.damped() {
            emitter.add_damping_anchor_works(h, x, v, works);
        }
    }

    /// Hands over the tension, in N, of each spring of the scene that has a stiffness,
    /// in any order: the one that a method [carried](Self::carried), or that at `x`.
    pub fn each_tension(
        &self,
        x: &[Vector3<f64>],
        carried: Option<&[f64]>,
        visit: &mut dyn FnMut(usize, f64),
    ) {
        self.each_with_its(carried, |line, emitter, carried| {
            if line < Lines::OTHERS {
                emitter.each_tension(x, carried, visit);
            }
        });
    }

    /// Hands over the energy, in J, of each spring of the scene that has a stiffness, in any
    /// order.
    pub fn each_energy(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(usize, f64)) {
        for emitter in self.emitters().take(Lines::OTHERS) {
            emitter.each_energy(x, visit);
        }
    }

    /// The forces, in N, that supports must bring up against those of the emitters and
    /// loads at a time in s, by block: all of those on fixed blocks, and the part across
    /// its guide on a guided one. Neither the weight of fixed blocks is among them, nor
    /// what moves them.
    pub fn support_forces(
        &self,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        carried: Option<&[f64]>,
    ) -> Vec<(usize, Vector3<f64>)> {
        let n_free = self.n_free();
        let forces = self.forces_on_all(time, x, v, carried);
        let mut along = forces.clone();
        self.guides.project(&mut along);
        let guided = self.guides.blocks();
        let guided = guided.map(|block| (block, along[block] - forces[block]));
        let fixed = (n_free..forces.len()).map(|block| (block, -forces[block]));
        guided.chain(fixed).collect()
    }

    /// As [`Self::forces`], with the numbers that a method [carried](Self::carried) in place
    /// of those at `x`.
    ///
    /// # Panics
    ///
    /// If `forces` is shorter than the number of free blocks.
    pub fn forces_of_carried(
        &self,
        time: f64,
        (x, v): (&[Vector3<f64>], &[Vector3<f64>]),
        carried: &[f64],
        forces: &mut [Vector3<f64>],
    ) {
        let on_all = self.forces_on_all(time, x, v, Some(carried));
        let forces = &mut forces[..self.n_free()];
        forces.copy_from_slice(&on_all[..self.n_free()]);
        self.guides.project(forces);
    }

    /// Those of all emitters on all blocks, in N.
    fn forces_on_all(
        &self,
        time: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        carried: Option<&[f64]>,
    ) -> Vec<Vector3<f64>> {
        let n_free = self.n_free();
        let mut forces = vec![Vector3::zeros(); self.numbering.n_nodes()];
        self.each_with_its(carried, |_, emitter, carried| {
            emitter.add_forces_on_all(x, v, n_free, carried, &mut forces);
            emitter.add_loads_on_all(time, &mut forces);
        });
        forces
    }

    /// Adds what [`Self::add_anchor_works`] in a time of 1 s changes by when all blocks move
    /// on by `y`, in m, and forces change as linearized at `at`, without its damping.
    pub fn add_anchor_work_changes(
        &self,
        at: &Evaluation<'_>,
        y: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        self.each_with_carried(at, |_, emitter, at| {
            emitter.add_anchor_work_changes(at, y, works);
        });
    }

    /// Adds the work of each fixed block against others, in J, when they go from `start` to
    /// `end` at constant velocities in a time `h`, in s; gives the heat of each emitter, in J.
    pub fn add_works_between_fixed(
        &self,
        start: &[Vector3<f64>],
        end: &[Vector3<f64>],
        h: f64,
        works: &mut [f64],
    ) -> Lines {
        self.lines(|emitter| emitter.add_works_between_fixed(start, end, h, works))
    }
}
