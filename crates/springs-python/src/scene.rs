//! Scenes.

use crate::arrays::{Floats, array1, array2, each, flat, some_nodes};
use crate::attended::Progress;
use crate::check::PyCheck;
use crate::errors::Fault;
use crate::result::{Run, RunResult};
use crate::simulation::PySimulation;
use crate::springs_of::{Given, Made, damp, make};
use crate::start::scene_at;
use crate::statics::{PyEquilibrium, settled, started};
use crate::study::{self, PyStudy};
use crate::sweep;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use springs::inspect::{Check, CheckError};
use springs::io::{Inputs, parse_scene_with_inputs, read_text, scene_to_string, write_scene};
use springs::scene::{
    Guide, Load, NamedMotion, Node, OverTime, PrescribedMotion, Rayleigh, RunOptions, Scene,
    StepControl, Vector3,
};
use springs::sinks::intervals;
use springs::step::NodeStates;
use springs::sweep::Subject;
use std::path::PathBuf;

/// Point masses joined by springs, in SI units.
#[pyclass(module = "springs", name = "Scene")]
#[derive(Clone, Default)]
pub(crate) struct PyScene {
    scene: Scene,
    options: RunOptions,
    /// Damping ratios wait here until nodes have all their masses.
    inputs: Inputs,
}

/// How a scene is to be run, in place of what it says itself.
#[derive(Default)]
struct Changes<'a> {
    duration: Option<f64>,
    tolerance: Option<f64>,
    step: Option<f64>,
    method: Option<&'a str>,
    tangent: Option<&'a str>,
    threads: Option<usize>,
}

impl PyScene {
    /// The scene with all dampings, if nothing is wrong with it.
    fn build(&self) -> PyResult<Scene> {
        let mut scene = self.scene.clone();
        if let Some(problem) = scene.problems().first() {
            return Err(Fault::from(problem).into());
        }
        damp(&mut scene, &self.inputs.damping_ratios)?;
        Ok(scene)
    }

    fn changed(&self, changes: &Changes<'_>) -> PyResult<(Scene, RunOptions)> {
        let (mut scene, mut options) = (self.build()?, self.options);
        let settings = &mut scene.settings;
        let unknown = |error: springs::scene::UnknownName| Fault::scene(error.to_string());
        if let Some(method) = changes.method {
            // The tangent of the scene was meant for the method there.
            settings.method = method.parse().map_err(unknown)?;
            settings.tangent = None;
        }
        if let Some(tangent) = changes.tangent {
            settings.tangent = Some(tangent.parse().map_err(unknown)?);
        }
        settings.step = match (changes.step, changes.tolerance) {
            (Some(_), Some(_)) => {
                let message = "a run has a step or a tolerance, not both";
                return Err(Fault::scene(message).into());
            }
            (Some(step), None) => StepControl::Fixed(step),
            (None, Some(tolerance)) => StepControl::Tolerance(tolerance),
            (None, None) => settings.step,
        };
        settings.duration = changes.duration.unwrap_or(settings.duration);
        options.threads = changes.threads.unwrap_or(options.threads);
        Ok((scene, options))
    }

    fn subject(&self) -> PyResult<Subject> {
        Ok(Subject {
            scene: self.build()?,
            options: self.options,
            inputs: self.inputs.clone(),
        })
    }

    fn indices<'py>(py: Python<'py>, from: usize, to: usize) -> Bound<'py, PyArray1<i64>> {
        array1(py, (from as i64..to as i64).collect())
    }
}

/// Which of x, y, z are named; all of them if nothing is.
fn axes_of(axes: Option<&str>) -> PyResult<[bool; 3]> {
    let Some(axes) = axes else {
        return Ok([true; 3]);
    };
    let held = ['x', 'y', 'z'].map(|axis| axes.contains(axis));
    let is_known = |axis: char| "xyz".contains(axis);
    if axes.is_empty() || !axes.chars().all(is_known) {
        return Err(Fault::scene("axes must be some of x, y and z, such as \"yz\"").into());
    }
    Ok(held)
}

