//! The folder that a run writes into.

use super::{Advised, Unwritten};
use springs::io::{
    ContinueError, MODES, PATH, Report, RunEnd, RunPlan, SHAPES, WriteError, part_name,
    remove_drafts, remove_series, try_to_write, write_report, write_scene,
};
use springs::plots::PLOTS;
use springs::scene::{RunOptions, Scene};
use springs::sinks::{Marks, SINKS, Sinks};
use springs::step::{Account, Frame, Samples, StepRecord};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

pub(crate) const SCENE: &str = "final.ron";
pub(crate) const REPORT: &str = "report.json";
/// What a stopped run goes on from.
pub(crate) const CHECKPOINT: &str = "checkpoint.bin";

/// Names of all that a run, a command of statics or of pictures may write; those of folders
/// end in `/`.
pub(crate) fn all_files() -> Vec<String> {
    let mut names = [SCENE, REPORT, PATH, MODES, SHAPES]
        .map(str::to_owned)
        .to_vec();
    for file in SINKS.iter().flat_map(|kind| kind.files()) {
        names.extend([file.to_owned(), part_name(file)]);
    }
    names.extend(PLOTS.iter().map(|plot| plot.picture.to_owned()));
    names.push(CHECKPOINT.to_owned());
    names
}

/// Refuses a folder in which one of the files exists already.
pub(crate) fn claim(folder: &Path, files: &[impl AsRef<str>], force: bool) -> Result<(), Advised> {
    if folder.exists() && !folder.is_dir() {
        return Err(Advised {
            message: format!("{} is in the way of the output folder", quoted(folder)),
            advice: Some("choose another folder with --out".to_owned()),
        });
    }
    let mut names = files.iter().map(AsRef::as_ref);
    match names.find(|name| folder.join(name).exists()) {
        Some(name) if !force => Err(Advised {
            message: format!(
                "the folder {} holds the {name} of another run",
                quoted(folder)
            ),
            advice: Some(match name {
                CHECKPOINT => format!(
                    "go on with it by `springs resume {}`, choose another folder with --out, \
                     or add --force",
                    folder.display()
                ),
                _ => "choose another folder with --out, or add --force".to_owned(),
            }),
        }),
        _ => Ok(()),
    }
}

/// A path in a sentence.
pub(crate) fn quoted(path: &Path) -> String {
    format!("`{}`", path.display())
}

/// Keeps others from writing into the folder until it is dropped or the program
/// ends, however it ends. `None` where the system cannot lock a folder.
pub(crate) fn lock(folder: &Path) -> Result<Option<File>, Advised> {
    let Ok(file) = File::open(folder) else {
        return Ok(None);
    };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(Advised {
            message: format!("another run is writing into the folder {}", quoted(folder)),
            advice: Some("wait for its end, or choose another folder with --out".to_owned()),
        }),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// Makes the folder if it is not there.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Unwritten> {
    Ok(
        std::fs::create_dir_all(folder).map_err(|source| WriteError {
            path: folder.to_owned(),
            source,
        })?,
    )
}

/// The files of one run. Those of an older run stay until they are replaced by
/// whole ones, or until this run is complete without them.
pub(crate) struct Output {
    folder: PathBuf,
    _lock: Option<File>,
    sinks: Sinks,
    /// The checkpoint in the folder, if there is one, is this run's.
    owns_checkpoint: bool,
}

/// Makes the folder of results and locks it; refuses that of another run.
pub(crate) fn open_folder(folder: &Path, force: bool) -> anyhow::Result<Option<File>> {
    make_folder(folder)?;
    let lock = lock(folder)?;
    // Another run may have ended since the folder was looked at.
    claim(folder, &all_files(), force)?;
    if lock.is_some() {
        remove_drafts(folder);
    }
    Ok(lock)
}

/// Removes what an older run left in a folder, but for names that stay. What cannot be
/// removed stays, too.
pub(crate) fn remove_all_but(folder: &Path, stays: impl Fn(&str) -> bool) {
    for name in all_files().into_iter().filter(|name| !stays(name)) {
        let path = folder.join(&name);
        if name.ends_with('/') {
            remove_series(&path);
        } else {
            let _ = std::fs::remove_file(path);
        }
    }
}

impl Output {
    /// Refuses a folder that holds the results of another run, and a scene that
    /// would be replaced by something else.
    pub(crate) fn check(folder: &Path, scene: &Path, force: bool) -> Result<(), Advised> {
        claim(folder, &all_files(), force)?;
        let Ok(scene) = scene.canonicalize() else {
            return Ok(());
        };
        // A scene is read before anything is written, and final.ron is replaced
        // by a whole scene: going on from there in place is safe.
        let others = all_files().into_iter().filter(|name| name != SCENE);
        let mut others = others.filter_map(|name| folder.join(name).canonicalize().ok());
        if others.any(|path| path == scene) {
            return Err(Advised {
                message: format!(
                    "the scene {} is a file that this run writes",
                    quoted(&scene)
                ),
                advice: Some("choose another folder with --out".to_owned()),
            });
        }
        Ok(())
    }

