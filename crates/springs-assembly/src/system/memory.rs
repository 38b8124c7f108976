//! What lasts of where a system has been.

use super::{System, its_part};
use crate::{Lines, MemoryUpdate};
use nalgebra::Vector3;

impl System {
    /// Whether anything may [change for good](Self::update_memory).
    pub fn has_memory(&self) -> bool {
        self.has_memory
    }

    /// Changes for good what lasts of having come to `x`, with the numbers that a method
    /// [carried](Self::carried): springs that are beyond their limits break. Those of the
    /// scene are given in its order; what others lost is among the other energy.
    pub fn update_memory(&mut self, x: &[Vector3<f64>], carried: Option<&[f64]>) -> MemoryUpdate {
        let mut update = MemoryUpdate::default();
        let mut rest = carried;
        for (line, emitter) in self.emitters.iter_mut().enumerate() {
            let n_of_scene = update.broken.len();
            let mine = its_part(&mut rest, &**emitter);
            emitter.update_memory(x, mine, &mut update);
            if line >= Lines::OTHERS {
                let others = update.broken.drain(n_of_scene..);
                let lost: f64 = others.map(|broken| broken.energy).sum();
                update.other_energy += lost;
            }
        }
        if !update.broken.is_empty() {
            update.broken.sort_by_key(|broken| broken.spring);
            self.follow_broken();
        }
        update
    }

    /// The largest change of velocity per time, in m/s², that a spring gives a node of it
    /// which it would break at `x`; `None` if none would.
    pub fn jump_at(&self, x: &[Vector3<f64>]) -> Option<f64> {
        let mut jump: Option<f64> = None;
        for emitter in self.emitters() {
            emitter.each_breaking(x, &mut |free_blocks, tension| {
                let masses = free_blocks.iter().map(|&block| self.masses[block as usize]);
                // Massless nodes have no velocity to change.
                let jumps = masses
                    .filter(|&mass| mass > 0.0)
                    .map(|mass| tension.abs() / mass);
                jump = Some(jumps.fold(jump.unwrap_or(0.0), f64::max));
            });
        }
        jump
    }

    /// [`Self::update_memory`] where the scene begins.
    pub(crate) fn break_at_start(&mut self) {
        if self.has_memory {
            let x = std::mem::take(&mut self.initial_positions);
            self.update_memory(&x, None);
            self.initial_positions = x;
        }
    }

    /// Hands over all that lasts, always in the same order, to be saved or replaced.
    pub fn each_memory(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        for emitter in &mut self.emitters {
            emitter.each_memory(visit);
        }
        self.follow_broken();
    }

    /// The springs of the scene that are broken, ascending.
    pub fn broken(&self) -> Vec<usize> {
        let mut broken = Vec::new();
        for emitter in self.emitters().take(Lines::OTHERS) {
            emitter.each_broken(&mut |spring| broken.push(spring));
        }
        broken.sort_unstable();
        broken
    }

    /// The springs of the scene that have yielded, ascending, and by how much, in m.
    pub fn yielded(&self) -> Vec<(usize, f64)> {
        let mut yielded = Vec::new();
        for emitter in self.emitters().take(Lines::OTHERS) {
            emitter.each_yielded(&mut |spring, elongation| yielded.push((spring, elongation)));
        }
        yielded.sort_by_key(|(spring, _)| *spring);
        yielded
    }

    fn follow_broken(&mut self) {
        let broken = self.broken();
        for emitter in &mut self.emitters {
            emitter.follow_broken(&broken);
        }
    }

    /// What is carried of broken springs is zero.
    ///
    /// # Panics
    ///
    /// If there are not [`Self::n_carried`] numbers.
    pub fn clear_broken(&self, carried: &mut [f64]) {
        let mut rest = carried;
        for emitter in self.emitters() {
            let (mine, others) = rest.split_at_mut(emitter.n_carried());
            emitter.clear_broken(mine);
            rest = others;
        }
    }
}
