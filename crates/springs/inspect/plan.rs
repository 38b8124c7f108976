//! How a scene will be simulated, and why so.

use serde::Serialize;
use springs_scene::{Method, Scene, Start, StepControl};
use springs_step::{Islands, Pace};

/// How a scene will be simulated; of several parts, the largest.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// The method; `auto` where trial runs are to choose it.
    pub method: String,
    /// The tangent, if the method has a choice of it.
    pub tangent: Option<String>,
    /// Why, where the settings left it open.
    pub reason: Option<String>,
    /// In s.
    pub duration: f64,
    /// Steps of fixed size: how many.
    pub steps: Option<u64>,
    /// Their size, in s.
    pub step_size: Option<f64>,
    /// The size of a last, shorter one, in s.
    pub shortened_last_step: Option<f64>,
    /// The error of positions to choose steps by, in m.
    pub tolerance: Option<f64>,
    /// Whether nothing was said of steps, so that the tolerance is 1e-3 of the size of
    /// each part.
    pub is_default_tolerance: bool,
    /// What trial runs at the beginning of the run settle, if there are any.
    pub trials_settle: Option<&'static str>,
    /// Whether a run finds an equilibrium first, and starts there.
    pub starts_from_equilibrium: bool,
}

impl Plan {
    /// Of a scene that was compiled into `islands`, with the start that it asks for.
    pub(super) fn of(scene: &Scene, start: Start, islands: &Islands) -> Self {
        let largest = islands.largest().simulation();
        let (choice, plan) = (largest.choice(), largest.plan());
        let settled = match choice.method {
            Method::Auto => "the method and its steps",
            _ => "the number of equal steps",
        };
        Self {
            method: choice.method.to_string(),
            tangent: choice.tangent.map(|tangent| tangent.to_string()),
            reason: Some(choice.reason.clone()).filter(|reason| !reason.is_empty()),
            duration: scene.settings.duration,
            steps: plan.map(|plan| plan.n_steps()),
            step_size: plan.map(|plan| plan.step_size),
            shortened_last_step: plan.and_then(|plan| plan.shortened),
            tolerance: match choice.pace {
                Pace::Fixed(_) => None,
                Pace::Tolerance(tolerance) => Some(tolerance),
            },
            is_default_tolerance: scene.settings.step == StepControl::Auto,
            trials_settle: largest.needs_trials().then_some(settled),
            starts_from_equilibrium: start == Start::Equilibrium,
        }
    }
}
