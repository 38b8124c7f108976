//! `springs run`: simulate a scene.

use super::checkpoints::{About, Every};
use super::output::{CHECKPOINT, Output, make_folder};
use super::progress::{Log, Progress};
use super::signals::Signals;
use super::source::SceneArguments;
use super::statics::sentence;
use super::view::invitation;
use super::watcher::Watcher;
use super::{Advised, Ending, Unwritten, say, say_advised, say_error, summary};
use clap::builder::{PossibleValue, PossibleValuesParser};
use springs::inspect::short;
use springs::io::{
    Checkpoint, PROBES, Report, RunEnd, RunPlan, SinkKind, WriteError, scene_to_string,
    write_checkpoint,
};
use springs::report::{self, Timings, TurnedOver, report};
use springs::scene::{RunOptions, Scene, Start};
use springs::sinks::{Marks, SINKS, intervals, tension_peaks};
use springs::solver::Interrupt;
use springs::step::{Islands, Outcome, Patience, StepError};
use springs::view::{self, View};
use std::path::PathBuf;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
pub(crate) struct RunArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder to write into [default: the scene's name without its ending; `scene` for standard input]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of equal time intervals between frames [default: that of the scene, or 60 a second]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// What to write besides final.ron and report.json, in place of what the scene asks for
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = outputs())]
    write: Vec<String>,
    /// End with view.html, a page to look at the run in a browser; as `--write view`
    #[arg(long)]
    view: bool,
    /// Write a checkpoint so often: every 100 (steps), every 0.5s (simulated)
    #[arg(long, value_name = "EVERY")]
    checkpoint: Option<Every>,
    /// How to tell of the way on standard error; `json`: an object a line for every step, no summary
    #[arg(long, value_name = "HOW", value_enum, default_value_t)]
    log: Log,
    /// No progress and no summary
    #[arg(long)]
    quiet: bool,
    /// Replace the results of another run
    #[arg(long)]
    force: bool,
}

/// The names of all outputs.
fn outputs() -> PossibleValuesParser {
    let value = |kind: &&dyn SinkKind| PossibleValue::new(kind.name()).help(kind.about());
    PossibleValuesParser::new(SINKS.iter().map(value))
}

impl RunArguments {
    /// The names of what is to be written.
    fn outputs(&self, scene: &Scene) -> Result<Vec<String>, Advised> {
        let asked = if self.write.is_empty() {
            &scene.output.write
        } else {
            &self.write
        };
        let mut names = asked.clone();
        if self.view {
            names.push(View.name().to_owned());
        }
        if !scene.output.probes.is_empty() {
            names.push(PROBES.to_owned());
        } else if names.iter().any(|name| name == PROBES) {
            return Err(Advised {
                message: "the scene has no probes to write".to_owned(),
                advice: Some(
                    "give it some, such as output: (probes: [(node: 1, of: [Position])])"
                        .to_owned(),
                ),
            });
        }
        Ok(names)
    }
}

/// A run on its way.
pub(super) struct Run {
    pub(super) scene: Scene,
    pub(super) options: RunOptions,
    pub(super) islands: Islands,
    pub(super) folder: PathBuf,
    pub(super) intervals: usize,
    pub(super) every: Option<Every>,
    pub(super) signals: Signals,
    pub(super) begin: Instant,
    pub(super) reading: Duration,
    pub(super) setup: Duration,
    /// Time of trial runs that an earlier run made.
    pub(super) trials_before: Duration,
    /// So far.
    pub(super) turned_over: TurnedOver,
    pub(super) quiet: bool,
    /// What was written when the last files began to be.
    pub(super) at_the_end: Option<Marks>,
}

pub(crate) fn run(arguments: &RunArguments) -> anyhow::Result<Ending> {
    let begin = Instant::now();
    let signals = Signals::watch();
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => arguments.scene.stem(),
    };
    Output::check(&folder, arguments.scene.path(), arguments.force)?;
    let mut source = arguments.scene.load()?;
    let reading = begin.elapsed();
    let progress = Progress::new(arguments.log, arguments.quiet);
    if source.scene.settings.start == Start::Equilibrium {
        progress.phase("looking for the equilibrium");
    }
    match source.start() {
        Ok(Some(equilibrium)) if !arguments.quiet && !progress.is_json() => {
            progress.clear();
            say(&format!("start: {}", sentence(&equilibrium)));
        }
        Ok(_) => {}
        Err(error) => {
            progress.clear();
            let advised = source.advised_of_statics(&error);
            if !error.is_not_found() {
                return Err(advised.into());
            }
            say_advised(&advised.message, advised.advice.as_deref());
            return Ok(Ending::Failed);
        }
    }
    progress.phase("setting up");
    let islands = Islands::with_options(&source.scene, &source.options)
        .map_err(|error| source.advised(&error))?;
    let intervals = match arguments.frames {
        Some(frames) => frames as usize,
        None => intervals(&source.scene),
    };
    let names = arguments.outputs(&source.scene)?;
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
        reading,
        setup: begin.elapsed().saturating_sub(reading),
        quiet: arguments.quiet,
        at_the_end: None,
    };
    run.hear_signals();
    let output = Output::begin(&run.folder, &names, &run.plan(), arguments.force)?;
    run.go(output, progress)
}

/// What came out.
struct Results {
    ending: report::Ending,
    report: Report,
    written: Vec<&'static str>,
}

impl Run {
    /// Simulates to the end, or until something stops it, and writes.
    pub(super) fn go(mut self, output: Output, mut progress: Progress) -> anyhow::Result<Ending> {
        progress.begin(self.islands.duration());
        let mut watcher = self.watcher(output, progress);
        let running = Instant::now();
        let outcome = self.simulate(&mut watcher);
        let others = watcher.writing + self.trial_time();
        watcher.stepping = running.elapsed().saturating_sub(others);
        watcher.progress.clear();
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
        watcher.progress.end(&report.status, self.islands.time());
        if !self.quiet && !watcher.progress.is_json() {
            let folder = watcher.output.folder();
            say(&summary::summary(&self.scene, &report, folder, &written));
            if written.contains(&view::FILE) {
                say(&invitation(&folder.join(view::FILE)));
            }
        }
        Ok(match ending {
            report::Ending::Finished => Ending::Done,
            report::Ending::Interrupted => {
                let time = short(self.islands.time());
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
    pub(super) fn hear_signals(&mut self) {
        self.signals.note_the_first();
        let interrupt = Interrupt::from(self.signals.is_interrupted());
        self.islands.set_interrupt(&interrupt);
    }

    /// What an output is told before the run.
    pub(super) fn plan(&self) -> RunPlan<'_> {
        RunPlan {
            scene: &self.scene,
            intervals: self.intervals,
        }
    }

    /// Of the trial runs of this run.
    fn trial_time(&self) -> Duration {
        self.islands.trial_time().saturating_sub(self.trials_before)
    }

    fn watcher(&self, output: Output, progress: Progress) -> Watcher {
        Watcher {
            is_interrupted: self.signals.is_interrupted(),
            progress,
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
        let ending = report::Ending::from(outcome);
        if ending == report::Ending::Interrupted {
            self.checkpoint(watcher)?;
        }
        let writing = Instant::now();
        self.at_the_end = Some(watcher.output.marks());
        let written = watcher.output.finish(
            &RunEnd {
                scene: &self.last(),
                time: self.islands.time(),
                peaks: &tension_peaks(&self.islands),
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
            reading: self.reading,
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
        let time = short(self.islands.time());
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
        self.islands.write_to(&mut scene);
        scene
    }
}
