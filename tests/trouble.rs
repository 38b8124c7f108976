//! Runs whose folder, disk or checkpoint is in trouble.

#![cfg(unix)]

mod common;

use common::append;
use common::workspace::{Workspace, all_files, signal, wait_until};
use springs::io::{Checkpoint, read_checkpoint, read_scene, scene_to_string, write_checkpoint};
use std::process::Output;
use std::time::{Duration, Instant};

const RESULTS: [&str; 4] = ["final.ron", "trajectory.csv", "energy.csv", "filmstrip.svg"];

/// Runs the program with files limited to about so many kilobytes (or half of
/// that, where the shell counts so).
fn with_small_files(workspace: &Workspace, kilobytes: u32, arguments: &str) -> Output {
    workspace.springs_within(&format!("-f {kilobytes}"), arguments)
}

#[test]
fn old_results_stay_until_there_are_new_ones() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 0.2");
    workspace.expect(0, "run net.ron --out d --write csv,svg --quiet");
    let old = all_files(&workspace.path("d"));
    // It goes on in place, and is killed.
    let options = "--duration 1e6 --write csv --frames 1000000 --force --quiet";
    let mut child = workspace.start(&format!("run d/final.ron --out d {options}"));
    let size = workspace.size("d");
    wait_until("frames are written", || {
        workspace.size("d") > size + 100_000
    });
    child.kill().unwrap();
    child.wait().unwrap();
    let mut left = all_files(&workspace.path("d"));
    left.retain(|name, _| !name.starts_with(".springs-"));
    assert!(left == old, "of the older run: {:?}", workspace.names("d"));
    // The next one comes to its end: what it does not write is gone, and so is
    // what the killed one left.
    workspace.expect(0, "run d/final.ron --out d --force --quiet");
    assert_eq!(workspace.names("d"), ["final.ron", "report.json"]);
    assert!(workspace.read("d/final.ron").as_bytes() != old["final.ron"]);
}

#[test]
fn a_scene_is_not_replaced_by_something_else() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 4 --duration 0.1");
    std::fs::create_dir(workspace.path("d")).unwrap();
    std::fs::copy(
        workspace.path("net.ron"),
        workspace.path("d/trajectory.csv"),
    )
    .unwrap();
    let said = workspace.expect(2, "run d/trajectory.csv --out d --force");
    assert!(said.contains("is a file that this run writes"), "{said}");
    assert_eq!(workspace.names("d"), ["trajectory.csv"]);
    assert_eq!(
        workspace.read("d/trajectory.csv"),
        workspace.read("net.ron")
    );
}

#[test]
fn two_runs_do_not_share_a_folder() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 1e6");
    workspace.scene("short.ron", "cloth 4 --duration 0.1");
    let mut child = workspace.start("run net.ron --out d --checkpoint 100 --write csv --quiet");
    wait_until("a checkpoint", || {
        workspace.path("d/checkpoint.bin").exists()
    });
    for arguments in [
        "run short.ron --out d --force",
        "resume d",
        "study short.ron --out d --budget 1",
        "study short.ron --out d --budget 1 --stability --force",
    ] {
        let said = workspace.expect(2, arguments);
        assert!(
            said.contains("another run is writing into the folder `d`"),
            "{said}"
        );
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // A killed run locks nothing.
    workspace.expect(0, "run short.ron --out d --force --quiet");
    assert_eq!(workspace.names("d"), ["final.ron", "report.json"]);
}

#[test]
fn a_study_knows_beforehand_whether_it_can_write() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 24 --duration 1");
    std::fs::write(workspace.path("file"), "in the way").unwrap();
    let begin = Instant::now();
    let said = workspace.expect(1, "study net.ron --out file/d --budget 60");
    assert!(said.contains("cannot write file/d"), "{said}");
    assert!(begin.elapsed() < Duration::from_secs(10));
    // What it had made for its results goes with them.
    workspace.expect(2, "study net.ron --out d --budget 1e-6");
    assert!(!workspace.path("d").exists());
}

