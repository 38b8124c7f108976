//! Springs that do nothing, pull nowhere, or stand twice.

use super::warning::Warnings;
use super::words::are;
use springs_scene::{Scene, Spring, SpringLaw};
use std::collections::HashMap;

/// The indices of some springs.
pub(super) fn indices(scene: &Scene, wanted: impl Fn(&Spring) -> bool) -> Vec<usize> {
    let springs = scene.springs.iter().enumerate();
    springs
        .filter_map(|(index, spring)| wanted(spring).then_some(index))
        .collect()
}

/// Whether only its mass is there of a spring.
pub(super) fn is_dead(spring: &Spring) -> bool {
    !spring.is_elastic() && spring.damping == 0.0
}

/// How long a spring is at the time 0, in m.
pub(super) fn start_length(scene: &Scene, spring: &Spring) -> f64 {
    let [a, b] = spring.nodes.map(|node| scene.start_position(node));
    (a - b).norm()
}

/// Springs that have no tension at the time 0 because their law pulls or pushes only.
pub(super) fn slack(scene: &Scene) -> Vec<usize> {
    indices(scene, |spring| {
        let law = spring.law.map(|law| &scene.laws[law]);
        !spring.broken
            && match law {
                Some(SpringLaw::TensionOnly { .. }) => {
                    start_length(scene, spring) < spring.rest_length
                }
                Some(SpringLaw::CompressionOnly { .. }) => {
                    start_length(scene, spring) > spring.rest_length
                }
                _ => false,
            }
    })
}

/// Springs between two nodes that another spring joins already.
pub(super) fn duplicates(scene: &Scene) -> Vec<usize> {
    let mut first_of_pair: HashMap<[usize; 2], usize> = HashMap::new();
    (0..scene.springs.len())
        .filter(|&index| {
            let [a, b] = scene.springs[index].nodes;
            let pair = [a.min(b), a.max(b)];
            *first_of_pair.entry(pair).or_insert(index) != index
        })
        .collect()
}

/// Strain from which on the start is told.
const MUCH_STRAINED: f64 = 0.5;

pub(super) fn list(scene: &Scene, warnings: &mut Warnings) {
    let dead = indices(scene, |spring| is_dead(spring) && !spring.broken);
    warnings.of_springs(
        &dead,
        |named| {
            let are = are(&dead);
            format!("{named} {are} without stiffness and damping: that adds mass and nothing else")
        },
        "give them a stiffness in N/m, or make their mass that of the nodes",
    );
    let coincident = indices(scene, |spring| {
        start_length(scene, spring) == 0.0 && spring.rest_length > 0.0
    });
    warnings.of_springs(
        &coincident,
        |named| {
            format!(
                "{named}: the two nodes coincide but the rest length is not zero, \
                 so the spring has no direction and pushes nowhere"
            )
        },
        "move one of the nodes a little the way it is to go",
    );
    let strained = indices(scene, |spring| {
        let strain = start_length(scene, spring) / spring.rest_length - 1.0;
        spring.rest_length > 0.0 && strain.abs() > MUCH_STRAINED
    });
    warnings.of_springs(
        &strained,
        |named| {
            format!("{named}: more than 50 % longer or shorter than at rest when the run starts")
        },
        "left out, a rest_length is the distance of the nodes",
    );
    warnings.of_springs(
        &duplicates(scene),
        |named| {
            format!("{named}: another spring joins the same two nodes already; their forces add up")
        },
        "remove one of them if that is not meant",
    );
}
