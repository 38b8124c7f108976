//! Numbers that a run comes to, by name.

use super::Subject;
use crate::report::{Ending, frame_energies};
use crate::sinks::default_intervals;
use springs_io::ENERGY_COLUMNS;
use springs_scene::{Start, printable};
use springs_solver::Interrupt;
use springs_statics::StaticsError;
use springs_step::{Account, Frame, Islands, Observer, SetupError, StepError};
use std::fmt;
use std::ops::ControlFlow;
use std::str::FromStr;
use std::time::Instant;

/// A number of a run: `max(…)`, `min(…)` or `final(…)` of a quantity, or a count.
///
/// Tensions (N) are those at the ends of steps where it is the largest or the least that
/// is asked for, of all springs, or of one as in `max(tension[3])`; strains, energies (J),
/// and coordinates (m), displacements (m) and speeds (m/s) of nodes are those of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Measure {
    name: String,
    what: What,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Over(Extent, Quantity),
    Steps,
    RejectedSteps,
    Seconds,
    BrokenSprings,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Extent {
    Max,
    Min,
    Final,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Tension(Option<usize>),
    Strain(Option<usize>),
    Node(NodeQuantity, usize),
    Speed,
    Energy(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NodeQuantity {
    Coordinate(usize),
    Velocity(usize),
    Speed,
    Displacement,
}

const EXTENTS: [(&str, Extent); 3] = [
    ("max", Extent::Max),
    ("min", Extent::Min),
    ("final", Extent::Final),
];

const COUNTS: [(&str, What); 4] = [
    ("steps", What::Steps),
    ("rejected_steps", What::RejectedSteps),
    ("seconds", What::Seconds),
    ("broken_springs", What::BrokenSprings),
];

const NODE_QUANTITIES: [(&str, NodeQuantity); 8] = [
    ("x", NodeQuantity::Coordinate(0)),
    ("y", NodeQuantity::Coordinate(1)),
    ("z", NodeQuantity::Coordinate(2)),
    ("vx", NodeQuantity::Velocity(0)),
    ("vy", NodeQuantity::Velocity(1)),
    ("vz", NodeQuantity::Velocity(2)),
    ("speed", NodeQuantity::Speed),
    ("displacement", NodeQuantity::Displacement),
];

/// There is no such measure.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// Of that name.
    #[error("`{name}` is no measure; {there_are}", there_are = what_can_be_measured())]
    Unknown {
        /// The name.
        name: String,
    },
    /// In this scene.
    #[error("`{name}` is nothing in this scene of {n_nodes} nodes and {n_springs} springs")]
    Nothing {
        /// The name.
        name: String,
        /// Number of nodes.
        n_nodes: usize,
        /// Number of springs.
        n_springs: usize,
    },
}

/// All measures, in words.
pub fn what_can_be_measured() -> String {
    let list = |names: &mut dyn Iterator<Item = &'static str>| names.collect::<Vec<_>>().join(", ");
    format!(
        "there are max(Q), min(Q) and final(Q), where Q is tension or strain (as tension[3], of \
         one spring), {} of a node (as z[3]), speed (of the fastest node), or an energy ({}); \
         and {}",
        list(&mut NODE_QUANTITIES.iter().map(|(name, _)| *name)),
        list(&mut ENERGY_COLUMNS.iter().map(|column| column.name)),
        list(&mut COUNTS.iter().map(|(name, _)| *name)),
    )
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl FromStr for Measure {
    type Err = MeasureError;

    fn from_str(name: &str) -> Result<Self, MeasureError> {
        let unknown = || MeasureError::Unknown {
            name: printable(name).to_string(),
        };
        let counts = COUNTS.iter().find(|(known, _)| *known == name);
        let what = match counts {
            Some((_, count)) => *count,
            None => over(name).ok_or_else(unknown)?,
        };
        Ok(Self {
            name: name.to_owned(),
            what,
        })
    }
}

fn over(name: &str) -> Option<What> {
    let (extent, quantity) = name.strip_suffix(')')?.split_once('(')?;
    let (_, extent) = EXTENTS.iter().find(|(known, _)| *known == extent)?;
    let (quantity, index) = match quantity.strip_suffix(']').map(|name| name.split_once('[')) {
        Some(Some((quantity, index))) => (quantity, Some(index.parse().ok()?)),
        Some(None) => return None,
        None => (quantity, None),
    };
    let energy = || {
        ENERGY_COLUMNS
            .iter()
            .position(|column| column.name == quantity)
    };
    let quantity = match (quantity, index) {
        ("tension", index) => Quantity::Tension(index),
        ("strain", index) => Quantity::Strain(index),
        ("speed", None) => Quantity::Speed,
        (quantity, Some(node)) => {
            let mut all = NODE_QUANTITIES.iter();
            let (_, found) = all.find(|(known, _)| *known == quantity)?;
            Quantity::Node(*found, node)
        }
        (_, None) => Quantity::Energy(energy()?),
    };
    Some(What::Over(*extent, quantity))
}

impl Measure {
    /// Whether it is something of a scene.
    ///
    /// # Errors
    ///
    /// If its node or spring is not there.
    pub fn check(&self, subject: &Subject) -> Result<(), MeasureError> {
        let (n_nodes, n_springs) = (subject.scene.nodes.len(), subject.scene.springs.len());
        let is_there = match self.what {
            What::Over(_, Quantity::Tension(spring) | Quantity::Strain(spring)) => {
                spring.unwrap_or(0) < n_springs
            }
            What::Over(_, Quantity::Node(_, node)) => node < n_nodes,
            What::Over(_, Quantity::Speed) => n_nodes > 0,
            _ => true,
        };
        if is_there {
            Ok(())
        } else {
            Err(MeasureError::Nothing {
                name: self.name.clone(),
                n_nodes,
                n_springs,
            })
        }
    }

    fn wants_members(&self) -> bool {
        matches!(self.what, What::Over(_, Quantity::Tension(_)))
    }

    fn wants_energies(&self) -> bool {
        matches!(self.what, What::Over(_, Quantity::Energy(_)))
    }
}

/// Why a run has no measures.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunFailure {
    /// It cannot be begun.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// It has no equilibrium to start from.
    #[error(transparent)]
    Start(#[from] StaticsError),
    /// It did not come to its end.
    #[error("{error}")]
    Step {
        /// Why.
        error: StepError,
    },
    /// It was asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// Runs a subject and measures it, on the threads of its options.
///
/// # Errors
///
/// If it does not come to its end.
pub fn measure(
    subject: &Subject,
    measures: &[Measure],
    interrupt: &Interrupt,
) -> Result<Vec<f64>, RunFailure> {
    let begin = Instant::now();
    let started;
    let scene = if subject.scene.settings.start == Start::Equilibrium {
        let options = springs_statics::Options::default()
            .with_threads(springs_step::threads(&subject.options))
            .with_interrupt(interrupt.clone());
        started = springs_statics::start(&subject.scene, &options)?.0;
        &started
    } else {
        &subject.scene
    };
    let mut islands = Islands::with_options(scene, &subject.options)?;
    islands.set_interrupt(interrupt);
    let mut watch = Watch {
        measures,
        subject,
        values: vec![None; measures.len()],
        wants_members: measures.iter().any(Measure::wants_members),
        wants_energies: measures.iter().any(Measure::wants_energies),
        awaits_energies: false,
        interrupt,
    };
    let outcome = islands.run(default_intervals(scene), &mut watch);
    match Ending::from(outcome) {
        Ending::Finished => {}
        Ending::Interrupted => return Err(RunFailure::Interrupted),
        Ending::Failed(error) => return Err(RunFailure::Step { error }),
    }
    let values = watch.values;
    let peaks = if measures.iter().any(Measure::wants_members) {
        islands.peaks()
    } else {
        Vec::new()
    };
    let counts = islands.work().counts;
    let of_peaks = |spring: Option<usize>, extent: Extent| {
        let range = spring.map_or(0..peaks.len(), |spring| spring..spring + 1);
        let peaks = peaks[range].iter();
        if extent == Extent::Max {
            peaks
                .map(|peak| peak.max_tension)
                .fold(f64::NEG_INFINITY, f64::max)
        } else {
            peaks
                .map(|peak| peak.min_tension)
                .fold(f64::INFINITY, f64::min)
        }
    };
    let measured = measures
        .iter()
        .zip(values)
        .map(|(measure, value)| match measure.what {
            What::Over(extent, Quantity::Tension(spring)) if extent != Extent::Final => {
                of_peaks(spring, extent)
            }
            What::Over(..) => value.unwrap_or(f64::NAN),
            What::Steps => counts.steps as f64,
            What::RejectedSteps => counts.rejected_steps as f64,
            What::Seconds => begin.elapsed().as_secs_f64(),
            What::BrokenSprings => {
                let mut last = scene.clone();
                islands.write_memory_to(&mut last);
                last.springs.iter().filter(|spring| spring.broken).count() as f64
            }
        });
    Ok(measured.collect())
}

/// Takes note of what frames come to.
struct Watch<'a> {
    measures: &'a [Measure],
    subject: &'a Subject,
    /// So far.
    values: Vec<Option<f64>>,
    wants_members: bool,
    wants_energies: bool,
    awaits_energies: bool,
    interrupt: &'a Interrupt,
}

impl Watch<'_> {
    fn take(&mut self, value_of: impl Fn(Quantity, Extent) -> Option<f64>) {
        for (measure, value) in self.measures.iter().zip(&mut self.values) {
            let What::Over(extent, quantity) = measure.what else {
                continue;
            };
            let Some(new) = value_of(quantity, extent) else {
                continue;
            };
            *value = Some(match (extent, *value) {
                (Extent::Max, Some(old)) => old.max(new),
                (Extent::Min, Some(old)) => old.min(new),
                _ => new,
            });
        }
    }

    fn goes_on(&self) -> ControlFlow<()> {
        if self.interrupt.is_requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// The largest of some numbers, or the least where that is asked for.
fn extreme(extent: Extent, numbers: impl Iterator<Item = f64>) -> Option<f64> {
    numbers.reduce(if extent == Extent::Min {
        f64::min
    } else {
        f64::max
    })
}

impl Observer for Watch<'_> {
    fn trial(&mut self, _steps: u64) -> ControlFlow<()> {
        self.goes_on()
    }

    fn wants_members(&self) -> bool {
        self.wants_members
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.awaits_energies = self.wants_energies;
        let scene = &self.subject.scene;
        let (x, v) = (&frame.nodes.positions, &frame.nodes.velocities);
        let strain = |index: usize| {
            let spring = &scene.springs[index];
            let [a, b] = spring.nodes;
            let length = (x[b] - x[a]).norm();
            springs_io::strain(spring, length)
        };
        let members = frame.members;
        self.take(|quantity, extent| match quantity {
            Quantity::Tension(spring) => {
                let tensions = &members.as_ref()?.tensions;
                match spring {
                    Some(spring) => Some(tensions[spring]),
                    None => extreme(extent, tensions.iter().copied()),
                }
            }
            Quantity::Strain(Some(spring)) => strain(spring),
            Quantity::Strain(None) => extreme(extent, (0..scene.springs.len()).filter_map(strain)),
            Quantity::Node(quantity, node) => Some(match quantity {
                NodeQuantity::Coordinate(axis) => x[node][axis],
                NodeQuantity::Velocity(axis) => v[node][axis],
                NodeQuantity::Speed => v[node].norm(),
                NodeQuantity::Displacement => (x[node] - scene.nodes[node].position).norm(),
            }),
            Quantity::Speed => v.iter().map(|v| v.norm()).reduce(f64::max),
            Quantity::Energy(_) => None,
        });
        self.goes_on()
    }

    fn wants_account(&self) -> bool {
        self.awaits_energies
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        self.awaits_energies = false;
        let energies = frame_energies(&account).numbers();
        self.take(|quantity, _| match quantity {
            Quantity::Energy(index) => Some(energies[index]),
            _ => None,
        });
        ControlFlow::Continue(())
    }

    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        self.goes_on()
    }
}
