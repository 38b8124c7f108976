//! Motions of a scene file, and their tables in files beside it.

use crate::read::{Findings, read_text};
use crate::scene_file::{MotionEntry, Real, Tuple};
use nalgebra::Vector3;
use springs_scene::{NamedMotion, Path as ScenePath, PrescribedMotion, printable};
use std::fs::File;
use std::path::Path;

/// The motions of a scene file of this name. Adds what is wrong to `findings`.
pub(crate) fn motions(
    entries: Vec<(String, MotionEntry)>,
    file: &str,
    findings: &mut Findings<'_>,
) -> Vec<NamedMotion> {
    let mut motions = Vec::with_capacity(entries.len());
    for (index, (name, entry)) in entries.into_iter().enumerate() {
        let motion = match entry {
            MotionEntry::Sine {
                amplitude,
                frequency,
                phase,
            } => PrescribedMotion::Sine {
                amplitude: vector(amplitude),
                frequency: frequency.0,
                phase: phase.0,
            },
            MotionEntry::Table(points) => {
                let points = points.0.into_iter();
                PrescribedMotion::Table(points.map(|point| (point.0.0, vector(point.1))).collect())
            }
            MotionEntry::Csv(name) => {
                let points = read_table(Path::new(file), &name).unwrap_or_else(|message| {
                    let path = ScenePath::Motion(index, None);
                    let advice = "it needs rows of time, x, y, z with commas between them";
                    findings.push(path, message, Some(advice));
                    vec![(0.0, Vector3::zeros())]
                });
                PrescribedMotion::Table(points.into())
            }
        };
        motions.push(NamedMotion { name, motion });
    }
    motions
}

pub(crate) fn vector(entry: Tuple<3, Real>) -> Vector3<f64> {
    Vector3::from(entry.0.map(|real| real.0))
}

/// Rows of time, x, y, z; the first may be a header. Errors are in words.
fn read_table(scene: &Path, name: &str) -> Result<Vec<(f64, Vector3<f64>)>, String> {
    let path = scene.parent().unwrap_or(Path::new("")).join(name);
    let shown = printable(&path.display().to_string());
    let text = read_text(&shown, File::open(&path)).map_err(|error| error.to_string())?;
    let mut rows = Vec::new();
    for (line, row) in text.lines().enumerate() {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if row.trim().is_empty() {
            continue;
        }
        let numbers: Result<Vec<f64>, _> = cells.iter().map(|cell| cell.parse()).collect();
        match numbers.as_deref() {
            Ok(&[time, x, y, z]) if [time, x, y, z].iter().all(|number| number.is_finite()) => {
                rows.push((time, Vector3::new(x, y, z)));
            }
            Err(_) if line == 0 && cells[0].parse::<f64>().is_err() => {}
            _ => {
                let row = printable(row);
                return Err(format!(
                    "{shown}:{}: `{row}` is no row of four numbers",
                    line + 1
                ));
            }
        }
    }
    Ok(rows)
}
