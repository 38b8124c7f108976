//! A simulation in steps, for a loop of one's own.

use crate::arrays::{Floats, array1, array2, flat};
use crate::attended::{LOOK, Progress, Shared, attended};
use crate::errors::{Fault, interrupted};
use crate::record::{ENERGIES, row_of};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use springs::io::{FrameEnergies, parse_scene, scene_to_string};
use springs::report::energy_sum;
use springs::scene::{Load, OverTime, RunOptions, Scene, Spring, StepControl, Vector3};
use springs::solver::Interrupt;
use springs::step::{Cause, Simulation, StepError};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Scenes with fewer free nodes make a step in less time than that between two looks
/// at signals, so that the calling thread makes them itself.
const FEW_NODES: usize = 2000;

/// Steps after which a simulation ends: more than anybody makes.
const MOST_STEPS: f64 = (1_u64 << 40) as f64;

/// So far may a time be from a whole number of steps, as a part of it.
const WHOLE: f64 = 1e-9;

/// What was before the scene was changed for the last time. Energies in J.
#[derive(Clone, Copy, Debug, Default)]
struct Before {
    steps: u64,
    /// Energy at the start.
    start: f64,
    control_work: f64,
    anchor_work: f64,
    load_work: f64,
    heat: f64,
    broken_energy: f64,
}

impl Before {
    fn reals(&mut self) -> [&mut f64; 6] {
        [
            &mut self.start,
            &mut self.control_work,
            &mut self.anchor_work,
            &mut self.load_work,
            &mut self.heat,
            &mut self.broken_energy,
        ]
    }
}

/// A simulation in steps of one size.
#[pyclass(module = "springs", name = "Simulation")]
pub(crate) struct PySimulation {
    /// As it was when it was changed for the last time.
    scene: Scene,
    /// Loads of the scene that are no forces of somebody's own.
    n_loads: usize,
    before: Before,
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
        let simulation = compile(py, &scene, &options, &shared)?;
        Ok(Self {
            n_loads: scene.loads.len(),
            before: Before {
                start: simulation.ledger().start.total(),
                ..Before::default()
            },
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

    /// Goes on with a changed scene from where it is. What that does to the energy is
    /// work of whoever changes it. Nothing changes if that scene is wrong.
    fn change(&mut self, py: Python<'_>, change: impl FnOnce(&mut Scene)) -> PyResult<()> {
        let mut scene = self.scene.clone();
        change(&mut scene);
        if scene == self.scene {
            return Ok(());
        }
        let simulation = self.simulation();
        scene.shift_time(simulation.stepper().time());
        simulation.nodes().write_to(&mut scene);
        simulation.write_memory_to(&mut scene, |spring| spring);
        let next = compile(py, &scene, &self.options, &self.shared)?;
        let simulation = self.simulation();
        let (ledger, steps) = (simulation.ledger(), simulation.stepper().steps());
        let control_work = next.ledger().start.total() - simulation.energy().total();
        let before = &mut self.before;
        before.steps += steps;
        before.control_work += control_work;
        before.anchor_work += ledger.anchor_work;
        before.load_work += ledger.load_work;
        before.heat += ledger.heat.sum();
        before.broken_energy += ledger.broken_energy;
        self.simulation = Mutex::new(next);
        self.scene = scene;
        Ok(())
    }

    /// Sets a number of each spring.
    fn set_springs(
        &mut self,
        value: &Bound<'_, PyAny>,
        what: &'static str,
        field: fn(&mut Spring) -> &mut f64,
    ) -> PyResult<()> {
        let numbers = Floats::new(what, value)?.each(self.scene.springs.len())?;
        self.change(value.py(), |scene| {
            let springs = scene.springs.iter_mut().zip(numbers);
            springs.for_each(|(spring, number)| *field(spring) = number);
        })
    }

    fn of_springs<'py>(
        &self,
        py: Python<'py>,
        field: fn(&Spring) -> f64,
    ) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.scene.springs.iter().map(field).collect())
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
        let mut before = self.before;
        let mut numbers = vec![
            text.len() as u64,
            u64::from(self.options.skip),
            self.options.threads as u64,
            self.n_loads as u64,
            before.steps,
        ];
        numbers.extend(before.reals().map(|real| real.to_bits()));
        let mut bytes =
            Vec::with_capacity(MAGIC.len() + 8 * (numbers.len() + words.len()) + text.len());
        bytes.extend(MAGIC);
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
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
        simulation.before = state.before;
        simulation.n_loads = state.n_loads;
        let restored = simulation.simulation().restore(state.words);
        restored.map_err(|_| damaged())?;
        Ok(simulation)
    }
}

