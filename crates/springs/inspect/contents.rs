//! What is in a scene: numbers of things, sizes, and how far values are apart.

use super::materials::{LawCount, MaterialRanges, laws, ranges};
use super::proportions::OwnWeight;
use super::range::Range;
use super::springs::{duplicates, slack};
use serde::Serialize;
use springs_assembly::System;
use springs_io::Inputs;
use springs_scene::Scene;
use springs_step::{Islands, Part};

/// What is in a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Contents {
    /// Nodes.
    pub nodes: usize,
    /// Nodes that are free.
    pub free_nodes: usize,
    /// Nodes that are fixed.
    pub fixed_nodes: usize,
    /// Fixed nodes that move.
    pub moving_nodes: usize,
    /// Free nodes that may move in part only.
    pub guided_nodes: usize,
    /// Free nodes without mass.
    pub massless_nodes: usize,
    /// Free nodes without a spring.
    pub loose_nodes: usize,
    /// Parts that are not coupled.
    pub parts: usize,
    /// Unknowns: three for each free node.
    pub unknowns: usize,
    /// Blocks of 3 × 3 numbers that a matrix of the scene stores.
    pub matrix_blocks: usize,
    /// Springs.
    pub springs: usize,
    /// Springs with a dashpot.
    pub damped_springs: usize,
    /// Springs that pull or push only, and do not at the start.
    pub slack_springs: usize,
    /// Springs between two nodes that another spring joins, too.
    pub duplicate_springs: usize,
    /// Springs that can break.
    pub breakable_springs: usize,
    /// Springs that are broken before the first step.
    pub broken_springs: usize,
    /// From corner to corner, in m.
    pub size: f64,
    /// Of the free nodes, in kg.
    pub free_mass: f64,
    /// Masses of free nodes that have one, in kg.
    pub node_masses: Option<Range>,
    /// Stiffnesses K of springs that have one, in N/m.
    pub stiffnesses: Option<Range>,
    /// Damping ratios c / 2√(K μ) of springs with dashpots, each with its two nodes alone.
    pub damping_ratios: Option<Range>,
    /// Drag of free nodes that have any, in N·s/m.
    pub drags: Option<Range>,
    /// In m/s².
    pub gravity: [f64; 3],
    /// By how much the springs at fixed nodes would be stretched or compressed if they
    /// carried all weight, over their length.
    pub own_weight_strain: Option<f64>,
    /// Loads.
    pub loads: usize,
    /// Nodes they are on, as often as they are named.
    pub loaded_nodes: usize,
    /// Values by material; empty where a file has neither materials nor laws.
    pub materials: Vec<MaterialRanges>,
    /// Laws other than the linear one.
    pub laws: Vec<LawCount>,
}

impl Contents {
    /// Of a scene that was compiled into `islands`.
    pub(super) fn of(scene: &Scene, inputs: &Inputs, islands: &Islands) -> Self {
        let nodes = |wanted: fn(&springs_scene::Node) -> bool| {
            scene.nodes.iter().filter(|node| wanted(node)).count()
        };
        let systems = || {
            islands
                .parts()
                .iter()
                .map(|part| part.simulation().system())
        };
        let masses = scene.node_masses();
        let free = || (0..scene.nodes.len()).filter(|&node| !scene.nodes[node].fixed);
        let springs = || scene.springs.iter().enumerate();
        let blocks = systems().map(|system| system.n_free() + system.pattern().pairs().len());
        let broken = |part: &Part| part.simulation().system().broken().len();
        let ratio = |index: usize| scene.dashpot(index) / scene.critical_damping(index, &masses);
        let has_materials = !inputs.springs.is_empty() || !scene.laws.is_empty();
        Self {
            nodes: scene.nodes.len(),
            free_nodes: islands.n_free(),
            fixed_nodes: nodes(|node| node.fixed),
            moving_nodes: nodes(springs_scene::Node::is_moving_anchor),
            guided_nodes: nodes(|node| node.guide.is_some()),
            massless_nodes: free().filter(|&node| masses[node] == 0.0).count(),
            loose_nodes: scene.islands().loose.len(),
            parts: islands.parts().len(),
            unknowns: 3 * islands.n_free(),
            matrix_blocks: blocks.sum(),
            springs: scene.springs.len(),
            damped_springs: springs()
                .filter(|(index, _)| scene.dashpot(*index) > 0.0)
                .count(),
            slack_springs: slack(scene).len(),
            duplicate_springs: duplicates(scene).len(),
            breakable_springs: springs()
                .filter(|(_, spring)| spring.breaks_at.is_some())
                .count(),
            // With those that are beyond their limits.
            broken_springs: islands.parts().iter().map(broken).sum(),
            size: scene.size(),
            free_mass: systems()
                .flat_map(System::masses)
                .fold(0.0, |sum, mass| sum + mass),
            node_masses: Range::of(
                free()
                    .map(|node| (node, masses[node]))
                    .filter(|(_, mass)| *mass > 0.0),
            ),
            stiffnesses: Range::of(
                springs()
                    .map(|(index, spring)| (index, spring.stiffness))
                    .filter(|(_, stiffness)| *stiffness > 0.0),
            ),
            damping_ratios: Range::of(
                springs()
                    .map(|(index, _)| (index, ratio(index)))
                    .filter(|(_, ratio)| *ratio > 0.0 && ratio.is_finite()),
            ),
            drags: Range::of(
                scene
                    .node_drags()
                    .into_iter()
                    .enumerate()
                    .filter(|(_, drag)| *drag > 0.0),
            ),
            gravity: scene.gravity.into(),
            own_weight_strain: OwnWeight::of(scene).map(|weight| weight.strain),
            loads: scene.loads.len(),
            loaded_nodes: scene.loads.iter().map(|load| load.nodes.len()).sum(),
            materials: if has_materials {
                ranges(scene, inputs)
            } else {
                Vec::new()
            },
            laws: laws(scene),
        }
    }
}
