//! Commands, their errors and exit codes.

mod check;
mod checkpoints;
mod manual;
mod modes;
mod new;
mod output;
mod plot;
mod progress;
mod resume;
mod run;
mod settle;
mod signals;
mod source;
mod statics;
mod study;
mod summary;
mod sweep;
mod view;
mod watcher;

use clap::{CommandFactory as _, Parser, Subcommand};
use springs::io::WriteError;
use springs::scene::printable_within;
use std::io::Write as _;
use std::process::ExitCode;

/// Mass-spring simulation.
#[derive(Parser)]
#[command(name = "springs", version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene file and write what came out.
    Run(run::RunArguments),
    /// Go on with a run that was stopped, as if it had not been.
    Resume(resume::ResumeArguments),
    /// Make a page to look at a finished run in a browser.
    View(view::ViewArguments),
    /// Draw the tables of a finished run: energies, steps, peaks, probes.
    Plot(plot::PlotArguments),
    /// Find the equilibrium of a scene, and say whether it is stable.
    Settle(settle::SettleArguments),
    /// Find the lowest frequencies and shapes of vibrations about an equilibrium.
    Modes(modes::ModesArguments),
    /// Say what is in a scene, what will be skipped and what looks wrong.
    Check(check::CheckArguments),
    /// Measure run time against error for a scene, method by method.
    Study(study::StudyArguments),
    /// Run a scene with many values of its numbers, on any number of machines.
    Sweep(sweep::SweepArguments),
    /// Print a scene file: a chain, a cloth or a block.
    New(new::NewArguments),
    /// Print what makes a shell complete commands.
    Completions(manual::CompletionArguments),
    /// Print the manual page.
    Man,
}

/// How a command ended, other than by an error.
enum Ending {
    Done,
    Failed,
    Interrupted,
}

/// The command line or the scene is wrong; nothing was written.
const EXIT_WRONG: u8 = 2;
/// The simulation could not go on.
const EXIT_FAILED: u8 = 3;
/// Ended by a signal, such as that of Ctrl-C.
const EXIT_INTERRUPTED: u8 = 130;
/// A result could not be written.
const EXIT_UNWRITTEN: u8 = 1;

/// An error with what to do about it.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
struct Advised {
    message: String,
    advice: Option<String>,
}

/// A result could not be written though the command and the scene are right.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
struct Unwritten {
    error: WriteError,
    advice: Option<String>,
}

impl From<WriteError> for Unwritten {
    fn from(error: WriteError) -> Self {
        Self {
            error,
            advice: None,
        }
    }
}

pub(crate) fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let ending = match arguments.command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Resume(arguments) => resume::resume(&arguments),
        Command::View(arguments) => view::view(&arguments),
        Command::Plot(arguments) => plot::plot_command(&arguments),
        Command::Settle(arguments) => settle::settle_command(&arguments),
        Command::Modes(arguments) => modes::modes_command(&arguments),
        Command::Check(arguments) => check::check(&arguments),
        Command::Study(arguments) => study::study_command(&arguments),
        Command::Sweep(arguments) => sweep::sweep(&arguments),
        Command::New(arguments) => new::new(&arguments),
        Command::Completions(arguments) => manual::completions(&arguments, Arguments::command()),
        Command::Man => manual::man(Arguments::command()),
    };
    match ending {
        Ok(Ending::Done) => ExitCode::SUCCESS,
        Ok(Ending::Failed) => EXIT_FAILED.into(),
        Ok(Ending::Interrupted) => EXIT_INTERRUPTED.into(),
        Err(error) => report_error(&error).into(),
    }
}

fn report_error(error: &anyhow::Error) -> u8 {
    let advised = error.downcast_ref::<Advised>();
    let unwritten = error.downcast_ref::<Unwritten>();
    let advice = advised.map(|error| &error.advice);
    let advice = advice.or(unwritten.map(|error| &error.advice));
    let advice = advice.and_then(|advice| advice.as_deref());
    say_advised(&error.to_string(), advice);
    if unwritten.is_some() {
        EXIT_UNWRITTEN
    } else {
        EXIT_WRONG
    }
}

/// An error, and what to do about it.
fn say_advised(message: &str, advice: Option<&str>) {
    say_error(message);
    if let Some(advice) = advice {
        say(&format!("  {advice}"));
    }
}

/// An error on standard error, coloured as those of the command line's parser.
fn say_error(message: &str) {
    let style = *clap::builder::Styles::styled().get_error();
    let _ = write!(anstream::stderr(), "{style}error:{style:#} ");
    say(message);
}

/// Longer lines are cut, in characters.
const LONGEST_LINE: usize = 1000;

/// Lines on standard error. If that is closed, nobody listens.
fn say(text: &str) {
    for line in text.split('\n') {
        let line = printable_within(line, LONGEST_LINE);
        let _ = writeln!(std::io::stderr(), "{line}");
    }
}

/// Text on standard output. A reader that has seen enough is no error.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            let path = "standard output".into();
            Err(Unwritten::from(WriteError { path, source }).into())
        }
        _ => Ok(()),
    }
}
