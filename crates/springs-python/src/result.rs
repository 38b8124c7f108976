//! A run and what comes of it.

use crate::arrays::{array1, array2, array3};
use crate::attended::{Progress, Shared, attended};
use crate::errors::{Fault, interrupted};
use crate::record::{Energies, Record, Recorder};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use springs::filmstrip::{Panel, filmstrip};
use springs::io::{
    ENERGIES, ENERGY_COLUMNS, FrameEnergies, FrameMembers, Npz, RunEnd, RunPlan, Sink, SinkKind,
    TrajectoryFrame, WriteError, write_whole,
};
use springs::report::{Ending, Timings, TurnedOver, report};
use springs::scene::{RunOptions, Scene, Vector3};
use springs::solver::Interrupt;
use springs::step::Islands;
use springs::view::page_of;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A run that is to begin or to go on.
pub(crate) struct Run {
    scene: Scene,
    options: RunOptions,
    intervals: usize,
    islands: Islands,
    record: Record,
    turned_over: TurnedOver,
    begin: Instant,
    setup: Duration,
}

impl Run {
    /// Compiles a scene.
    pub(crate) fn new(
        py: Python<'_>,
        scene: Scene,
        options: RunOptions,
        intervals: usize,
    ) -> PyResult<Self> {
        let begin = Instant::now();
        let islands = py.detach(|| Islands::with_options(&scene, &options));
        let islands = islands.map_err(|error| Fault::from(&error))?;
        Ok(Self {
            scene,
            options,
            intervals,
            islands,
            record: Record::default(),
            turned_over: TurnedOver::default(),
            setup: begin.elapsed(),
            begin,
        })
    }

    /// Runs to the end; what stops it on the way is raised, with the result as its
    /// attribute `result`.
    pub(crate) fn go(mut self, py: Python<'_>, progress: &Progress) -> PyResult<Py<RunResult>> {
        let (n_nodes, n_springs) = (self.scene.nodes.len(), self.scene.springs.len());
        let frames = (self.intervals + 1).saturating_sub(self.record.n_frames());
        self.record.reserve(frames, n_nodes, n_springs)?;
        let shared = Shared::default();
        let interrupt = Interrupt::from(shared.is_stopped.clone());
        self.islands.set_interrupt(&interrupt);
        let duration = self.islands.duration();
        let mut recorder = Recorder::new(self.record, self.turned_over, &shared, duration);
        let trials_before = self.islands.trial_time();
        let running = Instant::now();
        let (islands, intervals) = (&mut self.islands, self.intervals);
        let work = || islands.run(intervals, &mut recorder);
        let (outcome, raised) = attended(py, &shared, progress, work)?;
        let trials = self.islands.trial_time().saturating_sub(trials_before);
        let timings = Timings {
            total: self.begin.elapsed(),
            reading: Duration::ZERO,
            setup: self.setup,
            trials,
            stepping: running.elapsed().saturating_sub(trials),
            output: Duration::ZERO,
        };
        let turned_over = recorder.turned_over;
        self.record = Record::default();
        let (islands, record) = (&mut self.islands, recorder.record);
        let (ending, frames) = (Ending::from(outcome), record.n_frames());
        let report = report(&self.scene, islands, ending, timings, turned_over);
        let mut last = self.scene.clone();
        islands.write_to(&mut last);
        let springs = last.springs.iter();
        let (is_broken, yielded) = springs.map(|one| (one.broken, one.yielded)).unzip();
        let result = RunResult {
            t: array1(py, record.times).unbind(),
            x: array3(py, record.positions, n_nodes, frames).unbind(),
            v: array3(py, record.velocities, n_nodes, frames).unbind(),
            tension: array2(py, record.tensions, n_springs, frames).unbind(),
            energy: energies(py, record.energies)?.unbind(),
            status: report.status.clone(),
            report: json(py, &report)?,
            broken: array1(py, is_broken).unbind(),
            yielded: array1(py, yielded).unbind(),
            broken_since: record.broken_since,
            time: islands.time(),
            words: (ending == Ending::Interrupted).then(|| islands.save()),
            turned_over,
            scene: self.scene,
            last,
            options: self.options,
            intervals: self.intervals,
        };
        let (time, result) = (result.time, Py::new(py, result)?);
        let error = match (raised, ending) {
            (Some(raised), _) => interrupted(py, raised, time)?,
            (None, Ending::Failed(error)) => Fault::from(&error).into(),
            (None, _) => return Ok(result),
        };
        error.value(py).setattr("result", result)?;
        Err(error)
    }
}

