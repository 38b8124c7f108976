//! A simulation in steps, for a loop of one's own.

use crate::arrays::{Floats, array1, array2, flat};
use crate::attended::{LOOK, Progress, Shared, attended};
use crate::errors::{Fault, interrupted};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use serde::{Deserialize, Serialize};
use springs::io::{Checkpoint, ENERGY_COLUMNS, parse_scene, scene_to_string};
use springs::report::frame_energies;
use springs::scene::{RunOptions, Scene, Spring, StepControl};
use springs::solver::Interrupt;
use springs::step::{Cause, ChangeError, Simulation, StepError};
use std::fmt::Display;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Scenes with fewer free nodes make a step in less time than that between two looks
/// at signals, so that the calling thread makes them itself.
const FEW_NODES: usize = 2000;

/// Steps after which a simulation ends: more than anybody makes.
const MOST_STEPS: f64 = (1_u64 << 40) as f64;

/// So far may a time be from a whole number of steps, as a part of it.
const WHOLE: f64 = 1e-9;

/// What a saved simulation says beside its state.
#[derive(Serialize, Deserialize)]
struct About {
    springs_version: String,
    /// The scene as it was at the start, as a scene file.
    scene: String,
    skip: bool,
    threads: usize,
}

/// A simulation in steps of one size.
#[pyclass(module = "springs", name = "Simulation")]
pub(crate) struct PySimulation {
    /// As it was at the start.
    scene: Scene,
    options: RunOptions,
    step: f64,
    /// Never locked: it only lets other threads have the object.
    simulation: Mutex<Simulation>,
    shared: Shared,
    /// Positions and velocities, if somebody asked for them since the last step.
    states: Option<[Py<PyArray2<f64>>; 2]>,
}

impl PySimulation {
    pub(crate) fn new(py: Python<'_>, mut scene: Scene, options: RunOptions) -> PyResult<Self> {
        let StepControl::Fixed(step) = scene.settings.step else {
            return Err(Fault::scene("a simulation needs a step").into());
        };
        scene.settings.duration = MOST_STEPS * step;
        let shared = Shared::default();
        let simulation = py.detach(|| Simulation::changeable(&scene, &options));
        let mut simulation = simulation.map_err(|error| Fault::from(&error))?;
        simulation.set_interrupt(&Interrupt::from(shared.is_stopped.clone()));
        Ok(Self {
            scene,
            options,
            step,
            simulation: Mutex::new(simulation),
            shared,
            states: None,
        })
    }

    fn simulation(&mut self) -> &mut Simulation {
        let simulation = self.simulation.get_mut();
        simulation.unwrap_or_else(PoisonError::into_inner)
    }

    /// A number of each spring now.
    fn of_springs<'py>(
        &mut self,
        py: Python<'py>,
        field: fn(&Spring) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        let scene = self.simulation().changed_scene();
        let springs = scene.map_or(&[][..], |scene| &scene.springs);
        array1(py, springs.iter().map(field).collect())
    }

    /// The whole number of steps that a time is.
    fn n_steps(&self, dt: f64) -> PyResult<u64> {
        let ratio = dt / self.step;
        let n = ratio.round();
        if (0.0..MOST_STEPS).contains(&n) && (ratio - n).abs() <= WHOLE * n {
            return Ok(n as u64);
        }
        let message = format!("{dt:?} s are no whole number of steps of {:?} s", self.step);
        Err(Fault::scene(message).into())
    }

    fn states(&mut self, py: Python<'_>) -> PyResult<&[Py<PyArray2<f64>>; 2]> {
        let states = match self.states.take() {
            Some(states) => states,
            None => {
                let nodes = self.simulation().nodes();
                let array = |vectors| {
                    let array = array2(py, flat(vectors), 3, vectors.len());
                    // It would not move the nodes.
                    array.call_method1("setflags", (false,))?;
                    PyResult::Ok(array.unbind())
                };
                [array(&nodes.positions)?, array(&nodes.velocities)?]
            }
        };
        Ok(self.states.insert(states))
    }

    /// What [`Self::of_state`] reads.
    fn state(&mut self) -> PyResult<Vec<u8>> {
        let about = About {
            springs_version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene_to_string(&self.scene, &self.options),
            skip: self.options.skip,
            threads: self.options.threads,
        };
        let checkpoint = Checkpoint {
            about: serde_json::to_string(&about).map_err(Fault::system)?,
            words: self.simulation().save(),
        };
        Ok(checkpoint.to_bytes())
    }

    fn of_state(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        let foreign = |why: &dyn Display| Fault::scene(format!("the saved simulation {why}"));
        let read = Checkpoint::from_bytes(bytes);
        let Checkpoint { about, words } = read.map_err(|fault| foreign(&fault))?;
        let about: About = serde_json::from_str(&about)
            .map_err(|error| foreign(&format!("does not say what it is: {error}")))?;
        let (version, found) = (env!("CARGO_PKG_VERSION"), &about.springs_version);
        if found != version {
            let why = format!("is of springs {found}, and this is {version}");
            return Err(foreign(&why).into());
        }
        let parsed = parse_scene("a saved simulation", &about.scene);
        let (scene, mut options) = parsed.map_err(|error| Fault::from(&error))?;
        options.skip = about.skip;
        options.threads = about.threads;
        let mut simulation = Self::new(py, scene, options)?;
        let restored = simulation.simulation().restore(words);
        restored.map_err(|_| foreign(&"does not fit its scene"))?;
        Ok(simulation)
    }
}

