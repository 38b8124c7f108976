//! What breaks at the ends of steps.
//!
//! It is found out once nobody asks for states within the step any more, since these
//! are those of what was whole.

use super::Simulation;
use crate::control::controller::{Controller, Schedule};
use crate::run::breaks::Break;
use crate::{Archive, Interval, Stepper};
use springs_scene::Scene;

/// Something that breaks soon, known from a step that was made and taken back.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ahead {
    /// By this time it does, in s.
    by: f64,
    /// How late that may be found out, in s.
    within: f64,
}

/// The part of the tolerance that is for what breaks late.
const SHARE: f64 = 0.25;
/// When something breaks is found to no less than this part of the duration.
const SHORTEST: f64 = 1e-9;

impl Ahead {
    /// What breaks at the end of an attempted step that is too long for it: the nodes of a
    /// spring that breaks so much late fly off until the end with what it gave them
    /// meanwhile. `None` where methods carry tensions, too, which are those of steps that
    /// stand.
    pub(super) fn of(stepper: &Stepper, before: &Controller, step: Interval) -> Option<Self> {
        let system = stepper.system();
        if !system.has_memory() || stepper.method().tensions().is_some() {
            return None;
        }
        let jump = system.jump_at(&stepper.state().x)?;
        let allowed = SHARE * before.tolerance() / (jump * before.left());
        let within = allowed.max(SHORTEST * before.duration());
        (step.size > within).then_some(Self {
            by: step.end,
            within,
        })
    }

    /// The size of a step from `start`, of `h` at most, all in s: half of the way to what
    /// is ahead until that is near enough.
    pub(super) fn limit(ahead: Option<Self>, start: f64, h: f64) -> f64 {
        match ahead.map(|ahead| (ahead.by - start, ahead.within)) {
            Some((left, within)) if left > 0.0 => h.min((0.5 * left).max(within)),
            _ => h,
        }
    }
}

impl Simulation {
    /// Springs that are beyond their limits at the end of the last step break, if that is
    /// not done yet. Else they do when nobody asks for states within that step any more:
    /// when the next one begins, or after its last frame.
    pub fn end_step(&mut self) {
        if !std::mem::take(&mut self.is_end_open) {
            return;
        }
        let Some(update) = self.stepper.update_memory() else {
            return;
        };
        self.books.ledger.broken_energy += update.other_energy;
        if !update.is_abrupt {
            return;
        }
        self.ahead = None;
        let (system, state) = (self.stepper.system(), self.stepper.state());
        for broken in &update.broken {
            self.books.ledger.broken_energy += broken.energy;
            self.breaks.push(Break {
                time: state.time,
                spring: broken.spring,
                energy: broken.energy,
            });
        }
        if let Some(track) = &mut self.track {
            track.clear_broken(system, state);
        }
        if let Schedule::Adaptive(controller) = &mut self.schedule {
            controller.begin_anew();
        }
    }

    /// Writes into the springs of a scene what is broken or has yielded, where
    /// `spring_of` gives for each spring of the simulation the one of that scene.
    ///
    /// # Panics
    ///
    /// If the scene has no such spring.
    pub fn write_memory_to(&self, scene: &mut Scene, spring_of: impl Fn(usize) -> usize) {
        for spring in self.system().broken() {
            scene.springs[spring_of(spring)].broken = true;
        }
        for (spring, elongation) in self.system().yielded() {
            scene.springs[spring_of(spring)].yielded = elongation;
        }
    }

    /// The springs that broke so far, in the order in which they did.
    pub fn breaks(&self) -> &[Break] {
        &self.breaks
    }

    /// Hands over what broke; nothing where nothing can.
    pub(super) fn archive_breaks(&mut self, archive: &mut Archive) {
        if !self.system().has_memory() {
            return;
        }
        self.stepper.each_memory(archive);
        archive.flag(&mut self.is_end_open);
        archive.option(&mut self.ahead, |ahead, archive| {
            archive.real(&mut ahead.by);
            archive.real(&mut ahead.within);
        });
        let mut n = self.breaks.len() as u64;
        archive.word(&mut n);
        // Each spring breaks once.
        if n > self.n_springs as u64 {
            return archive.refuse();
        }
        self.breaks.resize(n as usize, Break::default());
        self.breaks.iter_mut().for_each(|one| one.archive(archive));
        if self.breaks.iter().any(|one| one.spring >= self.n_springs) {
            archive.refuse();
        }
    }
}
