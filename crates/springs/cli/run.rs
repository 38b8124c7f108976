//! `springs run`: simulate a scene; `springs resume`: go on where one stopped.

use super::output::{CHECKPOINT, Output, lock, make_folder, quoted};
use super::signals::Signals;
use super::source::{SceneArguments, at_most_useful};
use super::{Advised, Ending, Unwritten, say, say_error, summary};
use clap::builder::{PossibleValue, PossibleValuesParser};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use springs::io::{
    Checkpoint, CheckpointError, ContinueError, Report, RunEnd, RunPlan, SinkKind, WriteError,
    parse_scene, read_checkpoint, scene_to_string, write_checkpoint,
};
use springs::report::{self, Timings, TurnedOver, report};
use springs::scene::{RunOptions, Scene};
use springs::sinks::{Marks, SINKS};
use springs::solver::Interrupt;
use springs::step::{Account, Frame, Islands, Observer, Outcome, Patience, StepError};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
pub(crate) struct RunArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder to write into [default: the scene's name without its ending; `scene` for standard input]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of equal time intervals between frames [default: 60 a second]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// What to write besides final.ron and report.json
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = outputs())]
    write: Vec<String>,
    /// Write a checkpoint so often: every 100 (steps), every 0.5s (simulated)
    #[arg(long, value_name = "EVERY")]
    checkpoint: Option<Every>,
    /// No progress and no summary
    #[arg(long)]
    quiet: bool,
    /// Replace the results of another run
    #[arg(long)]
    force: bool,
}

#[derive(clap::Args)]
pub(crate) struct ResumeArguments {
    /// The folder of a run that was stopped
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Threads that may be used; results do not depend on it, and more than 256 are not used [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
    /// No progress and no summary
    #[arg(long)]
    quiet: bool,
}

/// The names of all outputs.
fn outputs() -> PossibleValuesParser {
    let value = |kind: &&dyn SinkKind| PossibleValue::new(kind.name()).help(kind.about());
    PossibleValuesParser::new(SINKS.iter().map(value))
}

/// How often checkpoints are written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Every {
    Steps(u64),
    /// Of simulated time.
    Seconds(f64),
}

/// A whole number is one of steps; anything else is seconds.
impl FromStr for Every {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(steps) = text.parse() {
            return match steps {
                0 => Err("it must be one step at least".to_owned()),
                steps => Ok(Self::Steps(steps)),
            };
        }
        let seconds = text.strip_suffix('s').unwrap_or(text).parse();
        match seconds {
            Ok(seconds) if seconds > 0.0 && f64::is_finite(seconds) => Ok(Self::Seconds(seconds)),
            _ => {
                Err("steps such as 100, or simulated seconds such as 0.5s, are expected".to_owned())
            }
        }
    }
}

/// What a checkpoint says about its run, besides its state.
#[derive(Serialize, Deserialize)]
struct About {
    springs_version: String,
    /// The scene as it was at the start, as a scene file.
    scene: String,
    skip: bool,
    intervals: usize,
    every: Option<Every>,
    outputs: Marks,
    /// Energy that moved so far, in J.
    turned_over: f64,
}

impl About {
    /// A sound check sum does not make a sound run.
    fn check(&self, scene: &Scene, islands: &Islands) -> Result<(), &'static str> {
        let duration = scene.settings.duration;
        let clocks = islands.parts().iter();
        let clocks = clocks.map(|part| part.simulation().stepper().time());
        let mut times = clocks.chain([islands.time()]);
        let nodes = islands.nodes();
        let mut numbers = nodes.positions.iter().chain(&nodes.velocities).flatten();
        let most_intervals = default_intervals(scene).max(u32::MAX as usize);
        if !times.all(|time| (0.0..=duration).contains(&time)) {
            Err("its time is not one of the run")
        } else if !numbers.all(|number| number.is_finite()) {
            Err("a node is nowhere")
        } else if !(1..=most_intervals).contains(&self.intervals) {
            Err("its number of frames is not one of a run")
        } else {
            Ok(())
        }
    }
}

/// A run on its way.
struct Run {
    scene: Scene,
    options: RunOptions,
    islands: Islands,
    folder: PathBuf,
    intervals: usize,
    every: Option<Every>,
    signals: Signals,
    begin: Instant,
    setup: Duration,
    /// Time of trial runs that an earlier run made.
    trials_before: Duration,
    /// So far.
    turned_over: TurnedOver,
    quiet: bool,
    /// What was written when the last files began to be.
    at_the_end: Option<Marks>,
}

