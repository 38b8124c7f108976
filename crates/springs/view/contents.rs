//! What the page shows of a run, packed.

use super::quantized::{Deflated, Packed, Quantized, Ranges};
use serde::Serialize;
use springs_io::{FrameFile, Quantity};
use springs_scene::{Scene, Spring};
use std::io;

/// What is shown of each frame.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shown {
    /// x, y, z of each node, in m.
    Position,
    /// Of each node, in m/s.
    Speed,
    /// Of each spring, in N.
    Tension,
    /// Of each spring; zero where its rest length is.
    Strain,
}

impl Shown {
    const ALL: [Self; 4] = [Self::Position, Self::Speed, Self::Tension, Self::Strain];

    fn n_components(self) -> usize {
        match self {
            Self::Position => 3,
            _ => 1,
        }
    }

    /// No number of it has fewer bits.
    fn fewest_bits(self) -> u32 {
        match self {
            Self::Position => 12,
            _ => 8,
        }
    }
}

/// The numbers of a frame.
#[derive(Default)]
struct Moment {
    /// In s.
    time: f64,
    /// Of each of [`Shown::ALL`], of nodes or springs one after the other.
    shown: [Vec<f64>; 4],
    numbers: Vec<f64>,
}

impl Moment {
    fn of(&self, shown: Shown) -> &[f64] {
        &self.shown[shown as usize]
    }

    fn read(
        &mut self,
        frames: &mut FrameFile<'_>,
        frame: usize,
        springs: &[Spring],
    ) -> io::Result<()> {
        let Self {
            time,
            shown: [positions, speeds, tensions, strains],
            numbers,
        } = self;
        frames.read(Quantity::Time, frame, numbers)?;
        *time = numbers[0];
        frames.read(Quantity::Position, frame, positions)?;
        frames.read(Quantity::Velocity, frame, numbers)?;
        let speed = |v: &[f64]| v[0].hypot(v[1]).hypot(v[2]);
        speeds.clear();
        speeds.extend(numbers.chunks_exact(3).map(speed));
        frames.read(Quantity::Tension, frame, tensions)?;
        frames.read(Quantity::Length, frame, numbers)?;
        let strain = |(length, spring): (&f64, &Spring)| {
            if spring.rest_length > 0.0 {
                (length - spring.rest_length) / spring.rest_length
            } else {
                0.0
            }
        };
        strains.clear();
        strains.extend(numbers.iter().zip(springs).map(strain));
        if self.shown.iter().flatten().all(|number| number.is_finite()) {
            Ok(())
        } else {
            let what = format!("frame {frame} has numbers that are not finite");
            Err(io::Error::new(io::ErrorKind::InvalidData, what))
        }
    }
}

/// 1 / (K l₀) of a spring, by which its tension is a strain if its law is linear.
fn compliance(spring: &Spring) -> f64 {
    let axial_stiffness = spring.stiffness * spring.rest_length;
    if axial_stiffness > 0.0 {
        1.0 / axial_stiffness
    } else {
        0.0
    }
}

/// The frames of a run that are shown, and their ranges.
pub(super) struct Survey {
    kept: Vec<usize>,
    pub(super) stride: usize,
    pub(super) times: Vec<f64>,
    /// Of each of [`Shown::ALL`].
    ranges: [Ranges; 4],
    /// How far tension · compliance is from the strain at most.
    nonlinearity: f64,
    most_compliance: f64,
}

/// Numbers that a browser is asked to keep at once.
const MOST_NUMBERS: usize = 64_000_000;
const MOST_BITS: u32 = 16;

impl Survey {
    /// Looks at all frames once.
    pub(super) fn of(frames: &mut FrameFile<'_>, scene: &Scene) -> io::Result<Self> {
        let size = frames.size();
        let a_frame = 4 * size.n_nodes + 2 * size.n_springs;
        let all = frames.n_frames();
        let stride = (all.saturating_mul(a_frame)).div_ceil(MOST_NUMBERS).max(1);
        let compliances: Vec<f64> = scene.springs.iter().map(compliance).collect();
        let mut survey = Self {
            kept: kept(all, stride),
            stride,
            times: Vec::new(),
            ranges: Shown::ALL.map(|shown| Ranges::new(shown.n_components())),
            nonlinearity: 0.0,
            most_compliance: compliances.iter().copied().fold(0.0, f64::max),
        };
        let mut moment = Moment::default();
        for &frame in &survey.kept {
            moment.read(frames, frame, &scene.springs)?;
            survey.times.push(moment.time);
            for (ranges, numbers) in survey.ranges.iter_mut().zip(&moment.shown) {
                ranges.take(numbers);
            }
            let (tensions, strains) = (moment.of(Shown::Tension), moment.of(Shown::Strain));
            let members = tensions.iter().zip(strains).zip(&compliances);
            for ((tension, strain), compliance) in members {
                let distance = (tension * compliance - strain).abs();
                survey.nonlinearity = survey.nonlinearity.max(distance);
            }
        }
        Ok(survey)
    }

    fn error(&self, shown: Shown, bits: u32) -> f64 {
        self.ranges[shown as usize].error(bits)
    }

    /// Of strains as tension · compliance.
    fn derived_error(&self, bits: u32) -> f64 {
        self.nonlinearity + self.most_compliance * self.error(Shown::Tension, bits)
    }

