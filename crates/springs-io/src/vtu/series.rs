//! A folder of numbered files that grows during a run, with a list of them.

use super::{FOLDER, LIST};
use crate::atomic::{DRAFT, Draft, WriteError, failure};
use crate::growing::{ContinueError, as_text, part_name, part_of};
use crate::sink::{Mark, Written};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const LIST_START: &str = "<?xml version=\"1.0\"?>\n\
    <VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>\n";
const LIST_END: &str = "</Collection>\n</VTKFile>\n";
const TIME_START: &str = "<FieldData>\n<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">";
const TIME_END: &str = "</DataArray>\n</FieldData>\n";
/// Bytes of a file in which its time is.
const HEAD: usize = 512;

/// A folder to which files are added, one a frame. It gets its name when it is
/// finished, and its list moves out of it then, to stand beside it.
///
/// Files that find no room on the disk are kept in memory and written by the next call
/// that can.
pub(super) struct GrowingSeries {
    /// Where it will be.
    path: PathBuf,
    /// Where it is.
    folder: PathBuf,
    /// The folder, as long as it goes when it is neither kept nor finished.
    draft: Option<TempDir>,
    list: List,
    n_files: usize,
    /// Those that are on the disk for sure.
    n_kept: usize,
    /// Of all files one after the other.
    sum: crc32fast::Hasher,
    n_bytes: u64,
    unwritten: Vec<FileBytes>,
}

/// How far a [`GrowingSeries`] is written.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SeriesMark {
    files: usize,
    bytes: u64,
    sum: u32,
    unwritten: Vec<FileBytes>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
