//! Velocity Verlet with an estimate of its error.

use super::passes::set_errors_of_pair;
use crate::method::weighing::{Weighing, part_of_difference};
use crate::{
    Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, Splitting, State, Work,
};
use nalgebra::Vector3;
use springs_assembly::System;

/// Velocity Verlet in pairs of steps of half the size.
///
/// With the accelerations a₀, a₁, a₂ at the ends of two steps of size k, one step of
/// 2k from the same start ends d = k²(a₁ − a₀) before them and, with a₂ for the
/// acceleration at its own end, is slower by k/2·(2a₁ − a₀ − a₂). Dashpots see velocities there
/// that differ by 3/2 d/k, so that it is faster by 3/2 M⁻¹D d. So
/// the errors that [`crate::Doubling`] finds with a third evaluation of forces are
/// there already, but for a part of velocities that is of one order higher.
pub struct VerletPairs {
    verlet: Splitting,
    /// D d, in N·s; empty without dashpots.
    damping: Vec<Vector3<f64>>,
    /// Hidden state is that at the start of the pair.
    is_fresh: bool,
    weighing: Weighing,
    flows: Flows,
}

impl VerletPairs {
    /// For a system.
    pub fn new(system: &System) -> Self {
        let verlet = Splitting::velocity_verlet(system);
        Self {
            damping: if system.is_damped() {
                vec![Vector3::zeros(); system.n_free()]
            } else {
                Vec::new()
            },
            weighing: Weighing::new(system, verlet.order()),
            verlet,
            is_fresh: true,
            flows: Flows::default(),
        }
    }
}

impl Method for VerletPairs {
    fn order(&self) -> u32 {
        self.verlet.order()
    }

    fn restart(&mut self) {
        self.verlet.restart();
        self.is_fresh = true;
        self.weighing.restart();
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let [first, second] = interval.halves();
        self.weighing.begin(&state.v);
        // The first half of a rejected pair was accepted.
        if !self.is_fresh {
            self.verlet.go_back();
        }
        self.verlet.step(system, anchors, first, state, work)?;
        self.flows.copy_from(self.verlet.last_flows());
        self.verlet.accept();
        self.is_fresh = false;
        self.verlet.step(system, anchors, second, state, work)?;
        self.flows.add(self.verlet.last_flows());
        let part = part_of_difference(self.order());
        let (k, accelerations) = (first.size, self.verlet.last_accelerations());
        let factors = [part * k * k, part * 0.5 * k];
        let [e_x, e_v] = self.weighing.errors();
        set_errors_of_pair(factors, accelerations, [e_x, e_v]);
        if system.is_damped() {
            self.damping.fill(Vector3::zeros());
            system.add_damping_product(&state.x, &state.v, 1.0, e_x, &mut self.damping);
            let damped = self.damping.iter().zip(system.masses());
            for (e_v, (damped, mass)) in e_v.iter_mut().zip(damped) {
                *e_v -= damped * (1.5 / mass);
            }
        }
        Ok(Some(self.weighing.estimate(interval.size, state)))
    }

    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let at = (system, state);
        Some(self.weighing.second_estimate(&mut self.verlet, at, work))
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.verlet.archive(archive);
        archive.flag(&mut self.is_fresh);
        self.weighing.archive(archive);
    }

    fn accept(&mut self) {
        self.verlet.accept();
        self.is_fresh = true;
    }

    fn flows(&self) -> Option<&Flows> {
        Some(&self.flows)
    }

    fn kinetic_energy(&self) -> Option<f64> {
        self.verlet.kinetic_energy()
    }
}