    /// Leaves out every other frame. Ranges stay as they are.
    fn thin(&mut self, n_frames: usize) {
        self.stride *= 2;
        let kept = kept(n_frames, self.stride);
        let pairs = self.kept.iter().zip(&self.times);
        let pairs = pairs.filter(|(frame, _)| kept.binary_search(frame).is_ok());
        self.times = pairs.map(|(_, time)| *time).collect();
        self.kept = kept;
    }

    /// Packs all into so many bytes: with fewer bits a number where that is needed, and
    /// then with fewer frames.
    pub(super) fn pack(
        &mut self,
        frames: &mut FrameFile<'_>,
        scene: &Scene,
        room: usize,
    ) -> io::Result<Arrays> {
        // Strains that follow from tensions nearly as well need no room.
        let derived_error = self.derived_error(MOST_BITS);
        let derives_strain = derived_error <= 4.0 * self.error(Shown::Strain, MOST_BITS);
        let mut arrays = Vec::new();
        for shown in Shown::ALL {
            if !(derives_strain && shown == Shown::Strain) {
                arrays.push((shown, self.array(frames, scene, shown, MOST_BITS)?));
            }
        }
        let mut slack = self.slack(frames, scene)?;
        loop {
            let sizes = arrays.iter().map(|(_, array)| array.packed.bytes.len());
            if sizes.sum::<usize>() + slack.len() <= room {
                break;
            }
            // The largest that may still be smaller.
            let open = arrays.iter_mut();
            let open = open.filter(|(shown, array)| array.bits > shown.fewest_bits());
            match open.max_by_key(|(_, array)| array.packed.bytes.len()) {
                Some((shown, array)) => {
                    *array = self.array(frames, scene, *shown, array.bits - 2)?;
                }
                None if self.kept.len() > 2 => {
                    self.thin(frames.n_frames());
                    for (shown, array) in &mut arrays {
                        *array = self.array(frames, scene, *shown, array.bits)?;
                    }
                    slack = self.slack(frames, scene)?;
                }
                None => break,
            }
        }
        let mut arrays = arrays.into_iter().map(|(_, array)| array);
        let mut next = || arrays.next().expect("an array of each quantity");
        let [position, speed, tension] = [next(), next(), next()];
        let strain = arrays.next();
        Ok(Arrays {
            strain_error: match &strain {
                Some(strain) => strain.error,
                None => self.derived_error(tension.bits),
            },
            position,
            speed,
            tension,
            strain,
            slack,
        })
    }

    fn array(
        &self,
        frames: &mut FrameFile<'_>,
        scene: &Scene,
        shown: Shown,
        bits: u32,
    ) -> io::Result<Array> {
        let width = match shown {
            Shown::Position => 3 * scene.nodes.len(),
            Shown::Speed => scene.nodes.len(),
            Shown::Tension | Shown::Strain => scene.springs.len(),
        };
        let mut quantized = Quantized::new(&self.ranges[shown as usize], width, bits);
        let mut moment = Moment::default();
        for &frame in &self.kept {
            moment.read(frames, frame, &scene.springs)?;
            quantized.push(moment.of(shown));
        }
        Ok(Array {
            packed: quantized.pack(),
            bits,
            error: self.error(shown, bits),
        })
    }

    /// A bit a spring, those of a frame to whole bytes, as differences from the frame
    /// before.
    fn slack(&self, frames: &mut FrameFile<'_>, scene: &Scene) -> io::Result<Vec<u8>> {
        let mut packed = Deflated::default();
        let mut before = vec![0; scene.springs.len().div_ceil(8)];
        let mut tensions = Vec::new();
        for &frame in &self.kept {
            frames.read(Quantity::Tension, frame, &mut tensions)?;
            let groups = tensions.chunks(8).map(|group| {
                let bits = group.iter().enumerate();
                bits.fold(0, |byte, (bit, tension)| {
                    byte | u8::from(*tension == 0.0) << bit
                })
            });
            let now: Vec<u8> = groups.collect();
            packed.push(now.iter().zip(&before).map(|(now, before)| now ^ before));
            before = now;
        }
        Ok(packed.finish())
    }
}

/// Every so many-th frame, and always the last one.
fn kept(n_frames: usize, stride: usize) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..n_frames).step_by(stride).collect();
    if kept.last().is_some_and(|&last| last + 1 < n_frames) {
        kept.push(n_frames - 1);
    }
    kept
}

/// An array, and how far its numbers may be off.
#[derive(Serialize)]
pub(super) struct Array {
    #[serde(flatten)]
    pub(super) packed: Packed,
    bits: u32,
    error: f64,
}

/// What moves, packed.
#[derive(Serialize)]
pub(super) struct Arrays {
    pub(super) position: Array,
    pub(super) speed: Array,
    pub(super) tension: Array,
    /// Without it strains are tension / (K l₀).
    pub(super) strain: Option<Array>,
    strain_error: f64,
    #[serde(skip)]
    pub(super) slack: Vec<u8>,
}

/// Numbers of each spring that do not change: both nodes as `u32`, then rest length
/// and 1 / (K l₀) as `f64`, little-endian, each for all springs.
pub(super) fn pack_springs(springs: &[Spring]) -> Vec<u8> {
    let mut bytes = Deflated::default();
    let nodes = springs.iter().flat_map(|spring| spring.nodes);
    bytes.push(nodes.flat_map(|node| (node as u32).to_le_bytes()));
    bytes.push(
        springs
            .iter()
            .flat_map(|spring| spring.rest_length.to_le_bytes()),
    );
    bytes.push(
        springs
            .iter()
            .flat_map(|spring| compliance(spring).to_le_bytes()),
    );
    bytes.finish()
}
