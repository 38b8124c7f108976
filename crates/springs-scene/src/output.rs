//! What a run of a scene shows of it.

use crate::settings::named;
use crate::{Path, Problem, Scene, UnknownName};
use std::fmt;
use std::str::FromStr;

/// What a run of a scene shows of it, beside where it ends. It changes nothing of that.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Output {
    /// Names of the outputs to be written, such as `csv`; whoever writes them knows which
    /// there are.
    pub write: Vec<String>,
    /// Equal time intervals between frames; `None`: as whoever runs it thinks fit.
    pub frames: Option<u32>,
    /// What is looked at beside frames.
    pub probes: Vec<Probe>,
}

/// A look at some nodes or springs, again and again.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// What it looks at.
    pub on: Probed,
    /// What it tells of each.
    pub of: Vec<ProbeQuantity>,
    /// Time between two looks, in s: the first is at time 0, and the last at the duration
    /// if that is a whole number of them. `None`: at each frame.
    pub every: Option<f64>,
}

/// What a probe looks at, by indices from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Probed {
    /// Nodes.
    Nodes(Vec<usize>),
    /// Springs.
    Springs(Vec<usize>),
}

impl Probed {
    /// The indices.
    pub fn indices(&self) -> &[usize] {
        match self {
            Self::Nodes(indices) | Self::Springs(indices) => indices,
        }
    }

    /// `node` or `spring`.
    pub fn item(&self) -> &'static str {
        match self {
            Self::Nodes(_) => "node",
            Self::Springs(_) => "spring",
        }
    }

    /// Whether a quantity is one of what it looks at.
    pub fn has(&self, quantity: ProbeQuantity) -> bool {
        use ProbeQuantity::{Energy, Length, Position, Strain, Tension, Velocity};
        match self {
            Self::Nodes(_) => matches!(quantity, Position | Velocity | Energy),
            Self::Springs(_) => matches!(quantity, Length | Strain | Tension | Energy),
        }
    }
}

named! {
    /// What a probe tells of a node or of a spring.
    ProbeQuantity, "quantity" {
        /// Of a node, in m.
        Position = "position",
        /// Of a node, in m/s.
        Velocity = "velocity",
        /// l of a spring, in m.
        Length = "length",
        /// l/l₀ − 1 of a spring.
        Strain = "strain",
        /// Of a spring without its dashpot, in N.
        Tension = "tension",
        /// ½ m v² of a node, with half the masses of its springs; of a spring what it holds
        /// by its length. In J.
        Energy = "energy",
    }
}

impl ProbeQuantity {
    /// The names of its numbers, in order.
    pub fn numbers(self) -> &'static [&'static str] {
        match self {
            Self::Position => &["x", "y", "z"],
            Self::Velocity => &["vx", "vy", "vz"],
            Self::Length => &["length"],
            Self::Strain => &["strain"],
            Self::Tension => &["tension"],
            Self::Energy => &["energy"],
        }
    }
}

impl Probe {
    /// What is wrong with it as that of this index of a scene.
    pub(crate) fn problem(&self, probe: usize, scene: &Scene) -> Option<Problem> {
        let n_items = match self.on {
            Probed::Nodes(_) => scene.nodes.len(),
            Probed::Springs(_) => scene.springs.len(),
        };
        let indices = self.on.indices().iter();
        if let Some(&index) = indices.clone().find(|index| **index >= n_items) {
            return Some(Problem::NoSuchProbed {
                probe,
                item: self.on.item(),
                index,
                count: n_items,
            });
        }
        if let Some(&quantity) = self.of.iter().find(|quantity| !self.on.has(**quantity)) {
            return Some(Problem::NoSuchQuantity {
                probe,
                item: self.on.item(),
                quantity,
            });
        }
        if self.of.is_empty() {
            return Some(Problem::TellsNothing { probe });
        }
        if self.of.contains(&ProbeQuantity::Strain) {
            let is_point = |spring: &&usize| scene.springs[**spring].rest_length == 0.0;
            if let Some(&spring) = indices.clone().find(is_point) {
                return Some(Problem::NoProbedStrain { probe, spring });
            }
        }
        let path = Path::Probe(probe, Some("every"));
        match self.every {
            Some(value) if !value.is_finite() => Some(Problem::NotFinite { path, value }),
            Some(value) if value <= 0.0 => Some(Problem::NotPositive { path, value }),
            Some(every) if scene.settings.duration / every > MOST_LOOKS => {
                Some(Problem::LooksTooOften { probe, every })
            }
            _ => None,
        }
    }
}

/// Of one probe.
const MOST_LOOKS: f64 = u32::MAX as f64;
