//! Error control for methods without an estimate of their own.

use super::passes::set_multiple_of_difference;
use crate::method::weighing::{Weighing, part_of_difference};
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use springs_assembly::System;
use springs_solver::{Interrupt, SolveError};

/// Any method, made to estimate its error: each step is made once as a whole
/// and once as two halves, which are the result; their difference gives the
/// errors of positions and of velocities (Hairer, Nørsett, Wanner: Solving Ordinary
/// Differential Equations I, 1993, II.4). What errors of velocities come to depends
/// on how far springs let them move anything, as in [`crate::TrBdf2`].
pub struct Doubling {
    method: Box<dyn Method>,
    whole: State,
    /// Hidden state is that at the start of the step.
    is_fresh: bool,
    weighing: Weighing,
    /// Of both halves.
    flows: Flows,
}

impl Doubling {
    /// Wraps a method.
    pub fn new(system: &System, method: Box<dyn Method>) -> Self {
        Self {
            weighing: Weighing::new(system, method.order()),
            method,
            whole: State::initial(system),
            is_fresh: true,
            flows: Flows::default(),
        }
    }
}

impl Method for Doubling {
    fn order(&self) -> u32 {
        self.method.order()
    }

    fn setup(&self) -> Work {
        self.method.setup()
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.method.expect_changing_steps(system)
    }

    fn longest_step(&self, system: &System) -> f64 {
        self.method.longest_step(system)
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.method.set_interrupt(interrupt);
    }

    fn restart(&mut self) {
        self.method.restart();
        self.is_fresh = true;
        self.weighing.restart();
    }

    fn springs_broke(&mut self, system: &System) {
        self.method.springs_broke(system);
        self.weighing.restart();
    }

    fn forces_jumped(&mut self, system: &System) {
        self.method.forces_jumped(system);
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
        let h = interval.size;
        self.whole.x.copy_from_slice(&state.x);
        self.whole.v.copy_from_slice(&state.v);
        self.weighing.begin(&state.v);
        // The first half of a rejected step was accepted by the method.
        if !self.is_fresh {
            self.method.restart();
        }
        self.method
            .step(system, anchors, interval, &mut self.whole, work)?;
        let [first, second] = interval.halves();
        self.method.step(system, anchors, first, state, work)?;
        if let Some(flows) = self.method.flows() {
            self.flows.copy_from(flows);
        }
        self.method.accept();
        self.is_fresh = false;
        self.method.step(system, anchors, second, state, work)?;
        if let Some(flows) = self.method.flows() {
            self.flows.add(flows);
        }

        let (whole, part) = (&self.whole, part_of_difference(self.method.order()));
        let [e_x, e_v] = self.weighing.errors();
        set_multiple_of_difference(part, &state.x, &whole.x, e_x);
        set_multiple_of_difference(part, &state.v, &whole.v, e_v);
        Ok(Some(self.weighing.estimate(h, state)))
    }

    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let at = (system, state);
        Some(self.weighing.second_estimate(&mut *self.method, at, work))
    }

    fn least_estimate(&self) -> Option<ErrorEstimate> {
        Some(self.weighing.least_estimate())
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.method.archive(archive);
        archive.flag(&mut self.is_fresh);
        self.weighing.archive(archive);
    }

    fn accept(&mut self) {
        self.method.accept();
        self.is_fresh = true;
    }

    fn keep_tensions(&mut self, system: &System) {
        self.method.keep_tensions(system);
    }

    fn tensions(&self) -> Option<&[f64]> {
        self.method.tensions()
    }

    fn flows(&self) -> Option<&Flows> {
        self.method.flows().map(|_| &self.flows)
    }
}
