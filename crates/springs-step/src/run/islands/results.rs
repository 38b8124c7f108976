//! What springs and supports carry, and what broke, from all parts.

use super::Islands;
use crate::run::members::Gathered;
use crate::{Break, Members, Observer, Part, Peak};
use springs_scene::Scene;

impl Islands {
    /// What springs and supports carry now, if the observer wants it.
    pub(super) fn members_for(&self, observer: &dyn Observer) -> Option<Members> {
        observer.wants_members().then(|| {
            let mut gathered = Gathered::new(self.n_springs);
            for part in &self.parts {
                let members = part.simulation.members_at(self.time, &part.state);
                gathered.add(members, &part.island.nodes, &part.island.springs);
            }
            let mut members = gathered.finish();
            self.supported.add_to(self.time, &mut members.reactions);
            members
        })
    }

    /// The largest and the least tension of each spring at the ends of steps, where an
    /// observer [wanted](Observer::wants_members) members; else nothing.
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

    /// Writes into the springs of a scene, which is that of the run, what is broken or has
    /// yielded, so that it continues from here.
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
