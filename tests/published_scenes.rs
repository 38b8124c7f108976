//! The example scenes of published cases give their figures on the command line.

mod common;

use common::workspace::Workspace;
use springs::io::read_scene;
use std::f64::consts::{PI, TAU};
use std::path::Path;

fn scene(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    path.join(name).display().to_string()
}

/// Rows of a table in a folder of results; words are no numbers.
fn rows(workspace: &Workspace, table: &str) -> Vec<Vec<f64>> {
    let text = workspace.read(table);
    let of_row = |row: &str| -> Vec<f64> {
        let cells = row.split(',');
        cells.map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
    };
    text.lines().skip(1).map(of_row).collect()
}

fn close(found: f64, expected: f64, part: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off < part, "{found}, not {expected}");
}

#[test]
fn catenaries_have_their_forces() {
    for (name, expected) in [
        ("mooring-line.ron", [31373.229, 26650.341, 87886.159]),
        ("steep-catenary.ron", [43694.581, 22365.599, 77634.401]),
    ] {
        let workspace = Workspace::new();
        workspace.expect(0, &format!("settle {} --out it", scene(name)));
        let ends = rows(&workspace, "it/reactions.csv");
        close(ends[0][2].abs(), expected[0], 1e-3);
        close(ends[0][4].abs(), expected[1], 1e-3);
        close(ends[1][4].abs(), expected[2], 1e-3);
    }
}

#[test]
fn a_point_load_pulls_its_cable_down() {
    let workspace = Workspace::new();
    workspace.expect(
        0,
        &format!(
            "settle {} --path 50 --out it",
            scene("point-load-cable.ron")
        ),
    );
    let path = rows(&workspace, "it/path.csv");
    close(path.last().unwrap()[1], 5.626, 5e-3);
}

#[test]
fn the_prism_is_twisted() {
    let workspace = Workspace::new();
    workspace.expect(
        0,
        &format!("settle {} --out it", scene("triplex-prism.ron")),
    );
    let (settled, _) = read_scene(&workspace.path("it/final.ron")).unwrap();
    let angle = |node: usize| {
        settled.nodes[node]
            .position
            .y
            .atan2(settled.nodes[node].position.x)
    };
    // A strut goes from node 0 to node 4.
    let twist = (angle(4) - angle(0)).rem_euclid(TAU).to_degrees();
    assert!((twist - 150.0).abs() < 1e-8, "{twist}");
}

#[test]
fn the_arch_has_its_rise_and_load_path() {
    let workspace = Workspace::new();
    workspace.expect(0, &format!("settle {} --out it", scene("arch.ron")));
    let (settled, _) = read_scene(&workspace.path("it/final.ron")).unwrap();
    close(settled.nodes[50].position.z, 3f64.sqrt() * 10.0 / 4.0, 1e-3);
    let load_path: f64 = rows(&workspace, "it/springs.csv")
        .iter()
        .map(|row| row[2] * row[4])
        .sum();
    close(load_path, 100.0 / 3f64.sqrt(), 1e-2);
}

#[test]
fn the_oscillator_swings_as_far_as_it_should() {
    let workspace = Workspace::new();
    workspace.expect(
        0,
        &format!("run {} --out it", scene("driven-oscillator.ron")),
    );
    let text = workspace.read("it/probes.csv");
    let late = text.lines().filter_map(|row| {
        let (time, rest) = row.split_once(',')?;
        let x = rest.strip_prefix("node,1,x,")?;
        (time.parse::<f64>().unwrap() > 25.0).then(|| x.parse::<f64>().unwrap())
    });
    let late: Vec<f64> = late.collect();
    assert!(late.len() > 490);
    let most = late.iter().copied().fold(f64::MIN, f64::max);
    let least = late.iter().copied().fold(f64::MAX, f64::min);
    let omega = TAU * 0.8;
    let amplitude = 0.3 / (50.0 - 2.0 * omega * omega).hypot(4.0 * omega);
    // The most of 125 looks a period, and the tolerance.
    assert!((0.5 * (most - least) - amplitude).abs() < 3e-4 * amplitude + 2e-6);
}

#[test]
fn the_bundle_has_its_strength() {
    let workspace = Workspace::new();
    workspace.expect(0, &format!("run {} --out it", scene("bundle.ron")));
    let reactions = rows(&workspace, "it/reactions.csv");
    let on_first = reactions.iter().filter(|row| row[1] == 0.0);
    let strongest = on_first.map(|row| -row[2]).fold(0.0, f64::max);
    // (N + 1) K X/4 with so few springs.
    close(strongest, 50.25, 2e-3);
}

#[test]
fn the_chain_has_its_frequencies() {
    let workspace = Workspace::new();
    workspace.expect(
        0,
        &format!("modes {} -n 40 --out it", scene("chain-between-walls.ron")),
    );
    let modes = rows(&workspace, "it/modes.csv");
    assert_eq!(modes.len(), 40);
    for mode in modes {
        let omega = 2.0 * 250f64.sqrt() * (mode[0] * PI / 82.0).sin();
        close(mode[1] * TAU, omega, 1e-10);
    }
}
