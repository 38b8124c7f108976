//! Every command and every scene of the README and the guide runs as written; programs are
//! documentation tests of the facade, Python lines tests of the package.

mod common;

use common::workspace::Workspace;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// What follows ```` ```language ```` in a text, block by block.
fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let opening = format!("```{language}\n");
    let after = text.split(opening.as_str()).skip(1);
    let block = |rest: &'a str| rest.split_once("```").expect("a closed block").0;
    after.map(block).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README, what the book begins with, and all chapters, with their texts.
fn documents() -> Vec<(PathBuf, String)> {
    let chapters = std::fs::read_dir(root().join("docs/guide/src")).unwrap();
    let mut paths: Vec<PathBuf> = chapters.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let others = ["README.md", "docs/README.md", "docs/SUMMARY.md"];
    paths.splice(0..0, others.map(|path| root().join(path)));
    let read = |path: PathBuf| (path.clone(), std::fs::read_to_string(path).unwrap());
    paths.into_iter().map(read).collect()
}

/// What `springs` is called with in a line, if it is: in a checkout, by cargo.
fn arguments(line: &str) -> Option<&str> {
    let forms = ["cargo run -- ", "cargo run --release -- ", "springs "];
    forms.iter().find_map(|form| line.strip_prefix(form))
}

/// A folder with the scenes of the examples where a checkout has them.
fn checkout() -> Workspace {
    let workspace = Workspace::new();
    let scenes = workspace.path("examples/scenes");
    std::fs::create_dir_all(&scenes).unwrap();
    std::fs::create_dir(workspace.path("target")).unwrap();
    for entry in std::fs::read_dir(root().join("examples/scenes")).unwrap() {
        let from = entry.unwrap().path();
        std::fs::copy(&from, scenes.join(from.file_name().unwrap())).unwrap();
    }
    workspace
}

/// As a shell reads it. Studies and sweeps get less to do, and less time.
fn shortened(arguments: &str) -> String {
    let words = arguments.split(' ');
    let mut words: Vec<&str> = words.map(|word| word.trim_matches('\'')).collect();
    if ["study", "sweep"].contains(&words[0]) {
        for (flag, value) in [("--budget", "2"), ("--duration", "0.05")] {
            if let Some(at) = words.iter().position(|word| *word == flag) {
                words[at + 1] = value;
            }
        }
    }
    words.join(" ")
}

/// Cargo's own commands name benches, examples and tests that exist.
fn check_of_cargo(line: &str) {
    let words: Vec<&str> = line.split(' ').collect();
    for (flag, folder) in [
        ("--example", "examples"),
        ("--bench", "benches"),
        ("--test", "tests"),
    ] {
        if let Some(at) = words.iter().position(|word| *word == flag) {
            let file = root().join(folder).join(words[at + 1]).with_extension("rs");
            assert!(file.exists(), "{line}: there is no {}", file.display());
        }
    }
}

#[test]
fn every_command_runs() {
    let workspace = checkout();
    // Some are in several places.
    let mut seen = HashSet::new();
    for (path, text) in documents() {
        for line in blocks(&text, "sh").into_iter().flat_map(str::lines) {
            if !seen.insert(line.to_owned()) {
                continue;
            }
            let Some(arguments) = arguments(line) else {
                check_of_cargo(line);
                continue;
            };
            let (arguments, output) = match arguments.split_once(" > ") {
                Some((arguments, file)) => (arguments, Some(file)),
                None => (arguments, None),
            };
            let printed = workspace.springs(&shortened(arguments));
            let error = String::from_utf8_lossy(&printed.stderr);
            assert!(
                printed.status.success(),
                "{}: {line}\n{error}",
                path.display()
            );
            if let Some(file) = output {
                std::fs::write(workspace.path(file), printed.stdout).unwrap();
            }
        }
    }
    assert!(seen.len() > 15, "only {} commands were found", seen.len());
}

/// Whole scenes as they are, and fields of scenes in a scene of six nodes on a line.
#[test]
fn every_scene_is_one() {
    let mut n_scenes = 0;
    for (path, text) in documents() {
        let workspace = Workspace::new();
        for block in blocks(&text, "ron") {
            let scene = if block.contains("Scene(") {
                block.to_owned()
            } else {
                let node =
                    |x: usize| format!("(position: ({x}, 0, 0), mass: 1, fixed: {})", x == 0);
                let nodes: Vec<String> = (0..6).map(node).collect();
                format!("Scene(version: 1, nodes: [{}], {block})", nodes.join(", "))
            };
            std::fs::write(workspace.path("scene.ron"), scene).unwrap();
            let checked = workspace.springs("check scene.ron");
            let error = String::from_utf8_lossy(&checked.stderr);
            assert!(
                checked.status.success(),
                "{}:\n{block}\n{error}",
                path.display()
            );
            n_scenes += 1;
        }
    }
    assert!(n_scenes > 3, "only {n_scenes} scenes were found");
}

/// Links between files lead somewhere, and those of the book stay in it.
#[test]
fn every_link_leads_to_a_file() {
    let book = root().join("docs").canonicalize().unwrap();
    for (path, text) in documents() {
        let targets = text.split("](").skip(1);
        for target in targets.map(|rest| rest.split_once(')').expect("a closed link").0) {
            let (file, _) = target.split_once('#').unwrap_or((target, ""));
            let is_abroad = file.starts_with("https://");
            let found = path.parent().unwrap().join(file).canonicalize();
            assert!(
                is_abroad || found.is_ok(),
                "{}: {target} leads nowhere",
                path.display()
            );
            let leaves_book = path.starts_with(root().join("docs"))
                && found.is_ok_and(|found| !found.starts_with(&book));
            assert!(!leaves_book, "{}: {target}", path.display());
        }
    }
}

/// The summary of the book lists every chapter.
#[test]
fn every_chapter_is_in_the_summary() {
    let documents = documents();
    let is_summary = |path: &Path| path.ends_with("SUMMARY.md");
    let (_, summary) = documents.iter().find(|(path, _)| is_summary(path)).unwrap();
    let docs = root().join("docs");
    let chapters = documents.iter().filter(|(path, _)| !is_summary(path));
    for name in chapters.filter_map(|(path, _)| path.strip_prefix(&docs).ok()) {
        let link = format!("]({})", name.to_str().unwrap().replace('\\', "/"));
        assert!(summary.contains(&link), "{link} is missing");
    }
}
