//! A sweep in a folder that any number of workers, in any processes, take runs from.
//!
//! | in the folder | |
//! | --- | --- |
//! | `sweep.json`, `scene.ron` | the plan; never changed |
//! | `todo/` | an empty file for each run that nobody has begun |
//! | `claimed/` | the same, of runs that a worker has taken by renaming them |
//! | `workers/` | a file for each worker, locked as long as it lives |
//! | `results.csv` | a line for each finished run; sorted when all are there |
//! | `lock` | held by who writes into `results.csv` |
//!
//! A run is renamed from `todo` to `claimed` by one worker only. It leaves `claimed`
//! when its line is written. What a worker that died has claimed goes back to `todo`,
//! unless its line is there.

use super::measure::{RunFailure, measure};
use super::table::{Table, append, quoted};
use super::{Axis, Plan, PlanError, Run, Subject};
use serde::{Deserialize, Serialize};
use springs_io::{
    Inputs, SceneError, WriteError, read_scene, scene_to_string, write_scene, write_whole,
};
use springs_solver::Interrupt;
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io;
use std::path::{Path, PathBuf};

/// The table of what runs came to.
pub const RESULTS: &str = "results.csv";
const PLAN: &str = "sweep.json";
const SCENE: &str = "scene.ron";
const LOCK: &str = "lock";
const TODO: &str = "todo";
const CLAIMED: &str = "claimed";
const WORKERS: &str = "workers";

/// A run whose workers have died so often has failed.
const MOST_ATTEMPTS: u32 = 20;

/// Something is wrong with a folder.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// It is no sweep.
    #[error("`{}` is not the folder of a sweep", folder.display())]
    NoSweep {
        /// The folder.
        folder: PathBuf,
    },
    /// It is another sweep.
    #[error("`{}` holds another sweep", folder.display())]
    Other {
        /// The folder.
        folder: PathBuf,
    },
    /// Its plan cannot be understood.
    #[error("`{}` cannot be understood: {source}", path.display())]
    Plan {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// Its scene cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its plan is not possible.
    #[error(transparent)]
    Impossible(#[from] PlanError),
    /// A file cannot be read, written or renamed.
    #[error(transparent)]
    File(#[from] WriteError),
}

/// A plan as a file.
#[derive(Serialize, Deserialize, PartialEq)]
struct PlanFile {
    springs_version: String,
    set: Vec<AxisFile>,
    measure: Vec<String>,
    skip: bool,
    inputs: Inputs,
}

#[derive(Serialize, Deserialize, PartialEq)]
struct AxisFile {
    name: String,
    values: Vec<f64>,
}

impl PlanFile {
    fn of(plan: &Plan) -> Self {
        let Subject {
            options, inputs, ..
        } = plan.subject();
        let axis = |axis: &Axis| AxisFile {
            name: axis.setting.to_string(),
            values: axis.values.clone(),
        };
        Self {
            springs_version: env!("CARGO_PKG_VERSION").to_owned(),
            set: plan.axes().iter().map(axis).collect(),
            measure: plan.measures().iter().map(ToString::to_string).collect(),
            skip: options.skip,
            inputs: inputs.clone(),
        }
    }
}

/// A worker that ends in good order leaves no file.
impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(self.folder.join(WORKERS).join(&self.name));
    }
}

/// How far a sweep is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Runs that have a line, failed ones included.
    pub done: usize,
    /// Runs that failed.
    pub failed: usize,
    /// All runs.
    pub runs: usize,
}

/// A worker of a sweep in a folder.
pub struct Folder {
    folder: PathBuf,
    plan: Plan,
    /// Its own file among the workers, locked as long as the worker lives.
    _alive: File,
    name: String,
    /// Runs to try, the next one last.
    listed: Vec<String>,
}

/// A run that is taken, and by which name.
pub struct Claim {
    /// The run.
    pub run: Run,
    name: String,
    attempt: u32,
}

