//! Steps of fixed size that are too long for the scene.

use super::vibrations::Vibrations;
use super::warning::Warnings;
use springs_step::{Pace, Simulation};

/// Warnings of the part with the fastest vibrations, which has the most to say about
/// steps.
pub(super) fn list(simulation: &Simulation, vibrations: &Vibrations, warnings: &mut Warnings) {
    let (system, choice) = (simulation.system(), simulation.choice());
    let (Pace::Fixed(h), Some(row)) = (choice.pace, choice.properties()) else {
        return;
    };
    let method = choice.method;
    let frequency = system.frequency_bound();
    let node: Vec<usize> = vibrations.highest_node.into_iter().collect();
    let Some(angle) = row.stable_angle else {
        if row.order == 1 && h * frequency > 1.0 && frequency.is_finite() {
            warnings.of_nodes(
                &node,
                |named| {
                    format!(
                        "the step of {h} s does not resolve the fastest vibrations, at {named}, \
                         which need less than {:.2e} s; the method damps them out",
                        1.0 / frequency
                    )
                },
                "choose steps by the error, with a tolerance, if they matter",
            );
        }
        return;
    };
    let rate = system.damping_rate_bound();
    let limits = [
        (frequency, "stiffest node allows", &node[..]),
        (rate, "strongest dashpots allow", &[]),
    ];
    let exceeds = |bound: f64| h * bound > angle && bound.is_finite();
    let exceeded = limits.into_iter().find(|(bound, ..)| exceeds(*bound));
    if let Some((bound, what, nodes)) = exceeded {
        let message = format!(
            "the step of {h} s may be unstable with {method}: the {what} {:.2e} s",
            angle / bound
        );
        let suggestion = "shorten it, take an implicit method, or give a tolerance instead";
        warnings.add(message, suggestion, nodes, &[]);
    }
}
