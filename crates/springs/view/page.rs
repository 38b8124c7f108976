//! The page itself: its parts and the data in them.

use super::FILE;
use super::contents::{Arrays, Shows, Survey, pack_springs};
use super::marks::{Changes, ShownLoad, loads};
use super::quantized::base64;
use crate::filmstrip::{axes, up_of};
use serde::Serialize;
use springs_io::{
    ENERGIES, ENERGY_COLUMNS, FrameEnergies, FrameSize, Npz, NpzError, SPRINGS, TRAJECTORY, Table,
    TableError, WriteError, open_npz, read_energies, read_tables, write_whole,
};
use springs_scene::{Guide, Node, Scene};
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

const HTML: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
/// In the order in which they use each other.
const SCRIPTS: [&str; 6] = [
    include_str!("page/decode.js"),
    include_str!("page/camera.js"),
    include_str!("page/loads.js"),
    include_str!("page/picture.js"),
    include_str!("page/plot.js"),
    include_str!("page/main.js"),
];

/// Bytes a spring that a page is kept below; more than 10,000 springs may have more than
/// 8 MB.
const BYTES_A_SPRING: usize = 800;
const FEW_SPRINGS: usize = 10_000;
/// Bytes for energies, times, styles and scripts.
const ROOM_FOR_OTHERS: usize = 300_000;

/// What frames are made of where there is no [`Npz`].
static TABLES: [&Table; 2] = [&TRAJECTORY, &SPRINGS];

/// A page cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The folder has no frames.
    #[error("{} has neither {} nor {} with {} to show", folder.display(), Npz::FILE, TABLES[0].file, TABLES[1].file)]
    NoFrames {
        /// The folder.
        folder: PathBuf,
    },
    /// The frames are those of another scene.
    #[error("{} is not of this scene: it has other numbers of nodes or springs", path.display())]
    OtherScene {
        /// The file of frames.
        path: PathBuf,
    },
    /// The file of frames is no such file.
    #[error(transparent)]
    Frames(#[from] NpzError),
    /// The tables are no tables of this scene.
    #[error(transparent)]
    Tables(#[from] TableError),
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The page cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Writes the page of a run of a scene from the output `npz` in a folder, or from `csv`
/// and `springs`, and from `energy` if that is there. Returns the page's file.
///
/// # Errors
///
/// If these are not there or not of this scene, or if the page cannot be written.
pub fn write_page(folder: &Path, scene: &Scene) -> Result<PathBuf, ViewError> {
    let path = folder.join(FILE);
    write_whole(&path, page_of(folder, scene)?.as_bytes())?;
    Ok(path)
}

/// What [`write_page`] writes.
///
/// # Errors
///
/// If it cannot be made.
pub fn page_of(folder: &Path, scene: &Scene) -> Result<String, ViewError> {
    let size = FrameSize::of(scene);
    let [path, trajectory] = [Npz::FILE, TRAJECTORY.file].map(|file| folder.join(file));
    let (path, frames) = if path.exists() {
        let frames = open_npz(&path)?;
        (path, frames)
    } else if TABLES.iter().all(|table| folder.join(table.file).exists()) {
        (trajectory, read_tables(folder, size)?)
    } else {
        let folder = folder.to_owned();
        return Err(ViewError::NoFrames { folder });
    };
    if frames.size() != size {
        return Err(ViewError::OtherScene { path });
    }
    let energies = energies_of(&folder.join(ENERGIES.file))?;
    let read = |source| ViewError::Read {
        path: path.clone(),
        source,
    };
    let mut shows = Shows::new(frames, scene);
    let mut survey = Survey::of(&mut shows).map_err(read)?;
    let points = shows.some_positions().map_err(read)?;
    let [_, _, toward] = axes(&scene.gravity, || points.iter());
    let springs = pack_springs(&scene.springs);
    let largest = BYTES_A_SPRING * size.n_springs.max(FEW_SPRINGS);
    // Four letters for three bytes.
    let room = largest / 4 * 3 - ROOM_FOR_OTHERS - springs.len();
    let arrays = survey.pack(&mut shows, room).map_err(read)?;
    let changes = Changes::of(scene, &mut shows, &survey.kept).map_err(read)?;
    let header = Header {
        name: &scene.name,
        nodes: size.n_nodes,
        springs: size.n_springs,
        stride: survey.stride,
        times: &survey.times,
        up: up_of(&scene.gravity).into(),
        toward: toward.into(),
        supports: supports(&scene.nodes),
        loads: loads(scene),
        energies,
        arrays: &arrays,
    };
    Ok(page(&header, [&springs, &changes.pack()]))
}

/// What the page says in words and few numbers, in SI units.
#[derive(Serialize)]
struct Header<'a> {
    name: &'a str,
    nodes: usize,
    springs: usize,
    /// Only every so many-th frame is shown, and the last one.
    stride: usize,
    times: &'a [f64],
    /// Against gravity.
    up: [f64; 3],
    /// Toward the viewer at the start.
    toward: [f64; 3],
    /// Nodes that are held: index and how.
    supports: Vec<(usize, Support)>,
    /// `None` where there are too many to show.
    loads: Option<Vec<ShownLoad>>,
    energies: Option<Energies>,
    arrays: &'a Arrays,
}

#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum Support {
    /// In place, or on its way.
    Fixed,
    /// In part.
    Guided,
}

