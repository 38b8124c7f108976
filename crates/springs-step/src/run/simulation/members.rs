//! What springs and supports carry during a run.

use super::Simulation;
use crate::run::members::{Track, state_of};
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

    /// What springs and supports carry at a time within a step, where `nodes` are, if the
    /// observer wants it; at the end of the step if there was none.
    pub(super) fn members_for(
        &self,
        observer: &dyn Observer,
        interval: Option<Interval>,
        time: f64,
        nodes: &NodeStates,
    ) -> Option<Members> {
        observer.wants_members().then(|| {
            let mut members = self.members_without_weight(interval, time, nodes);
            self.supported.add_to(time, &mut members.reactions);
            members
        })
    }

    /// The same without the masses of fixed nodes; nothing where tensions are not kept.
    fn members_without_weight(
        &self,
        interval: Option<Interval>,
        time: f64,
        nodes: &NodeStates,
    ) -> Members {
        let Some(track) = &self.track else {
            return Members::default();
        };
        let fraction = interval.map_or(1.0, |step| (time - step.start) / step.size);
        let system = self.stepper.system();
        let state = state_of(system, time, nodes);
        track.members(system, fraction.clamp(0.0, 1.0), &state)
    }

    /// [`Self::members_without_weight`] at a time that the last step got to.
    pub(crate) fn members_at(&self, time: f64, nodes: &NodeStates) -> Members {
        self.members_without_weight(self.last, time, nodes)
    }

    /// The largest and the least tension of each spring at the ends of steps, where an
    /// observer [wanted](Observer::wants_members) members; else nothing.
    pub fn peaks(&self) -> &[Peak] {
        self.track.as_ref().map_or(&[], Track::peaks)
    }
}
