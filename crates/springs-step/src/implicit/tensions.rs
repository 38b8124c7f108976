//! Tensions that are carried along from step to step.

use crate::Archive;
use nalgebra::Vector3;
use springs_assembly::System;

/// Tensions of all springs as first guesses of Newton's method, at the start of
/// a step and at its end.
pub(crate) struct Tensions {
    pub(crate) start: Vec<f64>,
    pub(crate) end: Vec<f64>,
    are_known: bool,
}

impl Tensions {
    pub(crate) fn new(system: &System) -> Self {
        Self {
            start: vec![0.0; system.n_carried()],
            end: vec![0.0; system.n_carried()],
            are_known: false,
        }
    }

    pub(crate) fn forget(&mut self) {
        self.are_known = false;
    }

    /// Those at the start of the next step, if they are known.
    pub(crate) fn known(&self) -> Option<&[f64]> {
        self.are_known.then_some(&*self.start)
    }

    /// Springs broke at the start of the next step.
    pub(crate) fn clear_broken(&mut self, system: &System) {
        system.clear_broken(&mut self.start);
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.flag(&mut self.are_known);
        archive.reals(&mut self.start);
    }

    /// Begins a step at the given positions; `end` is then the guess.
    pub(crate) fn begin(&mut self, system: &System, x: &[Vector3<f64>]) {
        if !self.are_known {
            system.carried(x, &mut self.start);
            self.are_known = true;
        }
        self.end.copy_from_slice(&self.start);
    }

    pub(crate) fn accept(&mut self) {
        std::mem::swap(&mut self.start, &mut self.end);
    }
}