fn supports(nodes: &[Node]) -> Vec<(usize, Support)> {
    let nodes = nodes.iter().enumerate();
    let held = nodes.filter_map(|(index, node)| match node.guide {
        _ if node.fixed => Some((index, Support::Fixed)),
        Some(Guide::Held(_) | Guide::Along(_)) => Some((index, Support::Guided)),
        None => None,
    });
    held.collect()
}

/// Rows of energies that a page has: more than its plots have pixels.
const MOST_ENERGIES: usize = 1000;

/// The columns of `energy.csv` after the time, in J; of long tables every so many-th row, and
/// the last one.
#[derive(Serialize)]
struct Energies {
    times: Vec<f64>,
    names: [&'static str; ENERGY_COLUMNS.len()],
    labels: [&'static str; ENERGY_COLUMNS.len()],
    /// Whether they add up since the start.
    flows: [bool; ENERGY_COLUMNS.len()],
    columns: [Vec<f64>; ENERGY_COLUMNS.len()],
}

fn energies_of(path: &Path) -> Result<Option<Energies>, TableError> {
    let rows = match read_energies(path) {
        Err(error) if error.is_missing() => return Ok(None),
        rows => rows?,
    };
    let stride = rows.len().div_ceil(MOST_ENERGIES).max(1);
    let last = rows.len().saturating_sub(1);
    let shown = (0..rows.len()).filter(|index| index % stride == 0 || *index == last);
    let shown: Vec<&FrameEnergies> = shown.map(|index| &rows[index]).collect();
    Ok(Some(Energies {
        times: shown.iter().map(|row| row.time).collect(),
        names: ENERGY_COLUMNS.map(|column| column.column),
        labels: ENERGY_COLUMNS.map(|column| column.label),
        flows: ENERGY_COLUMNS.map(|column| column.is_flow),
        columns: std::array::from_fn(|index| {
            shown.iter().map(|row| row.numbers()[index]).collect()
        }),
    }))
}

fn page(header: &Header<'_>, [springs, changes]: [&[u8]; 2]) -> String {
    let mut data = String::new();
    let json = serde_json::to_string(header).expect("finite numbers and texts");
    // No text may end the element.
    let json = json.replace('<', "\\u003c");
    let _ = writeln!(
        data,
        "<script type=\"application/json\" id=\"run\">{json}</script>"
    );
    let arrays = header.arrays;
    let packed = [&arrays.position, &arrays.speed, &arrays.tension];
    let [position, speed, tension] = packed.map(|array| Some(&array.packed.bytes[..]));
    let strain = arrays
        .strain
        .as_ref()
        .map(|strain| &strain.packed.bytes[..]);
    let parts = [
        ("position", position),
        ("speed", speed),
        ("tension", tension),
        ("strain", strain),
        ("slack", Some(&arrays.slack[..])),
        ("springs", Some(springs)),
        ("changes", Some(changes)),
    ];
    for (name, bytes) in parts {
        if let Some(bytes) = bytes {
            let text = base64(bytes);
            let kind = "application/octet-stream";
            let _ = writeln!(
                data,
                "<script type=\"{kind}\" id=\"{name}\">{text}</script>"
            );
        }
    }
    let name = match header.name {
        "" => "springs",
        name => name,
    };
    let title = name.replace('&', "&amp;").replace('<', "&lt;");
    let (head, scripts) = HTML.split_once("{{data}}").expect("a place for the data");
    // What a scene is called is not looked through for places.
    let head = head
        .replace("{{style}}", STYLE)
        .replace("{{title}}", &title);
    [head, data, scripts.replace("{{script}}", &SCRIPTS.concat())].concat()
}
