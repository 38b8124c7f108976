//! The work-precision diagram.

use super::order::observed_order;
use super::{Study, Trial};
use crate::drawing::{Area, COLOURS, Drawn, picture};
use crate::inspect::count;
use plotters::prelude::*;
use springs_scene::printable;

const SIZE: (u32, u32) = (900, 560);
const LEGEND: u32 = 260;
const MARK: i32 = 4;

/// Draws run time over error, both logarithmic, a line per method with its
/// observed order, as SVG. Errors below the uncertainty of the reference are
/// shaded, worthless results left out. Empty if there is nothing to draw.
pub fn diagram(study: &Study) -> String {
    let curves = curves(study);
    if curves.is_empty() {
        return String::new();
    }
    picture(SIZE, |root| draw(study, &curves, root))
}

/// The runs of one method, largest error first.
struct Curve<'a> {
    method: &'a str,
    trials: Vec<&'a Trial>,
}

fn curves(study: &Study) -> Vec<Curve<'_>> {
    let mut curves: Vec<Curve<'_>> = Vec::new();
    for trial in study.trials.iter().filter(|trial| !trial.worthless) {
        match curves.iter_mut().find(|curve| curve.method == trial.method) {
            Some(curve) => curve.trials.push(trial),
            None => curves.push(Curve {
                method: &trial.method,
                trials: vec![trial],
            }),
        }
    }
    curves
}

fn draw(study: &Study, curves: &[Curve<'_>], root: &Area<'_>) -> Drawn {
    let (left, right) = root.split_horizontally(SIZE.0 - LEGEND);
    let all = || curves.iter().flat_map(|curve| &curve.trials);
    let range = |value: fn(&Trial) -> f64| {
        let values = all().map(|trial| value(trial).max(1e-300));
        let (low, high) = values.fold((f64::INFINITY, 0f64), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        low / 2.0..high * 2.0
    };
    let (errors, seconds) = (range(|trial| trial.error), range(|trial| trial.seconds));
    let title = match study.scene.as_str() {
        "" => "run time against error".to_owned(),
        name => format!("{}: run time against error", printable(name)),
    };
    let mut chart = ChartBuilder::on(&left)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(46)
        .y_label_area_size(58)
        .build_cartesian_2d(errors.clone().log_scale(), seconds.clone().log_scale())?;
    let decades = |value: &f64| format!("{value:.0e}");
    chart
        .configure_mesh()
        .x_desc(format!("error after {} s (m)", study.duration))
        .y_desc("run time (s)")
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 12))
        .max_light_lines(1)
        .x_label_formatter(&decades)
        .y_label_formatter(&decades)
        .light_line_style(RGBColor(240, 240, 240))
        .bold_line_style(RGBColor(215, 215, 215))
        .draw()?;
    let floor = study.reference.uncertainty;
    let is_shaded = floor > errors.start;
    if is_shaded {
        let corners = [(errors.start, seconds.start), (floor, seconds.end)];
        let shade = RGBColor(200, 200, 200).mix(0.5).filled();
        chart.draw_series([Rectangle::new(corners, shade)])?;
    }
    for (index, curve) in curves.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let points = || {
            curve
                .trials
                .iter()
                .map(|trial| (trial.error, trial.seconds))
        };
        chart.draw_series(LineSeries::new(points(), colour.stroke_width(2)))?;
        // The shape of the markers, too, tells the method.
        match index % 3 {
            0 => {
                let dot = |at| Circle::new(at, MARK, colour.filled());
                chart.draw_series(points().map(dot))?
            }
            1 => {
                let triangle = |at| TriangleMarker::new(at, MARK + 1, colour.filled());
                chart.draw_series(points().map(triangle))?
            }
            _ => {
                let cross = |at| Cross::new(at, MARK, colour.stroke_width(2));
                chart.draw_series(points().map(cross))?
            }
        };
    }
    for (index, curve) in curves.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let y = 60 + 24 * index as i32;
        right.draw(&PathElement::new(
            vec![(8, y), (36, y)],
            colour.stroke_width(2),
        ))?;
        match index % 3 {
            0 => right.draw(&Circle::new((22, y), MARK, colour.filled()))?,
            1 => right.draw(&TriangleMarker::new((22, y), MARK + 1, colour.filled()))?,
            _ => right.draw(&Cross::new((22, y), MARK, colour.stroke_width(2)))?,
        }
        let order = match observed_order(&curve.trials) {
            Some(order) => format!(", order {order:.1}"),
            None => String::new(),
        };
        let text = format!("{}{order}", curve.method);
        right.draw(&Text::new(text, (44, y - 7), ("sans-serif", 14)))?;
    }
    let mut notes = Vec::new();
    if is_shaded {
        notes.push(format!("shaded: reference uncertain, {floor:.0e} m"));
    }
    let worthless = study.trials.iter().filter(|trial| trial.worthless).count();
    if worthless > 0 {
        notes.push(format!("not drawn: {} at least", count(worthless, "run")));
        notes.push(format!(
            "{:.1e} m off, a tenth of the motion",
            study.reference.worthless_from
        ));
    }
    let top = 60 + 24 * curves.len() as i32;
    for (line, note) in notes.into_iter().enumerate() {
        let at = (8, top + 16 * line as i32);
        right.draw(&Text::new(note, at, ("sans-serif", 12)))?;
    }
    Ok(())
}
