//! What becomes of a scene at any step size and stiffness.

use super::reference::Guard;
use super::{Clock, Options, Progress, StudyError};
use plotters::prelude::*;
use serde::Serialize;
use springs_assembly::Energy;
use springs_scene::{Method, Scene, StepControl};
use springs_step::{Outcome, SetupError, Simulation};
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::Instant;

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
/// If no method can move the scene.
pub fn stability(
    scene: &Scene,
    options: &Options,
    watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<StabilityMap, StudyError> {
    let mut clock = Clock {
        begin: Instant::now(),
        budget: options.budget,
        watch,
    };
    let mut map = StabilityMap {
        scene: scene.name.clone(),
        trials: Vec::new(),
        refused: Vec::new(),
        interrupted: false,
    };
    let mut methods = Vec::new();
    let mut refusal = None;
    for &method in &options.methods {
        let mut scene = scene.clone();
        scene.settings.method = method;
        scene.settings.tangent = None;
        scene.settings.step = StepControl::Fixed(scene.settings.duration);
        match Simulation::new(&scene) {
            Ok(_) => methods.push(method),
            Err(error) => {
                map.refused.push((method.to_string(), error.to_string()));
                refusal = Some(error);
            }
        }
    }
    if let (true, Some(error)) = (methods.is_empty(), refusal) {
        return Err(error.into());
    }
    for halving in 0..HALVINGS {
        let step = scene.settings.duration / (FEWEST_STEPS * 2f64.powi(halving));
        for &method in &methods {
            let what = format!("{method} in steps of {step:.1e} s");
            for stiffness_factor in DECADES.map(|decade| 10f64.powi(decade)) {
                if clock.tell(&what).is_break() {
                    map.interrupted = true;
                    return Ok(map);
                }
                if clock.fraction() > 1.0 {
                    return Ok(map);
                }
                let Some(fate) = fate(scene, method, step, stiffness_factor, &mut clock)? else {
                    map.interrupted |= clock.fraction() <= 1.0;
                    return Ok(map);
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
    Ok(map)
}

/// `None` if it was stopped.
fn fate(
    scene: &Scene,
    method: Method,
    step: f64,
    stiffness_factor: f64,
    clock: &mut Clock<'_>,
) -> Result<Option<Fate>, SetupError> {
    let mut scene = scene.clone();
    scene.settings.method = method;
    scene.settings.tangent = None;
    scene.settings.step = StepControl::Fixed(step);
    for spring in &mut scene.springs {
        spring.stiffness *= stiffness_factor;
    }
    let mut simulation = Simulation::new(&scene)?;
    let mut guard = Guard {
        clock,
        share: 1.0,
        countdown: 0,
        stopped: false,
    };
    match simulation.run(1, &mut guard) {
        Ok(Outcome::Finished) => {}
        Ok(Outcome::Stopped) => return Ok(None),
        Err(_) => return Ok(Some(Fate::Failed)),
    }
    let (ledger, end) = (simulation.ledger(), simulation.energy());
    let gain = ledger.method_gain(&end);
    let turned_over = moving(&ledger.start)
        .max(moving(&end))
        .max((end.gravity - ledger.start.gravity).abs())
        .max(ledger.dashpot_heat)
        .max(ledger.anchor_work.abs());
    Ok(Some(match gain / turned_over {
        part if part.is_nan() && turned_over == 0.0 => Fate::Kept,
        part if part < -NOTABLE => Fate::Damped,
        part if part <= NOTABLE => Fate::Kept,
        part if part.is_finite() => Fate::Gained,
        _ => Fate::Failed,
    }))
}

fn moving(energy: &Energy) -> f64 {
    energy.kinetic + energy.elastic
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

const PANEL: (u32, u32) = (240, 210);
const COLUMNS: usize = 4;
const LEGEND: u32 = 46;
const CAPTION: u32 = 30;
/// Space around a map within its panel: left, top, right, bottom.
const MARGINS: (i32, i32, i32, i32) = (48, 24, 8, 40);

/// Draws a map per method, step size to the right and stiffness upwards, as SVG.
/// Empty if there is nothing to draw.
pub fn stability_diagram(map: &StabilityMap) -> String {
    let mut svg = String::new();
    let mut methods: Vec<&str> = Vec::new();
    for trial in &map.trials {
        if !methods.contains(&trial.method.as_str()) {
            methods.push(&trial.method);
        }
    }
    if methods.is_empty() {
        return svg;
    }
    let columns = COLUMNS.min(methods.len());
    let rows = methods.len().div_ceil(columns) as u32;
    let size = (
        (PANEL.0 * columns as u32).max(3 * PANEL.0),
        CAPTION + PANEL.1 * rows + LEGEND,
    );
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(map, &methods, columns, size, &root).expect("drawing into memory");
        root.present().expect("drawing into memory");
    }
    svg
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type DrawResult = Result<(), DrawingAreaErrorKind<std::io::Error>>;

fn draw(
    map: &StabilityMap,
    methods: &[&str],
    columns: usize,
    size: (u32, u32),
    root: &Area<'_>,
) -> DrawResult {
    root.fill(&WHITE)?;
    let title = match map.scene.as_str() {
        "" => "stability over step and stiffness".to_owned(),
        name => format!("{name}: stability over step and stiffness"),
    };
    root.draw(&Text::new(title, (12, 8), ("sans-serif", 16)))?;
    for (index, method) in methods.iter().enumerate() {
        let corner = (
            (index % columns) as i32 * PANEL.0 as i32,
            CAPTION as i32 + (index / columns) as i32 * PANEL.1 as i32,
        );
        panel(map, method, corner, root)?;
    }
    let y = (size.1 - LEGEND) as i32 + 8;
    for (index, fate) in Fate::ALL.into_iter().enumerate() {
        let at = (12 + (index as i32 % 2) * 230, y + (index as i32 / 2) * 18);
        swatch(root, at, fate.colour())?;
        let text = (at.0 + 18, at.1);
        root.draw(&Text::new(fate.meaning(), text, ("sans-serif", 12)))?;
    }
    let text = (12 + 2 * 230, y);
    let not_run = "white: not run within the budget";
    root.draw(&Text::new(not_run, text, ("sans-serif", 12)))
}

fn swatch(root: &Area<'_>, (x, y): (i32, i32), colour: RGBColor) -> DrawResult {
    let corners = [(x, y), (x + 12, y + 12)];
    root.draw(&Rectangle::new(corners, colour.filled()))?;
    root.draw(&Rectangle::new(corners, BLACK.stroke_width(1)))
}

fn panel(map: &StabilityMap, method: &str, (left, top): (i32, i32), root: &Area<'_>) -> DrawResult {
    let (x0, y0) = (left + MARGINS.0, top + MARGINS.1);
    let width = PANEL.0 as i32 - MARGINS.0 - MARGINS.2;
    let height = PANEL.1 as i32 - MARGINS.1 - MARGINS.3;
    let small = ("sans-serif", 10);
    root.draw(&Text::new(
        method.to_owned(),
        (x0, top + 6),
        ("sans-serif", 12),
    ))?;
    let mut steps: Vec<f64> = map.trials.iter().map(|trial| trial.step).collect();
    steps.sort_by(f64::total_cmp);
    steps.dedup();
    let rows = DECADES.count() as i32;
    let column = |step: f64| steps.iter().position(|&s| s == step).unwrap_or(0) as i32;
    let x = |column: i32| x0 + column * width / steps.len() as i32;
    let y = |row: i32| y0 + height - row * height / rows;
    for trial in map.trials.iter().filter(|trial| trial.method == method) {
        let row = trial.stiffness_factor.log10().round() as i32 - DECADES.start();
        let column = column(trial.step);
        let corners = [(x(column), y(row + 1)), (x(column + 1), y(row))];
        root.draw(&Rectangle::new(corners, trial.fate.colour().filled()))?;
    }
    let frame = [(x0, y0), (x0 + width, y0 + height)];
    root.draw(&Rectangle::new(frame, BLACK.stroke_width(1)))?;
    for decade in DECADES.step_by(2) {
        let at = (
            left + 8,
            y(decade - DECADES.start()) - height / rows / 2 - 5,
        );
        root.draw(&Text::new(format!("K·1e{decade}"), at, small))?;
    }
    for &step in steps.iter().step_by(steps.len().div_ceil(3)) {
        let at = (x(column(step)), y0 + height + 4);
        root.draw(&Text::new(format!("{step:.0e}"), at, small))?;
    }
    let at = (x0 + width / 2 - 20, y0 + height + 18);
    root.draw(&Text::new("step, s", at, small))
}
