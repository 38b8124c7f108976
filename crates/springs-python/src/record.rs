//! What is kept of a run: its frames.

use crate::attended::Shared;
use crate::errors::Fault;
use pyo3::PyResult;
use springs::io::ENERGY_COLUMNS;
use springs::report::{TurnedOver, frame_energies};
use springs::step::{Account, Frame, Observer};
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// A number of each [`ENERGY_COLUMNS`].
pub(crate) type Energies<T> = [T; ENERGY_COLUMNS.len()];

/// Frames one after the other.
#[derive(Debug, Default)]
pub(crate) struct Record {
    pub(crate) times: Vec<f64>,
    pub(crate) positions: Vec<f64>,
    pub(crate) velocities: Vec<f64>,
    pub(crate) tensions: Vec<f64>,
    pub(crate) energies: Energies<Vec<f64>>,
    /// Springs that were broken, and since which frame.
    pub(crate) broken_since: BTreeMap<usize, usize>,
}

impl Record {
    /// Makes room for more frames.
    pub(crate) fn reserve(
        &mut self,
        frames: usize,
        n_nodes: usize,
        n_springs: usize,
    ) -> PyResult<()> {
        let room = |numbers: &mut Vec<f64>, each: usize| {
            let size = frames.saturating_mul(each);
            numbers.try_reserve_exact(size).map_err(|_| {
                let message = format!("there is not enough memory for {frames} frames");
                Fault::system(message)
            })
        };
        room(&mut self.times, 1)?;
        room(&mut self.positions, 3 * n_nodes)?;
        room(&mut self.velocities, 3 * n_nodes)?;
        room(&mut self.tensions, n_springs)?;
        self.energies
            .iter_mut()
            .try_for_each(|energies| room(energies, 1))?;
        Ok(())
    }

    pub(crate) fn n_frames(&self) -> usize {
        self.times.len()
    }
}

/// Keeps the frames of a run on its way.
pub(crate) struct Recorder {
    pub(crate) record: Record,
    pub(crate) turned_over: TurnedOver,
    shared: Shared,
    duration: f64,
    awaits_energies: bool,
}

impl Recorder {
    pub(crate) fn new(
        record: Record,
        turned_over: TurnedOver,
        shared: &Shared,
        duration: f64,
    ) -> Self {
        Self {
            awaits_energies: record.energies[0].len() < record.n_frames(),
            record,
            turned_over,
            shared: shared.clone(),
            duration,
        }
    }

    fn goes_on(&self) -> ControlFlow<()> {
        if self.shared.is_stopped() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

impl Observer for Recorder {
    fn trial(&mut self, _steps: u64) -> ControlFlow<()> {
        self.goes_on()
    }

    fn wants_members(&self) -> bool {
        true
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let record = &mut self.record;
        record.times.push(frame.time);
        let nodes = frame.nodes;
        record.positions.extend(nodes.positions.iter().flatten());
        record.velocities.extend(nodes.velocities.iter().flatten());
        if let Some(members) = frame.members {
            record.tensions.extend(&members.tensions);
            for &spring in &members.broken {
                record.broken_since.entry(spring).or_insert(frame.index);
            }
        }
        self.awaits_energies = true;
        ControlFlow::Continue(())
    }

    fn wants_account(&self) -> bool {
        self.awaits_energies
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        self.awaits_energies = false;
        self.turned_over.look(&account);
        let numbers = frame_energies(&account).numbers();
        let energies = self.record.energies.iter_mut();
        energies
            .zip(numbers)
            .for_each(|(all, number)| all.push(number));
        ControlFlow::Continue(())
    }

    fn step(&mut self, time: f64, _steps: u64) -> ControlFlow<()> {
        self.shared.set_progress(time / self.duration);
        self.goes_on()
    }
}
