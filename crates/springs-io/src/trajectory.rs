//! Trajectories as CSV.

use crate::atomic::{Draft, WriteError};
use nalgebra::Vector3;
use std::io::Write as _;
use std::path::Path;

/// Positions (m) and velocities (m/s) of all nodes at one time (s).
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryFrame<'a> {
    /// In s.
    pub time: f64,
    /// x of each node.
    pub positions: &'a [Vector3<f64>],
    /// v of each node.
    pub velocities: &'a [Vector3<f64>],
}

/// Writes frames to a file with the header `time,node,x,y,z,vx,vy,vz`, a row
/// per frame and node. Every number reads back to the same bits. The file gets
/// its name when it is finished.
#[derive(Debug)]
pub struct TrajectoryWriter {
    draft: Draft,
    buffer: Vec<u8>,
}

impl TrajectoryWriter {
    /// Starts the file that will be at `path`.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let mut draft = Draft::begin(path)?;
        draft.write(b"time,node,x,y,z,vx,vy,vz\n")?;
        Ok(Self {
            draft,
            buffer: Vec::new(),
        })
    }

    /// Appends a frame.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn write(&mut self, frame: TrajectoryFrame<'_>) -> Result<(), WriteError> {
        self.buffer.clear();
        let time = frame.time;
        let states = frame.positions.iter().zip(frame.velocities);
        for (node, (x, v)) in states.enumerate() {
            writeln!(
                self.buffer,
                "{time:?},{node},{:?},{:?},{:?},{:?},{:?},{:?}",
                x.x, x.y, x.z, v.x, v.y, v.z
            )
            .expect("writing to memory");
        }
        self.draft.write(&self.buffer)
    }

    /// Completes the file.
    ///
    /// # Errors
    ///
    /// If it cannot be given its name.
    pub fn finish(self) -> Result<(), WriteError> {
        self.draft.finish()
    }
}
