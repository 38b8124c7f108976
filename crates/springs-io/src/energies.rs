//! `energy.csv`: where the energy is and went, at each frame.

use crate::report::EnergySum;
use crate::rows::{TableError, TableRows};
use crate::sink::FrameEnergies;
use crate::table::{Rows, Table};
use std::io::Write as _;
use std::path::Path;

/// A kind of energy of a [`FrameEnergies`], or a flow of energy, in J.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnergyColumn {
    /// Its column of `energy.csv`.
    pub column: &'static str,
    /// Its name among measures of sweeps and in Python.
    pub name: &'static str,
    /// What pictures call it.
    pub label: &'static str,
    /// Whether it adds up since the start, and is not there at one time.
    pub is_flow: bool,
}

/// All of them, in the order of [`FrameEnergies::numbers`] and of `energy.csv`.
pub const ENERGY_COLUMNS: [EnergyColumn; 9] = [
    energy("kinetic", "kinetic"),
    energy("elastic", "springs"),
    energy("gravity", "gravity"),
    energy("total", "sum"),
    flow("anchor_work", "work of anchors"),
    flow("dashpot_heat", "heat of dashpots and drag"),
    EnergyColumn {
        name: "method",
        ..flow("method_gain", "gain of the method")
    },
    flow("load_work", "work of loads"),
    flow("broken_energy", "broken and yielded springs"),
];

const fn energy(name: &'static str, label: &'static str) -> EnergyColumn {
    EnergyColumn {
        column: name,
        name,
        label,
        is_flow: false,
    }
}

const fn flow(name: &'static str, label: &'static str) -> EnergyColumn {
    EnergyColumn {
        is_flow: true,
        ..energy(name, label)
    }
}

impl FrameEnergies {
    /// In the order of [`ENERGY_COLUMNS`].
    pub fn numbers(&self) -> [f64; ENERGY_COLUMNS.len()] {
        [
            self.energy.kinetic,
            self.energy.elastic,
            self.energy.gravity,
            self.energy.total,
            self.anchor_work,
            self.dashpot_heat,
            self.method_gain,
            self.load_work,
            self.broken_energy,
        ]
    }

    /// What has these [numbers](Self::numbers) at a time in s.
    pub fn of_numbers(time: f64, numbers: [f64; ENERGY_COLUMNS.len()]) -> Self {
        let [
            kinetic,
            elastic,
            gravity,
            total,
            anchor_work,
            dashpot_heat,
            method_gain,
            load_work,
            broken_energy,
        ] = numbers;
        Self {
            time,
            energy: EnergySum {
                kinetic,
                elastic,
                gravity,
                total,
            },
            anchor_work,
            dashpot_heat,
            load_work,
            method_gain,
            broken_energy,
        }
    }
}

/// The time and all energies.
const COLUMNS: [&str; ENERGY_COLUMNS.len() + 1] = {
    let mut columns = ["time"; ENERGY_COLUMNS.len() + 1];
    let mut index = 0;
    while index < ENERGY_COLUMNS.len() {
        columns[index + 1] = ENERGY_COLUMNS[index].column;
        index += 1;
    }
    columns
};

/// The output `energy`: a row per frame, in J.
pub static ENERGIES: Table = Table {
    name: "energy",
    about: "energy.csv: where the energy is and went, at each frame",
    file: "energy.csv",
    columns: &COLUMNS,
    rows: Rows::Energies(row),
};

fn row(energies: &FrameEnergies, bytes: &mut Vec<u8>) {
    write!(bytes, "{:?}", energies.time).expect("writing to memory");
    for number in energies.numbers() {
        write!(bytes, ",{number:?}").expect("writing to memory");
    }
    bytes.push(b'\n');
}

/// Reads `energy.csv`, row by row.
///
/// # Errors
///
/// If it cannot be read, or a cell is no finite number.
pub fn read_energies(path: &Path) -> Result<Vec<FrameEnergies>, TableError> {
    let mut rows = TableRows::open(path, COLUMNS)?;
    let mut all = Vec::new();
    while let Some(row) = rows.next()? {
        let mut numbers = [0.0; ENERGY_COLUMNS.len()];
        for (number, cell) in numbers.iter_mut().zip(1..) {
            *number = row.finite_number(cell)?;
        }
        all.push(FrameEnergies::of_numbers(row.finite_number(0)?, numbers));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RunEnd, RunPlan, SinkKind as _};
    use springs_scene::Scene;

    #[test]
    fn a_row_per_frame_in_the_order_of_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let scene = &Scene::default();
        let plan = RunPlan {
            scene,
            intervals: 1,
        };
        let mut sink = ENERGIES.begin(folder.path(), &plan).unwrap();
        assert!(sink.wants_energies());
        let energies = FrameEnergies {
            time: 0.5,
            energy: EnergySum {
                kinetic: 1.0,
                elastic: 2.0,
                gravity: -3.0,
                total: 0.1,
            },
            anchor_work: 4.0,
            dashpot_heat: 5.0,
            method_gain: -0.0,
            load_work: 0.5,
            broken_energy: 0.25,
        };
        sink.energies(&energies).unwrap();
        sink.finish(&RunEnd {
            scene,
            time: 0.5,
            peaks: &[],
        })
        .unwrap();
        let path = folder.path().join("energy.csv");
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(
            text,
            "time,kinetic,elastic,gravity,total,anchor_work,dashpot_heat,method_gain,load_work,broken_energy\n\
             0.5,1.0,2.0,-3.0,0.1,4.0,5.0,-0.0,0.5,0.25\n"
        );
        let read = read_energies(&path).unwrap();
        assert_eq!(read, [energies]);
        let bits = |energies: &FrameEnergies| energies.numbers().map(f64::to_bits);
        assert_eq!(bits(&read[0]), bits(&energies));
        std::fs::write(&path, text.replace("0.25", "")).unwrap();
        let error = read_energies(&path).unwrap_err().to_string();
        assert!(
            error.ends_with("energy.csv:2: there is no number in the column `broken_energy`"),
            "{error}"
        );
    }
}
