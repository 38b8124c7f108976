//! `springs.csv` with `peaks.csv`, and `reactions.csv`: what springs and supports carry.

use crate::atomic::{WriteError, write_whole};
use crate::growing::ContinueError;
use crate::sink::{
    FrameMembers, Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, TensionPeak, TrajectoryFrame,
    Written,
};
use crate::table::{Rows, Table};
use springs_scene::Spring;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The output `reactions`: a row per frame and support, in N.
pub static REACTIONS: Table = Table {
    name: "reactions",
    about: "reactions.csv: the force of every support on its node, at each frame",
    file: "reactions.csv",
    columns: &["time", "node", "fx", "fy", "fz"],
    rows: Rows::Members(reactions),
};

fn reactions(frame: &TrajectoryFrame<'_>, members: &FrameMembers<'_>, bytes: &mut Vec<u8>) {
    for (node, force) in members.reactions {
        let (time, [x, y, z]) = (frame.time, [force.x, force.y, force.z]);
        writeln!(bytes, "{time:?},{node},{x:?},{y:?},{z:?}").expect("writing to memory");
    }
}

/// The table of springs alone: a row per frame and spring.
pub static SPRINGS: Table = Table {
    name: "springs",
    about: "springs.csv: length, strain and tension of every spring at each frame; peaks.csv",
    file: "springs.csv",
    columns: &["time", "spring", "length", "strain", "tension", "state"],
    rows: Rows::Members(springs),
};

fn springs(frame: &TrajectoryFrame<'_>, members: &FrameMembers<'_>, bytes: &mut Vec<u8>) {
    let springs = members.springs.iter().zip(members.tensions);
    for ((index, (spring, &tension)), state) in springs.enumerate().zip(states(members)) {
        let length = frame.length_of(spring);
        let (time, state) = (frame.time, state.word());
        let strain = strain(spring, length).map_or(String::new(), |strain| format!("{strain:?}"));
        writeln!(
            bytes,
            "{time:?},{index},{length:?},{strain},{tension:?},{state}"
        )
        .expect("writing to memory");
    }
}

/// The strain of a spring of that length in m; none where there is no rest length.
pub fn strain(spring: &Spring, length: f64) -> Option<f64> {
    (spring.rest_length > 0.0).then(|| (length - spring.rest_length) / spring.rest_length)
}

/// What a spring does at a frame.
#[derive(Clone, Copy)]
pub(crate) enum SpringState {
    Slack,
    Taut,
    Pushed,
    Broken,
    Yielded,
}

impl SpringState {
    fn word(self) -> &'static str {
        match self {
            Self::Slack => "slack",
            Self::Taut => "taut",
            Self::Pushed => "pushed",
            Self::Broken => "broken",
            Self::Yielded => "yielded",
        }
    }

    /// For formats without words.
    pub(crate) fn number(self) -> i8 {
        match self {
            Self::Slack => 0,
            Self::Taut => 1,
            Self::Pushed => -1,
            Self::Broken => 2,
            Self::Yielded => 3,
        }
    }
}

/// That of each spring.
pub(crate) fn states<'a>(members: &FrameMembers<'a>) -> impl Iterator<Item = SpringState> + 'a {
    let mut broken = members.broken.iter().peekable();
    let mut yielded = members.yielded.iter().peekable();
    let tensions = members.tensions.iter().enumerate();
    tensions.map(move |(index, &tension)| {
        let has_yielded = yielded.next_if_eq(&&index).is_some();
        if broken.next_if_eq(&&index).is_some() {
            SpringState::Broken
        } else if has_yielded {
            SpringState::Yielded
        } else if tension > 0.0 {
            SpringState::Taut
        } else if tension < 0.0 {
            SpringState::Pushed
        } else {
            SpringState::Slack
        }
    })
}

const PEAKS: &str = "peaks.csv";

/// The output `springs`: a row per frame and spring, and at the end of the run one per
/// spring with its largest and least tension.
#[derive(Clone, Copy, Debug)]
pub struct SpringsAndPeaks;

impl SinkKind for SpringsAndPeaks {
    fn name(&self) -> &'static str {
        SPRINGS.name
    }

    fn about(&self) -> &'static str {
        SPRINGS.about
    }

    fn files(&self) -> Vec<&'static str> {
        vec![SPRINGS.file, PEAKS]
    }

    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        Ok(Box::new(WithPeaks {
            frames: SPRINGS.begin(folder, plan)?,
            peaks: folder.join(PEAKS),
        }))
    }

    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let frames = SPRINGS.resume(folder, plan, mark)?;
        let peaks = folder.join(PEAKS);
        Ok(Box::new(move || {
            Ok(Box::new(WithPeaks {
                frames: frames()?,
                peaks,
            }))
        }))
    }
}

struct WithPeaks {
    frames: Box<dyn Sink>,
    peaks: PathBuf,
}

impl Sink for WithPeaks {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        self.frames.frame(frame)
    }

    fn written(&mut self) -> &mut dyn Written {
        self.frames.written()
    }

    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<(), WriteError> {
        let mut text = "spring,max_tension,time_of_max,min_tension,time_of_min\n".to_owned();
        for (spring, peak) in end.peaks.iter().enumerate() {
            let TensionPeak {
                max_tension,
                time_of_max,
                min_tension,
                time_of_min,
            } = peak;
            text += &format!(
                "{spring},{max_tension:?},{time_of_max:?},{min_tension:?},{time_of_min:?}\n"
            );
        }
        self.frames.finish(end)?;
        write_whole(&self.peaks, text.as_bytes())
    }
}
