//! The program as a script sees it: files, streams, exit codes.

mod common;

use common::real_scenes;
use common::workspace::Workspace;
use serde_json::Value;
use springs::io::read_scene;
use std::io::Write as _;
use std::process::Stdio;

/// What scripts rely on in report.json.
const PROMISED_FIELDS: [&str; 30] = [
    "/method",
    "/tangent",
    "/threads",
    "/nodes",
    "/springs",
    "/unknowns",
    "/steps",
    "/rejected_steps",
    "/force_evaluations",
    "/symbolic_factorizations",
    "/factorizations",
    "/solves",
    "/newton_iterations",
    "/clamped_springs",
    "/simulated_seconds",
    "/seconds/total",
    "/seconds/reading",
    "/seconds/setup",
    "/seconds/stepping",
    "/seconds/assembly",
    "/seconds/factorization",
    "/seconds/solve",
    "/seconds/output",
    "/seconds/trials",
    "/trials/factorizations",
    "/energy/turned_over",
    "/energy/start",
    "/energy/end",
    "/peak_memory_bytes",
    "/status",
];

/// What a scene asks for is written where the command line asks for nothing else; probes
/// always are.
#[test]
fn a_scene_says_what_is_written() {
    let workspace = Workspace::new();
    let scene = r#"Scene(
        version: 1,
        gravity: (0, 0, -10),
        nodes: [(position: (0, 0, 0), fixed: true), (position: (0, 0, -1), mass: 1)],
        springs: [(nodes: (0, 1), stiffness: 100, rest_length: 0.9)],
        simulation: (step: 0.1, duration: 0.5, method: TrBdf2),
        output: (
            write: [Csv, Springs],
            frames: 2,
            probes: [
                (spring: 0, of: [Strain, Tension], every: 0.2),
                (node: 1, of: [Position, Velocity]),
            ],
        ),
    )"#;
    std::fs::write(workspace.path("hanging.ron"), scene).unwrap();
    workspace.expect(0, "run hanging.ron --out asked");
    let asked = [
        "final.ron",
        "peaks.csv",
        "probes.csv",
        "report.json",
        "springs.csv",
    ];
    assert_eq!(
        workspace.names("asked"),
        [&asked[..], &["trajectory.csv"]].concat()
    );
    let probes = workspace.read("asked/probes.csv");
    let rows: Vec<Vec<&str>> = probes.lines().map(|row| row.split(',').collect()).collect();
    assert_eq!(rows[0].join(","), "time,item,index,quantity,value");
    let without_values: Vec<String> = rows[1..].iter().map(|row| row[..4].join(",")).collect();
    let mut expected = Vec::new();
    for (time, of) in [
        ("0.0", "spring node"),
        ("0.2", "spring"),
        ("0.25", "node"),
        ("0.4", "spring"),
        ("0.5", "node"),
    ] {
        for item in of.split(' ') {
            let (index, quantities) = match item {
                "spring" => (0, "strain tension"),
                _ => (1, "x y z vx vy vz"),
            };
            let quantities = quantities.split(' ');
            expected.extend(quantities.map(|name| format!("{time},{item},{index},{name}")));
        }
    }
    assert_eq!(without_values, expected);
    // It hangs at rest.
    let value = |row: &[&str]| row[4].parse::<f64>().unwrap();
    for row in &rows[1..] {
        let expected = match row[3] {
            "strain" => 0.1 / 0.9,
            "tension" => 10.0,
            "z" => -1.0,
            _ => 0.0,
        };
        assert!((value(row) - expected).abs() < 1e-12, "{row:?}");
    }

    workspace.expect(0, "run hanging.ron --out other --write energy");
    let other = ["energy.csv", "final.ron", "probes.csv", "report.json"];
    assert_eq!(workspace.names("other"), other);
    workspace.scene("net.ron", "cloth 3");
    let said = workspace.expect(2, "run net.ron --write probes");
    assert!(said.contains("the scene has no probes to write"), "{said}");
}

