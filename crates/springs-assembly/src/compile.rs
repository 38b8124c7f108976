//! From a scene to a system: everything that is decided once.

use crate::drag::Drag;
use crate::elements::{Element, PointMasses, SpringMasses};
use crate::gravity::Gravity;
use crate::laws::{fading, springs_that_break, springs_with_laws};
use crate::sorting::sorted_by_rows;
use crate::springs::Merged;
use crate::system::Couplings;
use crate::{
    BlockPattern, Dashpots, Emitter, Lines, Loads, Motion, Numbering, SpringBetween, Springs,
    System,
};
use springs_math::dashpot::Fading;
use springs_math::law::TableError;
use springs_math::spring;
use springs_scene::{Node, Problem, Scene, Spring};

/// Why a scene has no system.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompileError {
    /// The scene itself is wrong; the message is that of the first problem.
    #[error("{}", .0[0])]
    Problems(Vec<Problem>),
    /// A law cannot be computed with.
    #[error("the law of spring {spring} cannot be computed with: {source}")]
    Law {
        /// The spring.
        spring: usize,
        /// What is wrong with it.
        source: TableError,
    },
    /// More emitters than [`Lines::MOST`].
    #[error("there are {n_emitters} emitters; {most} are the most", most = Lines::MOST)]
    TooManyEmitters {
        /// How many there are.
        n_emitters: usize,
    },
}

/// Numbers the nodes, lumps the masses, makes the emitters of springs, gravity,
/// dashpots, loads and drag, and fixes the sparsity pattern.
///
/// # Errors
///
/// If the scene has problems: all of them.
pub fn compile(scene: &Scene) -> Result<System, CompileError> {
    compile_with(scene, Compilation::default())
}

/// What a system has beside its scene.
#[derive(Default)]
pub struct Compilation {
    /// Emitters beside those of the scene, on its nodes.
    pub emitters: Vec<Box<dyn Emitter>>,
    /// Nothing is left out: springs between the same nodes stay apart, and the motion
    /// is in space even where it stays on a plane or a line.
    pub is_complete: bool,
    /// [Springs](System::change_springs) and [forces](System::set_forces) may change
    /// between steps. Then nothing is left out either.
    pub may_change: bool,
}

impl Compilation {
    /// With everything that is in the scene.
    pub fn complete() -> Self {
        Self {
            is_complete: true,
            ..Self::default()
        }
    }

    /// With more emitters.
    pub fn with_emitters(emitters: Vec<Box<dyn Emitter>>) -> Self {
        Self {
            emitters,
            ..Self::default()
        }
    }
}

/// The same as said, and with more emitters.
///
/// # Errors
///
/// If the scene has problems, or there are too many emitters.
///
/// # Panics
///
/// If an emitter asks for a node that is not there.
pub fn compile_with(scene: &Scene, compilation: Compilation) -> Result<System, CompileError> {
    let Compilation {
        emitters: others,
        is_complete,
        may_change,
    } = compilation;
    let is_complete = is_complete || may_change;
    let problems = scene.problems();
    if !problems.is_empty() {
        return Err(CompileError::Problems(problems));
    }
    let numbering = Numbering::new(scene.nodes.iter().map(|node| node.fixed));
    let masses = lump_mass(scene, &numbering);
    let mut springs = springs_of(scene, (is_complete, may_change));
    springs.number(&numbering);
    if !is_complete {
        springs.find_isotropy();
    }
    let mut dashpots = dashpots_of(scene, (is_complete, may_change));
    dashpots.number(&numbering);
    let gravity = Gravity::new(&scene.gravity, &masses);
    let mut loads = Loads::of_scene(scene);
    if may_change {
        loads = loads.with_set_forces(scene.nodes.len());
    }
    loads.number(&numbering);
    let mut drag = Drag::of_nodes(scene.node_drags());
    drag.number(&numbering);
    let mut with_laws = springs_with_laws(scene)?;
    with_laws.number(&numbering);
    let mut that_break = springs_that_break(scene)?;
    that_break.number(&numbering);
    let mut emitters: Vec<Box<dyn Emitter>> = vec![
        Box::new(springs),
        Box::new(gravity),
        Box::new(dashpots),
        Box::new(loads),
        Box::new(drag),
        Box::new(with_laws),
        Box::new(that_break),
    ];
    for mut emitter in others {
        emitter.number(&numbering);
        emitters.push(emitter);
    }
    if emitters.len() > Lines::MOST {
        return Err(CompileError::TooManyEmitters {
            n_emitters: emitters.len(),
        });
    }
    let (pattern, couplings) = place(&mut emitters, &numbering);
    let motion = if is_complete {
        Motion::Space
    } else {
        motion_of(scene, &numbering, &emitters, &couplings)
    };
    let matrix = (pattern, couplings);
    let mut system = System::new(scene, numbering, masses, emitters, matrix, motion);
    // What is beyond its limit in the scene breaks before anything moves.
    system.break_at_start();
    Ok(system)
}

