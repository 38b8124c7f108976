//! What the page marks: loads, and when springs broke or began to yield.

use super::contents::Shows;
use super::quantized::Deflated;
use serde::Serialize;
use springs_scene::{OverTime, Scene, Spring, SpringLaw};
use std::io;

/// A load as the page draws it.
#[derive(Serialize)]
pub(super) struct ShownLoad {
    nodes: Vec<usize>,
    /// In N.
    force: [f64; 3],
    over_time: Factor,
}

/// As [`OverTime`], with the time 0 at the end of the run.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Factor {
    Constant,
    Ramp { from: f64, to: f64 },
    Sine { frequency: f64, phase: f64 },
    Table { points: Vec<[f64; 2]> },
}

/// Nodes and points of tables of all loads that a page has room for.
const MOST_NUMBERS: usize = 5000;

/// The loads of a scene on free nodes; `None` where there are too many.
pub(super) fn loads(scene: &Scene) -> Option<Vec<ShownLoad>> {
    let (mut shown, mut n_numbers) = (Vec::new(), 0);
    for load in &scene.loads {
        let nodes = load.nodes.iter().copied();
        let nodes: Vec<usize> = nodes.filter(|&node| !scene.nodes[node].fixed).collect();
        let over_time = match &load.over_time {
            OverTime::Constant => Factor::Constant,
            &OverTime::Ramp { from, to } => Factor::Ramp { from, to },
            &OverTime::Sine { frequency, phase } => Factor::Sine { frequency, phase },
            OverTime::Table(points) => {
                n_numbers += 2 * points.len();
                Factor::Table {
                    points: points.clone(),
                }
            }
        };
        n_numbers += nodes.len();
        if n_numbers > MOST_NUMBERS {
            return None;
        }
        if !nodes.is_empty() {
            let force = load.force.into();
            shown.push(ShownLoad {
                nodes,
                force,
                over_time,
            });
        }
    }
    Some(shown)
}

/// No frame.
const NEVER: u32 = u32::MAX;
/// A plastic elongation, as a part of the rest length, that rounding does not make.
const YIELDED: f64 = 1e-9;

/// From which of the shown frames on springs are broken, and from which on they have yielded.
pub(super) struct Changes {
    broken: Vec<u32>,
    yielded: Vec<u32>,
}

impl Changes {
    /// Of a scene as it is at the end, from its frames: a broken spring has no tension
    /// from some frame on; one that has yielded is longer, or shorter, than its tension
    /// says.
    pub(super) fn of(scene: &Scene, shows: &mut Shows<'_>, kept: &[usize]) -> io::Result<Self> {
        let springs = &scene.springs;
        let mut changes = Self {
            broken: springs
                .iter()
                .map(|spring| if spring.broken { 0 } else { NEVER })
                .collect(),
            yielded: vec![NEVER; springs.len()],
        };
        let is_changed = |spring: &Spring| spring.broken || spring.yielded != 0.0;
        if !springs.iter().any(is_changed) {
            return Ok(changes);
        }
        let (mut tensions, mut lengths) = (Vec::new(), Vec::new());
        for (index, &frame) in (0..).zip(kept) {
            shows.read_members(frame, &mut lengths, &mut tensions)?;
            for (k, spring) in springs.iter().enumerate() {
                if spring.broken && tensions[k] != 0.0 {
                    changes.broken[k] = index + 1;
                }
                let law = spring.law.map(|law| &scene.laws[law]);
                if spring.yielded != 0.0
                    && changes.yielded[k] == NEVER
                    && matches!(law, Some(SpringLaw::Plastic { .. }))
                    && (lengths[k] - spring.rest_length - tensions[k] / spring.stiffness).abs()
                        > YIELDED * spring.rest_length
                {
                    changes.yielded[k] = index;
                }
            }
        }
        Ok(changes)
    }

    /// Two `u32` a spring, little-endian: first of all when they broke, then when they
    /// began to yield.
    pub(super) fn pack(&self) -> Vec<u8> {
        let mut packed = Deflated::default();
        for frames in [&self.broken, &self.yielded] {
            packed.push(frames.iter().flat_map(|frame| frame.to_le_bytes()));
        }
        packed.finish()
    }
}