#[test]
fn a_run_writes_its_files() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 0.5");
    let said = workspace.expect(0, "run net.ron --write csv,svg --frames 4");
    assert!(said.contains("36 nodes"), "{said}");
    let mut files: Vec<String> = std::fs::read_dir(workspace.path("net"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(
        files,
        [
            "filmstrip.svg",
            "final.ron",
            "report.json",
            "trajectory.csv"
        ]
    );

    let report = workspace.report("net");
    assert_eq!(report["status"], "finished");
    assert_eq!(report["nodes"], 36);
    assert_eq!(report["unknowns"], 102);
    assert_eq!(report["steps"], 30);
    assert_eq!(report["simulated_seconds"], 0.5);
    assert_eq!(report["symbolic_factorizations"], 1);
    for field in PROMISED_FIELDS {
        assert!(report.pointer(field).is_some(), "{field}");
    }
    let number = |field: &str| report.pointer(field).unwrap().as_f64().unwrap();
    assert!(number("/seconds/total") >= number("/seconds/stepping"));
    let balance = number("/energy/start/total") + number("/energy/anchor_work")
        - number("/energy/dashpot_heat")
        + number("/energy/method_gain");
    assert!((balance - number("/energy/end/total")).abs() < 1e-12);

    let table = workspace.read("net/trajectory.csv");
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("time,node,x,y,z,vx,vy,vz"));
    assert_eq!(table.lines().count(), 1 + 5 * 36);
    assert!(table.lines().last().unwrap().starts_with("0.5,35,"));
    // The last frame is the final scene, bit for bit.
    let last = read_scene(&workspace.path("net/final.ron")).unwrap().0;
    for (node, line) in last.nodes.iter().zip(table.lines().skip(1 + 4 * 36)) {
        let numbers: Vec<f64> = line
            .split(',')
            .map(|number| number.parse().unwrap())
            .collect();
        assert_eq!(numbers[2..5], *node.position.as_slice());
        assert_eq!(numbers[5..8], *node.velocity.as_slice());
    }
}

#[test]
fn frames_do_not_change_the_steps() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 8 --duration 0.3");
    workspace.expect(0, "run chain.ron --out a --quiet");
    workspace.expect(0, "run chain.ron --out b --quiet --write csv --frames 77");
    assert_eq!(workspace.read("a/final.ron"), workspace.read("b/final.ron"));
    assert_eq!(
        workspace.read("b/trajectory.csv").lines().count(),
        1 + 78 * 9
    );
}

/// A duration that is a whole number of steps only within 1e-9.
#[test]
fn the_last_frame_is_the_final_state() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 4");
    for duration in ["100.00000005", "99.99999995", "100", "99.97"] {
        workspace.expect(
            0,
            &format!("run chain.ron --step 0.1 --duration {duration} --frames 4 --write csv --force --quiet"),
        );
        let table = workspace.read("chain/trajectory.csv");
        assert_eq!(table.lines().count(), 1 + 5 * 5, "{duration}");
        let last = table.lines().last().unwrap();
        assert!(
            last.starts_with(&format!("{:?},4,", duration.parse::<f64>().unwrap())),
            "{last}"
        );
        let x: f64 = last.split(',').nth(2).unwrap().parse().unwrap();
        assert_eq!(
            x,
            read_scene(&workspace.path("chain/final.ron"))
                .unwrap()
                .0
                .nodes[4]
                .position
                .x
        );
    }
}

#[test]
fn a_run_continues_from_its_final_scene() {
    let workspace = Workspace::new();
    workspace.scene("whole.ron", "cloth 5 --duration 0.5");
    workspace.expect(0, "run whole.ron --quiet");
    workspace.expect(0, "run whole.ron --quiet --duration 0.25 --out half");
    workspace.expect(0, "run half/final.ron --quiet --out rest");
    let whole = read_scene(&workspace.path("whole/final.ron")).unwrap().0;
    let rest = read_scene(&workspace.path("rest/final.ron")).unwrap().0;
    assert_eq!(whole.nodes, rest.nodes);
}

