//! One run, in a thread of its own, stopped by the budget or by the user.

use super::{Progress, StudyError};
use nalgebra::Vector3;
use springs_scene::{Method, RunOptions, Scene, StepControl};
use springs_solver::Interrupt;
use springs_step::{Frame, Islands, Observer, Outcome, SetupError, Simulation, StepError};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two looks at the clock and at what the user wants.
const LOOK: Duration = Duration::from_millis(10);

/// The budget and who watches over it.
pub(super) struct Clock<'a> {
    begin: Instant,
    budget: Duration,
    watch: &'a mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
}

/// What came of some work, and whether the user stopped it.
pub(super) struct Supervised<R> {
    pub(super) result: R,
    pub(super) is_interrupted: bool,
}

impl<'a> Clock<'a> {
    pub(super) fn new(
        budget: Duration,
        watch: &'a mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    ) -> Self {
        Self {
            begin: Instant::now(),
            budget,
            watch,
        }
    }

    /// Part of the budget that is used up.
    pub(super) fn fraction(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() / self.budget.as_secs_f64()
    }

    /// Part of the budget that so many seconds are.
    pub(super) fn part(&self, seconds: f64) -> f64 {
        seconds / self.budget.as_secs_f64()
    }

    pub(super) fn tell(&mut self, what: &str) -> ControlFlow<()> {
        let fraction = self.fraction();
        (self.watch)(Progress { what, fraction })
    }

    /// Does `work` in a fresh thread. It is asked to stop when `share` of the
    /// budget is used up, or when the user says so.
    pub(super) fn supervise<R: Send>(
        &mut self,
        share: f64,
        work: impl FnOnce(&Interrupt) -> R + Send,
    ) -> Result<Supervised<R>, StudyError> {
        let stop = Arc::new(AtomicBool::new(false));
        let interrupt = Interrupt::from(stop.clone());
        let (done, is_done) = channel::<()>();
        let mut is_interrupted = false;
        let result = thread::scope(|scope| {
            let interrupt = &interrupt;
            let worker = thread::Builder::new().spawn_scoped(scope, move || {
                // Dropped at the end, even by a panic.
                let _done = done;
                work(interrupt)
            })?;
            while is_done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                is_interrupted |= self.tell("").is_break();
                if is_interrupted || self.fraction() >= share {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            match worker.join() {
                Ok(result) => Ok(result),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        });
        Ok(Supervised {
            result: result.map_err(StudyError::NoThread)?,
            is_interrupted,
        })
    }
}

/// Intervals of the run at whose ends positions are compared.
pub(super) const FRAMES: usize = 8;

/// A run that reached its end.
pub(super) struct Run {
    /// Positions at the end of each of [`FRAMES`] equal intervals; none of a run
    /// that is only timed.
    pub(super) frames: Vec<Vec<Vector3<f64>>>,
    pub(super) steps: u64,
    /// Compiling and stepping, in s.
    pub(super) seconds: f64,
}

impl Run {
    /// Positions at the end.
    pub(super) fn into_end(mut self) -> Vec<Vector3<f64>> {
        self.frames.pop().unwrap_or_default()
    }
}

/// Why a run did not reach its end.
pub(super) enum NoRun {
    Refused(SetupError),
    Failed(StepError),
    Stopped,
}

/// A scene and how it is run.
#[derive(Clone)]
pub(super) struct Case {
    pub(super) scene: Scene,
    pub(super) options: RunOptions,
}

impl Case {
    /// The same with another method, in its own tangent.
    pub(super) fn with(&self, method: Method, step: StepControl) -> Self {
        let mut case = self.clone();
        let settings = &mut case.scene.settings;
        settings.method = method;
        settings.tangent = None;
        settings.step = step;
        case
    }

    /// It in one part.
    pub(super) fn simulation(&self) -> Result<Simulation, SetupError> {
        Simulation::with_options(&self.scene, &self.options)
    }
}

/// Runs a scene and records where its nodes were.
pub(super) fn recorded(case: &Case, interrupt: &Interrupt) -> Result<Run, NoRun> {
    simulate(case, FRAMES, interrupt)
}

/// Runs a scene without looking at it.
pub(super) fn timed(case: &Case, interrupt: &Interrupt) -> Result<Run, NoRun> {
    simulate(case, 0, interrupt)
}

/// `intervals` of zero record nothing.
fn simulate(case: &Case, intervals: usize, interrupt: &Interrupt) -> Result<Run, NoRun> {
    let begin = Instant::now();
    let mut islands = Islands::with_options(&case.scene, &case.options).map_err(NoRun::Refused)?;
    islands.set_interrupt(interrupt);
    let mut recorder = Recorder { frames: Vec::new() };
    let outcome = match intervals {
        0 => islands.run(1, &mut ()),
        _ => islands.run(intervals, &mut recorder),
    };
    let seconds = begin.elapsed().as_secs_f64();
    match outcome {
        Ok(Outcome::Finished) => Ok(Run {
            frames: recorder.frames,
            steps: islands.work().counts.steps,
            seconds,
        }),
        Ok(Outcome::Stopped) => Err(NoRun::Stopped),
        Err(error) => Err(NoRun::Failed(error)),
    }
}

struct Recorder {
    frames: Vec<Vec<Vector3<f64>>>,
}

impl Observer for Recorder {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        if frame.index > 0 {
            self.frames.push(frame.nodes.positions.clone());
        }
        ControlFlow::Continue(())
    }
}

/// Short runs are repeated until this much time has passed, in s.
const LEAST: f64 = 5e-3;

/// The least time of a run, in s, in this thread; infinite if it was stopped. Of
/// short runs the first one, which warms up, hardly ever is the least.
pub(super) fn least_seconds(case: &Case, interrupt: &Interrupt) -> f64 {
    let (mut least, mut sum) = (f64::INFINITY, 0.0);
    while sum < LEAST {
        match timed(case, interrupt) {
            Ok(run) => {
                sum += run.seconds;
                least = least.min(run.seconds);
            }
            Err(_) => break,
        }
    }
    least
}

/// Largest distance of a node between two solutions, in m; not a number if one
/// is not.
pub(super) fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let distances = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    // `f64::max` would lose what is not a number.
    distances.fold(0.0, |largest, distance| {
        if distance > largest || distance.is_nan() {
            distance
        } else {
            largest
        }
    })
}