#[test]
fn a_run_that_finds_no_room_can_go_on() {
    for more in ["", "--checkpoint 0.05s"] {
        let workspace = Workspace::new();
        workspace.scene("net.ron", "cloth 8 --duration 1");
        let options = format!("--write csv,energy,svg --frames 300 {more}");
        workspace.expect(0, &format!("run net.ron --out whole --quiet {options}"));
        assert!(workspace.read("whole/trajectory.csv").len() > 2_000_000);

        let output = with_small_files(&workspace, 1000, &format!("run net.ron --out d {options}"));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("cannot write d/trajectory.csv: "), "{said}");
        assert!(
            said.contains(
                "saved are trajectory.csv.part, energy.csv.part, final.ron, report.json, checkpoint.bin"
            ),
            "{said}"
        );
        assert_eq!(
            workspace.names("d"),
            [
                "checkpoint.bin",
                "energy.csv.part",
                "final.ron",
                "report.json",
                "trajectory.csv.part"
            ]
        );
        assert!(read_scene(&workspace.path("d/final.ron")).is_ok());
        assert_eq!(workspace.report("d")["status"], "interrupted");
        // As long as there is no room, nothing is lost.
        let output = with_small_files(&workspace, 1000, "resume d --quiet");
        assert_eq!(output.status.code(), Some(1));

        workspace.expect(0, "resume d --quiet");
        for name in RESULTS {
            let (whole, resumed) = (format!("whole/{name}"), format!("d/{name}"));
            assert!(
                workspace.read(&whole) == workspace.read(&resumed),
                "{name} {more}"
            );
        }
    }
}

#[test]
fn a_run_without_any_room_says_so() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 8 --duration 0.1");
    for options in ["--write csv", "--checkpoint 1", ""] {
        let output = with_small_files(&workspace, 1, &format!("run net.ron --out d {options}"));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: cannot write d/"), "{said}");
        assert!(said.contains("  it had come to ") || said.contains("  nothing of the run"));
        let names = workspace.names("d");
        assert!(!names.contains(&"final.ron".to_owned()), "{names:?}");
        std::fs::remove_dir_all(workspace.path("d")).unwrap();
    }
}

/// Nobody may write there, not even root.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_to_is_noticed_at_the_start() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 8 --duration 1e9");
    let said = workspace.expect(1, "run net.ron --out /proc");
    assert!(said.contains("cannot write /proc/final.ron"), "{said}");
}

#[test]
fn a_folder_that_is_removed_is_made_again() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 1e6");
    let mut child = workspace.start("run net.ron --out d --checkpoint 1e5s --quiet");
    wait_until("a checkpoint", || {
        workspace.path("d/checkpoint.bin").exists()
    });
    std::fs::remove_dir_all(workspace.path("d")).unwrap();
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(
        workspace.names("d"),
        ["checkpoint.bin", "final.ron", "report.json"]
    );
    // Its table is gone with the folder.
    let options = "--write csv --frames 1000000 --force --quiet";
    let child = workspace.start_heard(&format!("run net.ron --out d {options}"));
    let size = workspace.size("d");
    wait_until("frames are written", || {
        workspace.size("d") > size + 100_000
    });
    std::fs::remove_dir_all(workspace.path("d")).unwrap();
    signal(&child, "INT");
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot write d/trajectory.csv: "), "{said}");
    assert!(
        said.contains("saved are final.ron, report.json\n"),
        "{said}"
    );
}

/// What is not there is not saved.
#[test]
fn a_kept_table_that_is_gone_is_not_said_to_be_saved() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 1e6");
    let options = "--write csv --frames 1000000 --checkpoint 1e6s --quiet";
    let child = workspace.start_heard(&format!("run net.ron --out d {options}"));
    wait_until("frames are written", || workspace.size("d") > 100_000);
    std::fs::remove_dir_all(workspace.path("d")).unwrap();
    std::fs::write(workspace.path("d"), "in the way").unwrap();
    signal(&child, "INT");
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("nothing of the run could be saved"), "{said}");
}

#[test]
fn a_table_that_was_changed_or_removed_is_not_continued() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 1e6");
    let mut child = workspace.start("run net.ron --out d --write csv --frames 1000000 --quiet");
    wait_until("frames are written", || workspace.size("d") > 100_000);
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let sound = all_files(&workspace.path("d"));
    let path = workspace.path("d/trajectory.csv");

    std::fs::write(&path, "time,node\n").unwrap();
    let said = workspace.expect(2, "resume d");
    assert!(
        said.contains("trajectory.csv is not what the run"),
        "{said}"
    );
    std::fs::remove_file(&path).unwrap();
    let said = workspace.expect(2, "resume d");
    assert!(said.contains("trajectory.csv is gone"), "{said}");
    assert_eq!(
        workspace.names("d"),
        ["checkpoint.bin", "final.ron", "report.json"]
    );

    // Put back, it is continued.
    std::fs::write(&path, &sound["trajectory.csv"]).unwrap();
    let mut child = workspace.start("resume d --quiet");
    let size = workspace.size("d");
    wait_until("frames are written", || {
        workspace.size("d") > size + sound["trajectory.csv"].len() as u64 + 100_000
    });
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let longer = std::fs::read(&path).unwrap();
    assert!(longer.len() > sound["trajectory.csv"].len());
    assert!(longer.starts_with(&sound["trajectory.csv"]));
}

