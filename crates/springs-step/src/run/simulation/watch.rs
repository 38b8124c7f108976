//! A watch over the energy of every step.

use super::Simulation;
use crate::control::controller::Schedule;
use crate::{Cause, Counts, Interval, Pace, Properties};
use springs_assembly::{Lines, Notable};

/// Evaluations of forces between two looks at the energy of springs, where no
/// linear system is solved, beside which a look costs nothing.
const LOOK_AT_SPRINGS: u64 = 16;

/// So many times the energy that was known to be there is not possible.
const IMPOSSIBLE: f64 = 1e4;

/// Energy of springs counts from this strain on. Methods that filter stiff
/// springs hold their tension with a stretch that is far too large for their
/// stiffness, but small.
const NOTABLE_STRAIN: f64 = 0.5;

impl Simulation {
    /// What is wrong with the energy after the attempted step, if anything is:
    /// there is far more than there ever was or came in, as with steps that are
    /// too long for an explicit method, long before numbers overflow.
    ///
    /// The kinetic energy is looked at in every step, where it costs nothing; the
    /// others where that is cheap beside the step, and in the last one.
    pub(super) fn watch_energy(
        &mut self,
        interval: Interval,
        counts: Counts,
        work: f64,
    ) -> Option<Cause> {
        let (system, state) = (self.stepper.system(), self.stepper.state());
        let done = self.work.counts;
        let is_last = match self.schedule {
            Schedule::Fixed(plan) => self.stepper.steps() + 1 >= plan.n_steps(),
            Schedule::Adaptive(_) | Schedule::Open(_) => interval.end >= self.duration,
        };
        let looks = is_last
            || done.solves > counts.solves
            || done.force_evaluations / LOOK_AT_SPRINGS
                > counts.force_evaluations / LOOK_AT_SPRINGS;
        let kinetic = self.stepper.kinetic_energy();
        let mut elastic = 0.0;
        if looks {
            let energy = system.energy(&state.x, &state.v);
            if !energy.total().is_finite() {
                return Some(Cause::EnergyOverflow);
            }
            elastic = stored(&energy.potential);
        }
        if kinetic + elastic <= IMPOSSIBLE * self.most_energy {
            return None;
        }
        // A straight chain of very short springs falls in its first step by many of
        // their lengths, since nothing holds it across; the next step pulls it back.
        let row = self.choice.properties();
        if row.is_some_and(Properties::damps_unresolved_vibrations) {
            elastic = 0.0;
        } else if looks {
            // What a tolerance allows is no divergence.
            let stretch = match self.choice.pace {
                Pace::Tolerance(tolerance) => tolerance,
                Pace::Fixed(_) => 0.0,
            };
            let notable = Notable {
                strain: NOTABLE_STRAIN,
                stretch,
            };
            elastic = stored(&system.energy_beyond(notable, &state.x));
        }
        let start = self.books.ledger.start;
        let now = system.energy(&state.x, &state.v);
        let fallen = (start.gravity() - now.gravity()).abs();
        // Every step rounds once more.
        let rounding = system.energy_of_rounding(&state.x);
        let rounded = (self.stepper.steps() + 1) as f64 * rounding;
        let known = start.kinetic + stored(&start.potential) + work + fallen + rounded;
        self.most_energy = self.most_energy.max(known);
        (kinetic + elastic > IMPOSSIBLE * self.most_energy).then_some(Cause::EnergyDiverged)
    }
}

/// Energy in springs and the like: all but that of gravity, which has no zero.
fn stored(potential: &Lines) -> f64 {
    potential.sum() - potential[Lines::GRAVITY]
}
