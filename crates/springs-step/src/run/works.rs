//! The work of each load and each support.

use crate::flows::BlockWorks;
use springs_assembly::System;

/// What loads and moving supports did so far, one by one, in J. They add up to the work of
/// loads and anchors in the [`Ledger`](crate::Ledger), up to rounding, and are integrated
/// as these are. Nothing else outside does work: supports that stand, or let a node slide,
/// do none.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Works {
    /// Of each load of the scene, on nodes that may move.
    pub loads: Vec<f64>,
    /// Of the forces that were [set](crate::Simulation::set_forces) between steps.
    pub set_forces: f64,
    /// Of each load of emitters that the scene does not have, in their order.
    pub other_loads: Vec<f64>,
    /// Of each fixed node that moves or has moved, in the order of the nodes.
    pub supports: Vec<SupportWork>,
}

/// The work of a support.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SupportWork {
    /// The fixed node.
    pub node: usize,
    /// In J.
    pub work: f64,
}

impl Works {
    /// Those of a system with so many loads of the scene, at the velocities `v` of all
    /// blocks.
    pub(crate) fn of(
        system: &System,
        works: &BlockWorks,
        (n_scene_loads, has_set_forces): (usize, bool),
        v: &[nalgebra::Vector3<f64>],
    ) -> Self {
        let mut loads = works.loads.clone();
        loads.resize(system.n_loads(), 0.0);
        let mut others = loads.split_off(n_scene_loads);
        let set_forces = if has_set_forces {
            others.remove(0)
        } else {
            0.0
        };
        let first_fixed = system.n_free();
        let mut moves: Vec<bool> = v[first_fixed..].iter().map(|v| v.norm() > 0.0).collect();
        for block in system.prescribed().iter().flat_map(|p| p.blocks()) {
            moves[block - first_fixed] = true;
        }
        let each = moves.iter().enumerate().filter_map(|(anchor, &moves)| {
            let work = works.anchors.get(anchor).copied().unwrap_or(0.0);
            let node = system.numbering().node(first_fixed + anchor);
            (moves || work != 0.0).then_some(SupportWork { node, work })
        });
        Self {
            loads,
            set_forces,
            other_loads: others,
            supports: each.collect(),
        }
    }

    /// Adds those of a part, whose nodes and loads are these of the scene.
    pub(crate) fn add_part(&mut self, part: Self, nodes: &[usize], loads: &[usize]) {
        for (&load, work) in loads.iter().zip(part.loads) {
            self.loads[load] += work;
        }
        self.supports
            .extend(part.supports.iter().map(|support| SupportWork {
                node: nodes[support.node],
                ..*support
            }));
    }

    /// After all parts: nodes that hold several of them have one work.
    pub(crate) fn finish(mut self) -> Self {
        self.supports.sort_by_key(|support| support.node);
        self.supports.dedup_by(|next, kept| {
            let is_same = next.node == kept.node;
            if is_same {
                kept.work += next.work;
            }
            is_same
        });
        self
    }
}
