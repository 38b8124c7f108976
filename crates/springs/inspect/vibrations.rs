//! How fast and how slowly a scene vibrates, without computing its modes.

use serde::Serialize;
use springs_statics::lowest_frequency_bound;
use springs_step::{Islands, Part, Simulation};
use std::f64::consts::TAU;

/// Between which frequencies a scene vibrates: bounds, no modes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Vibrations {
    /// No vibration is faster in any configuration, in Hz: ω² ≤ 2 Σ K / m at each node
    /// with a mass. `None` where a law has no largest stiffness.
    pub highest_bound: Option<f64>,
    /// The node where that is.
    pub highest_node: Option<usize>,
    /// A step, in s, that resolves a vibration of that frequency: 1/ω, six of them a
    /// period.
    pub resolving_step: Option<f64>,
    /// The slowest vibration of the parts that something holds, about the positions as
    /// given, is at this frequency or below, in Hz: Rayleigh's quotient of shapes that
    /// grow with the distance from what is held. Zero where nothing resists one of them,
    /// negative where one grows, as e^{2π|f|t}. `None` if no part is held.
    pub lowest_bound: Option<f64>,
    /// The first node of the part where that is.
    pub lowest_part: Option<usize>,
}

impl Vibrations {
    /// Of the parts of a compiled scene.
    pub(super) fn of(islands: &Islands) -> Self {
        let mut vibrations = Self {
            highest_bound: None,
            highest_node: None,
            resolving_step: None,
            lowest_bound: None,
            lowest_part: None,
        };
        let highest = islands.parts().iter().filter_map(highest);
        let highest = highest.max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((node, omega)) = highest.filter(|(_, omega)| *omega > 0.0) {
            vibrations.highest_node = Some(node);
            if omega.is_finite() {
                vibrations.highest_bound = Some(omega / TAU);
                vibrations.resolving_step = Some(1.0 / omega);
            }
        }
        let lowest = islands.parts().iter().filter_map(lowest);
        if let Some((node, omega)) = lowest.min_by(|a, b| a.1.total_cmp(&b.1)) {
            vibrations.lowest_bound = Some(omega / TAU);
            vibrations.lowest_part = Some(node);
        }
        vibrations
    }
}

/// The node with a mass that may vibrate fastest, and how fast, in rad/s.
fn highest(part: &Part) -> Option<(usize, f64)> {
    let system = part.simulation().system();
    let bounds = system.stiffness_bounds().into_iter().zip(system.masses());
    let massive = bounds.enumerate().filter(|(_, (_, mass))| **mass > 0.0);
    let squares = massive.map(|(block, (bound, mass))| (block, 2.0 * bound / mass));
    let (block, square) = squares.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let node = part.island().nodes[system.numbering().node(block)];
    Some((node, square.sqrt()))
}

/// The first node of a part, and a bound on its slowest vibration, in rad/s.
fn lowest(part: &Part) -> Option<(usize, f64)> {
    let omega = lowest_frequency_bound(part.simulation().system())?;
    Some((part.island().nodes[0], omega))
}

/// The part with the fastest vibrations.
pub(super) fn fastest(islands: &Islands) -> Option<&Simulation> {
    let frequency = |part: &&Simulation| part.system().frequency_bound();
    let parts = islands.parts().iter().map(Part::simulation);
    parts.max_by(|a, b| frequency(a).total_cmp(&frequency(b)))
}
