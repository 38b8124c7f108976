//! What springs and supports carry.

use crate::{Archive, Method, NodeStates, State};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::{PrescribedMotion, Scene};

/// What springs and supports carry at the time of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Members {
    /// The tension of each spring of the scene, in N, without the force of its dashpot.
    pub tensions: Vec<f64>,
    /// The force of each support, in the order of the nodes.
    pub reactions: Vec<Reaction>,
    /// The springs that are broken, ascending.
    pub broken: Vec<usize>,
    /// The springs that have yielded, ascending.
    pub yielded: Vec<usize>,
}

/// The force of a support on its node.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reaction {
    /// The node.
    pub node: usize,
    /// In N.
    pub force: Vector3<f64>,
}

/// The largest and the least tension of a spring at the ends of steps, at frames, and where a
/// probe told tensions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Peak {
    /// In N.
    pub max_tension: f64,
    /// When, in s.
    pub time_of_max: f64,
    /// In N.
    pub min_tension: f64,
    /// When, in s.
    pub time_of_min: f64,
}

impl Peak {
    pub(crate) fn at(time: f64, tension: f64) -> Self {
        Self {
            max_tension: tension,
            time_of_max: time,
            min_tension: tension,
            time_of_min: time,
        }
    }

    fn take(&mut self, time: f64, tension: f64) {
        if tension > self.max_tension {
            (self.max_tension, self.time_of_max) = (tension, time);
        }
        if tension < self.min_tension {
            (self.min_tension, self.time_of_min) = (tension, time);
        }
    }
}

/// What supports carry and move beside the rest: the masses of the fixed nodes of a
/// scene.
pub(crate) struct Supported {
    gravity: Vector3<f64>,
    masses: Vec<SupportedMass>,
}

struct SupportedMass {
    node: usize,
    /// In kg.
    mass: f64,
    motion: Option<PrescribedMotion>,
}

impl Supported {
    pub(crate) fn of(scene: &Scene) -> Self {
        let masses = scene.node_masses().into_iter().enumerate();
        let masses = masses.filter(|(node, mass)| scene.nodes[*node].fixed && *mass > 0.0);
        let masses = masses.map(|(node, mass)| {
            let motion = scene.nodes[node]
                .motion
                .map(|motion| &scene.motions[motion]);
            SupportedMass {
                node,
                mass,
                motion: motion.map(|named| named.motion.clone()),
            }
        });
        Self {
            gravity: scene.gravity,
            masses: masses.collect(),
        }
    }

    /// Adds m (a − g) at a time in s to reactions in the order of the nodes.
    pub(crate) fn add_to(&self, time: f64, reactions: &mut [Reaction]) {
        for SupportedMass { node, mass, motion } in &self.masses {
            let moved = motion.as_ref().map(|motion| motion.at(time).acceleration);
            let acceleration = moved.unwrap_or_else(Vector3::zeros);
            if let Ok(index) = reactions.binary_search_by_key(node, |reaction| reaction.node) {
                reactions[index].force += (acceleration - self.gravity) * *mass;
            }
        }
    }
}

/// Tensions at both ends of the last step, and the peaks so far.
#[derive(Clone)]
pub(crate) struct Track {
    n_springs: usize,
    /// What [`System::carried`] gives at both ends, by the method or by positions.
    start: Vec<f64>,
    end: Vec<f64>,
    /// Whether the method said it, so that positions do not.
    is_carried: bool,
    peaks: Vec<Peak>,
}

impl Track {
    /// Begins at a state.
    pub(crate) fn new(n_springs: usize, system: &System, state: &State) -> Self {
        let mut end = vec![0.0; system.n_carried()];
        system.carried(&state.x, &mut end);
        let mut track = Self {
            n_springs,
            start: end.clone(),
            end,
            is_carried: false,
            peaks: vec![Peak::at(state.time, 0.0); n_springs],
        };
        let peaks = &mut track.peaks;
        system.each_tension(&state.x, None, &mut |spring, tension| {
            peaks[spring] = Peak::at(state.time, tension);
        });
        track
    }

    /// Takes note of a step that stands.
    pub(crate) fn take(&mut self, system: &System, method: &dyn Method, state: &State) {
        std::mem::swap(&mut self.start, &mut self.end);
        self.is_carried = match method.tensions() {
            Some(tensions) => {
                self.end.copy_from_slice(tensions);
                true
            }
            None => {
                system.carried(&state.x, &mut self.end);
                false
            }
        };
        let (peaks, time) = (&mut self.peaks, state.time);
        system.each_tension(&state.x, Some(&self.end), &mut |spring, tension| {
            peaks[spring].take(time, tension);
        });
    }

