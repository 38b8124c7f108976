//! Velocity Verlet with an estimate of its error.

use super::passes::set_errors_of_pair;
use crate::method::weighing::{Weighing, part_of_difference};
use crate::{
    Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, Splitting, State, Work,
};
use springs_assembly::System;

/// Velocity Verlet in pairs of steps of half the size, for forces that do not depend
/// on velocities.
///
/// With the accelerations a₀, a₁, a₂ at the ends of two steps of size k, one step of
/// 2k from the same start ends k²(a₁ − a₀) before them and, with a₂ for the
/// acceleration at its own end, is slower by k/2·(2a₁ − a₀ − a₂). So
/// the errors that [`crate::Doubling`] finds with a third evaluation of forces are
/// there already, but for a part of velocities that is of one order higher.
pub struct VerletPairs {
    verlet: Splitting,
    /// Hidden state is that at the start of the pair.
    is_fresh: bool,
    weighing: Weighing,
    flows: Flows,
}

impl VerletPairs {
    /// For a system without dashpots and drag.
    pub fn new(system: &System) -> Self {
        let verlet = Splitting::velocity_verlet(system);
        Self {
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
        set_errors_of_pair(factors, accelerations, self.weighing.errors());
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
