//! What springs and supports carry during a run.

use super::Simulation;
use crate::run::frames::{Due, View};
use crate::run::members::{Track, state_of};
use crate::run::probes::{SpringValues, Wanted};
use crate::{Interval, Members, NodeStates, Observer, Peak};

impl Simulation {
    /// Keeps tensions and their peaks from now on.
    pub(crate) fn track_members(&mut self) {
        if self.track.is_none() {
            self.stepper.keep_tensions();
            let (system, state) = (self.stepper.system(), self.stepper.state());
            self.track = Some(Track::new(self.n_springs, system, state));
        }
    }

    /// Keeps them if frames or probes of this observer tell tensions.
    pub(super) fn track_members_for(&mut self, observer: &dyn Observer) {
        let probes_do = observer.wants_samples() && self.probes.want_tensions();
        if observer.wants_members() || probes_do {
            self.track_members();
        }
    }

    /// What there is to be seen at the time of `due` within the last step, where `nodes` are.
    pub(super) fn view(&mut self, due: &Due, nodes: &NodeStates, observer: &dyn Observer) -> View {
        let has_members = due.frame.is_some() && observer.wants_members();
        let members = has_members.then(|| {
            let mut members = self.members_at(due.time, nodes);
            self.supported.add_to(due.time, &mut members.reactions);
            members
        });
        let wanted = self.probes.wanted(due.probes.iter().copied());
        let springs = self.spring_values_at(wanted, due.time, nodes);
        View {
            members,
            samples: self.probes.look(&due.probes, nodes, &springs),
        }
    }

    /// What springs and supports carry at a time that the last step got to, where `nodes`
    /// are, without the masses of fixed nodes; nothing where tensions are not kept.
    pub(crate) fn members_at(&mut self, time: f64, nodes: &NodeStates) -> Members {
        let fraction = self.fraction_at(time);
        let Some(track) = &mut self.track else {
            return Members::default();
        };
        let system = self.stepper.system();
        track.members(system, fraction, &state_of(system, time, nodes))
    }

    /// What springs give at a time that the last step got to, as far as it is wanted;
    /// tensions must be kept for that.
    pub(crate) fn spring_values_at(
        &mut self,
        wanted: Wanted,
        time: f64,
        nodes: &NodeStates,
    ) -> SpringValues {
        let mut values = SpringValues::default();
        if wanted == Wanted::default() {
            return values;
        }
        let fraction = self.fraction_at(time);
        let system = self.stepper.system();
        let state = state_of(system, time, nodes);
        if let Some(track) = self.track.as_mut().filter(|_| wanted.tensions) {
            values.tensions = track.tensions(system, fraction, &state);
        }
        if wanted.energies {
            values.energies.resize(self.n_springs, 0.0);
            system.each_energy(&state.x, &mut |spring, energy| {
                values.energies[spring] = energy;
            });
        }
        values
    }

    /// How much of the last step was made at a time; all of it if there was none.
    fn fraction_at(&self, time: f64) -> f64 {
        let fraction = |step: Interval| ((time - step.start) / step.size).clamp(0.0, 1.0);
        self.last.map_or(1.0, fraction)
    }

    /// The largest and the least tension of each spring at the ends of steps, at frames and
    /// where probes tell tensions, if an observer [wanted](Observer::wants_members) members or
    /// samples of that; else nothing.
    pub fn peaks(&self) -> &[Peak] {
        self.track.as_ref().map_or(&[], Track::peaks)
    }
}
