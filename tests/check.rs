//! `springs check`: what it says of sound scenes and of odd ones.

mod common;

use common::desk::Desk;
use serde_json::Value;
use std::path::Path;

/// Everything that can be said of a scene of materials, supports, loads and groups that has
/// a mistake of every kind.
const ODD: &str = r#"Scene(
    version: 1,
    name: "odd",
    gravity: (0, 0, -9.81),
    materials: {
        "rod": (E: 210000, diameter: 0.02, density: 7850, damping_ratio: 0.01),
        "rope": (EA: 5e5, mass_per_length: 0.4, law: TensionOnly()),
    },
    groups: { "ends": [0, 3, 3], "nothing": [] },
    motions: { "lift": Table([(0, (0, 0, 0.1)), (1, (0, 0, 0.2))]) },
    nodes: [
        (position: (0, 0, 0), fixed: true),
        (position: (1, 0, 0), mass: 2),
        (position: (1, 0, 0), mass: 1),
        (position: (2, 0, 0.5), fixed: true, motion: "lift"),
        (position: (5, 0, 0), mass: 1),
    ],
    springs: [
        (nodes: (0, 1), material: "rod"),
        (nodes: (1, 3), material: "rod"),
        (nodes: (3, 1), material: "rope", rest_length: 1.5),
        (nodes: (2, 3), material: "rope"),
    ],
    loads: [(nodes: "ends", force: (0, 0, -1))],
    simulation: (method: LinearlyImplicitEuler, step: 0.05, duration: 2),
)"#;

fn check(desk: &Desk, arguments: &str) -> String {
    let output = desk.springs(&format!("check {arguments} --threads 1"));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{error}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(desk: &Desk, arguments: &str) -> Value {
    serde_json::from_str(&check(desk, &format!("{arguments} --json"))).unwrap()
}

#[test]
fn an_odd_scene_is_told_all_of_it() {
    let desk = Desk::new();
    std::fs::write(desk.path("odd.ron"), ODD).unwrap();
    insta::assert_snapshot!(check(&desk, "odd.ron"));
    assert_eq!(desk.names("."), ["odd.ron"], "a check writes nothing");
}

#[test]
fn a_sound_scene_is_described() {
    let desk = Desk::new();
    desk.scene("block.ron", "block 4 --method velocity-verlet --step 1e-4");
    insta::assert_snapshot!(check(&desk, "block.ron"));
}

/// JSON says what the text says, and names nodes and springs by their indices.
#[test]
fn json_says_what_the_text_says() {
    let desk = Desk::new();
    std::fs::write(desk.path("odd.ron"), ODD).unwrap();
    let (text, json) = (check(&desk, "odd.ron"), json(&desk, "odd.ron"));
    let warnings = json["warnings"].as_array().unwrap();
    for warning in warnings {
        let message = warning["message"].as_str().unwrap();
        assert!(text.contains(message), "{message} in\n{text}");
    }
    let about = |part: &str| {
        let says = |warning: &&Value| warning["message"].as_str().unwrap().contains(part);
        warnings.iter().find(says).unwrap()
    };
    assert_eq!(
        about("metals have in MPa")["springs"],
        serde_json::json!([0, 1])
    );
    assert_eq!(about("loads on")["nodes"], serde_json::json!([0, 3]));
    assert_eq!(json["contents"]["slack_springs"], 1);
    assert_eq!(json["contents"]["loose_nodes"], 1);
    assert_eq!(json["plan"]["steps"], 40);
    assert_eq!(json["contents"]["materials"][0]["material"], "rod");
}

/// What fields of a file say together, and what is wrong with the scene, are told at once; but
/// not what is wrong only because of the former.
#[test]
fn both_kinds_of_findings_are_told_together() {
    let desk = Desk::new();
    let scene = r#"Scene(version: 1,
        materials: { "bad": (EA: -1) },
        nodes: [(position: (0, 0, 0), fixed: true), (position: (1, 0, 0), mass: -2)],
        springs: [(nodes: (0, 1)), (nodes: (0, 1), material: "bad"), (nodes: (0, 5), stiffness: 1)],
    )"#;
    std::fs::write(desk.path("bad.ron"), scene).unwrap();
    let said = desk.expect(2, "check bad.ron");
    let errors: Vec<&str> = said
        .lines()
        .filter(|line| line.starts_with("error"))
        .collect();
    let told = [
        "has no stiffness",
        "EA of material",
        "mass of node 1",
        "joins node 5",
    ];
    assert_eq!(errors.len(), told.len(), "{said}");
    for part in told {
        assert!(said.contains(part), "{part} in\n{said}");
    }
}

/// The highest frequency is bounded from above, the lowest one, too, and both are near.
#[test]
fn frequencies_are_bounds() {
    let desk = Desk::new();
    desk.scene("block.ron", "block 4 --gravity 0,0,0");
    let vibrations = &json(&desk, "block.ron")["vibrations"];
    let bound = |name: &str| vibrations[name].as_f64().unwrap();
    desk.expect(0, "modes block.ron -n 1000 --out modes --quiet");
    let modes = desk.read("modes/modes.csv");
    let frequency = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
    let modes: Vec<f64> = modes.lines().skip(1).map(frequency).collect();
    let (lowest, highest) = (modes[0], modes[modes.len() - 1]);
    assert_eq!(modes.len(), 3 * 48);
    let (low, high) = (bound("lowest_bound"), bound("highest_bound"));
    assert!(lowest <= low && low < 1.5 * lowest, "{lowest} {low}");
    assert!(highest <= high && high < 2.0 * highest, "{highest} {high}");
}

/// Forecasts of memory hold within a factor, and know the number of steps.
#[test]
fn forecasts_are_near_what_a_run_takes() {
    let desk = Desk::new();
    for how in [
        "--method velocity-verlet --step 1e-4",
        "--method tr-bdf2 --step 0.01",
    ] {
        desk.scene("cloth.ron", &format!("cloth 40 --duration 0.05 {how}"));
        let forecast = &json(&desk, "cloth.ron")["forecast"];
        desk.expect(0, "run cloth.ron --out o --force --quiet --threads 1");
        let report = desk.report("o");
        assert_eq!(forecast["steps"], report["steps"]);
        let each = forecast["step_seconds"].as_f64().unwrap();
        let all = forecast["seconds"].as_f64().unwrap();
        let steps = report["steps"].as_f64().unwrap();
        assert!((all / (each * steps) - 1.0).abs() < 1e-12);
        if let Some(peak) = report["peak_memory_bytes"].as_f64() {
            let bytes = forecast["bytes"].as_f64().unwrap();
            assert!(
                bytes > peak / 3.0 && bytes < 3.0 * peak,
                "{how}: {bytes} {peak}"
            );
        }
    }
}

/// Their sources say what they are made of, so nothing in them is odd but steps.
#[test]
fn examples_raise_no_other_warnings_than_of_steps() {
    let desk = Desk::new();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    for entry in std::fs::read_dir(examples).unwrap() {
        let path = entry.unwrap().path();
        let checked = json(&desk, &path.display().to_string());
        for warning in checked["warnings"].as_array().unwrap() {
            let message = warning["message"].as_str().unwrap();
            assert!(
                message.starts_with("the step of"),
                "{}: {message}",
                path.display()
            );
        }
    }
}
