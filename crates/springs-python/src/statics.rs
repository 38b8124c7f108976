//! Equilibria.

use crate::arrays::{array1, array2, flat};
use crate::attended::{Progress, Shared, attended};
use crate::errors::Fault;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use springs::scene::{RunOptions, Scene, Start, Vector3};
use springs::solver::Interrupt;
use springs::statics::{Equilibrium, Options, StaticsError, Status, settle, start};

/// Where all forces are balanced: n nodes and k springs, in SI units.
#[pyclass(module = "springs", name = "Equilibrium", frozen)]
pub(crate) struct PyEquilibrium {
    /// Positions, in m: (n, 3).
    #[pyo3(get)]
    x: Py<PyArray2<f64>>,
    /// Tensions, in N: (k,).
    #[pyo3(get)]
    tension: Py<PyArray1<f64>>,
    /// Forces of supports on the nodes, in N: (n, 3); zero where there is none.
    #[pyo3(get)]
    reactions: Py<PyArray2<f64>>,
    /// `stable`, `unstable` or `mechanism`.
    #[pyo3(get)]
    status: &'static str,
    /// The nodes that move most in ways that nothing resists.
    #[pyo3(get)]
    nodes: Vec<usize>,
    /// The largest component of a force left, in N.
    #[pyo3(get)]
    residual: f64,
}

impl PyEquilibrium {
    fn new(py: Python<'_>, found: Equilibrium) -> Self {
        let n = found.positions.len();
        let mut reactions = vec![Vector3::zeros(); n];
        for reaction in &found.reactions {
            reactions[reaction.node] = reaction.force;
        }
        Self {
            x: array2(py, flat(&found.positions), 3, n).unbind(),
            tension: array1(py, found.tensions).unbind(),
            reactions: array2(py, flat(&reactions), 3, n).unbind(),
            status: found.status.name(),
            nodes: match found.status {
                Status::Stable => Vec::new(),
                Status::Unstable { nodes } | Status::Mechanism { nodes } => nodes,
            },
            residual: found.residual,
        }
    }
}

#[pymethods]
impl PyEquilibrium {
    /// Whether it comes back when it is pushed a little.
    #[getter]
    fn stable(&self) -> bool {
        self.status == Status::Stable.name()
    }

    fn __repr__(&self) -> String {
        let Self {
            status, residual, ..
        } = self;
        format!("<springs.Equilibrium {status}, {residual:.1e} N are left>")
    }
}

/// Runs statics in a thread of their own; they end when Ctrl-C is heard.
fn attended_statics<R: Send>(
    py: Python<'_>,
    options: &RunOptions,
    work: impl FnOnce(&Options) -> Result<R, StaticsError> + Send,
) -> PyResult<R> {
    let shared = Shared::default();
    let statics = Options::default()
        .with_threads(springs::step::threads(options))
        .with_interrupt(Interrupt::from(shared.is_stopped.clone()));
    let (found, raised) = attended(py, &shared, &Progress::new(None)?, || work(&statics))?;
    match raised {
        Some(raised) => Err(raised),
        None => Ok(found.map_err(|error| Fault::from(&error))?),
    }
}

/// Finds the equilibrium of a scene.
pub(crate) fn settled(
    py: Python<'_>,
    scene: &Scene,
    options: &RunOptions,
) -> PyResult<PyEquilibrium> {
    let found = attended_statics(py, options, |statics| settle(scene, statics))?;
    Ok(PyEquilibrium::new(py, found))
}

/// The scene as it starts: from its equilibrium, if it asks for that.
pub(crate) fn started(py: Python<'_>, scene: Scene, options: &RunOptions) -> PyResult<Scene> {
    if scene.settings.start == Start::AsGiven {
        return Ok(scene);
    }
    let (scene, _) = attended_statics(py, options, |statics| start(&scene, statics))?;
    Ok(scene)
}
