//! Every kind of bad scene file gets its error before anything is written.
//!
//! The files are in `tests/bad_scenes`, the messages in one snapshot.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

#[test]
fn each_bad_scene_gets_its_message() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad_scenes");
    let mut names: Vec<String> = std::fs::read_dir(&scenes)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert!(names.len() >= 80, "only {} bad scenes", names.len());
    let mut table = String::new();
    for name in names {
        let folder = tempfile::tempdir().unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_springs"))
            .current_dir(&scenes)
            .args(["run", &name, "--write", "csv,svg", "--out"])
            .arg(folder.path().join("out"))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}");
        assert!(output.stdout.is_empty(), "{name}");
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 0, "{name}: nothing may be written");
        write!(table, "{}", String::from_utf8(output.stderr).unwrap()).unwrap();
    }
    insta::assert_snapshot!(table);
}
