//! Equilibria of scenes.

use crate::StaticsError;
use crate::descent::Descent;
use crate::equations::{Equations, in_node_order, largest, vectors};
use nalgebra::Vector3;
use springs_assembly::{System, compile};
use springs_scene::{Scene, Start};
use springs_solver::{Inertia, Interrupt};

/// How statics are computed. No result depends on threads.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Options {
    /// Threads that may be used.
    pub threads: usize,
    /// Steps, of a few matrices each, until it is given up.
    pub most_iterations: usize,
    /// Asked to stop, it ends with an error.
    pub interrupt: Interrupt,
}

impl Default for Options {
    /// One thread, 2000 iterations.
    fn default() -> Self {
        Self {
            threads: 1,
            most_iterations: 2000,
            interrupt: Interrupt::default(),
        }
    }
}

impl Options {
    /// The same with so many threads.
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// The same, heard by this.
    pub fn with_interrupt(self, interrupt: Interrupt) -> Self {
        Self { interrupt, ..self }
    }
}

/// Where all forces are balanced.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Equilibrium {
    /// Of every node, in m.
    pub positions: Vec<Vector3<f64>>,
    /// What becomes of it when it is pushed a little.
    pub status: Status,
    /// The largest component of a force left on a node that can move, in N.
    pub residual: f64,
    /// The largest tension of a spring or load, in N, of which the residual is at most
    /// 1e-10, or what rounding of coordinates makes of the stiffness.
    pub largest_force: f64,
    /// Negative pivots of the stiffness: independent motions that it does not resist.
    pub negative_pivots: usize,
    /// Pivots that count as zero: up to 1e-11 of the stiffness at their node.
    pub zero_pivots: usize,
    /// Whether forces were balanced at the start.
    pub was_balanced: bool,
    /// Steps towards it, and corrections up to rounding.
    pub iterations: usize,
    /// Of each spring, in N.
    pub tensions: Vec<f64>,
    /// Of each support, in the order of the nodes.
    pub reactions: Vec<Reaction>,
}

/// The force of a support on its node.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reaction {
    /// The node.
    pub node: usize,
    /// In N.
    pub force: Vector3<f64>,
}

/// What becomes of an equilibrium when it is pushed a little.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// It comes back: the stiffness is positive definite.
    Stable,
    /// It goes away in as many independent ways as there are negative pivots.
    Unstable {
        /// The nodes that move most in the first ten of them, each node once.
        nodes: Vec<usize>,
    },
    /// It may go on as it is: there are motions that nothing resists.
    Mechanism {
        /// The nodes that move most in the first ten of them, each node once.
        nodes: Vec<usize>,
    },
}

impl Status {
    /// `stable`, `unstable` or `mechanism`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Unstable { .. } => "unstable",
            Self::Mechanism { .. } => "mechanism",
        }
    }
}

/// Unstable equilibria that are left before one is reported.
const MOST_ESCAPES: usize = 20;
/// Directions of which nodes are told.
const MOST_DIRECTIONS: usize = 10;

/// Finds an equilibrium of a scene with the loads of the time 0.
///
/// If forces are balanced at the start, that is it up to rounding, stable or not. From anywhere else it
/// goes downhill in potential energy; where symmetry alone leads to an unstable
/// equilibrium, such as that of a column pressed along its axis, it goes on to one side,
/// as long as that leads down.
///
/// # Errors
///
/// If the scene has problems, or no equilibrium is found.
pub fn settle(scene: &Scene, options: &Options) -> Result<Equilibrium, StaticsError> {
    let system = compile(scene)?;
    let mut equilibrium = settle_system(&system, options)?;
    equilibrium.add_weight_of_supports(scene);
    Ok(equilibrium)
}

/// The scene as it starts: with its nodes in equilibrium, if it
/// [asks for that](springs_scene::Start), and then asking no more. Velocities are as they
/// were. Gives the equilibrium, if one was asked for.
///
/// # Errors
///
/// As [`settle`].
pub fn start(
    scene: &Scene,
    options: &Options,
) -> Result<(Scene, Option<Equilibrium>), StaticsError> {
    let mut started = scene.clone();
    if scene.settings.start == Start::AsGiven {
        return Ok((started, None));
    }
    let equilibrium = settle(scene, options)?;
    equilibrium.write_to(&mut started);
    started.settings.start = Start::AsGiven;
    Ok((started, Some(equilibrium)))
}

