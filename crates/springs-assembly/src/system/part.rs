//! A system of some of the springs of another one.

use super::System;
use crate::Emitter;
use crate::compile::place;
use crate::guides::Guides;
use std::sync::Arc;

/// Some terms of a system, as a system of their own.
pub struct SystemPart {
    /// With the nodes, masses and motions of the whole.
    pub system: System,
    /// Which number that methods may carry for the whole each of its own is.
    pub of_whole: Vec<u32>,
}

impl System {
    /// The system of those terms alone whose carried numbers are `kept`, with constant forces.
    /// `None` where there is damping, guides, memory, or an emitter that cannot be taken apart.
    ///
    /// # Panics
    ///
    /// If there are not [`Self::n_carried`] of them.
    pub fn part(&self, kept: &[bool]) -> Option<SystemPart> {
        assert_eq!(kept.len(), self.n_carried(), "one for each");
        if self.is_damped() || self.has_memory || !self.guides.is_empty() {
            return None;
        }
        let mut emitters: Vec<Box<dyn Emitter>> = Vec::new();
        let (mut of_whole, mut first) = (Vec::new(), 0);
        for (emitter, nature) in self.emitters().zip(&self.natures) {
            let n_carried = emitter.n_carried();
            if nature.n_terms > 0 {
                let kept = &kept[first..first + n_carried];
                let (part, of_emitter) = emitter.part(&self.numbering, kept)?;
                emitters.push(part);
                of_whole.extend(of_emitter.iter().map(|&index| index + first as u32));
            }
            first += n_carried;
        }
        let (pattern, couplings) = place(&mut emitters, &self.numbering);
        let mut system = Self {
            numbering: self.numbering.clone(),
            masses: self.masses.clone(),
            inverse_masses: self.inverse_masses.clone(),
            natures: emitters.iter().map(|emitter| emitter.nature()).collect(),
            emitters,
            has_memory: false,
            constant_forces: self.constant_forces.clone(),
            couplings,
            guides: Guides::default(),
            prescribed: self.prescribed.clone(),
            motion: self.motion,
            pattern: Arc::new(pattern),
            initial_positions: self.initial_positions.clone(),
            initial_velocities: self.initial_velocities.clone(),
            frequency_bounds: [0.0; 2],
        };
        system.find_bounds();
        Some(SystemPart { system, of_whole })
    }
}
