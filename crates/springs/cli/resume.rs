//! `springs resume`: go on where a run stopped.

use super::checkpoints::About;
use super::output::{CHECKPOINT, Output, lock, quoted};
use super::progress::{Log, Progress};
use super::run::Run;
use super::signals::Signals;
use super::source::at_most_useful;
use super::{Advised, Ending, Unwritten};
use springs::io::{
    Checkpoint, CheckpointError, CheckpointFault, ContinueError, parse_scene, read_checkpoint,
};
use springs::report::TurnedOver;
use springs::step::Islands;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(clap::Args)]
pub(crate) struct ResumeArguments {
    /// The folder of a run that was stopped
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Threads that may be used; results do not depend on it, and more than 256 are not used [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
    /// How to tell of the way on standard error; `json`: an object a line for every step, no summary
    #[arg(long, value_name = "HOW", value_enum, default_value_t)]
    log: Log,
    /// No progress and no summary
    #[arg(long)]
    quiet: bool,
}

pub(crate) fn resume(arguments: &ResumeArguments) -> anyhow::Result<Ending> {
    let begin = Instant::now();
    let signals = Signals::watch();
    let folder = &arguments.folder;
    let path = folder.join(CHECKPOINT);
    // Nobody may write a checkpoint while it is read.
    let lock = lock(folder)?;
    if !path.exists() {
        return Err(Advised {
            message: format!("the folder {} holds no checkpoint", quoted(folder)),
            advice: Some(
                "runs with --checkpoint leave one until they are finished, and interrupted ones"
                    .to_owned(),
            ),
        }
        .into());
    }
    let read = read_checkpoint(&path).map_err(|error| match error {
        CheckpointError::Unsound {
            fault: CheckpointFault::OtherVersion { .. },
            ..
        } => anyhow::Error::from(Advised {
            message: error.to_string(),
            advice: Some(
                "go on with the program that wrote it, or start the run again with \
                 `springs run … --force`"
                    .to_owned(),
            ),
        }),
        other => other.into(),
    });
    let Checkpoint { about, words } = read?;
    let about: About = serde_json::from_str(&about)
        .map_err(|error| foreign(&path, &format!("it does not say what run it is: {error}")))?;
    let version = env!("CARGO_PKG_VERSION");
    if about.springs_version != version {
        let found = &about.springs_version;
        let why = format!("springs {found} wrote it, and this is {version}");
        return Err(foreign(&path, &why).into());
    }
    let (scene, mut options) = parse_scene(&path.display().to_string(), &about.scene)?;
    let reading = begin.elapsed();
    let progress = Progress::new(arguments.log, arguments.quiet);
    progress.phase("setting up");
    options.skip = about.skip;
    options.threads = arguments.threads.map_or(0, at_most_useful);
    let mut islands = Islands::with_options(&scene, &options)
        .map_err(|error| foreign(&path, &error.to_string()))?;
    islands
        .restore(words)
        .map_err(|error| foreign(&path, &error.to_string()))?;
    about
        .check(&scene, &islands)
        .map_err(|why| foreign(&path, why))?;
    let mut run = Run {
        trials_before: islands.trial_time(),
        turned_over: TurnedOver(about.turned_over),
        scene,
        options,
        islands,
        folder: folder.clone(),
        intervals: about.intervals,
        every: about.every,
        signals,
        begin,
        reading,
        setup: begin.elapsed().saturating_sub(reading),
        quiet: arguments.quiet,
        at_the_end: None,
    };
    run.hear_signals();
    let output = Output::resume(folder, lock, &run.plan(), &about.outputs);
    let output = output.map_err(|error| match error {
        ContinueError::File(error) => anyhow::Error::from(Unwritten::from(error)),
        other => foreign(&path, &other.to_string()).into(),
    })?;
    run.go(output, progress)
}

fn foreign(path: &Path, why: &str) -> Advised {
    Advised {
        message: format!("the run cannot go on from {}: {why}", quoted(path)),
        advice: Some("start it again with `springs run … --force`".to_owned()),
    }
}
