//! What every output of the table promises.

mod common;

use common::workspace::all_files;
use springs::io::{FrameMembers, Mark, RunEnd, RunPlan, SinkKind, TrajectoryFrame};
use springs::scene::generate::{Material, cloth};
use springs::scene::{BreakLimit, Probe, ProbeQuantity, Probed, Scene, Vector3};
use springs::sinks::{Marks, SINKS, Sinks, tension_peaks};
use springs::step::{Frame, Islands, NodeStates, Observer, Samples, StepRecord};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

const INTERVALS: usize = 6;

fn scene() -> Scene {
    let mut scene = cloth(4, Material::of_cloth());
    scene.settings.duration = 0.3;
    let of = vec![ProbeQuantity::Tension, ProbeQuantity::Energy];
    scene.output.probes = vec![
        Probe {
            on: Probed::Nodes(vec![7, 2]),
            of: vec![ProbeQuantity::Velocity],
            every: None,
        },
        Probe {
            on: Probed::Springs(vec![3]),
            of,
            every: Some(0.007),
        },
    ];
    scene
}

fn names() -> Vec<String> {
    SINKS.iter().map(|kind| kind.name().to_owned()).collect()
}

/// Writes outputs, and stops at a frame, before its energies are written.
struct Writer {
    sinks: Sinks,
    stop_at: Option<usize>,
}

impl Observer for Writer {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.sinks.frame(frame).unwrap();
        if self.stop_at == Some(frame.index) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn wants_members(&self) -> bool {
        self.sinks.wants_members()
    }

    fn wants_samples(&self) -> bool {
        self.sinks.want_samples()
    }

    fn samples(&mut self, samples: Samples<'_>) -> ControlFlow<()> {
        self.sinks.samples(samples).unwrap();
        ControlFlow::Continue(())
    }

    fn wants_account(&self) -> bool {
        self.sinks.awaits_energies()
    }

    fn account(&mut self, account: springs::step::Account) -> ControlFlow<()> {
        self.sinks.account(&account).unwrap();
        ControlFlow::Continue(())
    }

    fn record(&mut self, record: &StepRecord) {
        self.sinks.step(record).unwrap();
    }
}

fn finish(sinks: &mut Sinks, scene: &Scene, islands: &Islands) -> Vec<&'static str> {
    let mut last = scene.clone();
    islands.nodes().write_to(&mut last);
    let time = islands.time();
    let end = RunEnd {
        scene: &last,
        time,
        peaks: &tension_peaks(islands),
    };
    sinks.finish(&end).unwrap()
}

/// Runs to the end, killed after every one of the frames `kills` that a
/// checkpoint was written at; frames after it are lost with the program.
fn results(scene: &Scene, kills: &[usize]) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let intervals = INTERVALS;
    let plan = RunPlan { scene, intervals };
    let mut islands = Islands::new(scene).unwrap();
    let mut writer = Writer {
        sinks: Sinks::begin(folder, &names(), &plan).unwrap(),
        stop_at: None,
    };
    for &kill in kills {
        writer.stop_at = Some(kill);
        islands.run(INTERVALS, &mut writer).unwrap();
        writer.sinks.keep().1.unwrap();
        let (state, marks) = (islands.save(), writer.sinks.marks());
        writer.stop_at = None;
        islands.run(INTERVALS, &mut writer).unwrap();
        drop(writer);
        islands = Islands::new(scene).unwrap();
        islands.restore(state).unwrap();
        let text = serde_json::to_string(&marks).unwrap();
        let marks: Marks = serde_json::from_str(&text).unwrap();
        writer = Writer {
            sinks: Sinks::resume(folder, &plan, &marks).unwrap(),
            stop_at: None,
        };
    }
    islands.run(INTERVALS, &mut writer).unwrap();
    let files = finish(&mut writer.sinks, scene, &islands);
    let contents = all_files(folder);
    let promised: BTreeSet<&str> = files.into_iter().collect();
    let names = contents.keys().map(String::as_str);
    // A folder has the name up to its slash.
    let found: BTreeSet<&str> = names
        .map(|name| name.split_inclusive('/').next().unwrap_or(name))
        .collect();
    assert_eq!(found, promised);
    contents
}

#[test]
fn resumed_outputs_are_those_of_a_run_without_a_stop() {
    let scene = scene();
    let whole = results(&scene, &[]);
    assert!(whole.len() >= SINKS.len());
    for frame in 0..INTERVALS {
        assert_eq!(results(&scene, &[frame]), whole, "killed at {frame}");
    }
    assert_eq!(results(&scene, &[1, 3, 4]), whole);
}

/// Springs break on the way, which is seen in several outputs.
#[test]
fn resumed_outputs_of_springs_that_break() {
    let mut scene = scene();
    for (k, spring) in scene.springs.iter_mut().enumerate() {
        spring.breaks_at = Some(BreakLimit::Force(0.003 * (k + 1) as f64));
    }
    let whole = results(&scene, &[]);
    let rows = String::from_utf8(whole["springs.csv"].clone()).unwrap();
    let broken_at = |time: &str| {
        let rows = rows.lines().filter(|row| row.starts_with(time));
        rows.filter(|row| row.ends_with(",0.0,broken")).count()
    };
    assert!(broken_at("0.0,") == 0 && broken_at("0.3,") > 0, "{rows}");
    for frame in 0..INTERVALS {
        assert_eq!(results(&scene, &[frame]), whole, "killed at {frame}");
    }
    assert_eq!(results(&scene, &[0, 2, 3]), whole);
}

