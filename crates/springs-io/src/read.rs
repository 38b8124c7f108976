//! From a scene file to a scene.

use crate::loads::{Groups, add_fields, load};
use crate::locate::{Place, locate, path_in_words};
use crate::motions::{motions, vector};
use crate::output::output;
use crate::scene_file::{NodeEntry, SceneFile, SimulationEntry};
use crate::springs::{Inputs, damp, springs};
use crate::syntax;
use ron::extensions::Extensions;
use springs_scene::{
    Guide, Method, NamedMotion, Node, Path as ScenePath, Problem, Rayleigh, RunOptions, Scene,
    Settings, StepControl, printable,
};
use std::fmt;
use std::io::{self, Read};
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
        source: io::Error,
    },
    /// The file is not text.
    #[error("{file} is not a scene file: byte {offset} is not UTF-8 text")]
    NotText {
        /// The file.
        file: String,
        /// The first byte that is not text.
        offset: usize,
    },
    /// The file is not text: text has no zero bytes.
    #[error("{file} is not a scene file: byte {offset} is zero")]
    HoldsZero {
        /// The file.
        file: String,
        /// The first byte that is zero.
        offset: usize,
    },
    /// The file has no end, or it is longer than any scene.
    #[error("{file} is not a scene file: it is longer than {} GiB", LONGEST >> 30)]
    TooLong {
        /// The file.
        file: String,
    },
    /// The file is not a sound scene. Displays the first finding.
    #[error("{file}:{}", .findings[0])]
    Wrong {
        /// The file.
        file: String,
        /// What is wrong: what fields say together, such as a spring without a stiffness,
        /// then what the scene comes to, in nodes, springs and so on that nothing was
        /// found in before; the first hundred.
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
    /// The line of the file, its number before it, and on a second line a caret
    /// below the column; of long lines only the part around it. Empty
    /// if the line is.
    pub excerpt: String,
}

impl Finding {
    /// A finding at a path in the text of a scene file that reads without
    /// error, or at what encloses the path if the field is left out.
    pub fn at(
        text: &str,
        path: springs_scene::Path,
        message: String,
        advice: Option<&str>,
    ) -> Self {
        let text = without_mark(text);
        Self::in_text(
            text,
            locate(text, path),
            path_in_words(text, path),
            message,
            advice.map(str::to_owned),
        )
    }

    /// A finding at a place in a text without a byte order mark.
    pub(crate) fn in_text(
        text: &str,
        place: Place,
        path: String,
        message: String,
        advice: Option<String>,
    ) -> Self {
        Self {
            line: place.line,
            column: place.column,
            path,
            message,
            advice,
            excerpt: excerpt(text, place),
        }
    }
}

/// What is wrong in a text, as far as it was found: of more than [`MOST_FINDINGS`] the
/// first. Each takes a look through the text.
pub(crate) struct Findings<'a> {
    text: &'a str,
    found: Vec<Finding>,
    /// What they are in, without fields.
    elements: Vec<ScenePath>,
}

/// More than these help nobody.
const MOST_FINDINGS: usize = 100;

impl<'a> Findings<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            text,
            found: Vec::new(),
            elements: Vec::new(),
        }
    }

    /// Adds one, see [`Finding::at`].
    pub(crate) fn push(&mut self, path: ScenePath, message: String, advice: Option<&str>) {
        if self.found.len() < MOST_FINDINGS {
            let finding = Finding::at(self.text, path, message, advice);
            self.found.push(finding);
            self.elements.push(path.element());
        }
    }
}

/// Longer lines are shown in part, with so many characters before the column.
const LONGEST_LINE: usize = 120;
const BEFORE: usize = 80;

/// The line at a place, and a caret below the column; empty if the line is.
///
/// ```text
///   12 |         (nodes: (1, 9), stiffness: 100, mass: 0.1),
///      |                 ^
/// ```
fn excerpt(text: &str, place: Place) -> String {
    let line = text.lines().nth(place.line - 1).unwrap_or("").trim_end();
    if line.is_empty() {
        return String::new();
    }
    let before = place.column - 1;
    let is_long = line.chars().nth(LONGEST_LINE).is_some();
    let first = if is_long {
        before.saturating_sub(BEFORE)
    } else {
        0
    };
    let visible = line.chars().map(|c| if c.is_control() { ' ' } else { c });
    let mut shown: String = visible.skip(first).take(LONGEST_LINE).collect();
    let mut caret = before - first;
    if first > 0 {
        shown.insert(0, '…');
        caret += 1;
    }
    if line.chars().nth(first + LONGEST_LINE).is_some() {
        shown.push('…');
    }
    let number = place.line.to_string();
    let margin = " ".repeat(number.len());
    format!("  {number} | {shown}\n  {margin} | {}^", " ".repeat(caret))
}

