//! Files for other programs, read after their formats and not by our own code, hold the
//! numbers of the tables.

mod common;

use common::tangle;
use springs::io::write_scene;
use springs::scene::{Method, Node, RunOptions, StepControl, Vector3};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const N_FRAMES: usize = 8;
const N_NODES: usize = 12;

/// The outputs of a run.
struct Run {
    folder: TempDir,
    /// Rows of `trajectory.csv`: time, node, position, velocity.
    nodes: Vec<Vec<f64>>,
    /// Rows of `springs.csv`: time, spring, length, strain, tension.
    springs: Vec<Vec<f64>>,
    spring_nodes: Vec<[usize; 2]>,
    start: Vec<[f64; 3]>,
}

impl Run {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut scene = tangle(N_NODES - 1, 5);
        scene.settings.method = Method::LinearlyImplicitEuler;
        scene.settings.step = StepControl::Fixed(2e-3);
        scene.settings.duration = 0.2;
        scene.springs[2].rest_length = 0.0;
        // No spring joins it.
        scene.nodes.push(Node {
            mass: 1.0,
            ..Node::at(Vector3::new(1.0, 2.0, 3.0))
        });
        let file = folder.path().join("scene.ron");
        write_scene(&file, &scene, &RunOptions::default()).unwrap();
        let status = Command::new(env!("CARGO_BIN_EXE_springs"))
            .current_dir(folder.path())
            .args(["run", "scene.ron", "--out", ".", "--quiet", "--frames"])
            .args([
                &(N_FRAMES - 1).to_string(),
                "--write",
                "csv,springs,npz,vtu,pc2",
            ])
            .status();
        assert!(status.unwrap().success());
        Self {
            nodes: table(&folder.path().join("trajectory.csv"), 8),
            springs: table(&folder.path().join("springs.csv"), 5),
            spring_nodes: scene.springs.iter().map(|spring| spring.nodes).collect(),
            start: scene
                .nodes
                .iter()
                .map(|node| node.position.into())
                .collect(),
            folder,
        }
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.folder.path().join(name)).unwrap()
    }

    /// A column of nodes or springs at all frames, or at one.
    fn column(rows: &[Vec<f64>], columns: std::ops::Range<usize>) -> Vec<f64> {
        let parts = rows.iter().flat_map(|row| row[columns.clone()].to_vec());
        parts.collect()
    }
}

/// The first columns of a table; what is not there is no number.
fn table(path: &Path, n_columns: usize) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().skip(1);
    let cell = |text: &str| match text {
        "" => f64::NAN,
        text => text.parse().unwrap(),
    };
    let row = |line: &str| {
        let numbers = line.split(',').take(n_columns);
        numbers.map(cell).collect()
    };
    rows.map(row).collect()
}

fn number(bytes: &[u8], start: usize, n_bytes: usize) -> usize {
    let bytes = bytes[start..start + n_bytes].iter().rev();
    bytes.fold(0, |number, &byte| number << 8 | usize::from(byte))
}

fn reals(bytes: &[u8]) -> Vec<f64> {
    let words = bytes.chunks(8);
    let words = words.map(|word| f64::from_le_bytes(word.try_into().unwrap()));
    words.collect()
}

/// Stored entries of an archive, by its local headers.
fn unzip(mut bytes: &[u8]) -> BTreeMap<String, &[u8]> {
    let mut entries = BTreeMap::new();
    while bytes.starts_with(b"PK\x03\x04") {
        assert_eq!(number(bytes, 8, 2), 0, "stored");
        assert_eq!((number(bytes, 10, 2), number(bytes, 12, 2)), (0, 0x21));
        let (name, extra) = (number(bytes, 26, 2), number(bytes, 28, 2));
        assert_eq!(number(bytes, 30 + name, 4), 1 | 16 << 16, "ZIP64");
        let start = 30 + name + extra;
        let size = number(bytes, 30 + name + 4, 8);
        let contents = &bytes[start..start + size];
        assert_eq!(number(bytes, 14, 4), crc(contents) as usize);
        let name = String::from_utf8(bytes[30..30 + name].to_vec()).unwrap();
        entries.insert(name, contents);
        bytes = &bytes[start + size..];
    }
    assert!(bytes.starts_with(b"PK\x01\x02"));
    entries
}

/// CRC-32, bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    let bit = |sum: u32, _| (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg());
    !bytes.iter().fold(u32::MAX, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), bit)
    })
}

