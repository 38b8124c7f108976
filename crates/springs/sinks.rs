//! All outputs that a run can be asked for, and those that it writes.

use crate::filmstrip::Filmstrip;
use crate::report::{frame_energies, step_row};
use crate::view::View;
use serde::{Deserialize, Serialize};
use springs_io::{
    ContinueError, ENERGIES, FrameMembers, Mark, Npz, PointCache, ProbeSamples, Probes, REACTIONS,
    ResumeSink, RunEnd, RunPlan, STEPS, Sink, SinkKind, SpringsAndPeaks, TRAJECTORY, TensionPeak,
    TrajectoryFrame, Vtu, WriteError,
};
use springs_scene::{Scene, Spring, printable};
use springs_step::{Account, Frame, Islands, Samples, StepRecord};
use std::path::Path;

/// A row for each output; they are written and named in this order, each after those
/// that it [needs](SinkKind::needs).
pub static SINKS: &[&dyn SinkKind] = &[
    &TRAJECTORY,
    &ENERGIES,
    &STEPS,
    &SpringsAndPeaks,
    &REACTIONS,
    &Probes,
    &Npz,
    &Vtu,
    &PointCache,
    &Filmstrip,
    &View,
];

/// What is wrong with the outputs that a scene asks for, if anything is.
pub fn output_problem(scene: &Scene) -> Option<String> {
    let is_known = |name: &&String| SINKS.iter().any(|kind| kind.name() == name.as_str());
    let unknown = scene.output.write.iter().find(|name| !is_known(name))?;
    let known: Vec<&str> = SINKS.iter().map(|kind| kind.name()).collect();
    let (unknown, known) = (printable(unknown), known.join(", "));
    Some(format!(
        "there is no output `{unknown}`; known are {known}, each with a capital first letter"
    ))
}

/// What the tension of each spring came to, where members were wanted; else nothing.
pub fn tension_peaks(islands: &Islands) -> Vec<TensionPeak> {
    let peaks = islands.peaks().into_iter();
    let peaks = peaks.map(|peak| TensionPeak {
        max_tension: peak.max_tension,
        time_of_max: peak.time_of_max,
        min_tension: peak.min_tension,
        time_of_min: peak.time_of_min,
    });
    peaks.collect()
}

/// Intervals between the frames of a run of a scene: as many as it says, or 60 a second.
pub fn intervals(scene: &Scene) -> usize {
    match scene.output.frames {
        Some(frames) => frames as usize,
        None => default_intervals(scene),
    }
}

/// Intervals between the frames of a run where nothing else is said: 60 a second.
pub fn default_intervals(scene: &Scene) -> usize {
    (60.0 * scene.settings.duration).round().max(1.0) as usize
}

/// The outputs of one run.
pub struct Sinks {
    sinks: Vec<(&'static dyn SinkKind, Box<dyn Sink>)>,
    /// A frame was shown whose energies are still to come.
    awaits_energies: bool,
    /// Those of the scene, where members are wanted.
    springs: Vec<Spring>,
}

/// How far the outputs of a run are written, to go on from.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Marks {
    awaits_energies: bool,
    /// By the names of the outputs.
    sinks: Vec<(String, Mark)>,
}

impl Sinks {
    /// Starts the outputs of these names; names of none are not heard.
    ///
    /// # Errors
    ///
    /// If one cannot be written.
    pub fn begin(folder: &Path, names: &[String], plan: &RunPlan<'_>) -> Result<Self, WriteError> {
        let all = || SINKS.iter().copied();
        let is_named = |kind: &&dyn SinkKind| names.iter().any(|name| name == kind.name());
        let needed: Vec<&str> = all()
            .filter(is_named)
            .flat_map(SinkKind::needs)
            .copied()
            .collect();
        let asked = all().filter(|kind| is_named(kind) || needed.contains(&kind.name()));
        let sinks = asked.map(|kind| Ok((kind, kind.begin(folder, plan)?)));
        let sinks = sinks.collect::<Result<_, WriteError>>()?;
        Ok(Self::with(sinks, plan, false))
    }

    /// Goes on with the outputs of a run that was stopped. If one of them cannot
    /// be found as it was left, nothing is changed.
    ///
    /// # Errors
    ///
    /// If one is gone, is something else, or cannot be written.
    pub fn resume(folder: &Path, plan: &RunPlan<'_>, marks: &Marks) -> Result<Self, ContinueError> {
        let found = marks.find(folder, plan)?;
        let sinks = found.into_iter().map(|(kind, go_on)| Ok((kind, go_on()?)));
        let sinks = sinks.collect::<Result<_, WriteError>>()?;
        Ok(Self::with(sinks, plan, marks.awaits_energies))
    }

