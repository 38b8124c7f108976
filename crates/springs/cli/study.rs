//! `springs study`: run time against error for a scene.

use super::output::{claim, make_folder};
use super::signals::Signals;
use super::source::SceneArguments;
use super::{Advised, Ending, Unwritten, say, say_error};
use indicatif::{ProgressBar, ProgressStyle};
use springs::io::write_whole;
use springs::scene::Method;
use springs::study::{
    Options, Progress, StabilityMap, Study, StudyError, csv, diagram, recommendations, stability,
    stability_csv, stability_diagram, study, table,
};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

#[derive(clap::Args)]
pub(crate) struct StudyArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder to write into [default: the scene's name without its ending]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Methods to compare [default: all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    methods: Vec<Method>,
    /// Time that all runs together should take, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = positive)]
    budget: f64,
    /// How often short runs are repeated; the median counts
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

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number < 1e9 => Ok(number),
        Ok(_) => Err("must be greater than zero".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

const CSV: &str = "study.csv";
const JSON: &str = "study.json";
const DIAGRAM: &str = "study.svg";
const MAP_CSV: &str = "stability.csv";
const MAP_DIAGRAM: &str = "stability.svg";

pub(crate) fn study_command(arguments: &StudyArguments) -> anyhow::Result<Ending> {
    let signals = Signals::watch();
    let folder = match &arguments.out {
        Some(folder) => folder.clone(),
        None => arguments.scene.stem(),
    };
    let files: &[&str] = match arguments.stability {
        true => &[MAP_CSV, MAP_DIAGRAM],
        false => &[CSV, JSON, DIAGRAM],
    };
    claim(&folder, files, arguments.force)?;
    let source = arguments.scene.load()?;
    let mut options = Options {
        budget: Duration::from_secs_f64(arguments.budget),
        repeats: arguments.repeats as usize,
        ..Options::default()
    };
    if !arguments.methods.is_empty() {
        options.methods = arguments.methods.clone();
        options.methods.retain(|method| *method != Method::Auto);
    }
    signals.note_the_first();
    let interrupted = signals.is_interrupted();
    let bar = match arguments.quiet {
        true => ProgressBar::hidden(),
        false => progress_bar(),
    };
    let mut watch = |progress: Progress<'_>| {
        if !progress.what.is_empty() {
            bar.set_message(progress.what.to_owned());
        }
        bar.set_position((progress.fraction.min(1.0) * PARTS as f64) as u64);
        match interrupted.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let ending = match arguments.stability {
        true => stability(&source.scene, &options, &mut watch).map(|map| {
            bar.finish_and_clear();
            write_map(&map, &folder, arguments.quiet)
        }),
        false => study(&source.scene, &options, &mut watch).map(|study| {
            bar.finish_and_clear();
            write_study(&study, &folder, arguments.quiet)
        }),
    };
    bar.finish_and_clear();
    match ending {
        Ok(ending) => ending,
        Err(StudyError::Setup(error)) => Err(source.advised(&error).into()),
        Err(StudyError::Stopped) => {
            say_error("interrupted before there was a reference solution; nothing is written");
            Ok(Ending::Interrupted)
        }
        Err(error) => Err(Advised {
            message: error.to_string(),
            advice: Some("give it more time with --budget, or a shorter --duration".to_owned()),
        }
        .into()),
    }
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), Unwritten> {
    Ok(write_whole(&folder.join(name), text.as_bytes())?)
}

fn write_map(map: &StabilityMap, folder: &Path, quiet: bool) -> anyhow::Result<Ending> {
    make_folder(folder)?;
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
    Ok(match map.interrupted {
        true => Ending::Interrupted,
        false => Ending::Done,
    })
}

fn write_study(study: &Study, folder: &Path, quiet: bool) -> anyhow::Result<Ending> {
    make_folder(folder)?;
    write(folder, CSV, &csv(study))?;
    write(folder, JSON, &(serde_json::to_string_pretty(study)? + "\n"))?;
    write(folder, DIAGRAM, &diagram(study))?;
    if !quiet {
        say(&format!(
            "{}{} s, reference by {} at {:.0e} m, uncertain by {:.0e} m (against {})\n",
            match study.scene.as_str() {
                "" => String::new(),
                name => format!("{name}: "),
            },
            study.duration,
            study.reference.method,
            study.reference.tolerance,
            study.reference.uncertainty,
            study.reference.compared_with,
        ));
        say(&table(study));
        for (method, why) in &study.refused {
            say(&format!("left out {method}: {why}"));
        }
        for sentence in recommendations(study) {
            say(&sentence);
        }
        say(&format!(
            "wrote {CSV}, {JSON}, {DIAGRAM} into {}",
            folder.display()
        ));
    }
    Ok(match study.interrupted {
        true => Ending::Interrupted,
        false => Ending::Done,
    })
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