struct FileBytes(#[serde(with = "as_text")] Vec<u8>);

/// A folder that begins as a [`SeriesMark`] says, not yet changed.
pub(super) struct FoundSeries {
    path: PathBuf,
    /// It has not got its name yet, and is continued in place.
    is_part: bool,
    mark: SeriesMark,
}

impl GrowingSeries {
    /// Starts the folder that will be at `path`; nothing is left of it if it is neither
    /// kept nor finished.
    pub(super) fn begin(path: &Path) -> Result<Self, WriteError> {
        let draft = draft_of(path)?;
        Self::with(path, draft.path().to_owned(), Some(draft), 0)
    }

    fn with(
        path: &Path,
        folder: PathBuf,
        draft: Option<TempDir>,
        n_files: usize,
    ) -> Result<Self, WriteError> {
        Ok(Self {
            path: path.to_owned(),
            list: List::begin(&folder, n_files)?,
            folder,
            draft,
            n_files,
            n_kept: 0,
            sum: crc32fast::Hasher::new(),
            n_bytes: 0,
            unwritten: Vec::new(),
        })
    }

    /// Finds a kept or finished folder that begins as `mark` says. Nothing is changed.
    pub(super) fn find(path: &Path, mark: &Mark) -> Result<FoundSeries, ContinueError> {
        let mark: SeriesMark = mark.read(LIST)?;
        let is_part = match check(&part_of(path), &mark) {
            Ok(()) => true,
            Err(unfit) => {
                check(path, &mark).map_err(|error| unfit.or_if_missing(error))?;
                false
            }
        };
        Ok(FoundSeries {
            path: path.to_owned(),
            is_part,
            mark,
        })
    }

    /// Adds a file.
    pub(super) fn append(&mut self, bytes: Vec<u8>) -> Result<(), WriteError> {
        self.unwritten.push(FileBytes(bytes));
        self.flush()
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        while let Some(FileBytes(bytes)) = self.unwritten.first() {
            let path = self.folder.join(file_name(self.n_files));
            if let Err(source) = std::fs::write(&path, bytes) {
                // Half a file helps nobody. If it stays, no list has it.
                let _ = std::fs::remove_file(&path);
                return Err(WriteError { path, source });
            }
            self.list.append(&entry("", self.n_files, time_of(bytes)))?;
            self.sum.update(bytes);
            self.n_bytes += bytes.len() as u64;
            self.n_files += 1;
            self.unwritten.remove(0);
        }
        Ok(())
    }

    fn name_part(&mut self) -> Result<(), WriteError> {
        let Some(draft) = &self.draft else {
            return Ok(());
        };
        let part = part_of(&self.path);
        remove_series(&part);
        std::fs::rename(draft.path(), &part).map_err(failure(&part))?;
        // It is no longer where it would be removed from.
        let _ = self.draft.take().map(TempDir::keep);
        self.folder = part;
        Ok(())
    }

    /// Completes the folder and its list; older ones of their names are replaced. On the
    /// way, either folder has a list of its own.
    pub(super) fn finish(mut self) -> Result<(), WriteError> {
        self.flush()?;
        self.name_part()?;
        let mut list = Draft::begin(&self.path.with_file_name(LIST))?;
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let folder = &self.folder;
        list.write_by(|out| write_list(folder, self.n_files, &format!("{name}/"), out))?;
        remove_series(&self.path);
        std::fs::rename(folder, &self.path).map_err(failure(&self.path))?;
        list.finish()?;
        // One that cannot be removed is right all the same.
        let _ = std::fs::remove_file(self.path.join(LIST));
        Ok(())
    }
}

impl Written for GrowingSeries {
    fn n_unwritten(&self) -> usize {
        self.unwritten.iter().map(|file| file.0.len()).sum()
    }

    /// Under the name with `.part` added. An older folder of that name is replaced.
    fn keep(&mut self) -> Result<Vec<String>, WriteError> {
        self.name_part()?;
        for index in self.n_kept..self.n_files {
            let path = self.folder.join(file_name(index));
            let synced = File::open(&path).and_then(|file| file.sync_data());
            synced.map_err(failure(&path))?;
            self.n_kept = index + 1;
        }
        self.list.keep()?;
        Ok(vec![part_name(FOLDER)])
    }

    fn mark(&self) -> Mark {
        Mark::of(&SeriesMark {
            files: self.n_files,
            bytes: self.n_bytes,
            sum: self.sum.clone().finalize(),
            unwritten: self.unwritten.clone(),
        })
    }
}

impl FoundSeries {
    /// Goes on with the folder; what was written after the mark is written anew. A
    /// finished folder stays as it is until the new one is finished.
    pub(super) fn go_on(self) -> Result<GrowingSeries, WriteError> {
        let Self {
            path,
            is_part,
            mark,
        } = self;
        let (folder, draft) = if is_part {
            let folder = part_of(&path);
            cut(&folder, mark.files).map_err(failure(&folder))?;
            (folder, None)
        } else {
            let draft = draft_of(&path)?;
            for index in 0..mark.files {
                let (from, to) = (file_name(index), draft.path().join(file_name(index)));
                // Frames never change once they are written.
                let linked = std::fs::hard_link(path.join(&from), &to);
                let there = linked.or_else(|_| std::fs::copy(path.join(from), &to).map(|_| ()));
                there.map_err(failure(&to))?;
            }
            (draft.path().to_owned(), Some(draft))
        };
        let mut series = GrowingSeries::with(&path, folder, draft, mark.files)?;
        series.sum = crc32fast::Hasher::new_with_initial_len(mark.sum, mark.bytes);
        series.n_bytes = mark.bytes;
        series.unwritten = mark.unwritten;
        series.flush()?;
        Ok(series)
    }
}

fn draft_of(path: &Path) -> Result<TempDir, WriteError> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(DRAFT);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // As any new folder; the process's mask applies.
        builder.permissions(std::fs::Permissions::from_mode(0o777));
    }
    let parent = path.parent().unwrap_or(Path::new("."));
    builder.tempdir_in(parent).map_err(failure(path))
}

/// Whether a folder begins so.
fn check(folder: &Path, mark: &SeriesMark) -> Result<(), ContinueError> {
    let changed = || ContinueError::Changed {
        path: folder.to_owned(),
    };
    let (mut sum, mut n_bytes) = (crc32fast::Hasher::new(), 0);
    for index in 0..mark.files {
        let path = folder.join(file_name(index));
        let read = std::fs::read(&path);
        let bytes = read.map_err(|error| ContinueError::of_reading(&path, error))?;
        sum.update(&bytes);
        n_bytes += bytes.len() as u64;
        if n_bytes > mark.bytes {
            return Err(changed());
        }
    }
    if !folder.is_dir() {
        let path = folder.to_owned();
        return Err(ContinueError::Missing { path });
    }
    if (n_bytes, sum.finalize()) != (mark.bytes, mark.sum) {
        return Err(changed());
    }
    Ok(())
}

