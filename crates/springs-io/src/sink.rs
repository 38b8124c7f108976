//! What an output of a run is: somebody who is shown frames and energies.

use crate::atomic::WriteError;
use crate::growing::ContinueError;
use crate::report::EnergySum;
use crate::steps::StepRow;
use nalgebra::Vector3;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use springs_scene::{Scene, Spring};
use std::path::Path;

/// An output that a run can be asked for.
pub trait SinkKind: Send + Sync {
    /// What asks for it, such as `csv`.
    fn name(&self) -> &'static str;

    /// What it holds, in a few words.
    fn about(&self) -> &'static str;

    /// The files that it leaves in the folder of the run; a name that ends in `/` is
    /// that of a folder of numbered files. Until they are complete they are there under
    /// other names or, [kept](Written::keep), with `.part` added.
    fn files(&self) -> Vec<&'static str>;

    /// The names of outputs that it is made of, which are written, too, and finished
    /// before it.
    fn needs(&self) -> &'static [&'static str] {
        &[]
    }

    /// Starts the output in a folder. Older files stay until it is finished.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError>;

    /// Finds what a sink has written up to its [mark](Written::mark). Nothing is
    /// changed until the result is called: all outputs of a run must be found
    /// first.
    ///
    /// # Errors
    ///
    /// If it is not there or is something else, or if the mark is none of this
    /// output or of this scene.
    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError>;
}

/// Goes on with an output: removes what was written after the mark.
pub type ResumeSink = Box<dyn FnOnce() -> Result<Box<dyn Sink>, WriteError>>;

/// An output on its way.
///
/// It holds on to what it cannot write, and tries again at the next call.
pub trait Sink: Send {
    /// Whether to be called with the energies of each frame, after the frame.
    fn wants_energies(&self) -> bool {
        false
    }

    /// Whether frames are to have what springs and supports carry.
    fn wants_members(&self) -> bool {
        false
    }

    /// Whether to be called with what the probes of the scene tell.
    fn wants_samples(&self) -> bool {
        false
    }

    /// Whether to be called with every step.
    fn wants_steps(&self) -> bool {
        false
    }

    /// Called for every frame, in order.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn frame(&mut self, _frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        Ok(())
    }

    /// Called with the energies of a frame, if they are wanted.
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    fn energies(&mut self, _energies: &FrameEnergies) -> Result<(), WriteError> {
        Ok(())
    }

    /// Called with what probes tell at one time, if that is wanted, in the order of time.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn samples(&mut self, _samples: &ProbeSamples<'_>) -> Result<(), WriteError> {
        Ok(())
    }

    /// Called for every step, after the frames within it, if that is wanted.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn step(&mut self, _step: &StepRow) -> Result<(), WriteError> {
        Ok(())
    }

    /// What it has written so far, such as a [`GrowingFile`](crate::GrowingFile).
    fn written(&mut self) -> &mut dyn Written;

    /// Completes the files.
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<(), WriteError>;
}

/// What an output has written so far.
pub trait Written {
    /// Number of bytes that could not be written so far.
    fn n_unwritten(&self) -> usize {
        0
    }

    /// Makes what is written outlive the program, however it ends. Returns the
    /// names of the unfinished files that hold it, if it is not all in the mark.
    ///
    /// # Errors
    ///
    /// If that cannot be done; the output goes on as before.
    fn keep(&mut self) -> Result<Vec<String>, WriteError> {
        Ok(Vec::new())
    }

    /// What [`SinkKind::resume`] needs to go on from here, as long as what is
    /// written is kept or finished.
    fn mark(&self) -> Mark;
}

/// What is known of a run before it begins.
#[derive(Clone, Copy, Debug)]
pub struct RunPlan<'a> {
    /// As it is at the start.
    pub scene: &'a Scene,
    /// Equal time intervals between frames; there is one frame more, or a single
    /// one if the duration is zero.
    pub intervals: usize,
}

/// How a run ended.
#[derive(Clone, Copy, Debug)]
pub struct RunEnd<'a> {
    /// As it is at the end.
    pub scene: &'a Scene,
    /// In s.
    pub time: f64,
    /// What the tension of each spring came to, if members were wanted; else empty.
    pub peaks: &'a [TensionPeak],
}

/// The largest and the least tension of a spring at the ends of steps, at frames, and where a
/// probe told tensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TensionPeak {
    /// In N.
    pub max_tension: f64,
    /// When, in s.
    pub time_of_max: f64,
    /// In N.
    pub min_tension: f64,
    /// When, in s.
    pub time_of_min: f64,
}

/// What springs and supports carry at the time of a frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameMembers<'a> {
    /// The springs of the scene.
    pub springs: &'a [Spring],
    /// The tension of each, in N, without the force of its dashpot.
    pub tensions: &'a [f64],
    /// The broken ones among them, ascending.
    pub broken: &'a [usize],
    /// Those that have yielded, ascending.
    pub yielded: &'a [usize],
    /// Nodes and the forces of their supports on them, in N.
    pub reactions: &'a [(usize, Vector3<f64>)],
}

/// What probes tell at one time.
#[derive(Clone, Copy, Debug)]
pub struct ProbeSamples<'a> {
    /// In s.
    pub time: f64,
    /// Indices of the probes that look then, ascending, and the
    /// [numbers](springs_scene::ProbeQuantity::numbers) of each of their quantities, of each
    /// node or spring that they look at.
    pub samples: &'a [(usize, &'a [f64])],
}

/// Positions (m) and velocities (m/s) of all nodes at one time (s).
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryFrame<'a> {
    /// Counted from 0.
    pub index: usize,
    /// In s.
    pub time: f64,
    /// x of each node.
    pub positions: &'a [Vector3<f64>],
    /// v of each node.
    pub velocities: &'a [Vector3<f64>],
    /// What springs and supports carry, if that is wanted.
    pub members: Option<FrameMembers<'a>>,
}

impl TrajectoryFrame<'_> {
    /// The length of a spring, in m.
    ///
    /// # Panics
    ///
    /// If it has a node that does not exist.
    pub fn length_of(&self, spring: &Spring) -> f64 {
        let [a, b] = spring.nodes.map(|node| self.positions[node]);
        (b - a).norm()
    }
}

/// Energies at the time of a frame, in J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameEnergies {
    /// In s.
    pub time: f64,
    /// Energy then.
    pub energy: EnergySum,
    /// Work of moving anchors since the start.
    pub anchor_work: f64,
    /// Heat of dashpots since the start.
    pub dashpot_heat: f64,
    /// Work of loads so far, in J.
    pub load_work: f64,
    /// Gain of the method itself since the start, negative for a loss.
    pub method_gain: f64,
    /// What broken springs held when they broke, and the work of yielding.
    pub broken_energy: f64,
}

/// How far an output is written, in words of its own; part of a checkpoint.
///
/// It is written and read by `serde_json` only.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Mark(Box<RawValue>);

impl Mark {
    /// The mark that says so.
    ///
    /// # Panics
    ///
    /// If JSON cannot say it, such as a map whose keys are no texts.
    pub fn of(content: &impl Serialize) -> Self {
        Self(serde_json::value::to_raw_value(content).expect("what JSON can say"))
    }

    /// What it says, of an output whose file is named `file`.
    ///
    /// # Errors
    ///
    /// If it says something else.
    pub fn read<T: DeserializeOwned>(&self, file: &'static str) -> Result<T, ContinueError> {
        let content = serde_json::from_str(self.0.get());
        content.map_err(|source| ContinueError::Mark { file, source })
    }
}