impl Folder {
    /// Makes the folder of a sweep, or goes on with the same one that is there; nothing
    /// is run yet.
    ///
    /// # Errors
    ///
    /// If there is something else, or it cannot be written.
    pub fn begin(folder: &Path, plan: &Plan) -> Result<(), FolderError> {
        let path = folder.join(PLAN);
        let file = PlanFile::of(plan);
        let text = serde_json::to_string_pretty(&file).map_err(|source| FolderError::Plan {
            path: path.clone(),
            source,
        })?;
        for part in [TODO, CLAIMED, WORKERS] {
            let part = folder.join(part);
            std::fs::create_dir_all(&part).map_err(|source| failed(&part, source))?;
        }
        let _lock = lock(folder)?;
        let Subject { scene, options, .. } = plan.subject();
        if path.exists() {
            let there = std::fs::read_to_string(folder.join(SCENE)).unwrap_or_default();
            let is_same = PlanFile::of(&Self::read(folder)?) == file;
            return if is_same && there == scene_to_string(scene, options) {
                Ok(())
            } else {
                Err(FolderError::Other {
                    folder: folder.to_owned(),
                })
            };
        }
        let settings = file.set.iter().map(|axis| &axis.name);
        let columns = settings.chain(&file.measure).map(|name| quoted(name));
        let columns: Vec<String> = columns.collect();
        let header = format!("run,{},failure\n", columns.join(","));
        let results = folder.join(RESULTS);
        // Somebody who was killed may have come so far; anything else is not ours.
        if results.exists() && !std::fs::read(&results).is_ok_and(|text| text == header.as_bytes())
        {
            return Err(FolderError::Other {
                folder: folder.to_owned(),
            });
        }
        write_scene(&folder.join(SCENE), scene, options)?;
        let digits = (plan.n_runs() - 1).to_string().len();
        for run in 0..plan.n_runs() {
            let path = folder.join(TODO).join(format!("{run:0digits$}.0"));
            File::create(&path).map_err(|source| failed(&path, source))?;
        }
        write_whole(&results, header.as_bytes())?;
        // Last: without it there is no sweep.
        Ok(write_whole(&path, text.as_bytes())?)
    }

    /// Reads the plan of a folder.
    ///
    /// # Errors
    ///
    /// If it is not the folder of a sweep.
    pub fn read(folder: &Path) -> Result<Plan, FolderError> {
        let path = folder.join(PLAN);
        let Ok(text) = std::fs::read_to_string(&path) else {
            return Err(FolderError::NoSweep {
                folder: folder.to_owned(),
            });
        };
        let file: PlanFile = serde_json::from_str(&text).map_err(|source| FolderError::Plan {
            path: path.clone(),
            source,
        })?;
        let (scene, mut options) = read_scene(&folder.join(SCENE))?;
        options.threads = 1;
        options.skip = file.skip;
        let subject = Subject {
            scene,
            options,
            inputs: file.inputs,
        };
        let axes = file.set.into_iter().map(|axis| {
            Ok(Axis {
                setting: axis.name.parse().map_err(PlanError::Setting)?,
                values: axis.values,
            })
        });
        let axes = axes.collect::<Result<Vec<Axis>, FolderError>>()?;
        Ok(Plan::of_axes(subject, axes, &file.measure)?)
    }