pub(crate) fn run(arguments: &RunArguments) -> anyhow::Result<Ending> {
    let begin = Instant::now();
    let signals = Signals::watch();
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => arguments.scene.stem(),
    };
    Output::check(&folder, arguments.scene.path(), arguments.force)?;
    let source = arguments.scene.load()?;
    let islands = Islands::with_options(&source.scene, &source.options)
        .map_err(|error| source.advised(&error))?;
    let intervals = match arguments.frames {
        Some(frames) => frames as usize,
        None => default_intervals(&source.scene),
    };
    let mut run = Run {
        trials_before: Duration::ZERO,
        turned_over: TurnedOver::default(),
        scene: source.scene,
        options: source.options,
        islands,
        folder,
        intervals,
        every: arguments.checkpoint,
        signals,
        begin,
        setup: begin.elapsed(),
        quiet: arguments.quiet,
        at_the_end: None,
    };
    run.hear_signals();
    let output = Output::begin(&run.folder, &arguments.write, &run.plan(), arguments.force)?;
    run.go(output)
}

/// 60 a second.
fn default_intervals(scene: &Scene) -> usize {
    (60.0 * scene.settings.duration).round().max(1.0) as usize
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
        CheckpointError::OtherVersion { .. } => anyhow::Error::from(Advised {
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
        setup: begin.elapsed(),
        quiet: arguments.quiet,
        at_the_end: None,
    };
    run.hear_signals();
    let output = Output::resume(folder, lock, &run.plan(), &about.outputs);
    let output = output.map_err(|error| match error {
        ContinueError::File(error) => anyhow::Error::from(Unwritten::from(error)),
        other => foreign(&path, &other.to_string()).into(),
    })?;
    run.go(output)
}

fn foreign(path: &Path, why: &str) -> Advised {
    Advised {
        message: format!("the run cannot go on from {}: {why}", quoted(path)),
        advice: Some("start it again with `springs run … --force`".to_owned()),
    }
}

/// What came out.
struct Results {
    ending: report::Ending,
    report: Report,
    written: Vec<&'static str>,
}

impl Run {
    /// Simulates to the end, or until something stops it, and writes.
    fn go(mut self, output: Output) -> anyhow::Result<Ending> {
        let mut watcher = self.watcher(output);
        let running = Instant::now();
        let outcome = self.simulate(&mut watcher);
        let others = watcher.writing + self.trial_time();
        watcher.stepping = running.elapsed().saturating_sub(others);
        watcher.progress.finish_and_clear();
        let results = match outcome {
            Ok(outcome) => self.complete(&mut watcher, outcome),
            Err(unwritten) => Err(unwritten),
        };
        let Results {
            ending,
            report,
            written,
        } = match results {
            Ok(results) => results,
            Err(unwritten) => return Err(self.save_what_fits(&mut watcher, unwritten).into()),
        };
        if !self.quiet {
            let folder = watcher.output.folder();
            say(&summary::summary(&self.scene, &report, folder, &written));
        }
        Ok(match ending {
            report::Ending::Finished => Ending::Done,
            report::Ending::Interrupted => {
                let time = summary::short(self.islands.time());
                say_error(&format!(
                    "interrupted at {time} s; everything up to then is written"
                ));
                say(&format!(
                    "  `springs resume {}` goes on from there",
                    self.folder.display()
                ));
                Ending::Interrupted
            }
            report::Ending::Failed(error) => {
                say_error(&error.to_string());
                say(&format!("  {}", error.advice()));
                Ending::Failed
            }
        })
    }

    /// From now on the first signal is only noted, and the simulation stops soon.
    fn hear_signals(&mut self) {
        self.signals.note_the_first();
        let interrupt = Interrupt::from(self.signals.is_interrupted());
        self.islands.set_interrupt(&interrupt);
    }

    /// What an output is told before the run.
    fn plan(&self) -> RunPlan<'_> {
        RunPlan {
            scene: &self.scene,
            intervals: self.intervals,
        }
    }

    /// Of the trial runs of this run.
    fn trial_time(&self) -> Duration {
        self.islands.trial_time().saturating_sub(self.trials_before)
    }

    fn watcher(&self, output: Output) -> Watcher {
        Watcher {
            is_interrupted: self.signals.is_interrupted(),
            progress: if self.quiet {
                ProgressBar::hidden()
            } else {
                progress_bar()
            },
            last_drawn: Instant::now(),
            duration: self.islands.duration(),
            output,
            stepping: Duration::ZERO,
            writing: Duration::ZERO,
            failure: None,
            next_checkpoint: self.next_checkpoint(),
            // One to begin with.
            is_due: self.every.is_some(),
            turned_over: self.turned_over,
            next_look: self.islands.time(),
            is_look_due: true,
        }
    }

    /// Runs, with a checkpoint whenever one is due.
    fn simulate(&mut self, watcher: &mut Watcher) -> Result<Result<Outcome, StepError>, Unwritten> {
        loop {
            if watcher.is_due {
                self.checkpoint(watcher)?;
            }
            let frames = if watcher.output.wants_frames() {
                self.intervals
            } else {
                1
            };
            let outcome = self.islands.run(frames, watcher);
            if let Some(unwritten) = watcher.failure.take() {
                return Err(unwritten);
            }
            // A checkpoint stops a run only to be written.
            let goes_on = watcher.is_due && !watcher.is_interrupted();
            if !(goes_on && outcome == Ok(Outcome::Stopped)) {
                return Ok(outcome);
            }
        }
    }

    /// Writes what is written at the end, and removes what an older run left.
    fn complete(
        &mut self,
        watcher: &mut Watcher,
        outcome: Result<Outcome, StepError>,
    ) -> Result<Results, Unwritten> {
        let ending = match outcome {
            Ok(Outcome::Finished) => report::Ending::Finished,
            Ok(Outcome::Stopped) => report::Ending::Interrupted,
            Err(error) => report::Ending::Failed(error),
        };
        if ending == report::Ending::Interrupted {
            self.checkpoint(watcher)?;
        }
        let writing = Instant::now();
        self.at_the_end = Some(watcher.output.marks());
        let written = watcher.output.finish(
            &RunEnd {
                scene: &self.last(),
                time: self.islands.time(),
            },
            &self.options,
        )?;
        watcher.writing += writing.elapsed();
        let report = self.report(watcher, ending);
        watcher.output.report(&report)?;
        let is_finished = ending == report::Ending::Finished;
        watcher.output.remove_others(&written, is_finished);
        Ok(Results {
            ending,
            report,
            written,
        })
    }

    fn report(&self, watcher: &Watcher, ending: report::Ending) -> Report {
        let timings = Timings {
            setup: self.setup,
            trials: self.trial_time(),
            stepping: watcher.stepping,
            output: watcher.writing,
            total: self.begin.elapsed(),
        };
        report(
            &self.scene,
            &self.islands,
            ending,
            timings,
            watcher.turned_over,
        )
    }

    /// After a file could not be written: saves the rest as far as there is room,
    /// so that the run can go on when there is more.
    fn save_what_fits(&mut self, watcher: &mut Watcher, unwritten: Unwritten) -> Unwritten {
        let at_the_end = self.at_the_end.take();
        let marks = at_the_end.unwrap_or_else(|| watcher.output.marks());
        let report = self.report(watcher, report::Ending::Interrupted);
        self.turned_over = watcher.turned_over;
        let (last, options) = (self.last(), &self.options);
        let mut saved = watcher.output.save_what_fits(&last, options, &report);
        let can_go_on = marks.check(&self.folder, &self.plan()).is_ok();
        if can_go_on && self.write_checkpoint(marks).is_ok() {
            watcher.output.checkpoint_written();
        }
        let can_go_on = can_go_on && watcher.output.owns_checkpoint();
        if can_go_on {
            saved.push(CHECKPOINT.to_owned());
        }
        let time = summary::short(self.islands.time());
        let advice = if saved.is_empty() {
            format!("nothing of the run could be saved; it had come to {time} s")
        } else if can_go_on {
            format!(
                "it had come to {time} s; saved are {}; once files can be written again, \
                 `springs resume {}` goes on",
                saved.join(", "),
                self.folder.display()
            )
        } else {
            format!("it had come to {time} s; saved are {}", saved.join(", "))
        };
        Unwritten {
            advice: Some(advice),
            ..unwritten
        }
    }

    fn checkpoint(&mut self, watcher: &mut Watcher) -> Result<(), Unwritten> {
        let start = Instant::now();
        // It may have been removed on the way.
        make_folder(&self.folder)?;
        if self.every.is_some() {
            // What a checkpoint goes on from must be there after a kill.
            watcher.output.keep()?;
        }
        self.turned_over = watcher.turned_over;
        self.write_checkpoint(watcher.output.marks())?;
        watcher.output.checkpoint_written();
        watcher.is_due = false;
        watcher.next_checkpoint = self.next_checkpoint();
        watcher.writing += start.elapsed();
        Ok(())
    }

    /// When the next checkpoint after the present state is due.
    fn next_checkpoint(&self) -> Patience {
        let mut next = Patience::NEVER;
        match self.every {
            None => {}
            Some(Every::Steps(steps)) => {
                next.steps = self.islands.steps().saturating_add(steps);
            }
            Some(Every::Seconds(seconds)) => {
                let periods = (self.islands.time() / seconds * (1.0 + 1e-12)).floor();
                next.time = (periods + 1.0) * seconds;
            }
        }
        next
    }

    fn write_checkpoint(&mut self, outputs: Marks) -> Result<(), WriteError> {
        let path = self.folder.join(CHECKPOINT);
        let about = About {
            springs_version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene_to_string(&self.scene, &self.options),
            skip: self.options.skip,
            intervals: self.intervals,
            every: self.every,
            outputs,
            turned_over: self.turned_over.0,
        };
        let about = serde_json::to_string(&about).map_err(|error| WriteError {
            path: path.clone(),
            source: error.into(),
        })?;
        let words = self.islands.save();
        write_checkpoint(&path, &Checkpoint { about, words })
    }

    /// The scene as the simulation left it.
    fn last(&self) -> Scene {
        let mut scene = self.scene.clone();
        self.islands.nodes().write_to(&mut scene);
        for load in &mut scene.loads {
            load.over_time = load.over_time.after(self.islands.time());
        }
        scene
    }
}

