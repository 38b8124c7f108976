//! `springs run`: simulate a scene.

use super::output::{Extra, Output};
use super::source::SceneArguments;
use super::{Ending, Unwritten, say, say_error, summary, watch_for_interrupt};
use indicatif::{ProgressBar, ProgressStyle};
use springs::report::{self, Timings, report};
use springs::scene::Scene;
use springs::step::{Frame, Islands, Observer, Outcome};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
pub(crate) struct RunArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder to write into [default: the scene's name without its ending]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of equal time intervals between frames [default: 60 a second]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// What to write besides final.ron and report.json
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    write: Vec<Extra>,
    /// No progress and no summary
    #[arg(long)]
    quiet: bool,
    /// Replace the results of another run
    #[arg(long)]
    force: bool,
}

impl RunArguments {
    fn intervals(&self, duration: f64) -> usize {
        match self.frames {
            Some(frames) => frames as usize,
            None => (60.0 * duration).round().max(1.0) as usize,
        }
    }
}

pub(crate) fn run(arguments: &RunArguments) -> anyhow::Result<Ending> {
    let begin = Instant::now();
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => arguments.scene.stem(),
    };
    Output::check(&folder, arguments.force)?;
    let source = arguments.scene.load()?;
    let scene = &source.scene;
    let mut islands = Islands::new(scene).map_err(|error| source.advised(&error))?;
    let mut timings = Timings {
        setup: begin.elapsed(),
        ..Timings::default()
    };

    let intervals = arguments.intervals(scene.settings.duration);
    let output = Output::begin(&folder, &arguments.write, intervals)?;
    let mut watcher = Watcher {
        interrupted: watch_for_interrupt()?,
        progress: match arguments.quiet {
            true => ProgressBar::hidden(),
            false => progress_bar(),
        },
        last_drawn: Instant::now(),
        duration: islands.duration(),
        output,
        writing: Duration::ZERO,
        failure: None,
    };
    let frames = if watcher.output.wants_frames() {
        intervals
    } else {
        1
    };
    let running = Instant::now();
    let outcome = islands.run(frames, &mut watcher);
    timings.stepping = running.elapsed() - watcher.writing;
    watcher.progress.finish_and_clear();
    if let Some(unwritten) = watcher.failure {
        return Err(unwritten.into());
    }
    let ending = match outcome {
        Ok(Outcome::Finished) => report::Ending::Finished,
        Ok(Outcome::Stopped) => report::Ending::Interrupted,
        Err(error) => report::Ending::Failed(error),
    };

    let writing = Instant::now();
    let time = islands.time();
    let written = watcher.output.finish(&last(scene, &islands), time)?;
    timings.output = watcher.writing + writing.elapsed();
    timings.total = begin.elapsed();
    let report = report(scene, &islands, ending, timings);
    watcher.output.report(&report)?;

    if !arguments.quiet {
        say(&summary::summary(
            scene,
            &report,
            watcher.output.folder(),
            &written,
        ));
    }
    Ok(match ending {
        report::Ending::Finished => Ending::Done,
        report::Ending::Interrupted => {
            say_error(&format!(
                "interrupted at {time} s; everything up to then is written"
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

/// The scene as the simulation left it.
fn last(scene: &Scene, islands: &Islands) -> Scene {
    let mut scene = scene.clone();
    islands.nodes().write_to(&mut scene);
    scene
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

/// Writes frames, draws progress, notices an interrupt.
struct Watcher {
    interrupted: Arc<AtomicBool>,
    progress: ProgressBar,
    last_drawn: Instant,
    duration: f64,
    output: Output,
    writing: Duration,
    failure: Option<Unwritten>,
}

/// Time between two drawings of the progress bar.
const REDRAW: Duration = Duration::from_millis(100);

impl Observer for Watcher {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let start = Instant::now();
        let written = self.output.frame(frame);
        self.writing += start.elapsed();
        match written {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.failure = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    fn step(&mut self, time: f64) -> ControlFlow<()> {
        if !self.progress.is_hidden() && self.last_drawn.elapsed() >= REDRAW {
            let done = time / self.duration;
            self.progress.set_position((done * PROGRESS as f64) as u64);
            self.progress.set_message(format!("{time:.3} s simulated"));
            self.last_drawn = Instant::now();
        }
        match self.interrupted.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}
