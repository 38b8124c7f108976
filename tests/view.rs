//! The page of `springs view` holds the numbers of the run, as exactly as it says.

mod common;

use common::tangle;
use common::workspace::Workspace;
use flate2::read::DeflateDecoder;
use serde_json::Value;
use springs::io::write_scene;
use springs::scene::generate::{Material, cloth};
use springs::scene::{
    BreakLimit, Load, Method, OverTime, RunOptions, Scene, SpringLaw, StepControl, Tangent, Vector3,
};
use std::io::Read as _;
use std::path::Path;
use std::process::Command;

/// The text of an element of the page.
fn text<'a>(page: &'a str, id: &str) -> &'a str {
    let (_, after) = page.split_once(&format!(" id=\"{id}\">")).unwrap();
    after.split_once("</script>").unwrap().0
}

fn inflated(page: &str, id: &str) -> Vec<u8> {
    let letters = text(page, id).trim_end_matches('=').bytes();
    let values = letters.map(|letter| match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' => 62,
        _ => 63,
    });
    let (mut bits, mut n_bits, mut bytes) = (0_u32, 0, Vec::new());
    for value in values {
        (bits, n_bits) = (bits << 6 | u32::from(value), n_bits + 6);
        if n_bits >= 8 {
            n_bits -= 8;
            bytes.push((bits >> n_bits) as u8);
        }
    }
    let mut inflated = Vec::new();
    let mut decoder = DeflateDecoder::new(&bytes[..]);
    decoder.read_to_end(&mut inflated).unwrap();
    inflated
}

fn reals(value: &Value) -> Vec<f64> {
    let numbers = value.as_array().unwrap().iter();
    numbers.map(|number| number.as_f64().unwrap()).collect()
}

/// All numbers of an array, frame by frame.
fn array(page: &str, id: &str, packed: &Value) -> Vec<f64> {
    let bytes = inflated(page, id);
    let size = |name: &str| packed[name].as_u64().unwrap() as usize;
    let (width, order) = (size("width"), size("order"));
    let (low, step) = (reals(&packed["low"]), reals(&packed["step"]));
    let mut frames: Vec<Vec<u16>> = Vec::new();
    for coded in bytes.chunks(2 * width) {
        let numbers = (0..width).map(|i| {
            let coded = u16::from_le_bytes([coded[i], coded[width + i]]);
            let difference = (coded >> 1) ^ (coded & 1).wrapping_neg();
            let back = |n: usize| i64::from(frames[frames.len() - n][i]);
            let predicted = match order.min(frames.len()) {
                0 => 0,
                1 => back(1),
                2 => 2 * back(1) - back(2),
                _ => 3 * back(1) - 3 * back(2) + back(3),
            };
            difference.wrapping_add(predicted as u16)
        });
        let numbers = numbers.collect();
        frames.push(numbers);
    }
    let numbers = frames.iter().flat_map(|frame| frame.iter().enumerate());
    let numbers = numbers.map(|(i, number)| {
        let component = i % low.len();
        low[component] + step[component] * f64::from(*number)
    });
    numbers.collect()
}

/// Columns of a table, row by row.
fn columns(text: &str, columns: std::ops::Range<usize>) -> Vec<f64> {
    let rows = text.lines().skip(1);
    let rows = rows.flat_map(|line| {
        let cells = line.split(',').skip(columns.start).take(columns.len());
        // A strain that there is not is zero in the page, which does not show it.
        cells.map(|cell| match cell {
            "" => 0.0,
            cell => cell.parse().unwrap(),
        })
    });
    rows.collect()
}

fn assert_near(found: &[f64], expected: &[f64], error: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        // Half a step, and rounding of the sum.
        let bound = error * (1.0 + 1e-9) + 1e-14 * expected.abs();
        assert!(
            (found - expected).abs() <= bound,
            "{what}: {found}, {expected}, {error}"
        );
    }
}

