//! What statics write: `path.csv`, `modes.csv`, `shapes.csv` and their reports.

use crate::atomic::{WriteError, write_whole};
use nalgebra::Vector3;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// The file of [`write_path`].
pub const PATH: &str = "path.csv";
/// The files of [`write_modes`].
pub const MODES: &str = "modes.csv";
/// The second of them.
pub const SHAPES: &str = "shapes.csv";

/// What looking for an equilibrium came to, field by field as in `report.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SettleReport {
    /// Version of the program.
    pub springs_version: String,
    /// Name of the scene.
    pub scene: String,
    /// `stable`, `unstable`, `mechanism`, or `failed`.
    pub status: String,
    /// Nodes of the scene.
    pub nodes: usize,
    /// Springs of the scene.
    pub springs: usize,
    /// The largest component of a force left on a node that can move, in N.
    pub residual: Option<f64>,
    /// The largest tension or load, in N.
    pub largest_force: Option<f64>,
    /// Negative pivots of the stiffness.
    pub negative_pivots: Option<usize>,
    /// Those that count as zero.
    pub zero_pivots: Option<usize>,
    /// The nodes that move most in motions that nothing resists.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub loose_nodes: Vec<usize>,
    /// Newton iterations.
    pub iterations: Option<usize>,
    /// The load path, if one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathReport>,
    /// Run time from reading the scene on, in s.
    pub seconds: f64,
    /// Why no equilibrium was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<NotFound>,
}

/// Why no equilibrium was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NotFound {
    /// In a sentence.
    pub reason: String,
}

/// A load path in brief.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PathReport {
    /// `whole load`, `most points` or `lost`.
    pub end: String,
    /// Its equilibria, limit points among them.
    pub points: usize,
    /// At the end.
    pub load_factor: f64,
    /// At each limit point.
    pub limit_load_factors: Vec<f64>,
}

/// What looking for modes came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModesReport {
    /// Of the equilibrium that they are about.
    #[serde(flatten)]
    pub equilibrium: SettleReport,
    /// Modes that were written.
    pub modes: usize,
    /// Modes that there are.
    pub all_modes: usize,
    /// Modes that grow.
    pub negative_modes: usize,
    /// Modes that nothing resists.
    pub zero_modes: usize,
}

/// A row of `path.csv`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRow {
    /// What loads are multiplied with.
    pub load_factor: f64,
    /// Along the loads, in m.
    pub displacement: f64,
    /// Of the stiffness.
    pub negative_pivots: usize,
    /// Whether the load factor has a maximum or minimum here.
    pub is_limit: bool,
}

/// Writes `path.csv` into a folder.
///
/// # Errors
///
/// If it cannot be written.
pub fn write_path(folder: &Path, rows: &[PathRow]) -> Result<(), WriteError> {
    let mut text = "load_factor,displacement,negative_pivots,limit\n".to_owned();
    for row in rows {
        let (factor, displacement) = (row.load_factor, row.displacement);
        let (negative, limit) = (row.negative_pivots, u8::from(row.is_limit));
        writeln!(text, "{factor:?},{displacement:?},{negative},{limit}")
            .expect("writing to memory");
    }
    write_whole(&folder.join(PATH), text.as_bytes())
}

/// Writes `modes.csv`, frequencies in Hz by mode, and `shapes.csv`, where every node is and
/// how far it goes in each mode, into a folder. Modes are counted from 1.
///
/// # Errors
///
/// If one cannot be written.
pub fn write_modes(
    folder: &Path,
    frequencies: &[f64],
    positions: &[Vector3<f64>],
    shapes: &[Vec<Vector3<f64>>],
) -> Result<(), WriteError> {
    let mut text = "mode,frequency\n".to_owned();
    for (mode, frequency) in (1..).zip(frequencies) {
        writeln!(text, "{mode},{frequency:?}").expect("writing to memory");
    }
    write_whole(&folder.join(MODES), text.as_bytes())?;
    let mut text = "mode,node,x,y,z,ux,uy,uz\n".to_owned();
    for (mode, shape) in (1..).zip(shapes) {
        for (node, (x, u)) in positions.iter().zip(shape).enumerate() {
            writeln!(
                text,
                "{mode},{node},{:?},{:?},{:?},{:?},{:?},{:?}",
                x.x, x.y, x.z, u.x, u.y, u.z
            )
            .expect("writing to memory");
        }
    }
    write_whole(&folder.join(SHAPES), text.as_bytes())
}