#[test]
fn results_are_not_overwritten() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 3 --duration 0.1");
    workspace.expect(0, "run chain.ron --quiet --write csv");
    let before = workspace.read("chain/final.ron");
    let said = workspace.expect(2, "run chain.ron --duration 0.2");
    assert!(
        said.contains("of another run") && said.contains("--force"),
        "{said}"
    );
    assert_eq!(workspace.read("chain/final.ron"), before);
    workspace.expect(0, "run chain.ron --quiet --duration 0.2 --force");
    assert_ne!(workspace.read("chain/final.ron"), before);
    assert!(
        !workspace.path("chain/trajectory.csv").exists(),
        "of the older run"
    );
    std::fs::write(workspace.path("file"), "in the way").unwrap();
    workspace.expect(2, "run chain.ron --out file --force");
    assert_eq!(workspace.read("file"), "in the way");
}

#[test]
fn a_method_on_the_command_line_takes_no_tangent_from_the_file() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 3 --duration 0.1");
    let text = workspace
        .read("chain.ron")
        .replace("step:", "tangent: Filtered, step:");
    std::fs::write(workspace.path("chain.ron"), text).unwrap();
    workspace.expect(0, "run chain.ron --quiet");
    assert_eq!(workspace.report("chain")["tangent"], "filtered");
    workspace.expect(0, "run chain.ron --quiet --force --method tr-bdf2");
    assert_eq!(workspace.report("chain")["tangent"], Value::Null);
    workspace.expect(0, "run chain.ron --force --method auto --tolerance 1e-3");
    assert!(
        workspace.report("chain")["reason"]
            .as_str()
            .unwrap()
            .contains("cheapest")
    );
}

#[test]
fn quiet_means_silent() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 3 --duration 0.1");
    assert_eq!(workspace.expect(0, "run chain.ron --quiet"), "");
}

#[test]
fn wrong_command_lines_exit_with_2_and_write_nothing() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 3");
    for arguments in [
        "",
        "walk chain.ron",
        "run",
        "run no-such-file.ron",
        "run .",
        "run chain.ron --method leapfrog",
        "run chain.ron --tangent secant",
        "run chain.ron --step 0",
        "run chain.ron --step -0.1",
        "run chain.ron --step nan",
        "run chain.ron --step 0.1 --tolerance 0.1",
        "run chain.ron --tolerance 0",
        "run chain.ron --method tr-bdf2 --tangent exact",
        "run chain.ron --duration -1",
        "run chain.ron --duration inf",
        "run chain.ron --frames 0",
        "run chain.ron --threads 0",
        "run chain.ron --write obj",
        "check",
        "check no-such-file.ron",
        "new",
        "new rope 3",
        "new chain 0",
        "new cloth 1",
        "new cloth 1000000000",
        "new chain 3 --mass -1",
        "new network no-such.csv --cutoff 1",
        "new chain 3 --stiffness nan",
        "new chain 3 --gravity 1,2",
    ] {
        workspace.expect(2, arguments);
    }
    let left = std::fs::read_dir(workspace.folder()).unwrap().count();
    assert_eq!(left, 1, "only the scene");
}

#[test]
fn a_failing_simulation_exits_with_3_and_keeps_its_frames() {
    let workspace = Workspace::new();
    // A stiff chain in explicit steps above the stability limit.
    workspace.scene("chain.ron", "chain 6 --disturbance 1e-3");
    let said = workspace.expect(
        3,
        "run chain.ron --method velocity-verlet --step 2e-3 --duration 100 --frames 50000 --write csv,svg",
    );
    assert!(said.contains("the energy diverged at node"), "{said}");
    assert!(said.contains("of 60000.0 N/m was"), "{said}");
    assert!(said.contains("need steps below 1.7e-3 s"), "{said}");
    let report = workspace.report("chain");
    assert_eq!(report["status"], "failed");
    let failure = &report["failure"];
    assert!(failure["node"].as_u64().unwrap() > 0);
    assert!(failure["reason"].as_str().unwrap().contains("node"));
    let steps = report["steps"].as_u64().unwrap();
    assert_eq!(failure["step"], steps + 1);
    let table = workspace.read("chain/trajectory.csv");
    let last = table.lines().last().unwrap();
    let last: f64 = last.split(',').next().unwrap().parse().unwrap();
    assert!(last > 0.0 && last <= report["simulated_seconds"].as_f64().unwrap());
    assert!(read_scene(&workspace.path("chain/final.ron")).is_ok());
    assert!(workspace.path("chain/filmstrip.svg").exists());
}

