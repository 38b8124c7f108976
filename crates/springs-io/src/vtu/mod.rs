//! `frames.pvd` and `frames/00000.vtu`, …: all frames for ParaView, after VTK's file
//! formats: unstructured grids of lines, appended raw.
//!
//! Until they are complete, the frames and a `frames.pvd` that lists them are in one
//! folder, which is kept as `frames.part`.

mod series;

pub use series::remove_series;

use crate::atomic::WriteError;
use crate::growing::ContinueError;
use crate::members::{states, strain};
use crate::sink::{
    FrameMembers, Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, TrajectoryFrame, Written,
};
use nalgebra::Vector3;
use series::GrowingSeries;
use springs_scene::Scene;
use std::path::Path;

/// The list of all frames.
const LIST: &str = "frames.pvd";
/// The folder of frames.
const FOLDER: &str = "frames/";
/// A line between two points, in VTK.
const LINE: u8 = 3;

/// The output `vtu`: points with `velocity` (m/s) and `displacement` from the start (m),
/// lines with `tension` (N), `strain` and `state` (1 taut, −1 pushed, 0 slack,
/// 2 broken, 3 yielded).
#[derive(Clone, Copy, Debug)]
pub struct Vtu;

impl SinkKind for Vtu {
    fn name(&self) -> &'static str {
        "vtu"
    }

    fn about(&self) -> &'static str {
        "frames.pvd and frames/: nodes and springs at every frame, for ParaView"
    }

    fn files(&self) -> Vec<&'static str> {
        vec![LIST, FOLDER]
    }

    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        let series = GrowingSeries::begin(&folder.join(FOLDER))?;
        let start = start_positions(plan.scene);
        Ok(Box::new(Grids { series, start }))
    }

    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let found = GrowingSeries::find(&folder.join(FOLDER), mark)?;
        let start = start_positions(plan.scene);
        Ok(Box::new(move || {
            let series = found.go_on()?;
            Ok(Box::new(Grids { series, start }))
        }))
    }
}

struct Grids {
    series: GrowingSeries,
    /// Where the nodes were at time 0.
    start: Vec<Vector3<f64>>,
}

fn start_positions(scene: &Scene) -> Vec<Vector3<f64>> {
    let nodes = 0..scene.nodes.len();
    nodes.map(|node| scene.start_position(node)).collect()
}

impl Sink for Grids {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        match &frame.members {
            Some(members) => self.series.append(grid(frame, members, &self.start)),
            None => Ok(()),
        }
    }

    fn written(&mut self) -> &mut dyn Written {
        &mut self.series
    }

    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<(), WriteError> {
        self.series.finish()
    }
}

/// Arrays that follow the text of a file, each after its size in bytes.
#[derive(Default)]
struct Appended {
    bytes: Vec<u8>,
}

impl Appended {
    /// Appends an array; returns the element that refers to it.
    fn array<const N: usize>(
        &mut self,
        name: &str,
        kind: &str,
        n_components: usize,
        numbers: impl Iterator<Item = [u8; N]>,
    ) -> String {
        let offset = self.bytes.len();
        self.bytes.extend([0; 8]);
        numbers.for_each(|number| self.bytes.extend(number));
        let n_bytes = (self.bytes.len() - offset - 8) as u64;
        self.bytes[offset..offset + 8].copy_from_slice(&n_bytes.to_le_bytes());
        let components = match n_components {
            1 => String::new(),
            n => format!("NumberOfComponents=\"{n}\" "),
        };
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" {components}\
             format=\"appended\" offset=\"{offset}\"/>\n"
        )
    }

    fn vectors<'a>(&mut self, name: &str, of: impl Iterator<Item = &'a Vector3<f64>>) -> String {
        let numbers = of.flat_map(|vector| [vector.x, vector.y, vector.z]);
        self.array(name, "Float64", 3, numbers.map(f64::to_le_bytes))
    }

    fn reals(&mut self, name: &str, of: impl Iterator<Item = f64>) -> String {
        self.array(name, "Float64", 1, of.map(f64::to_le_bytes))
    }

    fn integers(&mut self, name: &str, of: impl Iterator<Item = usize>) -> String {
        let numbers = of.map(|number| (number as u64).to_le_bytes());
        self.array(name, "Int64", 1, numbers)
    }
}

/// The file of a frame.
fn grid(
    frame: &TrajectoryFrame<'_>,
    members: &FrameMembers<'_>,
    start: &[Vector3<f64>],
) -> Vec<u8> {
    let (springs, tensions) = (members.springs, members.tensions);
    let moved = frame.positions.iter().zip(start);
    let displacements: Vec<_> = moved.map(|(x, start)| x - start).collect();
    let strains = springs.iter().map(|spring| {
        // No number where there is no rest length.
        strain(spring, frame.length_of(spring)).unwrap_or(f64::NAN)
    });
    let states = states(members).map(|state| state.number().to_le_bytes());
    let mut appended = Appended::default();
    let text = [
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\">\n<UnstructuredGrid>\n",
        &series::time_element(frame.time),
        &format!(
            "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<PointData>\n",
            frame.positions.len(),
            springs.len()
        ),
        &appended.vectors("velocity", frame.velocities.iter()),
        &appended.vectors("displacement", displacements.iter()),
        "</PointData>\n<CellData>\n",
        &appended.reals("tension", tensions.iter().copied()),
        &appended.reals("strain", strains),
        &appended.array("state", "Int8", 1, states),
        "</CellData>\n<Points>\n",
        &appended.vectors("Points", frame.positions.iter()),
        "</Points>\n<Cells>\n",
        &appended.integers(
            "connectivity",
            springs.iter().flat_map(|spring| spring.nodes),
        ),
        &appended.integers("offsets", (1..=springs.len()).map(|spring| 2 * spring)),
        &appended.array("types", "UInt8", 1, springs.iter().map(|_| [LINE])),
        "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_",
    ]
    .concat();
    let end = "\n</AppendedData>\n</VTKFile>\n";
    [text.as_bytes(), &appended.bytes, end.as_bytes()].concat()
}
