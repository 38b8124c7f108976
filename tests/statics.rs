//! `springs settle` and `springs modes`, and runs that start from an equilibrium.

mod common;

use common::workspace::{Workspace, signal, wait_until};
use nalgebra::DMatrix;
use springs::io::{parse_scene, read_scene, scene_to_string};
use springs::scene::{Start, Vector3};
use springs::step::{SetupError, Simulation};
use std::f64::consts::TAU;
use std::path::Path;

const PENDULUM: &str = "Scene(
    version: 1,
    name: \"pendulum\",
    gravity: (0, 0, -10),
    nodes: [
        (position: (0, 0, 0), fixed: true),
        (position: (1, 0, 0), velocity: (0, 1, 0), mass: 2),
    ],
    springs: [(nodes: (0, 1), stiffness: 1000)],
    simulation: (start: Equilibrium, method: TrBdf2, step: 0.01, duration: 0.2),
)";

fn workspace(text: &str) -> Workspace {
    let workspace = Workspace::new();
    std::fs::write(workspace.path("it.ron"), text).unwrap();
    workspace
}

#[test]
fn settle_writes_the_equilibrium_at_rest() {
    let workspace = workspace(PENDULUM);
    let said = workspace.expect(0, "settle it.ron");
    assert!(said.contains("stable equilibrium"), "{said}");
    let expected = ["final.ron", "reactions.csv", "report.json", "springs.csv"];
    assert_eq!(workspace.names("it"), expected);
    let report = workspace.report("it");
    assert_eq!(report["status"], "stable");
    assert_eq!(
        (&report["negative_pivots"], &report["zero_pivots"]),
        (&0.into(), &0.into())
    );
    assert!(report["residual"].as_f64().unwrap() <= 2e-9);
    for field in ["iterations", "seconds", "largest_force", "nodes", "springs"] {
        assert!(report[field].is_number(), "{field}");
    }
    let (scene, _) = read_scene(&workspace.path("it/final.ron")).unwrap();
    assert!((scene.nodes[1].position - Vector3::new(0.0, 0.0, -1.02)).norm() < 1e-9);
    assert_eq!(scene.nodes[1].velocity, Vector3::zeros());
    assert_eq!(scene.springs[0].rest_length, 1.0);
    assert_eq!(scene.settings.start, Start::AsGiven);
    let springs = workspace.read("it/springs.csv");
    let row: Vec<&str> = springs.lines().nth(1).unwrap().split(',').collect();
    assert_eq!((row[0], row[1], row[5]), ("0.0", "0", "taut"));
    assert!((row[4].parse::<f64>().unwrap() - 20.0).abs() < 1e-8);
    let reactions = workspace.read("it/reactions.csv");
    assert_eq!(reactions.lines().count(), 2);

    // In equilibrium already: nothing is moved.
    std::fs::copy(workspace.path("it/final.ron"), workspace.path("again.ron")).unwrap();
    let said = workspace.expect(0, "settle again.ron");
    assert!(said.contains("as given"), "{said}");
    assert_eq!(
        workspace.read("again/final.ron"),
        workspace.read("it/final.ron")
    );
}

#[test]
fn nothing_of_another_run_is_replaced_unasked() {
    let workspace = workspace(PENDULUM);
    workspace.expect(0, "run it.ron --quiet");
    let before = workspace.names("it");
    for command in ["settle", "modes"] {
        let said = workspace.expect(2, &format!("{command} it.ron"));
        assert!(said.contains("of another run"), "{said}");
        assert_eq!(workspace.names("it"), before);
    }
    workspace.expect(0, "modes it.ron --force --quiet");
    assert!(workspace.names("it").contains(&"modes.csv".to_owned()));
    let said = workspace.expect(2, "run it.ron");
    assert!(said.contains("of another run"), "{said}");
    // What is not of the new run goes.
    workspace.expect(0, "settle it.ron --force --quiet");
    assert!(!workspace.names("it").contains(&"modes.csv".to_owned()));
}