/// One table is as it was left and longer, the other one is not: both stay.
#[test]
fn no_table_is_cut_if_another_one_was_changed() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 6 --duration 1e6");
    let options = "--write csv,energy --frames 10000000 --checkpoint 50000s --quiet";
    let mut child = workspace.start(&format!("run net.ron --out d {options}"));
    // Frames after the checkpoint at the start.
    wait_until("frames are written", || workspace.size("d") > 1_000_000);
    child.kill().unwrap();
    child.wait().unwrap();
    std::fs::write(workspace.path("d/energy.csv.part"), "time,kinetic\n").unwrap();
    let left = all_files(&workspace.path("d"));
    let said = workspace.expect(2, "resume d");
    assert!(
        said.contains("energy.csv.part is not what the run"),
        "{said}"
    );
    assert!(
        all_files(&workspace.path("d")) == left,
        "nothing is changed"
    );
}

#[test]
fn checkpoints_of_an_earlier_form_are_refused() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 2 --duration 1e5");
    let mut child = workspace.start("run chain.ron --out d --quiet");
    wait_until("the run is on its way", || workspace.path("d").exists());
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let path = workspace.path("d/checkpoint.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    let version = b"springs checkpoint\n".len();
    bytes[version] = 2;
    std::fs::write(&path, bytes).unwrap();
    let left = all_files(&workspace.path("d"));
    let said = workspace.expect(2, "resume d");
    assert!(said.contains("has version 2 of checkpoints"), "{said}");
    assert!(
        said.contains("  go on with the program that wrote it, or start the run again with"),
        "{said}"
    );
    assert!(all_files(&workspace.path("d")) == left);
}

/// A sound check sum, and a content that no run has written.
#[test]
fn checkpoints_with_impossible_content_do_no_harm() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 2 --duration 1e5");
    let options = "--write svg --frames 4 --checkpoint 1s --quiet";
    let mut child = workspace.start(&format!("run chain.ron --out d {options}"));
    let path = workspace.path("d/checkpoint.bin");
    let mut first = None;
    wait_until("steps are made", || {
        let now = std::fs::read(&path).ok();
        first = first.take().or_else(|| now.clone());
        now != first
    });
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let Checkpoint { about, words } = read_checkpoint(&path).unwrap();

    let refused = |about: &str, words: &[u64]| {
        let (about, words) = (about.to_owned(), words.to_vec());
        write_checkpoint(&path, &Checkpoint { about, words }).unwrap();
        let output = workspace.springs("resume d");
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("the run cannot go on from"), "{said}");
    };
    // Not a number, infinity: at the places where the state has numbers.
    let mut n_reals = 0;
    for index in 0..words.len() {
        let real = f64::from_bits(words[index]);
        if !(real.is_normal() && (1e-9..1e9).contains(&real.abs())) {
            continue;
        }
        n_reals += 1;
        let mut changed = words.clone();
        changed[index] = f64::NAN.to_bits();
        refused(&about, &changed);
    }
    assert!(n_reals > 10, "{n_reals} numbers in the state");
    for (sound, wrong) in [
        ("\"intervals\":4", "\"intervals\":9223372036854775808"),
        ("\"intervals\":4", "\"intervals\":0"),
        ("[[0,[[", "[[9218868437227405312,[["),
        ("[[0,[[", "[[0,[]],[0,[["),
    ] {
        assert!(about.contains(sound), "{about}");
        refused(&about.replacen(sound, wrong, 1), &words);
    }
}

/// Whatever a message quotes neither colours a terminal nor fills it.
#[test]
fn messages_are_plain_and_short() {
    let workspace = Workspace::new();
    let long = "V".repeat(3_000_000);
    std::fs::write(
        workspace.path("long.ron"),
        format!(
            "Scene(version: 1, nodes: [(position: (0, 0, 0), mass: 1)],
                simulation: (method: {long}, step: 0.01, duration: 0.1))"
        ),
    )
    .unwrap();
    workspace.scene("chain.ron", "chain 2 --duration 0.1");
    let red = "run chain.ron --quiet --out \u{1b}[31mred";
    workspace.expect(0, red);
    for arguments in ["run long.ron", red, "check \u{1b}[31m.ron"] {
        let said = workspace.expect(2, arguments);
        let is_plain = |c: char| c == '\n' || !c.is_control();
        assert!(said.chars().all(is_plain), "{arguments}: {said:?}");
        assert!(said.len() < 10_000, "{arguments}: {} bytes", said.len());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn standard_output_that_is_full_is_no_wrong_command() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 8 --duration 1");
    for arguments in ["new cloth 4", "check net.ron"] {
        let full = std::fs::File::create("/dev/full").unwrap();
        let output = workspace.command(arguments).stdout(full).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("cannot write standard output: "), "{said}");
    }
}

