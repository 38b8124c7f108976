//! Charts one below the other, with curves over a common axis.

use crate::drawing::{Area, COLOURS, Drawn, FINE, fine};
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// A chart of several curves.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    /// What is upwards, with its unit.
    pub(super) label: String,
    /// What is to the right, with its unit.
    pub(super) along: &'static str,
    pub(super) scale: Scale,
    pub(super) shape: Shape,
    pub(super) series: Vec<Series>,
}

/// How values become heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    /// Of positive values; others are left out.
    Logarithmic,
}

/// How values are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Lines,
    Dots,
}

/// A curve.
#[derive(Clone, Debug)]
pub(super) struct Series {
    pub(super) name: String,
    pub(super) points: Vec<(f64, f64)>,
}

impl Series {
    pub(super) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            points: Vec::new(),
        }
    }
}

impl Chart {
    /// Of curves over time.
    pub(super) fn over_time(label: &str, scale: Scale, series: Vec<Series>) -> Self {
        Self {
            label: label.to_owned(),
            along: "time (s)",
            scale,
            shape: Shape::Lines,
            series,
        }
    }

    /// The same with what can be drawn: points with numbers, as many as can be told apart.
    fn drawable(&self) -> Self {
        let can_be_drawn = |(x, y): &(f64, f64)| {
            x.is_finite() && y.is_finite() && (self.scale == Scale::Linear || *y > 0.0)
        };
        let series = self.series.iter().map(|series| {
            let points = series.points.iter().copied().filter(can_be_drawn);
            Series {
                name: series.name.clone(),
                points: thinned(points.collect()),
            }
        });
        Self {
            series: series.filter(|series| !series.points.is_empty()).collect(),
            ..self.clone()
        }
    }

    fn range(&self, of: fn(&(f64, f64)) -> f64) -> Option<Range<f64>> {
        let points = self.series.iter().flat_map(|series| &series.points);
        let one = points.map(|point| of(point)..of(point));
        one.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
    }
}

/// Parts of the axis that are told apart.
const PARTS: usize = 900;

/// Points in order of the axis, with no more than the first, the least, the largest and the last of
/// each part of it: what a picture of all of them would show.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= 4 * PARTS {
        return points;
    }
    let length = points.len().div_ceil(PARTS);
    let of_part = |part: &[(f64, f64)]| {
        let by_height = |a: &usize, b: &usize| part[*a].1.total_cmp(&part[*b].1);
        let least = (0..part.len()).min_by(by_height).unwrap_or(0);
        let largest = (0..part.len()).max_by(by_height).unwrap_or(0);
        let mut kept = vec![0, least, largest, part.len() - 1];
        kept.sort_unstable();
        kept.dedup();
        kept.into_iter()
            .map(|index| part[index])
            .collect::<Vec<_>>()
    };
    points.chunks(length).flat_map(of_part).collect()
}

/// In pixels.
const WIDTH: u32 = 900;
const HEIGHT: u32 = 230;
const TITLE: u32 = 36;
const LEGEND: u32 = 210;
/// Curves that are named beside a chart.
const MOST_NAMED: usize = 9;

/// Draws charts, one below the other; those without curves are left out.
pub(super) fn draw(title: &str, charts: &[Chart]) -> String {
    let charts = charts.iter().map(Chart::drawable);
    let charts: Vec<Chart> = charts.filter(|chart| !chart.series.is_empty()).collect();
    let size = (WIDTH, TITLE + HEIGHT * charts.len().max(1) as u32);
    fine(size, |root| {
        let (top, rest) = root.split_vertically(TITLE * FINE);
        let place = (units(12), units(TITLE as i32 / 2 + 2));
        top.draw(&Text::new(title.to_owned(), place, words(16, HPos::Left)))?;
        if charts.is_empty() {
            let place = (units(12), units(20));
            let text = "there is nothing in the table to draw";
            return rest.draw(&Text::new(text, place, words(12, HPos::Left)));
        }
        for (area, chart) in rest.split_evenly((charts.len(), 1)).iter().zip(&charts) {
            draw_chart(area, chart)?;
        }
        Ok(())
    })
}

fn units(pixels: i32) -> i32 {
    pixels * FINE as i32
}

/// Text of so many pixels, beside a point.
fn words(size: i32, along: HPos) -> TextStyle<'static> {
    let style = TextStyle::from(("sans-serif", units(size)).into_font());
    style.pos(Pos::new(along, VPos::Center))
}

