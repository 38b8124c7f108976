//! Files that appear whole or not at all.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

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
        builder.prefix(".springs-");
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
            Err(source) => Err(WriteError {
                path: path.to_owned(),
                source,
            }),
        }
    }

    /// Appends bytes.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.file.write_all(bytes).map_err(|source| WriteError {
            path: self.path.clone(),
            source,
        })
    }

    /// Appends all that is in another file.
    pub(crate) fn append(&mut self, source: &mut File) -> Result<(), WriteError> {
        match io::copy(source, &mut self.file) {
            Ok(_) => Ok(()),
            Err(source) => Err(WriteError {
                path: self.path.clone(),
                source,
            }),
        }
    }

    /// [`Self::finish`] with all bytes on the disk before the file gets its name.
    pub(crate) fn finish_on_disk(self) -> Result<(), WriteError> {
        match self.file.as_file().sync_all() {
            Ok(()) => self.finish(),
            Err(source) => Err(WriteError {
                path: self.path,
                source,
            }),
        }
    }

    /// Gives the file its name; an older one of that name is replaced.
    pub(crate) fn finish(self) -> Result<(), WriteError> {
        let Self { path, file } = self;
        match file.persist(&path) {
            Ok(_) => Ok(()),
            Err(error) => Err(WriteError {
                path,
                source: error.error,
            }),
        }
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
    fn errors_name_the_file() {
        let error = write_whole(Path::new("/no/such/folder/file"), b"").unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("cannot write /no/such/folder/file: "),
            "{text}"
        );
    }
}
