//! What a run has come to, saved and loaded.

use super::{Simulation, Switch};
use crate::control::auto::Settled;
use crate::control::controller::Schedule;
use crate::{Archive, Choice, ForeignState, StepPlan};
use springs_scene::Method;

/// More than trial runs ever settle.
const MOST_EQUAL_STEPS: u64 = 1 << 30;

impl Simulation {
    /// Everything that the run has come to, as words that mean something to
    /// [`Self::restore`] only.
    pub fn save(&mut self) -> Vec<u64> {
        let mut archive = Archive::saving();
        self.archive(&mut archive);
        archive.into_words()
    }

    /// Goes on where another run of the same scene was when it was saved; from
    /// there on it gives the same bits.
    ///
    /// # Errors
    ///
    /// If the words do not come from a run of this scene; this one is of no use
    /// any more then.
    pub fn restore(&mut self, words: Vec<u64>) -> Result<(), ForeignState> {
        let mut archive = Archive::loading(words);
        self.archive(&mut archive);
        archive.finish()
    }

    /// Hands over everything that the run has come to; the scene and what
    /// follows from it alone are not among it.
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        self.archive_controls(archive);
        self.archive_breaks(archive);
        if self.needs_trials && self.archive_settled(archive).is_none() {
            return archive.refuse();
        }
        if let Some(auto) = &mut self.auto {
            let mut current = auto.current() as u64;
            archive.word(&mut current);
            let is_settled = matches!(self.schedule, Schedule::Adaptive(_));
            let is_in_use = current == auto.current() as u64 && !self.choice.is_open();
            if is_settled && !is_in_use {
                let picked = auto.switch_to(self.stepper.system(), current as usize);
                if picked.and_then(|picked| self.put_to_use(picked)).is_none() {
                    return archive.refuse();
                }
            }
        }
        if let Some(auto) = &mut self.auto {
            auto.archive(self.stepper.system(), archive);
        }
        if let Schedule::Adaptive(controller) = &mut self.schedule {
            controller.archive(archive);
        }
        let mut is_tracked = self.track.is_some();
        archive.flag(&mut is_tracked);
        if is_tracked {
            self.track_members();
        } else if self.track.is_some() {
            return archive.refuse();
        }
        if let Some(track) = &mut self.track {
            track.archive(archive);
        }
        self.stepper.archive(archive);
        self.dense_output.archive(archive);
        let system = self.stepper.system();
        self.books.archive(system, archive);
        self.books_before.archive(system, archive);
        self.last_flows.archive(system, archive);
        archive.real(&mut self.most_energy);
        self.work.archive(archive);
        self.trial_work.archive(archive);
        archive.duration(&mut self.trial_time);
        archive.option(&mut self.last, |interval, archive| {
            for real in [&mut interval.start, &mut interval.end, &mut interval.size] {
                archive.real(real);
            }
        });
        for option in [&mut self.last_rate, &mut self.estimated_error] {
            archive.option(option, |number, archive| archive.real(number));
        }
        archive.flag(&mut self.is_told);
        archive.option(&mut self.shown, |shown, archive| shown.archive(archive));
        self.archive_switches(archive);
        self.stepper.scatter(&mut self.nodes);
    }

    /// What trial runs have settled; `None` if it cannot be what they settled here.
    fn archive_settled(&mut self, archive: &mut Archive) -> Option<()> {
        let was_open = self.needs_trials();
        let mut is_open = was_open;
        archive.flag(&mut is_open);
        if is_open {
            return was_open.then_some(());
        }
        let mut steps = self.plan().map_or(0, |plan| plan.n_steps());
        let (mut method, mut reason) = (self.choice.method, self.choice.reason.clone());
        archive.word(&mut steps);
        archive_method_name(&mut method, archive);
        archive.text(&mut reason);
        if let Schedule::Open(controller) = self.schedule {
            let is_plan = (1..=MOST_EQUAL_STEPS).contains(&steps);
            let plan = StepPlan::equal(self.duration, steps.max(1));
            match (&self.auto, method) {
                (None, _) if is_plan && method == self.choice.method => {
                    self.schedule = Schedule::Fixed(plan);
                }
                (Some(_), Method::FilteredLeapfrog) if is_plan => {
                    let choice = Choice {
                        method,
                        ..self.choice.clone()
                    };
                    let mut method = choice.build(self.stepper.system()).ok()?;
                    method.set_interrupt(&self.interrupt);
                    let schedule = Schedule::Fixed(plan);
                    self.put_settled(Settled {
                        choice,
                        method,
                        schedule,
                    })
                    .ok()?;
                }
                (Some(_), _) if steps == 0 => self.schedule = Schedule::Adaptive(controller),
                _ => return None,
            }
        }
        self.choice.reason = reason;
        archive.is_sound().then_some(())
    }

    fn archive_switches(&mut self, archive: &mut Archive) {
        let mut n = self.switches.len() as u64;
        archive.word(&mut n);
        let mut switches = std::mem::take(&mut self.switches).into_iter();
        for _ in 0..n {
            let mut switch = switches.next().unwrap_or(Switch {
                time: 0.0,
                method: Method::Auto,
                reason: String::new(),
            });
            archive.real(&mut switch.time);
            archive_method_name(&mut switch.method, archive);
            archive.text(&mut switch.reason);
            if !archive.is_sound() {
                return;
            }
            self.switches.push(switch);
        }
    }
}

/// A method, by its place in the list of all.
fn archive_method_name(method: &mut Method, archive: &mut Archive) {
    let index = Method::ALL.iter().position(|other| other == method);
    let mut index = index.unwrap_or_default() as u64;
    archive.word(&mut index);
    match Method::ALL.get(index as usize) {
        Some(loaded) => *method = *loaded,
        None => archive.refuse(),
    }
}
