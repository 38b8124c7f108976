//! Nodes without mass or springs, at one place, or that begin with a jump.

use super::warning::Warnings;
use super::words::{are, rounded};
use springs_scene::Scene;
use std::collections::{HashMap, HashSet};

pub(super) fn list(scene: &Scene, warnings: &mut Warnings) {
    list_masses(scene, warnings);
    list_without_springs(scene, warnings);
    list_coincident(scene, warnings);
    list_jumps(scene, warnings);
}

/// Masses that differ by more than this factor are told.
const MOST_UNEQUAL: f64 = 1e6;

fn list_masses(scene: &Scene, warnings: &mut Warnings) {
    let masses = scene.node_masses();
    let free = || (0..scene.nodes.len()).filter(|&node| !scene.nodes[node].fixed);
    let massless: Vec<usize> = free().filter(|&node| masses[node] == 0.0).collect();
    let them = if massless.len() == 1 { "it" } else { "them" };
    warnings.of_nodes(
        &massless,
        |named| {
            format!(
                "{named} {} free but without mass: only springs hold {them}, and explicit methods \
                 refuse {them}",
                are(&massless)
            )
        },
        "give nodes or springs a mass in kg",
    );
    let heavy = || free().filter(|&node| masses[node] > 0.0);
    let by_mass = |a: &usize, b: &usize| masses[*a].total_cmp(&masses[*b]);
    if let (Some(light), Some(heavy)) = (heavy().min_by(by_mass), heavy().max_by(by_mass)) {
        let ratio = masses[heavy] / masses[light];
        if ratio > MOST_UNEQUAL {
            warnings.of_nodes(
                &[heavy],
                |named| format!("{named} is {ratio:.1e} times as heavy as node {light}"),
                "is a unit wrong? masses are in kg",
            );
        }
    }
}

fn list_without_springs(scene: &Scene, warnings: &mut Warnings) {
    let mut has_spring = vec![false; scene.nodes.len()];
    for node in scene.springs.iter().flat_map(|spring| spring.nodes) {
        has_spring[node] = true;
    }
    let loose = |fixed: bool| -> Vec<usize> {
        let nodes = 0..scene.nodes.len();
        let nodes = nodes.filter(|&node| !has_spring[node] && scene.nodes[node].fixed == fixed);
        nodes.collect()
    };
    let free = loose(false);
    warnings.of_nodes(
        &free,
        |named| {
            let are = are(&free);
            format!("{named} {are} free but at no spring: only loads and gravity act there")
        },
        "join it by a spring, fix it, or remove it",
    );
    if !scene.springs.is_empty() {
        let fixed = loose(true);
        warnings.of_nodes(
            &fixed,
            |named| {
                let are = are(&fixed);
                format!("{named} {are} fixed and at no spring: that does nothing")
            },
            "join it by a spring, or remove it",
        );
    }
}

/// Nodes that begin at the very place of another one, which no spring joins them with.
fn list_coincident(scene: &Scene, warnings: &mut Warnings) {
    let mut first_at: HashMap<[u64; 3], usize> = HashMap::new();
    let mut pairs: HashSet<[usize; 2]> = HashSet::new();
    for node in 0..scene.nodes.len() {
        // Zero has two signs.
        let place = scene.start_position(node).map(|x| (x + 0.0).to_bits());
        let first = *first_at.entry(place.into()).or_insert(node);
        if first != node {
            pairs.insert([first, node]);
        }
    }
    if pairs.is_empty() {
        return;
    }
    for spring in &scene.springs {
        let [a, b] = spring.nodes;
        pairs.remove(&[a.min(b), a.max(b)]);
    }
    let mut apart: Vec<usize> = pairs.into_iter().map(|[_, node]| node).collect();
    apart.sort_unstable();
    warnings.of_nodes(
        &apart,
        |named| {
            let are = are(&apart);
            format!("{named} {are} at the place of another node, and no spring joins the two")
        },
        "if they are meant to be one, give springs the same node",
    );
}

/// Nodes that are elsewhere at the time 0 than their positions say.
fn list_jumps(scene: &Scene, warnings: &mut Warnings) {
    let jump = |node: usize| {
        let displacement = scene.displacement(node, 0.0)?.displacement.norm();
        (displacement > 0.0).then_some((node, displacement))
    };
    let jumps = (0..scene.nodes.len()).filter_map(jump);
    let (nodes, by): (Vec<usize>, Vec<f64>) = jumps.unzip();
    let most = by.into_iter().fold(0.0, f64::max);
    warnings.of_nodes(
        &nodes,
        |named| {
            format!(
                "{named}: the motion begins up to {} m away from the position, but rest lengths \
                 that are left out are those between positions",
                rounded(most)
            )
        },
        "let the motion begin at (0, 0, 0), or give rest lengths",
    );
}
