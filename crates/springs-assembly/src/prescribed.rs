//! Motions that fixed blocks follow.

use crate::Numbering;
use springs_scene::{Displacement, PrescribedMotion, Scene};
use std::sync::Arc;

/// A motion and the blocks that follow it.
#[derive(Clone, Debug)]
pub struct Prescribed {
    motion: PrescribedMotion,
    blocks: Vec<u32>,
}

impl Prescribed {
    /// Those of a scene that any fixed node follows.
    pub(crate) fn of_scene(scene: &Scene, numbering: &Numbering) -> Arc<[Self]> {
        let motions = scene.motions.iter().enumerate();
        let followed = motions.map(|(index, motion)| {
            let nodes = scene.nodes.iter().enumerate();
            let followers = nodes.filter(|(_, node)| node.motion == Some(index));
            Self {
                motion: motion.motion.clone(),
                blocks: followers
                    .map(|(node, _)| numbering.block(node) as u32)
                    .collect(),
            }
        });
        followed
            .filter(|prescribed| !prescribed.blocks.is_empty())
            .collect()
    }

    /// What it is at a time in s.
    pub fn at(&self, time: f64) -> Displacement {
        self.motion.at(time)
    }

    /// The blocks that follow it.
    pub fn blocks(&self) -> impl Iterator<Item = usize> {
        self.blocks.iter().map(|&block| block as usize)
    }
}
