//! Where the energy went.

use crate::{HiddenState, Interval, Quadrature, State};
use springs_assembly::{Energy, System};

/// Energy at the start and the flows since then, in J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ledger {
    /// Energy at the start.
    pub start: Energy,
    /// Heat produced by dashpots.
    pub dashpot_heat: f64,
    /// Work done by moving anchors.
    pub anchor_work: f64,
    powers: Powers,
}

/// Heat and anchor power at one instant, in W.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Powers {
    dashpots: f64,
    anchors: f64,
}

impl Powers {
    /// Scenes without dashpots or moving anchors cost next to nothing here.
    fn at(system: &System, state: &State) -> Self {
        Self {
            dashpots: system.dashpots().dissipation(&state.x, &state.v),
            anchors: system.anchor_power(&state.x, &state.v),
        }
    }
}

impl Ledger {
    /// Opens the ledger.
    pub fn open(system: &System, state: &State) -> Self {
        Self {
            start: system.energy(&state.x, &state.v),
            dashpot_heat: 0.0,
            anchor_work: 0.0,
            powers: Powers::at(system, state),
        }
    }

    /// Enters a step that ended at `state`.
    pub fn record(
        &mut self,
        system: &System,
        state: &State,
        interval: Interval,
        quadrature: Quadrature,
    ) {
        let (before, after) = (self.powers, Powers::at(system, state));
        let integral = |start: f64, end: f64| {
            interval.size * (quadrature.start * start + quadrature.end * end)
        };
        self.dashpot_heat += integral(before.dashpots, after.dashpots);
        self.anchor_work += integral(before.anchors, after.anchors);
        self.powers = after;
    }

    /// The flows; the start is that of the scene.
    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        let Powers { dashpots, anchors } = &mut self.powers;
        let flows = [&mut self.dashpot_heat, &mut self.anchor_work];
        for real in flows.into_iter().chain([dashpots, anchors]) {
            state.real(real);
        }
    }

    /// The ledger of several systems together.
    pub(crate) fn sum(ledgers: impl Iterator<Item = Self>) -> Option<Self> {
        ledgers.reduce(|a, b| Self {
            start: a.start + b.start,
            dashpot_heat: a.dashpot_heat + b.dashpot_heat,
            anchor_work: a.anchor_work + b.anchor_work,
            powers: Powers {
                dashpots: a.powers.dashpots + b.powers.dashpots,
                anchors: a.powers.anchors + b.powers.anchors,
            },
        })
    }

    /// What is left of the change to `end` after heat and work: the gain (or,
    /// if negative, the loss) of the method itself, in J. It includes what the
    /// ledger's own integrals over a step miss.
    pub fn method_gain(&self, end: &Energy) -> f64 {
        end.total() - self.start.total() + self.dashpot_heat - self.anchor_work
    }
}