/// What an array's file says of it, and its numbers.
fn array(bytes: &[u8]) -> (&str, &[u8]) {
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let start = 10 + number(bytes, 8, 2);
    assert_eq!(start % 64, 0);
    let header = std::str::from_utf8(&bytes[10..start]).unwrap();
    assert!(header.ends_with('\n'));
    (header.trim_end(), &bytes[start..])
}

#[test]
fn arrays_hold_what_the_tables_hold() {
    let run = Run::new();
    let bytes = run.read("trajectory.npz");
    let entries = unzip(&bytes);
    let (f, n, k) = (N_FRAMES, N_NODES, run.spring_nodes.len());
    let firsts: Vec<_> = run.nodes.iter().step_by(n).cloned().collect();
    let arrays = [
        ("time", format!("({f},)"), Run::column(&firsts, 0..1)),
        (
            "position",
            format!("({f}, {n}, 3)"),
            Run::column(&run.nodes, 2..5),
        ),
        (
            "velocity",
            format!("({f}, {n}, 3)"),
            Run::column(&run.nodes, 5..8),
        ),
        (
            "length",
            format!("({f}, {k})"),
            Run::column(&run.springs, 2..3),
        ),
        (
            "tension",
            format!("({f}, {k})"),
            Run::column(&run.springs, 4..5),
        ),
    ];
    assert_eq!(entries.len(), arrays.len() + 1);
    for (name, shape, numbers) in arrays {
        let (header, bytes) = array(entries[&format!("{name}.npy")]);
        let expected = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
        assert_eq!(header, expected);
        assert_eq!(reals(bytes), numbers, "{name}");
    }
    let (header, bytes) = array(entries["springs.npy"]);
    let expected = format!("{{'descr': '<i8', 'fortran_order': False, 'shape': ({k}, 2), }}");
    assert_eq!(header, expected);
    let nodes = bytes.chunks(8).map(|word| number(word, 0, 8));
    assert!(nodes.eq(run.spring_nodes.iter().flatten().copied()));
}

/// The text before `name`'s value in quotes is cut off, and what is after it.
fn attribute<'a>(text: &'a str, name: &str) -> &'a str {
    let (_, after) = text.split_once(&format!("{name}=\"")).unwrap();
    after.split_once('"').unwrap().0
}

/// The array of this name in a file with appended raw data, in bytes.
fn appended<'a>(file: &'a [u8], name: &str) -> (&'a str, &'a [u8]) {
    let begin = b"<AppendedData encoding=\"raw\">\n_";
    let place = file.windows(begin.len()).position(|part| part == begin);
    let start = place.unwrap() + begin.len();
    let text = std::str::from_utf8(&file[..start]).unwrap();
    assert_eq!(attribute(text, "byte_order"), "LittleEndian");
    assert_eq!(attribute(text, "header_type"), "UInt64");
    let mut elements = text.split("<DataArray ").skip(1);
    let element = elements.find(|element| attribute(element, "Name") == name);
    let element = element.unwrap();
    let start = start + attribute(element, "offset").parse::<usize>().unwrap();
    let bytes = &file[start + 8..][..number(file, start, 8)];
    (attribute(element, "type"), bytes)
}

#[test]
fn grids_hold_what_the_tables_hold() {
    let run = Run::new();
    let (n, k) = (N_NODES, run.spring_nodes.len());
    let list = String::from_utf8(run.read("frames.pvd")).unwrap();
    let entries: Vec<&str> = list.split("<DataSet ").skip(1).collect();
    assert_eq!(entries.len(), N_FRAMES);
    for (index, entry) in entries.into_iter().enumerate() {
        let nodes = &run.nodes[n * index..][..n];
        let springs = &run.springs[k * index..][..k];
        assert_eq!(attribute(entry, "file"), format!("frames/{index:05}.vtu"));
        assert_eq!(attribute(entry, "timestep").parse(), Ok(nodes[0][0]));
        let file = run.read(attribute(entry, "file"));
        let reals = |name| {
            let (kind, bytes) = appended(&file, name);
            assert_eq!(kind, "Float64");
            reals(bytes)
        };
        assert_eq!(reals("Points"), Run::column(nodes, 2..5));
        assert_eq!(reals("velocity"), Run::column(nodes, 5..8));
        let bits = |numbers: Vec<f64>| Vec::from_iter(numbers.into_iter().map(f64::to_bits));
        assert_eq!(bits(reals("strain")), bits(Run::column(springs, 3..4)));
        assert_eq!(reals("tension"), Run::column(springs, 4..5));
        let starts = run.start.iter().flatten();
        let moved = Run::column(nodes, 2..5).into_iter().zip(starts);
        let moved: Vec<f64> = moved.map(|(x, start)| x - start).collect();
        assert_eq!(reals("displacement"), moved);
        let integers = |name| -> Vec<usize> {
            let (kind, bytes) = appended(&file, name);
            assert_eq!(kind, "Int64");
            bytes.chunks(8).map(|word| number(word, 0, 8)).collect()
        };
        assert_eq!(integers("connectivity"), run.spring_nodes.concat());
        assert_eq!(integers("offsets"), Vec::from_iter((2..=2 * k).step_by(2)));
        assert_eq!(appended(&file, "types"), ("UInt8", &vec![3; k][..]));
        let states = springs
            .iter()
            .map(|row| row[4].partial_cmp(&0.0).unwrap() as u8);
        let states: Vec<u8> = states.collect();
        assert_eq!(appended(&file, "state"), ("Int8", &states[..]));
        assert!(file.ends_with(b"\n</AppendedData>\n</VTKFile>\n"));
    }
}

