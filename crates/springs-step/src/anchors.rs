//! Prescribed motion of fixed nodes.

use crate::{Archive, Interval, NodeStates, State};
use nalgebra::Vector3;
use springs_assembly::{Prescribed, System};
use std::sync::Arc;

/// Fixed nodes follow x₀ + v t, and some of them a motion of the scene beside that. The
/// position is computed from the time, never summed up over steps.
#[derive(Clone, Debug)]
pub struct Anchors {
    first: usize,
    /// Positions at time `since`, in m, without the motions.
    origins: Vec<Vector3<f64>>,
    /// Without those of the motions, in m/s.
    velocities: Vec<Vector3<f64>>,
    since: f64,
    prescribed: Arc<[Prescribed]>,
    any_moves: bool,
}

impl Anchors {
    /// Anchors that are where `state` has them at its time.
    pub(crate) fn new(system: &System, state: &State) -> Self {
        let first = system.n_free();
        let mut anchors = Self {
            first,
            origins: state.x[first..].to_vec(),
            velocities: state.v[first..].to_vec(),
            since: state.time,
            prescribed: system.prescribed().clone(),
            any_moves: system.any_anchor_moves(&state.v),
        };
        for prescribed in &*anchors.prescribed {
            let moved = prescribed.at(state.time);
            for block in prescribed.blocks() {
                anchors.origins[block - first] -= moved.displacement;
                anchors.velocities[block - first] -= moved.velocity;
            }
        }
        anchors
    }

    /// What says how they move from where they are at a time: with a saved one they go on
    /// as if they had not been made anew.
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.vectors(&mut self.origins);
        archive.vectors(&mut self.velocities);
        archive.real(&mut self.since);
        archive.flag(&mut self.any_moves);
    }

    /// Gives them their positions in m, and their velocities in m/s as far as these
    /// change, at `time`, in s.
    pub fn place(&self, time: f64, x: &mut [Vector3<f64>], v: &mut [Vector3<f64>]) {
        if !self.any_moves {
            return;
        }
        for (anchor, x) in x[self.first..].iter_mut().enumerate() {
            *x = self.without_motion(anchor, time);
        }
        for prescribed in &*self.prescribed {
            let moved = prescribed.at(time);
            for block in prescribed.blocks() {
                x[block] += moved.displacement;
                v[block] = self.velocities[block - self.first] + moved.velocity;
            }
        }
    }

    /// Where one of them is without the motion that it follows, in m.
    fn without_motion(&self, anchor: usize, time: f64) -> Vector3<f64> {
        self.origins[anchor] + self.velocities[anchor] * (time - self.since)
    }

    /// Gives those whose velocities change the ones, in m/s, that lead from `x`, where
    /// they are at the start of an interval, straight to its end.
    pub fn point_at_end(&self, interval: Interval, x: &[Vector3<f64>], v: &mut [Vector3<f64>]) {
        for prescribed in &*self.prescribed {
            let moved = prescribed.at(interval.end).displacement;
            for block in prescribed.blocks() {
                let end = self.without_motion(block - self.first, interval.end) + moved;
                v[block] = (end - x[block]) / interval.size;
            }
        }
    }

    /// Whether velocities of some change with time; gives their accelerations at `time`
    /// in s, in m/s², and zero for the other fixed nodes.
    pub fn accelerations(&self, time: f64, accelerations: &mut [Vector3<f64>]) -> bool {
        accelerations[self.first..].fill(Vector3::zeros());
        for prescribed in &*self.prescribed {
            let moved = prescribed.at(time);
            for block in prescribed.blocks() {
                accelerations[block] = moved.acceleration;
            }
        }
        !self.prescribed.is_empty()
    }

    /// Puts nodes that follow a motion where they are at `time`, in s.
    pub(crate) fn place_nodes(&self, system: &System, time: f64, nodes: &mut NodeStates) {
        for prescribed in &*self.prescribed {
            let moved = prescribed.at(time);
            for block in prescribed.blocks() {
                let (node, anchor) = (system.numbering().node(block), block - self.first);
                nodes.positions[node] = self.without_motion(anchor, time) + moved.displacement;
                nodes.velocities[node] = self.velocities[anchor] + moved.velocity;
            }
        }
    }
}
