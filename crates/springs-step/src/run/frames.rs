//! The frames of a run that are still to come, and the looks of probes.

use crate::run::observer::{Frame, Samples, either};
use crate::run::probes::{Probes, Sample};
use crate::{Archive, Members, NodeStates, Observer};
use std::ops::ControlFlow;

/// How many frames of how many intervals were shown, and how often those probes looked that
/// have times of their own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Shown {
    intervals: u64,
    frames: u64,
    looks: Vec<u64>,
}

impl Shown {
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.word(&mut self.intervals);
        archive.word(&mut self.frames);
        archive.words(&mut self.looks);
    }
}

/// Times at equal distances, 0 the first.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Clock {
    duration: f64,
    spacing: Spacing,
    /// The index of the next one.
    next: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Spacing {
    /// So many intervals make the duration.
    Parts(u64),
    /// In s; and how many there are up to the duration.
    Every(f64, u64),
}

/// A duration is a whole number of intervals if it is that but for so large a part.
const WHOLE: f64 = 1e-9;

impl Clock {
    fn parts(duration: f64, intervals: u64) -> Self {
        Self {
            duration,
            spacing: Spacing::Parts(if duration == 0.0 { 0 } else { intervals }),
            next: 0,
        }
    }

    fn every(duration: f64, every: f64) -> Self {
        let whole = (duration / every).round();
        let is_whole = (whole * every - duration).abs() <= WHOLE * duration;
        let intervals = if is_whole {
            whole
        } else {
            (duration / every).floor()
        };
        Self {
            duration,
            spacing: Spacing::Every(every, intervals as u64),
            next: 0,
        }
    }

    /// The next time; one at the duration is exactly that.
    fn next_time(&self) -> Option<f64> {
        let (intervals, time) = match self.spacing {
            Spacing::Parts(intervals) if self.next == intervals => (intervals, self.duration),
            Spacing::Parts(intervals) => (
                intervals,
                self.duration * self.next as f64 / intervals as f64,
            ),
            Spacing::Every(every, intervals) => {
                let time = every * self.next as f64;
                let is_end = (time - self.duration).abs() <= WHOLE * self.duration;
                (intervals, if is_end { self.duration } else { time })
            }
        };
        (self.next <= intervals).then_some(time)
    }

    /// Whether a time is the next one, which it is no more.
    fn take(&mut self, time: f64) -> bool {
        let is_due = self.next_time().is_some_and(|next| next <= time);
        self.next += u64::from(is_due);
        is_due
    }

    fn skip_to(&mut self, time: f64) {
        while self.take(time) {}
    }
}

/// The frames and looks still to come.
pub(crate) struct Frames {
    frames: Clock,
    intervals: usize,
    /// Probes that look at every frame.
    at_frames: Vec<usize>,
    /// The others, by when they look.
    others: Vec<(Clock, Vec<usize>)>,
    pub(crate) between: NodeStates,
}

/// A frame this close to the end of a step, as a fraction of it, is the end.
pub(crate) const AT_THE_END: f64 = 1e-9;

/// What there is to be shown at a time.
pub(crate) struct Due {
    pub(crate) time: f64,
    /// The index of the frame.
    pub(crate) frame: Option<usize>,
    /// The probes that look, in order.
    pub(crate) probes: Vec<usize>,
}

/// What there is to be seen at a time, beside the nodes.
pub(crate) struct View {
    pub(crate) members: Option<Members>,
    pub(crate) samples: Vec<Sample>,
}