/// Drawn to standard error, and only if that is a terminal. Its length is
/// simulated time.
fn progress_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}, {eta} left")
        .expect("a template that is correct");
    ProgressBar::new(PROGRESS).with_style(style)
}

/// Parts of the duration that the progress bar tells apart.
const PROGRESS: u64 = 10_000;

/// Writes frames, draws progress, notices an interrupt or when a checkpoint is
/// due.
struct Watcher {
    is_interrupted: Arc<AtomicBool>,
    progress: ProgressBar,
    last_drawn: Instant,
    duration: f64,
    output: Output,
    stepping: Duration,
    writing: Duration,
    failure: Option<Unwritten>,
    next_checkpoint: Patience,
    is_due: bool,
    /// Energy that moved so far.
    turned_over: TurnedOver,
    /// When energies are looked at next, in simulated seconds.
    next_look: f64,
    is_look_due: bool,
}

/// Looks at the energies of a run, in equal intervals.
const LOOKS: f64 = 64.0;

/// Time between two drawings of the progress bar.
const REDRAW: Duration = Duration::from_millis(100);

impl Watcher {
    fn is_interrupted(&self) -> bool {
        self.is_interrupted.load(Ordering::SeqCst)
    }

    /// A failure ends the run at the next step: what belongs to this one is kept
    /// to be written later, as long as it is not too much.
    fn write(
        &mut self,
        write: impl FnOnce(&mut Output) -> Result<(), Unwritten>,
    ) -> ControlFlow<()> {
        let start = Instant::now();
        let written = write(&mut self.output);
        self.writing += start.elapsed();
        if let Err(error) = written {
            self.failure.get_or_insert(error);
            if self.output.n_unwritten() > MOST_UNWRITTEN {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
}

/// Bytes that are kept in memory if they cannot be written.
const MOST_UNWRITTEN: usize = 1 << 28;

impl Observer for Watcher {
    fn trial(&mut self, steps: u64) -> ControlFlow<()> {
        if !self.progress.is_hidden() && self.last_drawn.elapsed() >= REDRAW {
            self.progress
                .set_message(format!("{steps} steps of trial runs"));
            self.last_drawn = Instant::now();
        }
        if self.is_interrupted() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        self.write(|output| output.frame(frame))
    }

    fn patience(&self) -> Patience {
        self.next_checkpoint
    }

    fn wants_account(&self) -> bool {
        self.is_look_due || self.output.wants_account()
    }

    fn account(&mut self, account: Account) -> ControlFlow<()> {
        self.is_look_due = false;
        self.turned_over.look(&account);
        if !self.output.wants_account() {
            return ControlFlow::Continue(());
        }
        self.write(|output| output.account(&account))
    }

    fn step(&mut self, time: f64, steps: u64) -> ControlFlow<()> {
        if !self.progress.is_hidden() && self.last_drawn.elapsed() >= REDRAW {
            let done = time / self.duration;
            self.progress.set_position((done * PROGRESS as f64) as u64);
            self.progress.set_message(format!("{time:.3} s simulated"));
            self.last_drawn = Instant::now();
        }
        if time >= self.next_look {
            self.is_look_due = true;
            self.next_look = time + self.duration / LOOKS;
        }
        self.is_due = self.next_checkpoint.is_used_up(time, steps);
        if self.is_due || self.is_interrupted() || self.failure.is_some() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_and_seconds_are_told_apart() {
        assert_eq!("100".parse(), Ok(Every::Steps(100)));
        assert_eq!("0.5".parse(), Ok(Every::Seconds(0.5)));
        assert_eq!("2s".parse(), Ok(Every::Seconds(2.0)));
        for bad in ["0", "-1", "0.0", "often", "inf", "nans"] {
            assert!(bad.parse::<Every>().is_err(), "{bad}");
        }
    }
}
