//! Numbers that a run comes to, by name.

use super::Subject;
use super::selection::Selection;
use crate::report::{Ending, frame_energies};
use crate::sinks::intervals;
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
/// is asked for, of all springs, or of some as in `max(tension[3])`, `max(tension[3:10])` or
/// `max(materials.wire.tension)`; strains, energies (J),
/// and coordinates (m), displacements (m) and speeds (m/s) of nodes are those of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Measure {
    name: String,
    what: What,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum What {
    Over(Extent, Quantity),
    Count(Count),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Count {
    Steps,
    RejectedSteps,
    EstimatedError,
    Seconds,
    BrokenSprings,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Extent {
    Max,
    Min,
    Final,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Quantity {
    OfSprings(SpringQuantity, Selection),
    Node(NodeQuantity, usize),
    Speed,
    Energy(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SpringQuantity {
    Tension,
    Strain,
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

const COUNTS: [(&str, Count); 5] = [
    ("steps", Count::Steps),
    ("rejected_steps", Count::RejectedSteps),
    ("estimated_error", Count::EstimatedError),
    ("seconds", Count::Seconds),
    ("broken_springs", Count::BrokenSprings),
];

const SPRING_QUANTITIES: [(&str, SpringQuantity); 2] = [
    ("tension", SpringQuantity::Tension),
    ("strain", SpringQuantity::Strain),
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
    #[error("`{name}` is nothing in this scene, which has {there}")]
    Nothing {
        /// The name.
        name: String,
        /// What there is.
        there: String,
    },
}

/// All measures, in words.
pub fn what_can_be_measured() -> String {
    let list = |names: &mut dyn Iterator<Item = &'static str>| names.collect::<Vec<_>>().join(", ");
    format!(
        "there are max(Q), min(Q) and final(Q), where Q is {} (as tension[3], tension[3:10] or \
         materials.NAME.tension, of some springs), {} of a node (as z[3]), speed (of the fastest node), or an energy ({}); \
         and {}",
        list(&mut SPRING_QUANTITIES.iter().map(|(name, _)| *name)),
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
            Some((_, count)) => What::Count(*count),
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
    Some(What::Over(*extent, self::quantity(quantity)?))
}

fn quantity(name: &str) -> Option<Quantity> {
    let of_springs = |name: &str| {
        let mut all = SPRING_QUANTITIES.iter();
        all.find(|(known, _)| *known == name)
            .map(|(_, found)| *found)
    };
    if let Some((selection, field)) = Selection::of_material(name) {
        return Some(Quantity::OfSprings(of_springs(field)?, selection));
    }
    for (known, quantity) in SPRING_QUANTITIES {
        if let Some((selection, "")) = Selection::of_list(name, known) {
            return Some(Quantity::OfSprings(quantity, selection));
        }
    }
    if name == "speed" {
        return Some(Quantity::Speed);
    }
    if let Some((quantity, node)) = name.strip_suffix(']').and_then(|name| name.split_once('[')) {
        let mut all = NODE_QUANTITIES.iter();
        let (_, found) = all.find(|(known, _)| *known == quantity)?;
        return Some(Quantity::Node(*found, node.parse().ok()?));
    }
    let energy = ENERGY_COLUMNS.iter().position(|column| column.name == name);
    energy.map(Quantity::Energy)
}

impl Measure {
    /// Whether it is something of a scene.
    ///
    /// # Errors
    ///
    /// If its node or spring is not there.
    pub fn check(&self, subject: &Subject) -> Result<(), MeasureError> {
        let n_nodes = subject.scene.nodes.len();
        let there = match &self.what {
            What::Over(_, Quantity::OfSprings(_, selection)) => match springs(selection, subject) {
                Err(there) => there,
                Ok(_) => return Ok(()),
            },
            What::Over(_, Quantity::Node(_, node)) if *node >= n_nodes => {
                format!("{n_nodes} nodes, counted from 0")
            }
            What::Over(_, Quantity::Speed) if n_nodes == 0 => "no nodes".to_owned(),
            _ => return Ok(()),
        };
        Err(MeasureError::Nothing {
            name: self.name.clone(),
            there,
        })
    }

    fn wants_members(&self) -> bool {
        matches!(
            self.what,
            What::Over(_, Quantity::OfSprings(SpringQuantity::Tension, _))
        )
    }

    fn wants_energies(&self) -> bool {
        matches!(self.what, What::Over(_, Quantity::Energy(_)))
    }
}

/// The springs that a measure is of.
fn springs(selection: &Selection, subject: &Subject) -> Result<Vec<usize>, String> {
    let n_springs = subject.scene.springs.len();
    selection.members(&subject.inputs, n_springs, "springs")
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
    // Those of none are not measured.
    let springs_of = |measure: &Measure| match &measure.what {
        What::Over(_, Quantity::OfSprings(_, selection)) => {
            springs(selection, subject).unwrap_or_default()
        }
        _ => Vec::new(),
    };
    let springs: Vec<Vec<usize>> = measures.iter().map(springs_of).collect();
    let mut watch = Watch {
        measures,
        springs: &springs,
        subject,
        values: vec![None; measures.len()],
        wants_members: measures.iter().any(Measure::wants_members),
        wants_energies: measures.iter().any(Measure::wants_energies),
        awaits_energies: false,
        interrupt,
    };
    let outcome = islands.run(intervals(scene), &mut watch);
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
    let count = |count: Count| match count {
        Count::Steps => counts.steps as f64,
        Count::RejectedSteps => counts.rejected_steps as f64,
        Count::EstimatedError => islands.estimated_error().unwrap_or(f64::NAN),
        Count::Seconds => begin.elapsed().as_secs_f64(),
        Count::BrokenSprings => {
            let mut last = scene.clone();
            islands.write_memory_to(&mut last);
            last.springs.iter().filter(|spring| spring.broken).count() as f64
        }
    };
    let all = measures.iter().zip(values).zip(&springs);
    let measured = all.map(|((measure, value), springs)| match &measure.what {
        What::Count(kind) => count(*kind),
        What::Over(extent, Quantity::OfSprings(SpringQuantity::Tension, _))
            if *extent != Extent::Final =>
        {
            let tension = |&spring: &usize| match extent {
                Extent::Min => peaks[spring].min_tension,
                _ => peaks[spring].max_tension,
            };
            extreme(*extent, springs.iter().map(tension)).unwrap_or(f64::NAN)
        }
        What::Over(..) => value.unwrap_or(f64::NAN),
    });
    Ok(measured.collect())
}

/// Takes note of what frames come to.
struct Watch<'a> {
    measures: &'a [Measure],
    /// Those that each measure is of.
    springs: &'a [Vec<usize>],
    subject: &'a Subject,
    /// So far.
    values: Vec<Option<f64>>,
    wants_members: bool,
    wants_energies: bool,
    awaits_energies: bool,
    interrupt: &'a Interrupt,
}

impl Watch<'_> {
    fn take(&mut self, value_of: impl Fn(&Quantity, Extent, &[usize]) -> Option<f64>) {
        let all = self.measures.iter().zip(self.springs);
        for ((measure, springs), value) in all.zip(&mut self.values) {
            let What::Over(extent, quantity) = &measure.what else {
                continue;
            };
            let Some(new) = value_of(quantity, *extent, springs) else {
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
        self.take(|quantity, extent, springs| match quantity {
            Quantity::OfSprings(SpringQuantity::Tension, _) => {
                let tensions = &members.as_ref()?.tensions;
                extreme(extent, springs.iter().map(|&spring| tensions[spring]))
            }
            Quantity::OfSprings(SpringQuantity::Strain, _) => {
                extreme(extent, springs.iter().filter_map(|&spring| strain(spring)))
            }
            &Quantity::Node(quantity, node) => Some(match quantity {
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
        self.take(|quantity, _, _| match quantity {
            Quantity::Energy(index) => Some(energies[*index]),
            _ => None,
        });
        ControlFlow::Continue(())
    }

    fn step(&mut self, _time: f64, _steps: u64) -> ControlFlow<()> {
        self.goes_on()
    }
}