impl Frames {
    /// Without the probes if the observer does not want what they tell.
    pub(crate) fn new(
        duration: f64,
        intervals: usize,
        nodes: &NodeStates,
        probes: &Probes,
        observer: &dyn Observer,
    ) -> Self {
        let (mut at_frames, mut others) = (Vec::new(), Vec::<(Clock, Vec<usize>)>::new());
        let all = probes.periods().enumerate();
        for (probe, every) in all.filter(|_| observer.wants_samples()) {
            let Some(every) = every else {
                at_frames.push(probe);
                continue;
            };
            let clock = Clock::every(duration, every);
            match others.iter_mut().find(|(other, _)| *other == clock) {
                Some((_, probes)) => probes.push(probe),
                None => others.push((clock, vec![probe])),
            }
        }
        Self {
            frames: Clock::parts(duration, intervals as u64),
            intervals,
            at_frames,
            others,
            between: nodes.clone(),
        }
    }

    /// When there is something to be shown next, in s.
    pub(crate) fn next_time(&self) -> Option<f64> {
        let clocks = self.others.iter().map(|(clock, _)| clock);
        let times = clocks.chain([&self.frames]).filter_map(Clock::next_time);
        times.min_by(f64::total_cmp)
    }

    /// Leaves out what was `shown`, or, if that was something else, all up to `time`.
    pub(crate) fn go_on(&mut self, shown: Option<&Shown>, time: f64) {
        match shown {
            Some(shown)
                if shown.intervals == self.intervals as u64
                    && shown.looks.len() == self.others.len() =>
            {
                self.frames.next = shown.frames;
                for ((clock, _), looks) in self.others.iter_mut().zip(&shown.looks) {
                    clock.next = *looks;
                }
            }
            _ if time > 0.0 => {
                self.frames.skip_to(time);
                for (clock, _) in &mut self.others {
                    clock.skip_to(time);
                }
            }
            _ => {}
        }
    }

    pub(crate) fn shown(&self) -> Shown {
        Shown {
            intervals: self.intervals as u64,
            frames: self.frames.next,
            looks: self.others.iter().map(|(clock, _)| clock.next).collect(),
        }
    }

    /// What is to be shown at the next time, if that has come; it is then no more to come.
    pub(crate) fn take(&mut self, until: f64) -> Option<Due> {
        let time = self.next_time().filter(|time| *time <= until)?;
        let index = self.frames.next as usize;
        let frame = self.frames.take(time).then_some(index);
        let mut probes = Vec::new();
        if frame.is_some() {
            probes.extend(&self.at_frames);
        }
        for (clock, of_clock) in &mut self.others {
            if clock.take(time) {
                probes.extend(&*of_clock);
            }
        }
        probes.sort_unstable();
        Some(Due {
            time,
            frame,
            probes,
        })
    }
}

impl Due {
    /// Shows it.
    pub(crate) fn show(
        &self,
        nodes: &NodeStates,
        view: &View,
        to: &mut dyn Observer,
    ) -> ControlFlow<()> {
        let time = self.time;
        let mut shown = ControlFlow::Continue(());
        if let Some(index) = self.frame {
            shown = to.frame(Frame {
                index,
                time,
                nodes,
                members: view.members.as_ref(),
            });
        }
        if !view.samples.is_empty() {
            let samples = &view.samples;
            shown = either(shown, to.samples(Samples { time, samples }));
        }
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(mut clock: Clock) -> Vec<f64> {
        let next = || {
            let time = clock.next_time();
            clock.next += 1;
            time
        };
        std::iter::from_fn(next).collect()
    }

    #[test]
    fn clocks_end_with_the_duration_where_they_meet_it() {
        assert_eq!(
            times(Clock::parts(0.3, 3)),
            [0.0, 0.3 / 3.0, 0.6 / 3.0, 0.3]
        );
        assert_eq!(times(Clock::every(0.3, 0.1)), [0.0, 0.1, 0.2, 0.3]);
        assert_eq!(times(Clock::every(0.25, 0.1)), [0.0, 0.1, 0.2]);
        assert_eq!(times(Clock::every(0.25, 0.4)), [0.0]);
        assert_eq!(times(Clock::parts(0.0, 7)), [0.0]);
        assert_eq!(times(Clock::every(0.0, 0.4)), [0.0]);
    }
}
