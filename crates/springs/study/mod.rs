//! Run time against error for one's own scene.
//!
//! A [`Study`] makes a reference solution and says how far it can be trusted,
//! runs the methods over a sweep of tolerances and steps, and sets the time
//! each run took beside the error it ended with. The error is the largest
//! distance of a node from its place in the reference at the end.
//!
//! A [`StabilityMap`] says what becomes of the scene's energy at any step size
//! and stiffness.

mod diagram;
mod reference;
mod stability;
mod sweep;
mod words;

pub use diagram::diagram;
pub use reference::Reference;
pub use stability::{
    Fate, StabilityMap, StabilityTrial, stability, stability_csv, stability_diagram,
};
pub use sweep::{Setting, Trial};
pub use words::{csv, recommendations, table};

use serde::Serialize;
use springs_scene::{Method, Scene};
use springs_step::SetupError;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How a study is made.
#[derive(Clone, Debug)]
pub struct Options {
    /// The methods to compare.
    pub methods: Vec<Method>,
    /// Time that all runs together should take.
    pub budget: Duration,
    /// How often each run is repeated, if it is short; the median counts.
    pub repeats: usize,
}

impl Default for Options {
    /// All methods, half a minute, three repeats.
    fn default() -> Self {
        let all = Method::ALL.iter().copied();
        Self {
            methods: all.filter(|method| *method != Method::Auto).collect(),
            budget: Duration::from_secs(30),
            repeats: 3,
        }
    }
}

/// What a study found out.
#[derive(Clone, Debug, Serialize)]
pub struct Study {
    /// Name of the scene.
    pub scene: String,
    /// Simulated time, in s.
    pub duration: f64,
    /// The solution that errors are measured against.
    pub reference: Reference,
    /// All runs, in the order in which they were made.
    pub trials: Vec<Trial>,
    /// Methods that cannot move the scene, and why.
    pub refused: Vec<(String, String)>,
    /// Whether it was stopped before its end.
    pub interrupted: bool,
}

/// Where a study is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// What is being run.
    pub what: &'a str,
    /// Part of the budget that is used up.
    pub fraction: f64,
}

/// Why there is no study.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The scene cannot be simulated.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// No method solved the scene twice with the same result.
    #[error("no reference solution could be made within the budget")]
    NoReference,
    /// It was stopped before there was a reference.
    #[error("stopped before there was a reference solution")]
    Stopped,
}

/// Makes a study; `watch` sees the progress and may stop it, which keeps what
/// there is.
///
/// # Errors
///
/// If the scene cannot be simulated or no reference can be made.
pub fn study(
    scene: &Scene,
    options: &Options,
    watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Study, StudyError> {
    let begin = Instant::now();
    let mut clock = Clock {
        begin,
        budget: options.budget,
        watch,
    };
    let (reference, positions) = reference::make(scene, &mut clock)?;
    let mut study = Study {
        scene: scene.name.clone(),
        duration: scene.settings.duration,
        reference,
        trials: Vec::new(),
        refused: Vec::new(),
        interrupted: false,
    };
    sweep::run(scene, options, &positions, &mut study, &mut clock);
    Ok(study)
}

/// The budget and who watches over it.
struct Clock<'a> {
    begin: Instant,
    budget: Duration,
    watch: &'a mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
}

impl Clock<'_> {
    /// Part of the budget that is used up.
    fn fraction(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() / self.budget.as_secs_f64()
    }

    fn tell(&mut self, what: &str) -> ControlFlow<()> {
        let fraction = self.fraction();
        (self.watch)(Progress { what, fraction })
    }
}
