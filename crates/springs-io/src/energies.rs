//! `energy.csv`: where the energy is and went, at each frame.

use crate::sink::FrameEnergies;
use crate::table::{Rows, Table};
use std::io::Write as _;

/// The output `energy`: a row per frame, in J.
pub static ENERGIES: Table = Table {
    name: "energy",
    about: "energy.csv: where the energy is and went, at each frame",
    file: "energy.csv",
    header: "time,kinetic,elastic,gravity,total,anchor_work,dashpot_heat,method_gain,load_work,broken_energy",
    rows: Rows::Energies(row),
};

fn row(energies: &FrameEnergies, bytes: &mut Vec<u8>) {
    let FrameEnergies {
        time,
        energy,
        anchor_work,
        dashpot_heat,
        method_gain,
        load_work,
        broken_energy,
    } = energies;
    writeln!(
        bytes,
        "{time:?},{:?},{:?},{:?},{:?},{anchor_work:?},{dashpot_heat:?},{method_gain:?},{load_work:?},{broken_energy:?}",
        energy.kinetic, energy.elastic, energy.gravity, energy.total
    )
    .expect("writing to memory");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EnergySum, RunEnd, RunPlan, SinkKind as _};
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
        let text = std::fs::read_to_string(folder.path().join("energy.csv")).unwrap();
        assert_eq!(
            text,
            "time,kinetic,elastic,gravity,total,anchor_work,dashpot_heat,method_gain,load_work,broken_energy\n\
             0.5,1.0,2.0,-3.0,0.1,4.0,5.0,-0.0,0.5,0.25\n"
        );
    }
}
