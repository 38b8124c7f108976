//! Tables as CSV: trajectories, energy over time.

use crate::atomic::{Draft, WriteError, failure};
use nalgebra::Vector3;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read as _, Seek as _, SeekFrom, Write as _};
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
    /// Rows that are not written yet.
    buffer: String,
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

impl Growing {
    /// Where the file will be, and the file.
    fn file(&mut self) -> (PathBuf, &mut File) {
        match self {
            Self::Draft(draft) => (draft.path().to_owned(), draft.file()),
            Self::Part { path, file } => (path.clone(), file),
        }
    }
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
    /// It is not there.
    #[error("{} is gone, which the run has begun to write", path.display())]
    Missing {
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
        Self::create(path, header)?.keep()
    }

    /// Makes a table that would be gone if it is not finished a lasting one, as
    /// of [`Self::create_lasting`]. An older one of that name is replaced.
    ///
    /// # Errors
    ///
    /// If it cannot be renamed.
    pub fn keep(self) -> Result<Self, WriteError> {
        let Growing::Draft(draft) = self.growing else {
            return Ok(self);
        };
        let path = draft.path().to_owned();
        let file = draft.finish_as(&part_of(&path))?;
        let growing = Growing::Part { path, file };
        Ok(Self { growing, ..self })
    }

    /// Goes on with a lasting or finished file that begins as one did when it
    /// was stopped; what was written later is written anew. A finished file stays
    /// as it is until the table is finished again.
    ///
    /// # Errors
    ///
    /// If it cannot be read or written, is missing, or begins otherwise. All files
    /// are then untouched.
    pub fn resume(path: &Path, beginning: Beginning) -> Result<Self, ContinueError> {
        let part = part_of(path);
        let growing = match open_beginning(&part, beginning) {
            Ok(mut file) => {
                let (bytes, start) = (beginning.bytes, SeekFrom::Start(beginning.bytes));
                let cut = file.set_len(bytes).and_then(|()| file.seek(start));
                cut.map_err(failure(&part))?;
                let path = path.to_owned();
                Growing::Part { path, file }
            }
            Err(unfit) => match (open_beginning(path, beginning), unfit) {
                (Ok(mut file), _) => {
                    let mut copy = Draft::begin(path)?;
                    file.rewind().map_err(failure(path))?;
                    copy.append(&mut file, beginning.bytes)?;
                    Growing::Draft(copy)
                }
                (Err(error), ContinueError::Missing { .. }) => return Err(error),
                (Err(_), error) => return Err(error),
            },
        };
        let sum = crc32fast::Hasher::new_with_initial_len(beginning.sum, beginning.bytes);
        Ok(Self {
            growing,
            buffer: String::new(),
            sum,
            bytes: beginning.bytes,
        })
    }

    fn start(growing: Growing, header: &str) -> Result<Self, WriteError> {
        let mut writer = Self {
            growing,
            buffer: format!("{header}\n"),
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
            write!(self.buffer, "{comma}{number:?}").expect("writing to a string");
        }
        self.buffer.push('\n');
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
            .expect("writing to a string");
        }
        self.flush()
    }

    /// Appends rows as text, such as those of [`Self::unwritten`].
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    pub fn append(&mut self, rows: &str) -> Result<(), WriteError> {
        self.buffer.push_str(rows);
        self.flush()
    }

    /// Rows that could not be written so far; the next call tries again. They are
    /// not part of [`Self::beginning`].
    pub fn unwritten(&self) -> &str {
        &self.buffer
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        let (path, file) = self.growing.file();
        if let Err(source) = file.write_all(self.buffer.as_bytes()) {
            // Half a row helps nobody. If it stays, nobody reads that far.
            let _ = file.set_len(self.bytes);
            let _ = file.seek(SeekFrom::Start(self.bytes));
            return Err(WriteError { path, source });
        }
        self.sum.update(self.buffer.as_bytes());
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

/// Opens a file that begins so.
fn open_beginning(path: &Path, beginning: Beginning) -> Result<File, ContinueError> {
    let opened = OpenOptions::new().read(true).write(true).open(path);
    let mut file = opened.map_err(|error| match error.kind() {
        ErrorKind::NotFound => ContinueError::Missing {
            path: path.to_owned(),
        },
        _ => failure(path)(error).into(),
    })?;
    let changed = || ContinueError::Changed {
        path: path.to_owned(),
    };
    let (mut sum, mut bytes) = (crc32fast::Hasher::new(), 0);
    let mut chunk = vec![0; 1 << 16];
    while bytes < beginning.bytes {
        let wanted = (beginning.bytes - bytes).min(chunk.len() as u64) as usize;
        let n = file.read(&mut chunk[..wanted]).map_err(failure(path))?;
        if n == 0 {
            return Err(changed());
        }
        sum.update(&chunk[..n]);
        bytes += n as u64;
    }
    if sum.finalize() == beginning.sum {
        Ok(file)
    } else {
        Err(changed())
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
        assert!(matches!(error, ContinueError::Missing { .. }));
    }

    /// The file that was there at the stop was put back.
    #[test]
    fn the_right_file_is_continued_beside_a_wrong_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trajectory");
        let mut writer = TableWriter::create(&path, TRAJECTORY_HEADER).unwrap();
        writer.frame(frame(0.0)).unwrap();
        let beginning = writer.beginning();
        writer.finish().unwrap();
        let sound = std::fs::read(&path).unwrap();
        std::fs::write(&path, b"another").unwrap();
        let error = TableWriter::resume(&path, beginning).unwrap_err();
        assert!(matches!(error, ContinueError::Changed { .. }));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        std::fs::write(part_of(&path), b"another").unwrap();
        std::fs::write(&path, &sound).unwrap();
        let mut writer = TableWriter::resume(&path, beginning).unwrap();
        writer.frame(frame(1.0)).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), sound, "until it is finished");
        writer.finish().unwrap();
        let longer = std::fs::read(&path).unwrap();
        assert!(longer.len() > sound.len() && longer.starts_with(&sound));
    }

    /// `/dev/full` takes no byte.
    #[cfg(target_os = "linux")]
    #[test]
    fn rows_that_cannot_be_written_are_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trajectory");
        let mut writer = TableWriter::create(&path, TRAJECTORY_HEADER).unwrap();
        writer.frame(frame(0.0)).unwrap();
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let growing = Growing::Part {
            path: path.clone(),
            file: full,
        };
        let own = std::mem::replace(&mut writer.growing, growing);
        let beginning = writer.beginning();
        assert!(writer.frame(frame(1.0)).is_err());
        assert_eq!(writer.beginning(), beginning);
        let rows = writer.unwritten().to_owned();
        assert_eq!(rows.lines().count(), 2);
        writer.growing = own;
        drop(writer.keep().unwrap());
        let mut writer = TableWriter::resume(&path, beginning).unwrap();
        writer.append(&rows).unwrap();
        writer.finish().unwrap();
        let whole = folder.path().join("whole");
        let mut writer = TableWriter::create(&whole, TRAJECTORY_HEADER).unwrap();
        writer.frame(frame(0.0)).unwrap();
        writer.frame(frame(1.0)).unwrap();
        writer.finish().unwrap();
        assert_eq!(
            std::fs::read(&path).unwrap(),
            std::fs::read(&whole).unwrap()
        );
    }
}
