//! Many runs of one scene with different numbers in it.
//!
//! A [`Plan`] has [settings](Setting) with values, every one with every other, and
//! [measures](Measure) of each run. A [`Folder`] has the plan on disk, and workers, in
//! any number of processes, that take runs from it; each writes one line of a table.
//!
//! ```
//! use springs::sweep::{Plan, Subject, measure};
//! use springs::scene::generate::{Material, chain};
//! use springs::solver::Interrupt;
//!
//! let subject = Subject::of(chain(4, Material::of_chain(4)));
//! let plan = Plan::new(subject, &["EA=log:1e3:1e5:3".to_owned()], &["max(tension)".to_owned()])?;
//! let run = plan.run(2).expect("the last of three");
//! assert_eq!(run.values, [1e5]);
//! let measured = measure(&plan.subject_of(&run)?, plan.measures(), &Interrupt::default())?;
//! assert!(measured[0] > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod folder;
mod measure;
mod selection;
mod setting;
mod table;
mod values;

pub use folder::{Claim, Folder, FolderError, Progress, RESULTS};
pub use measure::{Measure, MeasureError, RunFailure, measure, what_can_be_measured};
pub use setting::{Setting, SettingError, what_can_be_set};
pub use values::{ValuesError, values};

use springs_io::Inputs;
use springs_scene::{RunOptions, Scene};

/// What is run: a scene, how, and how its file gives its springs.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// How it is run.
    pub options: RunOptions,
    /// Materials and damping ratios, which the scene does not keep.
    pub inputs: Inputs,
}

impl Subject {
    /// A scene without materials, run on one thread.
    pub fn of(scene: Scene) -> Self {
        let mut options = RunOptions::default();
        options.threads = 1;
        Self {
            scene,
            options,
            inputs: Inputs::default(),
        }
    }
}

/// A setting and the values that it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What is set.
    pub setting: Setting,
    /// To what.
    pub values: Vec<f64>,
}

/// What is to be run, and what of it is wanted.
#[derive(Clone, Debug)]
pub struct Plan {
    subject: Subject,
    axes: Vec<Axis>,
    measures: Vec<Measure>,
}

/// One run of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Its number, from 0: the last axis changes first.
    pub index: usize,
    /// The value of each axis.
    pub values: Vec<f64>,
}

/// A plan is not possible.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A setting.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Its values.
    #[error("`{setting}`: {source}")]
    Values {
        /// The setting.
        setting: String,
        /// What is wrong.
        source: ValuesError,
    },
    /// A value of it.
    #[error("`{setting}` = {value:?}: {source}")]
    Value {
        /// The setting.
        setting: String,
        /// The value.
        value: f64,
        /// What is wrong.
        source: SettingError,
    },
    /// A measure.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// It is not written as one.
    #[error("`{text}` must be NAME=VALUES, such as EA=log:1e3:1e6:20 or step=0.01,0.02")]
    NoAxis {
        /// What is.
        text: String,
    },
    /// The same name twice.
    #[error("`{name}` is there twice")]
    Twice {
        /// The name.
        name: String,
    },
    /// Nothing is set, or nothing is measured.
    #[error("a sweep needs {what}")]
    Nothing {
        /// What it needs.
        what: &'static str,
    },
    /// More runs than anybody makes.
    #[error("{n:e} runs are more than {most}", most = Plan::MOST)]
    TooMany {
        /// How many.
        n: f64,
    },
}

impl Plan {
    /// So many runs at most.
    pub const MOST: usize = 10_000_000;

    /// From axes such as `EA=log:1e3:1e6:20` and the names of measures. Every value is
    /// tried on the scene by itself.
    ///
    /// # Errors
    ///
    /// If anything of it is wrong.
    pub fn new(subject: Subject, axes: &[String], measures: &[String]) -> Result<Self, PlanError> {
        let parsed = axes.iter().map(|text| {
            let no_axis = || PlanError::NoAxis { text: text.clone() };
            let (name, list) = text.split_once('=').ok_or_else(no_axis)?;
            let setting: Setting = name.trim().parse()?;
            let values = values(list).map_err(|source| PlanError::Values {
                setting: setting.to_string(),
                source,
            })?;
            Ok(Axis { setting, values })
        });
        let axes = parsed.collect::<Result<Vec<Axis>, PlanError>>()?;
        Self::of_axes(subject, axes, measures)
    }

    /// The same of axes.
    ///
    /// # Errors
    ///
    /// If anything of it is wrong.
    pub fn of_axes(
        subject: Subject,
        axes: Vec<Axis>,
        measures: &[String],
    ) -> Result<Self, PlanError> {
        if axes.is_empty() {
            let what = "something to set, as --set EA=log:1e3:1e6:20";
            return Err(PlanError::Nothing { what });
        }
        if measures.is_empty() {
            let what = "something to measure, as --measure 'max(tension)'";
            return Err(PlanError::Nothing { what });
        }
        let n = axes.iter().map(|axis| axis.values.len() as f64).product();
        if n > Self::MOST as f64 {
            return Err(PlanError::TooMany { n });
        }
        let measures: Result<Vec<Measure>, MeasureError> =
            measures.iter().map(|name| name.parse()).collect();
        let measures = measures?;
        let settings = axes.iter().map(|axis| axis.setting.to_string());
        let mut names: Vec<String> = settings
            .chain(measures.iter().map(Measure::to_string))
            .collect();
        names.sort_unstable();
        if let Some(same) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(PlanError::Twice {
                name: same[0].clone(),
            });
        }
        measures
            .iter()
            .try_for_each(|measure| measure.check(&subject))?;
        for Axis { setting, values } in &axes {
            for &value in values {
                let set = subject.with(std::slice::from_ref(setting), &[value]);
                set.map_err(|source| PlanError::Value {
                    setting: setting.to_string(),
                    value,
                    source,
                })?;
            }
        }
        Ok(Self {
            subject,
            axes,
            measures,
        })
    }

    /// What is run.
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// What is set.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// What is measured.
    pub fn measures(&self) -> &[Measure] {
        &self.measures
    }

    /// How many runs there are.
    pub fn n_runs(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// A run by its number; `None` if there are not so many.
    pub fn run(&self, index: usize) -> Option<Run> {
        if index >= self.n_runs() {
            return None;
        }
        let mut left = index;
        let mut values = vec![0.0; self.axes.len()];
        for (axis, value) in self.axes.iter().zip(&mut values).rev() {
            *value = axis.values[left % axis.values.len()];
            left /= axis.values.len();
        }
        Some(Run { index, values })
    }

    /// What a run of it runs.
    ///
    /// # Errors
    ///
    /// If its values are not possible together.
    pub fn subject_of(&self, run: &Run) -> Result<Subject, SettingError> {
        let settings: Vec<Setting> = self.axes.iter().map(|axis| axis.setting.clone()).collect();
        self.subject.with(&settings, &run.values)
    }
}

#[cfg(test)]
mod tests;