/// The list in the folder of a series. After each entry it is whole.
struct List {
    path: PathBuf,
    file: File,
    /// Where the next entry begins.
    end: u64,
}

impl List {
    /// Writes the list of so many files that are there.
    fn begin(folder: &Path, n_files: usize) -> Result<Self, WriteError> {
        let path = folder.join(LIST);
        let written = File::create(&path).and_then(|mut file| {
            let mut out = io::BufWriter::new(&mut file);
            write_list(folder, n_files, "", &mut out)?;
            out.flush()?;
            drop(out);
            let end = file.stream_position()? - LIST_END.len() as u64;
            Ok((file, end))
        });
        let (file, end) = written.map_err(failure(&path))?;
        Ok(Self { path, file, end })
    }

    /// Adds an entry in one go, or nothing.
    fn append(&mut self, entry: &str) -> Result<(), WriteError> {
        let text = format!("{entry}{LIST_END}");
        let start = SeekFrom::Start(self.end);
        let file = &mut self.file;
        let written = file
            .seek(start)
            .and_then(|_| file.write_all(text.as_bytes()));
        if let Err(source) = written {
            // What was there fits there.
            let again = file.seek(start);
            let _ = again.and_then(|_| file.write_all(LIST_END.as_bytes()));
            let _ = file.set_len(self.end + LIST_END.len() as u64);
            let path = self.path.clone();
            return Err(WriteError { path, source });
        }
        self.end += entry.len() as u64;
        Ok(())
    }

    fn keep(&self) -> Result<(), WriteError> {
        self.file.sync_data().map_err(failure(&self.path))
    }
}

/// Writes the list of so many files in a folder, with this before their names.
fn write_list(folder: &Path, n_files: usize, prefix: &str, out: &mut impl Write) -> io::Result<()> {
    out.write_all(LIST_START.as_bytes())?;
    for index in 0..n_files {
        let mut head = Vec::new();
        let file = File::open(folder.join(file_name(index)))?;
        file.take(HEAD as u64).read_to_end(&mut head)?;
        out.write_all(entry(prefix, index, time_of(&head)).as_bytes())?;
    }
    out.write_all(LIST_END.as_bytes())
}

fn entry(prefix: &str, index: usize, time: &str) -> String {
    let name = file_name(index);
    format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{prefix}{name}\"/>\n")
}

fn file_name(index: usize) -> String {
    format!("{index:05}{EXTENSION}")
}

const EXTENSION: &str = ".vtu";

/// The time of a frame in its file; one of the first elements.
pub(super) fn time_element(time: f64) -> String {
    format!("{TIME_START}{time:?}{TIME_END}")
}

/// The time in a file that has a [`time_element`], as it is written.
fn time_of(bytes: &[u8]) -> &str {
    let head = &bytes[..bytes.len().min(HEAD)];
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        // Numbers begin there.
        Err(error) => std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default(),
    };
    let after = text.split_once(TIME_START).map(|(_, after)| after);
    let time = after.and_then(|after| after.split_once(TIME_END));
    time.map_or("", |(time, _)| time)
}

/// The number of a file of a series.
fn index_of(name: &str) -> Option<usize> {
    let index = name.strip_suffix(EXTENSION)?.parse().ok()?;
    (file_name(index) == name).then_some(index)
}

