//! What becomes of a scene at any step size and stiffness.

use super::run::{Case, Clock};
use super::{Options, Progress, StudyError};
use crate::drawing::{Area, Drawn, picture};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;
use springs_assembly::{Energy, compile};
use springs_scene::{Method, Scene, StepControl, printable};
use springs_solver::Interrupt;
use springs_step::{Cause, Outcome, SetupError};
use std::fmt::Write as _;
use std::ops::ControlFlow;

/// How a run with one step size and stiffness ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// The method lost more than a tenth of the energy that was turned over.
    Damped,
    /// It kept the energy to a tenth.
    Kept,
    /// It added more than a tenth.
    Gained,
    /// A step could not be made, or numbers stopped being finite.
    Failed,
}

/// One run of a stability map.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct StabilityTrial {
    /// Method, in kebab-case.
    pub method: String,
    /// Step size, in s.
    pub step: f64,
    /// What all stiffnesses were multiplied with.
    pub stiffness_factor: f64,
    /// How it ended.
    pub fate: Fate,
}

/// The fate of a scene over step size and stiffness, for each method.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct StabilityMap {
    /// Name of the scene.
    pub scene: String,
    /// All runs.
    pub trials: Vec<StabilityTrial>,
    /// Methods that cannot move the scene, and why.
    pub refused: Vec<(String, String)>,
    /// Whether it was stopped before its end.
    pub interrupted: bool,
}

/// Steps of the coarsest run, and how often they are doubled.
const FEWEST_STEPS: f64 = 8.0;
const HALVINGS: i32 = 11;
/// Powers of ten of the stiffness.
const DECADES: std::ops::RangeInclusive<i32> = -2..=6;
/// Part of the energy turned over that counts as a loss or gain.
const NOTABLE: f64 = 0.1;

