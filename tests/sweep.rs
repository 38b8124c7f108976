//! Sweeps: many runs, any number of workers, some of which are killed.

mod common;

use common::Random;
use springs::io::parse_scene_with_inputs;
use springs::solver::Interrupt;
use springs::sweep::{Folder, Plan, Progress, RESULTS, Subject, measure};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const SPRINGS: &str = env!("CARGO_BIN_EXE_springs");

/// A weight on a wire. Where the steps are too long for velocity Verlet, a run fails.
const SCENE: &str = r#"Scene(
    version: 1,
    gravity: (0, 0, -9.81),
    materials: {"wire": (EA: 1000, damping_ratio: 0.05)},
    nodes: [(position: (0, 0, 0), fixed: true), (position: (0, 0, -1), mass: 2)],
    springs: [(nodes: (0, 1), material: "wire")],
    simulation: (method: VelocityVerlet, step: 0.001, duration: 0.5),
)"#;

fn springs(arguments: &str, folder: &Path) -> Command {
    let mut command = Command::new(SPRINGS);
    command
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .stdin(Stdio::null());
    command
}

fn with_scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("weight.ron"), SCENE).unwrap();
    folder
}

fn error(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn results(folder: &Path) -> String {
    std::fs::read_to_string(folder.join(RESULTS)).unwrap()
}

const GRID: &str = "--set EA=log:1e2:1e8:4 --set materials.wire.damping_ratio=0.01,0.1 \
                    --measure max(tension) --measure final(z[1]) --measure steps";

/// Each line is what the same run comes to by itself, the failed ones with why.
#[test]
fn a_table_has_what_each_run_comes_to() {
    let folder = with_scene();
    let here = folder.path();
    let run = format!("sweep weight.ron {GRID} --out out --workers 2");
    let output = springs(&run, here).output().unwrap();
    assert!(output.status.success(), "{}", error(&output));
    // EA of 1e8 takes steps below 0.3 ms.
    insta::assert_snapshot!(error(&output), @"8 of 8 runs are in `out/results.csv`; 2 failed");
    let table = results(&here.join("out"));
    let mut lines = table.lines();
    let header = "run,EA,materials.wire.damping_ratio,max(tension),final(z[1]),steps,failure";
    assert_eq!(lines.next(), Some(header));
    let (scene, options, inputs) = parse_scene_with_inputs("weight.ron", SCENE).unwrap();
    let subject = Subject {
        scene,
        options,
        inputs,
    };
    let axes = ["EA=log:1e2:1e8:4", "materials.wire.damping_ratio=0.01,0.1"];
    let measures = ["max(tension)", "final(z[1])", "steps"];
    let plan = Plan::new(
        subject,
        &axes.map(String::from),
        &measures.map(String::from),
    )
    .unwrap();
    for index in 0..plan.n_runs() {
        let run = plan.run(index).unwrap();
        let subject = plan.subject_of(&run).unwrap();
        let [ea, ratio] = run.values[..] else {
            panic!("two axes");
        };
        let line = lines.next().unwrap();
        match measure(&subject, plan.measures(), &Interrupt::default()) {
            Ok(measured) => {
                let [tension, z, steps] = measured[..] else {
                    panic!("three measures");
                };
                let expected = format!("{index},{ea:?},{ratio:?},{tension:?},{z:?},{steps:?},");
                assert_eq!(line, expected);
            }
            Err(why) => {
                assert_eq!(ea, 1e8);
                let begin = format!("{index},{ea:?},{ratio:?},,,,");
                let told = line.strip_prefix(&begin).unwrap();
                assert_eq!(told.trim_matches('"'), why.to_string());
            }
        }
    }
    assert_eq!(lines.next(), None);
    // The same again has nothing to do, and another one does not go there.
    assert!(springs(&run, here).status().unwrap().success());
    assert_eq!(results(&here.join("out")), table);
    let other = springs(&run.replace("0.01,0.1", "0.2"), here)
        .output()
        .unwrap();
    assert_eq!(other.status.code(), Some(2));
    insta::assert_snapshot!(error(&other), @r"
    error: `out` holds another sweep
      choose another folder with --out
    ");
}

#[test]
fn what_is_wrong_is_told_before_anything_is_written() {
    let folder = with_scene();
    let told = |arguments: &str| {
        let output = springs(arguments, folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        assert!(!folder.path().join("weight").exists());
        error(&output)
    };
    insta::assert_snapshot!([
        told("sweep weight.ron --set E=3 --measure steps"),
        told("sweep weight.ron --set EA=3,-3 --measure steps"),
        told("sweep weight.ron --set EA=3 --measure max(force)"),
        told("sweep work ."),
    ].concat(), @r"
    error: `E` cannot be set; of springs stiffness, EA, rest_length, prestrain, pretension, mass, mass_per_length, damping, damping_ratio, as `EA`, `springs.mass`, `springs[3].EA`, `springs[3:10].EA` or `materials.NAME.EA`; of nodes mass, drag, as `nodes.mass` or `nodes[3].mass`; a factor of `loads` or `loads[0]`; gravity, drag, damping.mass, damping.stiffness, step, tolerance, duration; with `*` at the end, a factor of what is there
    error: `EA` = -3.0: the stiffness of spring 0 must not be negative, but is -3
    error: `max(force)` is no measure; there are max(Q), min(Q) and final(Q), where Q is tension, strain (as tension[3], tension[3:10] or materials.NAME.tension, of some springs), x, y, z, vx, vy, vz, speed, displacement of a node (as z[3]), speed (of the fastest node), or an energy (kinetic, elastic, gravity, total, anchor_work, dashpot_heat, method, load_work, broken_energy); and steps, rejected_steps, estimated_error, seconds, broken_springs
    error: `.` is not the folder of a sweep
      make one with `springs sweep SCENE.ron --set … --measure …`
    ");
}

/// Kills workers at random until all runs are there.
fn survive(axes: &str, runs: usize, workers: usize, kills: usize, longest: Duration) {
    let folder = with_scene();
    let here = folder.path();
    let sweep = |out: &str, workers: usize| {
        let run = format!("sweep weight.ron {axes} --measure max(tension) --measure steps --quiet");
        let run = format!("{run} --out {out} --workers {workers}");
        assert!(springs(&run, here).status().unwrap().success());
    };
    sweep("whole", 1);
    let expected = results(&here.join("whole"));
    assert_eq!(expected.lines().count(), runs + 1);
    sweep("killed", 0);
    let start = || {
        let mut command = springs("sweep work killed --quiet", here);
        command.stderr(Stdio::null()).spawn().unwrap()
    };
    let mut random = Random(7);
    let mut started: Vec<Child> = (0..workers).map(|_| start()).collect();
    for kill in 0..kills {
        let part = random.between(0.0, 1.0);
        std::thread::sleep(longest.mul_f64(part));
        let victim = &mut started[kill % workers];
        let _ = victim.kill();
        victim.wait().unwrap();
        *victim = start();
    }
    for mut worker in started {
        assert!(worker.wait().unwrap().success());
    }
    // What was claimed by those that were killed last.
    assert!(start().wait().unwrap().success());
    assert_eq!(results(&here.join("killed")), expected);
    let progress = Folder::work(&here.join("killed"))
        .unwrap()
        .progress()
        .unwrap();
    let all = Progress {
        done: runs,
        failed: 0,
        runs,
    };
    assert_eq!(progress, all);
    for part in ["todo", "claimed"] {
        let left = std::fs::read_dir(here.join("killed").join(part)).unwrap();
        assert_eq!(left.count(), 0, "{part}");
    }
}

#[test]
fn killed_workers_leave_no_trace() {
    let axes = "--set EA=log:1e2:1e4:10 --set duration=lin:0.1:0.5:10";
    survive(axes, 100, 3, 12, Duration::from_millis(40));
}

/// As many as an afternoon of a small cluster has.
#[test]
#[ignore = "takes minutes"]
fn fifty_kills_in_ten_thousand_runs_leave_no_trace() {
    let axes = "--set EA=log:1e2:1e4:100 --set duration=lin:0.5:5:100";
    survive(axes, 10_000, 4, 50, Duration::from_millis(800));
}
