//! What a run says at its end.

use springs::inspect::count;
use springs::io::Report;
use springs::scene::{Scene, printable};
use std::path::Path;

/// Changes of method that are told.
const MOST_SWITCHES: usize = 5;

/// A few lines for a person.
pub(crate) fn summary(scene: &Scene, report: &Report, folder: &Path, written: &[&str]) -> String {
    let mut lines = Vec::new();
    let name = match scene.name.as_str() {
        "" => String::new(),
        name => format!("{}: ", printable(name)),
    };
    lines.push(format!(
        "{name}{}, {}, {}",
        count(report.nodes, "node"),
        count(report.springs, "spring"),
        count(report.unknowns, "unknown"),
    ));
    let tangent = match &report.tangent {
        Some(tangent) => format!(" with {tangent} tangent"),
        None => String::new(),
    };
    let shortened = match report.shortened_last_step {
        Some(rest) => format!(", the last shortened to {} s", short(rest)),
        None => String::new(),
    };
    let sizes = match (report.step_size, report.tolerance) {
        (Some(step_size), None) => format!(" of {} s{shortened}", short(step_size)),
        (Some(step_size), Some(tolerance)) => format!(
            " of {} s for an error of {} m",
            short(step_size),
            short(tolerance)
        ),
        (None, tolerance) => format!(
            " for an error of {} m, {} rejected",
            short(tolerance.unwrap_or(0.0)),
            report.rejected_steps
        ),
    };
    lines.push(format!(
        "  {} s in {}{sizes}, {}{tangent}",
        short(report.simulated_seconds),
        count(report.steps as usize, "step"),
        report.method,
    ));
    if let Some(reason) = &report.reason {
        lines.push(format!("  chosen because {reason}"));
    }
    if !report.islands.is_empty() {
        lines.push(format!(
            "  in {} that do not feel each other; that is the largest, and the most steps",
            count(report.islands.len(), "part"),
        ));
    }
    for switch in report.switches.iter().take(MOST_SWITCHES) {
        lines.push(format!(
            "  from {} s on with {}, {}",
            short(switch.time),
            switch.method,
            switch.reason
        ));
    }
    let seconds = &report.seconds;
    let parts = [
        ("setup", seconds.setup),
        ("assembly", seconds.assembly),
        ("factorization", seconds.factorization),
        ("solve", seconds.solve),
        ("output", seconds.output),
    ];
    let parts = parts.iter().filter(|(_, seconds)| *seconds > 0.0);
    let parts: Vec<String> = parts
        .map(|(what, s)| format!("{what} {}", time(*s)))
        .collect();
    lines.push(format!(
        "  took {}: {}",
        time(seconds.total),
        parts.join(", ")
    ));
    let energy = &report.energy;
    lines.push(format!(
        "  energy {} → {}  (kinetic {}, springs {}, gravity {})",
        joule(energy.start.total),
        joule(energy.end.total),
        joule(energy.end.kinetic),
        joule(energy.end.elastic),
        joule(energy.end.gravity),
    ));
    let mut flows = Vec::new();
    if energy.dashpot_heat != 0.0 {
        flows.push(format!("dashpots took {}", joule(energy.dashpot_heat)));
    }
    if energy.anchor_work != 0.0 {
        flows.push(format!("anchors gave {}", joule(energy.anchor_work)));
    }
    let (verb, gain) = match energy.method_gain < 0.0 {
        true => ("lost", -energy.method_gain),
        false => ("gained", energy.method_gain),
    };
    flows.push(format!("the method itself {verb} {}", joule(gain)));
    lines.push(format!("  {}", flows.join(", ")));
    if report.rescued_steps > 0 {
        lines.push(format!(
            "  {} could not be made in one and were made in shorter ones",
            count(report.rescued_steps as usize, "step"),
        ));
    }
    if report.clamped_springs > 0 {
        lines.push(format!(
            "  {} clamped where the matrix was indefinite, over all steps",
            count(report.clamped_springs as usize, "spring"),
        ));
    }
    lines.push(format!(
        "  wrote {} into {}",
        written.join(", "),
        folder.display()
    ));
    lines.join("\n")
}

/// Four significant digits.
pub(crate) fn short(value: f64) -> String {
    let text = format!("{value:.3e}");
    let rounded: f64 = text.parse().unwrap_or(value);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        1e-3..1e7 => format!("{rounded}"),
        _ => text,
    }
}

fn joule(value: f64) -> String {
    format!("{} J", short(value))
}

/// "1.2 ms", "3.4 s", "5 min 6 s".
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{:.0} µs", s * 1e6),
        s if s < 0.1 => format!("{:.1} ms", s * 1e3),
        s if s < 1.0 => format!("{:.0} ms", s * 1e3),
        s if s < 59.95 => format!("{s:.1} s"),
        s => {
            let whole = s.round() as u64;
            format!("{} min {} s", whole / 60, whole % 60)
        }
    }
}
