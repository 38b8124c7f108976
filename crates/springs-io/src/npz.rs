//! `trajectory.npz`: all frames as arrays for numpy.
//!
//! Until it is complete the frames are one after the other in a file of plain numbers.
//! Kept as `trajectory.npz.part`, that can be read, too, with numbers n of nodes and k
//! of springs:
//!
//! ```python
//! frame = [("time", "<f8"), ("position", "<f8", (n, 3)), ("velocity", "<f8", (n, 3)),
//!          ("length", "<f8", (k,)), ("tension", "<f8", (k,))]
//! frames = numpy.fromfile("trajectory.npz.part", frame)
//! ```

use crate::atomic::{WriteError, failure};
use crate::frames::{FrameFile, FrameSize, Quantity, append_frame};
use crate::growing::{ContinueError, FileMark, GrowingFile};
use crate::sink::{Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, TrajectoryFrame, Written};
use crate::zip::{ZipWriter, entries};
use springs_scene::Scene;
use std::fs::File;
use std::io::{self, Read as _, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const FILE: &str = Npz::FILE;
/// The array of the nodes of each spring.
const SPRINGS: &str = "springs";

/// The output `npz`: arrays `time` (f), `position` and `velocity` (f, n, 3), `springs`
/// (k, 2), `length` and `tension` (f, k) of f frames, n nodes and k springs, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct Npz;

impl Npz {
    /// The name of its file.
    pub const FILE: &'static str = "trajectory.npz";
}

impl SinkKind for Npz {
    fn name(&self) -> &'static str {
        "npz"
    }

    fn about(&self) -> &'static str {
        "trajectory.npz: nodes and springs at every frame, for numpy"
    }

    fn files(&self) -> Vec<&'static str> {
        vec![FILE]
    }

    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        let file = GrowingFile::begin(&folder.join(FILE))?;
        Ok(Box::new(Frames {
            file,
            size: FrameSize::of(plan.scene),
            springs: spring_nodes(plan.scene),
        }))
    }

    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let path = folder.join(FILE);
        let mark: FileMark = mark.read(FILE)?;
        let size = FrameSize::of(plan.scene);
        let n_bytes = mark.n_bytes + mark.unwritten.len() as u64;
        if !(mark.n_bytes.is_multiple_of(size.n_bytes()) && n_bytes.is_multiple_of(size.n_bytes()))
        {
            return Err(ContinueError::OtherScene { file: FILE });
        }
        let go_on: Box<dyn FnOnce() -> Result<GrowingFile, WriteError>> =
            match GrowingFile::find_part(&path, 0, &mark) {
                Ok(part) => Box::new(|| part.go_on()),
                Err(unfit) => {
                    let found = find_finished(&path, size, &mark);
                    let found = found.map_err(|error| unfit.or_if_missing(error))?;
                    Box::new(move || copy(found, &path, mark))
                }
            };
        let springs = spring_nodes(plan.scene);
        Ok(Box::new(move || {
            Ok(Box::new(Frames {
                file: go_on()?,
                size,
                springs,
            }))
        }))
    }
}

fn spring_nodes(scene: &Scene) -> Vec<[usize; 2]> {
    scene.springs.iter().map(|spring| spring.nodes).collect()
}

/// Finds a finished file that begins as the mark says.
fn find_finished(
    path: &Path,
    size: FrameSize,
    mark: &FileMark,
) -> Result<FrameFile, ContinueError> {
    let changed = || ContinueError::Changed {
        path: path.to_owned(),
    };
    let mut found = match open_npz(path) {
        Ok(found) if found.size == size => found,
        Ok(_) | Err(NpzError::Other { .. }) => return Err(changed()),
        Err(NpzError::Read { source, .. }) => {
            return Err(ContinueError::of_reading(path, source));
        }
    };
    let n_frames = (mark.n_bytes / size.n_bytes()) as usize;
    if found.n_frames < n_frames {
        return Err(changed());
    }
    let (mut sum, mut bytes) = (crc32fast::Hasher::new(), Vec::new());
    for frame in 0..n_frames {
        bytes.clear();
        let read = found.append_frame(frame, &mut bytes);
        read.map_err(failure(path))?;
        sum.update(&bytes);
    }
    if sum.finalize() != mark.sum {
        return Err(changed());
    }
    found.n_frames = n_frames;
    Ok(found)
}

/// Starts a file with all of these frames.
fn copy(mut frames: FrameFile, path: &Path, mark: FileMark) -> Result<GrowingFile, WriteError> {
    let mut file = GrowingFile::begin(path)?;
    for frame in 0..frames.n_frames {
        let mut frame_bytes = Vec::new();
        let read = frames.append_frame(frame, &mut frame_bytes);
        read.map_err(failure(path))?;
        file.append(|bytes| bytes.append(&mut frame_bytes))?;
    }
    file.append(|bytes| bytes.extend(mark.unwritten))?;
    Ok(file)
}

struct Frames {
    file: GrowingFile,
    size: FrameSize,
    springs: Vec<[usize; 2]>,
}

impl Sink for Frames {
    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        match &frame.members {
            Some(members) => self
                .file
                .append(|bytes| append_frame(frame, members, bytes)),
            None => Ok(()),
        }
    }

    fn written(&mut self) -> &mut dyn Written {
        &mut self.file
    }

    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<(), WriteError> {
        let Self {
            file,
            size,
            springs,
        } = *self;
        file.finish_as(|grown, out| {
            let n_frames = (grown.metadata()?.len() / size.n_bytes()) as usize;
            let frames = FrameFile::of_frames(grown.try_clone()?, size, n_frames);
            write_npz(frames, &springs, out)
        })
    }
}

