//! A folder, and the program in it.

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The contents of all files of a folder and of those in it.
pub fn all_files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            let inner = all_files(&entry.path()).into_iter();
            all.extend(inner.map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            all.insert(name, std::fs::read(entry.path()).unwrap());
        }
    }
    all
}

/// A folder of its own and the program in it.
pub struct Workspace(tempfile::TempDir);

/// Whoever waits longer waits for nothing.
const PATIENCE: Duration = Duration::from_secs(120);

impl Workspace {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn folder(&self) -> &Path {
        self.0.path()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The program, with arguments that are split at spaces.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_springs"));
        command
            .current_dir(&self.0)
            .args(arguments.split_whitespace())
            .stdin(Stdio::null());
        command
    }

    pub fn springs(&self, arguments: &str) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The same with a limit of the shell's `ulimit`.
    pub fn springs_within(&self, limit: &str, arguments: &str) -> Output {
        let program = env!("CARGO_BIN_EXE_springs");
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit {limit}; exec {program} {arguments}")]);
        let shell = shell.current_dir(&self.0).stdin(Stdio::null());
        shell.output().unwrap()
    }

    /// Starts the program; nobody reads what it says.
    pub fn start(&self, arguments: &str) -> Child {
        let mut command = self.command(arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().unwrap()
    }

    /// Starts the program; what it says to standard error is kept.
    pub fn start_heard(&self, arguments: &str) -> Child {
        let mut command = self.command(arguments);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// Runs, expects an exit code, and returns what went to standard error.
    pub fn expect(&self, code: i32, arguments: &str) -> String {
        let output = self.springs(arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments}: {error}");
        assert!(output.stdout.is_empty() || code == 0, "{arguments}");
        error
    }

    /// Writes what `springs new` prints: a scene for the note's step, unless
    /// the arguments ask for something else.
    pub fn scene(&self, name: &str, arguments: &str) {
        let method = if arguments.contains("--method") || arguments.contains("--tolerance") {
            ""
        } else {
            "--method linearly-implicit-euler"
        };
        let output = self.springs(&format!("new {arguments} {method}"));
        assert!(output.status.success());
        std::fs::write(self.path(name), output.stdout).unwrap();
    }

    pub fn report(&self, folder: &str) -> Value {
        serde_json::from_str(&self.read(&format!("{folder}/report.json"))).unwrap()
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Names of all files in a folder, sorted; none if there is no folder.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.path(folder)) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// The bytes in a folder.
    pub fn size(&self, folder: &str) -> u64 {
        let names = self.names(folder);
        // A file may be renamed at any moment.
        let size = |name: &String| std::fs::metadata(self.path(folder).join(name)).ok();
        names.iter().filter_map(size).map(|file| file.len()).sum()
    }
}

/// Waits for a condition.
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !condition() {
        assert!(begin.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Sends a signal, such as INT.
pub fn signal(child: &Child, name: &str) {
    let status = Command::new("kill")
        .args([format!("-{name}"), child.id().to_string()])
        .status();
    assert!(status.unwrap().success());
}
