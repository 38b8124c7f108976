//! Files that appear whole or not at all.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

/// How the names of unfinished files and folders begin.
pub(crate) const DRAFT: &str = ".springs-";

/// A file that grows under another name until it is complete.
#[derive(Debug)]
pub(crate) struct Draft {
    path: PathBuf,
    file: NamedTempFile,
}

impl Draft {
    /// Starts the file that will be at `path`, in the same folder.
    pub(crate) fn begin(path: &Path) -> Result<Self, WriteError> {
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(DRAFT);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // As any new file; the process's mask applies.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        match builder.tempfile_in(folder) {
            Ok(file) => Ok(Self {
                path: path.to_owned(),
                file,
            }),
            Err(source) => Err(failure(path)(source)),
        }
    }

    /// Appends bytes.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.file.write_all(bytes).map_err(failure(&self.path))
    }

    /// Appends what `write` writes, in few pieces.
    pub(crate) fn write_by(
        &mut self,
        write: impl FnOnce(&mut io::BufWriter<&mut File>) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        let mut buffer = io::BufWriter::new(self.file.as_file_mut());
        let written = write(&mut buffer).and_then(|()| buffer.flush());
        drop(buffer);
        written.map_err(failure(&self.path))
    }

    /// Appends so many bytes of another file.
    pub(crate) fn append(&mut self, source: &mut File, bytes: u64) -> Result<(), WriteError> {
        let copied = io::copy(&mut io::Read::take(source, bytes), &mut self.file);
        copied.map(|_| ()).map_err(failure(&self.path))
    }

    /// [`Self::finish`] with all bytes on the disk before the file gets its name.
    pub(crate) fn finish_on_disk(self) -> Result<(), WriteError> {
        match self.file.as_file().sync_all() {
            Ok(()) => self.finish(),
            Err(source) => Err(failure(&self.path)(source)),
        }
    }

    /// Gives the file its name; an older one of that name is replaced.
    pub(crate) fn finish(self) -> Result<(), WriteError> {
        let persisted = self.file.persist(&self.path);
        persisted
            .map(|_| ())
            .map_err(|error| failure(&self.path)(error.error))
    }

    /// The file, and the name under which it is gone when that is dropped.
    pub(crate) fn into_parts(self) -> (File, TempPath) {
        self.file.into_parts()
    }
}

/// The error of a file.
pub(crate) fn failure(path: &Path) -> impl Fn(io::Error) -> WriteError {
    let path = path.to_owned();
    move |source| WriteError {
        path: path.clone(),
        source,
    }
}

/// Writes a file in one go.
///
/// # Errors
///
/// If it cannot be written; an older file of that name is then untouched.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let mut draft = Draft::begin(path)?;
    draft.write(bytes)?;
    draft.finish()
}

/// Whether a file could be written at `path`; nothing is left of the attempt.
///
/// # Errors
///
/// If it could not, for want of a right or of the folder.
pub fn try_to_write(path: &Path) -> Result<(), WriteError> {
    Draft::begin(path).map(|_| ())
}

/// Removes the unfinished files and folders that programs which were killed have left
/// in a folder. Nobody may be writing into it. What cannot be removed stays.
pub fn remove_drafts(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries {
        if entry.file_name().to_string_lossy().starts_with(DRAFT) {
            let path = entry.path();
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unfinished_file_leaves_the_old_one_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result");
        write_whole(&path, b"old").unwrap();
        let mut draft = Draft::begin(&path).unwrap();
        draft.write(b"half of the ne").unwrap();
        drop(draft);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn drafts_of_killed_programs_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["result", ".springs-Qx3bZf", ".springs-0", ".other"] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        remove_drafts(folder.path());
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, [".other", "result"]);
        remove_drafts(Path::new("/no/such/folder"));
    }

    #[test]
    fn an_attempt_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        try_to_write(&folder.path().join("result")).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(try_to_write(Path::new("/no/such/folder/file")).is_err());
    }

    #[test]
    fn errors_name_the_file() {
        let error = write_whole(Path::new("/no/such/folder/file"), b"").unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("cannot write /no/such/folder/file: "),
            "{text}"
        );
    }
}