fn draw_chart(area: &Area<'_>, chart: &Chart) -> Drawn {
    let (left, right) = area.split_horizontally((WIDTH - LEGEND) * FINE);
    let along = chart.range(|point| point.0).unwrap_or(0.0..1.0);
    let up = chart.range(|point| point.1).unwrap_or(0.0..1.0);
    let along = widened(along, 0.0);
    match chart.scale {
        Scale::Linear => draw_curves(&left, chart, along, widened(up, 0.06))?,
        Scale::Logarithmic => {
            let up = up.start / 1.5..up.end * 1.5;
            draw_curves(&left, chart, along, up.log_scale())?;
        }
    }
    for (index, series) in chart.series.iter().take(MOST_NAMED).enumerate() {
        let y = units(22 + 19 * index as i32);
        let colour = COLOURS[index % COLOURS.len()];
        match chart.shape {
            Shape::Lines => {
                let sample = [(units(4), y), (units(26), y)];
                right.draw(&PathElement::new(sample, colour.stroke_width(2 * FINE)))?;
            }
            Shape::Dots => {
                right.draw(&Circle::new((units(15), y), units(3), colour.filled()))?;
            }
        }
        let place = (units(32), y);
        right.draw(&Text::new(
            series.name.clone(),
            place,
            words(12, HPos::Left),
        ))?;
    }
    let others = chart.series.len().saturating_sub(MOST_NAMED);
    if others > 0 {
        let place = (units(32), units(22 + 19 * MOST_NAMED as i32));
        let text = format!("and {others} more");
        right.draw(&Text::new(text, place, words(12, HPos::Left)))?;
    }
    Ok(())
}

/// A range with room at both ends, as a part of it; never empty.
fn widened(range: Range<f64>, part: f64) -> Range<f64> {
    let size = range.end - range.start;
    if size > 0.0 {
        return range.start - part * size..range.end + part * size;
    }
    let size = range.start.abs().max(1.0);
    range.start - 0.5 * size..range.end + 0.5 * size
}

fn draw_curves<Y>(area: &Area<'_>, chart: &Chart, along: Range<f64>, up: Y) -> Drawn
where
    Y: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut context = ChartBuilder::on(area)
        .margin(units(8))
        .x_label_area_size(units(36))
        .y_label_area_size(units(64))
        .build_cartesian_2d(along, up)?;
    let label = |value: &f64| number(*value);
    context
        .configure_mesh()
        .x_desc(chart.along)
        .y_desc(chart.label.as_str())
        .axis_desc_style(("sans-serif", units(14)))
        .label_style(("sans-serif", units(12)))
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .y_labels(6)
        .max_light_lines(0)
        .set_all_tick_mark_size(units(4))
        .axis_style(RGBColor(120, 120, 120).stroke_width(FINE))
        .bold_line_style(RGBColor(225, 225, 225).stroke_width(FINE))
        .draw()?;
    // The first curves lie on top.
    for (index, series) in chart.series.iter().enumerate().rev() {
        let colour = COLOURS[index % COLOURS.len()];
        let points = series.points.iter().copied();
        match chart.shape {
            Shape::Lines => {
                let style = colour.stroke_width(FINE + FINE / 2);
                context.draw_series([PathElement::new(points.collect::<Vec<_>>(), style)])?;
            }
            Shape::Dots => {
                let dot = |at| Circle::new(at, units(2), colour.filled());
                context.draw_series(points.map(dot))?;
            }
        }
    }
    Ok(())
}

/// As few digits as tell labels apart.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        1e-3..1e5 => {
            let text = format!("{value:.6}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => {
            let text = format!("{value:.2e}");
            let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
            let digits = digits.trim_end_matches('0').trim_end_matches('.');
            format!("{digits}e{power}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_what_stands_out() {
        let mut points: Vec<_> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[31_415].1 = 5.0;
        points[92_653].1 = -7.0;
        let thin = thinned(points.clone());
        assert!(thin.len() <= 4 * PARTS, "{}", thin.len());
        assert!(thin.contains(&points[31_415]) && thin.contains(&points[92_653]));
        assert!(thin.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!((thin[0], thin[thin.len() - 1]), (points[0], points[99_999]));
        assert_eq!(thinned(points[..100].to_vec()), points[..100]);
    }

    #[test]
    fn labels_are_short() {
        let texts = [0.0, 0.5, -1200.0, 2.5e-7, 3e9].map(number);
        assert_eq!(texts, ["0", "0.5", "-1200", "2.5e-7", "3e9"]);
    }
}
