//! Motions in scene files, read and written, and their tables in files beside these.

use crate::csv_rows::read_rows;
use crate::read::Findings;
use crate::scene_file::{List, Real, Tuple};
use crate::write::{number, tuple};
use nalgebra::Vector3;
use serde::Deserialize;
use springs_scene::{NamedMotion, Path as ScenePath, PrescribedMotion};

/// `(time, (x, y, z))`.
#[derive(Deserialize)]
pub(crate) struct TimedPoint(pub(crate) Real, pub(crate) Tuple<3, Real>);

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Motion")]
pub(crate) enum MotionEntry {
    Sine {
        amplitude: Tuple<3, Real>,
        frequency: Real,
        #[serde(default)]
        phase: Real,
    },
    Table(List<TimedPoint>),
    /// Rows of time, x, y, z in a file beside the scene.
    Csv(String),
}

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
                let rows = read_rows(file, &name).unwrap_or_else(|message| {
                    let path = ScenePath::Motion(index, None);
                    let advice = "it needs rows of time, x, y, z with commas between them";
                    findings.push(path, message, Some(advice));
                    vec![[0.0; 4]]
                });
                let points = rows.into_iter();
                let points = points.map(|[time, x, y, z]| (time, Vector3::new(x, y, z)));
                PrescribedMotion::Table(points.collect())
            }
        };
        motions.push(NamedMotion { name, motion });
    }
    motions
}

pub(crate) fn vector(entry: Tuple<3, Real>) -> Vector3<f64> {
    Vector3::from(entry.0.map(|real| real.0))
}

/// As it stands in a scene file.
pub(crate) fn motion_text(motion: &PrescribedMotion) -> String {
    match motion {
        PrescribedMotion::Sine {
            amplitude,
            frequency,
            phase,
        } => {
            let (frequency, phase) = (number(*frequency), number(*phase));
            let amplitude = tuple(amplitude);
            format!("Sine(amplitude: {amplitude}, frequency: {frequency}, phase: {phase})")
        }
        PrescribedMotion::Table(points) => {
            let points = points.iter();
            let points = points.map(|(time, at)| format!("({}, {})", number(*time), tuple(at)));
            format!("Table([{}])", points.collect::<Vec<_>>().join(", "))
        }
    }
}
