//! Run time against error.

use crate::arrays::array1;
use crate::attended::{Progress, Shared, attended};
use crate::errors::{Fault, interrupted};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use springs::scene::{RunOptions, Scene};
use springs::study::{
    Options, Setting, Study, StudyError, csv, diagram, recommendations, study, table,
};
use std::ops::ControlFlow;

/// Run time against error, method by method.
#[pyclass(module = "springs", name = "Study", frozen)]
pub(crate) struct PyStudy(Study);

/// Makes a study; one that is interrupted keeps what there is.
pub(crate) fn make(
    py: Python<'_>,
    scene: &Scene,
    options: Options,
    progress: &Progress,
) -> PyResult<PyStudy> {
    let shared = Shared::default();
    let work = || {
        study(scene, &options, &mut |progress| {
            shared.set_progress(progress.fraction.min(1.0));
            if shared.is_stopped() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
    };
    let (made, raised) = attended(py, &shared, progress, work)?;
    let made = match made {
        Ok(made) => made,
        Err(error) => {
            return Err(match (raised, &error) {
                (Some(raised), _) => raised,
                (None, StudyError::Setup(error)) => Fault::from(error).into(),
                (None, error) => Fault::scene(error.to_string()).into(),
            });
        }
    };
    let made = PyStudy(made);
    match raised {
        None => Ok(made),
        Some(raised) => {
            let error = interrupted(py, raised, 0.0)?;
            error.value(py).setattr("result", Py::new(py, made)?)?;
            Err(error)
        }
    }
}

/// How a study is made.
pub(crate) fn options(budget: f64, run: RunOptions) -> PyResult<Options> {
    let budget = std::time::Duration::try_from_secs_f64(budget)
        .map_err(|error| Fault::scene(format!("budget must be a number of seconds: {error}")))?;
    Ok(Options {
        budget,
        run,
        ..Options::default()
    })
}

#[pymethods]
impl PyStudy {
    /// The runs as arrays (r,) by name: `method`, `step` (s) and `tolerance` (m), one of
    /// them NaN, `steps`, `seconds`, `error` (m), `worthless`.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let trials = &self.0.trials;
        let column = |of: &dyn Fn(&springs::study::Trial) -> f64| -> Vec<f64> {
            trials.iter().map(of).collect()
        };
        let rows = PyDict::new(py);
        let methods: Vec<&str> = trials.iter().map(|trial| trial.method.as_str()).collect();
        let methods = py.import("numpy")?.call_method1("array", (methods,))?;
        rows.set_item("method", methods)?;
        let step = |trial: &springs::study::Trial| match trial.setting {
            Setting::Step(step) => step,
            Setting::Tolerance(_) => f64::NAN,
        };
        let tolerance = |trial: &springs::study::Trial| match trial.setting {
            Setting::Step(_) => f64::NAN,
            Setting::Tolerance(tolerance) => tolerance,
        };
        rows.set_item("step", array1(py, column(&step)))?;
        rows.set_item("tolerance", array1(py, column(&tolerance)))?;
        let steps = trials.iter().map(|trial| trial.steps as i64).collect();
        rows.set_item("steps", array1::<i64>(py, steps))?;
        rows.set_item("seconds", array1(py, column(&|trial| trial.seconds)))?;
        rows.set_item("error", array1(py, column(&|trial| trial.error)))?;
        let worthless = trials.iter().map(|trial| trial.worthless).collect();
        rows.set_item("worthless", array1::<bool>(py, worthless))?;
        Ok(rows)
    }

    /// Which method and step are the quickest for which error, as sentences.
    #[getter]
    fn advice(&self) -> Vec<String> {
        recommendations(&self.0)
    }

    /// The runs as CSV.
    #[getter]
    fn csv(&self) -> String {
        csv(&self.0)
    }

    /// Time against error as a picture.
    #[getter]
    fn svg(&self) -> String {
        diagram(&self.0)
    }

    fn __str__(&self) -> String {
        format!("{}\n{}", table(&self.0), self.advice().join("\n"))
    }

    fn __repr__(&self) -> String {
        format!("<springs.Study of {} runs>", self.0.trials.len())
    }

    fn _repr_html_(&self) -> String {
        self.svg()
    }
}
