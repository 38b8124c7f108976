//! Frames as plain numbers, which can be read one at a time in any order.

use crate::sink::{FrameMembers, TrajectoryFrame};
use springs_scene::Scene;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};

/// What a frame has, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// One number, in s.
    Time,
    /// Three numbers a node, in m.
    Position,
    /// Three numbers a node, in m/s.
    Velocity,
    /// A number a spring, in m.
    Length,
    /// A number a spring, in N, without the force of its dashpot.
    Tension,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Time,
        Self::Position,
        Self::Velocity,
        Self::Length,
        Self::Tension,
    ];

    /// The name of its array.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Length => "length",
            Self::Tension => "tension",
        }
    }
}

/// Numbers of nodes and springs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSize {
    /// Number of nodes.
    pub n_nodes: usize,
    /// Number of springs.
    pub n_springs: usize,
}

impl FrameSize {
    /// Of a scene.
    pub fn of(scene: &Scene) -> Self {
        Self {
            n_nodes: scene.nodes.len(),
            n_springs: scene.springs.len(),
        }
    }

    /// The shape of a quantity at one frame.
    pub(crate) fn shape(self, quantity: Quantity) -> Vec<usize> {
        match quantity {
            Quantity::Time => vec![],
            Quantity::Position | Quantity::Velocity => vec![self.n_nodes, 3],
            Quantity::Length | Quantity::Tension => vec![self.n_springs],
        }
    }

    /// How many numbers that is.
    pub(crate) fn n_numbers(self, quantity: Quantity) -> usize {
        self.shape(quantity).iter().product()
    }

    /// Bytes of a frame, all quantities one after the other.
    pub(crate) fn n_bytes(self) -> u64 {
        let numbers = Quantity::ALL.map(|quantity| self.n_numbers(quantity));
        8 * numbers.iter().sum::<usize>() as u64
    }
}

/// Appends a frame, all quantities one after the other.
pub(crate) fn append_frame(
    frame: &TrajectoryFrame<'_>,
    members: &FrameMembers<'_>,
    bytes: &mut Vec<u8>,
) {
    let mut number = |number: f64| bytes.extend(number.to_le_bytes());
    number(frame.time);
    for vector in frame.positions.iter().chain(frame.velocities) {
        vector.iter().copied().for_each(&mut number);
    }
    for spring in members.springs {
        number(frame.length_of(spring));
    }
    members.tensions.iter().copied().for_each(&mut number);
}

/// Frames in a file.
#[derive(Debug)]
pub struct FrameFile {
    file: File,
    pub(crate) size: FrameSize,
    pub(crate) n_frames: usize,
    /// Of each quantity, in bytes: where it begins, and from frame to frame.
    places: [(u64, u64); 5],
    bytes: Vec<u8>,
}

impl FrameFile {
    /// Frames one after the other.
    pub(crate) fn of_frames(file: File, size: FrameSize, n_frames: usize) -> Self {
        let mut start = 0;
        let places = Quantity::ALL.map(|quantity| {
            let place = (start, size.n_bytes());
            start += 8 * size.n_numbers(quantity) as u64;
            place
        });
        Self::new(file, size, n_frames, places)
    }

    /// Quantities one after the other, which begin there.
    pub(crate) fn of_quantities(
        file: File,
        size: FrameSize,
        n_frames: usize,
        starts: [u64; 5],
    ) -> Self {
        let strides = Quantity::ALL.map(|quantity| 8 * size.n_numbers(quantity) as u64);
        let places = std::array::from_fn(|index| (starts[index], strides[index]));
        Self::new(file, size, n_frames, places)
    }

    fn new(file: File, size: FrameSize, n_frames: usize, places: [(u64, u64); 5]) -> Self {
        Self {
            file,
            size,
            n_frames,
            places,
            bytes: Vec::new(),
        }
    }

    /// Numbers of nodes and springs.
    pub fn size(&self) -> FrameSize {
        self.size
    }

    /// Number of frames.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// The numbers of a quantity at a frame.
    ///
    /// # Errors
    ///
    /// If the file cannot be read.
    ///
    /// # Panics
    ///
    /// If there is no such frame.
    pub fn read(
        &mut self,
        quantity: Quantity,
        frame: usize,
        numbers: &mut Vec<f64>,
    ) -> io::Result<()> {
        let bytes = self.bytes(quantity, frame)?;
        let words = bytes.chunks_exact(8);
        let words = words.map(|word| f64::from_le_bytes(word.try_into().expect("eight bytes")));
        numbers.clear();
        numbers.extend(words);
        Ok(())
    }

    /// [`Self::read`] as they are in the file.
    pub(crate) fn bytes(&mut self, quantity: Quantity, frame: usize) -> io::Result<&[u8]> {
        assert!(frame < self.n_frames, "frame {frame} of {}", self.n_frames);
        let (start, stride) = self.places[quantity as usize];
        self.bytes.resize(8 * self.size.n_numbers(quantity), 0);
        let place = SeekFrom::Start(start + frame as u64 * stride);
        self.file.seek(place)?;
        self.file.read_exact(&mut self.bytes)?;
        Ok(&self.bytes)
    }

    /// Appends a frame as [`append_frame`] does.
    pub(crate) fn append_frame(&mut self, frame: usize, bytes: &mut Vec<u8>) -> io::Result<()> {
        for quantity in Quantity::ALL {
            bytes.extend(self.bytes(quantity, frame)?);
        }
        Ok(())
    }
}