/// The linear springs that have a stiffness, or may come to one; those of one rest length
/// between the same two nodes are one, unless nothing is to be left out: K = ΣK. Their
/// tensions are in proportion to their stiffnesses, so that this is exact with every
/// projection.
fn springs_of(scene: &Scene, (is_complete, may_change): (bool, bool)) -> Springs {
    let is_linear = |spring: &Spring| {
        let acts = spring.stiffness > 0.0 || may_change;
        acts && spring.law.is_none() && !spring.is_breakable()
    };
    // Rest lengths are not negative, so their bits are in their order.
    let firsts = firsts_of_pairs(scene, is_complete, |_, spring| {
        is_linear(spring).then_some((spring.rest_length + 0.0).to_bits())
    });
    let mut sums = vec![0.0; scene.springs.len()];
    for (spring, &first) in scene.springs.iter().zip(&firsts) {
        sums[first] += spring.stiffness;
    }
    let is_first = |index: &usize| is_linear(&scene.springs[*index]) && firsts[*index] == *index;
    let index: Vec<usize> = (0..scene.springs.len()).filter(is_first).collect();
    let parts = firsts.iter().enumerate();
    let parts = parts.filter(|(spring, first)| spring != *first);
    let parts = parts.map(|(spring, first)| Merged {
        into: index.binary_search(first).expect("one that is there"),
        index: spring,
        share: scene.springs[spring].stiffness / sums[*first],
    });
    let parts = parts.collect();
    let springs = index.iter().map(|&index| SpringBetween {
        nodes: scene.springs[index].nodes,
        law: spring::Spring {
            stiffness: sums[index],
            rest_length: scene.springs[index].rest_length,
        },
    });
    let springs: Vec<_> = springs.collect();
    Springs::of_scene(&springs, index, parts)
}

/// The springs that have a damping, or may come to one; those between the same two nodes
/// that fade nowhere and cannot break are one, unless nothing is to be left out: c = Σc.
fn dashpots_of(scene: &Scene, (is_complete, may_change): (bool, bool)) -> Dashpots {
    let may_damp = may_change && scene.damping.stiffness > 0.0;
    let is_damped = |index: usize| scene.dashpot(index) > 0.0 || may_damp;
    let firsts = firsts_of_pairs(scene, is_complete, |index, _| {
        let stays = fading(scene, index) == Fading::Nowhere && !scene.springs[index].is_breakable();
        (is_damped(index) && stays).then_some(())
    });
    let mut sums = vec![0.0; scene.springs.len()];
    for (index, &first) in firsts.iter().enumerate() {
        sums[first] += scene.dashpot(index);
    }
    let damped = scene.springs.iter().enumerate();
    let damped = damped.filter(|(index, _)| is_damped(*index) && firsts[*index] == *index);
    let damped: Vec<_> = damped.map(|(index, _)| index).collect();
    let nodes = |&index: &usize| (scene.springs[index].nodes, sums[index]);
    let dashpots: Vec<_> = damped.iter().map(nodes).collect();
    let fading = damped.iter().map(|&index| fading(scene, index)).collect();
    let dashpots = Dashpots::new(&dashpots).with_fading(fading);
    let may_break = |&index: &usize| scene.springs[index].is_breakable();
    if may_change || damped.iter().any(may_break) {
        dashpots.of_springs(damped)
    } else {
        dashpots
    }
}

