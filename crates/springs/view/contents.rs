//! What the page shows of a run, packed.

use super::quantized::{Deflated, Packed, Quantized, Ranges};
use nalgebra::Vector3;
use serde::Serialize;
use springs_io::{FrameFile, Quantity, strain};
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

/// Frames of a scene as they are shown.
pub(super) struct Shows<'a> {
    frames: FrameFile,
    scene: &'a Scene,
    numbers: Vec<f64>,
}

impl<'a> Shows<'a> {
    /// Of frames of this scene.
    pub(super) fn new(frames: FrameFile, scene: &'a Scene) -> Self {
        Self {
            frames,
            scene,
            numbers: Vec::new(),
        }
    }

    fn time(&mut self, frame: usize) -> io::Result<f64> {
        self.frames.read(Quantity::Time, frame, &mut self.numbers)?;
        Ok(self.numbers[0])
    }

    /// Reads what is shown of a frame, of nodes or springs one after the other.
    fn read(&mut self, shown: Shown, frame: usize, to: &mut Vec<f64>) -> io::Result<()> {
        let (frames, numbers) = (&mut self.frames, &mut self.numbers);
        to.clear();
        match shown {
            Shown::Position => frames.read(Quantity::Position, frame, to)?,
            Shown::Speed => {
                frames.read(Quantity::Velocity, frame, numbers)?;
                let speed = |v: &[f64]| v[0].hypot(v[1]).hypot(v[2]);
                to.extend(numbers.chunks_exact(3).map(speed));
            }
            Shown::Tension => frames.read(Quantity::Tension, frame, to)?,
            Shown::Strain => {
                let mut tensions = Vec::new();
                frames.read(Quantity::Length, frame, numbers)?;
                frames.read(Quantity::Tension, frame, &mut tensions)?;
                let members = numbers.iter().zip(&tensions).zip(&self.scene.springs);
                to.extend(members.map(|((length, tension), spring)| {
                    // How far the ends of a broken one are apart is no strain.
                    let is_whole = !spring.broken || *tension != 0.0;
                    let strain = strain(spring, *length).filter(|_| is_whole);
                    strain.unwrap_or(0.0)
                }));
            }
        }
        if to.iter().all(|number| number.is_finite()) {
            Ok(())
        } else {
            let what = format!("frame {frame} has numbers that are not finite");
            Err(io::Error::new(io::ErrorKind::InvalidData, what))
        }
    }

    /// Reads lengths and tensions of the springs at a frame.
    pub(super) fn read_members(
        &mut self,
        frame: usize,
        lengths: &mut Vec<f64>,
        tensions: &mut Vec<f64>,
    ) -> io::Result<()> {
        self.frames.read(Quantity::Length, frame, lengths)?;
        self.frames.read(Quantity::Tension, frame, tensions)
    }

