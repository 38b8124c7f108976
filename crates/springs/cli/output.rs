//! The folder that a run writes into.

use super::{Advised, Unwritten};
use serde::{Deserialize, Serialize};
use springs::filmstrip::{Panel, filmstrip};
use springs::io::{
    Beginning, ContinueError, Report, TRAJECTORY_HEADER, TableWriter, TrajectoryFrame, WriteError,
    write_report, write_scene, write_whole,
};
use springs::scene::{Scene, Vector3};
use springs::step::{Account, Frame};
use std::path::{Path, PathBuf};

/// What `--write` can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub(crate) enum Extra {
    /// trajectory.csv: all nodes at every frame
    Csv,
    /// filmstrip.svg: the first, the middle and the last frame
    Svg,
    /// energy.csv: where the energy is and went, at the first step from each frame on
    Energy,
}

const SCENE: &str = "final.ron";
const REPORT: &str = "report.json";
const TRAJECTORY: &str = "trajectory.csv";
const ENERGY: &str = "energy.csv";
const FILMSTRIP: &str = "filmstrip.svg";
/// What a stopped run goes on from.
pub(crate) const CHECKPOINT: &str = "checkpoint.bin";

const FILES: [&str; 8] = [
    SCENE,
    REPORT,
    TRAJECTORY,
    "trajectory.csv.part",
    ENERGY,
    "energy.csv.part",
    FILMSTRIP,
    CHECKPOINT,
];

const ENERGY_HEADER: &str =
    "time,kinetic,elastic,gravity,total,anchor_work,dashpot_heat,method_gain";

/// Refuses a folder in which one of the files exists already.
pub(crate) fn claim(folder: &Path, files: &[&str], force: bool) -> Result<(), Advised> {
    if folder.exists() && !folder.is_dir() {
        return Err(Advised {
            message: format!("{} is in the way of the output folder", folder.display()),
            advice: Some("choose another folder with --out".to_owned()),
        });
    }
    match files.iter().find(|name| folder.join(name).exists()) {
        Some(name) if !force => Err(Advised {
            message: format!("{} holds the {name} of another run", folder.display()),
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

/// Makes the folder if it is not there.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Unwritten> {
    Ok(
        std::fs::create_dir_all(folder).map_err(|source| WriteError {
            path: folder.to_owned(),
            source,
        })?,
    )
}

/// The files of one run.
pub(crate) struct Output {
    folder: PathBuf,
    trajectory: Option<TableWriter>,
    energy: Option<TableWriter>,
    /// A frame was shown since the last account.
    wants_account: bool,
    /// Moments for the filmstrip, and the frame in the middle.
    panels: Option<Vec<Panel>>,
    middle: usize,
}

/// What has been written so far, to go on from.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Written {
    /// Lengths and check sums.
    trajectory: Option<(u64, u32)>,
    energy: Option<(u64, u32)>,
    wants_account: bool,
    /// Times and positions, bit by bit.
    panels: Option<Vec<(u64, Vec<[u64; 3]>)>>,
    middle: usize,
}

impl Output {
    /// Refuses a folder that holds the results of another run.
    pub(crate) fn check(folder: &Path, force: bool) -> Result<(), Advised> {
        claim(folder, &FILES, force)
    }

    /// Makes the folder, without older results, and starts the tables; lasting
    /// ones outlive a program that is killed.
    pub(crate) fn begin(
        folder: &Path,
        extras: &[Extra],
        intervals: usize,
        lasting: bool,
    ) -> Result<Self, Unwritten> {
        make_folder(folder)?;
        for name in FILES {
            match std::fs::remove_file(folder.join(name)) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    let path = folder.to_owned();
                    return Err(WriteError { path, source }.into());
                }
                _ => {}
            }
        }
        let table = |extra, name, header| match (extras.contains(&extra), lasting) {
            (false, _) => Ok(None),
            (true, false) => TableWriter::create(&folder.join(name), header).map(Some),
            (true, true) => TableWriter::create_lasting(&folder.join(name), header).map(Some),
        };
        Ok(Self {
            folder: folder.to_owned(),
            trajectory: table(Extra::Csv, TRAJECTORY, TRAJECTORY_HEADER)?,
            energy: table(Extra::Energy, ENERGY, ENERGY_HEADER)?,
            wants_account: false,
            panels: extras.contains(&Extra::Svg).then(Vec::new),
            middle: intervals / 2,
        })
    }

    /// Goes on with the files of a run that was stopped.
    pub(crate) fn resume(folder: &Path, written: &Written) -> Result<Self, ContinueError> {
        let table = |beginning: Option<(u64, u32)>, name| match beginning {
            None => Ok(None),
            Some((bytes, sum)) => {
                TableWriter::resume(&folder.join(name), Beginning { bytes, sum }).map(Some)
            }
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
            trajectory: table(written.trajectory, TRAJECTORY)?,
            energy: table(written.energy, ENERGY)?,
            wants_account: written.wants_account,
            panels,
            middle: written.middle,
        })
    }

    /// What has been written so far.
    pub(crate) fn written(&self) -> Written {
        let beginning = |table: &TableWriter| {
            let Beginning { bytes, sum } = table.beginning();
            (bytes, sum)
        };
        let bits = |x: &Vector3<f64>| <[f64; 3]>::from(*x).map(f64::to_bits);
        let panel = |panel: &Panel| {
            let positions = panel.positions.iter().map(bits);
            (panel.time.to_bits(), positions.collect())
        };
        Written {
            trajectory: self.trajectory.as_ref().map(beginning),
            energy: self.energy.as_ref().map(beginning),
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

    pub(crate) fn frame(&mut self, frame: Frame<'_>) -> Result<(), Unwritten> {
        self.wants_account = self.energy.is_some();
        if let Some(trajectory) = &mut self.trajectory {
            trajectory.frame(TrajectoryFrame {
                time: frame.time,
                positions: &frame.nodes.positions,
                velocities: &frame.nodes.velocities,
            })?;
        }
        if let Some(panels) = &mut self.panels
            && (frame.index == 0 || frame.index == self.middle)
        {
            panels.push(Panel {
                time: frame.time,
                positions: frame.nodes.positions.clone(),
            });
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
}
