//! The folder that a run writes into.

use super::{Advised, Unwritten};
use serde::{Deserialize, Serialize};
use springs::filmstrip::{Panel, filmstrip};
use springs::io::{
    Beginning, ContinueError, Report, TRAJECTORY_HEADER, TableWriter, TrajectoryFrame, WriteError,
    remove_drafts, try_to_write, write_report, write_scene, write_whole,
};
use springs::scene::{Scene, Vector3};
use springs::step::{Account, Frame};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

/// What `--write` can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub(crate) enum Extra {
    /// trajectory.csv: all nodes at every frame
    Csv,
    /// filmstrip.svg: the first, the middle and the last frame
    Svg,
    /// energy.csv: where the energy is and went, at each frame
    Energy,
}

const SCENE: &str = "final.ron";
const REPORT: &str = "report.json";
const TRAJECTORY: &str = "trajectory.csv";
const ENERGY: &str = "energy.csv";
const FILMSTRIP: &str = "filmstrip.svg";
/// What a stopped run goes on from.
pub(crate) const CHECKPOINT: &str = "checkpoint.bin";

const TRAJECTORY_PART: &str = "trajectory.csv.part";
const ENERGY_PART: &str = "energy.csv.part";

/// All that a run may write.
const FILES: [&str; 8] = [
    SCENE,
    REPORT,
    TRAJECTORY,
    TRAJECTORY_PART,
    ENERGY,
    ENERGY_PART,
    FILMSTRIP,
    CHECKPOINT,
];

const ENERGY_HEADER: &str =
    "time,kinetic,elastic,gravity,total,anchor_work,dashpot_heat,method_gain";