    /// Becomes a worker of a folder.
    ///
    /// # Errors
    ///
    /// If it is not the folder of a sweep, or cannot be written.
    pub fn work(folder: &Path) -> Result<Self, FolderError> {
        let plan = Self::read(folder)?;
        // Random, since workers may be on several machines.
        let name = format!("{:016x}", RandomState::new().build_hasher().finish());
        let path = folder.join(WORKERS).join(&name);
        let made = OpenOptions::new().write(true).create_new(true).open(&path);
        // It is locked before anything is claimed under its name.
        let locked = made.and_then(|file| file.lock().map(|()| file));
        Ok(Self {
            folder: folder.to_owned(),
            plan,
            _alive: locked.map_err(|source| failed(&path, source))?,
            name,
            listed: Vec::new(),
        })
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Takes a run; `None` if none is left that nobody works on.
    ///
    /// # Errors
    ///
    /// If the folder cannot be read or written.
    pub fn claim(&mut self) -> Result<Option<Claim>, FolderError> {
        loop {
            let Some(entry) = self.listed.pop() else {
                self.listed = list(&self.folder.join(TODO))?;
                self.listed.reverse();
                if self.listed.is_empty() && self.return_abandoned()? == 0 {
                    return Ok(None);
                }
                continue;
            };
            let Some((run, attempt)) = run_and_attempt(&entry) else {
                continue;
            };
            let Some(run) = self.plan.run(run) else {
                continue;
            };
            let name = format!("{entry}.{}", self.name);
            let from = self.folder.join(TODO).join(&entry);
            match std::fs::rename(&from, self.folder.join(CLAIMED).join(&name)) {
                Ok(()) => return Ok(Some(Claim { run, name, attempt })),
                // Somebody else was faster.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(source) => return Err(failed(&from, source).into()),
            }
        }
    }

    /// Writes the line of a run: its measures, or why it failed.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn finish(&self, claim: &Claim, measured: Result<&[f64], &str>) -> Result<(), FolderError> {
        let numbers = claim.run.values.iter().map(|value| format!("{value:?}"));
        let mut fields: Vec<String> = numbers.collect();
        match measured {
            Ok(measured) => {
                fields.extend(measured.iter().map(|value| format!("{value:?}")));
                fields.push(String::new());
            }
            Err(why) => {
                fields.extend(self.plan.measures().iter().map(|_| String::new()));
                fields.push(quoted(why));
            }
        }
        let line = format!("{},{}\n", claim.run.index, fields.join(","));
        let path = self.folder.join(RESULTS);
        let lock = lock(&self.folder)?;
        append(&path, &line).map_err(|source| failed(&path, source))?;
        drop(lock);
        remove(&self.folder.join(CLAIMED).join(&claim.name))
    }

    /// Gives a run back that was not finished.
    ///
    /// # Errors
    ///
    /// If it cannot be.
    pub fn give_back(&self, claim: &Claim) -> Result<(), FolderError> {
        self.put_back(&claim.name, claim.run.index, claim.attempt)
    }

