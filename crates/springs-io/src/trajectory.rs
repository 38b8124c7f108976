//! `trajectory.csv`: all nodes at every frame.

use crate::sink::TrajectoryFrame;
use crate::table::{Rows, Table};
use std::io::Write as _;

/// The columns of [`TRAJECTORY`].
pub(crate) const COLUMNS: [&str; 8] = ["time", "node", "x", "y", "z", "vx", "vy", "vz"];

/// The output `csv`: a row per frame and node, in m and m/s.
pub static TRAJECTORY: Table = Table {
    name: "csv",
    about: "trajectory.csv: all nodes at every frame",
    file: "trajectory.csv",
    columns: &COLUMNS,
    rows: Rows::Frames(rows),
};

fn rows(frame: &TrajectoryFrame<'_>, bytes: &mut Vec<u8>) {
    let time = frame.time;
    let states = frame.positions.iter().zip(frame.velocities);
    for (node, (x, v)) in states.enumerate() {
        writeln!(
            bytes,
            "{time:?},{node},{:?},{:?},{:?},{:?},{:?},{:?}",
            x.x, x.y, x.z, v.x, v.y, v.z
        )
        .expect("writing to memory");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RunEnd, RunPlan, SinkKind as _};
    use nalgebra::Vector3;
    use springs_scene::Scene;

    #[test]
    fn a_row_per_frame_and_node_whose_numbers_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let scene = &Scene::default();
        let plan = RunPlan {
            scene,
            intervals: 1,
        };
        let positions = &[Vector3::new(0.1, 0.2, -0.3), Vector3::new(1e-9, 2.0, -0.0)];
        let velocities = &[Vector3::new(1.0 / 3.0, 5e-324, 1e300), Vector3::zeros()];
        let mut sink = TRAJECTORY.begin(folder.path(), &plan).unwrap();
        assert!(!sink.wants_energies());
        for (index, time) in [0.0, 0.25].into_iter().enumerate() {
            let frame = TrajectoryFrame {
                index,
                time,
                positions,
                velocities,
                members: None,
            };
            sink.frame(&frame).unwrap();
        }
        sink.finish(&RunEnd {
            scene,
            time: 0.25,
            peaks: &[],
        })
        .unwrap();
        let text = std::fs::read_to_string(folder.path().join("trajectory.csv")).unwrap();
        assert_eq!(
            text,
            "time,node,x,y,z,vx,vy,vz\n\
             0.0,0,0.1,0.2,-0.3,0.3333333333333333,5e-324,1e300\n\
             0.0,1,1e-9,2.0,-0.0,0.0,0.0,0.0\n\
             0.25,0,0.1,0.2,-0.3,0.3333333333333333,5e-324,1e300\n\
             0.25,1,1e-9,2.0,-0.0,0.0,0.0,0.0\n"
        );
    }
}
