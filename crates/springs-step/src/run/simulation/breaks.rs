//! What breaks at the ends of steps.
//!
//! It is found out once nobody asks for states within the step any more, since these
//! are those of what was whole.

use super::Simulation;
use crate::HiddenState;
use crate::control::controller::Schedule;
use crate::run::breaks::Break;

impl Simulation {
    /// Springs that are beyond their limits at the end of the last step break, if that is
    /// not done yet.
    pub(super) fn end_step(&mut self) {
        if !std::mem::take(&mut self.is_end_open) {
            return;
        }
        let Some(update) = self.stepper.update_memory() else {
            return;
        };
        self.ledger.broken_energy += update.other_energy;
        if !update.is_abrupt {
            return;
        }
        let (system, state) = (self.stepper.system(), self.stepper.state());
        for broken in &update.broken {
            self.ledger.broken_energy += broken.energy;
            self.breaks.push(Break {
                time: state.time,
                spring: broken.spring,
                energy: broken.energy,
            });
        }
        if let Some(track) = &mut self.track {
            track.clear_broken(system, state);
        }
        if let Schedule::Adaptive(controller) = &mut self.schedule {
            controller.begin_anew();
        }
    }

    /// The springs that broke so far, in the order in which they did.
    pub fn breaks(&self) -> &[Break] {
        &self.breaks
    }

    /// Marks the springs of a scene, which is that of the simulation, that are broken
    /// now.
    ///
    /// # Panics
    ///
    /// If the scene has fewer springs.
    pub fn write_broken_to(&self, scene: &mut springs_scene::Scene) {
        for spring in self.system().broken() {
            scene.springs[spring].broken = true;
        }
    }

    /// Hands over what broke; nothing where nothing can.
    pub(super) fn visit_breaks(&mut self, state: &mut HiddenState) {
        if !self.system().has_memory() {
            return;
        }
        self.stepper.visit_memory(state);
        state.flag(&mut self.is_end_open);
        let mut n = self.breaks.len() as u64;
        state.word(&mut n);
        // Each spring breaks once.
        if n > self.n_springs as u64 {
            return state.refuse();
        }
        self.breaks.resize(n as usize, Break::default());
        self.breaks.iter_mut().for_each(|one| one.visit(state));
        if self.breaks.iter().any(|one| one.spring >= self.n_springs) {
            state.refuse();
        }
    }
}
