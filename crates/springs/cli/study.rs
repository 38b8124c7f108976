//! `springs study`: run time against error for a scene.

use super::output::{claim, lock, make_folder};
use super::signals::Signals;
use super::source::{SceneArguments, Source};
use super::{Advised, Ending, Unwritten, print, say, say_error};
use indicatif::{ProgressBar, ProgressStyle};
use springs::io::{try_to_write, write_whole};
use springs::scene::{Method, printable};
use springs::study::{
    Options, Progress, StabilityMap, Study, StudyError, csv, diagram, method_notes,
    recommendations, reference_csv, reference_note, stability, stability_csv, stability_diagram,
    study, table,
};
use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
pub(crate) struct StudyArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder to write into [default: the scene's name without its ending]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[arg(long, value_name = "NAMES", value_delimiter = ',', help = methods_help())]
    methods: Vec<Method>,
    /// Time that all runs together should take, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = positive)]
    budget: f64,
    /// How often runs that may be recommended are measured; the least time counts
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Map what becomes of the energy over step size and stiffness instead
    #[arg(long)]
    stability: bool,
    /// No progress and no table
    #[arg(long)]
    quiet: bool,
    /// Replace the results of another study
    #[arg(long)]
    force: bool,
}

fn methods_help() -> String {
    let names: Vec<&str> = Method::ALL
        .iter()
        .map(|method| method.kebab_name())
        .collect();
    format!(
        "Methods to compare, with commas between them: {} [default: all but auto]",
        names.join(", ")
    )
}

/// In seconds: more than thirty years.
const LONGEST_BUDGET: f64 = 1e9;

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > LONGEST_BUDGET => Err(format!("must be {LONGEST_BUDGET:e} at most")),
        Ok(number) if number > 0.0 => Ok(number),
        Ok(_) => Err("must be greater than zero".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

const CSV: &str = "study.csv";
const JSON: &str = "study.json";
const DIAGRAM: &str = "study.svg";
const REFERENCE: &str = "reference.csv";
const MAP_CSV: &str = "stability.csv";
const MAP_DIAGRAM: &str = "stability.svg";

pub(crate) fn study_command(arguments: &StudyArguments) -> anyhow::Result<Ending> {
    let begin = Instant::now();
    let signals = Signals::watch();
    if let Some(flag) = arguments.scene.chooses_method_or_step() {
        return Err(Advised {
            message: format!("{flag} means nothing to a study, which tries methods and steps out"),
            advice: Some("name the methods to compare with --methods".to_owned()),
        }
        .into());
    }
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => arguments.scene.stem(),
    };
    let files: &[&str] = if arguments.stability {
        &[MAP_CSV, MAP_DIAGRAM]
    } else {
        &[CSV, JSON, DIAGRAM, REFERENCE]
    };
    claim(&folder, files, arguments.force)?;
    let mut source = arguments.scene.load()?;
    source
        .start()
        .map_err(|error| source.advised_of_statics(&error))?;
    let mut options = Options {
        repeats: arguments.repeats as usize,
        command: format!("springs run {}", arguments.scene.arguments().join(" ")),
        run: source.options,
        ..Options::default()
    };
    if !arguments.methods.is_empty() {
        options.methods = arguments.methods.clone();
    }
    signals.note_the_first();
    let target = Target::open(folder, files[0])?;
    let interrupted = signals.is_interrupted();
    let bar = if arguments.quiet {
        ProgressBar::hidden()
    } else {
        progress_bar()
    };
    let budget = Duration::from_secs_f64(arguments.budget);
    let mut watch = |progress: Progress<'_>| {
        if !progress.what.is_empty() {
            bar.set_message(progress.what.to_owned());
        }
        bar.set_position((progress.fraction.min(1.0) * PARTS as f64) as u64);
        if interrupted.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let ending = if arguments.stability {
        options.budget = budget;
        let map = stability(&source.scene, &options, &mut watch);
        bar.finish_and_clear();
        map.map(|map| write_map(&map, &target.folder, arguments.quiet))
    } else {
        options.budget = budget.mul_f64(1.0 - COMMANDS);
        let study = study(&source.scene, &options, &mut watch);
        let study = study.map(|mut study| {
            let runs = Commands {
                arguments: &arguments.scene,
                source: &source,
                until: begin + budget,
                interrupted: &interrupted,
            };
            runs.time(&mut study, options.repeats);
            study
        });
        bar.finish_and_clear();
        study.map(|study| write_study(&study, &target.folder, arguments.quiet))
    };
    ending.unwrap_or_else(|error| unstudied(error, &source))
}

fn unstudied(error: StudyError, source: &Source) -> anyhow::Result<Ending> {
    let advice = match &error {
        StudyError::Setup(error) => return Err(source.advised(error).into()),
        StudyError::Stopped => {
            say_error("interrupted before there was a result; nothing is written");
            return Ok(Ending::Interrupted);
        }
        StudyError::NoDuration(_) => Some("give one with --duration"),
        StudyError::AllRefused(_) => Some("name others with --methods"),
        StudyError::NoReference | StudyError::NoRun => {
            Some("give it more time with --budget, or a shorter --duration")
        }
        _ => None,
    };
    Err(Advised {
        message: error.to_string(),
        advice: advice.map(str::to_owned),
    }
    .into())
}

/// Part of the budget for the commands that are recommended.
const COMMANDS: f64 = 0.1;

/// Their runs are so short that they are repeated so many times as often.
const MORE_REPEATS: usize = 3;

/// Runs that take longer, in s, take as long in a process of their own.
const SHORT: f64 = 0.05;