/// The numbers of a table without its header.
fn rows(table: &str) -> Vec<Vec<f64>> {
    let numbers = |line: &str| line.split(',').map(|n| n.parse().unwrap()).collect();
    table.lines().skip(1).map(numbers).collect()
}

/// energy.csv has a row for every frame of trajectory.csv, at the same time, also
/// where several frames lie in one step and in a scene of several parts; its
/// energies are those of the frame.
#[test]
fn energies_join_frames() {
    let workspace = Workspace::new();
    // Two parts: a net without rest lengths, in a plane no more, and a weight.
    let scene = "Scene(version: 1, gravity: (0, 0, -9.81),
        nodes: [(position: (0, 0, 0), fixed: true, velocity: (0, 0, 0.5)), (position: (1, 0, 0), mass: 0.5),
            (position: (0, 5, 0), fixed: true), (position: (0, 6, 0.5), mass: 2, velocity: (0.3, 0, 0))],
        springs: [(nodes: (0, 1), stiffness: 200, damping: 0.4), (nodes: (2, 3), stiffness: 40)],
        simulation: (duration: 1.5))";
    std::fs::write(workspace.path("two.ron"), scene).unwrap();
    for options in [
        "--method dop853 --tolerance 1e-8",
        "--method dop853 --tolerance 1e-8 --no-skip",
        "--method tr-bdf2 --step 0.02",
        "--tolerance 1e-6",
    ] {
        let more = "--write csv,energy --frames 97 --quiet --force";
        workspace.expect(0, &format!("run two.ron {options} {more}"));
        let (frames, energies) = (
            workspace.read("two/trajectory.csv"),
            workspace.read("two/energy.csv"),
        );
        let time = |line: &str| line.split(',').next().unwrap().to_owned();
        let of_frames: Vec<String> = frames.lines().skip(1).step_by(4).map(time).collect();
        let of_energies: Vec<String> = energies.lines().skip(1).map(time).collect();
        assert_eq!(of_frames, of_energies, "{options}");
        assert_eq!(of_frames.len(), 98);
        let masses = [0.0, 0.5, 0.0, 2.0];
        for (nodes, row) in rows(&frames).chunks(4).zip(rows(&energies)) {
            let free = || nodes.iter().zip(masses);
            let kinetic: f64 = free()
                .map(|(node, m)| 0.5 * m * node[5..8].iter().map(|v| v * v).sum::<f64>())
                .sum();
            let gravity: f64 = free().map(|(node, m)| 9.81 * m * node[4]).sum();
            let length = |a: usize, b: usize| -> f64 {
                let squares = (2..5).map(|k| (nodes[a][k] - nodes[b][k]).powi(2));
                squares.sum::<f64>().sqrt()
            };
            let elastic = 100.0 * (length(0, 1) - 1.0).powi(2)
                + 20.0 * (length(2, 3) - 1.25f64.sqrt()).powi(2);
            for (column, expected) in [(1, kinetic), (2, elastic), (3, gravity)] {
                let error = (row[column] - expected).abs();
                assert!(error < 1e-11 * (1.0 + expected.abs()), "{options}: {row:?}");
            }
            if options.contains("dop853") {
                // The flows are those of the frame's time, too.
                assert!(row[7].abs() < 1e-5, "{options}: {row:?}");
            }
        }
    }
}

#[test]
fn energies_of_a_run_in_fixed_steps() {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 6 --duration 0.5");
    workspace.expect(0, "run cloth.ron --write energy --frames 20 --quiet");
    let text = workspace.read("cloth/energy.csv");
    let header = "time,kinetic,elastic,gravity,total,anchor_work,dashpot_heat,method_gain,load_work,broken_energy";
    assert_eq!(text.lines().next(), Some(header));
    let table = rows(&text);
    assert_eq!(table.len(), 21);
    for row in &table {
        assert!((row[1] + row[2] + row[3] - row[4]).abs() < 1e-14);
    }
    assert_eq!(table[20][0], 0.5);
    assert!(table[20][1] > 0.0);
    // In steps that resolve everything, next to nothing is the method's own.
    workspace.expect(
        0,
        "run cloth.ron --out fine --method velocity-verlet --step 1e-4 --write energy --quiet",
    );
    let table = rows(&workspace.read("fine/energy.csv"));
    let last = table.last().unwrap();
    assert!(last[7].abs() < 1e-3 * last[1], "{last:?}");
}