fn energies(py: Python<'_>, columns: Energies<Vec<f64>>) -> PyResult<Bound<'_, PyDict>> {
    let energies = PyDict::new(py);
    for (kind, column) in ENERGY_COLUMNS.iter().zip(columns) {
        energies.set_item(kind.name, array1(py, column))?;
    }
    Ok(energies)
}

pub(crate) fn json(py: Python<'_>, report: &impl serde::Serialize) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(report).map_err(Fault::system)?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}

/// What a run came to: f frames of n nodes and k springs, in SI units.
#[pyclass(module = "springs", name = "Result", frozen)]
pub(crate) struct RunResult {
    /// Times of the frames, in s: (f,).
    #[pyo3(get)]
    t: Py<PyArray1<f64>>,
    /// Positions, in m: (f, n, 3).
    #[pyo3(get)]
    x: Py<PyArray3<f64>>,
    /// Velocities, in m/s: (f, n, 3).
    #[pyo3(get)]
    v: Py<PyArray3<f64>>,
    /// Tensions without the force of dashpots, in N: (f, k).
    #[pyo3(get)]
    tension: Py<PyArray2<f64>>,
    /// Energies and their flows since the start, in J, by name: (f,). `method` is what
    /// the method itself gained or, if negative, lost.
    #[pyo3(get)]
    energy: Py<PyDict>,
    /// Which springs are broken at the end: (k,).
    #[pyo3(get)]
    broken: Py<PyArray1<bool>>,
    /// By how much springs have yielded at the end, in m: (k,).
    #[pyo3(get)]
    yielded: Py<PyArray1<f64>>,
    /// What `report.json` of the command line holds.
    #[pyo3(get)]
    report: Py<PyAny>,
    /// `finished`, `interrupted` or `failed`.
    #[pyo3(get)]
    status: String,
    /// How far it came, in s.
    #[pyo3(get)]
    time: f64,
    /// What it goes on from, if it was interrupted.
    words: Option<Vec<u64>>,
    turned_over: TurnedOver,
    /// As it was at the start.
    scene: Scene,
    /// As it is at the end.
    last: Scene,
    /// Springs that were broken, and since which frame.
    broken_since: BTreeMap<usize, usize>,
    options: RunOptions,
    intervals: usize,
}

/// The numbers of all arrays, for those who write them.
struct Numbers {
    times: Vec<f64>,
    positions: Vec<Vector3<f64>>,
    velocities: Vec<Vector3<f64>>,
    tensions: Vec<f64>,
}

impl RunResult {
    fn numbers(&self, py: Python<'_>) -> PyResult<Numbers> {
        let vectors = |array: &Py<PyArray3<f64>>| -> PyResult<Vec<Vector3<f64>>> {
            let numbers = array.bind(py).to_vec().map_err(changed)?;
            let (rows, _) = numbers.as_chunks::<3>();
            Ok(rows.iter().map(|row| Vector3::from(*row)).collect())
        };
        Ok(Numbers {
            times: self.t.bind(py).to_vec().map_err(changed)?,
            positions: vectors(&self.x)?,
            velocities: vectors(&self.v)?,
            tensions: self.tension.bind(py).to_vec().map_err(changed)?,
        })
    }

    fn columns(&self, py: Python<'_>) -> PyResult<Energies<Vec<f64>>> {
        let mut columns: Energies<Vec<f64>> = Default::default();
        for (column, kind) in columns.iter_mut().zip(ENERGY_COLUMNS) {
            let array = self.energy.bind(py).as_any().get_item(kind.name)?;
            *column = array.cast::<PyArray1<f64>>()?.to_vec().map_err(changed)?;
        }
        Ok(columns)
    }

    /// The springs that are broken at a frame, ascending.
    fn broken_at(&self, frame: usize) -> Vec<usize> {
        let all = self.broken_since.iter();
        let broken = all.filter(|(_, since)| **since <= frame);
        broken.map(|(spring, _)| *spring).collect()
    }

    fn plan(&self) -> RunPlan<'_> {
        RunPlan {
            scene: &self.scene,
            intervals: self.intervals,
        }
    }

    /// Shows all frames to an output.
    fn show(&self, numbers: &Numbers, sink: &mut dyn Sink) -> Result<(), Fault> {
        let (n, k) = (self.scene.nodes.len(), self.scene.springs.len());
        for (index, &time) in numbers.times.iter().enumerate() {
            let frame = TrajectoryFrame {
                index,
                time,
                positions: &numbers.positions[index * n..(index + 1) * n],
                velocities: &numbers.velocities[index * n..(index + 1) * n],
                members: Some(FrameMembers {
                    springs: &self.scene.springs,
                    tensions: &numbers.tensions[index * k..(index + 1) * k],
                    // Arrays and pages do without these.
                    broken: &[],
                    yielded: &[],
                    reactions: &[],
                }),
            };
            sink.frame(&frame).map_err(Fault::system)?;
        }
        Ok(())
    }

    fn finish(&self, sink: Box<dyn Sink>) -> Result<(), Fault> {
        let end = RunEnd {
            scene: &self.last,
            time: self.time,
            peaks: &[],
        };
        sink.finish(&end).map_err(Fault::system)
    }

    /// Writes the file of arrays into a folder, and says where it is.
    fn write_arrays(&self, numbers: &Numbers, folder: &Path) -> Result<PathBuf, Fault> {
        let mut sink = Npz.begin(folder, &self.plan()).map_err(Fault::system)?;
        self.show(numbers, &mut *sink)?;
        self.finish(sink)?;
        Ok(folder.join(Npz.files()[0]))
    }

    fn write_energies(
        &self,
        times: &[f64],
        columns: &Energies<Vec<f64>>,
        folder: &Path,
    ) -> Result<(), Fault> {
        let mut sink = ENERGIES
            .begin(folder, &self.plan())
            .map_err(Fault::system)?;
        for (k, &time) in times.iter().enumerate() {
            let numbers = std::array::from_fn(|column| columns[column][k]);
            let energies = FrameEnergies::of_numbers(time, numbers);
            sink.energies(&energies).map_err(Fault::system)?;
        }
        self.finish(sink)
    }
}

/// An array that somebody has made something else of.
fn changed(error: impl std::fmt::Display) -> Fault {
    Fault::scene(format!("an array of the result was changed: {error}"))
}

/// A folder for files that are on their way, beside where they go.
fn folder_beside(path: &Path) -> Result<tempfile::TempDir, Fault> {
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    let folder = tempfile::tempdir_in(parent.unwrap_or(Path::new(".")));
    folder.map_err(|error| cannot_write(path, error))
}

fn cannot_write(path: &Path, source: std::io::Error) -> Fault {
    let path = path.to_owned();
    Fault::system(WriteError { path, source })
}

#[pymethods]
impl RunResult {
    /// Goes on with a run that was interrupted, and returns the result of the whole, with
    /// the same bits as if it had not been.
    #[pyo3(signature = (*, progress=None))]
    fn resume(&self, py: Python<'_>, progress: Option<&Bound<'_, PyAny>>) -> PyResult<Py<Self>> {
        let progress = Progress::new(progress)?;
        let Some(words) = &self.words else {
            let message = format!("the run is {}: it does not go on", self.status);
            return Err(Fault::scene(message).into());
        };
        let mut run = Run::new(py, self.scene.clone(), self.options, self.intervals)?;
        run.islands.restore(words.clone()).map_err(Fault::system)?;
        run.turned_over = self.turned_over;
        run.record = Record {
            times: self.t.bind(py).to_vec().map_err(changed)?,
            positions: self.x.bind(py).to_vec().map_err(changed)?,
            velocities: self.v.bind(py).to_vec().map_err(changed)?,
            tensions: self.tension.bind(py).to_vec().map_err(changed)?,
            energies: self.columns(py)?,
            broken_since: self.broken_since.clone(),
        };
        run.go(py, &progress)
    }

    /// Writes all frames for `numpy.load`: `time` (f,), `position`, `velocity` (f, n, 3),
    /// `springs` (k, 2), `length`, `tension` (f, k); the same file as `--write npz`.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let numbers = self.numbers(py)?;
        py.detach(|| {
            let folder = folder_beside(&path)?;
            let file = self.write_arrays(&numbers, folder.path())?;
            let moved = std::fs::rename(file, &path);
            Ok(moved.map_err(|error| cannot_write(&path, error))?)
        })
    }

    /// Writes a page to look at the run in a browser and returns its path; without a
    /// path, into a new folder, and opens it.
    #[pyo3(signature = (path=None))]
    fn view(&self, py: Python<'_>, path: Option<PathBuf>) -> PyResult<PathBuf> {
        let (path, opens) = match path {
            Some(path) => (path, false),
            None => {
                let folder = tempfile::Builder::new().prefix("springs-").tempdir();
                let folder = folder.map_err(Fault::system)?.keep();
                (folder.join("view.html"), true)
            }
        };
        let (numbers, energies) = (self.numbers(py)?, self.columns(py)?);
        py.detach(|| {
            let folder = tempfile::tempdir().map_err(Fault::system)?;
            self.write_arrays(&numbers, folder.path())?;
            self.write_energies(&numbers.times, &energies, folder.path())?;
            let page = page_of(folder.path(), &self.last).map_err(Fault::system)?;
            write_whole(&path, page.as_bytes()).map_err(Fault::system)
        })?;
        if opens {
            let address = format!("file://{}", path.display());
            py.import("webbrowser")?.call_method1("open", (address,))?;
        }
        Ok(path)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let frames = self.t.bind(py).as_any().len().unwrap_or(0);
        let Self { status, time, .. } = self;
        format!("<springs.Result {status} at {time:?} s, {frames} frames>")
    }

    /// The first, the middle and the last frame as a picture.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let n = self.scene.nodes.len();
        let (times, positions) = (self.t.bind(py).readonly(), self.x.bind(py).readonly());
        let times = times.as_slice().map_err(changed)?;
        let (rows, _) = positions.as_slice().map_err(changed)?.as_chunks::<3>();
        let Some(last) = times.len().checked_sub(1) else {
            return Ok(String::new());
        };
        let mut shown = vec![0, last / 2, last];
        shown.dedup();
        let panel = |index: usize| Panel {
            time: times[index],
            positions: rows[index * n..(index + 1) * n]
                .iter()
                .map(|row| Vector3::from(*row))
                .collect(),
            broken: self.broken_at(index),
        };
        let panels: Vec<Panel> = shown.into_iter().map(panel).collect();
        Ok(filmstrip(&self.scene, &panels))
    }
}