    /// Positions of the first, the middle and the last frame.
    pub(super) fn some_positions(&mut self) -> io::Result<Vec<Vector3<f64>>> {
        let (mut points, mut numbers) = (Vec::new(), Vec::new());
        let n_frames = self.frames.n_frames();
        let last = n_frames.saturating_sub(1);
        for frame in [0, last / 2, last] {
            if frame < n_frames {
                self.read(Shown::Position, frame, &mut numbers)?;
                let vectors = numbers.chunks_exact(3);
                points.extend(vectors.map(|x| Vector3::new(x[0], x[1], x[2])));
            }
        }
        Ok(points)
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
    pub(super) kept: Vec<usize>,
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
/// A time in words takes as many letters as so many bytes of an array.
const BYTES_OF_TIME: usize = 15;

impl Survey {
    /// Looks at all frames once.
    pub(super) fn of(shows: &mut Shows<'_>) -> io::Result<Self> {
        let size = shows.frames.size();
        let a_frame = 4 * size.n_nodes + 2 * size.n_springs;
        let all = shows.frames.n_frames();
        let stride = (all.saturating_mul(a_frame)).div_ceil(MOST_NUMBERS).max(1);
        let compliances: Vec<f64> = shows.scene.springs.iter().map(compliance).collect();
        let mut survey = Self {
            kept: kept(all, stride),
            stride,
            times: Vec::new(),
            ranges: Shown::ALL.map(|shown| Ranges::new(shown.n_components())),
            nonlinearity: 0.0,
            most_compliance: compliances.iter().copied().fold(0.0, f64::max),
        };
        let mut numbers: [Vec<f64>; 4] = Default::default();
        for &frame in &survey.kept {
            survey.times.push(shows.time(frame)?);
            for shown in Shown::ALL {
                let numbers = &mut numbers[shown as usize];
                shows.read(shown, frame, numbers)?;
                survey.ranges[shown as usize].take(numbers);
            }
            let [_, _, tensions, strains] = &numbers;
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
    pub(super) fn pack(&mut self, shows: &mut Shows<'_>, room: usize) -> io::Result<Arrays> {
        // Strains that follow from tensions nearly as well need no room.
        let derived_error = self.derived_error(MOST_BITS);
        let derives_strain = derived_error <= 4.0 * self.error(Shown::Strain, MOST_BITS);
        let mut arrays = Vec::new();
        for shown in Shown::ALL {
            if !(derives_strain && shown == Shown::Strain) {
                arrays.push((shown, self.array(shows, shown, MOST_BITS)?));
            }
        }
        let mut slack = self.slack(shows)?;
        loop {
            let sizes = arrays.iter().map(|(_, array)| array.packed.bytes.len());
            let times = BYTES_OF_TIME * self.times.len();
            if sizes.sum::<usize>() + slack.len() + times <= room {
                break;
            }
            // The largest that may still be smaller.
            let open = arrays.iter_mut();
            let open = open.filter(|(shown, array)| array.bits > shown.fewest_bits());
            match open.max_by_key(|(_, array)| array.packed.bytes.len()) {
                Some((shown, array)) => {
                    *array = self.array(shows, *shown, array.bits - 2)?;
                }
                None if self.kept.len() > 2 => {
                    self.thin(shows.frames.n_frames());
                    for (shown, array) in &mut arrays {
                        *array = self.array(shows, *shown, MOST_BITS)?;
                    }
                    slack = self.slack(shows)?;
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

    fn array(&self, shows: &mut Shows<'_>, shown: Shown, bits: u32) -> io::Result<Array> {
        let size = shows.frames.size();
        let width = match shown {
            Shown::Position => 3 * size.n_nodes,
            Shown::Speed => size.n_nodes,
            Shown::Tension | Shown::Strain => size.n_springs,
        };
        let mut quantized = Quantized::new(&self.ranges[shown as usize], width, bits);
        let mut numbers = Vec::new();
        for &frame in &self.kept {
            shows.read(shown, frame, &mut numbers)?;
            quantized.push(&numbers);
        }
        Ok(Array {
            packed: quantized.pack(),
            bits,
            error: self.error(shown, bits),
        })
    }

    /// A bit a spring, those of a frame to whole bytes, as differences from the frame
    /// before.
    fn slack(&self, shows: &mut Shows<'_>) -> io::Result<Vec<u8>> {
        let mut packed = Deflated::default();
        let mut before = vec![0; shows.frames.size().n_springs.div_ceil(8)];
        let mut tensions = Vec::new();
        for &frame in &self.kept {
            shows.read(Shown::Tension, frame, &mut tensions)?;
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
    #[serde(skip)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use springs_io::{
        FrameMembers, Npz, RunEnd, RunPlan, SinkKind as _, TrajectoryFrame, open_npz,
    };
    use springs_scene::Node;

    const FRAMES: usize = 257;

    /// Frames of noise, which nothing makes small.
    fn noise(scene: &Scene) -> FrameFile {
        let folder = tempfile::tempdir().unwrap();
        let plan = RunPlan {
            scene,
            intervals: FRAMES - 1,
        };
        let mut sink = Npz.begin(folder.path(), &plan).unwrap();
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1);
            (seed >> 40) as f64
        };
        for index in 0..FRAMES {
            let mut vectors = || -> Vec<Vector3<f64>> {
                let nodes = scene.nodes.iter();
                nodes
                    .map(|_| Vector3::new(random(), random(), random()))
                    .collect()
            };
            let (positions, velocities) = (vectors(), vectors());
            let tensions: Vec<f64> = scene.springs.iter().map(|_| random()).collect();
            let frame = TrajectoryFrame {
                index,
                time: index as f64,
                positions: &positions,
                velocities: &velocities,
                members: Some(FrameMembers {
                    springs: &scene.springs,
                    tensions: &tensions,
                    broken: &[],
                    yielded: &[],
                    reactions: &[],
                }),
            };
            sink.frame(&frame).unwrap();
        }
        let end = RunEnd {
            scene,
            time: FRAMES as f64,
            peaks: &[],
        };
        sink.finish(&end).unwrap();
        open_npz(&folder.path().join(Npz::FILE)).unwrap()
    }

    /// With less and less room, numbers lose bits down to the fewest, and then frames are left
    /// out: always every so many-th is kept, and the last one.
    #[test]
    fn what_has_no_room_loses_bits_and_then_frames() {
        let mut scene = Scene::default();
        for x in 0..5 {
            scene.add_node(Node::at(Vector3::x() * f64::from(x)));
        }
        for x in 0..4 {
            scene.add_spring(x, x + 1, 1.0);
        }
        let mut shows = Shows::new(noise(&scene), &scene);
        let mut last = usize::MAX;
        let mut strides = Vec::new();
        for room in [1_000_000, 17_000, 12_000, 3_000] {
            let mut survey = Survey::of(&mut shows).unwrap();
            assert_eq!((survey.stride, survey.kept.len()), (1, FRAMES));
            let arrays = survey.pack(&mut shows, room).unwrap();
            let packed = [&arrays.position, &arrays.speed, &arrays.tension];
            let packed = packed.into_iter().chain(&arrays.strain);
            let sizes = packed.map(|array| array.packed.bytes.len());
            let size = sizes.sum::<usize>() + arrays.slack.len();
            assert!(
                size + BYTES_OF_TIME * survey.times.len() <= room,
                "{size} in {room}"
            );
            assert!(size < last, "{size} in {room}");
            last = size;
            assert_eq!(survey.kept, kept(FRAMES, survey.stride));
            assert_eq!(survey.kept.last(), Some(&(FRAMES - 1)));
            let times = survey.kept.iter().map(|frame| *frame as f64);
            assert!(survey.times.iter().copied().eq(times));
            strides.push((survey.stride, arrays.position.bits));
        }
        assert_eq!(strides[0], (1, MOST_BITS));
        assert!(strides[1].0 == 1 && strides[1].1 < MOST_BITS, "{strides:?}");
        assert!(
            strides[3].0 > strides[2].0 && strides[2].0 > 1,
            "{strides:?}"
        );
    }
}
