//! From a scene file to a scene.

use crate::locate::{Place, locate};
use crate::scene_file::{NodeEntry, SceneFile, SimulationEntry, SpringEntry};
use nalgebra::Vector3;
use ron::extensions::Extensions;
use springs_scene::{Method, Node, Scene, Settings, Spring, StepControl};
use std::fmt;
use std::path::Path;

/// Why a scene file gives no scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read.
    #[error("cannot read {file}: {source}")]
    Unreadable {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not text.
    #[error("{file} is not a scene file: byte {offset} is not UTF-8 text")]
    NotText {
        /// The file.
        file: String,
        /// The first byte that is not text.
        offset: usize,
    },
    /// The file is not a sound scene. Displays the first finding.
    #[error("{file}:{}", .findings[0])]
    Wrong {
        /// The file.
        file: String,
        /// Everything that is wrong, in the order of the scene; not empty.
        findings: Vec<Finding>,
    },
}

/// One thing that is wrong in a scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
    /// The field, such as `springs[3].stiffness`; empty for the whole file.
    pub path: String,
    /// What is wrong with it.
    pub message: String,
    /// What to do about it, if that is not plain.
    pub advice: Option<String>,
}

/// "3:14: springs[3].stiffness: must be …"
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.line, self.column)?;
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        f.write_str(&self.message)
    }
}

/// Reads a scene file.
///
/// # Errors
///
/// If the file cannot be read or is not a sound scene.
pub fn read_scene(path: &Path) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    match std::fs::read(path) {
        Ok(bytes) => decode_scene(&file, bytes),
        Err(source) => Err(SceneError::Unreadable { file, source }),
    }
}

/// Reads a scene from the bytes of a scene file; `file` is its name in errors.
///
/// # Errors
///
/// As [`read_scene`], but for reading.
pub fn decode_scene(file: &str, bytes: Vec<u8>) -> Result<Scene, SceneError> {
    let text = String::from_utf8(bytes).map_err(|error| SceneError::NotText {
        file: file.to_owned(),
        offset: error.utf8_error().valid_up_to(),
    })?;
    parse_scene(file, &text)
}

/// Reads a scene from the text of a scene file; `file` is its name in errors.
///
/// A scene is `Scene(version: 1, name, gravity, nodes: [...], springs: [...],
/// simulation: (...))` in RON, all in SI units; the README lists the fields.
///
/// # Errors
///
/// If the text is not a sound scene: the first fault of its syntax, or
/// everything that is wrong with the scene it describes.
pub fn parse_scene(file: &str, text: &str) -> Result<Scene, SceneError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    let wrong = |findings| SceneError::Wrong {
        file: file.to_owned(),
        findings,
    };
    let entries: SceneFile = match options.from_str(text) {
        Ok(entries) => entries,
        Err(error) => return Err(wrong(vec![syntax_finding(&options, text, &error)])),
    };
    if entries.simulation.step.is_some() && entries.simulation.tolerance.is_some() {
        let place = locate(text, springs_scene::Path::Simulation("tolerance"));
        return Err(wrong(vec![Finding {
            line: place.line,
            column: place.column,
            path: "simulation.tolerance".to_owned(),
            message: "a simulation has a step or a tolerance, not both".to_owned(),
            advice: Some("remove one of them".to_owned()),
        }]));
    }
    let scene = scene(entries);
    let problems = scene.problems();
    if problems.is_empty() {
        return Ok(scene);
    }
    let findings = problems.iter().map(|problem| {
        let Place { line, column } = locate(text, problem.path());
        Finding {
            line,
            column,
            path: problem.path().to_string(),
            message: problem.to_string(),
            advice: problem.advice().map(str::to_owned),
        }
    });
    Err(wrong(findings.take(MOST_FINDINGS).collect()))
}

/// More than these help nobody.
const MOST_FINDINGS: usize = 100;

/// Reads once more, keeping track of the path, which the fast way does not.
fn syntax_finding(options: &ron::Options, text: &str, error: &ron::error::SpannedError) -> Finding {
    let path = ron::Deserializer::from_str_with_options(text, options)
        .ok()
        .and_then(|mut deserializer| {
            serde_path_to_error::deserialize::<_, SceneFile>(&mut deserializer).err()
        })
        .map(|error| error.path().to_string())
        .filter(|path| path != ".")
        .unwrap_or_default();
    let position = error.span.start;
    Finding {
        line: position.line,
        column: position.col,
        path,
        message: error.code.to_string(),
        advice: None,
    }
}

fn scene(file: SceneFile) -> Scene {
    let nodes: Vec<Node> = file.nodes.0.into_iter().map(node).collect();
    let springs = file.springs.0.into_iter();
    Scene {
        name: file.name,
        gravity: vector(file.gravity),
        springs: springs.map(|entry| spring(entry, &nodes)).collect(),
        nodes,
        settings: settings(file.simulation),
    }
}

fn vector(entry: crate::scene_file::Tuple<3, crate::scene_file::Real>) -> Vector3<f64> {
    Vector3::from(entry.0.map(|real| real.0))
}

fn node(entry: NodeEntry) -> Node {
    Node {
        position: vector(entry.position),
        velocity: vector(entry.velocity),
        mass: entry.mass.0,
        fixed: entry.fixed,
    }
}

/// A rest length that is left out is the distance of the nodes; where a node
/// does not exist either, validation says so.
fn spring(entry: SpringEntry, nodes: &[Node]) -> Spring {
    let ends = entry.nodes.0.map(|index| index.0);
    let distance = || match ends.map(|node| nodes.get(node)) {
        [Some(a), Some(b)] => (a.position - b.position).norm(),
        _ => 0.0,
    };
    Spring {
        nodes: ends,
        stiffness: entry.stiffness.0,
        rest_length: entry.rest_length.map_or_else(distance, |real| real.0),
        mass: entry.mass.0,
        damping: entry.damping.0,
    }
}

fn settings(entry: SimulationEntry) -> Settings {
    let step = match (entry.step, entry.tolerance) {
        (Some(step), _) => StepControl::Fixed(step.0),
        (None, Some(tolerance)) => StepControl::Tolerance(tolerance.0),
        (None, None) => StepControl::Auto,
    };
    let default = Settings::default();
    Settings {
        method: entry.method.map_or(Method::Auto, |named| named.0),
        tangent: entry.tangent.map(|named| named.0),
        step,
        duration: entry.duration.map_or(default.duration, |real| real.0),
    }
}