/// Runs a scene and compares its page with the tables; whether strains have an array of
/// their own.
fn check(scene: &Scene) -> bool {
    let workspace = Workspace::new();
    write_scene(&workspace.path("net.ron"), scene, &RunOptions::default()).unwrap();
    let said = workspace.expect(
        0,
        "run net.ron --out d --frames 30 --write csv,springs --view",
    );
    assert!(said.contains("open d/view.html in a browser"), "{said}");
    let page = workspace.read("d/view.html");
    let run: Value = serde_json::from_str(text(&page, "run")).unwrap();
    let arrays = &run["arrays"];
    let error = |value: &Value| value.as_f64().unwrap();
    let (nodes, springs) = (
        workspace.read("d/trajectory.csv"),
        workspace.read("d/springs.csv"),
    );
    let times: Vec<f64> = columns(&nodes, 0..1)
        .into_iter()
        .step_by(scene.nodes.len())
        .collect();
    // They are exact in the page, but `serde_json` may read the last bit otherwise.
    assert_near(&reals(&run["times"]), &times, 0.0, "times");
    assert_eq!(run["name"], scene.name);

    let positions = columns(&nodes, 2..5);
    let found = array(&page, "position", &arrays["position"]);
    assert_near(
        &found,
        &positions,
        error(&arrays["position"]["error"]),
        "position",
    );
    let size = positions.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    assert!(error(&arrays["position"]["error"]) <= 2.0 * size / 65535.0);

    let velocities = columns(&nodes, 5..8);
    let speed = |v: &[f64]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let speeds: Vec<f64> = velocities.chunks(3).map(speed).collect();
    let found = array(&page, "speed", &arrays["speed"]);
    assert_near(&found, &speeds, error(&arrays["speed"]["error"]), "speed");

    let tensions = columns(&springs, 4..5);
    let found = array(&page, "tension", &arrays["tension"]);
    assert_near(
        &found,
        &tensions,
        error(&arrays["tension"]["error"]),
        "tension",
    );

    // Both nodes of each spring, then its rest length, then 1 / (K l₀).
    let fixed = inflated(&page, "springs");
    let k = scene.springs.len();
    assert_eq!(fixed.len(), 24 * k);
    let ends = fixed[..8 * k]
        .chunks(4)
        .map(|word| u32::from_le_bytes(word.try_into().unwrap()));
    let expected = scene.springs.iter().flat_map(|spring| spring.nodes);
    assert!(ends.map(|node| node as usize).eq(expected));
    let words = fixed[8 * k..].chunks(8);
    let words: Vec<f64> = words
        .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
        .collect();
    let rest_lengths = scene.springs.iter().map(|spring| spring.rest_length);
    assert_eq!(words[..k], Vec::from_iter(rest_lengths));

    let has_strain = !arrays["strain"].is_null();
    let strains = if has_strain {
        array(&page, "strain", &arrays["strain"])
    } else {
        found
            .iter()
            .zip(words[k..].iter().cycle())
            .map(|(t, c)| t * c)
            .collect()
    };
    assert_near(
        &strains,
        &columns(&springs, 3..4),
        error(&arrays["strain_error"]),
        "strain",
    );

    let mut slack = inflated(&page, "slack");
    let width = k.div_ceil(8);
    for i in width..slack.len() {
        slack[i] ^= slack[i - width];
    }
    for (index, tension) in tensions.iter().enumerate() {
        let (frame, spring) = (index / k, index % k);
        let bit = slack[frame * width + spring / 8] >> (spring % 8) & 1;
        assert_eq!(bit == 1, *tension == 0.0, "{frame}, {spring}");
    }

    let energy = workspace.read("d/energy.csv");
    let names: Vec<&str> = energy.lines().next().unwrap().split(',').skip(1).collect();
    assert_eq!(run["energies"]["names"], serde_json::json!(names));
    for (column, values) in run["energies"]["columns"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
    {
        let expected = columns(&energy, column + 1..column + 2);
        assert_near(&reals(values), &expected, 0.0, "energies");
    }

    // The same page again.
    std::fs::remove_file(workspace.path("d/view.html")).unwrap();
    workspace.expect(0, "view d");
    assert_eq!(workspace.read("d/view.html"), page);
    // And from the tables, whose numbers are the same.
    std::fs::remove_file(workspace.path("d/trajectory.npz")).unwrap();
    workspace.expect(0, "view d --quiet");
    assert!(workspace.read("d/view.html") == page);
    has_strain
}

/// A net that tears: some of its springs yield before.
fn torn() -> Scene {
    let mut scene = cloth(5, Material::of_cloth());
    scene.laws = vec![SpringLaw::Plastic {
        yields_at: 0.02,
        hardening: 1.0,
    }];
    for (k, spring) in scene.springs.iter_mut().enumerate() {
        spring.breaks_at = Some(BreakLimit::Force(0.03 + 0.002 * (k % 9) as f64));
        spring.law = (k % 3 == 0 && spring.stiffness > 1.0).then_some(0);
    }
    scene.loads = vec![Load {
        name: String::new(),
        nodes: vec![0, 24, 12],
        force: Vector3::new(0.0, 0.0, -2.0),
        over_time: OverTime::Ramp { from: 0.1, to: 0.3 },
    }];
    scene.settings.duration = 0.4;
    scene.settings.method = Method::VelocityVerlet;
    scene.settings.step = StepControl::Fixed(1e-4);
    scene
}

/// The page knows from which frame on springs are broken or have yielded, and has the loads as
/// they are at the end.
#[test]
fn the_page_marks_broken_and_yielded_springs_and_loads() {
    let workspace = Workspace::new();
    let scene = torn();
    write_scene(&workspace.path("net.ron"), &scene, &RunOptions::default()).unwrap();
    workspace.expect(
        0,
        "run net.ron --out d --frames 40 --write springs --view --quiet",
    );
    let page = workspace.read("d/view.html");
    let changes = inflated(&page, "changes");
    let words = changes
        .chunks(4)
        .map(|word| u32::from_le_bytes(word.try_into().unwrap()));
    let words: Vec<u32> = words.collect();
    let table = workspace.read("d/springs.csv");
    let states: Vec<&str> = table
        .lines()
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap())
        .collect();
    let k = scene.springs.len();
    let first = |spring: usize, state: &str| {
        let mut frames = states.iter().skip(spring).step_by(k);
        frames
            .position(|found| *found == state)
            .map_or(u32::MAX, |frame| frame as u32)
    };
    for spring in 0..k {
        assert_eq!(words[spring], first(spring, "broken"), "broken {spring}");
        assert_eq!(
            words[k + spring],
            first(spring, "yielded"),
            "yielded {spring}"
        );
    }
    let changed = |words: &[u32]| words.iter().filter(|&&frame| frame != u32::MAX).count();
    assert!(
        changed(&words[..k]) > 3 && changed(&words[k..]) > 3,
        "{words:?}"
    );
    let run: Value = serde_json::from_str(text(&page, "run")).unwrap();
    let load = &run["loads"][0];
    // Those on fixed nodes, the corners, are not drawn.
    let free = |node: &usize| !scene.nodes[*node].fixed;
    let nodes: Vec<usize> = vec![0, 24, 12].into_iter().filter(free).collect();
    assert_eq!(load["nodes"], serde_json::json!(nodes));
    assert_eq!(load["over_time"]["kind"], "ramp");
    assert_near(
        &[load["over_time"]["to"].as_f64().unwrap()],
        &[-0.1],
        1e-12,
        "ramp",
    );
}

