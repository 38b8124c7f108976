//! Elements: what carries mass.

use crate::Numbering;
use springs_scene::Scene;

/// Something whose mass is lumped to the nodes it touches.
pub trait Element {
    /// Adds its share to the mass of every block it touches, in kg.
    fn add_lumped_mass(&self, masses: &mut [f64]);
}

/// Masses that nodes have of their own.
#[derive(Clone, Debug)]
pub struct PointMasses(Vec<(u32, f64)>);

impl PointMasses {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let own = |(node, mass)| (numbering.block(node) as u32, mass);
        let nodes = scene.nodes.iter().map(|node| node.mass).enumerate();
        Self(nodes.filter(|&(_, mass)| mass > 0.0).map(own).collect())
    }
}

impl Element for PointMasses {
    fn add_lumped_mass(&self, masses: &mut [f64]) {
        for &(block, mass) in &self.0 {
            masses[block as usize] += mass;
        }
    }
}

/// Masses of springs: half to each node (section 2.1 of the note).
#[derive(Clone, Debug)]
pub struct SpringMasses(Vec<([u32; 2], f64)>);

impl SpringMasses {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let springs = scene.springs.iter().filter(|spring| spring.mass > 0.0);
        let blocks = |nodes: [usize; 2]| nodes.map(|node| numbering.block(node) as u32);
        Self(
            springs
                .map(|spring| (blocks(spring.nodes), spring.mass))
                .collect(),
        )
    }
}

impl Element for SpringMasses {
    fn add_lumped_mass(&self, masses: &mut [f64]) {
        for &(ends, mass) in &self.0 {
            for block in ends {
                masses[block as usize] += 0.5 * mass;
            }
        }
    }
}