/// What a change comes to.
fn made(change: Result<(), ChangeError>) -> PyResult<()> {
    change.map_err(|error| match error {
        ChangeError::Problem(problem) => Fault::from(&problem).into(),
        ChangeError::NotFixed { node } => Fault::scene(error.to_string()).at_node(node).into(),
        _ => Fault::scene(error.to_string()).into(),
    })
}

/// Makes steps, and looks at signals in between.
fn steps_inline(simulation: &mut Simulation, n: u64) -> (Result<(), StepError>, Option<PyErr>) {
    let mut looked = Instant::now();
    for _ in 0..n {
        if let Err(error) = simulation.step() {
            return (Err(error), None);
        }
        if looked.elapsed() >= LOOK {
            if let Err(raised) = Python::attach(|py| py.check_signals()) {
                return (Ok(()), Some(raised));
            }
            looked = Instant::now();
        }
    }
    (Ok(()), None)
}

#[pymethods]
impl PySimulation {
    /// Simulated time, in s.
    #[getter]
    fn time(&mut self) -> f64 {
        self.simulation().stepper().steps() as f64 * self.step
    }

    /// Positions now, in m: (n, 3), not to be written to.
    #[getter]
    fn x(&mut self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        Ok(self.states(py)?[0].clone_ref(py))
    }

    /// Velocities now, in m/s: (n, 3), not to be written to.
    #[getter]
    fn v(&mut self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        Ok(self.states(py)?[1].clone_ref(py))
    }

