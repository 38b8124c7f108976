//! What each crate may depend on, and what its package holds.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(arguments)
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

/// Names of everything that a crate depends on, directly or not.
fn dependencies(of: &str) -> BTreeSet<String> {
    let tree = cargo(&["tree", "-p", of, "-e", "normal", "--prefix", "none"]);
    tree.lines()
        .skip(1)
        .filter_map(|line| line.split_whitespace().next())
        .map(str::to_owned)
        .collect()
}

#[test]
fn dependencies_point_one_way() {
    // Crate, and which of the others and of the heavy libraries it may know.
    let allowed: [(&str, &[&str]); 8] = [
        ("springs-math", &["nalgebra"]),
        ("springs-threads", &[]),
        ("springs-scene", &["nalgebra"]),
        (
            "springs-assembly",
            &[
                "nalgebra",
                "springs-math",
                "springs-scene",
                "springs-threads",
            ],
        ),
        ("springs-solver", &["faer", "springs-threads"]),
        (
            "springs-statics",
            &[
                "faer",
                "nalgebra",
                "springs-assembly",
                "springs-math",
                "springs-scene",
                "springs-solver",
                "springs-threads",
            ],
        ),
        (
            "springs-step",
            &[
                "faer",
                "nalgebra",
                "springs-assembly",
                "springs-math",
                "springs-scene",
                "springs-solver",
                "springs-threads",
            ],
        ),
        ("springs-io", &["nalgebra", "ron", "serde", "springs-scene"]),
    ];
    let watched = |name: &&String| {
        name.starts_with("springs") || ["faer", "nalgebra", "ron", "serde"].contains(&name.as_str())
    };
    for (name, allowed) in allowed {
        let known = dependencies(name);
        let known: Vec<&str> = known.iter().filter(watched).map(String::as_str).collect();
        assert_eq!(known, allowed, "{name}");
    }
}

#[test]
fn only_one_crate_names_faer_and_one_rayon() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for entry in std::fs::read_dir(root.join("crates")).unwrap() {
        let manifest = entry.unwrap().path().join("Cargo.toml");
        let Ok(text) = std::fs::read_to_string(&manifest) else {
            continue;
        };
        for (library, owner) in [("faer", "springs-solver"), ("rayon", "springs-threads")] {
            let is_owner = manifest.to_string_lossy().contains(owner);
            let names_it = text.contains(&format!("\n{library}"));
            assert_eq!(names_it, is_owner, "{library} in {}", manifest.display());
        }
    }
}

#[test]
fn packages_hold_what_they_should() {
    let listed = |package: &str| -> BTreeSet<String> {
        let list = cargo(&["package", "--list", "--allow-dirty", "-p", package]);
        list.lines().map(|line| line.replace('\\', "/")).collect()
    };
    for package in [
        "springs-math",
        "springs-threads",
        "springs-scene",
        "springs-assembly",
        "springs-solver",
        "springs-statics",
        "springs-step",
        "springs-io",
    ] {
        let files = listed(package);
        for file in ["src/lib.rs", "README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            assert!(files.contains(file), "{package} lacks {file}");
        }
    }
    let files = listed("springs");
    for file in [
        "crates/springs/lib.rs",
        "crates/springs/main.rs",
        "crates/springs/cli/run.rs",
        "examples/power_line.rs",
        "examples/scenes/power-line.ron",
        "benches/step.rs",
        "tests/command_line.rs",
        "README.md",
        "LICENSE-MIT",
        "LICENSE-APACHE",
    ] {
        assert!(files.contains(file), "springs lacks {file}");
    }
    assert!(
        !files.iter().any(|file| file.contains("springs-math")),
        "the root package must not hold other crates"
    );
}

/// What is cited is what is built.
#[test]
fn the_citation_names_this_version() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("CITATION.cff");
    let text = std::fs::read_to_string(path).unwrap();
    let version = concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n");
    assert!(text.contains(version), "not{version}");
    for licence in env!("CARGO_PKG_LICENSE").split(" OR ") {
        assert!(text.contains(&format!("\n  - {licence}\n")), "{licence}");
    }
}