#[test]
fn a_run_may_start_from_equilibrium() {
    let workspace = workspace(PENDULUM);
    workspace.expect(0, "settle it.ron --out settled --quiet");
    let said = workspace.expect(0, "run it.ron --out run --write csv");
    assert!(said.contains("start: stable equilibrium"), "{said}");
    let (settled, _) = read_scene(&workspace.path("settled/final.ron")).unwrap();
    // Positions are those of the equilibrium, velocities those of the scene.
    let first = workspace
        .read("run/trajectory.csv")
        .lines()
        .nth(2)
        .unwrap()
        .to_owned();
    let numbers: Vec<f64> = first.split(',').map(|word| word.parse().unwrap()).collect();
    assert_eq!(numbers[4], settled.nodes[1].position.z);
    assert_eq!(numbers[5..], [0.0, 1.0, 0.0]);
    // It goes on where it was.
    let (last, _) = read_scene(&workspace.path("run/final.ron")).unwrap();
    assert_eq!(last.settings.start, Start::AsGiven);
    workspace.expect(0, "run run/final.ron --out second --quiet");
    workspace.expect(0, "run it.ron --duration 0.4 --out whole --quiet");
    let (second, _) = read_scene(&workspace.path("second/final.ron")).unwrap();
    let (whole, _) = read_scene(&workspace.path("whole/final.ron")).unwrap();
    let apart = second.nodes[1].position - whole.nodes[1].position;
    assert!(apart.norm() < 1e-12, "{apart:?}");

    let checked = workspace.springs("check it.ron");
    let checked = String::from_utf8(checked.stdout).unwrap();
    assert!(checked.contains("starts from its equilibrium"), "{checked}");

    // The library settles nothing unasked.
    let (scene, options) = read_scene(&workspace.path("it.ron")).unwrap();
    let text = scene_to_string(&scene, &options);
    assert_eq!(parse_scene("it", &text).unwrap().0, scene);
    let error = Simulation::new(&scene).err().unwrap();
    assert!(matches!(error, SetupError::NotSettled), "{error}");
    let options = springs::statics::Options::default();
    let (started, equilibrium) = springs::statics::start(&scene, &options).unwrap();
    assert!(equilibrium.is_some() && Simulation::new(&started).is_ok());
}

#[test]
fn a_run_that_was_stopped_goes_on_without_settling_again() {
    // Long enough to be stopped on the way.
    let workspace = workspace(&PENDULUM.replace("duration: 0.2", "duration: 300"));
    let mut child = workspace.start("run it.ron --out stopped --checkpoint 1000");
    wait_until("a checkpoint", || {
        workspace.path("stopped/checkpoint.bin").exists()
    });
    signal(&child, "INT");
    child.wait().unwrap();
    let said = workspace.expect(0, "resume stopped");
    assert!(!said.contains("start:"), "{said}");
    workspace.expect(0, "run it.ron --out whole");
    assert_eq!(
        workspace.read("stopped/final.ron"),
        workspace.read("whole/final.ron")
    );
}

#[test]
fn modes_are_those_of_a_pendulum() {
    let workspace = workspace(PENDULUM);
    let said = workspace.expect(0, "modes it.ron -n 20");
    assert!(said.contains("not in equilibrium"), "{said}");
    assert!(said.contains("3 of 3 modes"), "{said}");
    let text = workspace.read("it/modes.csv");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("mode,frequency"));
    let frequencies: Vec<f64> = lines
        .map(|line| line.split_once(',').unwrap().1.parse().unwrap())
        .collect();
    let of = |square: f64| square.sqrt() / std::f64::consts::TAU;
    let expected = [of(10.0 / 1.02), of(10.0 / 1.02), of(500.0)];
    for (frequency, expected) in frequencies.iter().zip(expected) {
        assert!((frequency / expected - 1.0).abs() < 1e-9);
    }
    let shapes = workspace.read("it/shapes.csv");
    assert_eq!(shapes.lines().next(), Some("mode,node,x,y,z,ux,uy,uz"));
    assert_eq!(shapes.lines().count(), 1 + 3 * 2);
    let report = workspace.report("it");
    assert_eq!(report["status"], "stable");
    assert_eq!(
        (&report["modes"], &report["all_modes"]),
        (&3.into(), &3.into())
    );
    let said = workspace.expect(0, "modes it/final.ron -n 1 --out again");
    assert!(said.contains("modes are about it as it is"), "{said}");
}

