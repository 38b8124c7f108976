//! Reads and writes mass-spring scenes, trajectories and reports.
//!
//! Scenes are RON files, described in [`parse_scene`]; trajectories are CSV, arrays for
//! numpy ([`Npz`]), grids for ParaView ([`Vtu`]) or point caches for Blender
//! ([`PointCache`]); reports are JSON. Every file appears whole or not at all. An output of a run is a
//! [`SinkKind`].
//!
//! ```
//! let text = "Scene(
//!     version: 1,
//!     nodes: [(position: (0, 0, 0), fixed: true), (position: [0, 0, -1], mass: 0.2)],
//!     springs: [(nodes: (0, 1), stiffness: 100)],
//! )";
//! let (scene, _) = springs_io::parse_scene("pendulum.ron", text)?;
//! assert_eq!(scene.springs[0].rest_length, 1.0);
//!
//! let error = springs_io::parse_scene("pendulum.ron", &text.replace("100", "-1")).unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     "pendulum.ron:4:42: springs[0].stiffness: \
//!      the stiffness of spring 0 must not be negative, but is -1"
//! );
//! # Ok::<(), springs_io::SceneError>(())
//! ```

mod atomic;
mod checkpoint;
mod csv_rows;
mod energies;
mod frames;
mod growing;
mod law_file;
mod loads;
mod locate;
mod members;
mod motions;
mod npz;
mod output;
mod point_cache;
mod probes;
mod read;
mod report;
mod rows;
mod scene_file;
mod sink;
mod spring_file;
mod springs;
mod statics;
mod steps;
mod syntax;
mod table;
mod tables;
mod trajectory;
mod vtu;
mod write;
mod zip;

pub use atomic::{WriteError, remove_drafts, try_to_write, write_whole};
pub use checkpoint::{
    Checkpoint, CheckpointError, CheckpointFault, read_checkpoint, write_checkpoint,
};
pub use csv_rows::{RowsError, read_points};
pub use energies::{ENERGIES, ENERGY_COLUMNS, EnergyColumn, read_energies};
pub use frames::{FrameFile, FrameSize, Quantity};
pub use growing::{ContinueError, FileMark, FoundFile, GrowingFile, part_name};
pub use members::{REACTIONS, SPRINGS, SpringsAndPeaks, strain};
pub use npz::{Npz, NpzError, open_npz};
pub use point_cache::PointCache;
pub use probes::{PROBES, Probes};
pub use read::{Finding, SceneError, parse_scene, parse_scene_with_inputs, read_scene, read_text};
pub use report::{
    EnergyReport, EnergySum, FailureReport, IslandReport, LoadWorkReport, Report, SavingReport,
    SecondsReport, SupportWorkReport, SwitchReport, TrialsReport, write_report,
};
pub use rows::{TableError, TableRow, TableRows};
pub use sink::{
    FrameEnergies, FrameMembers, Mark, ProbeSamples, ResumeSink, RunEnd, RunPlan, Sink, SinkKind,
    TensionPeak, TrajectoryFrame, Written,
};
pub use springs::{Inputs, SpringInput};
pub use statics::{
    MODES, ModesReport, NotFound, PATH, PathReport, PathRow, SHAPES, SettleReport, write_modes,
    write_path,
};
pub use steps::{STEPS, StepRow};
pub use table::{Rows, Table};
pub use tables::read_tables;
pub use trajectory::TRAJECTORY;
pub use vtu::{Vtu, remove_series};
pub use write::{scene_to_string, write_scene};
