//! `springs check`: what it says of sound scenes and of odd ones.

mod common;

use common::real_scenes;
use common::workspace::Workspace;
use serde_json::Value;

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

fn check(workspace: &Workspace, arguments: &str) -> String {
    let output = workspace.springs(&format!("check {arguments} --threads 1"));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{error}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(workspace: &Workspace, arguments: &str) -> Value {
    serde_json::from_str(&check(workspace, &format!("{arguments} --json"))).unwrap()
}

#[test]
fn an_odd_scene_is_told_all_of_it() {
    let workspace = Workspace::new();
    std::fs::write(workspace.path("odd.ron"), ODD).unwrap();
    insta::assert_snapshot!(check(&workspace, "odd.ron"));
    assert_eq!(workspace.names("."), ["odd.ron"], "a check writes nothing");
}

#[test]
fn a_sound_scene_is_described() {
    let workspace = Workspace::new();
    workspace.scene("block.ron", "block 4 --method velocity-verlet --step 1e-4");
    insta::assert_snapshot!(check(&workspace, "block.ron"));
}

/// JSON says what the text says, and names nodes and springs by their indices.
#[test]
fn json_says_what_the_text_says() {
    let workspace = Workspace::new();
    std::fs::write(workspace.path("odd.ron"), ODD).unwrap();
    let (text, json) = (check(&workspace, "odd.ron"), json(&workspace, "odd.ron"));
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
    let workspace = Workspace::new();
    let scene = r#"Scene(version: 1,
        materials: { "bad": (EA: -1) },
        nodes: [(position: (0, 0, 0), fixed: true), (position: (1, 0, 0), mass: -2)],
        springs: [(nodes: (0, 1)), (nodes: (0, 1), material: "bad"), (nodes: (0, 5), stiffness: 1)],
    )"#;
    std::fs::write(workspace.path("bad.ron"), scene).unwrap();
    let said = workspace.expect(2, "check bad.ron");
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
    let workspace = Workspace::new();
    workspace.scene("block.ron", "block 4 --gravity 0,0,0");
    let vibrations = &json(&workspace, "block.ron")["vibrations"];
    let bound = |name: &str| vibrations[name].as_f64().unwrap();
    workspace.expect(0, "modes block.ron -n 1000 --out modes --quiet");
    let modes = workspace.read("modes/modes.csv");
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
    let workspace = Workspace::new();
    for how in [
        "--method velocity-verlet --step 1e-4",
        "--method tr-bdf2 --step 0.01",
    ] {
        workspace.scene("cloth.ron", &format!("cloth 40 --duration 0.05 {how}"));
        let forecast = &json(&workspace, "cloth.ron")["forecast"];
        workspace.expect(0, "run cloth.ron --out o --force --quiet --threads 1");
        let report = workspace.report("o");
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

/// What is odd in the examples is so on purpose.
#[test]
fn examples_raise_the_warnings_that_are_known() {
    let known = [
        ("block", "the step of 0.005 s does not resolve"),
        ("bundle", "another spring joins the same two nodes"),
        ("power-line", "the step of 0.01 s does not resolve"),
        // Published with an EA that makes it hardly stretch.
        ("steep-catenary", "sound would run along"),
    ];
    let workspace = Workspace::new();
    let mut n_warnings = 0;
    for path in real_scenes() {
        let checked = json(&workspace, &path.display().to_string());
        let name = path.file_stem().unwrap().to_str().unwrap();
        for warning in checked["warnings"].as_array().unwrap() {
            let message = warning["message"].as_str().unwrap();
            let is_known = |(scene, part): &(&str, &str)| *scene == name && message.contains(part);
            assert!(known.iter().any(is_known), "{name}: {message}");
            n_warnings += 1;
        }
    }
    assert_eq!(n_warnings, known.len());
}

/// Steps that the error chooses are within what was told before.
#[test]
fn steps_of_dop853_are_as_forecast() {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 8 --duration 1");
    for tolerance in ["1e-2", "1e-4"] {
        let how = format!("cloth.ron --method dop853 --tolerance {tolerance}");
        let check = json(&workspace, &how);
        let [least, most] =
            [0, 1].map(|k| check["forecast"]["usual"]["steps"][k].as_u64().unwrap());
        workspace.expect(0, &format!("run {how} --out o --force --quiet"));
        let steps = workspace.report("o")["steps"].as_u64().unwrap();
        assert!((least..=most).contains(&steps), "{least} {steps} {most}");
    }
    // What comes from the error is not known of other methods.
    let text = check(&workspace, "cloth.ron --method tr-bdf2 --tolerance 1e-3");
    assert!(!text.contains("usually"), "{text}");
}
