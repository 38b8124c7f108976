//! Files that grow during a run, and can be continued by another one.

use crate::atomic::{Draft, WriteError, failure};
use crate::sink::{Mark, Written};
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// A file to which bytes are appended. It gets its name when it is finished.
///
/// Bytes that find no room on the disk are kept in memory and written by the
/// next call that can.
#[derive(Debug)]
pub struct GrowingFile {
    path: PathBuf,
    file: File,
    /// The name under which it is gone if it is not finished; without one it has
    /// its own with `.part` added, which stays.
    draft: Option<TempPath>,
    /// Bytes that are not written yet.
    buffer: Vec<u8>,
    /// Length of what it begins with that changes as it grows.
    n_header: u64,
    /// Of what is after that.
    sum: crc32fast::Hasher,
    n_bytes: u64,
}

/// How far a [`GrowingFile`] is written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileMark {
    /// Its length, without a header that changes.
    #[serde(rename = "bytes")]
    pub(crate) n_bytes: u64,
    /// Its check sum, CRC-32.
    pub(crate) sum: u32,
    /// Bytes that did not find room.
    #[serde(with = "as_text")]
    pub(crate) unwritten: Vec<u8>,
}

/// A file that begins as a [`FileMark`] says, not yet changed.
#[derive(Debug)]
pub struct FoundFile {
    path: PathBuf,
    file: File,
    /// It has not got its name yet, and is continued in place.
    is_part: bool,
    n_header: u64,
    mark: FileMark,
}

/// An output cannot be continued.
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
    /// Its mark is none of this output.
    #[error("what it says of {file} cannot be read: {source}")]
    Mark {
        /// Name of the file.
        file: &'static str,
        /// Why.
        source: serde_json::Error,
    },
    /// Its mark is sound, but no run of this scene can have left it.
    #[error("what it says of {file} is not of this scene")]
    OtherScene {
        /// Name of the file.
        file: &'static str,
    },
    /// There is no such output.
    #[error("it writes `{name}`, which is not known here")]
    Unknown {
        /// Name of the output.
        name: String,
    },
}

impl ContinueError {
    /// A file that is gone, or cannot be read.
    pub(crate) fn of_reading(path: &Path, error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::NotFound => Self::Missing {
                path: path.to_owned(),
            },
            _ => failure(path)(error).into(),
        }
    }

    /// What to say where an unfinished file is unfit, and the finished one, too.
    pub(crate) fn or_if_missing(self, finished: Self) -> Self {
        match self {
            Self::Missing { .. } => finished,
            unfit => unfit,
        }
    }
}

impl GrowingFile {
    /// Starts the file that will be at `path`; nothing is left of it if it is
    /// neither kept nor finished.
    ///
    /// # Errors
    ///
    /// If it cannot be made.
    pub fn begin(path: &Path) -> Result<Self, WriteError> {
        let (file, draft) = Draft::begin(path)?.into_parts();
        Ok(Self {
            path: path.to_owned(),
            file,
            draft: Some(draft),
            buffer: Vec::new(),
            n_header: 0,
            sum: crc32fast::Hasher::new(),
            n_bytes: 0,
        })
    }

    /// [`Self::begin`] with a header, which may [change](Self::set_header) but not grow.
    pub(crate) fn begin_with_header(path: &Path, header: &[u8]) -> Result<Self, WriteError> {
        let mut growing = Self::begin(path)?;
        growing.n_header = header.len() as u64;
        growing.set_header(header)?;
        Ok(growing)
    }

    /// Writes another header of the same length.
    pub(crate) fn set_header(&mut self, header: &[u8]) -> Result<(), WriteError> {
        let file = &mut self.file;
        let written = file.rewind().and_then(|()| file.write_all(header));
        let end = SeekFrom::Start(self.n_header + self.n_bytes);
        // What is appended goes there, also if this one could not be written.
        let back = file.seek(end);
        written.and(back).map(drop).map_err(failure(&self.path))
    }

    /// Finds a kept or finished file that begins as `mark` says. Nothing is
    /// changed.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is missing, or begins otherwise.
    pub fn find(path: &Path, mark: FileMark) -> Result<FoundFile, ContinueError> {
        Self::find_with_header(path, 0, mark)
    }