/// Energies of very many frames are thinned, and the last one is there.
#[test]
fn a_page_has_no_more_energies_than_its_plots_show() {
    let workspace = Workspace::new();
    let scene = "Scene(version: 1, nodes: [(position: (0, 0, 0), velocity: (1, 0, 0), mass: 1)],
        simulation: (method: VelocityVerlet, step: 0.01, duration: 40))";
    std::fs::write(workspace.path("one.ron"), scene).unwrap();
    workspace.expect(0, "run one.ron --out d --frames 3500 --view --quiet");
    let page = workspace.read("d/view.html");
    let run: Value = serde_json::from_str(text(&page, "run")).unwrap();
    let times = reals(&run["energies"]["times"]);
    assert!(times.len() <= 1001 && times.len() > 500, "{}", times.len());
    assert_eq!((times[0], times[times.len() - 1]), (0.0, 40.0));
    assert_eq!(reals(&run["times"]).len(), 3501);
    for column in run["energies"]["columns"].as_array().unwrap() {
        assert_eq!(reals(column).len(), times.len());
    }
    assert!(page.len() < 500_000, "{}", page.len());
}

fn scene() -> Scene {
    let mut scene = tangle(20, 3);
    scene.name = "a </script> {{script}} & more".to_owned();
    scene.settings.duration = 0.5;
    scene.settings.step = StepControl::Fixed(1e-3);
    scene.settings.method = Method::LinearlyImplicitEuler;
    scene
}

#[test]
fn the_page_holds_the_run_as_exactly_as_it_says() {
    let mut cloth = cloth(5, Material::of_cloth());
    cloth.settings.duration = 0.5;
    cloth.settings.method = Method::VelocityVerlet;
    cloth.settings.step = StepControl::Fixed(1e-3);
    assert!(!check(&cloth), "tensions say what strains are");
    let mut scene = scene();
    scene.springs[3].stiffness = 0.0;
    scene.springs[4].rest_length = 0.0;
    assert!(check(&scene), "a spring without tension has strains");
    // Tensions that the steps carry along are not those of the positions.
    scene.settings.tangent = Some(Tangent::Filtered);
    scene.settings.step = StepControl::Fixed(0.05);
    assert!(check(&scene));
}

