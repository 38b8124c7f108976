//! Checkpoints: what a run has come to, in one checked file.

use crate::atomic::{Draft, WriteError};
use std::io;
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
    /// The file is no sound checkpoint.
    #[error("{} {fault}", path.display())]
    Unsound {
        /// The file.
        path: PathBuf,
        /// Why.
        fault: CheckpointFault,
    },
}

/// Bytes are no sound checkpoint; the words go on after what the bytes are called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointFault {
    /// They are something else.
    #[error("is not a checkpoint")]
    NoCheckpoint,
    /// Another version of this program wrote them.
    #[error("has version {found} of checkpoints, but this program reads version {VERSION}")]
    OtherVersion {
        /// Their version.
        found: u32,
    },
    /// They are cut off, or something in them has changed.
    #[error("is damaged: it is cut off, or something in it has changed")]
    Damaged,
}

/// How every checkpoint begins; then come its version, the check sum of the
/// rest, the length of `about` in bytes, `about`, and the words, all
/// little-endian.
const MAGIC: &[u8] = b"springs checkpoint\n";
const VERSION: u32 = 12;
/// Bytes of the check sum, and those before what it is of.
const SUM: usize = 4;
const BODY: usize = MAGIC.len() + 4 + SUM;

impl Checkpoint {
    /// As it stands in a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let Self { about, words } = self;
        let mut bytes = Vec::with_capacity(BODY + 8 + about.len() + 8 * words.len());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend([0; SUM]);
        bytes.extend((about.len() as u64).to_le_bytes());
        bytes.extend(about.bytes());
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        let sum = crc32fast::hash(&bytes[BODY..]).to_le_bytes();
        bytes[BODY - SUM..BODY].copy_from_slice(&sum);
        bytes
    }

    /// From the bytes of a file.
    ///
    /// # Errors
    ///
    /// If they are no sound checkpoint of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointFault> {
        use CheckpointFault::{Damaged, NoCheckpoint, OtherVersion};
        let rest = bytes.strip_prefix(MAGIC).ok_or(NoCheckpoint)?;
        let (version, rest) = rest.split_first_chunk().ok_or(Damaged)?;
        let found = u32::from_le_bytes(*version);
        if found != VERSION {
            return Err(OtherVersion { found });
        }
        let (sum, body) = rest.split_first_chunk::<SUM>().ok_or(Damaged)?;
        if crc32fast::hash(body) != u32::from_le_bytes(*sum) {
            return Err(Damaged);
        }
        let (length, rest) = body.split_first_chunk().ok_or(Damaged)?;
        let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| Damaged)?;
        let (about, words) = rest.split_at_checked(length).ok_or(Damaged)?;
        let (words, rest) = words.as_chunks();
        if !rest.is_empty() {
            return Err(Damaged);
        }
        Ok(Self {
            about: String::from_utf8(about.to_vec()).map_err(|_| Damaged)?,
            words: words.iter().map(|word| u64::from_le_bytes(*word)).collect(),
        })
    }
}

/// Writes a checkpoint, whole or not at all; it is on the disk when this
/// returns.
///
/// # Errors
///
/// If it cannot be written; an older one is then untouched.
pub fn write_checkpoint(path: &Path, checkpoint: &Checkpoint) -> Result<(), WriteError> {
    let mut draft = Draft::begin(path)?;
    draft.write(&checkpoint.to_bytes())?;
    draft.finish_on_disk()
}

/// Reads a checkpoint.
///
/// # Errors
///
/// If the file cannot be read or is not a sound checkpoint of this version.
pub fn read_checkpoint(path: &Path) -> Result<Checkpoint, CheckpointError> {
    let own_path = || path.to_owned();
    let bytes = std::fs::read(path).map_err(|source| CheckpointError::Unreadable {
        path: own_path(),
        source,
    })?;
    Checkpoint::from_bytes(&bytes).map_err(|fault| CheckpointError::Unsound {
        path: own_path(),
        fault,
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
            Err(CheckpointError::Unsound {
                fault: CheckpointFault::Damaged,
                ..
            })
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
        let fault_of = |error| match error {
            CheckpointError::Unsound { fault, .. } => Some(fault),
            _ => None,
        };
        assert_eq!(fault_of(other), Some(CheckpointFault::NoCheckpoint));
        write_checkpoint(&path, &checkpoint()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[MAGIC.len()] = 200;
        std::fs::write(&path, &bytes).unwrap();
        let version = read_checkpoint(&path).unwrap_err();
        let other = CheckpointFault::OtherVersion { found: 200 };
        assert_eq!(fault_of(version), Some(other));
    }
}