    /// [`Self::find`] with a header of so many bytes.
    pub(crate) fn find_with_header(
        path: &Path,
        n_header: u64,
        mark: FileMark,
    ) -> Result<FoundFile, ContinueError> {
        let unfit = match Self::find_part(path, n_header, &mark) {
            Ok(found) => return Ok(found),
            Err(error) => error,
        };
        match open_beginning(path, n_header, &mark) {
            Ok(file) => Ok(FoundFile {
                path: path.to_owned(),
                file,
                is_part: false,
                n_header,
                mark,
            }),
            Err(error) => Err(unfit.or_if_missing(error)),
        }
    }

    /// [`Self::find`] of a file that was kept, not finished.
    pub(crate) fn find_part(
        path: &Path,
        n_header: u64,
        mark: &FileMark,
    ) -> Result<FoundFile, ContinueError> {
        Ok(FoundFile {
            path: path.to_owned(),
            file: open_beginning(&part_of(path), n_header, mark)?,
            is_part: true,
            n_header,
            mark: mark.clone(),
        })
    }

    /// Appends what `write` appends to the bytes that it is given.
    ///
    /// # Errors
    ///
    /// If it cannot be written; it is then kept as [unwritten](Self::n_unwritten).
    pub fn append(&mut self, write: impl FnOnce(&mut Vec<u8>)) -> Result<(), WriteError> {
        write(&mut self.buffer);
        self.flush()
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        if let Err(source) = self.file.write_all(&self.buffer) {
            // Half a row helps nobody. If it stays, nobody reads that far.
            let end = self.n_header + self.n_bytes;
            let _ = self.file.set_len(end);
            let _ = self.file.seek(SeekFrom::Start(end));
            let path = self.path.clone();
            return Err(WriteError { path, source });
        }
        self.sum.update(&self.buffer);
        self.n_bytes += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }

    /// Number of bytes that could not be written so far.
    pub fn n_unwritten(&self) -> usize {
        self.buffer.len()
    }

    /// How far it is written, for [`Self::find`].
    pub fn mark(&self) -> FileMark {
        FileMark {
            n_bytes: self.n_bytes,
            sum: self.sum.clone().finalize(),
            unwritten: self.buffer.clone(),
        }
    }

    /// Makes what is written outlive the program, however it ends, under the name
    /// with `.part` added. An older file of that name is replaced.
    ///
    /// # Errors
    ///
    /// If it cannot be renamed or brought onto the disk. It goes on growing as
    /// before.
    pub fn keep(&mut self) -> Result<(), WriteError> {
        if let Some(draft) = self.draft.take() {
            let part = part_of(&self.path);
            if let Err(error) = draft.persist(&part) {
                self.draft = Some(error.path);
                return Err(failure(&part)(error.error));
            }
        }
        self.file.sync_data().map_err(failure(&self.path))
    }

    /// Completes the file; an older one of its name is replaced.
    ///
    /// # Errors
    ///
    /// If it cannot be given its name.
    pub fn finish(self) -> Result<(), WriteError> {
        let named = match self.draft {
            Some(draft) => draft.persist(&self.path).map_err(|error| error.error),
            None => std::fs::rename(part_of(&self.path), &self.path),
        };
        named.map_err(failure(&self.path))
    }

    /// Completes the file with other contents, which `write` makes of what has grown;
    /// that is removed then.
    ///
    /// # Errors
    ///
    /// If they cannot be written; what has grown is then kept, if that is possible.
    pub(crate) fn finish_as(
        mut self,
        write: impl FnOnce(&mut File, &mut BufWriter<&mut File>) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        let made = self.flush().and_then(|()| {
            let mut contents = Draft::begin(&self.path)?;
            contents.write_by(|out| write(&mut self.file, out))?;
            contents.finish()
        });
        if made.is_err() {
            let _ = self.keep();
        } else if self.draft.is_none() {
            // One that cannot be removed is in nobody's way.
            let _ = std::fs::remove_file(part_of(&self.path));
        }
        made
    }
}

impl Written for GrowingFile {
    fn n_unwritten(&self) -> usize {
        Self::n_unwritten(self)
    }

    fn keep(&mut self) -> Result<Vec<String>, WriteError> {
        Self::keep(self)?;
        let name = self.path.file_name().unwrap_or_default();
        Ok(vec![part_name(&name.to_string_lossy())])
    }

