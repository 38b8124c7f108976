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
        let mut blocks = vec![Vec::new(); scene.motions.len()];
        for (node, motion) in scene.nodes.iter().map(|node| node.motion).enumerate() {
            if let Some(motion) = motion {
                blocks[motion].push(numbering.block(node) as u32);
            }
        }
        let motions = scene.motions.iter().zip(blocks);
        let followed = motions.filter(|(_, blocks)| !blocks.is_empty());
        let prescribed = followed.map(|(motion, blocks)| Self {
            motion: motion.motion.clone(),
            blocks,
        });
        prescribed.collect()
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
