//! The Python module `springs._springs`: scenes, runs and simulations with numpy arrays.
//!
//! It converts between Python and the crate `springs`, and knows no formula. Steps,
//! statics and studies run in a thread of their own, without the lock of the interpreter,
//! while the calling thread hears Python's signals (`attended.rs`); scenes are compiled
//! without the lock. `python/springs/_springs.pyi` has the
//! interface; the tests are in `python/tests`.

mod arrays;
mod attended;
mod check;
mod errors;
mod law;
mod record;
mod result;
mod scene;
mod simulation;
mod springs_of;
mod start;
mod statics;
mod study;
mod sweep;

use pyo3::prelude::*;

#[pymodule]
fn _springs(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<scene::PyScene>()?;
    module.add_class::<law::PyLaw>()?;
    module.add_class::<check::PyCheck>()?;
    module.add_class::<result::RunResult>()?;
    module.add_class::<statics::PyEquilibrium>()?;
    module.add_class::<simulation::PySimulation>()?;
    module.add_class::<study::PyStudy>()?;
    module.add_function(wrap_pyfunction!(scene::load, module)?)?;
    module.add_function(wrap_pyfunction!(scene::scene_of_text, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::simulation_of_state, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