    /// Springs broke at the end of the last step, where the state is.
    pub(crate) fn clear_broken(&mut self, system: &System, state: &State) {
        system.clear_broken(&mut self.end);
        let (peaks, time) = (&mut self.peaks, state.time);
        for spring in system.broken() {
            peaks[spring].take(time, 0.0);
        }
    }

    /// What springs carry at a fraction of the last step where the method said it: what they
    /// carry that steps do not resolve is not what positions between them say.
    fn carried(&self, fraction: f64) -> Option<Vec<f64>> {
        self.is_carried.then(|| {
            let ends = self.start.iter().zip(&self.end);
            let between = ends.map(|(start, end)| start + (end - start) * fraction);
            between.collect()
        })
    }

    /// Tensions at a fraction of the last step, where the nodes are as in `state`, in N; they
    /// count for the peaks.
    pub(crate) fn tensions(&mut self, system: &System, fraction: f64, state: &State) -> Vec<f64> {
        let carried = self.carried(fraction);
        let mut tensions = vec![0.0; self.n_springs];
        let (peaks, time) = (&mut self.peaks, state.time);
        system.each_tension(&state.x, carried.as_deref(), &mut |spring, tension| {
            tensions[spring] = tension;
            peaks[spring].take(time, tension);
        });
        tensions
    }

    /// At a fraction of the last step, where the nodes are as in `state`; without the
    /// weight of fixed nodes.
    pub(crate) fn members(&mut self, system: &System, fraction: f64, state: &State) -> Members {
        let tensions = self.tensions(system, fraction, state);
        let carried = self.carried(fraction);
        let carried = carried.as_deref();
        let forces = system.support_forces(state.time, &state.x, &state.v, carried);
        let reactions = forces.into_iter().map(|(block, force)| Reaction {
            node: system.numbering().node(block),
            force,
        });
        let mut reactions: Vec<Reaction> = reactions.collect();
        reactions.sort_by_key(|reaction| reaction.node);
        Members {
            tensions,
            reactions,
            broken: system.broken(),
            yielded: system.yielded().iter().map(|(spring, _)| *spring).collect(),
        }
    }

    /// What each spring came to so far.
    pub(crate) fn peaks(&self) -> &[Peak] {
        &self.peaks
    }

    /// What was carried at the end of the last step.
    pub(crate) fn end(&self) -> &[f64] {
        &self.end
    }

    /// The last step began where `start` was carried.
    pub(crate) fn began_with(&mut self, start: Vec<f64>) {
        self.start = start;
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.reals(&mut self.start);
        archive.reals(&mut self.end);
        archive.flag(&mut self.is_carried);
        for peak in &mut self.peaks {
            for real in [
                &mut peak.max_tension,
                &mut peak.time_of_max,
                &mut peak.min_tension,
                &mut peak.time_of_min,
            ] {
                archive.real(real);
            }
        }
    }
}

/// Members of a whole scene from those of its parts.
pub(crate) struct Gathered {
    members: Members,
}

impl Gathered {
    pub(crate) fn new(n_springs: usize) -> Self {
        Self {
            members: Members {
                tensions: vec![0.0; n_springs],
                ..Members::default()
            },
        }
    }

    /// Adds those of a part, whose nodes and springs are these of the scene.
    pub(crate) fn add(&mut self, part: Members, nodes: &[usize], springs: &[usize]) {
        let all = &mut self.members;
        for (k, &spring) in springs.iter().enumerate() {
            all.tensions[spring] = part.tensions[k];
        }
        let in_scene = |&spring: &usize| springs[spring];
        all.broken.extend(part.broken.iter().map(in_scene));
        all.yielded.extend(part.yielded.iter().map(in_scene));
        all.reactions
            .extend(part.reactions.iter().map(|reaction| Reaction {
                node: nodes[reaction.node],
                ..*reaction
            }));
    }

    /// Nodes that hold several parts have one reaction.
    pub(crate) fn finish(self) -> Members {
        let mut members = self.members;
        members.broken.sort_unstable();
        members.yielded.sort_unstable();
        members.reactions.sort_by_key(|reaction| reaction.node);
        members.reactions.dedup_by(|next, kept| {
            let is_same = next.node == kept.node;
            if is_same {
                kept.force += next.force;
            }
            is_same
        });
        members
    }
}

/// Positions and velocities as global vectors at a time in s.
pub(crate) fn state_of(system: &System, time: f64, nodes: &NodeStates) -> State {
    let mut state = State::initial(system);
    state.gather(system, nodes);
    state.time = time;
    state
}