#[pymethods]
impl PyScene {
    /// `gravity` (3,) in m/s^2; `drag` in N s/m on every free node; `damping` (2,), of
    /// masses in 1/s and of stiffnesses in s.
    #[new]
    #[pyo3(signature = (gravity=None, *, name="", drag=0.0, damping=(0.0, 0.0)))]
    fn new(
        gravity: Option<&Bound<'_, PyAny>>,
        name: &str,
        drag: f64,
        damping: (f64, f64),
    ) -> PyResult<Self> {
        let gravity = match gravity {
            Some(gravity) => Floats::new("gravity", gravity)?.vector()?,
            None => Vector3::zeros(),
        };
        let (mass, stiffness) = damping;
        let scene = Scene {
            name: name.to_owned(),
            gravity,
            drag,
            damping: Rayleigh { mass, stiffness },
            ..Scene::default()
        };
        Ok(Self {
            scene,
            ..Self::default()
        })
    }

    /// Adds nodes at `x` (n, 3) in m, with velocities `v` (n, 3) in m/s, masses and drags,
    /// a number or (n,), in kg and N s/m. Returns their indices (n,).
    #[pyo3(signature = (x, *, v=None, mass=None, drag=None))]
    fn nodes<'py>(
        &mut self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        v: Option<&Bound<'py, PyAny>>,
        mass: Option<&Bound<'py, PyAny>>,
        drag: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let positions = Floats::new("x", x)?.vectors()?;
        let n = positions.len();
        let velocities = match v {
            Some(v) => Floats::new("v", v)?.n_vectors(n)?,
            None => vec![Vector3::zeros(); n],
        };
        let masses = each("mass", mass, n)?.unwrap_or_else(|| vec![0.0; n]);
        let drags = each("drag", drag, n)?;
        let first = self.scene.nodes.len();
        self.scene.nodes.extend((0..n).map(|index| Node {
            velocity: velocities[index],
            mass: masses[index],
            drag: drags.as_ref().map(|drags| drags[index]),
            ..Node::at(positions[index])
        }));
        Ok(Self::indices(py, first, first + n))
    }

    /// Adds springs between the pairs of nodes `ij` (k, 2). All others are a number or
    /// (k,): `stiffness` in N/m or `EA` in N; `rest_length` in m, `pretension` in N or
    /// `prestrain`, else they are at rest; `mass` in kg or `mass_per_length` in kg/m;
    /// `damping` in N s/m or `damping_ratio`. `law` is a `Law` or "tension-only",
    /// "compression-only", "linear". Returns their indices (k,).
    #[pyo3(signature = (ij, stiffness=None, *, EA=None, rest_length=None, pretension=None, prestrain=None,
        mass=None, mass_per_length=None, damping=None, damping_ratio=None, law=None))]
    #[expect(
        non_snake_case,
        clippy::too_many_arguments,
        reason = "as engineers write it"
    )]
    fn springs<'py>(
        &mut self,
        py: Python<'py>,
        ij: &Bound<'py, PyAny>,
        stiffness: Option<&Bound<'py, PyAny>>,
        EA: Option<&Bound<'py, PyAny>>,
        rest_length: Option<&Bound<'py, PyAny>>,
        pretension: Option<&Bound<'py, PyAny>>,
        prestrain: Option<&Bound<'py, PyAny>>,
        mass: Option<&Bound<'py, PyAny>>,
        mass_per_length: Option<&Bound<'py, PyAny>>,
        damping: Option<&Bound<'py, PyAny>>,
        damping_ratio: Option<&Bound<'py, PyAny>>,
        law: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let given = Given {
            stiffness,
            axial_stiffness: EA,
            rest_length,
            pretension,
            prestrain,
            mass,
            mass_per_length,
            damping,
            damping_ratio,
            law,
        };
        let Made {
            mut springs,
            law,
            ratios,
        } = make(&self.scene, ij, &given)?;
        let law = law.map(|law| {
            let laws = &mut self.scene.laws;
            let known = laws.iter().position(|known| *known == law);
            known.unwrap_or_else(|| {
                laws.push(law);
                laws.len() - 1
            })
        });
        springs.iter_mut().for_each(|spring| spring.law = law);
        let first = self.scene.springs.len();
        self.scene.springs.append(&mut springs);
        self.inputs.damping_ratios.extend(ratios);
        Ok(Self::indices(py, first, self.scene.springs.len()))
    }

    /// Holds nodes (an index, indices or a mask) along `axes`, such as "z" or "xy";
    /// without axes they follow x + v t, and beside that the smooth `motion` (m, 3) in m
    /// at the `times` (m,) in s.
    #[pyo3(signature = (nodes, axes=None, *, motion=None, times=None))]
    fn fix(
        &mut self,
        nodes: &Bound<'_, PyAny>,
        axes: Option<&str>,
        motion: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let nodes = some_nodes(nodes, self.scene.nodes.len())?;
        let axes = axes_of(axes)?;
        let motion = match (motion, times) {
            (None, None) => None,
            (Some(motion), Some(times)) if axes == [true; 3] => {
                let times = Floats::new("times", times)?;
                let times = times.row()?;
                let displacements = Floats::new("motion", motion)?.n_vectors(times.len())?;
                let points = times.iter().copied().zip(displacements);
                let index = self.scene.motions.len();
                self.scene.motions.push(NamedMotion {
                    name: format!("motion {index}"),
                    motion: PrescribedMotion::Table(points.collect()),
                });
                Some(index)
            }
            _ => {
                let message = "a motion needs motion, times and no axes";
                return Err(Fault::scene(message).into());
            }
        };
        for node in nodes {
            let node = &mut self.scene.nodes[node];
            let mut held = axes;
            if let Some(Guide::Held(before)) = node.guide {
                held = std::array::from_fn(|axis| held[axis] || before[axis]);
            }
            node.fixed |= held == [true; 3];
            node.guide = (!node.fixed).then_some(Guide::Held(held));
            node.motion = motion.or(node.motion);
        }
        Ok(())
    }

    /// A force in N on each of some nodes (an index, indices or a mask): `force` (3,), or
    /// (m, 3) at the `times` (m,) in s, with straight lines between and constant before
    /// and after. `name` is for people and stands in the report.
    #[pyo3(signature = (nodes, force, times=None, *, name=""))]
    fn load(
        &mut self,
        nodes: &Bound<'_, PyAny>,
        force: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
        name: &str,
    ) -> PyResult<()> {
        let nodes = some_nodes(nodes, self.scene.nodes.len())?;
        let force = Floats::new("force", force)?;
        let Some(times) = times else {
            let force = force.vector()?;
            self.scene.loads.push(Load {
                name: name.to_owned(),
                nodes,
                force,
                over_time: OverTime::Constant,
            });
            return Ok(());
        };
        let times = Floats::new("times", times)?;
        let times = times.row()?;
        let forces = force.n_vectors(times.len())?;
        for axis in 0..3 {
            if forces.iter().all(|force| force[axis] == 0.0) {
                continue;
            }
            let points = times.iter().zip(&forces);
            let mut direction = Vector3::zeros();
            direction[axis] = 1.0;
            self.scene.loads.push(Load {
                name: name.to_owned(),
                nodes: nodes.clone(),
                force: direction,
                over_time: OverTime::Table(
                    points.map(|(&time, force)| [time, force[axis]]).collect(),
                ),
            });
        }
        Ok(())
    }

    /// The same scene with how it is run as its own settings: the arguments of `run`.
    #[pyo3(signature = (*, duration=None, tolerance=None, step=None, method=None, tangent=None))]
    fn with_settings(
        &self,
        duration: Option<f64>,
        tolerance: Option<f64>,
        step: Option<f64>,
        method: Option<&str>,
        tangent: Option<&str>,
    ) -> PyResult<Self> {
        let (scene, options) = self.changed(&Changes {
            duration,
            tolerance,
            step,
            method,
            tangent,
            threads: None,
        })?;
        Ok(Self {
            scene,
            options,
            inputs: self.inputs.clone(),
        })
    }

    /// What is in the scene, what a run leaves out, and what looks wrong; runs nothing.
    fn check(&self, py: Python<'_>) -> PyResult<PyCheck> {
        let (scene, options) = self.changed(&Changes::default())?;
        match py.detach(|| Check::of(&scene, &options, &self.inputs)) {
            Ok(check) => Ok(PyCheck(check)),
            Err(CheckError::Setup(error)) => Err(Fault::from(&error).into()),
            Err(error) => Err(Fault::system(error).into()),
        }
    }

    /// Finds an equilibrium under the loads of the time 0, and says whether it is stable.
    #[pyo3(signature = (*, threads=None))]
    fn settle(&self, py: Python<'_>, threads: Option<usize>) -> PyResult<PyEquilibrium> {
        let (scene, options) = self.changed(&Changes {
            threads,
            ..Changes::default()
        })?;
        settled(py, &scene, &options)
    }

    /// Simulates `duration` s from `start` (anything with x and perhaps v, broken and
    /// yielded, such as an equilibrium or a result; else the scene itself), with an error of `tolerance` m or steps of `step` s,
    /// and shows `frames` + 1 frames (else those of its file, or 60 a second). `progress` is True for a bar, or a
    /// function of a number from 0 to 1.
    ///
    /// Ctrl-C raises `Interrupted`, and what fails on the way `StepError`; their `result`
    /// has everything up to then.
    #[pyo3(signature = (duration=None, *, start=None, tolerance=None, step=None, method=None, tangent=None,
        frames=None, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "all but the first are keywords")]
    fn run(
        &self,
        py: Python<'_>,
        duration: Option<f64>,
        start: Option<&Bound<'_, PyAny>>,
        tolerance: Option<f64>,
        step: Option<f64>,
        method: Option<&str>,
        tangent: Option<&str>,
        frames: Option<usize>,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Py<RunResult>> {
        let progress = Progress::new(progress)?;
        let (scene, options) = self.changed(&Changes {
            duration,
            tolerance,
            step,
            method,
            tangent,
            threads,
        })?;
        let scene = scene_at(py, scene, start, &options)?;
        let intervals = match frames {
            Some(0) => return Err(Fault::scene("frames must be at least 1").into()),
            Some(frames) => frames,
            None => intervals(&scene),
        };
        Run::new(py, scene, options, intervals)?.go(py, &progress)
    }

    /// A simulation in steps of `step` s, for a loop of one's own.
    #[pyo3(signature = (step, *, method=None, tangent=None, start=None, threads=None))]
    fn simulation(
        &self,
        py: Python<'_>,
        step: f64,
        method: Option<&str>,
        tangent: Option<&str>,
        start: Option<&Bound<'_, PyAny>>,
        threads: Option<usize>,
    ) -> PyResult<PySimulation> {
        let (scene, options) = self.changed(&Changes {
            step: Some(step),
            method,
            tangent,
            threads,
            ..Changes::default()
        })?;
        let scene = scene_at(py, scene, start, &options)?;
        PySimulation::new(py, scene, options)
    }

    /// Run time against error, method by method, in about `budget` s.
    #[pyo3(signature = (budget=30.0, *, threads=None, progress=None))]
    fn study(
        &self,
        py: Python<'_>,
        budget: f64,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyStudy> {
        let progress = Progress::new(progress)?;
        let (scene, options) = self.changed(&Changes {
            threads,
            ..Changes::default()
        })?;
        let scene = started(py, scene, &options)?;
        study::make(py, &scene, study::options(budget, options)?, &progress)
    }

    /// The same scene with other numbers, by name, such as `{"EA": 1e5, "loads": 2.0}`:
    /// the names of `springs sweep --set`.
    fn changed_by(&self, settings: &Bound<'_, PyDict>) -> PyResult<Self> {
        let Subject {
            scene,
            options,
            inputs,
        } = sweep::changed(self.subject()?, settings)?;
        Ok(Self {
            scene,
            options,
            inputs,
        })
    }

    /// Runs the scene on one thread, and returns these numbers of the run by name, such as
    /// "max(tension)": those of `springs sweep --measure`.
    fn measure(&self, py: Python<'_>, names: Vec<String>) -> PyResult<Vec<f64>> {
        sweep::measured(py, self.subject()?, &names)
    }

    /// Writes a scene file, which reads back to the same bits.
    fn write(&self, path: PathBuf) -> PyResult<()> {
        let scene = self.build()?;
        Ok(write_scene(&path, &scene, &self.options).map_err(Fault::system)?)
    }

    /// Positions of the nodes, in m: (n, 3).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let nodes = NodeStates::of(&self.scene);
        array2(py, flat(&nodes.positions), 3, nodes.positions.len())
    }

    /// Velocities of the nodes, in m/s: (n, 3).
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let nodes = NodeStates::of(&self.scene);
        array2(py, flat(&nodes.velocities), 3, nodes.velocities.len())
    }

    /// Masses of the nodes with half of those of their springs, in kg: (n,).
    #[getter]
    fn mass<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.scene.node_masses())
    }

    /// The nodes of the springs: (k, 2).
    #[getter]
    fn ij<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let springs = &self.scene.springs;
        let nodes = springs.iter().flat_map(|spring| spring.nodes);
        array2(
            py,
            nodes.map(|node| node as i64).collect(),
            2,
            springs.len(),
        )
    }

    /// Stiffnesses of the springs, in N/m: (k,).
    #[getter]
    fn stiffness<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let springs = self.scene.springs.iter();
        array1(py, springs.map(|spring| spring.stiffness).collect())
    }

    /// Rest lengths of the springs, in m: (k,).
    #[getter]
    fn rest_length<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let springs = self.scene.springs.iter();
        array1(py, springs.map(|spring| spring.rest_length).collect())
    }

    /// The same scene, to be changed apart.
    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let text = scene_to_string(&self.build()?, &self.options);
        let inputs = serde_json::to_string(&self.inputs).map_err(Fault::system)?;
        let make = py.import("springs._springs")?.getattr("_scene")?;
        (make, (text, inputs)).into_pyobject(py)
    }

    fn __repr__(&self) -> String {
        let (n, k) = (self.scene.nodes.len(), self.scene.springs.len());
        format!("<springs.Scene of {n} nodes and {k} springs>")
    }
}

fn parse(file: &str, text: &str) -> PyResult<PyScene> {
    let read = parse_scene_with_inputs(file, text);
    let (scene, options, inputs) = read.map_err(|error| Fault::from(&error))?;
    Ok(PyScene {
        scene,
        options,
        inputs,
    })
}

/// Reads a scene file, the same as the command line does.
#[pyfunction]
pub(crate) fn load(path: PathBuf) -> PyResult<PyScene> {
    let file = path.display().to_string();
    let text = read_text(&file, std::fs::File::open(&path));
    parse(&file, &text.map_err(|error| Fault::from(&error))?)
}

/// A scene from the text of a file and what that does not say of materials, groups and
/// damping ratios: what pickling writes.
#[pyfunction(name = "_scene")]
pub(crate) fn scene_of_text(text: &str, inputs: &str) -> PyResult<PyScene> {
    let mut scene = parse("a pickled scene", text)?;
    scene.inputs = serde_json::from_str(inputs)
        .map_err(|error| Fault::scene(format!("a pickled scene is damaged: {error}")))?;
    Ok(scene)
}