/// Devices give bytes for ever.
#[cfg(target_os = "linux")]
#[test]
fn what_has_no_end_is_no_scene() {
    let workspace = Workspace::new();
    let said = workspace.expect(2, "check /dev/zero");
    assert!(
        said.contains("/dev/zero is not a scene file: byte 0 is zero"),
        "{said}"
    );
    let zeros = std::fs::File::open("/dev/zero").unwrap();
    let output = workspace
        .command("run - --out o")
        .stdin(zeros)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    workspace.expect(2, "check /dev/urandom");
}

#[test]
fn odd_names_of_scenes_stay_in_the_folder() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 2 --duration 0.1");
    std::fs::create_dir(workspace.path("here")).unwrap();
    for name in ["...ron", "..ron", "-.ron"] {
        std::fs::copy(
            workspace.path("chain.ron"),
            workspace.path("here").join(name),
        )
        .unwrap();
        let mut command = workspace.command("run --quiet --force --");
        let status = command
            .arg(name)
            .current_dir(workspace.path("here"))
            .status();
        assert!(status.unwrap().success(), "{name}");
    }
    assert_eq!(workspace.names(""), ["chain.ron", "here"]);
    assert_eq!(
        workspace.names("here"),
        ["-.ron", "...ron", "..ron", "scene"]
    );
}

#[test]
fn far_too_many_threads_are_as_many_as_help() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 40 --step 1e-2 --duration 0.03");
    workspace.expect(0, "run net.ron --threads 1 --out one --quiet");
    workspace.expect(0, "run net.ron --threads 4294967295 --out many --quiet");
    assert!(workspace.report("many")["threads"].as_u64().unwrap() <= 256);
    assert_eq!(
        workspace.read("one/final.ron"),
        workspace.read("many/final.ron")
    );
    workspace.expect(2, "run net.ron --threads 4294967296 --out more");
}

/// Stacks of 128 MB in 2 GB are few of 256, and there is no room for any of 1 TB.
#[cfg(target_os = "linux")]
#[test]
fn what_no_threads_can_be_started_for_is_done_by_fewer() {
    let workspace = Workspace::new();
    workspace.scene("net.ron", "cloth 24 --step 1e-2 --duration 0.03");
    let (net, options) = read_scene(&workspace.path("net.ron")).unwrap();
    let mut nets = net.clone();
    append(&mut nets, &net);
    append(&mut nets, &net);
    std::fs::write(workspace.path("nets.ron"), scene_to_string(&nets, &options)).unwrap();
    for scene in ["net", "nets"] {
        let one = format!("{scene}-one");
        workspace.expect(
            0,
            &format!("run {scene}.ron --threads 1 --out {one} --quiet"),
        );
        for (threads, stack) in [(256, 1u64 << 27), (2, 1 << 40)] {
            let many = format!("{scene}-{threads}");
            let arguments = format!("run {scene}.ron --threads {threads} --out {many} --quiet");
            let stack = format!("RUST_MIN_STACK={stack}");
            let output =
                workspace.springs_within(&format!("-v 2000000; export {stack}"), &arguments);
            assert!(output.status.success(), "{output:?}");
            let [one, many] = [&one, &many].map(|run| workspace.read(&format!("{run}/final.ron")));
            assert_eq!(one, many, "{scene} on {threads} threads");
        }
    }
}

#[test]
fn what_the_command_line_says_is_not_blamed_on_the_file() {
    let workspace = Workspace::new();
    workspace.scene("chain.ron", "chain 3 --step 0.01");
    for arguments in [
        "run chain.ron --tangent exact --method velocity-verlet",
        "run chain.ron --method tr-bdf2 --tangent exact",
        "check chain.ron --tangent exact --method velocity-verlet",
    ] {
        let said = workspace.expect(2, arguments);
        assert!(said.starts_with("error: on the command line, "), "{said}");
        assert!(!said.contains("chain.ron:"), "{said}");
    }
}