const TRUSS: &str = "Scene(
    version: 1,
    nodes: [
        (position: (-1, 0, 0), fixed: true),
        (position: (1, 0, 0), fixed: true),
        (position: (0, 0, 0.3), fixed: \"y\"),
    ],
    springs: [(nodes: (0, 2), stiffness: 100), (nodes: (1, 2), stiffness: 100)],
    loads: [(nodes: [2], force: (0, 0, -1.2))],
)";

#[test]
fn a_path_is_followed_past_its_limit() {
    let workspace = workspace(TRUSS);
    let said = workspace.expect(0, "settle it.ron --path 300");
    assert!(
        said.contains("limit points at load factors 0.8292, -0.8292"),
        "{said}"
    );
    let path = workspace.read("it/path.csv");
    let mut lines = path.lines();
    assert_eq!(
        lines.next(),
        Some("load_factor,displacement,negative_pivots,limit")
    );
    let limit = lines.find(|line| line.ends_with(",1")).unwrap();
    let factor: f64 = limit.split(',').next().unwrap().parse().unwrap();
    assert!((1.2 * factor - 0.994992).abs() < 1e-6);
    assert!(path.lines().last().unwrap().starts_with("1.0,"));
    assert_eq!(workspace.report("it")["path"]["end"], "whole load");

    let said = workspace.expect(3, "settle it.ron --path 5 --out short");
    assert!(said.contains("came to load factor"), "{said}");
    assert_eq!(workspace.names("short"), ["path.csv", "report.json"]);
    let report = workspace.report("short");
    assert_eq!(
        (&report["status"], &report["path"]["end"]),
        (&"failed".into(), &"most points".into())
    );
}

#[test]
fn what_is_unstable_or_loose_is_said() {
    let standing = PENDULUM
        .replace("position: (1, 0, 0)", "position: (0, 0, 0.98)")
        .replace("stiffness: 1000", "stiffness: 1000, rest_length: 1");
    let workspace = workspace(&standing);
    let said = workspace.expect(0, "settle it.ron");
    assert!(
        said.contains("unstable equilibrium (2 negative pivots, most at node 1)"),
        "{said}"
    );
    assert_eq!(workspace.report("it")["status"], "unstable");
    assert_eq!(
        workspace.report("it")["loose_nodes"],
        serde_json::json!([1])
    );

    let loose = PENDULUM.replace("gravity: (0, 0, -10)", "gravity: (0, 0, 0)");
    std::fs::write(workspace.path("loose.ron"), loose).unwrap();
    let said = workspace.expect(0, "settle loose.ron");
    assert!(
        said.contains("mechanism (2 motions that nothing resists"),
        "{said}"
    );
    let report = workspace.report("loose");
    assert_eq!(
        (&report["status"], &report["zero_pivots"]),
        (&"mechanism".into(), &2.into())
    );
}

#[test]
fn each_failure_has_its_message() {
    let falling = PENDULUM.replace("fixed: true", "mass: 1");
    let workspace = workspace(&falling);
    let said = workspace.expect(3, "settle it.ron");
    assert!(said.contains("is carried off, nothing holds it"), "{said}");
    assert!(said.contains("fix a node"), "{said}");
    assert_eq!(workspace.names("it"), ["report.json"]);
    let report = workspace.report("it");
    assert_eq!(report["status"], "failed");
    assert!(report["failure"]["reason"].is_string());
    let said = workspace.expect(3, "run it.ron --out run");
    assert!(said.contains("is carried off"), "{said}");
    assert!(!workspace.path("run").exists());
    workspace.expect(3, "modes it.ron --out modes");

    let two = |code: i32, scene: &str, arguments: &str, expected: &str| {
        std::fs::write(workspace.path("two.ron"), scene).unwrap();
        let said = workspace.expect(code, arguments);
        assert!(said.contains(expected), "{said}");
        assert!(!workspace.path("two").exists(), "nothing may be written");
    };
    let no_loads = "there are no loads that a path could follow";
    two(2, PENDULUM, "settle two.ron --path 10", no_loads);
    let later = "force: (0, 0, -1.2), over_time: Ramp(from: 0, to: 1))";
    let later = TRUSS.replace("force: (0, 0, -1.2))", later);
    let not_yet = "all loads are zero at time 0, and statics takes them as they are then";
    two(2, &later, "settle two.ron --path 10", not_yet);
    two(
        2,
        TRUSS,
        "modes two.ron",
        "no node that can move has a mass",
    );
    // A massless node between two springs in a row, without tension.
    let massless = "Scene(
        version: 1,
        nodes: [
            (position: (0, 0, 0), fixed: true),
            (position: (1, 0, 0)),
            (position: (2, 0, 0), mass: 1),
        ],
        springs: [(nodes: (0, 1), stiffness: 10), (nodes: (1, 2), stiffness: 10)],
    )";
    two(2, massless, "modes two.ron", "two.ron:5:");
    two(
        2,
        massless,
        "modes two.ron",
        "node 1 has no mass, and nothing holds it",
    );
    two(2, PENDULUM, "modes two.ron -n 0", "0 is not in 1..");
    two(2, PENDULUM, "settle two.ron --path 1", "1 is not in 2..");
    let unknown = PENDULUM.replace("Equilibrium", "Equilibrum");
    two(
        2,
        &unknown,
        "settle two.ron",
        "unknown start `Equilibrum`; known are AsGiven, Equilibrium",
    );
}

