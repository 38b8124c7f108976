//! Run time against error for one's own scene.
//!
//! A [`Study`] makes a reference solution and says how far it can be trusted,
//! runs the methods over a sweep of tolerances and steps, and sets the time
//! each run took beside the error it ended with. The error is the largest
//! distance of a node from its place in the reference at the end; where errors
//! are a tenth of the motion and more, at any time of the run, a result is
//! called worthless and never recommended.
//!
//! Every run is made in a thread of its own, so that none finds the processor or
//! the memory as another one left it. The time of a run is the least of several:
//! compiling the scene and all steps, without reading it or writing anything.
//!
//! A [`StabilityMap`] says what becomes of the scene's energy at any step size
//! and stiffness.

mod advice;
mod diagram;
mod order;
mod reference;
mod run;
mod stability;
mod sweep;
mod text;

pub use advice::Advice;
pub use diagram::diagram;
pub use reference::Reference;
pub use stability::{
    Fate, StabilityMap, StabilityTrial, stability, stability_csv, stability_diagram,
};
pub use sweep::{MethodSummary, Setting, SweepEnd, Trial};
pub use text::{csv, method_notes, recommendations, reference_csv, reference_note, table};

use run::{Case, Clock};
use serde::Serialize;
use springs_assembly::compile;
use springs_scene::{Method, RunOptions, Scene};
use springs_step::SetupError;
use std::ops::ControlFlow;
use std::time::Duration;

/// How a study is made.
#[derive(Clone, Debug)]
pub struct Options {
    /// The methods to compare.
    pub methods: Vec<Method>,
    /// Time that all runs together should take.
    pub budget: Duration,
    /// How often the runs that may be recommended are measured, spread over
    /// time; the least time counts.
    pub repeats: usize,
    /// What a recommended command begins with.
    pub command: String,
    /// How all of them are run.
    pub run: RunOptions,
}

impl Default for Options {
    /// All methods but [`Method::Auto`], half a minute, three repeats.
    fn default() -> Self {
        let all = Method::ALL.iter().copied();
        Self {
            methods: all.filter(|method| *method != Method::Auto).collect(),
            budget: Duration::from_secs(30),
            repeats: 3,
            command: "springs run SCENE.ron".to_owned(),
            run: RunOptions::default(),
        }
    }
}

/// What a study found out.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Study {
    /// Name of the scene.
    pub scene: String,
    /// Simulated time, in s.
    pub duration: f64,
    /// The solution that errors are measured against.
    pub reference: Reference,
    /// All runs, in the order in which they were made.
    pub trials: Vec<Trial>,
    /// What became of each method.
    pub methods: Vec<MethodSummary>,
    /// Methods that cannot move the scene, and why.
    pub refused: Vec<(String, String)>,
    /// The quickest run for each error, largest error first.
    pub advice: Vec<Advice>,
    /// Whether it was stopped before its end.
    pub interrupted: bool,
}

/// Where a study is.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Progress<'a> {
    /// What is being run; empty while that goes on.
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
    /// There is no time to study.
    #[error("the duration is {0} s, and a study needs one that is greater than zero")]
    NoDuration(f64),
    /// Each method that was asked for is refused.
    #[error("no method that was asked for can move the scene: {}", refusals(.0))]
    AllRefused(Vec<(String, String)>),
    /// No method solved the scene twice within the budget.
    #[error("no reference solution could be made within the budget")]
    NoReference,
    /// No method solved the scene, and time does not help.
    #[error("no reference solution can be made: {method}: {reason}")]
    Unsolvable {
        /// The method that came the furthest, in kebab-case.
        method: String,
        /// Why it could not go on.
        reason: String,
    },
    /// The budget was used up before a run was finished.
    #[error("no run was finished within the budget")]
    NoRun,
    /// It was stopped before there was anything to keep.
    #[error("stopped before there was a result")]
    Stopped,
    /// The system gave no thread to run in.
    #[error("no thread could be started: {0}")]
    NoThread(#[from] std::io::Error),
}

fn refusals(refused: &[(String, String)]) -> String {
    let each: Vec<String> = refused
        .iter()
        .map(|(method, why)| format!("{method}: {why}"))
        .collect();
    each.join("; ")
}

/// Makes a study; `watch` sees the progress and may stop it, which keeps what
/// there is.
///
/// # Errors
///
/// If the scene cannot be simulated, or if no reference or no run can be made.
pub fn study(
    scene: &Scene,
    options: &Options,
    watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Study, StudyError> {
    let duration = scene.settings.duration;
    if duration <= 0.0 {
        return Err(StudyError::NoDuration(duration));
    }
    compile(scene).map_err(SetupError::from)?;
    let case = &Case {
        scene: scene.clone(),
        options: options.run,
    };
    let mut clock = Clock::new(options.budget, watch);
    let (reference, frames) = reference::make(case, &mut clock)?;
    let mut study = Study {
        scene: scene.name.clone(),
        duration,
        reference,
        trials: Vec::new(),
        methods: Vec::new(),
        refused: Vec::new(),
        advice: Vec::new(),
        interrupted: false,
    };
    sweep::run(case, options, &frames, &mut study, &mut clock)?;
    advice::measure_again(case, options, &mut study, &mut clock)?;
    study.advice = advice::advice(&study, &options.command);
    Ok(study)
}
