//! From a scene to a system: everything that is decided once.

use crate::batch::Connections;
use crate::elements::{Element, PointMasses, SpringMasses};
use crate::system::Batches;
use crate::{BlockPattern, Dashpots, Gravity, Motion, Numbering, Springs, System};
use springs_scene::{Problem, Scene};

/// Why a scene has no system.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompileError {
    /// The scene itself is wrong; the message is that of the first problem.
    #[error("{}", .0[0])]
    Problems(Vec<Problem>),
}

/// Numbers the nodes, lumps the masses, batches the emitters and fixes the
/// sparsity pattern.
///
/// # Errors
///
/// If the scene has problems: all of them.
pub fn compile(scene: &Scene) -> Result<System, CompileError> {
    let problems = scene.problems();
    if !problems.is_empty() {
        return Err(CompileError::Problems(problems));
    }
    let numbering = Numbering::new(scene.nodes.iter().map(|node| node.fixed));
    let masses = lump_mass(scene, &numbering);
    let mut springs = Springs::new(scene, &numbering);
    let mut dashpots = Dashpots::new(scene, &numbering);
    let gravity = Gravity::new(&scene.gravity, &masses);

    let interior = |connections: &Connections| connections.ends()[connections.interior()].to_vec();
    let triplets = [
        interior(&springs.connections),
        interior(&dashpots.connections),
    ];
    let (pattern, pairs) = BlockPattern::from_triplets(numbering.n_free(), &triplets.concat());
    let (of_springs, of_dashpots) = pairs.split_at(triplets[0].len());
    springs.connections.set_pairs(of_springs);
    dashpots.connections.set_pairs(of_dashpots);

    let motion = if scene.settings.skip {
        let connections = [&springs.connections, &dashpots.connections];
        motion_of(scene, &numbering, connections)
    } else {
        Motion::Space
    };
    let batches = Batches {
        springs,
        dashpots,
        gravity,
    };
    Ok(System::new(
        scene, numbering, masses, batches, pattern, motion,
    ))
}

/// Where free nodes and the anchors they feel lie and move.
fn motion_of(scene: &Scene, numbering: &Numbering, connections: [&Connections; 2]) -> Motion {
    let live = || {
        connections
            .into_iter()
            .flat_map(|connections| &connections.ends()[connections.live()])
    };
    let n_free = numbering.n_free();
    let ends = live().flatten().map(|&block| block as usize);
    let mut blocks: Vec<usize> = ends.filter(|&block| block >= n_free).collect();
    blocks.sort_unstable();
    blocks.dedup();
    blocks.extend(0..n_free);
    let node = |block: usize| &scene.nodes[numbering.node(block)];
    let positions: Vec<_> = blocks.iter().map(|&block| node(block).position).collect();
    let velocities: Vec<_> = blocks.iter().map(|&block| node(block).velocity).collect();
    let motion = Motion::of(&positions, &velocities, &scene.gravity);
    let pushes_out = live().any(|ends| {
        let [a, b] = ends.map(|block| node(block as usize).position);
        motion.is_left_by(&(b - a))
    });
    if pushes_out { Motion::Space } else { motion }
}

/// Mass of each free block, in kg.
fn lump_mass(scene: &Scene, numbering: &Numbering) -> Vec<f64> {
    let elements: [&dyn Element; 2] = [
        &PointMasses::new(scene, numbering),
        &SpringMasses::new(scene, numbering),
    ];
    let mut masses = vec![0.0; numbering.n_nodes()];
    for element in elements {
        element.add_lumped_mass(&mut masses);
    }
    masses.truncate(numbering.n_free());
    masses
}