/// All modes of the elastic network against a dense matrix that is made from the points
/// alone; and as many as dense matrices and iteration find.
#[test]
fn an_elastic_network_has_the_modes_of_its_dense_matrix() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    let table = std::fs::read_to_string(folder.join("elastic-network.csv")).unwrap();
    let points = table.lines().skip(1).map(|row| {
        let numbers = row.split(',').map(|cell| cell.parse().unwrap());
        Vector3::from_iterator(numbers)
    });
    let points: Vec<Vector3<f64>> = points.collect();
    let (n, stiffness, cutoff) = (points.len(), 0.7, 1.3e-9);
    let mass = 1.39e-23 / n as f64;
    let mut dense = DMatrix::zeros(3 * n, 3 * n);
    let mut n_springs = 0;
    for i in 0..n {
        for j in i + 1..n {
            let apart = points[j] - points[i];
            if apart.norm() > cutoff {
                continue;
            }
            n_springs += 1;
            let along = apart.normalize();
            let block = along * along.transpose() * (stiffness / mass);
            for (row, column, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
                let mut part = dense.fixed_view_mut::<3, 3>(3 * row, 3 * column);
                part += block * sign;
            }
        }
    }
    // It takes entries that are about 1.
    let unit = dense.amax();
    dense /= unit;
    let mut squares: Vec<f64> = dense.symmetric_eigenvalues().data.into();
    squares.iter_mut().for_each(|square| *square *= unit);
    squares.sort_by(f64::total_cmp);

    let workspace = Workspace::new();
    let scene = folder.join("elastic-network.ron");
    let (read, _) = read_scene(&scene).unwrap();
    assert_eq!(read.springs.len(), n_springs);
    let largest = squares[3 * n - 1];
    for count in [20, 120, 3 * n, 1000] {
        let command = format!("modes {} -n {count} --out modes --force", scene.display());
        workspace.expect(0, &command);
        let report = workspace.report("modes");
        assert_eq!(report["zero_modes"], 6);
        assert_eq!(report["all_modes"], 3 * n);
        let modes = workspace.read("modes/modes.csv");
        let frequencies = modes.lines().skip(1).map(|row| {
            let (_, frequency) = row.split_once(',').unwrap();
            frequency.parse::<f64>().unwrap()
        });
        let frequencies: Vec<f64> = frequencies.collect();
        assert_eq!(frequencies.len(), count.min(3 * n));
        assert!(frequencies[..6].iter().all(|frequency| *frequency == 0.0));
        for (frequency, square) in frequencies.iter().zip(&squares).skip(6) {
            let found = (frequency * TAU).powi(2);
            // Rounding of the dense matrix is in proportion to its largest eigenvalue.
            let off = (found - square).abs();
            assert!(
                off < 1e-10 * square + 1e-13 * largest,
                "{found:e}, not {square:e}"
            );
        }
    }
}

/// More modes than iteration finds: along a hanging chain they are four decades apart.
#[test]
fn all_modes_of_a_hanging_chain_are_found() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 60");
    for count in [30, 150, 179, 180] {
        workspace.expect(0, &format!("modes chain.ron -n {count} --out {count}"));
        assert_eq!(workspace.report(&count.to_string())["modes"], count);
    }
}