/// `3:14: springs[3].stiffness: must be …`
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.line, self.column)?;
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        f.write_str(&self.message)
    }
}

/// Reads a scene file: the scene, and how it says it is run.
///
/// # Errors
///
/// If the file cannot be read or is not a sound scene.
pub fn read_scene(path: &Path) -> Result<(Scene, RunOptions), SceneError> {
    let file = path.display().to_string();
    let text = read_text(&file, std::fs::File::open(path))?;
    parse_scene(&file, &text)
}

/// Reads all of a scene file's text; `file` is its name in errors.
///
/// # Errors
///
/// If it could not be opened, cannot be read, is longer than 16 GiB, holds a zero
/// byte, or is not UTF-8.
pub fn read_text<R: Read>(file: &str, opened: io::Result<R>) -> Result<String, SceneError> {
    let file = || file.to_owned();
    let unreadable = |source| SceneError::Unreadable {
        file: file(),
        source,
    };
    let mut reader = opened.map_err(unreadable)?;
    let mut bytes = Vec::new();
    loop {
        let start = bytes.len();
        if start as u64 > LONGEST {
            return Err(SceneError::TooLong { file: file() });
        }
        let room = bytes.try_reserve(PIECE as usize);
        room.map_err(|_| unreadable(io::ErrorKind::OutOfMemory.into()))?;
        let read = reader.by_ref().take(PIECE).read_to_end(&mut bytes);
        if read.map_err(unreadable)? == 0 {
            break;
        }
        // Devices and pipes may go on for ever.
        if let Some(zero) = bytes[start..].iter().position(|byte| *byte == 0) {
            let offset = start + zero;
            return Err(SceneError::HoldsZero {
                file: file(),
                offset,
            });
        }
    }
    String::from_utf8(bytes).map_err(|error| SceneError::NotText {
        file: file(),
        offset: error.utf8_error().valid_up_to(),
    })
}

/// In bytes: a scene of 100 million nodes has about 10 GB.
const LONGEST: u64 = 1 << 34;

/// Bytes that are read between two looks at them.
const PIECE: u64 = 1 << 20;

/// Reads a scene, and how it is run, from the text of a scene file; `file` is its name
/// in errors.
///
/// A scene is `Scene(version: 1, name, gravity, nodes: [...], springs: [...],
/// simulation: (...))` in RON, all in SI units; the README lists the fields.
///
/// # Errors
///
/// If the text is not a sound scene: the first fault of its syntax, or
/// [what is wrong](SceneError::Wrong) with the scene it describes.
pub fn parse_scene(file: &str, text: &str) -> Result<(Scene, RunOptions), SceneError> {
    let (scene, options, _) = parse_scene_with_inputs(file, text)?;
    Ok((scene, options))
}

/// The same, with how the file gives its springs, which a scene does not keep.
///
/// # Errors
///
/// As [`parse_scene`].
pub fn parse_scene_with_inputs(
    file: &str,
    text: &str,
) -> Result<(Scene, RunOptions, Inputs), SceneError> {
    let text = without_mark(text);
    let syntax = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    let wrong = |findings| SceneError::Wrong {
        file: file.to_owned(),
        findings,
    };
    let entries: SceneFile = match syntax.from_str(text) {
        Ok(entries) => entries,
        Err(error) => return Err(wrong(vec![syntax::finding(&syntax, text, &error)])),
    };
    if entries.simulation.step.is_some() && entries.simulation.tolerance.is_some() {
        return Err(wrong(vec![Finding::at(
            text,
            springs_scene::Path::Simulation("tolerance"),
            "a simulation has a step or a tolerance, not both".to_owned(),
            Some("remove one of them"),
        )]));
    }
    let options = options(&entries.simulation);
    let nodes = entries.nodes.0.iter().enumerate();
    let twice = nodes.filter(|(_, node)| node.slides.is_some() && node.fixed.0.contains(&true));
    let twice: Vec<_> = twice
        .map(|(node, _)| Problem::FixedAndGuided { node })
        .collect();
    let mut findings = Findings::new(text);
    let (scene, law_places, inputs) = scene(entries, file, &mut findings);
    let mut problems = scene.problems();
    problems.retain(|problem| !twice.contains(problem));
    problems.extend(twice);
    problems.extend(options.problems());
    let known = std::mem::take(&mut findings.elements);
    for problem in problems {
        let path = match problem.path() {
            ScenePath::Law(law) => law_places[law],
            path => path,
        };
        if !may_come_of(&known, path, &inputs) {
            findings.push(path, problem.to_string(), problem.advice());
        }
    }
    if findings.found.is_empty() {
        Ok((scene, options, inputs))
    } else {
        Err(wrong(findings.found))
    }
}

