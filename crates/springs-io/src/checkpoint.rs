//! Checkpoints: what a run has come to, in one checked file.

use crate::atomic::{Draft, WriteError};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// What a run needs to go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoint {
    /// What run it is, in words of the writer's own.
    pub about: String,
    /// Its state, bit by bit.
    pub words: Vec<u64>,
}

/// A checkpoint could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{} is not a checkpoint", path.display())]
    NoCheckpoint {
        /// The file.
        path: PathBuf,
    },
    /// Another version of this program wrote it.
    #[error("{} has version {found} of checkpoints, but this program reads version {VERSION}", path.display())]
    OtherVersion {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// The file is cut off, or something in it has changed.
    #[error("{} is damaged: it is cut off, or something in it has changed", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
    },
}

/// How every checkpoint begins; then come its version, the check sum of the
/// rest, the length of `about` in bytes, `about`, and the words, all
/// little-endian.
const MAGIC: &[u8] = b"springs checkpoint\n";
const VERSION: u32 = 6;

/// Writes a checkpoint, whole or not at all; it is on the disk when this
/// returns.
///
/// # Errors
///
/// If it cannot be written; an older one is then untouched.
pub fn write_checkpoint(path: &Path, checkpoint: &Checkpoint) -> Result<(), WriteError> {
    let Checkpoint { about, words } = checkpoint;
    let mut body = Vec::with_capacity(8 + about.len() + 8 * words.len());
    body.extend((about.len() as u64).to_le_bytes());
    body.extend(about.bytes());
    body.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    let mut draft = Draft::begin(path)?;
    draft.write(MAGIC)?;
    draft.write(&VERSION.to_le_bytes())?;
    draft.write(&crc32fast::hash(&body).to_le_bytes())?;
    draft.write(&body)?;
    draft.finish_on_disk()
}

/// Reads a checkpoint.
///
/// # Errors
///
/// If the file cannot be read or is not a sound checkpoint of this version.
pub fn read_checkpoint(path: &Path) -> Result<Checkpoint, CheckpointError> {
    let own_path = || path.to_owned();
    let mut bytes = Vec::new();
    let read = std::fs::File::open(path).and_then(|mut file| file.read_to_end(&mut bytes));
    read.map_err(|source| CheckpointError::Unreadable {
        path: own_path(),
        source,
    })?;
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        return Err(CheckpointError::NoCheckpoint { path: own_path() });
    };
    let damaged = || CheckpointError::Damaged { path: own_path() };
    let (version, rest) = rest.split_first_chunk().ok_or_else(damaged)?;
    let found = u32::from_le_bytes(*version);
    if found != VERSION {
        return Err(CheckpointError::OtherVersion {
            path: own_path(),
            found,
        });
    }
    let (sum, body) = rest.split_first_chunk().ok_or_else(damaged)?;
    if crc32fast::hash(body) != u32::from_le_bytes(*sum) {
        return Err(damaged());
    }
    let (length, rest) = body.split_first_chunk().ok_or_else(damaged)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| damaged())?;
    let (about, words) = rest.split_at_checked(length).ok_or_else(damaged)?;
    let (words, rest) = words.as_chunks();
    if !rest.is_empty() {
        return Err(damaged());
    }
    Ok(Checkpoint {
        about: String::from_utf8(about.to_vec()).map_err(|_| damaged())?,
        words: words.iter().map(|word| u64::from_le_bytes(*word)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checkpoint() -> Checkpoint {
        Checkpoint {
            about: "a run".to_owned(),
            words: vec![0, 1, u64::MAX, (-0.0f64).to_bits()],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write_checkpoint(&path, &checkpoint()).unwrap();
        assert_eq!(read_checkpoint(&path).unwrap(), checkpoint());
    }

    /// Cut off anywhere, or with any bit flipped.
    #[test]
    fn damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write_checkpoint(&path, &checkpoint()).unwrap();
        let sound = std::fs::read(&path).unwrap();
        for length in 0..sound.len() {
            std::fs::write(&path, &sound[..length]).unwrap();
            assert!(read_checkpoint(&path).is_err(), "{length} bytes");
        }
        for bit in 0..8 * sound.len() {
            let mut bytes = sound.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &bytes).unwrap();
            assert!(read_checkpoint(&path).is_err(), "bit {bit}");
        }
        std::fs::write(&path, [&sound[..], b"more"].concat()).unwrap();
        assert!(matches!(
            read_checkpoint(&path),
            Err(CheckpointError::Damaged { .. })
        ));
    }

    #[test]
    fn other_files_and_versions_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        let missing = read_checkpoint(&path).unwrap_err();
        assert!(matches!(missing, CheckpointError::Unreadable { .. }));
        std::fs::write(&path, b"Scene(").unwrap();
        let other = read_checkpoint(&path).unwrap_err();
        assert!(matches!(other, CheckpointError::NoCheckpoint { .. }));
        write_checkpoint(&path, &checkpoint()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[MAGIC.len()] = 9;
        std::fs::write(&path, &bytes).unwrap();
        let version = read_checkpoint(&path).unwrap_err();
        assert!(matches!(
            version,
            CheckpointError::OtherVersion { found: 9, .. }
        ));
    }
}
