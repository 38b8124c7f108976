//! What springs and supports carry, and what broke, from all parts.

use super::Islands;
use crate::run::frames::{Due, View};
use crate::run::members::Gathered;
use crate::run::probes::{SpringValues, Wanted};
use crate::{Break, Members, Observer, Part, Peak};
use springs_scene::Scene;
use std::ops::ControlFlow;

impl Islands {
    /// Shows what is due now.
    pub(super) fn show(&mut self, due: &Due, observer: &mut dyn Observer) -> ControlFlow<()> {
        let has_members = due.frame.is_some() && observer.wants_members();
        let wanted = self.probes.wanted(due.probes.iter().copied());
        let springs = self.spring_values(wanted);
        let view = View {
            members: has_members.then(|| self.members()),
            samples: self.probes.look(&due.probes, &self.nodes, &springs),
        };
        due.show(&self.nodes, &view, observer)
    }

    /// What springs and supports carry now.
    fn members(&mut self) -> Members {
        let mut gathered = Gathered::new(self.n_springs);
        for part in &mut self.parts {
            let members = part.simulation.members_at(self.time, &part.state);
            gathered.add(members, &part.island.nodes, &part.island.springs);
        }
        let mut members = gathered.finish();
        self.supported.add_to(self.time, &mut members.reactions);
        members
    }

    /// What springs give now, as far as it is wanted.
    fn spring_values(&mut self, wanted: Wanted) -> SpringValues {
        let room = |is_wanted| vec![0.0; if is_wanted { self.n_springs } else { 0 }];
        let mut values = SpringValues {
            tensions: room(wanted.tensions),
            energies: room(wanted.energies),
        };
        for part in &mut self.parts {
            let of_part = part
                .simulation
                .spring_values_at(wanted, self.time, &part.state);
            let both = [
                (&mut values.tensions, of_part.tensions),
                (&mut values.energies, of_part.energies),
            ];
            for (all, of_part) in both {
                for (&spring, value) in part.island.springs.iter().zip(of_part) {
                    all[spring] = value;
                }
            }
        }
        values
    }

    /// The largest and the least tension of each spring as [`crate::Simulation::peaks`] has
    /// them; nothing where they are not kept.
    pub fn peaks(&self) -> Vec<Peak> {
        let of_parts = self.parts.iter().map(|part| part.simulation.peaks());
        if of_parts.map(<[Peak]>::len).sum::<usize>() < self.n_springs {
            return Vec::new();
        }
        let mut peaks = vec![Peak::at(0.0, 0.0); self.n_springs];
        for part in &self.parts {
            let of_part = part.island.springs.iter().zip(part.simulation.peaks());
            of_part.for_each(|(&spring, peak)| peaks[spring] = *peak);
        }
        peaks
    }

    /// The springs that broke so far, in the order in which they did.
    pub fn breaks(&self) -> Vec<Break> {
        let of_part = |part: &Part| -> Vec<Break> {
            let breaks = part.simulation.breaks().iter();
            let in_scene = breaks.map(|one| Break {
                spring: part.island.springs[one.spring],
                ..*one
            });
            in_scene.collect()
        };
        let mut breaks: Vec<Break> = self.parts.iter().flat_map(of_part).collect();
        breaks.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.spring.cmp(&b.spring)));
        breaks
    }

    /// The error of positions now, in m, by the estimates of the methods: that of the worst
    /// part. `None` where a part that has moved has none.
    pub fn estimated_error(&self) -> Option<f64> {
        let simulations = self.parts.iter().map(|part| &part.simulation);
        let moved = simulations.filter(|simulation| simulation.stepper().steps() > 0);
        let errors: Option<Vec<f64>> = moved.map(|one| one.estimated_error()).collect();
        errors?.into_iter().reduce(f64::max)
    }

    /// Makes of the scene of the run one that continues from here: where nodes are now, what
    /// is broken or has yielded, loads and motions from now on.
    ///
    /// # Panics
    ///
    /// If the scene has fewer nodes or springs.
    pub fn write_to(&self, scene: &mut Scene) {
        scene.shift_time(self.time());
        self.nodes().write_to(scene);
        self.write_memory_to(scene);
    }

    /// Writes into the springs of a scene, which is that of the run, what is broken or has
    /// yielded.
    ///
    /// # Panics
    ///
    /// If the scene has fewer springs.
    pub fn write_memory_to(&self, scene: &mut Scene) {
        for part in &self.parts {
            let springs = &part.island.springs;
            part.simulation
                .write_memory_to(scene, |spring| springs[spring]);
        }
    }
}
