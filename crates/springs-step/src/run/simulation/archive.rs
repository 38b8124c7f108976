//! What a run has come to, saved and loaded.

use super::{Simulation, Switch};
use crate::control::auto::Settled;
use crate::control::controller::Schedule;
use crate::{Choice, ForeignState, HiddenState, StepPlan};
use springs_scene::Method;

/// More than trial runs ever settle.
const MOST_EQUAL_STEPS: u64 = 1 << 30;

impl Simulation {
    /// Everything that the run has come to, as words that mean something to
    /// [`Self::restore`] only.
    pub fn save(&mut self) -> Vec<u64> {
        let mut state = HiddenState::saving();
        self.visit(&mut state);
        state.into_words()
    }

    /// Goes on where another run of the same scene was when it was saved; from
    /// there on it gives the same bits.
    ///
    /// # Errors
    ///
    /// If the words do not come from a run of this scene; this one is of no use
    /// any more then.
    pub fn restore(&mut self, words: Vec<u64>) -> Result<(), ForeignState> {
        let mut state = HiddenState::loading(words);
        self.visit(&mut state);
        state.finish()
    }

    /// Hands over everything that the run has come to; the scene and what
    /// follows from it alone are not among it.
    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        self.visit_controls(state);
        self.visit_breaks(state);
        if self.needs_trials && self.visit_settled(state).is_none() {
            return state.refuse();
        }
        if let Some(auto) = &mut self.auto {
            let mut current = auto.current() as u64;
            state.word(&mut current);
            let is_settled = matches!(self.schedule, Schedule::Adaptive(_));
            let is_in_use = current == auto.current() as u64 && !self.choice.is_open();
            if is_settled && !is_in_use {
                let picked = auto.switch_to(self.stepper.system(), current as usize);
                if picked.and_then(|picked| self.put_to_use(picked)).is_none() {
                    return state.refuse();
                }
            }
        }
        if let Some(auto) = &mut self.auto {
            auto.visit(self.stepper.system(), state);
        }
        if let Schedule::Adaptive(controller) = &mut self.schedule {
            controller.visit(state);
        }
        let mut is_tracked = self.track.is_some();
        state.flag(&mut is_tracked);
        if is_tracked {
            self.track_members();
        } else if self.track.is_some() {
            return state.refuse();
        }
        if let Some(track) = &mut self.track {
            track.visit(state);
        }
        self.stepper.visit(state);
        self.between.visit(state);
        self.ledger.visit(state);
        self.ledger_before.visit(state);
        self.last_flows.visit(state);
        state.real(&mut self.most_energy);
        self.work.visit(state);
        self.trial_work.visit(state);
        state.duration(&mut self.trial_time);
        state.option(&mut self.last, |interval, state| {
            for real in [&mut interval.start, &mut interval.end, &mut interval.size] {
                state.real(real);
            }
        });
        state.flag(&mut self.is_told);
        state.option(&mut self.shown, |shown, state| shown.visit(state));
        self.visit_switches(state);
        self.stepper.scatter(&mut self.nodes);
    }

    /// What trial runs have settled; `None` if it cannot be what they settled here.
    fn visit_settled(&mut self, state: &mut HiddenState) -> Option<()> {
        let was_open = self.needs_trials();
        let mut is_open = was_open;
        state.flag(&mut is_open);
        if is_open {
            return was_open.then_some(());
        }
        let mut steps = self.plan().map_or(0, |plan| plan.n_steps());
        let (mut method, mut reason) = (self.choice.method, self.choice.reason.clone());
        state.word(&mut steps);
        visit_method_name(&mut method, state);
        state.text(&mut reason);
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
        state.is_sound().then_some(())
    }

    fn visit_switches(&mut self, state: &mut HiddenState) {
        let mut n = self.switches.len() as u64;
        state.word(&mut n);
        let mut switches = std::mem::take(&mut self.switches).into_iter();
        for _ in 0..n {
            let mut switch = switches.next().unwrap_or(Switch {
                time: 0.0,
                method: Method::Auto,
                reason: String::new(),
            });
            state.real(&mut switch.time);
            visit_method_name(&mut switch.method, state);
            state.text(&mut switch.reason);
            if !state.is_sound() {
                return;
            }
            self.switches.push(switch);
        }
    }
}

/// A method, by its place in the list of all.
fn visit_method_name(method: &mut Method, state: &mut HiddenState) {
    let index = Method::ALL.iter().position(|other| other == method);
    let mut index = index.unwrap_or_default() as u64;
    state.word(&mut index);
    match Method::ALL.get(index as usize) {
        Some(loaded) => *method = *loaded,
        None => state.refuse(),
    }
}
