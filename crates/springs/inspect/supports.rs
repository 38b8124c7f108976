//! Parts that nothing holds, loads that move nothing, and groups with mistakes.

use super::warning::Warnings;
use super::words::{count, name_them};
use springs_io::Inputs;
use springs_scene::{Scene, Vector3, printable};

pub(super) fn list(scene: &Scene, inputs: &Inputs, warnings: &mut Warnings) {
    list_floating(scene, warnings);
    list_loads(scene, warnings);
    list_groups(inputs, warnings);
}

/// Parts of several nodes that fall; single ones are told by what they lack, a spring.
fn list_floating(scene: &Scene, warnings: &mut Warnings) {
    if scene.gravity == Vector3::zeros() {
        return;
    }
    let islands = scene.islands();
    let is_free = |&&node: &&usize| !scene.nodes[node].fixed && scene.nodes[node].guide.is_none();
    let connected = islands.connected.iter();
    let floating = connected.filter(|island| island.nodes.iter().all(|node| is_free(&node)));
    let floating: Vec<usize> = floating.map(|island| island.nodes[0]).collect();
    let parts = count(floating.len(), "part");
    let them = if floating.len() == 1 { "it" } else { "them" };
    warnings.of_nodes(
        &floating,
        |named| {
            format!(
                "{parts} with {named}: no fixed node holds {them}, so gravity makes {them} fall \
                 for ever"
            )
        },
        "fix a node, or leave out gravity",
    );
}

fn list_loads(scene: &Scene, warnings: &mut Warnings) {
    let mut on_fixed: Vec<usize> = Vec::new();
    for (index, load) in scene.loads.iter().enumerate() {
        on_fixed.extend(load.nodes.iter().filter(|&&node| scene.nodes[node].fixed));
        let twice = repeated(&load.nodes);
        warnings.of_nodes(
            &twice,
            |named| format!("load {index} names {named} more than once, and acts as often"),
            "name each node once",
        );
        if load.nodes.is_empty() || load.force == Vector3::zeros() {
            let lacks = if load.nodes.is_empty() {
                "is on no node"
            } else {
                "has no force"
            };
            warnings.general(format!("load {index} {lacks}"), "remove it, or complete it");
        }
    }
    on_fixed.sort_unstable();
    on_fixed.dedup();
    warnings.of_nodes(
        &on_fixed,
        |named| {
            format!("loads on {named}, fixed: they move nothing, and are only part of reactions")
        },
        "put them on free nodes",
    );
}

fn list_groups(inputs: &Inputs, warnings: &mut Warnings) {
    for (name, nodes) in &inputs.groups {
        let name = printable(name);
        if nodes.is_empty() {
            warnings.general(
                format!("group `{name}` has no node"),
                "remove it, or fill it",
            );
        }
        let twice = repeated(nodes);
        if !twice.is_empty() {
            let nodes = name_them("node", &twice);
            warnings.of_nodes(
                &twice,
                |_| format!("group `{name}` has {nodes} more than once, so that loads act twice"),
                "name each node once",
            );
        }
    }
}

/// Numbers that stand more than once, ascending.
fn repeated(numbers: &[usize]) -> Vec<usize> {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    let pairs = sorted.windows(2).filter(|pair| pair[0] == pair[1]);
    let mut repeated: Vec<usize> = pairs.map(|pair| pair[0]).collect();
    repeated.dedup();
    repeated
}