/// As [`settle`], of a system, whatever emitters it has; reactions are without the weight
/// of fixed nodes.
///
/// # Errors
///
/// If no equilibrium is found.
pub fn settle_system(system: &System, options: &Options) -> Result<Equilibrium, StaticsError> {
    let mut x = system.initial_positions().to_vec();
    let mut descent = Descent::new(Equations::new(system), options)?;
    let is_start = descent.is_balanced(&x)?;
    if !is_start {
        descent.run(&mut x)?;
    }
    let mut escapes = 0..MOST_ESCAPES;
    let inertia = loop {
        descent.refine(&mut x)?;
        let inertia = descent.inertia(&x)?;
        if is_start || inertia.negative == 0 || escapes.next().is_none() {
            break inertia;
        }
        let Some(beside) = descent.beside(&x) else {
            break inertia;
        };
        x = beside;
        descent.run(&mut x)?;
    };
    Ok(Equilibrium {
        was_balanced: is_start,
        ..judge(&descent, &x, inertia)
    })
}

/// What kind of equilibrium there is at x, where pivots were counted last.
fn judge(descent: &Descent<'_>, x: &[Vector3<f64>], inertia: Inertia) -> Equilibrium {
    let system = descent.equations.system;
    let status = if inertia.negative > 0 {
        let nodes = moving_most(system, descent.factor().negative_directions());
        Status::Unstable { nodes }
    } else if inertia.zero > 0 {
        let nodes = moving_most(system, descent.factor().zero_directions());
        Status::Mechanism { nodes }
    } else {
        Status::Stable
    };
    let mut tensions = Vec::new();
    system.each_tension(x, None, &mut |spring, tension| {
        if tensions.len() <= spring {
            tensions.resize(spring + 1, 0.0);
        }
        tensions[spring] = tension;
    });
    let at_rest = vec![Vector3::zeros(); x.len()];
    let forces = system.support_forces(0.0, x, &at_rest, None);
    let reactions = forces.into_iter().map(|(block, force)| Reaction {
        node: system.numbering().node(block),
        force,
    });
    let mut reactions: Vec<Reaction> = reactions.collect();
    reactions.sort_by_key(|reaction| reaction.node);
    Equilibrium {
        positions: in_node_order(system, x),
        status,
        was_balanced: false,
        residual: largest(&descent.equations.forces(x)).1,
        largest_force: descent.equations.largest_force(x),
        negative_pivots: inertia.negative,
        zero_pivots: inertia.zero,
        iterations: descent.iterations,
        tensions,
        reactions,
    }
}

/// The nodes that move most in some directions, each once, in order.
fn moving_most(system: &System, directions: impl Iterator<Item = Vec<f64>>) -> Vec<usize> {
    let nodes = directions.take(MOST_DIRECTIONS).map(|direction| {
        let (block, _) = largest(vectors(&direction));
        system.numbering().node(block)
    });
    let mut nodes: Vec<usize> = nodes.collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

impl Equilibrium {
    /// What supports carry of the masses of fixed nodes.
    fn add_weight_of_supports(&mut self, scene: &Scene) {
        self.tensions.resize(scene.springs.len(), 0.0);
        let masses = scene.node_masses();
        for reaction in &mut self.reactions {
            if scene.nodes[reaction.node].fixed {
                reaction.force -= scene.gravity * masses[reaction.node];
            }
        }
    }

    /// The scene with its nodes here; velocities are as they were.
    ///
    /// # Panics
    ///
    /// If the scene has another number of nodes.
    pub fn write_to(&self, scene: &mut Scene) {
        assert_eq!(scene.nodes.len(), self.positions.len(), "the same nodes");
        for (node, position) in scene.nodes.iter_mut().zip(&self.positions) {
            if !node.fixed {
                node.position = *position;
            }
        }
    }
}
