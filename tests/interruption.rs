//! Runs that are interrupted by signals, at any moment.

#![cfg(unix)]

mod common;

use common::workspace::{Workspace, signal, wait_until};
use springs::io::read_scene;
use std::process::{Command, Stdio};

/// Far more frames than anybody waits for.
const ENDLESS: &str = "run cloth.ron --out o --write csv --frames 1000000 --quiet";

fn endless_cloth() -> Workspace {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 8 --duration 1e6");
    workspace
}

/// Waits until a run has written some frames into `o`.
fn wait_for_frames(workspace: &Workspace) {
    wait_until("frames are written", || workspace.size("o") > 100_000);
}

/// What the signals mean to a process: a line of its status, of one bit a signal.
#[cfg(target_os = "linux")]
fn signal_mask(child: &std::process::Child, line: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let mask = status.lines().find_map(|text| text.strip_prefix(line));
    u64::from_str_radix(mask.unwrap().trim(), 16).unwrap()
}

#[test]
fn every_ending_signal_leaves_what_there_is() {
    for name in ["INT", "TERM", "HUP"] {
        let workspace = endless_cloth();
        let child = workspace.start_heard(ENDLESS);
        wait_for_frames(&workspace);
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{name}: {said}");
        assert!(said.contains("error: interrupted at "), "{said}");
        assert!(said.contains("`springs resume o`"), "{said}");
        let report = workspace.report("o");
        assert_eq!(report["status"], "interrupted");
        assert!(report["steps"].as_u64().unwrap() > 0);
        assert!(read_scene(&workspace.path("o/final.ron")).is_ok());
        assert!(workspace.read("o/trajectory.csv").ends_with('\n'));
        assert_eq!(
            workspace.names("o"),
            [
                "checkpoint.bin",
                "final.ron",
                "report.json",
                "trajectory.csv"
            ]
        );
    }
}

/// Interrupted on its way, with or without checkpoints asked for, a run goes on
/// as if nothing had been.
#[test]
fn an_interrupted_run_can_be_resumed() {
    for more in ["", "--checkpoint 0.1s"] {
        let workspace = Workspace::new();
        // Seconds of work, which nobody can have done in the time between two looks.
        workspace.scene("cloth.ron", "cloth 12 --duration 0.2 --step 5e-5");
        let options = "--write csv,energy,svg,view --frames 200 --quiet";
        workspace.expect(0, &format!("run cloth.ron --out whole {options}"));
        let mut child = workspace.start(&format!("run cloth.ron --out o {options} {more}"));
        wait_for_frames(&workspace);
        signal(&child, "INT");
        assert_eq!(child.wait().unwrap().code(), Some(130));
        let refused = workspace.expect(2, "run cloth.ron --out o --quiet");
        assert!(refused.contains("another run"), "{refused}");
        workspace.expect(0, "resume o --quiet");
        let names = [
            "final.ron",
            "trajectory.csv",
            "energy.csv",
            "filmstrip.svg",
            "view.html",
        ];
        for name in names {
            let (whole, resumed) = (format!("whole/{name}"), format!("o/{name}"));
            assert!(
                workspace.read(&whole) == workspace.read(&resumed),
                "{name} {more}"
            );
        }
        assert_eq!(workspace.report("o")["status"], "finished");
        let nothing = workspace.expect(2, "resume o");
        assert!(nothing.contains("holds no checkpoint"), "{nothing}");
    }
}

/// Both signals reach a program that was stopped, so they are there at once.
#[test]
fn a_second_signal_ends_the_program_at_once() {
    let workspace = endless_cloth();
    let mut child = workspace.start(ENDLESS);
    wait_for_frames(&workspace);
    signal(&child, "STOP");
    signal(&child, "INT");
    signal(&child, "TERM");
    signal(&child, "CONT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let names = workspace.names("o");
    let results: Vec<_> = names.iter().filter(|name| !name.starts_with('.')).collect();
    assert_eq!(results, Vec::<&String>::new(), "nothing was complete");
}

/// A scene that does not come.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_before_anything_is_written_ends_the_program_at_once() {
    for command in ["run - --out o", "study - --out o"] {
        let workspace = Workspace::new();
        let mut child = workspace
            .command(command)
            .stdin(Stdio::piped())
            .spawn()
            .unwrap();
        wait_until("signals are watched", || {
            signal_mask(&child, "SigCgt:") & 1 << 14 != 0
        });
        signal(&child, "TERM");
        // The pipe is held open until here.
        let input = child.stdin.take();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{command}");
        drop(input);
        assert!(!workspace.path("o").exists());
    }
}

