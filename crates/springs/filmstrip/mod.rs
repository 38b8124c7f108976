//! A few moments of a run side by side, as an SVG picture.

mod drawing;
mod marks;
mod strains;
mod view;

pub use drawing::filmstrip;
pub(crate) use view::{axes, up_of};

use nalgebra::Vector3;
use springs_io::{
    ContinueError, Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, TrajectoryFrame, WriteError,
    Written, write_whole,
};
use springs_scene::{Scene, Spring};
use std::path::{Path, PathBuf};

/// One moment of a run.
#[derive(Clone, Debug)]
pub struct Panel {
    /// In s.
    pub time: f64,
    /// Position of every node of the scene, in m.
    pub positions: Vec<Vector3<f64>>,
    /// The springs that are broken then, ascending.
    pub broken: Vec<usize>,
}

const FILE: &str = "filmstrip.svg";

/// The output `svg`: the [`filmstrip`] of the first, the middle and the last frame.
#[derive(Clone, Copy, Debug)]
pub struct Filmstrip;

impl SinkKind for Filmstrip {
    fn name(&self) -> &'static str {
        "svg"
    }

    fn about(&self) -> &'static str {
        "filmstrip.svg: the first, the middle and the last frame"
    }

    fn files(&self) -> Vec<&'static str> {
        vec![FILE]
    }

    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        Ok(Box::new(Panels::new(folder, plan, Vec::new())))
    }

    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let panels: Vec<PanelBits> = mark.read(FILE)?;
        let panels: Vec<Panel> = panels.into_iter().map(panel_of).collect();
        if !panels.iter().all(|panel| fits(panel, plan.scene)) {
            return Err(ContinueError::OtherScene { file: FILE });
        }
        let sink = Panels::new(folder, plan, panels);
        Ok(Box::new(|| Ok(Box::new(sink))))
    }
}

/// The panels of a picture that is drawn at the end.
struct Panels {
    path: PathBuf,
    /// Index of the frame in the middle.
    middle: usize,
    /// Springs can break.
    can_break: bool,
    panels: Vec<Panel>,
}

impl Panels {
    fn new(folder: &Path, plan: &RunPlan<'_>, panels: Vec<Panel>) -> Self {
        Self {
            path: folder.join(FILE),
            middle: plan.intervals / 2,
            can_break: plan.scene.springs.iter().any(Spring::is_breakable),
            panels,
        }
    }
}

impl Sink for Panels {
    fn wants_members(&self) -> bool {
        self.can_break
    }

    fn frame(&mut self, frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        if frame.index == 0 || frame.index == self.middle {
            self.panels.push(Panel {
                time: frame.time,
                positions: frame.positions.to_vec(),
                broken: frame
                    .members
                    .map_or(Vec::new(), |members| members.broken.to_vec()),
            });
        }
        Ok(())
    }

    fn written(&mut self) -> &mut dyn Written {
        self
    }

    fn finish(mut self: Box<Self>, end: &RunEnd<'_>) -> Result<(), WriteError> {
        let last = self.panels.last();
        if last.is_none_or(|panel| panel.time < end.time) {
            self.panels.push(Panel {
                time: end.time,
                positions: end.scene.nodes.iter().map(|node| node.position).collect(),
                broken: broken_of(end.scene),
            });
        }
        // Its loads are where they are at the end.
        let mut scene = end.scene.clone();
        scene.shift_time(-end.time);
        let picture = filmstrip(&scene, &self.panels);
        write_whole(&self.path, picture.as_bytes())
    }
}

/// All is in the mark.
impl Written for Panels {
    fn mark(&self) -> Mark {
        let panels: Vec<PanelBits> = self.panels.iter().map(bits_of).collect();
        Mark::of(&panels)
    }
}

/// The springs that are broken, ascending.
fn broken_of(scene: &Scene) -> Vec<usize> {
    let springs = scene.springs.iter().enumerate();
    let broken = springs.filter(|(_, spring)| spring.broken);
    broken.map(|(index, _)| index).collect()
}

/// Time and positions of a panel, bit by bit, and its broken springs.
type PanelBits = (u64, Vec<[u64; 3]>, Vec<usize>);

fn bits_of(panel: &Panel) -> PanelBits {
    let bits = |x: &Vector3<f64>| <[f64; 3]>::from(*x).map(f64::to_bits);
    let positions = panel.positions.iter().map(bits);
    let broken = panel.broken.clone();
    (panel.time.to_bits(), positions.collect(), broken)
}

fn panel_of((time, positions, broken): PanelBits) -> Panel {
    let vector = |bits: [u64; 3]| Vector3::from(bits.map(f64::from_bits));
    Panel {
        time: f64::from_bits(time),
        positions: positions.into_iter().map(vector).collect(),
        broken,
    }
}

/// Whether a run of this scene can have come by there.
fn fits(panel: &Panel, scene: &Scene) -> bool {
    let mut numbers = panel.positions.iter().flatten();
    panel.time.is_finite()
        && panel.positions.len() == scene.nodes.len()
        && numbers.all(|number| number.is_finite())
        && panel.broken.is_sorted()
        && panel
            .broken
            .last()
            .is_none_or(|last| *last < scene.springs.len())
}