#[test]
fn without_frames_it_says_what_to_run() {
    let workspace = Workspace::new();
    write_scene(&workspace.path("net.ron"), &scene(), &RunOptions::default()).unwrap();
    let said = workspace.expect(2, "view .");
    assert!(said.contains("holds no run: it has no final.ron"), "{said}");
    assert!(
        said.contains("springs run SCENE.ron --out DIR --view"),
        "{said}"
    );
    workspace.expect(0, "run net.ron --out d");
    let said = workspace.expect(2, "view d");
    assert!(
        said.contains("d has neither trajectory.npz nor trajectory.csv with springs.csv to show"),
        "{said}"
    );
    assert!(
        said.contains("springs run SCENE.ron --out DIR --view"),
        "{said}"
    );
    std::fs::write(workspace.path("d/trajectory.npz"), "no archive").unwrap();
    let said = workspace.expect(2, "view d");
    assert!(
        said.contains("is not as the output `npz` of a run leaves it"),
        "{said}"
    );
    assert!(!workspace.path("d/view.html").exists());
}

/// What a person sees of a page in a browser of this size.
fn look(page: &Path, [width, height]: [&str; 2]) -> Value {
    let chromium = std::env::var("SPRINGS_CHROMIUM").unwrap_or_else(|_| "chromium".to_owned());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign/look.mjs");
    let output = Command::new("node")
        .arg(&script)
        .arg(&chromium)
        .arg(page)
        .args([width, height])
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
#[ignore = "needs node, and a Chromium named by SPRINGS_CHROMIUM"]
fn a_browser_marks_loads_and_what_became_of_springs() {
    let workspace = Workspace::new();
    write_scene(&workspace.path("net.ron"), &torn(), &RunOptions::default()).unwrap();
    workspace.expect(0, "run net.ron --out d --frames 40 --view --quiet");
    let seen = look(&workspace.path("d/view.html"), ["1280", "800"]);
    assert_eq!(seen["problems"], serde_json::json!([]));
    let marks = seen["marks"].as_array().unwrap();
    for mark in ["broken", "yielded", "load, 2 N at most", "fixed"] {
        assert!(marks.contains(&mark.into()), "{mark} in {marks:?}");
    }
    // At the end the ramp has risen, and the arrow points down.
    assert_near(
        &reals(&seen["arrow"]["force"]),
        &[0.0, 0.0, -2.0],
        1e-12,
        "force",
    );
    let arrow = reals(&seen["arrow"]["vector"]);
    assert!(
        arrow[2] < 0.0 && arrow[0].abs() + arrow[1].abs() < 1e-6 * -arrow[2],
        "{arrow:?}"
    );
}

/// `SPRINGS_CHROMIUM=chromium cargo test --test view -- --ignored`, with node.
#[test]
#[ignore = "needs node, and a Chromium named by SPRINGS_CHROMIUM"]
fn a_browser_shows_what_is_picked() {
    let workspace = Workspace::new();
    write_scene(&workspace.path("net.ron"), &scene(), &RunOptions::default()).unwrap();
    workspace.expect(0, "run net.ron --out d --frames 30 --write csv --view");
    for size in [["390", "844"], ["1280", "800"]] {
        let seen = look(&workspace.path("d/view.html"), size);
        assert_eq!(seen["problems"], serde_json::json!([]));
        assert_eq!(seen["unnamed"], serde_json::json!([]));
        assert_eq!(seen["isWider"], false);
        assert_eq!(
            (&seen["isPlaying"], &seen["isStopped"]),
            (&Value::from(true), &Value::from(true))
        );
        assert!(seen["turned"].as_f64().unwrap() != 0.0);
        let distances = reals(&seen["distances"]);
        assert!(distances[1] < distances[0] && distances[2] < 0.5 * distances[1]);
        assert_eq!(seen["pickedNode"]["kind"], "node");
        assert_eq!(seen["pickedNode"]["index"], seen["node"]);
        assert_eq!(seen["pickedSpring"]["kind"], "spring");
        assert!(seen["plots"].as_u64().unwrap() >= 3);
        // What is said of the picked node is in the table.
        let table = workspace.read("d/trajectory.csv");
        let time = seen["numbers"]["time"].as_f64().unwrap();
        let start = format!("{time:?},{},", seen["node"]);
        let row = table.lines().find(|line| line.starts_with(&start)).unwrap();
        let expected: Vec<f64> = row
            .split(',')
            .skip(2)
            .map(|cell| cell.parse().unwrap())
            .collect();
        let found = reals(&seen["numbers"]["position"]);
        assert_near(&found, &expected[..3], 1e-4, "position");
        for (shown, expected) in seen["values"]
            .as_array()
            .unwrap()
            .iter()
            .zip(&expected[..3])
        {
            let shown = shown.as_str().unwrap().replace('−', "-").replace(" m", "");
            assert_near(&[shown.parse().unwrap()], &[*expected], 2e-4, "as text");
        }
    }
}