/// Refuses a folder in which one of the files exists already.
pub(crate) fn claim(folder: &Path, files: &[&str], force: bool) -> Result<(), Advised> {
    if folder.exists() && !folder.is_dir() {
        return Err(Advised {
            message: format!("{} is in the way of the output folder", quoted(folder)),
            advice: Some("choose another folder with --out".to_owned()),
        });
    }
    match files.iter().find(|name| folder.join(name).exists()) {
        Some(name) if !force => Err(Advised {
            message: format!(
                "the folder {} holds the {name} of another run",
                quoted(folder)
            ),
            advice: Some(match *name {
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
    trajectory: Option<TableWriter>,
    energy: Option<TableWriter>,
    /// A frame was shown since the last account.
    wants_account: bool,
    /// Moments for the filmstrip, and the frame in the middle.
    panels: Option<Vec<Panel>>,
    middle: usize,
    /// The checkpoint in the folder, if there is one, is this run's.
    owns_checkpoint: bool,
}

/// What has been written so far, to go on from.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Written {
    trajectory: Option<WrittenTable>,
    energy: Option<WrittenTable>,
    wants_account: bool,
    /// Times and positions, bit by bit.
    panels: Option<Vec<(u64, Vec<[u64; 3]>)>>,
    middle: usize,
}

/// What has been written of a table.
#[derive(Debug, Serialize, Deserialize)]
struct WrittenTable {
    bytes: u64,
    sum: u32,
    /// Rows that did not find room.
    unwritten: String,
}

impl WrittenTable {
    fn of(table: &TableWriter) -> Self {
        let Beginning { bytes, sum } = table.beginning();
        Self {
            bytes,
            sum,
            unwritten: table.unwritten().to_owned(),
        }
    }

    fn resume(&self, path: &Path) -> Result<TableWriter, ContinueError> {
        let beginning = Beginning {
            bytes: self.bytes,
            sum: self.sum,
        };
        let mut table = TableWriter::resume(path, beginning)?;
        table.append(&self.unwritten)?;
        Ok(table)
    }
}

impl Written {
    /// Whether a run of this scene can have written it.
    pub(crate) fn fits(&self, scene: &Scene) -> bool {
        let is_number = |bits: &u64| f64::from_bits(*bits).is_finite();
        let panels = self.panels.iter().flatten();
        let mut fit = panels.map(|(time, positions)| {
            is_number(time)
                && positions.len() == scene.nodes.len()
                && positions.iter().flatten().all(is_number)
        });
        fit.all(|fits| fits)
    }
}

impl Output {
    /// Refuses a folder that holds the results of another run, and a scene that
    /// would be replaced by something else.
    pub(crate) fn check(folder: &Path, scene: &Path, force: bool) -> Result<(), Advised> {
        claim(folder, &FILES, force)?;
        let Ok(scene) = scene.canonicalize() else {
            return Ok(());
        };
        // A scene is read before anything is written, and final.ron is replaced
        // by a whole scene: going on from there in place is safe.
        let others = FILES.iter().filter(|name| **name != SCENE);
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

    /// Makes the folder, locks it, and starts the tables.
    pub(crate) fn begin(
        folder: &Path,
        extras: &[Extra],
        intervals: usize,
        force: bool,
    ) -> anyhow::Result<Self> {
        make_folder(folder)?;
        let lock = lock(folder)?;
        // Another run may have ended since the folder was looked at.
        claim(folder, &FILES, force)?;
        if lock.is_some() {
            remove_drafts(folder);
        }
        try_to_write(&folder.join(SCENE)).map_err(Unwritten::from)?;
        let table = |extra, name, header| match extras.contains(&extra) {
            true => TableWriter::create(&folder.join(name), header).map(Some),
            false => Ok(None),
        };
        let trajectory = table(Extra::Csv, TRAJECTORY, TRAJECTORY_HEADER);
        let energy = table(Extra::Energy, ENERGY, ENERGY_HEADER);
        Ok(Self {
            folder: folder.to_owned(),
            _lock: lock,
            trajectory: trajectory.map_err(Unwritten::from)?,
            energy: energy.map_err(Unwritten::from)?,
            wants_account: false,
            panels: extras.contains(&Extra::Svg).then(Vec::new),
            middle: intervals / 2,
            owns_checkpoint: false,
        })
    }

    /// Goes on with the files of a run that was stopped, in a folder that is
    /// locked.
    pub(crate) fn resume(
        folder: &Path,
        lock: Option<File>,
        written: &Written,
    ) -> Result<Self, ContinueError> {
        if lock.is_some() {
            remove_drafts(folder);
        }
        let table = |written: &Option<WrittenTable>, name| match written {
            None => Ok(None),
            Some(table) => table.resume(&folder.join(name)).map(Some),
        };
        let panels = written.panels.as_ref().map(|panels| {
            let vector = |bits: &[u64; 3]| Vector3::from(bits.map(f64::from_bits));
            let panel = |(time, positions): &(u64, Vec<[u64; 3]>)| Panel {
                time: f64::from_bits(*time),
                positions: positions.iter().map(vector).collect(),
            };
            panels.iter().map(panel).collect()
        });
        Ok(Self {
            folder: folder.to_owned(),
            _lock: lock,
            trajectory: table(&written.trajectory, TRAJECTORY)?,
            energy: table(&written.energy, ENERGY)?,
            wants_account: written.wants_account,
            panels,
            middle: written.middle,
            owns_checkpoint: true,
        })
    }

    /// Makes the tables outlive the program; they go on as `.part` files. Says
    /// which ones.
    pub(crate) fn keep_tables(&mut self) -> Result<Vec<&'static str>, Unwritten> {
        let mut kept = Vec::new();
        for (table, name) in [
            (&mut self.trajectory, TRAJECTORY_PART),
            (&mut self.energy, ENERGY_PART),
        ] {
            if let Some(growing) = table.take() {
                *table = Some(growing.keep()?);
                kept.push(name);
            }
        }
        Ok(kept)
    }

    /// Bytes of rows that could not be written so far.
    pub(crate) fn n_unwritten(&self) -> usize {
        let tables = [&self.trajectory, &self.energy].into_iter().flatten();
        tables.map(|table| table.unwritten().len()).sum()
    }

    /// Notes that a checkpoint of this run is in the folder.
    pub(crate) fn checkpoint_written(&mut self) {
        self.owns_checkpoint = true;
    }

    /// Whether this run has left a checkpoint to go on from.
    pub(crate) fn owns_checkpoint(&self) -> bool {
        self.owns_checkpoint
    }

    /// What has been written so far.
    pub(crate) fn written(&self) -> Written {
        let bits = |x: &Vector3<f64>| <[f64; 3]>::from(*x).map(f64::to_bits);
        let panel = |panel: &Panel| {
            let positions = panel.positions.iter().map(bits);
            (panel.time.to_bits(), positions.collect())
        };
        Written {
            trajectory: self.trajectory.as_ref().map(WrittenTable::of),
            energy: self.energy.as_ref().map(WrittenTable::of),
            wants_account: self.wants_account,
            panels: self
                .panels
                .as_ref()
                .map(|panels| panels.iter().map(panel).collect()),
            middle: self.middle,
        }
    }

    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether anybody asked for frames.
    pub(crate) fn wants_frames(&self) -> bool {
        self.trajectory.is_some() || self.panels.is_some() || self.energy.is_some()
    }

    /// Whether a frame was shown whose energies are not yet written.
    pub(crate) fn wants_account(&self) -> bool {
        self.wants_account
    }

    /// The table comes last: if it finds no room, everything else is as if it
    /// had. The table keeps its rows.
    pub(crate) fn frame(&mut self, frame: Frame<'_>) -> Result<(), Unwritten> {
        self.wants_account = self.energy.is_some();
        if let Some(panels) = &mut self.panels
            && (frame.index == 0 || frame.index == self.middle)
        {
            panels.push(Panel {
                time: frame.time,
                positions: frame.nodes.positions.clone(),
            });
        }
        if let Some(trajectory) = &mut self.trajectory {
            trajectory.frame(TrajectoryFrame {
                time: frame.time,
                positions: &frame.nodes.positions,
                velocities: &frame.nodes.velocities,
            })?;
        }
        Ok(())
    }

    pub(crate) fn account(&mut self, account: &Account) -> Result<(), Unwritten> {
        self.wants_account = false;
        let Account {
            time,
            energy,
            ledger,
        } = account;
        if let Some(table) = &mut self.energy {
            table.row(&[
                *time,
                energy.kinetic,
                energy.elastic,
                energy.gravity,
                energy.total(),
                ledger.anchor_work,
                ledger.dashpot_heat,
                ledger.method_gain(energy),
            ])?;
        }
        Ok(())
    }

    /// Completes everything but the report; `last` is the scene as it ended.
    pub(crate) fn finish(
        &mut self,
        last: &Scene,
        time: f64,
    ) -> Result<Vec<&'static str>, Unwritten> {
        let mut written = vec![SCENE, REPORT];
        // The folder may have been removed on the way.
        make_folder(&self.folder)?;
        write_scene(&self.folder.join(SCENE), last)?;
        for (table, name) in [
            (&mut self.trajectory, TRAJECTORY),
            (&mut self.energy, ENERGY),
        ] {
            if let Some(table) = table.take() {
                table.finish()?;
                written.push(name);
            }
        }
        if let Some(mut panels) = self.panels.take() {
            if panels.last().is_none_or(|panel| panel.time < time) {
                panels.push(Panel {
                    time,
                    positions: last.nodes.iter().map(|node| node.position).collect(),
                });
            }
            let picture = filmstrip(last, &panels);
            write_whole(&self.folder.join(FILMSTRIP), picture.as_bytes())?;
            written.push(FILMSTRIP);
        }
        Ok(written)
    }

    pub(crate) fn report(&self, report: &Report) -> Result<(), Unwritten> {
        Ok(write_report(&self.folder.join(REPORT), report)?)
    }

    /// The results are complete: removes what is left of an older run, and the
    /// checkpoint if nothing is left to go on with. What cannot be removed stays.
    pub(crate) fn remove_others(&self, written: &[&str], is_finished: bool) {
        let keeps_checkpoint = self.owns_checkpoint && !is_finished;
        for name in FILES {
            let stays = written.contains(&name) || (name == CHECKPOINT && keeps_checkpoint);
            if !stays {
                let _ = std::fs::remove_file(self.folder.join(name));
            }
        }
    }

    /// Whether the tables that a run would go on with are there.
    pub(crate) fn holds_tables(&self, written: &Written) -> bool {
        let there = |name: &str| self.folder.join(name).exists();
        let tables = [
            (&written.trajectory, TRAJECTORY, TRAJECTORY_PART),
            (&written.energy, ENERGY, ENERGY_PART),
        ];
        let mut tables = tables.into_iter();
        tables.all(|(table, name, part)| table.is_none() || there(part) || there(name))
    }

    /// Writes the final scene and the report as far as there is room, after
    /// something else could not be written. Says which files are there.
    pub(crate) fn save_what_fits(&mut self, last: &Scene, report: &Report) -> Vec<&'static str> {
        // The folder may have been removed on the way.
        let _ = make_folder(&self.folder);
        let mut saved = self.keep_tables().unwrap_or_default();
        if write_scene(&self.folder.join(SCENE), last).is_ok() {
            saved.push(SCENE);
        }
        if self.report(report).is_ok() {
            saved.push(REPORT);
        }
        saved
    }
}