/// What leaves the range of numbers is an error before it is written anywhere.
#[test]
fn no_file_gets_a_number_that_is_none() {
    let workspace = Workspace::new();
    let scene = |nodes: &str, more: &str| {
        let text = format!(
            "Scene(version: 1, nodes: [{nodes}],\n{more},\nsimulation: (method: VelocityVerlet, step: 1, duration: 100))"
        );
        std::fs::write(workspace.path("far.ron"), text).unwrap();
    };
    let no_springs = "springs: []";
    scene(
        "(position: (0, 0, 0), velocity: (1e153, 0, 0), fixed: true), (position: (1, 0, 0), mass: 1, velocity: (0, 1, 0))",
        no_springs,
    );
    let said = workspace.expect(2, "run far.ron");
    assert!(
        said.contains("node 0 is fixed and moves to 1e155 m"),
        "{said}"
    );
    assert!(said.contains("far.ron:1:"), "{said}");
    scene(
        "(position: (0, 0, 0), velocity: (1e160, 0, 0), mass: 1)",
        no_springs,
    );
    let said = workspace.expect(2, "run far.ron");
    assert!(
        said.contains("its kinetic energy is not a finite number"),
        "{said}"
    );
    scene(
        "(position: (0, 0, 1e100), mass: 1e100)",
        "gravity: (0, 0, -1e200), springs: []",
    );
    let said = workspace.expect(2, "run far.ron");
    assert!(said.contains("the energy at the start"), "{said}");
    // It falls until its energy is no number any more.
    scene(
        "(position: (0, 0, 0), mass: 1)",
        "gravity: (0, 0, -1e153), springs: []",
    );
    let said = workspace.expect(3, "run far.ron --write csv,energy --frames 100");
    assert!(said.contains("at node 0 in step"), "{said}");
    for name in ["trajectory.csv", "energy.csv", "report.json", "final.ron"] {
        let text = workspace.read(&format!("far/{name}"));
        let is_clean = ["NaN", "inf", "null,"]
            .iter()
            .all(|word| !text.contains(word));
        assert!(is_clean || name == "report.json", "{name}: {text}");
    }
    let report = workspace.report("far");
    assert!(report["energy"]["end"]["total"].is_number(), "{report}");
    let frames = rows(&workspace.read("far/trajectory.csv"));
    assert_eq!(frames.len() as u64, 1 + report["steps"].as_u64().unwrap());
    assert_eq!(rows(&workspace.read("far/energy.csv")).len(), frames.len());
    assert_eq!(report["failure"]["time"], frames.last().unwrap()[0]);
}

#[test]
fn scenes_come_through_pipes() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 4 --duration 0.1");
    let mut child = workspace
        .command("run - --quiet")
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let text = workspace.read("chain.ron");
    child
        .stdin
        .take()
        .unwrap()
        .write_all(text.as_bytes())
        .unwrap();
    assert!(child.wait().unwrap().success());
    workspace.expect(0, "run chain.ron --quiet");
    assert_eq!(
        workspace.read("scene/final.ron"),
        workspace.read("chain/final.ron")
    );
}

#[test]
fn check_runs_nothing_and_says_what_is_there() {
    let workspace = Workspace::new();
    workspace.scene(
        "block.ron",
        "block 3 --stiffness 1e9 --method velocity-verlet --step 0.01",
    );
    let output = workspace.springs("check block.ron");
    assert!(output.status.success());
    let said = String::from_utf8(output.stdout).unwrap();
    for part in [
        "27 nodes: 18 free, 9 fixed",
        "skipped",
        "an explicit method moves 54 unknowns",
        "may be unstable",
    ] {
        assert!(said.contains(part), "{part} in:\n{said}");
    }
    assert_eq!(std::fs::read_dir(workspace.folder()).unwrap().count(), 1);
}

