//! A simulation in steps, for a loop of one's own.

use crate::arrays::{array2, flat};
use crate::attended::{Progress, Shared, attended};
use crate::errors::{Fault, interrupted};
use crate::record::ENERGIES;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use springs::io::{parse_scene, scene_to_string};
use springs::scene::{RunOptions, Scene, StepControl};
use springs::solver::Interrupt;
use springs::step::{Cause, Simulation, StepError};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Scenes with fewer free nodes make a step in less time than that between two looks
/// at signals, so that the calling thread makes them itself.
const FEW_NODES: usize = 2000;

/// Time between two looks at signals.
const LOOK: Duration = Duration::from_millis(20);

/// Steps after which a simulation ends: more than anybody makes.
const MOST_STEPS: f64 = (1_u64 << 40) as f64;

/// So far may a time be from a whole number of steps, as a part of it.
const WHOLE: f64 = 1e-9;

/// A simulation in steps of one size.
#[pyclass(module = "springs", name = "Simulation")]
pub(crate) struct PySimulation {
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
        let simulation = py.detach(|| Simulation::with_options(&scene, &options));
        let mut simulation = simulation.map_err(|error| Fault::from(&error))?;
        let shared = Shared::default();
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
    fn state(&mut self) -> Vec<u8> {
        let text = scene_to_string(&self.scene, &self.options);
        let words = self.simulation().save();
        let mut bytes = Vec::with_capacity(MAGIC.len() + 24 + text.len() + 8 * words.len());
        bytes.extend(MAGIC);
        bytes.push(u8::from(self.options.skip));
        bytes.extend((self.options.threads as u64).to_le_bytes());
        bytes.extend((text.len() as u64).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        bytes
    }

    fn of_state(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        let state = SavedState::read(bytes).ok_or_else(damaged)?;
        let parsed = parse_scene("a saved simulation", state.text);
        let (scene, mut options) = parsed.map_err(|error| Fault::from(&error))?;
        options.skip = state.skip;
        options.threads = state.threads;
        let mut simulation = Self::new(py, scene, options)?;
        let restored = simulation.simulation().restore(state.words);
        restored.map_err(|_| damaged())?;
        Ok(simulation)
    }
}

/// How every saved simulation begins.
const MAGIC: &[u8] = b"springs simulation 1\n";

struct SavedState<'a> {
    skip: bool,
    threads: usize,
    text: &'a str,
    words: Vec<u64>,
}

impl<'a> SavedState<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let (skip, rest) = bytes.strip_prefix(MAGIC)?.split_first()?;
        let (threads, rest) = rest.split_first_chunk()?;
        let (length, rest) = rest.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (text, words) = rest.split_at_checked(length)?;
        let (words, rest) = words.as_chunks();
        rest.is_empty().then_some(())?;
        Some(Self {
            skip: *skip == 1,
            threads: usize::try_from(u64::from_le_bytes(*threads)).ok()?,
            text: std::str::from_utf8(text).ok()?,
            words: words.iter().map(|word| u64::from_le_bytes(*word)).collect(),
        })
    }
}

fn damaged() -> Fault {
    Fault::scene("this is no saved simulation, or one of another version")
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
        self.simulation().stepper().time()
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

    /// Energies now and their flows since the start, in J, by name.
    #[getter]
    fn energy<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let simulation = self.simulation();
        let (energy, ledger) = (simulation.energy(), simulation.ledger());
        let energies = PyDict::new(py);
        let numbers = [
            energy.kinetic,
            energy.elastic(),
            energy.gravity(),
            energy.total(),
            ledger.anchor_work,
            ledger.load_work,
            ledger.heat.sum(),
            ledger.method_gain(&energy),
        ];
        for (name, number) in ENERGIES.into_iter().zip(numbers) {
            energies.set_item(name, number)?;
        }
        Ok(energies)
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
        match (raised, made) {
            (Some(raised), _) => Err(interrupted(py, raised, self.time())?),
            (None, Err(error)) if error.cause != Cause::Interrupted => {
                Err(Fault::from(&error).into())
            }
            (None, _) => Ok(()),
        }
    }

    /// Everything that the simulation has come to.
    fn save<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.state())
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
        let state = self.state();
        Self::of_state(py, &state)
    }

    fn __deepcopy__(&mut self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> PyResult<Self> {
        self.__copy__(py)
    }

    fn __reduce__<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let make = py.import("springs._springs")?.getattr("_simulation")?;
        (make, (self.save(py),)).into_pyobject(py)
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
