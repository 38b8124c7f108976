//! What a run says at its end.

use springs::inspect::{count, short, time};
use springs::io::{Report, SecondsReport};
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
            "  in {} that are not coupled; that is the largest, and the most steps",
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
    lines.push(format!("  took {}", phases(&report.seconds)));
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
        let takers = match (scene.has_drag(), scene.has_dashpots()) {
            (true, true) => "dashpots and drag",
            (true, false) => "drag",
            (false, _) => "dashpots",
        };
        flows.push(format!("{takers} took {}", joule(energy.dashpot_heat)));
    }
    if energy.load_work != 0.0 {
        flows.push(format!("loads gave {}", joule(energy.load_work)));
    }
    if energy.anchor_work != 0.0 {
        flows.push(format!("anchors gave {}", joule(energy.anchor_work)));
    }
    if report.broken_springs > 0 {
        let (springs, held) = (
            count(report.broken_springs, "spring"),
            joule(energy.broken_energy),
        );
        flows.push(format!("{springs} broke and took {held}"));
    }
    let (verb, gain) = if energy.method_gain < 0.0 {
        ("lost", -energy.method_gain)
    } else {
        ("gained", energy.method_gain)
    };
    let share = match energy.turned_over {
        0.0 => String::new(),
        moved => format!(", {} % of the energy that moved", percent(gain / moved)),
    };
    flows.push(format!("the method itself {verb} {}{share}", joule(gain)));
    lines.push(format!("  {}", flows.join(", ")));
    lines.extend(caution(scene, report));
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

/// A method that made or lost more than this part of the energy that moved has
/// shown its own behaviour, not that of the scene.
const MOST_OF_IT: f64 = 0.5;

/// What to do where most of the motion is the method's own making.
fn caution(scene: &Scene, report: &Report) -> Option<String> {
    let energy = &report.energy;
    let what = match energy.method_gain / energy.turned_over {
        part if part <= -MOST_OF_IT => "damped out most of the motion",
        part if part >= MOST_OF_IT => "made most of this energy",
        _ => return None,
    };
    let tolerance = match (report.tolerance, scene.size()) {
        (Some(tolerance), _) => 0.1 * tolerance,
        (None, size) if size > 0.0 => 1e-3 * size,
        (None, _) => 1e-3,
    };
    Some(format!(
        "  the method {what}, not the scene: choose steps by the error, \
         with --method auto --tolerance {}",
        short(tolerance)
    ))
}

/// "608 ms: setup 19.6 ms, steps 574 ms (assembly 54.7 ms, …), output 13.2 ms".
fn phases(seconds: &SecondsReport) -> String {
    let list = |phases: &[(&str, f64)]| {
        let phases = phases.iter().filter(|(_, seconds)| *seconds > 0.0);
        let phases: Vec<String> = phases
            .map(|(what, seconds)| format!("{what} {}", time(*seconds)))
            .collect();
        phases.join(", ")
    };
    let mut parts = vec![list(&[
        ("reading", seconds.reading),
        ("setup", seconds.setup),
        ("trial runs", seconds.trials),
        ("steps", seconds.stepping),
    ])];
    let inner = [seconds.assembly, seconds.factorization, seconds.solve];
    if let [assembly, factorization, solve] = inner
        && seconds.stepping > 0.0
        && inner.iter().sum::<f64>() > 0.0
    {
        // Of parts that run at once, the time of each counts.
        let of = if inner.iter().sum::<f64>() > seconds.stepping {
            "on all threads "
        } else {
            ""
        };
        parts[0] += &format!(
            " ({of}{})",
            list(&[
                ("assembly", assembly),
                ("factorization", factorization),
                ("solve", solve),
            ])
        );
    }
    if seconds.output > 0.0 {
        parts.push(list(&[("output", seconds.output)]));
    }
    format!("{}: {}", time(seconds.total), parts.join(", "))
}

/// "50", "0.42"; two significant digits, "below 0.01" where there is next to
/// nothing.
fn percent(part: f64) -> String {
    match 100.0 * part {
        small if small < 0.01 => "below 0.01".to_owned(),
        percent if percent < 10.0 => short((percent * 100.0).round() / 100.0),
        percent => format!("{percent:.0}"),
    }
}

fn joule(value: f64) -> String {
    format!("{} J", short(value))
}