    /// Energies now and their flows since the start, in J, by name; `control_work` is
    /// that of changes of rest lengths and stiffnesses.
    #[getter]
    fn energy<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let account = self.simulation().account_now();
        let energies = PyDict::new(py);
        let numbers = frame_energies(&account).numbers();
        for (column, number) in ENERGY_COLUMNS.iter().zip(numbers) {
            energies.set_item(column.name, number)?;
        }
        energies.set_item("control_work", account.ledger.control_work)?;
        Ok(energies)
    }

    /// Rest lengths of the springs, in m: (k,). They are set from a number or (k,), as
    /// are stiffnesses, and steps go on from where they are.
    #[getter]
    fn rest_length<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_springs(py, |spring| spring.rest_length)
    }

    #[setter]
    fn set_rest_length(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let lengths = Floats::new("rest_length", value)?.each(self.scene.springs.len())?;
        made(self.simulation().set_rest_lengths(&lengths))
    }

    /// Stiffnesses of the springs, in N/m: (k,).
    #[getter]
    fn stiffness<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_springs(py, |spring| spring.stiffness)
    }

    #[setter]
    fn set_stiffness(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let stiffnesses = Floats::new("stiffness", value)?.each(self.scene.springs.len())?;
        made(self.simulation().set_stiffnesses(&stiffnesses))
    }

    /// Forces on the nodes beside the loads of the scene, in N: (n, 3). They stay until
    /// others are set.
    #[getter]
    fn force<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let forces = self.simulation().set_forces_now();
        array2(py, flat(forces), 3, forces.len())
    }

    #[setter]
    fn set_force(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let forces = Floats::new("force", value)?.n_vectors(self.scene.nodes.len())?;
        made(self.simulation().set_forces(&forces))
    }

    /// Velocities of fixed nodes beside the motions that they follow, in m/s: (n, 3),
    /// zero for free nodes. They go on from where they are.
    #[getter]
    fn anchor_velocity<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let velocities = self.simulation().anchor_velocities();
        array2(py, flat(velocities), 3, velocities.len())
    }

    #[setter]
    fn set_anchor_velocity(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let velocities =
            Floats::new("anchor_velocity", value)?.n_vectors(self.scene.nodes.len())?;
        self.states = None;
        made(self.simulation().set_anchor_velocities(&velocities))
    }

    /// Which springs are broken: (k,).
    #[getter]
    fn broken<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        let mut broken = vec![false; self.scene.springs.len()];
        let all = self.simulation().system().broken();
        all.into_iter().for_each(|spring| broken[spring] = true);
        array1(py, broken)
    }

    /// By how much springs have yielded, in m: (k,).
    #[getter]
    fn yielded<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut yielded = vec![0.0; self.scene.springs.len()];
        let all = self.simulation().system().yielded();
        all.into_iter()
            .for_each(|(spring, by)| yielded[spring] = by);
        array1(py, yielded)
    }

    /// Makes as many steps as `dt` s are, which must be a whole number of them.
    ///
    /// Ctrl-C raises `Interrupted`, and a step that fails `StepError`; the simulation is
    /// then at the end of the last whole step.
    fn advance(&mut self, py: Python<'_>, dt: f64) -> PyResult<()> {
        let n = self.n_steps(dt)?;
        self.states = None;
        let shared = self.shared.clone();
        let simulation = self.simulation();
        let (made, raised) = if simulation.system().n_free() <= FEW_NODES {
            py.detach(|| steps_inline(simulation, n))
        } else {
            let mut work = || (0..n).try_for_each(|_| simulation.step().map(drop));
            let nobody = Progress::new(None)?;
            let done = attended(py, &shared, &nobody, &mut work);
            shared.go_on();
            done?
        };
        // What breaks or yields there does so now, and not when the next step begins.
        self.simulation().end_step();
        match (raised, made) {
            (Some(raised), _) => Err(interrupted(py, raised, self.time())?),
            (None, Err(error)) if error.cause != Cause::Interrupted => {
                Err(Fault::from(&error).into())
            }
            (None, _) => Ok(()),
        }
    }

    /// Everything that the simulation has come to.
    fn save<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.state()?))
    }

    /// Goes back to what was saved, and goes on from there with the same bits.
    fn restore(&mut self, py: Python<'_>, saved: &[u8]) -> PyResult<()> {
        *self = Self::of_state(py, saved)?;
        Ok(())
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    /// Nothing is left to be closed.
    fn __exit__(
        &self,
        _kind: &Bound<'_, PyAny>,
        _value: &Bound<'_, PyAny>,
        _trace: &Bound<'_, PyAny>,
    ) -> bool {
        false
    }

    fn __copy__(&mut self, py: Python<'_>) -> PyResult<Self> {
        let state = self.state()?;
        Self::of_state(py, &state)
    }

    fn __deepcopy__(&mut self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.__copy__(py)
    }

    fn __reduce__<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let make = py.import("springs._springs")?.getattr("_simulation")?;
        (make, (self.save(py)?,)).into_pyobject(py)
    }

    fn __repr__(&mut self) -> String {
        format!("<springs.Simulation at {:?} s>", self.time())
    }
}

/// A simulation that was saved: what pickling writes.
#[pyfunction(name = "_simulation")]
pub(crate) fn simulation_of_state(py: Python<'_>, saved: &[u8]) -> PyResult<PySimulation> {
    PySimulation::of_state(py, saved)
}