    /// Makes the folder, locks it, and starts what is asked for besides scene and
    /// report.
    pub(crate) fn begin(
        folder: &Path,
        names: &[String],
        plan: &RunPlan<'_>,
        force: bool,
    ) -> anyhow::Result<Self> {
        let lock = open_folder(folder, force)?;
        try_to_write(&folder.join(SCENE)).map_err(Unwritten::from)?;
        Ok(Self {
            folder: folder.to_owned(),
            _lock: lock,
            sinks: Sinks::begin(folder, names, plan).map_err(Unwritten::from)?,
            owns_checkpoint: false,
        })
    }

    /// Goes on with the files of a run that was stopped, in a folder that is
    /// locked.
    pub(crate) fn resume(
        folder: &Path,
        lock: Option<File>,
        plan: &RunPlan<'_>,
        marks: &Marks,
    ) -> Result<Self, ContinueError> {
        if lock.is_some() {
            remove_drafts(folder);
        }
        Ok(Self {
            folder: folder.to_owned(),
            _lock: lock,
            sinks: Sinks::resume(folder, plan, marks)?,
            owns_checkpoint: true,
        })
    }

    /// Makes what is written outlive the program; it goes on as `.part` files.
    pub(crate) fn keep(&mut self) -> Result<(), Unwritten> {
        let (_, kept) = self.sinks.keep();
        Ok(kept?)
    }

    /// Bytes that could not be written so far.
    pub(crate) fn n_unwritten(&mut self) -> usize {
        self.sinks.n_unwritten()
    }

    /// Notes that a checkpoint of this run is in the folder.
    pub(crate) fn checkpoint_written(&mut self) {
        self.owns_checkpoint = true;
    }

    /// Whether this run has left a checkpoint to go on from.
    pub(crate) fn owns_checkpoint(&self) -> bool {
        self.owns_checkpoint
    }

    /// How far it is written.
    pub(crate) fn marks(&mut self) -> Marks {
        self.sinks.marks()
    }

    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether anybody asked for frames.
    pub(crate) fn wants_frames(&self) -> bool {
        !self.sinks.is_empty()
    }

    /// Whether a frame was shown whose energies are not yet written.
    pub(crate) fn wants_account(&self) -> bool {
        self.sinks.awaits_energies()
    }

    /// What finds no room is kept to be written later.
    pub(crate) fn frame(&mut self, frame: Frame<'_>) -> Result<(), Unwritten> {
        Ok(self.sinks.frame(frame)?)
    }

    pub(crate) fn step(&mut self, record: &StepRecord) -> Result<(), Unwritten> {
        Ok(self.sinks.step(record)?)
    }

    pub(crate) fn wants_members(&self) -> bool {
        self.sinks.wants_members()
    }

    pub(crate) fn wants_samples(&self) -> bool {
        self.sinks.want_samples()
    }

    pub(crate) fn samples(&mut self, samples: Samples<'_>) -> Result<(), Unwritten> {
        Ok(self.sinks.samples(samples)?)
    }

    pub(crate) fn account(&mut self, account: &Account) -> Result<(), Unwritten> {
        Ok(self.sinks.account(account)?)
    }

    /// Completes everything but the report; says which files there are then.
    pub(crate) fn finish(
        &mut self,
        end: &RunEnd<'_>,
        options: &RunOptions,
    ) -> Result<Vec<&'static str>, Unwritten> {
        // The folder may have been removed on the way.
        make_folder(&self.folder)?;
        write_scene(&self.folder.join(SCENE), end.scene, options)?;
        let mut written = vec![SCENE, REPORT];
        written.extend(self.sinks.finish(end)?);
        Ok(written)
    }

    pub(crate) fn report(&self, report: &Report) -> Result<(), Unwritten> {
        Ok(write_report(&self.folder.join(REPORT), report)?)
    }

    /// The results are complete: removes what is left of an older run, and the
    /// checkpoint if nothing is left to go on with. What cannot be removed stays.
    pub(crate) fn remove_others(&self, written: &[&str], is_finished: bool) {
        let keeps_checkpoint = self.owns_checkpoint && !is_finished;
        remove_all_but(&self.folder, |name| {
            written.contains(&name) || (name == CHECKPOINT && keeps_checkpoint)
        });
    }

    /// Writes the final scene and the report as far as there is room, after
    /// something else could not be written. Says which files are there.
    pub(crate) fn save_what_fits(
        &mut self,
        last: &Scene,
        options: &RunOptions,
        report: &Report,
    ) -> Vec<String> {
        // The folder may have been removed on the way.
        let _ = make_folder(&self.folder);
        let (mut saved, _) = self.sinks.keep();
        saved.retain(|name| self.folder.join(name).exists());
        if write_scene(&self.folder.join(SCENE), last, options).is_ok() {
            saved.push(SCENE.to_owned());
        }
        if self.report(report).is_ok() {
            saved.push(REPORT.to_owned());
        }
        saved
    }
}