/// Runs the recommended commands as a user would: a short run takes longer in a
/// process that has just begun than in one that has made it before.
struct Commands<'a> {
    arguments: &'a SceneArguments,
    source: &'a Source,
    until: Instant,
    interrupted: &'a AtomicBool,
}

impl Commands<'_> {
    /// Replaces the times of short runs by those that the commands report. What
    /// cannot be run that way keeps its time.
    fn time(&self, study: &mut Study, repeats: usize) {
        let Ok(program) = std::env::current_exe() else {
            return;
        };
        let folder = std::env::temp_dir().join(format!("springs-study-{}", std::process::id()));
        let scene = folder.join("scene.ron");
        if std::fs::create_dir_all(&folder).is_ok() && self.source.copy_to(&scene).is_ok() {
            let mut times = vec![f64::INFINITY; study.advice.len()];
            for _ in 0..MORE_REPEATS * repeats {
                for (advice, least) in study.advice.iter().zip(&mut times) {
                    let is_over = Instant::now() > self.until;
                    if advice.seconds > SHORT || is_over || self.is_interrupted() {
                        continue;
                    }
                    let mut command = Command::new(&program);
                    command.arg("run").arg(&scene).args(self.arguments.flags());
                    command.args(advice.arguments());
                    command
                        .arg("--out")
                        .arg(&folder)
                        .args(["--force", "--quiet"]);
                    if let Some(seconds) = reported(command, &folder) {
                        *least = least.min(seconds);
                    }
                }
            }
            for (advice, seconds) in study.advice.iter_mut().zip(times) {
                if seconds.is_finite() {
                    advice.seconds = seconds;
                }
            }
        }
        // What is left there is of no use.
        let _ = std::fs::remove_dir_all(&folder);
    }

    fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

/// The time that a run reports for setup and steps, in s.
fn reported(mut command: Command, folder: &Path) -> Option<f64> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.status().ok().filter(|status| status.success())?;
    let text = std::fs::read_to_string(folder.join("report.json")).ok()?;
    let report: serde_json::Value = serde_json::from_str(&text).ok()?;
    let seconds = &report["seconds"];
    Some(seconds["setup"].as_f64()? + seconds["stepping"].as_f64()?)
}

/// The folder to write into, made and locked before anything takes time.
struct Target {
    folder: PathBuf,
    is_new: bool,
    _lock: Option<File>,
}

impl Target {
    fn open(folder: PathBuf, file: &str) -> anyhow::Result<Self> {
        let is_new = !folder.exists();
        make_folder(&folder)?;
        let target = Self {
            _lock: lock(&folder)?,
            is_new,
            folder,
        };
        try_to_write(&target.folder.join(file)).map_err(Unwritten::from)?;
        Ok(target)
    }
}

impl Drop for Target {
    /// Where nothing was written, nothing is left.
    fn drop(&mut self) {
        if self.is_new {
            // Fails where there are files.
            let _ = std::fs::remove_dir(&self.folder);
        }
    }
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), Unwritten> {
    Ok(write_whole(&folder.join(name), text.as_bytes())?)
}

fn write_map(map: &StabilityMap, folder: &Path, quiet: bool) -> anyhow::Result<Ending> {
    write(folder, MAP_CSV, &stability_csv(map))?;
    write(folder, MAP_DIAGRAM, &stability_diagram(map))?;
    if !quiet {
        for (method, why) in &map.refused {
            say(&format!("left out {method}: {why}"));
        }
        say(&format!(
            "{} runs; wrote {MAP_CSV}, {MAP_DIAGRAM} into {}",
            map.trials.len(),
            folder.display()
        ));
    }
    Ok(ending(map.interrupted))
}

fn write_study(study: &Study, folder: &Path, quiet: bool) -> anyhow::Result<Ending> {
    write(folder, CSV, &csv(study))?;
    write(folder, JSON, &(serde_json::to_string_pretty(study)? + "\n"))?;
    write(folder, REFERENCE, &reference_csv(study))?;
    let picture = diagram(study);
    let mut written = vec![CSV, JSON, REFERENCE];
    if picture.is_empty() {
        // One of another study would not belong to this one.
        let _ = std::fs::remove_file(folder.join(DIAGRAM));
    } else {
        write(folder, DIAGRAM, &picture)?;
        written.push(DIAGRAM);
    }
    if !quiet {
        let name = match study.scene.as_str() {
            "" => String::new(),
            name => format!("{}: ", printable(name)),
        };
        let mut text = format!("{name}{} s\n{}\n\n", study.duration, reference_note(study));
        text += &(table(study) + "\n");
        for line in method_notes(study)
            .into_iter()
            .chain(recommendations(study))
        {
            text += &(line + "\n");
        }
        print(&text)?;
        if picture.is_empty() {
            say(&format!("{DIAGRAM} is not written: all runs are worthless"));
        }
        say(&format!(
            "wrote {} into {}",
            written.join(", "),
            folder.display()
        ));
    }
    Ok(ending(study.interrupted))
}

fn ending(is_interrupted: bool) -> Ending {
    if is_interrupted {
        say_error("interrupted; what there was is written, and is incomplete");
        Ending::Interrupted
    } else {
        Ending::Done
    }
}

/// Parts of the budget that the progress bar tells apart.
const PARTS: u64 = 1000;

/// Drawn to standard error, and only if that is a terminal.
fn progress_bar() -> ProgressBar {
    let style =
        ProgressStyle::with_template("{bar:32} {percent:>3} % of the budget, {eta} left  {msg}")
            .expect("a template that is correct");
    ProgressBar::new(PARTS).with_style(style)
}
