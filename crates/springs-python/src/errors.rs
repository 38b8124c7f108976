//! Errors as Python exceptions: the classes of `springs._errors`.

use pyo3::prelude::*;
use pyo3::types::{IntoPyDict as _, PyDict};
use springs::io::{Finding, SceneError};
use springs::scene::{Path, Problem};
use springs::statics::StaticsError;
use springs::step::{SetupError, StepError};

/// What becomes an exception.
#[derive(Debug)]
pub(crate) struct Fault {
    class: &'static str,
    message: String,
    advice: Option<String>,
    node: Option<usize>,
    spring: Option<usize>,
    time: Option<f64>,
}

impl Fault {
    fn of_class(class: &'static str, message: String) -> Self {
        Self {
            class,
            message,
            advice: None,
            node: None,
            spring: None,
            time: None,
        }
    }

    /// Something is wrong with a scene or with how it is to be run.
    pub(crate) fn scene(message: impl Into<String>) -> Self {
        Self::of_class("SceneError", message.into())
    }

    /// A file cannot be read or written, or a system has no room.
    pub(crate) fn system(error: impl std::fmt::Display) -> Self {
        Self::of_class("SystemError", error.to_string())
    }

    /// The same with what to do about it.
    pub(crate) fn advised(self, advice: Option<&str>) -> Self {
        Self {
            advice: advice.map(str::to_owned),
            ..self
        }
    }

    /// The same, of a node.
    pub(crate) fn at_node(self, node: usize) -> Self {
        let node = Some(node);
        Self { node, ..self }
    }

    /// The same, of a spring.
    pub(crate) fn at_spring(self, spring: usize) -> Self {
        let spring = Some(spring);
        Self { spring, ..self }
    }

    fn at(self, path: Option<Path>) -> Self {
        match path {
            Some(Path::Node(node, _)) => self.at_node(node),
            Some(Path::Spring(spring, _)) => self.at_spring(spring),
            _ => self,
        }
    }

    fn exception(&self, py: Python<'_>) -> PyResult<PyErr> {
        let class = py.import("springs._errors")?.getattr(self.class)?;
        let attributes = PyDict::new(py);
        attributes.set_item("node", self.node)?;
        attributes.set_item("spring", self.spring)?;
        attributes.set_item("time", self.time)?;
        attributes.set_item("advice", self.advice.as_deref())?;
        let value = class.call((&self.message,), Some(&attributes))?;
        Ok(PyErr::from_value(value))
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        Python::attach(|py| fault.exception(py).unwrap_or_else(|error| error))
    }
}

impl From<&Problem> for Fault {
    fn from(problem: &Problem) -> Self {
        Self::scene(problem.to_string())
            .advised(problem.advice())
            .at(Some(problem.path()))
    }
}

impl From<&SetupError> for Fault {
    fn from(error: &SetupError) -> Self {
        Self::scene(error.to_string())
            .advised(error.advice())
            .at(error.path())
    }
}

impl From<&StaticsError> for Fault {
    fn from(error: &StaticsError) -> Self {
        let class = if error.is_not_found() {
            "StepError"
        } else {
            "SceneError"
        };
        Self::of_class(class, error.to_string())
            .advised(error.advice())
            .at(error.path())
    }
}

impl From<&StepError> for Fault {
    fn from(error: &StepError) -> Self {
        let fault = Self::of_class("StepError", error.to_string());
        Self {
            advice: Some(error.advice().to_owned()),
            node: Some(error.node),
            spring: error.suspect.map(|suspect| suspect.spring),
            time: Some(error.time),
            ..fault
        }
    }
}

impl From<&SceneError> for Fault {
    fn from(error: &SceneError) -> Self {
        let SceneError::Wrong { file, findings } = error else {
            return Self::system(error);
        };
        let Finding { path, advice, .. } = &findings[0];
        let index = |list: &str| -> Option<usize> {
            let (index, _) = path.strip_prefix(list)?.split_once(']')?;
            index.parse().ok()
        };
        let shown = findings.iter().map(|finding| format!("{file}:{finding}"));
        let shown: Vec<String> = shown.take(MOST_FINDINGS).collect();
        Self {
            node: index("nodes["),
            spring: index("springs["),
            advice: advice.clone(),
            ..Self::scene(shown.join("\n"))
        }
    }
}

/// At most this many of the things wrong with a file are told.
const MOST_FINDINGS: usize = 20;

/// The exception of a run that Ctrl-C or a handler of another signal stopped.
pub(crate) fn interrupted(py: Python<'_>, cause: PyErr, time: f64) -> PyResult<PyErr> {
    if !cause.is_instance_of::<pyo3::exceptions::PyKeyboardInterrupt>(py) {
        return Ok(cause);
    }
    let class = py.import("springs._errors")?.getattr("Interrupted")?;
    let attributes = [("time", time)].into_py_dict(py)?;
    let message = format!("interrupted at {time:?} s");
    let error = PyErr::from_value(class.call((message,), Some(&attributes))?);
    error.set_cause(py, Some(cause));
    Ok(error)
}
