//! `springs sweep`: many runs of a scene with different numbers in it.

use super::output::{make_folder, quoted};
use super::signals::Signals;
use super::source::SceneArguments;
use super::{Advised, Ending, Unwritten, say};
use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use springs::solver::Interrupt;
use springs::sweep::{
    Folder, FolderError, Plan, PlanError, Progress, RESULTS, Subject, what_can_be_measured,
    what_can_be_set,
};
use std::path::{Path, PathBuf};
use std::thread;

#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct SweepArguments {
    #[command(subcommand)]
    work: Option<Work>,
    // Neither may hold the other: clap then takes it for left out.
    #[command(flatten)]
    scene: Option<SceneArguments>,
    #[command(flatten)]
    sweep: Option<NewSweep>,
}

#[derive(Subcommand)]
enum Work {
    /// Take runs from the folder of a sweep until none is left
    Work(WorkArguments),
}

#[derive(Args)]
struct WorkArguments {
    /// The folder
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Runs at the same time, each on one thread
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=256))]
    workers: u32,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

#[derive(Args)]
struct NewSweep {
    #[arg(long, value_name = "NAME=VALUES", required = true, help = "Set a number: EA=log:1e3:1e6:20, lin:FROM:TO:N or numbers with commas; several are combined", long_help = long(&what_can_be_set()))]
    set: Vec<String>,
    #[arg(long, value_name = "MEASURE", required = true, help = "Measure each run, such as 'max(tension)'", long_help = long(&what_can_be_measured()))]
    measure: Vec<String>,
    /// Folder to write into [default: the scene's name without its ending]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Runs at the same time, each on one thread; with 0 the folder is made for workers
    /// that are started otherwise [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=256))]
    workers: Option<u32>,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

fn long(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|letter| letter.to_uppercase());
    first.into_iter().flatten().chain(letters).collect()
}

pub(crate) fn sweep(arguments: &SweepArguments) -> anyhow::Result<Ending> {
    let signals = Signals::watch();
    if let Some(Work::Work(work)) = &arguments.work {
        signals.note_the_first();
        return run_workers(&work.folder, work.workers as usize, work.quiet, &signals);
    }
    let (Some(scene), Some(new)) = (&arguments.scene, &arguments.sweep) else {
        let message = "a sweep needs a scene, --set and --measure".to_owned();
        let advice = Some("or `work` and the folder of one".to_owned());
        return Err(Advised { message, advice }.into());
    };
    let folder = new.out.clone().unwrap_or_else(|| scene.stem());
    let source = scene.load()?;
    let mut options = source.options;
    options.threads = 1;
    let subject = Subject {
        scene: source.scene,
        options,
        inputs: source.inputs,
    };
    let plan = Plan::new(subject, &new.set, &new.measure).map_err(|error| advised(&error))?;
    make_folder(&folder)?;
    signals.note_the_first();
    Folder::begin(&folder, &plan).map_err(of_folder)?;
    let cores = || thread::available_parallelism().map_or(1, usize::from);
    let workers = new.workers.map_or_else(cores, |workers| workers as usize);
    if workers == 0 {
        if !new.quiet {
            let runs = plan.n_runs();
            let work = format!("springs sweep work {}", quoted(&folder));
            say(&format!("{runs} runs are there for any number of `{work}`"));
        }
        return Ok(Ending::Done);
    }
    run_workers(&folder, workers, new.quiet, &signals)
}

fn advised(error: &PlanError) -> Advised {
    Advised {
        message: error.to_string(),
        advice: None,
    }
}

fn of_folder(error: FolderError) -> anyhow::Error {
    let advice = match &error {
        FolderError::File(_) => None,
        FolderError::Other { .. } => Some("choose another folder with --out".to_owned()),
        FolderError::NoSweep { .. } => {
            Some("make one with `springs sweep SCENE.ron --set … --measure …`".to_owned())
        }
        _ => None,
    };
    match error {
        FolderError::File(error) => Unwritten::from(error).into(),
        error => Advised {
            message: error.to_string(),
            advice,
        }
        .into(),
    }
}

/// Workers in threads of this process, until no run is left.
fn run_workers(
    folder: &Path,
    workers: usize,
    quiet: bool,
    signals: &Signals,
) -> anyhow::Result<Ending> {
    let interrupt = Interrupt::from(signals.is_interrupted());
    let first = Folder::work(folder).map_err(of_folder)?;
    let bar = progress_bar(quiet, first.progress().map_err(of_folder)?);
    let others = (1..workers).map(|_| Folder::work(folder));
    let all: Result<Vec<Folder>, FolderError> = [Ok(first)].into_iter().chain(others).collect();
    let all = all.map_err(of_folder)?;
    let outcomes: Vec<Result<(), FolderError>> = thread::scope(|scope| {
        let work = |mut worker: Folder| {
            let (interrupt, bar) = (&interrupt, &bar);
            scope.spawn(move || worker.make_runs(interrupt, |_| bar.inc(1)))
        };
        let threads: Vec<_> = all.into_iter().map(work).collect();
        let ends = threads.into_iter().map(|thread| thread.join());
        ends.map(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    bar.finish_and_clear();
    outcomes
        .into_iter()
        .collect::<Result<(), FolderError>>()
        .map_err(of_folder)?;
    let progress = Folder::work(folder)
        .and_then(|worker| worker.progress())
        .map_err(of_folder)?;
    if !quiet {
        say(&summary(folder, progress));
    }
    if interrupt.is_requested() {
        Ok(Ending::Interrupted)
    } else {
        Ok(Ending::Done)
    }
}

fn summary(folder: &Path, progress: Progress) -> String {
    let Progress { done, failed, runs } = progress;
    let table = quoted(&folder.join(RESULTS));
    let failed = if failed > 0 {
        format!("; {failed} failed")
    } else {
        String::new()
    };
    format!("{done} of {runs} runs are in {table}{failed}")
}

fn progress_bar(quiet: bool, progress: Progress) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} runs, {eta} left");
    let bar = ProgressBar::new(progress.runs as u64);
    bar.set_position(progress.done as u64);
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