/// A finished output goes on, too: it is there up to the mark.
#[test]
fn outputs_that_were_finished_on_the_way_go_on() {
    let scene = &scene();
    let whole = results(scene, &[]);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let intervals = INTERVALS;
    let plan = RunPlan { scene, intervals };
    let mut islands = Islands::new(scene).unwrap();
    let mut writer = Writer {
        sinks: Sinks::begin(folder, &names(), &plan).unwrap(),
        stop_at: Some(2),
    };
    islands.run(INTERVALS, &mut writer).unwrap();
    let marks = writer.sinks.marks();
    finish(&mut writer.sinks, scene, &islands);
    marks.check(folder, &plan).unwrap();
    writer = Writer {
        sinks: Sinks::resume(folder, &plan, &marks).unwrap(),
        stop_at: None,
    };
    islands.run(INTERVALS, &mut writer).unwrap();
    finish(&mut writer.sinks, scene, &islands);
    assert_eq!(all_files(folder), whole);
}

/// One that is made of others comes after them.
#[test]
fn outputs_follow_what_they_need() {
    for (index, kind) in SINKS.iter().enumerate() {
        for need in kind.needs() {
            let place = SINKS.iter().position(|kind| kind.name() == *need);
            let needed = SINKS[place.unwrap()];
            assert!(place.unwrap() < index && needed.needs().is_empty());
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = &scene();
    let intervals = INTERVALS;
    let plan = RunPlan { scene, intervals };
    let mut sinks = Sinks::begin(folder.path(), &["view".to_owned()], &plan).unwrap();
    let marks = serde_json::to_string(&sinks.marks()).unwrap();
    for name in ["energy", "npz", "view"] {
        assert!(marks.contains(&format!("[\"{name}\",")), "{marks}");
    }
}

#[test]
fn names_and_files_of_outputs_are_their_own() {
    let names: BTreeSet<&str> = SINKS.iter().map(|kind| kind.name()).collect();
    assert_eq!(names.len(), SINKS.len());
    let files: Vec<&str> = SINKS.iter().flat_map(|kind| kind.files()).collect();
    let different: BTreeSet<&&str> = files.iter().collect();
    assert_eq!(different.len(), files.len());
    for reserved in ["final.ron", "report.json", "checkpoint.bin"] {
        assert!(!files.contains(&reserved));
    }
}

/// A mark after `n_frames` frames.
fn mark(kind: &dyn SinkKind, n_frames: usize) -> Mark {
    let folder = tempfile::tempdir().unwrap();
    let scene = &scene();
    let intervals = 1000;
    let plan = RunPlan { scene, intervals };
    let nodes = NodeStates::of(scene);
    let tensions = vec![1.0; scene.springs.len()];
    let reactions = [(0, Vector3::z())];
    let mut sink = kind.begin(folder.path(), &plan).unwrap();
    for index in 0..n_frames {
        let frame = TrajectoryFrame {
            index,
            time: index as f64,
            positions: &nodes.positions,
            velocities: &nodes.velocities,
            members: Some(FrameMembers {
                springs: &scene.springs,
                tensions: &tensions,
                broken: &[],
                yielded: &[],
                reactions: &reactions,
            }),
        };
        sink.frame(&frame).unwrap();
    }
    sink.written().mark()
}

/// Nothing is kept in memory frame by frame.
#[test]
fn marks_do_not_grow_with_frames() {
    for &kind in SINKS {
        let size = |n_frames| serde_json::to_string(&mark(kind, n_frames)).unwrap().len();
        let (few, many) = (size(510), size(990));
        assert!(many <= few + 20, "{}: {few}, {many}", kind.name());
    }
}

#[test]
fn an_output_that_is_neither_kept_nor_finished_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scene = &scene();
    let plan = RunPlan {
        scene,
        intervals: INTERVALS,
    };
    drop(Sinks::begin(folder.path(), &names(), &plan).unwrap());
    assert_eq!(all_files(folder.path()), BTreeMap::new());
}

/// If one output cannot go on, the others are not touched.
#[test]
fn outputs_go_on_together_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = &scene();
    let intervals = INTERVALS;
    let plan = RunPlan { scene, intervals };
    let mut islands = Islands::new(scene).unwrap();
    let mut writer = Writer {
        sinks: Sinks::begin(folder, &names(), &plan).unwrap(),
        stop_at: Some(2),
    };
    islands.run(INTERVALS, &mut writer).unwrap();
    writer.sinks.keep().1.unwrap();
    let marks = writer.sinks.marks();
    writer.stop_at = None;
    islands.run(INTERVALS, &mut writer).unwrap();
    drop(writer);
    let left = all_files(folder);
    let text = serde_json::to_string(&marks).unwrap();
    let refused = |text: &str, plan: &RunPlan<'_>| {
        let marks: Marks = serde_json::from_str(text).unwrap();
        let error = Sinks::resume(folder, plan, &marks).err().unwrap();
        assert_eq!(all_files(folder), left);
        error.to_string()
    };
    let error = refused(&text.replace("\"svg\"", "\"obj\""), &plan);
    assert_eq!(error, "it writes `obj`, which is not known here");
    let error = refused(
        &text.replace("[\"energy\",{\"bytes\"", "[\"energy\",{\"length\""),
        &plan,
    );
    assert!(
        error.starts_with("what it says of energy.csv cannot"),
        "{error}"
    );
    let mut other = scene.clone();
    other.nodes[0].position = Vector3::zeros();
    other.nodes.pop();
    let scene = &other;
    let error = refused(&text, &RunPlan { scene, intervals });
    assert_eq!(error, "what it says of trajectory.npz is not of this scene");
    Sinks::resume(folder, &plan, &marks).unwrap();
}
