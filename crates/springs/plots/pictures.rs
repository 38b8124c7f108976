//! What is drawn of each table.

use super::chart::{Chart, Scale, Series, Shape};
use springs_io::{ENERGY_COLUMNS, TableError, TableRows, read_energies};
use std::path::Path;

/// Of `energy.csv`: energies, and what flowed.
pub(super) fn energies(path: &Path) -> Result<Vec<Chart>, TableError> {
    let rows = read_energies(path)?;
    let (mut energies, mut flows) = (Vec::new(), Vec::new());
    for (index, column) in ENERGY_COLUMNS.iter().enumerate() {
        let points = rows.iter().map(|row| (row.time, row.numbers()[index]));
        let series = Series {
            points: points.collect(),
            ..Series::new(column.label)
        };
        if column.is_flow {
            flows.push(series);
        } else {
            energies.push(series);
        }
    }
    // What there is nothing of is left out.
    flows.retain(|one| one.points.iter().any(|(_, value)| *value != 0.0));
    Ok(vec![
        Chart::over_time("energy (J)", Scale::Linear, energies),
        Chart::over_time("since the start (J)", Scale::Linear, flows),
    ])
}

/// Of `steps.csv`: step sizes, errors, and iterations.
pub(super) fn steps(path: &Path) -> Result<Vec<Chart>, TableError> {
    const COLUMNS: [&str; 8] = [
        "time",
        "step_size",
        "error",
        "allowed_error",
        "steps",
        "newton_iterations",
        "solver_iterations",
        "rejected_steps",
    ];
    let [mut sizes, mut error, mut allowed] =
        ["step size", "estimated error", "allowed error"].map(Series::new);
    let mut each = [
        "Newton iterations",
        "iterations of conjugate gradients",
        "rejected steps",
    ]
    .map(Series::new);
    let mut before = [0.0; 4];
    let mut rows = TableRows::open(path, COLUMNS)?;
    while let Some(row) = rows.next()? {
        let time = row.number_or_nan(0)?;
        sizes.points.push((time, row.number_or_nan(1)?));
        error.points.push((time, row.number_or_nan(2)?));
        allowed.points.push((time, row.number_or_nan(3)?));
        let mut counts = [0.0; 4];
        for (count, cell) in counts.iter_mut().zip(4..) {
            *count = row.number_or_nan(cell)?;
        }
        let steps: f64 = counts[0] - before[0];
        for (series, (count, before)) in each.iter_mut().zip(counts.iter().zip(&before).skip(1)) {
            series
                .points
                .push((time, (count - before) / steps.max(1.0)));
        }
        before = counts;
    }
    let mut each = each.to_vec();
    each.retain(|one| one.points.iter().any(|(_, value)| *value != 0.0));
    Ok(vec![
        Chart::over_time("step size (s)", Scale::Logarithmic, vec![sizes]),
        Chart::over_time(
            "error of a step (m)",
            Scale::Logarithmic,
            vec![error, allowed],
        ),
        Chart::over_time("number a step", Scale::Linear, each),
    ])
}

/// Of `peaks.csv`: a bar for each spring, from its least to its largest tension.
pub(super) fn peaks(path: &Path) -> Result<Vec<Chart>, TableError> {
    const COLUMNS: [&str; 3] = ["spring", "max_tension", "min_tension"];
    let [mut most, mut least] = ["largest", "least"].map(Series::new);
    let mut rows = TableRows::open(path, COLUMNS)?;
    while let Some(row) = rows.next()? {
        let spring = row.number_or_nan(0)?;
        most.points.push((spring, row.number_or_nan(1)?));
        least.points.push((spring, row.number_or_nan(2)?));
    }
    Ok(vec![Chart {
        along: "spring",
        shape: Shape::Dots,
        ..Chart::over_time("tension (N)", Scale::Linear, vec![most, least])
    }])
}

/// What probes tell together: quantities of one unit share a chart.
const UNITS: [(&str, &[&str]); 6] = [
    ("position (m)", &["x", "y", "z"]),
    ("velocity (m/s)", &["vx", "vy", "vz"]),
    ("length (m)", &["length"]),
    ("strain", &["strain"]),
    ("tension (N)", &["tension"]),
    ("energy (J)", &["energy"]),
];

/// Of `probes.csv`: a line for each number that a probe tells.
pub(super) fn probes(path: &Path) -> Result<Vec<Chart>, TableError> {
    const COLUMNS: [&str; 5] = ["time", "item", "index", "quantity", "value"];
    let mut charts: Vec<Chart> = Vec::new();
    let mut rows = TableRows::open(path, COLUMNS)?;
    while let Some(row) = rows.next()? {
        let [_, item, index, quantity, _] = row.cells;
        let known = UNITS.iter().find(|(_, names)| names.contains(&quantity));
        // What later programs tell has its name.
        let label = known.map_or(quantity, |(label, _)| label);
        let chart = match charts.iter().position(|chart| chart.label == label) {
            Some(found) => &mut charts[found],
            None => {
                charts.push(Chart::over_time(label, Scale::Linear, Vec::new()));
                charts.last_mut().expect("one that was added")
            }
        };
        let is_only_one = known.is_some_and(|(_, names)| names.len() == 1);
        let name = if is_only_one {
            format!("{item} {index}")
        } else {
            format!("{item} {index}, {quantity}")
        };
        let point = (row.number_or_nan(0)?, row.number_or_nan(4)?);
        match chart.series.iter_mut().find(|series| series.name == name) {
            Some(series) => series.points.push(point),
            None => chart.series.push(Series {
                points: vec![point],
                ..Series::new(&name)
            }),
        }
    }
    Ok(charts)
}
