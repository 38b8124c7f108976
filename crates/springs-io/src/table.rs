//! Tables as CSV: trajectories, energy over time.

use crate::atomic::{Draft, WriteError};
use nalgebra::Vector3;
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

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

/// Writes rows of numbers under a header. Every number reads back to the same
/// bits. The file gets its name when it is finished.
#[derive(Debug)]
pub struct TableWriter {
    growing: Growing,
    buffer: Vec<u8>,
    sum: crc32fast::Hasher,
    bytes: u64,
}

/// A file that does not have its name yet.
#[derive(Debug)]
enum Growing {
    /// Gone if it is not finished.
    Draft(Draft),
    /// Under the name with `.part` added, which stays.
    Part { path: PathBuf, file: File },
}

/// The beginning of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beginning {
    /// Its length.
    pub bytes: u64,
    /// Its check sum, CRC-32.
    pub sum: u32,
}

/// A table cannot be continued.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContinueError {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] WriteError),
    /// It does not begin as it did when the run was stopped.
    #[error("{} is not what the run has written so far", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
}

/// Of tables of [`TableWriter::frame`]: a row per frame and node.
pub const TRAJECTORY_HEADER: &str = "time,node,x,y,z,vx,vy,vz";

impl TableWriter {
    /// Starts the file that will be at `path`; nothing is left of it if it is
    /// not finished.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn create(path: &Path, header: &str) -> Result<Self, WriteError> {
        Self::start(Growing::Draft(Draft::begin(path)?), header)
    }

    /// The same with a file of that name and `.part`, which stays if the program
    /// is killed, so that [`Self::resume`] can go on with it.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn create_lasting(path: &Path, header: &str) -> Result<Self, WriteError> {
        let file = File::create(part_of(path)).map_err(failure(path))?;
        let path = path.to_owned();
        Self::start(Growing::Part { path, file }, header)
    }

    /// Goes on with a lasting or finished file that begins as one did when it
    /// was stopped; what was written later is written anew.
    ///
    /// # Errors
    ///
    /// If it cannot be written or begins otherwise.
    pub fn resume(path: &Path, beginning: Beginning) -> Result<Self, ContinueError> {
        let part = part_of(path);
        if !part.exists() && path.exists() {
            // Whole or not at all: this, too, may be killed.
            let mut copy = Draft::begin(&part)?;
            let mut source = File::open(path).map_err(failure(path))?;
            copy.append(&mut source)?;
            copy.finish()?;
        }
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .open(&part)
            .map_err(failure(&part))?;
        let (mut sum, mut bytes) = (crc32fast::Hasher::new(), 0);
        let mut chunk = vec![0; 1 << 16];
        while bytes < beginning.bytes {
            let wanted = (beginning.bytes - bytes).min(chunk.len() as u64) as usize;
            let n = file.read(&mut chunk[..wanted]).map_err(failure(&part))?;
            if n == 0 {
                return Err(ContinueError::Changed { path: part });
            }
            sum.update(&chunk[..n]);
            bytes += n as u64;
        }
        if sum.clone().finalize() != beginning.sum {
            return Err(ContinueError::Changed { path: part });
        }
        file.set_len(bytes).map_err(failure(&part))?;
        file.seek(SeekFrom::Start(bytes)).map_err(failure(&part))?;
        Ok(Self {
            growing: Growing::Part {
                path: path.to_owned(),
                file,
            },
            buffer: Vec::new(),
            sum,
            bytes,
        })
    }

    fn start(growing: Growing, header: &str) -> Result<Self, WriteError> {
        let mut writer = Self {
            growing,
            buffer: format!("{header}\n").into_bytes(),
            sum: crc32fast::Hasher::new(),
            bytes: 0,
        };
        writer.flush()?;
        Ok(writer)
    }

    /// Appends a row of numbers.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn row(&mut self, numbers: &[f64]) -> Result<(), WriteError> {
        for (k, number) in numbers.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            write!(self.buffer, "{comma}{number:?}").expect("writing to memory");
        }
        self.buffer.push(b'\n');
        self.flush()
    }

    /// Appends the rows of a frame.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn frame(&mut self, frame: TrajectoryFrame<'_>) -> Result<(), WriteError> {
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
        self.flush()
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        match &mut self.growing {
            Growing::Draft(draft) => draft.write(&self.buffer)?,
            Growing::Part { path, file } => {
                file.write_all(&self.buffer).map_err(failure(path))?;
            }
        }
        self.sum.update(&self.buffer);
        self.bytes += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }

    /// What is written so far.
    pub fn beginning(&self) -> Beginning {
        Beginning {
            bytes: self.bytes,
            sum: self.sum.clone().finalize(),
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    ///
    /// If it cannot be given its name.
    pub fn finish(self) -> Result<(), WriteError> {
        match self.growing {
            Growing::Draft(draft) => draft.finish(),
            Growing::Part { path, .. } => {
                std::fs::rename(part_of(&path), &path).map_err(failure(&path))
            }
        }
    }
}

/// The name of an unfinished file.
fn part_of(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    name.into()
}

fn failure(path: &Path) -> impl Fn(io::Error) -> WriteError {
    let path = path.to_owned();
    move |source| WriteError {
        path: path.clone(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(time: f64) -> TrajectoryFrame<'static> {
        const NODES: [Vector3<f64>; 2] =
            [Vector3::new(0.1, 0.2, -0.3), Vector3::new(1e-9, 2.0, 0.0)];
        TrajectoryFrame {
            time,
            positions: &NODES,
            velocities: &NODES,
        }
    }

    #[test]
    fn a_resumed_file_is_that_of_a_run_without_a_stop() {
        let folder = tempfile::tempdir().unwrap();
        let (whole, resumed) = (folder.path().join("whole"), folder.path().join("resumed"));
        let mut writer = TableWriter::create(&whole, TRAJECTORY_HEADER).unwrap();
        (0..4).for_each(|k| writer.frame(frame(f64::from(k))).unwrap());
        writer.finish().unwrap();

        let mut writer = TableWriter::create_lasting(&resumed, TRAJECTORY_HEADER).unwrap();
        writer.frame(frame(0.0)).unwrap();
        let beginning = writer.beginning();
        // These were written after the checkpoint, and the program was killed.
        writer.frame(frame(1.0)).unwrap();
        drop(writer);
        let mut writer = TableWriter::resume(&resumed, beginning).unwrap();
        (1..3).for_each(|k| writer.frame(frame(f64::from(k))).unwrap());
        let beginning = writer.beginning();
        // Interrupted, and finished up to there.
        writer.finish().unwrap();
        let mut writer = TableWriter::resume(&resumed, beginning).unwrap();
        writer.frame(frame(3.0)).unwrap();
        writer.finish().unwrap();
        assert_eq!(
            std::fs::read(&whole).unwrap(),
            std::fs::read(&resumed).unwrap()
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn another_file_is_not_continued() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trajectory");
        let mut writer = TableWriter::create_lasting(&path, TRAJECTORY_HEADER).unwrap();
        writer.frame(frame(0.0)).unwrap();
        let beginning = writer.beginning();
        drop(writer);
        let part = part_of(&path);
        let mut bytes = std::fs::read(&part).unwrap();
        bytes[30] ^= 1;
        std::fs::write(&part, &bytes).unwrap();
        let error = TableWriter::resume(&path, beginning).unwrap_err();
        assert!(matches!(error, ContinueError::Changed { .. }));
        std::fs::write(&part, &bytes[..20]).unwrap();
        let error = TableWriter::resume(&path, beginning).unwrap_err();
        assert!(matches!(error, ContinueError::Changed { .. }));
        std::fs::remove_file(&part).unwrap();
        let error = TableWriter::resume(&path, beginning).unwrap_err();
        assert!(matches!(error, ContinueError::File(_)));
    }
}