/// The first spring of those between the same nodes and with the same `trait_of`,
/// for each spring; only among springs that have one, and itself where nothing is
/// to be left out.
fn firsts_of_pairs<T: Ord + Copy>(
    scene: &Scene,
    is_complete: bool,
    trait_of: impl Fn(usize, &Spring) -> Option<T>,
) -> Vec<usize> {
    let mut firsts: Vec<usize> = (0..scene.springs.len()).collect();
    if is_complete {
        return firsts;
    }
    let springs = scene.springs.iter().enumerate();
    let by_pair: Vec<([usize; 2], T, usize)> = springs
        .filter_map(|(index, spring)| {
            let [a, b] = spring.nodes;
            Some(([a.min(b), a.max(b)], trait_of(index, spring)?, index))
        })
        .collect();
    let by_pair = sorted_by_rows(&by_pair, scene.nodes.len(), |(pair, ..)| pair[0]);
    for same in by_pair.chunk_by(|a, b| (a.0, &a.1) == (b.0, &b.1)) {
        for &(_, _, index) in same {
            firsts[index] = same[0].2;
        }
    }
    firsts
}

/// Fixes the pattern of the matrix, tells every emitter its places there, and lists
/// what is coupled.
pub(crate) fn place(
    emitters: &mut [Box<dyn Emitter>],
    numbering: &Numbering,
) -> (BlockPattern, Couplings) {
    let is_free = |block: u32| !numbering.is_fixed(block);
    let mut triplets = Vec::new();
    let mut ends = Vec::new();
    let mut couplings = Couplings::default();
    let mut is_coupled = vec![false; numbering.n_nodes()];
    for emitter in &*emitters {
        emitter.each_stencil(&mut |stencil| {
            for (i, &a) in stencil.iter().enumerate() {
                is_coupled[a as usize] = true;
                for &b in &stencil[i + 1..] {
                    match [is_free(a), is_free(b)] {
                        [true, true] => triplets.push([a, b]),
                        [true, false] => couplings.anchored.push([a, b]),
                        [false, true] => couplings.anchored.push([b, a]),
                        [false, false] => {}
                    }
                }
            }
        });
        ends.push(triplets.len());
    }
    let blocks = (0u32..).zip(&is_coupled);
    couplings.coupled = blocks
        .filter_map(|(block, &is)| is.then_some(block))
        .collect();
    let (pattern, pairs) = BlockPattern::from_triplets(numbering.n_free(), &triplets);
    let mut begin = 0;
    for (emitter, end) in emitters.iter_mut().zip(ends) {
        emitter.place(&pairs[begin..end]);
        begin = end;
    }
    (pattern, couplings)
}

/// Where free nodes and the anchors they feel lie and move.
fn motion_of(
    scene: &Scene,
    numbering: &Numbering,
    emitters: &[Box<dyn Emitter>],
    couplings: &Couplings,
) -> Motion {
    // Both may lead out of a plane.
    let leaves = |node: &Node| node.guide.is_some() || node.motion.is_some();
    if scene.nodes.iter().any(leaves) || !emitters.iter().all(|emitter| emitter.nature().is_central)
    {
        return Motion::Space;
    }
    let n_free = numbering.n_free();
    let coupled = couplings.coupled.iter().map(|&block| block as usize);
    let mut blocks: Vec<usize> = coupled.filter(|&block| block >= n_free).collect();
    blocks.extend(0..n_free);
    let node = |block: usize| &scene.nodes[numbering.node(block)];
    let positions: Vec<_> = blocks.iter().map(|&block| node(block).position).collect();
    let velocities: Vec<_> = blocks.iter().map(|&block| node(block).velocity).collect();
    let motion = Motion::of(&positions, &velocities, &scene.gravity);
    let mut pushes_out = false;
    for emitter in emitters {
        emitter.each_stencil(&mut |stencil| {
            if let &[a, b] = stencil {
                let [a, b] = [a, b].map(|block| node(block as usize).position);
                pushes_out |= motion.is_left_by(&(b - a));
            }
        });
    }
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
