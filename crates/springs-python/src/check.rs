//! What is in a scene, what a run leaves out, what looks wrong.

use crate::result::json;
use pyo3::prelude::*;
use springs::inspect::{Check, Warning};

/// What a scene holds, how it will be simulated, what a run of it leaves out without changing
/// the result, and what is legal but probably not meant; to be printed.
#[pyclass(module = "springs", name = "Check", frozen)]
pub(crate) struct PyCheck(pub(crate) Check);

#[pymethods]
impl PyCheck {
    /// What is left out: (what, what that saves, when that is exact).
    #[getter]
    fn skipped(&self) -> Vec<(&str, &str, &str)> {
        let skipped = self.0.skipped.iter();
        let skipped = skipped.map(|one| (&*one.what, &*one.saves, &*one.exact));
        skipped.collect()
    }

    /// What looks wrong, as sentences.
    #[getter]
    fn suspicious(&self) -> Vec<String> {
        self.0.warnings.iter().map(Warning::to_string).collect()
    }

    /// All of it, as `springs check --json` prints it.
    #[getter]
    fn report(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        json(py, &self.0)
    }

    fn __str__(&self) -> String {
        self.0.to_string().trim_end().to_owned()
    }

    fn __repr__(&self) -> String {
        self.__str__()
    }
}
