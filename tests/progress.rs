//! What a run tells of its way, what completes commands, and scenes from pipes.

mod common;

use common::workspace::Workspace;
use serde_json::Value;
use std::io::Write as _;
use std::process::Stdio;

/// The objects on standard error, and nothing else.
fn events(said: &str) -> Vec<Value> {
    let lines = said.lines().map(serde_json::from_str);
    lines.collect::<Result<_, _>>().unwrap()
}

fn of_kind<'a>(events: &'a [Value], kind: &str) -> Vec<&'a Value> {
    events
        .iter()
        .filter(|event| event["event"] == kind)
        .collect()
}

#[test]
fn the_log_has_an_object_for_every_step() {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 4 --duration 0.4 --tolerance 1e-3");
    let said = workspace.expect(
        0,
        "run cloth.ron --method dop853 --log json --write steps --out o",
    );
    let events = events(&said);
    let steps = of_kind(&events, "step");
    let report = workspace.report("o");
    assert_eq!(steps.len() as u64, report["steps"].as_u64().unwrap());
    let mut time = 0.0;
    for step in &steps {
        let number = |name: &str| step[name].as_f64().unwrap();
        assert!((number("time") - time - number("step_size")).abs() < 1e-12);
        assert!(number("error") <= number("allowed_error"));
        time = number("time");
    }
    assert_eq!(time, 0.4);
    // What is allowed to all steps together is the tolerance.
    let allowed: f64 = steps
        .iter()
        .map(|step| step["allowed_error"].as_f64().unwrap())
        .sum();
    assert!((allowed - 1e-3).abs() < 1e-12, "{allowed}");
    let last = &events[events.len() - 1];
    assert_eq!(
        (&last["event"], &last["status"]),
        (&"end".into(), &"finished".into())
    );
    // The table has the same.
    let table = workspace.read("o/steps.csv");
    let mut rows = table.lines();
    let names: Vec<&str> = rows.next().unwrap().split(',').collect();
    for (step, row) in steps.iter().zip(rows) {
        for (name, cell) in names.iter().zip(row.split(',')) {
            let value: Value = serde_json::from_str(cell).unwrap_or_else(|_| cell.into());
            assert_eq!(step[name], value, "{name}");
        }
    }
    assert_eq!(table.lines().count(), steps.len() + 1);
}

#[test]
fn steps_of_one_size_have_no_estimate() {
    let workspace = Workspace::new();
    workspace.scene(
        "chain.ron",
        "chain 4 --duration 0.5 --method tr-bdf2 --step 0.05",
    );
    let events = events(&workspace.expect(0, "run chain.ron --log json"));
    let steps = of_kind(&events, "step");
    assert_eq!(steps.len(), 10);
    assert!(
        steps
            .iter()
            .all(|step| step["error"].is_null() && step["newton_iterations"] != 0)
    );
    assert_eq!(of_kind(&events, "phase")[0]["phase"], "setting up");
}

/// Two pendulums that are not coupled: an object whenever both have come to one time, the
/// same ones in every run.
#[test]
fn parts_are_told_together() {
    let workspace = Workspace::new();
    let scene = "Scene(version: 1, gravity: (0, 0, -10),
        nodes: [(position: (0, 0, 0), fixed: true), (position: (1, 0, 0), mass: 1),
            (position: (0, 5, 0), fixed: true), (position: (3, 5, 0), mass: 2)],
        springs: [(nodes: (0, 1), stiffness: 1e3), (nodes: (2, 3), stiffness: 1e5)],
        simulation: (method: TrBdf2, tolerance: 1e-3, duration: 1))";
    std::fs::write(workspace.path("two.ron"), scene).unwrap();
    let table = |folder: &str| {
        workspace.expect(
            0,
            &format!("run two.ron --write steps --frames 5 --quiet --out {folder}"),
        );
        workspace.read(&format!("{folder}/steps.csv"))
    };
    let rows = table("a");
    assert_eq!(rows, table("b"));
    assert!(rows.lines().count() > 16, "{rows}");
    let last = rows.lines().last().unwrap();
    assert!(last.starts_with("1.0,"), "{last}");
    let report = workspace.report("a");
    assert_eq!(last.split(',').nth(5).unwrap(), report["steps"].to_string());
}

#[test]
fn a_run_that_fails_or_is_wrong_says_so_beside_the_log() {
    let workspace = Workspace::new();
    workspace.scene(
        "stiff.ron",
        "chain 4 --stiffness 1e9 --method velocity-verlet --step 0.1",
    );
    let said = workspace.expect(3, "run stiff.ron --log json");
    assert!(
        said.contains(r#""event":"end","status":"failed""#),
        "{said}"
    );
    assert!(said.contains("\nerror: "), "{said}");
}

#[test]
fn shells_and_manuals_know_every_command() {
    let workspace = Workspace::new();
    let commands = [
        "run", "resume", "view", "settle", "modes", "check", "study", "new",
    ];
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = workspace.springs(&format!("completions {shell}"));
        let script = String::from_utf8(script.stdout).unwrap();
        for word in commands
            .iter()
            .chain(&["tolerance", "linearly-implicit-euler"])
        {
            assert!(script.contains(word), "{word} in the script of {shell}");
        }
    }
    let page = String::from_utf8(workspace.springs("man").stdout).unwrap();
    for command in commands {
        let heading = format!(".SH \"SPRINGS {}\"", command.to_uppercase());
        assert!(page.contains(&heading), "{heading}");
    }
    assert!(page.starts_with(".ie"), "{}", &page[..80]);
}

/// Files that a scene from a pipe names are found from the current folder, and its results
/// are in `scene`.
#[test]
fn a_scene_from_a_pipe_finds_its_files() {
    let workspace = Workspace::new();
    std::fs::write(workspace.path("crane.csv"), "0,0,0,0\n1,0,0,2\n").unwrap();
    let scene = r#"Scene(version: 1, motions: { "crane": Csv("crane.csv") },
        nodes: [(position: (0, 0, 0), fixed: true, motion: "crane"), (position: (0, 0, -1), mass: 1)],
        springs: [(nodes: (0, 1), stiffness: 100)])"#;
    let mut command = workspace.command("run - --quiet");
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(scene.as_bytes())
        .unwrap();
    assert!(child.wait().unwrap().success());
    assert!(
        workspace
            .read("scene/final.ron")
            .contains("(0.0, 0.0, 0.0)")
    );
    assert_eq!(workspace.names("scene"), ["final.ron", "report.json"]);
}