    fn with(
        sinks: Vec<(&'static dyn SinkKind, Box<dyn Sink>)>,
        plan: &RunPlan<'_>,
        awaits_energies: bool,
    ) -> Self {
        let mut sinks = Self {
            sinks,
            awaits_energies,
            springs: Vec::new(),
        };
        if sinks.wants_members() {
            sinks.springs.clone_from(&plan.scene.springs);
        }
        sinks
    }

    /// Whether frames are to have what springs and supports carry.
    pub fn wants_members(&self) -> bool {
        self.sinks.iter().any(|(_, sink)| sink.wants_members())
    }

    /// Whether the probes of the scene are to look.
    pub fn want_samples(&self) -> bool {
        self.sinks.iter().any(|(_, sink)| sink.wants_samples())
    }

    /// Whether nothing is to be written.
    pub fn is_empty(&self) -> bool {
        self.sinks.is_empty()
    }

    fn each(&mut self) -> impl Iterator<Item = &mut dyn Sink> {
        self.sinks.iter_mut().map(|(_, sink)| &mut **sink as _)
    }

    /// Whether a frame was shown whose energies are still to be written.
    pub fn awaits_energies(&self) -> bool {
        self.awaits_energies
    }

    /// Shows a frame to all, also if one of them cannot write it.
    ///
    /// # Errors
    ///
    /// The first of theirs.
    pub fn frame(&mut self, frame: Frame<'_>) -> Result<(), WriteError> {
        let reactions: Vec<_> = frame.members.map_or(Vec::new(), |members| {
            let reactions = members.reactions.iter();
            reactions.map(|one| (one.node, one.force)).collect()
        });
        let frame = TrajectoryFrame {
            index: frame.index,
            time: frame.time,
            positions: &frame.nodes.positions,
            velocities: &frame.nodes.velocities,
            members: frame.members.map(|members| FrameMembers {
                springs: &self.springs,
                tensions: &members.tensions,
                broken: &members.broken,
                yielded: &members.yielded,
                reactions: &reactions,
            }),
        };
        self.awaits_energies = false;
        let sinks = self.sinks.iter_mut();
        let written = sinks.map(|(_, sink)| {
            self.awaits_energies |= sink.wants_energies();
            sink.frame(&frame)
        });
        written.fold(Ok(()), Result::and)
    }

    /// Shows what probes tell to those who want it.
    ///
    /// # Errors
    ///
    /// The first of theirs.
    pub fn samples(&mut self, samples: Samples<'_>) -> Result<(), WriteError> {
        let of_probes = samples.samples.iter();
        let of_probes: Vec<(usize, &[f64])> = of_probes
            .map(|sample| (sample.probe, &sample.values[..]))
            .collect();
        let samples = ProbeSamples {
            time: samples.time,
            samples: &of_probes,
        };
        let wanting = self.each().filter(|sink| sink.wants_samples());
        let written = wanting.map(|sink| sink.samples(&samples));
        written.fold(Ok(()), Result::and)
    }

    /// Shows a step to those who want it, also if one of them cannot write it.
    ///
    /// # Errors
    ///
    /// The first of theirs.
    pub fn step(&mut self, record: &StepRecord) -> Result<(), WriteError> {
        let sinks = self.each().filter(|sink| sink.wants_steps());
        let written = sinks.map(|sink| sink.step(&step_row(record)));
        written.fold(Ok(()), Result::and)
    }

    /// Shows the energies of the frame to those who want them.
    ///
    /// # Errors
    ///
    /// The first of theirs.
    pub fn account(&mut self, account: &Account) -> Result<(), WriteError> {
        let energies = frame_energies(account);
        self.awaits_energies = false;
        let wanting = self.each().filter(|sink| sink.wants_energies());
        let written = wanting.map(|sink| sink.energies(&energies));
        written.fold(Ok(()), Result::and)
    }

    /// Number of bytes that could not be written so far.
    pub fn n_unwritten(&mut self) -> usize {
        self.each().map(|sink| sink.written().n_unwritten()).sum()
    }

    /// Makes what is written outlive the program, as far as each of them can.
    /// Returns the names of the unfinished files that hold it, and the first error.
    pub fn keep(&mut self) -> (Vec<String>, Result<(), WriteError>) {
        let (mut files, mut all) = (Vec::new(), Ok(()));
        for sink in self.each() {
            match sink.written().keep() {
                Ok(kept) => files.extend(kept),
                Err(error) => all = all.and(Err(error)),
            }
        }
        (files, all)
    }

    /// How far they are written. To go on from there, what is written must be kept
    /// or finished.
    pub fn marks(&mut self) -> Marks {
        let sinks = self.sinks.iter_mut();
        let marks = sinks.map(|(kind, sink)| (kind.name().to_owned(), sink.written().mark()));
        Marks {
            awaits_energies: self.awaits_energies,
            sinks: marks.collect(),
        }
    }

    /// Completes them one by one, and returns the names of the files that are
    /// complete. After an error the rest can still be kept.
    ///
    /// # Errors
    ///
    /// If one cannot be written.
    pub fn finish(&mut self, end: &RunEnd<'_>) -> Result<Vec<&'static str>, WriteError> {
        let mut files = Vec::new();
        while !self.sinks.is_empty() {
            let (kind, sink) = self.sinks.remove(0);
            sink.finish(end)?;
            files.extend(kind.files());
        }
        Ok(files)
    }
}

impl Marks {
    /// Whether a run could go on from here now.
    ///
    /// # Errors
    ///
    /// If an output is gone or is something else.
    pub fn check(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<(), ContinueError> {
        self.find(folder, plan).map(|_| ())
    }

    fn find(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
    ) -> Result<Vec<(&'static dyn SinkKind, ResumeSink)>, ContinueError> {
        let found = self.sinks.iter().map(|(name, mark)| {
            let kind = SINKS.iter().copied().find(|kind| kind.name() == name);
            let kind = kind.ok_or_else(|| ContinueError::Unknown { name: name.clone() })?;
            Ok((kind, kind.resume(folder, plan, mark)?))
        });
        found.collect()
    }
}