/// Whether what is wrong at a path may only come of what was found in the file: there, in the
/// material of the spring, or in a group of nodes.
fn may_come_of(known: &[ScenePath], path: ScenePath, inputs: &Inputs) -> bool {
    let material = |index: usize| {
        let place = inputs
            .springs
            .binary_search_by_key(&index, |input| input.spring);
        Some(ScenePath::Material(
            inputs.springs[place.ok()?].material?,
            None,
        ))
    };
    let source = match path {
        ScenePath::Spring(index, _) => material(index),
        _ => None,
    };
    let names_nodes = matches!(path, ScenePath::Load(..) | ScenePath::Probe(..));
    known.iter().any(|found| {
        *found == path.element()
            || Some(*found) == source
            || (names_nodes && matches!(found, ScenePath::Group(_)))
    })
}

/// Some editors begin a file with a byte order mark.
fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// The scene, where the file has its laws, and how it gives its springs.
fn scene(
    file: SceneFile,
    name: &str,
    findings: &mut Findings<'_>,
) -> (Scene, Vec<ScenePath>, Inputs) {
    let motions = motions(file.motions.0, name, findings);
    let nodes = file.nodes.0.into_iter().enumerate();
    let nodes = nodes.map(|(index, entry)| node(index, entry, &motions, findings));
    let nodes: Vec<Node> = nodes.collect();
    let resolved = springs(file.springs.0, &file.materials.0, &nodes, findings);
    let groups = Groups::new(file.groups.0, nodes.len(), findings);
    let loads = file.loads.0.into_iter().enumerate();
    let loads = loads.map(|(index, entry)| load(index, entry, &groups, name, findings));
    let loads = loads.collect();
    let output = output(file.output, &groups, findings);
    let mut scene = Scene {
        motions,
        name: file.name,
        gravity: vector(file.gravity),
        springs: resolved.springs,
        laws: resolved.laws,
        nodes,
        loads,
        drag: file.drag.0,
        damping: Rayleigh {
            mass: file.damping.mass.0,
            stiffness: file.damping.stiffness.0,
        },
        settings: settings(file.simulation),
        output,
    };
    damp(&resolved.inputs.damping_ratios, &mut scene, findings);
    add_fields(file.fields.0, &mut scene, name, findings);
    let inputs = Inputs {
        groups: groups.into_named(),
        ..resolved.inputs
    };
    (scene, resolved.law_places, inputs)
}

/// The index of what has a name; one that nothing has is added to `findings`.
pub(crate) fn find_named<'a>(
    what: &str,
    name: &str,
    known: impl Iterator<Item = &'a str> + Clone,
    path: ScenePath,
    findings: &mut Findings<'_>,
) -> Option<usize> {
    let found = known.clone().position(|known| known == name);
    if found.is_none() {
        findings.push(path, no_such(what, name, known), None);
    }
    found
}

/// "there is no material `a`; known are b, c".
fn no_such<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<String> = known.map(printable).collect();
    let known = if known.is_empty() {
        "the scene has none".to_owned()
    } else {
        format!("known are {}", known.join(", "))
    };
    format!("there is no {what} `{}`; {known}", printable(name))
}

fn node(
    index: usize,
    entry: NodeEntry,
    motions: &[NamedMotion],
    findings: &mut Findings<'_>,
) -> Node {
    let held = entry.fixed.0;
    let motion = entry.motion.and_then(|name| {
        let known = motions.iter().map(|motion| motion.name.as_str());
        let path = ScenePath::Node(index, Some("motion"));
        find_named("motion", &name, known, path, findings)
    });
    let along = entry
        .slides
        .map(|direction| Guide::Along(vector(direction)));
    Node {
        position: vector(entry.position),
        velocity: vector(entry.velocity),
        mass: entry.mass.0,
        fixed: held == [true; 3],
        guide: match held {
            [true, true, true] | [false, false, false] => along,
            axes => Some(Guide::Held(axes)),
        },
        motion,
        drag: entry.drag.map(|real| real.0),
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
        start: entry.start.map_or(default.start, |named| named.0),
    }
}

fn options(entry: &SimulationEntry) -> RunOptions {
    let mut options = RunOptions::default();
    if let Some(named) = &entry.linear_tolerance {
        options.linear_tolerance = named.0;
    }
    options.sleep = entry.sleep.map(|real| real.0);
    options.substeps = entry.substeps;
    options
}