/// As `nohup` has it.
#[cfg(target_os = "linux")]
#[test]
fn an_ignored_signal_stays_ignored() {
    let workspace = endless_cloth();
    let program = env!("CARGO_BIN_EXE_springs");
    let mut child = Command::new("sh")
        .args(["-c", &format!("trap '' HUP; exec {program} {ENDLESS}")])
        .current_dir(workspace.folder())
        .spawn()
        .unwrap();
    wait_for_frames(&workspace);
    assert_eq!(
        signal_mask(&child, "SigIgn:") & 1,
        1,
        "hangups are still ignored"
    );
    signal(&child, "HUP");
    let size = workspace.size("o");
    wait_until("the run goes on", || workspace.size("o") > size + 100_000);
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

/// A checkpoint is due whenever the run looks up.
#[test]
fn a_run_that_is_always_writing_checkpoints_can_be_interrupted() {
    for every in ["1", "0.0001s"] {
        let workspace = Workspace::new();
        std::fs::write(
            workspace.path("swing.ron"),
            "Scene(version: 1, nodes: [(position: (0, 0, 0), fixed: true), (position: (1, 0, 0), mass: 1)],
                springs: [(nodes: (0, 1), stiffness: 100)], gravity: (0, 0, -9.81),
                simulation: (method: VelocityVerlet, step: 0.0001, duration: 1e6))",
        )
        .unwrap();
        let mut child = workspace.start(&format!("run swing.ron --checkpoint {every} --out o"));
        wait_until("the first checkpoint is written", || {
            workspace.path("o/checkpoint.bin").exists()
        });
        signal(&child, "INT");
        assert_eq!(child.wait().unwrap().code(), Some(130), "{every}");
        assert_eq!(workspace.report("o")["status"], "interrupted");
    }
}

/// Scenes in several parts keep to the same intervals.
#[test]
fn parts_write_checkpoints_as_often_as_asked_for() {
    for every in ["100", "0.01s"] {
        let workspace = Workspace::new();
        std::fs::write(
            workspace.path("two.ron"),
            "Scene(version: 1, gravity: (0, 0, -9.81),
                nodes: [(position: (0, 0, 0), fixed: true), (position: (1, 0, 0), mass: 1), (position: (-1, 0, 0.5), mass: 1)],
                springs: [(nodes: (0, 1), stiffness: 100), (nodes: (0, 2), stiffness: 50)],
                simulation: (method: TrBdf2, step: 0.0001, duration: 1e6))",
        )
        .unwrap();
        let mut child = workspace.start(&format!("run two.ron --checkpoint {every} --out o"));
        let path = workspace.path("o/checkpoint.bin");
        // A round of all parts takes 62 500 s.
        let mut seen: Vec<Vec<u8>> = Vec::new();
        wait_until("several checkpoints are written", || {
            if let Ok(bytes) = std::fs::read(&path)
                && seen.last() != Some(&bytes)
            {
                seen.push(bytes);
            }
            seen.len() >= 4
        });
        signal(&child, "INT");
        assert_eq!(child.wait().unwrap().code(), Some(130), "{every}");
    }
}

/// Trial runs are part of the run: nothing is lost, and it can be resumed.
#[test]
fn a_run_can_be_interrupted_in_its_trial_runs() {
    let workspace = Workspace::new();
    workspace.scene(
        "cloth.ron",
        "cloth 16 --method implicit-midpoint --tolerance 1e-12",
    );
    let mut child = workspace.start("run cloth.ron --checkpoint 1s --out o --quiet");
    wait_until("the first checkpoint is written", || {
        workspace.path("o/checkpoint.bin").exists()
    });
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let report = workspace.report("o");
    assert_eq!(report["status"], "interrupted");
    assert_eq!(report["steps"], 0);
    assert!(workspace.path("o/checkpoint.bin").exists());
}

#[test]
fn a_checkpoint_that_is_not_sound_is_refused() {
    let workspace = Workspace::new();
    workspace.scene("cloth.ron", "cloth 6 --duration 1e3");
    // Too long to be finished.
    let mut child = workspace.start("run cloth.ron --checkpoint 10 --write csv --quiet");
    let (path, part) = (
        workspace.path("cloth/checkpoint.bin"),
        workspace.path("cloth/trajectory.csv.part"),
    );
    wait_until("frames are written", || {
        std::fs::metadata(&part).map_or(0, |part| part.len()) > 1_000_000
    });
    child.kill().unwrap();
    child.wait().unwrap();
    let sound = std::fs::read(&path).unwrap();
    let mut flipped = sound.clone();
    flipped[100] ^= 4;
    for bad in [&sound[..sound.len() / 2], &flipped, b"Scene("] {
        std::fs::write(&path, bad).unwrap();
        let error = workspace.expect(2, "resume cloth");
        let named = ["damaged", "not a checkpoint"]
            .iter()
            .any(|why| error.contains(why));
        assert!(named && error.contains("checkpoint.bin"), "{error}");
    }
    // That of another run: its trajectory is not the one here.
    std::fs::write(&path, &sound).unwrap();
    let rows = std::fs::read(&part).unwrap();
    std::fs::write(&part, &rows[..40]).unwrap();
    let error = workspace.expect(2, "resume cloth");
    assert!(error.contains("trajectory.csv.part"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), sound, "nothing was touched");
}