/// How every saved simulation begins.
const MAGIC: &[u8] = b"springs simulation 1\n";

/// Compiles a scene; the simulation stops when it is asked to.
fn compile(
    py: Python<'_>,
    scene: &Scene,
    options: &RunOptions,
    shared: &Shared,
) -> PyResult<Simulation> {
    let simulation = py.detach(|| Simulation::with_options(scene, options));
    let mut simulation = simulation.map_err(|error| Fault::from(&error))?;
    simulation.set_interrupt(&Interrupt::from(shared.is_stopped.clone()));
    Ok(simulation)
}

struct SavedState<'a> {
    skip: bool,
    threads: usize,
    n_loads: usize,
    before: Before,
    text: &'a str,
    words: Vec<u64>,
}

impl<'a> SavedState<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let mut number = || {
            let (number, after) = rest.split_first_chunk()?;
            rest = after;
            Some(u64::from_le_bytes(*number))
        };
        let length = usize::try_from(number()?).ok()?;
        let skip = number()? == 1;
        let threads = usize::try_from(number()?).ok()?;
        let n_loads = usize::try_from(number()?).ok()?;
        let mut before = Before {
            steps: number()?,
            ..Before::default()
        };
        for real in before.reals() {
            *real = f64::from_bits(number()?);
        }
        let (text, words) = rest.split_at_checked(length)?;
        let (words, rest) = words.as_chunks();
        rest.is_empty().then_some(())?;
        Some(Self {
            skip,
            threads,
            n_loads,
            before,
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
        let steps = self.before.steps + self.simulation().stepper().steps();
        steps as f64 * self.step
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
        let before = self.before;
        let simulation = self.simulation();
        let (energy, ledger) = (energy_sum(&simulation.energy()), simulation.ledger());
        let anchor_work = before.anchor_work + ledger.anchor_work;
        let load_work = before.load_work + ledger.load_work;
        let heat = before.heat + ledger.heat.sum();
        let broken_energy = before.broken_energy + ledger.broken_energy;
        let taken = heat + broken_energy - anchor_work - load_work - before.control_work;
        let numbers = row_of(&FrameEnergies {
            time: 0.0,
            energy,
            anchor_work,
            load_work,
            dashpot_heat: heat,
            broken_energy,
            method_gain: energy.total - before.start + taken,
        });
        let energies = PyDict::new(py);
        for (name, number) in ENERGIES.into_iter().zip(numbers) {
            energies.set_item(name, number)?;
        }
        energies.set_item("control_work", before.control_work)?;
        Ok(energies)
    }

    /// Rest lengths of the springs, in m: (k,). They are set from a number or (k,), as
    /// are stiffnesses; the scene is then compiled anew, and steps go on from where they
    /// are.
    #[getter]
    fn rest_length<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_springs(py, |spring| spring.rest_length)
    }

    #[setter]
    fn set_rest_length(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        self.set_springs(value, "rest_length", |spring| &mut spring.rest_length)
    }

    /// Stiffnesses of the springs, in N/m: (k,).
    #[getter]
    fn stiffness<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_springs(py, |spring| spring.stiffness)
    }

    #[setter]
    fn set_stiffness(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        self.set_springs(value, "stiffness", |spring| &mut spring.stiffness)
    }

    /// Forces on the nodes beside the loads of the scene, in N: (n, 3). They stay until
    /// others are set.
    #[getter]
    fn force<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let n = self.scene.nodes.len();
        let mut forces = vec![Vector3::zeros(); n];
        for load in &self.scene.loads[self.n_loads..] {
            load.nodes
                .iter()
                .for_each(|&node| forces[node] += load.force);
        }
        array2(py, flat(&forces), 3, n)
    }

    #[setter]
    fn set_force(&mut self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let forces = Floats::new("force", value)?.n_vectors(self.scene.nodes.len())?;
        let n_loads = self.n_loads;
        self.change(value.py(), |scene| {
            scene.loads.truncate(n_loads);
            let forces = forces.into_iter().enumerate();
            let forces = forces.filter(|(_, force)| *force != Vector3::zeros());
            scene.loads.extend(forces.map(|(node, force)| Load {
                nodes: vec![node],
                force,
                over_time: OverTime::Constant,
            }));
        })
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
