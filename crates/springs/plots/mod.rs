//! `springs plot`: pictures of the tables that a run left.
//!
//! A table is one row of [`PLOTS`].

mod chart;
mod pictures;

use springs_io::{TableError, WriteError, write_whole};
use springs_scene::printable;
use std::path::{Path, PathBuf};

/// A table that can be drawn.
#[derive(Clone, Copy)]
pub struct Plot {
    /// The table.
    pub table: &'static str,
    /// The picture.
    pub picture: &'static str,
    /// What it shows, in a few words.
    pub about: &'static str,
    charts: fn(&Path) -> Result<Vec<chart::Chart>, TableError>,
}

/// A row for each table.
pub static PLOTS: &[Plot] = &[
    Plot {
        table: "energy.csv",
        picture: "energy.svg",
        about: "energies and where they went, over time",
        charts: pictures::energies,
    },
    Plot {
        table: "steps.csv",
        picture: "steps.svg",
        about: "step sizes, estimated errors and iterations, over time",
        charts: pictures::steps,
    },
    Plot {
        table: "peaks.csv",
        picture: "peaks.svg",
        about: "the largest and least tension of every spring",
        charts: pictures::peaks,
    },
    Plot {
        table: "probes.csv",
        picture: "probes.svg",
        about: "what the probes of the scene tell, over time",
        charts: pictures::probes,
    },
];

/// Pictures of a run cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// No table is there.
    #[error("the folder `{}` holds no table to draw", folder.display())]
    Nothing {
        /// The folder.
        folder: PathBuf,
    },
    /// A table is not as a run writes it.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A picture cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Draws all tables in the folder of a run, and returns the names of the pictures.
///
/// # Errors
///
/// If no table is there, or one cannot be read, or a picture cannot be written.
pub fn plot(folder: &Path) -> Result<Vec<&'static str>, PlotError> {
    let name = name_of_run(folder);
    let mut pictures = Vec::new();
    for plot in PLOTS {
        let charts = match (plot.charts)(&folder.join(plot.table)) {
            Ok(charts) => charts,
            Err(error) if error.is_missing() => continue,
            Err(error) => return Err(error.into()),
        };
        let title = match name.as_str() {
            "" => plot.about.to_owned(),
            name => format!("{name}: {}", plot.about),
        };
        let picture = chart::draw(&title, &charts);
        write_whole(&folder.join(plot.picture), picture.as_bytes())?;
        pictures.push(plot.picture);
    }
    if pictures.is_empty() {
        let folder = folder.to_owned();
        return Err(PlotError::Nothing { folder });
    }
    Ok(pictures)
}

/// The name of the scene, if the report tells it.
fn name_of_run(folder: &Path) -> String {
    let report = std::fs::read_to_string(folder.join("report.json")).ok();
    let report = report.and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
    let name = report.and_then(|report| Some(report["scene"].as_str()?.to_owned()));
    printable(&name.unwrap_or_default())
}
