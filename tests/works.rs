//! The work of each load and each support in `report.json`.

mod common;

use common::workspace::Workspace;
use serde_json::Value;

/// Masses that a load on a group lifts, one that a motion shakes by a spring, and a field.
const SCENE: &str = r#"Scene(
    version: 1,
    groups: { "deck": [0, 1] },
    motions: { "lift": Sine(amplitude: (0, 0, 0.1), frequency: 1) },
    nodes: [
        (position: (0, 0, 0), mass: 1),
        (position: (1, 0, 0), mass: 1),
        (position: (2, 0, 1), fixed: true, motion: "lift"),
        (position: (2, 0, 0), mass: 3),
        (position: (5, 0, 1), fixed: true),
    ],
    springs: [(nodes: (2, 3), stiffness: 1e3)],
    loads: [
        (nodes: "deck", force: (0, 0, 2)),
        (nodes: [3], force: (0, 0, -4)),
        (name: "tug", nodes: [1, 4], force: (0, 1, 0), over_time: Ramp(from: 0, to: 1)),
    ],
    fields: [(acceleration: (1, 0, 0))],
    simulation: (method: Dop853, tolerance: 1e-9, duration: 1),
)"#;

fn close(value: &Value, expected: f64) -> bool {
    (value.as_f64().unwrap() - expected).abs() < 1e-6
}

#[test]
fn the_report_names_what_did_work() {
    let workspace = Workspace::new();
    std::fs::write(workspace.path("lift.ron"), SCENE).unwrap();
    workspace.expect(0, "run lift.ron");
    let report = workspace.report("lift");
    let energy = &report["energy"];
    let loads = energy["loads"].as_array().unwrap();
    // Two masses of 1 kg go ½·2·1² m upwards, and a field takes 1, 1 and 3 kg ½ m along.
    // The ramp gives v = t²/2 and so ∫ t·t²/2 dt.
    let named = [
        (0, Some("deck"), 0, 2, 4.0),
        (2, Some("tug"), 1, 2, 0.125),
        (3, Some("field 0"), 0, 2, 1.0),
    ];
    for (load, name, first_node, nodes, work) in named {
        let row = &loads[load];
        assert_eq!(row["load"], load);
        assert_eq!(row["name"].as_str(), name);
        assert_eq!(
            (&row["first_node"], &row["nodes"]),
            (&first_node.into(), &nodes.into())
        );
        assert!(close(&row["work"], work), "{row}");
    }
    assert!(loads[1].get("name").is_none(), "{}", loads[1]);
    // 3 kg on 1 kN/m: the support gives what the mass, the spring and the loads do not.
    let supports = energy["supports"].as_array().unwrap();
    let [support] = &supports[..] else {
        panic!("{supports:?}");
    };
    assert_eq!(
        (&support["node"], &support["motion"]),
        (&2.into(), &"lift".into())
    );
    for (rows, total) in [(loads, "load_work"), (supports, "anchor_work")] {
        let works = rows.iter().map(|row| row["work"].as_f64().unwrap());
        let sum: f64 = works.sum();
        assert!(
            (sum - energy[total].as_f64().unwrap()).abs() < 1e-12,
            "{energy}"
        );
    }
    let left = energy["method_gain"].as_f64().unwrap();
    assert!(left.abs() < 1e-6, "{energy}");
    // They keep their names in the scene that goes on.
    workspace.expect(0, "run lift/final.ron --out more");
    let more = workspace.report("more");
    let names = more["energy"]["loads"].as_array().unwrap().iter();
    let names: Vec<Option<&str>> = names.map(|row| row["name"].as_str()).collect();
    assert_eq!(
        names,
        [
            Some("deck"),
            None,
            Some("tug"),
            Some("field 0"),
            Some("field 0")
        ]
    );
}

#[test]
fn without_any_the_report_has_none() {
    let workspace = Workspace::new();
    let text = SCENE.replace("motion: \"lift\"", "drag: 0");
    let (head, rest) = text.split_once("    loads: [").unwrap();
    let (_, tail) = rest.split_once("    simulation").unwrap();
    let text = format!("{head}    simulation{tail}").replace(", drag: 0", "");
    std::fs::write(workspace.path("plain.ron"), text).unwrap();
    workspace.expect(0, "run plain.ron");
    let energy = &workspace.report("plain")["energy"];
    assert!(
        energy.get("loads").is_none() && energy.get("supports").is_none(),
        "{energy}"
    );
}
