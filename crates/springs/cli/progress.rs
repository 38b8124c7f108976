//! What a run tells of its way: one line on a terminal, or objects of JSON.

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use serde::Serialize;
use springs::inspect::time;
use springs::report::step_row;
use springs::step::StepRecord;
use std::io::Write as _;
use std::time::{Duration, Instant};

/// How a run tells of its way on standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Log {
    /// One line that changes, if standard error is a terminal
    #[default]
    Line,
    /// An object of JSON a line for every step
    Json,
}

/// Time between two drawings of the line.
const REDRAW: Duration = Duration::from_millis(100);
/// The speed that is told is that of about so much time, in s.
const MEMORY: f64 = 3.0;

/// Tells of a run on standard error.
pub(super) struct Progress {
    teller: Teller,
    /// Simulated time at the end, in s.
    duration: f64,
    last_drawn: Instant,
    /// The last step, and the counts when the line was drawn last.
    last: Option<StepRecord>,
    drawn: Option<StepRecord>,
    speed: Speed,
    begin: Instant,
}

enum Teller {
    Nobody,
    Line(ProgressBar),
    Json,
}

/// Simulated seconds a second.
#[derive(Clone, Copy, Default)]
struct Speed {
    /// When it was noted last, and the simulated time then, in s.
    last: Option<(Instant, f64)>,
    average: Option<f64>,
}

impl Speed {
    /// Takes note of the simulated time, in s.
    fn note(&mut self, simulated: f64) {
        let before = self.last.replace((Instant::now(), simulated));
        let Some((since, from)) = before else {
            return;
        };
        let seconds = since.elapsed().as_secs_f64();
        let now = (simulated - from) / seconds;
        let weight = 1.0 - (-seconds / MEMORY).exp();
        self.average = Some(match self.average {
            Some(average) => average + weight * (now - average),
            None => now,
        });
    }
}

/// A line of `--log json`.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event<'a> {
    /// Something that comes before the first step.
    Phase {
        phase: &'a str,
        elapsed: f64,
    },
    Trials {
        steps: u64,
        elapsed: f64,
    },
    Step {
        #[serde(flatten)]
        row: springs::io::StepRow,
        elapsed: f64,
    },
    End {
        status: &'a str,
        time: f64,
        elapsed: f64,
    },
}

impl Progress {
    pub(super) fn new(log: Log, is_quiet: bool) -> Self {
        let now = Instant::now();
        let teller = match log {
            Log::Json => Teller::Json,
            Log::Line if is_quiet => Teller::Nobody,
            Log::Line => {
                let bar = ProgressBar::new(PARTS)
                    .with_style(style("{spinner} {msg}"))
                    .with_finish(ProgressFinish::AndClear);
                // Hidden where standard error is no terminal.
                if bar.is_hidden() {
                    Teller::Nobody
                } else {
                    Teller::Line(bar)
                }
            }
        };
        Self {
            teller,
            duration: 0.0,
            last_drawn: now,
            last: None,
            drawn: None,
            speed: Speed::default(),
            begin: now,
        }
    }

    /// Whether the summary of a run would stand among objects of JSON.
    pub(super) fn is_json(&self) -> bool {
        matches!(self.teller, Teller::Json)
    }

    /// Something begins that comes before the first step.
    pub(super) fn phase(&self, phase: &str) {
        match &self.teller {
            Teller::Nobody => {}
            Teller::Line(bar) => {
                bar.set_message(format!("{phase} …"));
                bar.enable_steady_tick(REDRAW);
            }
            Teller::Json => self.say(&Event::Phase {
                phase,
                elapsed: self.elapsed(),
            }),
        }
    }

    /// A run begins or goes on that ends at a simulated time, in s.
    pub(super) fn begin(&mut self, duration: f64) {
        self.duration = duration;
    }

    /// Trial runs have made so many steps.
    pub(super) fn trial(&mut self, steps: u64) {
        if !self.is_due() {
            return;
        }
        match &self.teller {
            Teller::Nobody => {}
            Teller::Line(bar) => bar.set_message(format!("trial runs: {steps} steps")),
            Teller::Json => self.say(&Event::Trials {
                steps,
                elapsed: self.elapsed(),
            }),
        }
    }

    /// A step was made.
    pub(super) fn record(&mut self, record: &StepRecord) {
        self.last = Some(*record);
        if self.is_json() {
            self.say(&Event::Step {
                row: step_row(record),
                elapsed: self.elapsed(),
            });
        }
    }

    /// The run has come to a simulated time, in s.
    pub(super) fn come_to(&mut self, simulated: f64) {
        if !matches!(self.teller, Teller::Line(_)) || !self.is_due() {
            return;
        }
        self.speed.note(simulated);
        let text = self.line(simulated);
        if let Teller::Line(bar) = &self.teller {
            bar.disable_steady_tick();
            bar.set_style(style("{bar:20} {percent:>3} %  {msg}"));
            bar.set_position((simulated / self.duration * PARTS as f64) as u64);
            bar.set_message(text);
        }
        self.drawn = self.last;
    }

    /// "0.53 of 1.6 s, step 2.1 ms, error 40 % of allowed, 3 iterations, 0.4 × real time, 3.2 s left".
    fn line(&self, simulated: f64) -> String {
        let mut text = format!("{simulated:.4} of {} s", self.duration);
        if let Some(record) = &self.last {
            text += &format!(", step {}", time(record.step_size));
            if let (Some(error), Some(allowed)) = (record.error, record.allowed_error) {
                text += &format!(", error {:.0} % of allowed", 100.0 * error / allowed);
            }
            let before = self.drawn.as_ref().map(|drawn| drawn.counts);
            let before = before.unwrap_or_default();
            let steps = record.counts.steps.saturating_sub(before.steps);
            let iterations = record.counts.newton_iterations;
            let iterations = iterations.saturating_sub(before.newton_iterations);
            if steps > 0 && iterations > 0 {
                let each = iterations as f64 / steps as f64;
                text += &format!(", {each:.1} iterations a step");
            }
        }
        if let Some(speed) = self.speed.average.filter(|speed| *speed > 0.0) {
            let left = (self.duration - simulated) / speed;
            text += &format!(", {speed:.2} × real time, {} left", time(left));
        }
        text
    }

    /// Makes room for other lines.
    pub(super) fn clear(&self) {
        if let Teller::Line(bar) = &self.teller {
            bar.disable_steady_tick();
            bar.finish_and_clear();
        }
    }

    /// The run is over, at a simulated time in s.
    pub(super) fn end(&self, status: &str, simulated: f64) {
        if self.is_json() {
            self.say(&Event::End {
                status,
                time: simulated,
                elapsed: self.elapsed(),
            });
        }
    }

    /// Whether enough time has passed since this was true last.
    fn is_due(&mut self) -> bool {
        let is_due = self.last_drawn.elapsed() >= REDRAW;
        if is_due {
            self.last_drawn = Instant::now();
        }
        is_due
    }

    /// Since the command began, in s.
    fn elapsed(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// If standard error is closed, nobody listens.
    fn say(&self, event: &Event<'_>) {
        let line = serde_json::to_string(event).expect("events have a JSON form");
        let _ = writeln!(std::io::stderr(), "{line}");
    }
}

/// Parts of the duration that the bar tells apart.
const PARTS: u64 = 10_000;

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("a template that is correct")
}