fn write_npz(
    mut frames: FrameFile,
    springs: &[[usize; 2]],
    out: &mut (impl Write + Seek),
) -> io::Result<()> {
    let mut zip = ZipWriter::new(out);
    let (size, n_frames) = (frames.size, frames.n_frames);
    for quantity in Quantity::ALL {
        zip.entry(&format!("{}.npy", quantity.name()), |out| {
            let mut shape = vec![n_frames];
            shape.extend(size.shape(quantity));
            out.write_all(&array_header(FLOATS, &shape))?;
            (0..n_frames).try_for_each(|frame| out.write_all(frames.bytes(quantity, frame)?))
        })?;
    }
    zip.entry(&format!("{SPRINGS}.npy"), |out| {
        out.write_all(&array_header(INTEGERS, &[springs.len(), 2]))?;
        let numbers = springs.iter().flatten();
        let bytes: Vec<u8> = numbers
            .flat_map(|&node| (node as u64).to_le_bytes())
            .collect();
        out.write_all(&bytes)
    })?;
    zip.finish()
}

const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
const FLOATS: &str = "<f8";
const INTEGERS: &str = "<i8";

/// What a file of an array begins with, after numpy's format 1.0.
fn array_header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let mut numbers: Vec<String> = shape.iter().map(usize::to_string).collect();
    if numbers.len() == 1 {
        numbers.push(String::new());
    }
    let numbers = numbers.join(", ");
    let mut text = format!(
        "{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}",
        numbers.trim_end()
    );
    // To a multiple of 64, with the line's end.
    let unpadded = MAGIC.len() + 2 + text.len() + 1;
    text.extend(std::iter::repeat_n(
        ' ',
        unpadded.next_multiple_of(64) - unpadded,
    ));
    text.push('\n');
    let n_bytes = (text.len() as u16).to_le_bytes();
    [MAGIC, &n_bytes, text.as_bytes()].concat()
}

/// A file is no `trajectory.npz`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NpzError {
    /// It cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is something else, or was changed by another program.
    #[error("{} is not as the output `npz` of a run leaves it", path.display())]
    Other {
        /// The file.
        path: PathBuf,
    },
}

/// Opens the file that the output [`Npz`] wrote.
///
/// # Errors
///
/// If it cannot be read or is something else.
pub fn open_npz(path: &Path) -> Result<FrameFile, NpzError> {
    let read = |source| NpzError::Read {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(read)?;
    let arrays = find_arrays(&mut file).map_err(read)?;
    let found = arrays.and_then(|arrays| frames_of(file, &arrays));
    found.ok_or_else(|| NpzError::Other {
        path: path.to_owned(),
    })
}

/// Where the numbers of an array begin, and its shape.
struct Array {
    start: u64,
    shape: Vec<usize>,
}

/// The arrays of [`Quantity::ALL`], if all are there.
fn find_arrays(file: &mut File) -> io::Result<Option<Vec<Array>>> {
    let Some(entries) = entries(file)? else {
        return Ok(None);
    };
    let mut arrays = Vec::new();
    for quantity in Quantity::ALL {
        let name = format!("{}.npy", quantity.name());
        let Some(entry) = entries.iter().find(|entry| entry.name == name) else {
            return Ok(None);
        };
        file.seek(SeekFrom::Start(entry.start()))?;
        let mut header = Vec::new();
        let most = entry.n_bytes.min(LONGEST_HEADER);
        (&mut *file).take(most).read_to_end(&mut header)?;
        match array_of(entry.start(), entry.n_bytes, &header) {
            Some(array) => arrays.push(array),
            None => return Ok(None),
        }
    }
    Ok(Some(arrays))
}

/// Bytes in which the header of an array of few dimensions ends.
const LONGEST_HEADER: u64 = 256;

fn array_of(start: u64, n_bytes: u64, bytes: &[u8]) -> Option<Array> {
    let text = String::from_utf8_lossy(bytes.get(MAGIC.len() + 2..)?).into_owned();
    let (_, shape) = text.split_once("'shape': (")?;
    let (shape, _) = shape.split_once(')')?;
    let numbers = shape.split(", ").map(|number| number.trim_end_matches(','));
    let shape: Vec<usize> = numbers
        .map(|number| number.parse().ok())
        .collect::<Option<_>>()?;
    // It says nothing but that, and it is all there.
    let header = array_header(FLOATS, &shape);
    let numbers = shape
        .iter()
        .try_fold(8, |all: usize, n| all.checked_mul(*n))?;
    let is_whole = n_bytes == header.len() as u64 + numbers as u64;
    (bytes.starts_with(&header) && is_whole).then(|| Array {
        start: start + header.len() as u64,
        shape,
    })
}

fn frames_of(file: File, arrays: &[Array]) -> Option<FrameFile> {
    let [time, position, _, length, _] = arrays else {
        return None;
    };
    let size = FrameSize {
        n_nodes: *position.shape.get(1)?,
        n_springs: *length.shape.get(1)?,
    };
    let n_frames = *time.shape.first()?;
    let fits = |(array, quantity): (&Array, Quantity)| {
        array.shape[0] == n_frames && array.shape[1..] == size.shape(quantity)
    };
    let fit = arrays.iter().zip(Quantity::ALL).all(fits);
    let starts = std::array::from_fn(|index| arrays[index].start);
    fit.then(|| FrameFile::of_quantities(file, size, n_frames, starts))
}
