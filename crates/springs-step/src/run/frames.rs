//! The frames of a run that are still to come.

use crate::run::observer::Frame;
use crate::{Archive, Members, NodeStates, Observer};
use std::ops::ControlFlow;

/// How many frames of how many intervals were shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Shown {
    intervals: u64,
    frames: u64,
}

impl Shown {
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.word(&mut self.intervals);
        archive.word(&mut self.frames);
    }
}

/// The frames still to come.
pub(crate) struct Frames {
    duration: f64,
    intervals: usize,
    next: usize,
    pub(crate) between: NodeStates,
}

/// A frame this close to the end of a step, as a fraction of it, is the end.
pub(crate) const AT_THE_END: f64 = 1e-9;

impl Frames {
    pub(crate) fn new(duration: f64, intervals: usize, nodes: &NodeStates) -> Self {
        let intervals = if duration == 0.0 { 0 } else { intervals };
        Self {
            duration,
            intervals,
            next: 0,
            between: nodes.clone(),
        }
    }

    /// Time of the next frame; the last one is exactly the duration.
    pub(crate) fn next_time(&self) -> Option<f64> {
        match self.next.cmp(&self.intervals) {
            std::cmp::Ordering::Less => {
                Some(self.duration * self.next as f64 / self.intervals as f64)
            }
            std::cmp::Ordering::Equal => Some(self.duration),
            std::cmp::Ordering::Greater => None,
        }
    }

    /// Leaves out the frames that were `shown`, or, if those were others, all
    /// up to `time`.
    pub(crate) fn go_on(&mut self, shown: Option<Shown>, time: f64) {
        match shown {
            Some(shown) if shown.intervals == self.intervals as u64 => {
                self.next = shown.frames as usize;
            }
            _ if time > 0.0 => {
                while self.next_time().is_some_and(|next| next <= time) {
                    self.next += 1;
                }
            }
            _ => {}
        }
    }

    pub(crate) fn is_first(&self) -> bool {
        self.next == 0
    }

    pub(crate) fn shown(&self) -> Shown {
        Shown {
            intervals: self.intervals as u64,
            frames: self.next as u64,
        }
    }

    /// Shows the next frame.
    pub(crate) fn show(
        &mut self,
        time: f64,
        nodes: &NodeStates,
        members: Option<Members>,
        to: &mut dyn Observer,
    ) -> ControlFlow<()> {
        let index = self.next;
        self.next += 1;
        to.frame(Frame {
            index,
            time,
            nodes,
            members: members.as_ref(),
        })
    }
}