    fn put_back(&self, name: &str, run: usize, attempt: u32) -> Result<(), FolderError> {
        let from = self.folder.join(CLAIMED).join(name);
        let to = self.folder.join(TODO).join(format!("{run}.{attempt}"));
        match std::fs::rename(&from, to) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                Err(failed(&from, source).into())
            }
            _ => Ok(()),
        }
    }

    /// Returns what workers that died have claimed; how much that was.
    fn return_abandoned(&self) -> Result<usize, FolderError> {
        let claimed = list(&self.folder.join(CLAIMED))?;
        let mut returned = 0;
        let mut dead = BTreeSet::new();
        let mut alive = BTreeSet::from([self.name.clone()]);
        for name in claimed {
            let Some((entry, worker)) = name.rsplit_once('.') else {
                continue;
            };
            let Some((run, attempt)) = run_and_attempt(entry) else {
                continue;
            };
            if !dead.contains(worker) && !alive.contains(worker) {
                if self.is_alive(worker) {
                    alive.insert(worker.to_owned());
                } else {
                    dead.insert(worker.to_owned());
                }
            }
            if alive.contains(worker) {
                continue;
            }
            let _lock = lock(&self.folder)?;
            let path = self.folder.join(CLAIMED).join(&name);
            if !path.exists() {
                continue;
            }
            let table = self.folder.join(RESULTS);
            let read = Table::read(&table).map_err(|source| failed(&table, source))?;
            if read.rows.iter().any(|row| row.run == run) {
                remove(&path)?;
                continue;
            }
            self.put_back(&name, run, attempt + 1)?;
            returned += 1;
        }
        Ok(returned)
    }

    /// Whether somebody holds the lock of a worker.
    fn is_alive(&self, worker: &str) -> bool {
        let Ok(file) = File::open(self.folder.join(WORKERS).join(worker)) else {
            return false;
        };
        matches!(file.try_lock(), Err(TryLockError::WouldBlock))
    }

    /// How far the sweep is; once all runs are there, the table is in their order.
    ///
    /// # Errors
    ///
    /// If the table cannot be read or written.
    pub fn progress(&self) -> Result<Progress, FolderError> {
        let _lock = lock(&self.folder)?;
        let path = self.folder.join(RESULTS);
        let table = Table::read(&path).map_err(|source| failed(&path, source))?;
        let runs = self.plan.n_runs();
        let progress = Progress {
            done: table.rows.len(),
            failed: table.rows.iter().filter(|row| row.has_failed()).count(),
            runs,
        };
        if progress.done == runs && !table.is_sorted() {
            write_whole(&path, table.sorted().as_bytes())?;
        }
        Ok(progress)
    }

    /// Takes runs and makes them until none is left, or the interrupt asks to stop; tells
    /// of each whether it failed.
    ///
    /// # Errors
    ///
    /// If the folder cannot be read or written.
    pub fn make_runs(
        &mut self,
        interrupt: &Interrupt,
        mut made: impl FnMut(bool),
    ) -> Result<(), FolderError> {
        while let Some(claim) = self.claim()? {
            match self.make(&claim, interrupt) {
                Ok(measured) => {
                    self.finish(&claim, Ok(&measured))?;
                    made(true);
                }
                Err(None) => return self.give_back(&claim),
                Err(Some(why)) => {
                    self.finish(&claim, Err(&why))?;
                    made(false);
                }
            }
        }
        Ok(())
    }

    /// The measures of a run, or why it failed; nothing if it was asked to stop.
    fn make(&self, claim: &Claim, interrupt: &Interrupt) -> Result<Vec<f64>, Option<String>> {
        if claim.attempt >= MOST_ATTEMPTS {
            return Err(Some(format!("{MOST_ATTEMPTS} workers died of it")));
        }
        let subject = self.plan.subject_of(&claim.run);
        let subject = subject.map_err(|error| Some(error.to_string()))?;
        match measure(&subject, self.plan.measures(), interrupt) {
            Ok(measured) => Ok(measured),
            Err(RunFailure::Interrupted) => Err(None),
            Err(_) if interrupt.is_requested() => Err(None),
            Err(error) => Err(Some(error.to_string())),
        }
    }
}

/// Waits for the lock of the table, which is free when it is dropped.
fn lock(folder: &Path) -> Result<File, WriteError> {
    let path = folder.join(LOCK);
    let opened = OpenOptions::new().create(true).append(true).open(&path);
    let locked = opened.and_then(|file| file.lock().map(|()| file));
    locked.map_err(|source| failed(&path, source))
}

/// The names in a folder, ascending.
fn list(folder: &Path) -> Result<Vec<String>, WriteError> {
    let names = std::fs::read_dir(folder).and_then(|entries| {
        let name = |entry: io::Result<std::fs::DirEntry>| {
            Ok(entry?.file_name().to_string_lossy().into_owned())
        };
        entries.map(name).collect::<io::Result<Vec<String>>>()
    });
    let mut names = names.map_err(|source| failed(folder, source))?;
    names.sort_unstable();
    Ok(names)
}

/// What the name of a file in `todo` says.
fn run_and_attempt(name: &str) -> Option<(usize, u32)> {
    let (run, attempt) = name.split_once('.')?;
    Some((run.parse().ok()?, attempt.parse().ok()?))
}

fn remove(path: &Path) -> Result<(), FolderError> {
    match std::fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => Err(failed(path, source).into()),
        _ => Ok(()),
    }
}

fn failed(path: &Path, source: io::Error) -> WriteError {
    WriteError {
        path: path.to_owned(),
        source,
    }
}