/// Removes the files of a series from this number on.
fn cut(folder: &Path, n_files: usize) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let index = index_of(&entry.file_name().to_string_lossy());
        if index.is_some_and(|index| index >= n_files) {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

/// Removes a folder of numbered frames with its list. If there is anything else in the
/// folder, that stays with it; what cannot be removed stays, too.
pub fn remove_series(folder: &Path) {
    let _ = std::fs::remove_file(folder.join(LIST));
    if cut(folder, 0).is_ok() {
        let _ = std::fs::remove_dir(folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(time: f64) -> Vec<u8> {
        [time_element(time).as_bytes(), &[200, 255]].concat()
    }

    fn list(path: &Path) -> Vec<String> {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(
            text.starts_with(LIST_START) && text.ends_with(LIST_END),
            "{text}"
        );
        let entries = text.lines().filter(|line| line.starts_with("<DataSet"));
        entries.map(str::to_owned).collect()
    }

    /// The program may be killed after any of these lines.
    #[test]
    fn the_list_is_whole_at_any_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames/");
        let mut series = GrowingSeries::begin(&path).unwrap();
        for n in 0..3 {
            assert_eq!(list(&series.folder.join(LIST)).len(), n);
            series.append(file(n as f64)).unwrap();
        }
        series.keep().unwrap();
        let part = folder.path().join("frames.part");
        assert_eq!(series.folder, part);
        assert_eq!(
            list(&part.join(LIST))[2],
            "<DataSet timestep=\"2.0\" part=\"0\" file=\"00002.vtu\"/>"
        );
        series.append(file(3.0)).unwrap();
        series.finish().unwrap();
        assert_eq!(
            list(&folder.path().join(LIST))[3],
            "<DataSet timestep=\"3.0\" part=\"0\" file=\"frames/00003.vtu\"/>"
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 4);
    }

    #[test]
    fn an_older_folder_stays_until_the_new_one_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames/");
        let series_of = |times: &[f64]| {
            let mut series = GrowingSeries::begin(&path).unwrap();
            for &time in times {
                series.append(file(time)).unwrap();
            }
            series
        };
        series_of(&[0.0, 1.0]).finish().unwrap();
        let new = series_of(&[7.0]);
        assert_eq!(list(&folder.path().join(LIST)).len(), 2);
        assert_eq!(std::fs::read(path.join("00000.vtu")).unwrap(), file(0.0));
        new.finish().unwrap();
        assert_eq!(list(&folder.path().join(LIST)).len(), 1);
        assert_eq!(std::fs::read(path.join("00000.vtu")).unwrap(), file(7.0));
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 1);
    }

    /// Nothing but frames is ever removed.
    #[test]
    fn a_folder_with_other_things_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames/");
        std::fs::create_dir(&path).unwrap();
        for name in ["00000.vtu", "1.vtu", "00000.png"] {
            std::fs::write(path.join(name), "").unwrap();
        }
        let mut series = GrowingSeries::begin(&path).unwrap();
        series.append(file(0.0)).unwrap();
        let mark = series.mark();
        let error = series.finish().unwrap_err();
        assert_eq!(error.path, path);
        let mut left: Vec<_> = std::fs::read_dir(&path)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["00000.png", "1.vtu"]);
        // The new one was kept, and goes on.
        let found = GrowingSeries::find(&path, &mark).unwrap();
        assert!(found.is_part);
        std::fs::remove_dir_all(&path).unwrap();
        found.go_on().unwrap().finish().unwrap();
        assert_eq!(std::fs::read(path.join("00000.vtu")).unwrap(), file(0.0));
    }

    #[test]
    fn frames_that_cannot_be_written_are_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames/");
        let mut series = GrowingSeries::begin(&path).unwrap();
        series.append(file(0.0)).unwrap();
        series.keep().unwrap();
        let obstacle = part_of(&path).join("00001.vtu");
        std::fs::create_dir(&obstacle).unwrap();
        for n in 1..3 {
            assert!(series.append(file(f64::from(n))).is_err());
        }
        assert_eq!(series.n_unwritten(), file(1.0).len() + file(2.0).len());
        assert_eq!(list(&part_of(&path).join(LIST)).len(), 1);
        let mark = serde_json::to_string(&series.mark()).unwrap();
        drop(series);
        std::fs::remove_dir(&obstacle).unwrap();
        let mark = serde_json::from_str(&mark).unwrap();
        let found = GrowingSeries::find(&path, &mark).unwrap();
        found.go_on().unwrap().finish().unwrap();
        assert_eq!(list(&folder.path().join(LIST)).len(), 3);
        assert_eq!(std::fs::read(path.join("00002.vtu")).unwrap(), file(2.0));
    }

    #[test]
    fn another_folder_is_not_continued() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames/");
        let mut series = GrowingSeries::begin(&path).unwrap();
        series.append(file(0.0)).unwrap();
        series.keep().unwrap();
        let mark = || series.mark();
        let first = part_of(&path).join("00000.vtu");
        std::fs::write(&first, file(1.0)).unwrap();
        let error = GrowingSeries::find(&path, &mark()).err().unwrap();
        assert!(matches!(error, ContinueError::Changed { .. }), "{error}");
        std::fs::remove_file(&first).unwrap();
        let error = GrowingSeries::find(&path, &mark()).err().unwrap();
        assert!(matches!(error, ContinueError::Missing { .. }), "{error}");
    }
}