/// Runs the scene with every method in steps of the duration over 8, 16, … and
/// with its stiffnesses times 1e-2 … 1e6; `watch` sees the progress and may stop
/// it. Coarse steps come first, so that a short budget still shows all methods.
///
/// # Errors
///
/// If no method can move the scene, or no run was finished.
pub fn stability(
    scene: &Scene,
    options: &Options,
    watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<StabilityMap, StudyError> {
    let duration = scene.settings.duration;
    if duration <= 0.0 {
        return Err(StudyError::NoDuration(duration));
    }
    compile(scene).map_err(SetupError::from)?;
    let case = Case {
        scene: scene.clone(),
        options: options.run,
    };
    let mut clock = Clock::new(options.budget, watch);
    let mut map = StabilityMap {
        scene: scene.name.clone(),
        trials: Vec::new(),
        refused: Vec::new(),
        interrupted: false,
    };
    let mut methods = Vec::new();
    for &method in &options.methods {
        match case.with(method, StepControl::Fixed(duration)).simulation() {
            Ok(_) => methods.push(method),
            Err(error) => map.refused.push((method.to_string(), error.to_string())),
        }
    }
    if methods.is_empty() {
        return Err(StudyError::AllRefused(map.refused));
    }
    fill(&case, &methods, &mut map, &mut clock)?;
    match (map.trials.is_empty(), map.interrupted) {
        (false, _) => Ok(map),
        (true, true) => Err(StudyError::Stopped),
        (true, false) => Err(StudyError::NoRun),
    }
}

/// Makes the runs until the budget is used up or the user stops them.
fn fill(
    case: &Case,
    methods: &[Method],
    map: &mut StabilityMap,
    clock: &mut Clock<'_>,
) -> Result<(), StudyError> {
    for halving in 0..HALVINGS {
        let step = case.scene.settings.duration / (FEWEST_STEPS * 2f64.powi(halving));
        for &method in methods {
            let what = format!("{method} in steps of {step:.1e} s");
            let case = case.with(method, StepControl::Fixed(step));
            for stiffness_factor in DECADES.map(|decade| 10f64.powi(decade)) {
                if clock.tell(&what).is_break() {
                    map.interrupted = true;
                    return Ok(());
                }
                if clock.fraction() > 1.0 {
                    return Ok(());
                }
                let mut case = case.clone();
                case.scene.scale_stiffness(stiffness_factor);
                let supervised = clock.supervise(1.0, |interrupt| fate(&case, interrupt))?;
                map.interrupted |= supervised.is_interrupted;
                let Some(fate) = supervised.result else {
                    return Ok(());
                };
                map.trials.push(StabilityTrial {
                    method: method.to_string(),
                    step,
                    stiffness_factor,
                    fate,
                });
            }
        }
    }
    Ok(())
}

/// `None` if it was stopped.
fn fate(case: &Case, interrupt: &Interrupt) -> Option<Fate> {
    let mut simulation = match case.simulation() {
        Ok(simulation) => simulation,
        Err(_) => return Some(Fate::Failed),
    };
    simulation.set_interrupt(interrupt);
    match simulation.run(1, &mut ()) {
        Ok(Outcome::Finished) => {}
        Ok(Outcome::Stopped) => return None,
        Err(error) => {
            return Some(match error.cause {
                Cause::EnergyDiverged | Cause::EnergyOverflow => Fate::Gained,
                _ => Fate::Failed,
            });
        }
    }
    let (ledger, end) = (simulation.ledger(), simulation.energy());
    let gain = ledger.method_gain(&end);
    let turned_over = moving(&ledger.start)
        .max(moving(&end))
        .max((end.gravity() - ledger.start.gravity()).abs())
        .max(ledger.heat.sum())
        .max(ledger.anchor_work.abs());
    Some(match gain / turned_over {
        part if part.is_nan() && turned_over == 0.0 => Fate::Kept,
        part if part < -NOTABLE => Fate::Damped,
        part if part <= NOTABLE => Fate::Kept,
        part if part.is_finite() => Fate::Gained,
        _ => Fate::Failed,
    })
}

fn moving(energy: &Energy) -> f64 {
    energy.kinetic + energy.elastic()
}

/// `method,step,stiffness_factor,fate`, a row per run.
pub fn stability_csv(map: &StabilityMap) -> String {
    let mut text = String::from("method,step,stiffness_factor,fate\n");
    for trial in &map.trials {
        writeln!(
            text,
            "{},{:?},{:?},{}",
            trial.method,
            trial.step,
            trial.stiffness_factor,
            trial.fate.word()
        )
        .expect("writing to a string");
    }
    text
}

impl Fate {
    const ALL: [Self; 4] = [Self::Damped, Self::Kept, Self::Gained, Self::Failed];

    fn word(self) -> &'static str {
        match self {
            Self::Damped => "damped",
            Self::Kept => "kept",
            Self::Gained => "gained",
            Self::Failed => "failed",
        }
    }

    fn meaning(self) -> &'static str {
        match self {
            Self::Damped => "energy damped by more than a tenth",
            Self::Kept => "energy kept to a tenth",
            Self::Gained => "energy gained: unstable",
            Self::Failed => "failed",
        }
    }

    /// From light to dark, so that print tells them apart.
    fn colour(self) -> RGBColor {
        match self {
            Self::Kept => RGBColor(222, 240, 232),
            Self::Damped => RGBColor(144, 196, 232),
            Self::Gained => RGBColor(213, 94, 0),
            Self::Failed => RGBColor(20, 20, 20),
        }
    }
}

const PANEL: (u32, u32) = (240, 216);
const COLUMNS: usize = 4;
const CAPTION: u32 = 30;
/// Space around a map within its panel: left, top, right, bottom.
const MARGINS: (i32, i32, i32, i32) = (54, 24, 8, 42);
/// Distance of the lines of the legend, and how many there are.
const LINE: i32 = 18;
const LINES: i32 = 5;
const NOTES: [&str; 2] = [
    "Stiffnesses are those of the scene times the number at the left.",
    "Beyond its stable step a method gains energy, and with more steps numbers overflow: it failed.",
];

/// Draws a map per method, step size to the right and stiffness upwards, as SVG.
/// Empty if there is nothing to draw.
pub fn stability_diagram(map: &StabilityMap) -> String {
    let mut methods: Vec<&str> = Vec::new();
    for trial in &map.trials {
        if !methods.contains(&trial.method.as_str()) {
            methods.push(&trial.method);
        }
    }
    if methods.is_empty() {
        return String::new();
    }
    let columns = COLUMNS.min(methods.len());
    let rows = methods.len().div_ceil(columns) as u32;
    let legend = (LINE * LINES + 16) as u32;
    let size = (
        (PANEL.0 * columns as u32).max(3 * PANEL.0),
        CAPTION + PANEL.1 * rows + legend,
    );
    let top = (size.1 - legend) as i32;
    picture(size, |root| draw(map, &methods, columns, top, root))
}

