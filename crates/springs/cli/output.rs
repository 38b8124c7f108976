//! The folder that a run writes into.

use super::{Advised, Unwritten};
use springs::filmstrip::{Panel, filmstrip};
use springs::io::{
    Report, TrajectoryFrame, TrajectoryWriter, WriteError, write_report, write_scene, write_whole,
};
use springs::scene::Scene;
use springs::step::Frame;
use std::path::{Path, PathBuf};

/// What `--write` can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Extra {
    /// trajectory.csv: all nodes at every frame
    Csv,
    /// filmstrip.svg: the first, the middle and the last frame
    Svg,
}

const SCENE: &str = "final.ron";
const REPORT: &str = "report.json";
const TRAJECTORY: &str = "trajectory.csv";
const FILMSTRIP: &str = "filmstrip.svg";

const FILES: [&str; 4] = [SCENE, REPORT, TRAJECTORY, FILMSTRIP];

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
            advice: Some("choose another folder with --out, or add --force".to_owned()),
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
    trajectory: Option<TrajectoryWriter>,
    /// Moments for the filmstrip, and the frame in the middle.
    panels: Option<Vec<Panel>>,
    middle: usize,
}

impl Output {
    /// Refuses a folder that holds the results of another run.
    pub(crate) fn check(folder: &Path, force: bool) -> Result<(), Advised> {
        claim(folder, &FILES, force)
    }

    /// Makes the folder, without older results, and starts the trajectory.
    pub(crate) fn begin(
        folder: &Path,
        extras: &[Extra],
        intervals: usize,
    ) -> Result<Self, Unwritten> {
        let failed = |source| WriteError {
            path: folder.to_owned(),
            source,
        };
        make_folder(folder)?;
        for name in FILES {
            match std::fs::remove_file(folder.join(name)) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(failed(error).into());
                }
                _ => {}
            }
        }
        let trajectory = match extras.contains(&Extra::Csv) {
            true => Some(TrajectoryWriter::create(&folder.join(TRAJECTORY))?),
            false => None,
        };
        Ok(Self {
            folder: folder.to_owned(),
            trajectory,
            panels: extras.contains(&Extra::Svg).then(Vec::new),
            middle: intervals / 2,
        })
    }

    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether anybody asked for frames.
    pub(crate) fn wants_frames(&self) -> bool {
        self.trajectory.is_some() || self.panels.is_some()
    }

    pub(crate) fn frame(&mut self, frame: Frame<'_>) -> Result<(), Unwritten> {
        if let Some(trajectory) = &mut self.trajectory {
            trajectory.write(TrajectoryFrame {
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

    /// Completes everything but the report; `last` is the scene as it ended.
    pub(crate) fn finish(
        &mut self,
        last: &Scene,
        time: f64,
    ) -> Result<Vec<&'static str>, Unwritten> {
        let mut written = vec![SCENE, REPORT];
        write_scene(&self.folder.join(SCENE), last)?;
        if let Some(trajectory) = self.trajectory.take() {
            trajectory.finish()?;
            written.push(TRAJECTORY);
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
