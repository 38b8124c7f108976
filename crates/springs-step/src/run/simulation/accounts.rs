//! Energies at the end of a step and within it.

use super::{AT_THE_END, Simulation};
use crate::{Account, Flows, Interval, Ledger, NodeStates, State};

impl Simulation {
    /// Energies now.
    pub fn account_now(&self) -> Account {
        self.account(self.stepper.time())
    }

    /// Energies at the end of the last step, which `time` is.
    pub(super) fn account(&self, time: f64) -> Account {
        Account {
            time,
            energy: self.energy(),
            ledger: self.ledger,
        }
    }

    /// Energies at a time within the last step, where `nodes` are.
    pub(super) fn account_between(
        &mut self,
        interval: Interval,
        time: f64,
        nodes: &NodeStates,
    ) -> Account {
        let ledger = self.ledger_between(interval, time, nodes);
        let state = self.gather_between(nodes);
        let energy = self.stepper.system().energy(&state.x, &state.v);
        self.state_between = Some(state);
        Account {
            time,
            energy,
            ledger,
        }
    }

    /// The ledger at a time within the last step, where `nodes` are.
    fn ledger_between(&mut self, interval: Interval, time: f64, nodes: &NodeStates) -> Ledger {
        let state = self.gather_between(nodes);
        let (system, h) = (self.stepper.system(), interval.size);
        let ends = [self.stepper.before(), self.stepper.state()];
        let elapsed = time - interval.start;
        let flows = match self.flows_between {
            Some((at, flows)) if at == time => flows,
            _ => self.last_flows.part(system, ends, h, elapsed / h),
        };
        let mut ledger = self.ledger_before;
        ledger.record(flows + Flows::between_fixed(system, &ends[0].x, &state, elapsed));
        self.state_between = Some(state);
        ledger
    }

    /// The global vectors of `nodes`; to be put back for the next time.
    fn gather_between(&mut self, nodes: &NodeStates) -> State {
        let state = self.state_between.take();
        let mut state = state.unwrap_or_else(|| self.stepper.state().clone());
        state.gather(self.stepper.system(), nodes);
        state
    }

    /// The ledger when [`Self::advance_to`] got to a time, where `nodes` were.
    pub(crate) fn ledger_at(&mut self, time: f64, nodes: &NodeStates) -> Ledger {
        match self.last {
            Some(interval) if time < interval.end - AT_THE_END * interval.size => {
                self.ledger_between(interval, time, nodes)
            }
            _ => self.ledger,
        }
    }
}
