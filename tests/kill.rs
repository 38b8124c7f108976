//! The program is really killed, again and again, at any moment, and what it
//! writes in the end is what it writes if nobody kills it.

mod common;

use common::{Random, append, tangle};
use springs::io::write_scene;
use springs::scene::{Method, Probe, ProbeQuantity, Probed, RunOptions, Scene, StepControl};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SPRINGS: &str = env!("CARGO_BIN_EXE_springs");

const RESULTS: [&str; 11] = [
    "final.ron",
    "trajectory.csv",
    "energy.csv",
    "probes.csv",
    "steps.csv",
    "trajectory.npz",
    "frames.pvd",
    "mesh.obj",
    "points.pc2",
    "filmstrip.svg",
    "view.html",
];

const WRITTEN: &str = "--write csv,energy,steps,npz,vtu,pc2,svg,view";

fn springs(arguments: &str, folder: &Path) -> Command {
    let mut command = Command::new(SPRINGS);
    command
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

fn results(folder: &Path) -> Vec<Vec<u8>> {
    let read = |path| std::fs::read(path).expect("a result");
    let frames = std::fs::read_dir(folder.join("frames")).expect("frames");
    let mut frames: Vec<_> = frames.map(|entry| entry.unwrap().path()).collect();
    frames.sort();
    let files = RESULTS.iter().map(|name| folder.join(name));
    files.chain(frames).map(read).collect()
}

/// Kills runs of the scene until `kills` of them died before they were done;
/// says how many runs were finished on the way.
fn survive(scene: &Scene, options: &str, kills: usize, random: &mut Random) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_scene(&here.join("scene.ron"), scene, &RunOptions::default()).unwrap();
    let whole = format!("run scene.ron --out whole {WRITTEN} {options}");
    let begin = Instant::now();
    assert!(springs(&whole, here).status().unwrap().success());
    let longest = begin.elapsed().as_secs_f64();
    let expected = results(&here.join("whole"));

    let (mut killed, mut finished) = (0, 0);
    while killed < kills || finished == 0 {
        let run = format!("run scene.ron --out killed --force {WRITTEN} --checkpoint 7 {options}");
        let mut command = springs(&run, here);
        loop {
            let mut child = command.spawn().unwrap();
            if killed < kills {
                let moment = random.between(0.0, 1.2 * longest);
                std::thread::sleep(Duration::from_secs_f64(moment));
                // It may be done already.
                let _ = child.kill();
            }
            let status = child.wait().unwrap();
            if status.success() {
                break;
            }
            let code = status.code();
            // Killed before the first checkpoint, there is nothing to resume.
            let has_checkpoint = here.join("killed/checkpoint.bin").exists();
            assert!(
                code.is_none() || (code == Some(2) && !has_checkpoint),
                "{code:?}"
            );
            killed += usize::from(code.is_none());
            command = if has_checkpoint {
                springs("resume killed", here)
            } else {
                springs(&run, here)
            };
        }
        assert_eq!(results(&here.join("killed")), expected, "{options}");
        let left: Vec<_> = std::fs::read_dir(here.join("killed")).unwrap().collect();
        let names = left.into_iter().map(|entry| entry.unwrap().file_name());
        let strange = names
            .map(|name| name.into_string().unwrap())
            .filter(|name| !RESULTS.contains(&&**name))
            .filter(|name| name != "report.json" && name != "frames");
        assert_eq!(strange.collect::<Vec<_>>(), Vec::<String>::new());
        finished += 1;
    }
    finished
}

/// Long enough to be killed on the way, and in two islands.
fn scene(method: Method, step: StepControl) -> Scene {
    let mut scene = tangle(12, 6);
    append(&mut scene, &tangle(8, 7));
    scene.settings.method = method;
    scene.settings.step = step;
    scene.settings.duration = 2.0;
    scene.output.probes = vec![Probe {
        on: Probed::Springs(vec![1, 20]),
        of: vec![ProbeQuantity::Tension, ProbeQuantity::Energy],
        every: Some(0.017),
    }];
    scene
}

fn cases() -> [(Scene, &'static str); 4] {
    [
        (
            scene(Method::LinearlyImplicitEuler, StepControl::Fixed(2e-3)),
            "--frames 50",
        ),
        (
            scene(Method::LinearlyImplicitEuler, StepControl::Fixed(2e-3)),
            "--frames 50 --no-skip --threads 1",
        ),
        (
            scene(Method::Auto, StepControl::Tolerance(1e-4)),
            "--frames 33",
        ),
        (
            scene(Method::TrBdf2, StepControl::Tolerance(1e-2)),
            "--frames 200",
        ),
    ]
}

#[test]
fn killed_runs_end_in_the_same_bits() {
    let mut random = Random(11);
    for (scene, options) in cases() {
        survive(&scene, options, 8, &mut random);
    }
}

/// `cargo test --release --test kill -- --ignored`
#[test]
#[ignore = "takes minutes"]
fn five_hundred_kills() {
    let mut random = Random(12);
    for (scene, options) in cases() {
        let finished = survive(&scene, options, 130, &mut random);
        eprintln!("130 kills, {finished} runs finished in the same bits: {options}");
    }
}
