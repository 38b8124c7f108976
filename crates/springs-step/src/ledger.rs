//! Where the energy went.

use crate::flows::BlockWorks;
use crate::{Archive, Flows, State};
use springs_assembly::{Energy, Lines, System};

/// Energy at the start and the flows since then, in J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ledger {
    /// Energy at the start.
    pub start: Energy,
    /// Heat produced by the damping forces of each emitter.
    pub heat: Lines,
    /// Work done by moving anchors.
    pub anchor_work: f64,
    /// Work done by loads.
    pub load_work: f64,
    /// What springs held that broke, and the work of yielding.
    pub broken_energy: f64,
    /// Work of whoever [changed springs](crate::Simulation::set_rest_lengths) between
    /// steps: what their energy changed by where they were.
    pub control_work: f64,
}

impl Ledger {
    /// Opens the ledger.
    pub fn open(system: &System, state: &State) -> Self {
        Self {
            start: system.energy(&state.x, &state.v),
            heat: Lines::default(),
            anchor_work: 0.0,
            load_work: 0.0,
            broken_energy: 0.0,
            control_work: 0.0,
        }
    }

    /// Enters flows.
    pub fn record(&mut self, flows: &Flows) {
        self.heat += flows.heat;
        self.anchor_work += flows.anchor_work();
        self.load_work += flows.load_work();
    }

    /// The flows of steps; the start is that of the scene.
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        self.heat.iter_mut().for_each(|heat| archive.real(heat));
        archive.real(&mut self.anchor_work);
        archive.real(&mut self.load_work);
        archive.real(&mut self.broken_energy);
    }

    /// The ledger of several systems together.
    pub(crate) fn sum(ledgers: impl Iterator<Item = Self>) -> Option<Self> {
        ledgers.reduce(|a, b| Self {
            start: a.start + b.start,
            heat: a.heat + b.heat,
            anchor_work: a.anchor_work + b.anchor_work,
            load_work: a.load_work + b.load_work,
            broken_energy: a.broken_energy + b.broken_energy,
            control_work: a.control_work + b.control_work,
        })
    }

    /// What is left of the change to `end` after heat, work and what broke: the gain (or,
    /// if negative, the loss) of the method itself, in J.
    pub fn method_gain(&self, end: &Energy) -> f64 {
        let taken = self.heat.sum() - self.anchor_work - self.load_work + self.broken_energy;
        end.total() - self.start.total() + (taken - self.control_work)
    }
}

/// The ledger, and the work of each anchor and load in it.
#[derive(Clone, Debug)]
pub(crate) struct Books {
    pub(crate) ledger: Ledger,
    pub(crate) works: BlockWorks,
}

impl Books {
    pub(crate) fn open(system: &System, state: &State) -> Self {
        Self {
            ledger: Ledger::open(system, state),
            works: BlockWorks::default(),
        }
    }

    pub(crate) fn record(&mut self, flows: &Flows) {
        self.ledger.record(flows);
        self.works.add_times(&flows.works, 1.0);
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.ledger = other.ledger;
        self.works.copy_from(&other.works);
    }

    pub(crate) fn archive(&mut self, system: &System, archive: &mut Archive) {
        self.ledger.archive(archive);
        self.works.archive(system, archive);
    }
}
