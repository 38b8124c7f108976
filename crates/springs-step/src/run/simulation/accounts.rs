//! Energies at the end of a step and within it.

use super::{AT_THE_END, Simulation};
use crate::ledger::Books;
use crate::{Account, Interval, NodeStates, State, Works};

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
            ledger: self.books.ledger,
        }
    }

    /// Energies at a time within the last step, where `nodes` are.
    pub(super) fn account_between(
        &mut self,
        interval: Interval,
        time: f64,
        nodes: &NodeStates,
    ) -> Account {
        let ledger = self.books_between(interval, time, nodes).ledger;
        let state = self.gather_between(nodes);
        let energy = self.stepper.system().energy(&state.x, &state.v);
        self.state_between = Some(state);
        Account {
            time,
            energy,
            ledger,
        }
    }

    /// The books at a time within the last step, where `nodes` are.
    fn books_between(&mut self, interval: Interval, time: f64, nodes: &NodeStates) -> Books {
        let state = self.gather_between(nodes);
        let (system, h) = (self.stepper.system(), interval.size);
        let ends = [self.stepper.before(), self.stepper.state()];
        let elapsed = time - interval.start;
        let mut flows = match &self.flows_between {
            Some((at, flows)) if *at == time => flows.clone(),
            _ => self.last_flows.part(system, ends, h, elapsed / h),
        };
        flows.add_between_fixed(system, &ends[0].x, &state, elapsed);
        let mut books = self.books_before.clone();
        books.record(&flows);
        self.state_between = Some(state);
        books
    }

    /// The global vectors of `nodes`; to be put back for the next time.
    fn gather_between(&mut self, nodes: &NodeStates) -> State {
        let state = self.state_between.take();
        let mut state = state.unwrap_or_else(|| self.stepper.state().clone());
        state.gather(self.stepper.system(), nodes);
        state
    }

    /// The books when [`Self::advance_to`] got to a time, where `nodes` were.
    pub(crate) fn books_at(&mut self, time: f64, nodes: &NodeStates) -> Books {
        match self.last {
            Some(interval) if time < interval.end - AT_THE_END * interval.size => {
                self.books_between(interval, time, nodes)
            }
            _ => self.books.clone(),
        }
    }

    /// The works in books of this simulation, by loads and nodes.
    pub(crate) fn works_of(&self, books: &Books) -> Works {
        let loads = (self.n_loads, self.controls.is_some());
        Works::of(self.system(), &books.works, loads, &self.stepper.state().v)
    }
}