#[test]
fn samples_hold_what_the_table_holds() {
    let run = Run::new();
    let bytes = run.read("points.pc2");
    assert_eq!(&bytes[..12], b"POINTCACHE2\0");
    let real = |start: usize| f32::from_le_bytes(bytes[start..start + 4].try_into().unwrap());
    assert_eq!((number(&bytes, 12, 4), number(&bytes, 16, 4)), (1, N_NODES));
    assert_eq!((real(20), real(24)), (0.0, 1.0));
    assert_eq!(number(&bytes, 28, 4), N_FRAMES);
    let found: Vec<f32> = (32..bytes.len()).step_by(4).map(real).collect();
    let expected = Run::column(&run.nodes, 2..5).into_iter();
    assert_eq!(found, Vec::from_iter(expected.map(|number| number as f32)));

    let text = String::from_utf8(run.read("mesh.obj")).unwrap();
    let lines = text.lines().map(|line| line.split_once(' ').unwrap());
    let (vertices, edges): (Vec<_>, Vec<_>) = lines.partition(|(kind, _)| *kind == "v");
    let vertices = vertices.into_iter().map(|(_, numbers)| {
        let numbers = numbers.split(' ').map(|number| number.parse().unwrap());
        numbers.collect::<Vec<f64>>()
    });
    assert!(vertices.eq(run.start.iter().map(|x| x.to_vec())));
    let edges = edges.into_iter().map(|(kind, numbers)| {
        assert_eq!(kind, "l");
        let (first, second) = numbers.split_once(' ').unwrap();
        [first, second].map(|number| number.parse::<usize>().unwrap() - 1)
    });
    // Blender leaves out nodes that have no line, and plays nothing then.
    let loose = [N_NODES - 1; 2];
    assert!(edges.eq(run.spring_nodes.iter().copied().chain([loose])));
}

/// No file may be larger than a limit; then there is none.
#[cfg(unix)]
#[test]
fn outputs_that_find_no_room_go_on() {
    use common::workspace::{Workspace, all_files};
    for output in ["npz", "pc2"] {
        let workspace = Workspace::new();
        workspace.scene("net.ron", "cloth 8 --duration 1");
        let options = format!("--write {output} --frames 3000 --checkpoint 0.1s --quiet");
        workspace.expect(0, &format!("run net.ron --out whole {options}"));
        let output = workspace.springs_within("-f 1000", &format!("run net.ron --out d {options}"));
        assert_eq!(output.status.code(), Some(1));
        let names = workspace.names("d");
        assert!(names.contains(&"checkpoint.bin".to_owned()), "{names:?}");
        assert!(
            names.iter().any(|name| name.ends_with(".part")),
            "{names:?}"
        );
        workspace.expect(0, "resume d --quiet");
        let [resumed, whole] = ["d", "whole"].map(|name| {
            let mut files = all_files(&workspace.path(name));
            files.remove("report.json");
            files
        });
        assert!(resumed == whole);
    }
}

/// `SPRINGS_PYTHON=python3 cargo test --test formats -- --ignored`: a Python with numpy
/// and meshio, and what it has of VTK and Blender (`pip install bpy`).
#[test]
#[ignore = "needs a Python with numpy and meshio, named by SPRINGS_PYTHON"]
fn foreign_readers_find_what_the_tables_hold() {
    let python = std::env::var("SPRINGS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let run = Run::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign/read_formats.py");
    let output = Command::new(python)
        .arg(script)
        .arg(run.folder.path())
        .output();
    let output = output.unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    print!("{}", String::from_utf8_lossy(&output.stdout));
}
