//! Numbers that methods carry along from step to step, such as tensions.

use super::{System, its_part};
use crate::{Emitter, OwnStiffness};
use nalgebra::Vector3;

impl System {
    /// Numbers that a method may carry along for all emitters.
    pub fn n_carried(&self) -> usize {
        self.emitters().map(Emitter::n_carried).sum()
    }

    /// Hands over the free blocks of every term that methods may carry a number for, in the
    /// order of these, and half of a bound, in N/m, on the eigenvalues of its Hessian.
    pub fn each_carried_term(&self, mut visit: impl FnMut(&[u32], f64)) {
        for emitter in self.emitters() {
            emitter.each_carried_term(&mut visit);
        }
    }

    /// These numbers at `x`.
    ///
    /// # Panics
    ///
    /// If there are not [`Self::n_carried`] of them.
    pub fn carried(&self, x: &[Vector3<f64>], carried: &mut [f64]) {
        let mut rest = carried;
        for emitter in self.emitters() {
            let (mine, others) = rest.split_at_mut(emitter.n_carried());
            emitter.carried(x, mine);
            rest = others;
        }
    }

    /// These numbers as predicted for positions x + h·v, to first order in h.
    ///
    /// # Panics
    ///
    /// If there are not [`Self::n_carried`] of them.
    pub fn predict_carried(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        h: f64,
        carried: &mut [f64],
    ) {
        let mut rest = carried;
        for emitter in self.emitters() {
            let (mine, others) = rest.split_at_mut(emitter.n_carried());
            emitter.predict_carried(x, v, h, mine);
            rest = others;
        }
    }

    /// What the terms of these numbers, with them in place of those at `x`, give against a
    /// move of each free block alone.
    ///
    /// # Panics
    ///
    /// If there are not [`Self::n_carried`] of them, or `own` is too short.
    pub fn own_stiffness(&self, x: &[Vector3<f64>], carried: &[f64], own: &mut [OwnStiffness]) {
        own.fill(OwnStiffness::default());
        let mut rest = Some(carried);
        for emitter in self.emitters() {
            let mine = its_part(&mut rest, emitter).expect("one for each");
            emitter.add_own_stiffness(x, mine, own);
        }
    }

    /// −`scale`·(dH/dt)·v on all blocks, fixed ones too, in N for a scale in s², as far as it
    /// acts along springs with a free end: H is the Hessian with these numbers, and dH/dt what
    /// it changes by when all blocks move on with `v`. It keeps turning springs from getting
    /// longer.
    ///
    /// # Panics
    ///
    /// If there are not [`Self::n_carried`] of them, or `forces` is too short.
    pub fn turning_forces(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        carried: &[f64],
        scale: f64,
        forces: &mut [Vector3<f64>],
    ) {
        forces.fill(Vector3::zeros());
        let mut rest = Some(carried);
        for emitter in self.emitters() {
            let mine = its_part(&mut rest, emitter).expect("one for each");
            emitter.add_turning_forces(x, v, mine, scale, forces);
        }
    }
}
