//! `mesh.obj` and `points.pc2`: all frames for Blender, whose modifier Mesh Cache plays
//! the points of the one with the mesh of the other.
//!
//! `points.pc2` is a PC2 file: a header of 32 bytes, then x, y, z of all points, sample by
//! sample, as `f32`. The header has the number of samples so far after each of them.
//!
//! Blender leaves out vertices that no line has, and Mesh Cache then plays nothing: a node
//! without springs has a line to itself, which makes no edge.

use crate::atomic::WriteError;
use crate::growing::{ContinueError, FileMark, GrowingFile, part_name};
use crate::sink::{Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, TrajectoryFrame, Written};
use serde::{Deserialize, Serialize};
use springs_scene::Scene;
use std::io::Write as _;
use std::path::Path;

const MESH: &str = "mesh.obj";
const POINTS: &str = "points.pc2";
const N_HEADER: u64 = 32;

/// The output `pc2`: the nodes at time 0 and lines between them, and where they are at
/// each frame, in m.
#[derive(Clone, Copy, Debug)]
pub struct PointCache;

#[derive(Serialize, Deserialize)]
struct FileMarks {
    mesh: FileMark,
    points: FileMark,
}

impl SinkKind for PointCache {
    fn name(&self) -> &'static str {
        "pc2"
    }

    fn about(&self) -> &'static str {
        "mesh.obj and points.pc2: all nodes at every frame, for Blender"
    }

    fn files(&self) -> Vec<&'static str> {
        vec![MESH, POINTS]
    }

    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        let mut mesh = GrowingFile::begin(&folder.join(MESH))?;
        mesh.append(|bytes| write_mesh(plan.scene, bytes))?;
        let n_points = plan.scene.nodes.len();
        let points = GrowingFile::begin_with_header(&folder.join(POINTS), &header(n_points, 0))?;
        Ok(Box::new(Samples {
            files: Files { mesh, points },
            n_points,
            n_samples: 0,
        }))
    }

    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let FileMarks { mesh, points } = mark.read(POINTS)?;
        let n_points = plan.scene.nodes.len();
        let sample = 12 * n_points as u64;
        let n_bytes = points.n_bytes + points.unwritten.len() as u64;
        if !n_bytes.is_multiple_of(sample.max(1)) {
            return Err(ContinueError::OtherScene { file: POINTS });
        }
        let mesh = GrowingFile::find(&folder.join(MESH), mesh)?;
        let points = GrowingFile::find_with_header(&folder.join(POINTS), N_HEADER, points)?;
        Ok(Box::new(move || {
            let files = Files {
                mesh: mesh.go_on()?,
                points: points.go_on()?,
            };
            Ok(Box::new(Samples {
                files,
                n_points,
                n_samples: n_bytes / sample.max(1),
            }))
        }))
    }
}

struct Files {
    mesh: GrowingFile,
    points: GrowingFile,
}

struct Samples {
    files: Files,
    n_points: usize,
    n_samples: u64,
}

impl Sink for Samples {
    fn frame(&mut self, frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        self.n_samples += 1;
        let points = &mut self.files.points;
        points.append(|bytes| {
            let numbers = frame.positions.iter().flat_map(|x| [x.x, x.y, x.z]);
            bytes.extend(numbers.flat_map(|number| (number as f32).to_le_bytes()));
        })?;
        points.set_header(&header(self.n_points, self.n_samples))
    }

    fn written(&mut self) -> &mut dyn Written {
        &mut self.files
    }

    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<(), WriteError> {
        let Files { mesh, mut points } = self.files;
        // One that was resumed may have had no frame since.
        points.set_header(&header(self.n_points, self.n_samples))?;
        mesh.finish()?;
        points.finish()
    }
}

impl Written for Files {
    fn n_unwritten(&self) -> usize {
        self.mesh.n_unwritten() + self.points.n_unwritten()
    }

    fn keep(&mut self) -> Result<Vec<String>, WriteError> {
        self.mesh.keep()?;
        self.points.keep()?;
        Ok([MESH, POINTS].map(part_name).into())
    }

    fn mark(&self) -> Mark {
        Mark::of(&FileMarks {
            mesh: self.mesh.mark(),
            points: self.points.mark(),
        })
    }
}

/// The header of a file of samples that are one unit of time apart, from 0 on.
fn header(n_points: usize, n_samples: u64) -> Vec<u8> {
    let mut bytes = b"POINTCACHE2\0".to_vec();
    bytes.extend(1_i32.to_le_bytes());
    bytes.extend((n_points as i32).to_le_bytes());
    bytes.extend(0_f32.to_le_bytes());
    bytes.extend(1_f32.to_le_bytes());
    bytes.extend((n_samples as i32).to_le_bytes());
    bytes
}

/// Nodes are counted from 1 there.
fn write_line([first, second]: [usize; 2], bytes: &mut Vec<u8>) {
    writeln!(bytes, "l {} {}", first + 1, second + 1).expect("writing to memory");
}

fn write_mesh(scene: &Scene, bytes: &mut Vec<u8>) {
    for node in 0..scene.nodes.len() {
        let x = scene.start_position(node);
        writeln!(bytes, "v {:?} {:?} {:?}", x.x, x.y, x.z).expect("writing to memory");
    }
    let mut has_line = vec![false; scene.nodes.len()];
    for [first, second] in scene.springs.iter().map(|spring| spring.nodes) {
        [has_line[first], has_line[second]] = [true, true];
        write_line([first, second], bytes);
    }
    let loose = (0..has_line.len()).filter(|&node| !has_line[node]);
    loose.for_each(|node| write_line([node, node], bytes));
}