    fn mark(&self) -> Mark {
        Mark::of(&Self::mark(self))
    }
}

impl FoundFile {
    /// Goes on with the file; what was written after the mark is written anew. A
    /// finished file stays as it is until the new one is finished.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn go_on(self) -> Result<GrowingFile, WriteError> {
        let Self {
            path,
            mut file,
            is_part,
            n_header,
            mark,
        } = self;
        let n_bytes = n_header + mark.n_bytes;
        let (file, draft) = if is_part {
            let cut = file.set_len(n_bytes);
            let cut = cut.and_then(|()| file.seek(SeekFrom::Start(n_bytes)));
            cut.map_err(failure(&part_of(&path)))?;
            (file, None)
        } else {
            let mut copy = Draft::begin(&path)?;
            file.rewind().map_err(failure(&path))?;
            copy.append(&mut file, n_bytes)?;
            let (file, draft) = copy.into_parts();
            (file, Some(draft))
        };
        let mut growing = GrowingFile {
            path,
            file,
            draft,
            buffer: mark.unwritten,
            n_header,
            sum: crc32fast::Hasher::new_with_initial_len(mark.sum, mark.n_bytes),
            n_bytes: mark.n_bytes,
        };
        growing.flush()?;
        Ok(growing)
    }
}

/// The name of a file, or of a folder that ends in `/`, that is kept unfinished.
pub fn part_name(name: &str) -> String {
    match name.strip_suffix('/') {
        Some(folder) => format!("{folder}.part/"),
        None => format!("{name}.part"),
    }
}

pub(crate) fn part_of(path: &Path) -> PathBuf {
    // Without a slash at the end.
    let path: PathBuf = path.components().collect();
    let mut name = OsString::from(path);
    name.push(part_name(""));
    name.into()
}

/// Opens a file that begins so after its header.
fn open_beginning(path: &Path, n_header: u64, mark: &FileMark) -> Result<File, ContinueError> {
    let opened = OpenOptions::new().read(true).write(true).open(path);
    let mut file = opened.map_err(|error| ContinueError::of_reading(path, error))?;
    let changed = || ContinueError::Changed {
        path: path.to_owned(),
    };
    file.seek(SeekFrom::Start(n_header))
        .map_err(failure(path))?;
    let (mut sum, mut n_bytes) = (crc32fast::Hasher::new(), 0);
    let mut chunk = vec![0; 1 << 16];
    while n_bytes < mark.n_bytes {
        let wanted = (mark.n_bytes - n_bytes).min(chunk.len() as u64) as usize;
        let n = file.read(&mut chunk[..wanted]).map_err(failure(path))?;
        if n == 0 {
            return Err(changed());
        }
        sum.update(&chunk[..n]);
        n_bytes += n as u64;
    }
    if sum.finalize() == mark.sum {
        Ok(file)
    } else {
        Err(changed())
    }
}