#[test]
fn every_real_scene_runs() {
    let mut run = 0;
    for path in real_scenes() {
        let duration = read_scene(&path).unwrap().0.settings.duration.min(0.2);
        let workspace = Workspace::new();
        let checked = workspace.springs(&format!("check {}", path.display()));
        assert!(checked.status.success(), "{}", path.display());
        workspace.expect(
            0,
            &format!(
                "run {} --duration {duration:?} --write csv,svg --quiet",
                path.display()
            ),
        );
        run += 1;
    }
    assert!(run >= 4);
}

/// A name may hold what a terminal takes for commands, and line breaks.
#[test]
fn names_from_files_are_shown_as_text() {
    let workspace = Workspace::new();
    let scene = r#"Scene(version: 1, name: "\u{1b}]0;title\u{7}\u{1b}[31mred\nerror: <no> & \u{202e}",
        nodes: [(position: (0, 0, 0), velocity: (1, 0, 0), mass: 1)],
        simulation: (method: VelocityVerlet, step: 0.01, duration: 0.1))"#;
    std::fs::write(workspace.path("named.ron"), scene).unwrap();
    let checked = String::from_utf8(workspace.springs("check named.ron").stdout).unwrap();
    let said = workspace.expect(0, "run named.ron --write svg");
    let picture = workspace.read("named/filmstrip.svg");
    let hostile = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
    for text in [&checked, &said, &picture] {
        assert!(text.contains("\\u{1b}[31mred\\nerror"), "{text}");
        assert!(!text.contains(hostile), "{text:?}");
    }
    assert!(picture.contains("&lt;no&gt; &amp;"));
    // So is a file name.
    let missing = workspace.expect(2, "run no\u{1b}such.ron");
    assert!(!missing.contains(hostile), "{missing:?}");
}

/// The trial runs of these take hours, and a check makes none.
#[test]
fn check_makes_no_step() {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 8 --duration 1e4");
    for (how, settles) in [
        (
            "--method implicit-midpoint --tolerance 1e-12",
            "the number of equal steps",
        ),
        (
            "--method filtered-leapfrog --tolerance 1e-12",
            "the number of equal steps",
        ),
        (
            "--method auto --tolerance 1e-12",
            "the method and its steps",
        ),
    ] {
        let begin = std::time::Instant::now();
        let said = String::from_utf8(workspace.springs(&format!("check cloth.ron {how}")).stdout);
        let said = said.unwrap();
        let settled = format!("trial runs first; they settle {settles}");
        assert!(said.contains(&settled), "{said}");
        assert!(begin.elapsed().as_secs() < 60, "{how}");
    }
}

#[test]
fn check_finds_nothing_wrong_with_sound_scenes() {
    let workspace = Workspace::new();
    let mut paths = vec![];
    for (name, arguments) in [
        ("chain.ron", "chain 50 --tolerance 1e-3"),
        ("cloth.ron", "cloth 24 --tolerance 1e-3"),
        ("block.ron", "block 6 --tolerance 1e-3"),
    ] {
        workspace.scene(name, arguments);
        paths.push(workspace.path(name));
    }
    paths.extend(real_scenes());
    assert!(paths.len() >= 7);
    for path in paths {
        let output = workspace.springs(&format!("check {} --tolerance 1e-2", path.display()));
        let said = String::from_utf8(output.stdout).unwrap();
        for alarm in ["unit wrong", "is stiffness", "is damping", "is it"] {
            assert!(!said.contains(alarm), "{}:\n{said}", path.display());
        }
    }
}

/// Nothing that moves is 0 kg.
#[test]
fn check_tells_no_negative_zero() {
    let workspace = Workspace::new();
    let scene = "Scene(version: 1, nodes: [(position: (0, 0, 0), fixed: true)])";
    std::fs::write(workspace.path("one.ron"), scene).unwrap();
    let said = String::from_utf8(workspace.springs("check one.ron").stdout).unwrap();
    assert!(said.contains("  0 kg free to move"), "{said}");
}