fn draw(
    map: &StabilityMap,
    methods: &[&str],
    columns: usize,
    legend: i32,
    root: &Area<'_>,
) -> Drawn {
    let title = match map.scene.as_str() {
        "" => "stability over step and stiffness".to_owned(),
        name => format!("{}: stability over step and stiffness", printable(name)),
    };
    root.draw(&Text::new(title, (12, 8), ("sans-serif", 16)))?;
    for (index, method) in methods.iter().enumerate() {
        let corner = (
            (index % columns) as i32 * PANEL.0 as i32,
            CAPTION as i32 + (index / columns) as i32 * PANEL.1 as i32,
        );
        panel(map, method, corner, root)?;
    }
    let fates = Fate::ALL.map(|fate| (fate.colour(), fate.meaning()));
    let not_run = [(WHITE, "not run within the budget")];
    for (index, (colour, meaning)) in fates.into_iter().chain(not_run).enumerate() {
        let index = index as i32;
        let at = (12 + (index % 2) * 280, legend + 8 + (index / 2) * LINE);
        swatch(root, at, colour)?;
        root.draw(&Text::new(meaning, (at.0 + 18, at.1), ("sans-serif", 12)))?;
    }
    for (line, note) in NOTES.into_iter().enumerate() {
        let at = (12, legend + 10 + (3 + line as i32) * LINE);
        root.draw(&Text::new(note, at, ("sans-serif", 12)))?;
    }
    Ok(())
}

fn swatch(root: &Area<'_>, (x, y): (i32, i32), colour: RGBColor) -> Drawn {
    let corners = [(x, y), (x + 12, y + 12)];
    root.draw(&Rectangle::new(corners, colour.filled()))?;
    root.draw(&Rectangle::new(corners, BLACK.stroke_width(1)))
}

fn panel(map: &StabilityMap, method: &str, (left, top): (i32, i32), root: &Area<'_>) -> Drawn {
    let (x0, y0) = (left + MARGINS.0, top + MARGINS.1);
    let width = PANEL.0 as i32 - MARGINS.0 - MARGINS.2;
    let height = PANEL.1 as i32 - MARGINS.1 - MARGINS.3;
    let aligned = |across, along| {
        let style = TextStyle::from(("sans-serif", 11).into_font());
        style.pos(Pos::new(across, along))
    };
    let (below, beside) = (
        aligned(HPos::Center, VPos::Top),
        aligned(HPos::Right, VPos::Center),
    );
    root.draw(&Text::new(
        method.to_owned(),
        (x0, top + 6),
        ("sans-serif", 12),
    ))?;
    let mut steps: Vec<f64> = map.trials.iter().map(|trial| trial.step).collect();
    steps.sort_by(f64::total_cmp);
    steps.dedup();
    let rows = DECADES.count() as i32;
    let n_columns = steps.len() as i32;
    let x = |column: i32| x0 + column * width / n_columns;
    let y = |row: i32| y0 + height - row * height / rows;
    for trial in map.trials.iter().filter(|trial| trial.method == method) {
        let row = trial.stiffness_factor.log10().round() as i32 - DECADES.start();
        let column = steps.iter().position(|step| *step == trial.step);
        let column = column.unwrap_or(0) as i32;
        let corners = [(x(column), y(row + 1)), (x(column + 1), y(row))];
        root.draw(&Rectangle::new(corners, trial.fate.colour().filled()))?;
    }
    let frame = [(x0, y0), (x0 + width, y0 + height)];
    root.draw(&Rectangle::new(frame, BLACK.stroke_width(1)))?;
    for decade in DECADES.step_by(2) {
        let row = decade - DECADES.start();
        let at = (x0 - 5, (y(row) + y(row + 1)) / 2);
        root.draw(&Text::new(format!("× 1e{decade}"), at, beside.clone()))?;
    }
    // Labels are as wide as two columns and a half, so every third one has one.
    for (column, step) in (0..).zip(&steps).step_by(3) {
        let middle = (x(column) + x(column + 1)) / 2;
        let tick = vec![(middle, y0 + height), (middle, y0 + height + 4)];
        root.draw(&PathElement::new(tick, BLACK.stroke_width(1)))?;
        let at = (middle, y0 + height + 6);
        root.draw(&Text::new(format!("{step:.0e}"), at, below.clone()))?;
    }
    let at = (x0 + width / 2, y0 + height + 21);
    root.draw(&Text::new("step (s)", at, below))
}