/// Bytes as a text of one character a byte: rows of a table can be read in it.
pub(crate) mod as_text {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    pub(crate) fn serialize<S: Serializer>(bytes: &[u8], to: S) -> Result<S::Ok, S::Error> {
        let text: String = bytes.iter().map(|&byte| char::from(byte)).collect();
        text.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(from)?;
        let bytes: Result<_, _> = text.chars().map(u8::try_from).collect();
        bytes.map_err(|_| D::Error::custom("a character is not a byte"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn append(growing: &mut GrowingFile, text: &str) {
        let written = growing.append(|bytes| bytes.extend(text.bytes()));
        written.unwrap();
    }

    fn resume(path: &Path, mark: FileMark) -> Result<GrowingFile, ContinueError> {
        Ok(GrowingFile::find(path, mark)?.go_on()?)
    }

    #[test]
    fn a_resumed_file_is_that_of_a_run_without_a_stop() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        let mut growing = GrowingFile::begin(&path).unwrap();
        append(&mut growing, "header\n0\n");
        growing.keep().unwrap();
        let mark = growing.mark();
        // This was written after the checkpoint, and the program was killed.
        append(&mut growing, "1, of the program that was killed\n");
        drop(growing);
        let mut growing = resume(&path, mark).unwrap();
        append(&mut growing, "1\n");
        append(&mut growing, "2\n");
        let mark = growing.mark();
        // Interrupted, and finished up to there.
        growing.finish().unwrap();
        let mut growing = resume(&path, mark).unwrap();
        append(&mut growing, "3\n");
        let so_far = std::fs::read_to_string(&path).unwrap();
        assert_eq!(so_far, "header\n0\n1\n2\n", "until it is finished");
        growing.finish().unwrap();
        let whole = std::fs::read_to_string(&path).unwrap();
        assert_eq!(whole, "header\n0\n1\n2\n3\n");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn another_file_is_not_continued() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        let mut growing = GrowingFile::begin(&path).unwrap();
        append(&mut growing, "header\n0\n");
        growing.keep().unwrap();
        let mark = growing.mark();
        drop(growing);
        let part = part_of(&path);
        for other in ["header\n1\n", "header\n"] {
            std::fs::write(&part, other).unwrap();
            let error = resume(&path, mark.clone()).unwrap_err();
            assert!(matches!(error, ContinueError::Changed { .. }), "{error}");
            assert_eq!(std::fs::read_to_string(&part).unwrap(), other);
        }
        std::fs::remove_file(&part).unwrap();
        let error = resume(&path, mark).unwrap_err();
        assert!(matches!(error, ContinueError::Missing { .. }));
    }

    #[test]
    fn to_find_a_file_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        let mut growing = GrowingFile::begin(&path).unwrap();
        append(&mut growing, "header\n");
        growing.keep().unwrap();
        let mark = growing.mark();
        append(&mut growing, "0\n");
        drop(growing);
        drop(GrowingFile::find(&path, mark.clone()).unwrap());
        let part = part_of(&path);
        assert_eq!(std::fs::read_to_string(&part).unwrap(), "header\n0\n");
        std::fs::rename(&part, &path).unwrap();
        let found = GrowingFile::find(&path, mark).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        drop(found);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "header\n0\n");
    }

    /// The file that was there at the stop was put back.
    #[test]
    fn the_right_file_is_continued_beside_a_wrong_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        let mut growing = GrowingFile::begin(&path).unwrap();
        append(&mut growing, "header\n0\n");
        let mark = growing.mark();
        growing.finish().unwrap();
        std::fs::write(&path, "another").unwrap();
        let error = resume(&path, mark.clone()).unwrap_err();
        assert!(matches!(error, ContinueError::Changed { .. }));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        std::fs::write(part_of(&path), "another").unwrap();
        std::fs::write(&path, "header\n0\n").unwrap();
        let mut growing = resume(&path, mark).unwrap();
        append(&mut growing, "1\n");
        growing.finish().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "header\n0\n1\n");
    }

    /// `/dev/full` takes no byte.
    #[cfg(target_os = "linux")]
    #[test]
    fn bytes_that_cannot_be_written_are_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut growing = GrowingFile::begin(&path).unwrap();
        append(&mut growing, "written");
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let own = std::mem::replace(&mut growing.file, full);
        let written = growing.mark();
        let unwritten = [0, b'"', 200, 255];
        let error = growing.append(|bytes| bytes.extend(unwritten)).unwrap_err();
        assert_eq!(error.path, path);
        assert_eq!(growing.n_unwritten(), 4);
        let mark = growing.mark();
        assert_eq!(
            (mark.n_bytes, mark.sum),
            (written.n_bytes, written.sum),
            "nothing was written"
        );
        growing.file = own;
        growing.keep().unwrap();
        drop(growing);
        let text = serde_json::to_string(&mark).unwrap();
        let mark = serde_json::from_str(&text).unwrap();
        resume(&path, mark).unwrap().finish().unwrap();
        let whole = [&b"written"[..], &unwritten].concat();
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        // What no run has left is no mark.
        let strange = text.replace("written\":\"", "written\":\"≠");
        assert!(serde_json::from_str::<FileMark>(&strange).is_err());
    }

    /// A file that could not be kept still grows, and is kept later.
    #[test]
    fn a_file_that_cannot_be_kept_is_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut growing = GrowingFile::begin(&path).unwrap();
        append(&mut growing, "a");
        let part = part_of(&path);
        std::fs::create_dir(&part).unwrap();
        assert!(growing.keep().is_err());
        append(&mut growing, "b");
        std::fs::remove_dir(&part).unwrap();
        growing.keep().unwrap();
        assert_eq!(std::fs::read_to_string(&part).unwrap(), "ab");
    }
}
