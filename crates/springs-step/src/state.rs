//! Positions and velocities, in the order of the scene and of the unknowns.

use crate::Archive;
use crate::vectors::copy;
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::Scene;

/// Positions (m) and velocities (m/s) of all nodes, in the order of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeStates {
    /// x of each node, in m.
    pub positions: Vec<Vector3<f64>>,
    /// v of each node, in m/s.
    pub velocities: Vec<Vector3<f64>>,
}

impl NodeStates {
    /// Those of the scene at time 0.
    pub fn of(scene: &Scene) -> Self {
        let nodes = || 0..scene.nodes.len();
        Self {
            positions: nodes().map(|node| scene.start_position(node)).collect(),
            velocities: nodes().map(|node| scene.start_velocity(node)).collect(),
        }
    }

    /// The first node with a position or velocity whose square is not a finite
    /// number.
    pub(crate) fn first_not_finite(&self) -> Option<usize> {
        let mut states = self.positions.iter().zip(&self.velocities);
        states.position(|(x, v)| !has_square(x) || !has_square(v))
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.vectors(&mut self.positions);
        archive.vectors(&mut self.velocities);
    }

    /// Writes them into the nodes of a scene, so that it continues from here. Loads and
    /// motions must be those from then on, see [`Scene::shift_time`].
    ///
    /// # Panics
    ///
    /// If the scene has another number of nodes.
    pub fn write_to(&self, scene: &mut Scene) {
        assert_eq!(scene.nodes.len(), self.positions.len(), "the same nodes");
        let states = self.positions.iter().zip(&self.velocities);
        for (index, (position, velocity)) in states.enumerate() {
            let moved = scene.displacement(index, 0.0);
            let node = &mut scene.nodes[index];
            (node.position, node.velocity) = (*position, *velocity);
            if let Some(moved) = moved {
                node.position -= moved.displacement;
                node.velocity -= moved.velocity;
            }
        }
    }
}

/// The global vectors: all blocks in compiled order, the unknowns first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Time since the start, in s.
    pub time: f64,
    /// Positions, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities, in m/s.
    pub v: Vec<Vector3<f64>>,
}

impl State {
    /// That of the scene at time 0.
    pub(crate) fn initial(system: &System) -> Self {
        Self {
            time: 0.0,
            x: system.initial_positions().to_vec(),
            v: system.initial_velocities().to_vec(),
        }
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.real(&mut self.time);
        archive.vectors(&mut self.x);
        archive.vectors(&mut self.v);
    }

    /// Becomes a copy of another state of the same system, within its own memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.time = other.time;
        copy(&other.x, &mut self.x);
        copy(&other.v, &mut self.v);
    }

    /// Collects the nodes into the global vectors; says whether anything
    /// differs from what was there.
    pub(crate) fn gather(&mut self, system: &System, nodes: &NodeStates) -> bool {
        let numbering = system.numbering();
        assert_eq!(nodes.positions.len(), numbering.n_nodes(), "all nodes");
        assert_eq!(nodes.velocities.len(), numbering.n_nodes(), "all nodes");
        let mut differs = false;
        for (block, (x, v)) in self.x.iter_mut().zip(&mut self.v).enumerate() {
            let node = numbering.node(block);
            differs |= *x != nodes.positions[node] || *v != nodes.velocities[node];
            *x = nodes.positions[node];
            *v = nodes.velocities[node];
        }
        differs
    }

    /// Copies the global vectors back to the nodes.
    pub(crate) fn scatter(&self, system: &System, nodes: &mut NodeStates) {
        system.numbering().scatter(&self.x, &mut nodes.positions);
        system.numbering().scatter(&self.v, &mut nodes.velocities);
    }

    /// The kinetic energy of the free blocks, in J, if that and the squares of all
    /// positions and velocities are finite numbers; in one pass.
    pub(crate) fn finite_kinetic_energy(&self, masses: &[f64]) -> Option<f64> {
        let add_square = |sum: Vector3<f64>, x: &Vector3<f64>| sum + x.component_mul(x);
        let squares = self.x.iter().fold(Vector3::zeros(), add_square);
        let moving = masses.iter().zip(&self.v);
        let twice = moving.fold(Vector3::zeros(), |sum: Vector3<f64>, (&mass, v)| {
            sum + v.component_mul(v) * mass
        });
        let kinetic = 0.5 * twice.sum();
        (squares.sum().is_finite() && kinetic.is_finite()).then_some(kinetic)
    }

    /// The first block with a position, or a velocity if it is free, whose square
    /// is not a finite number.
    pub(crate) fn first_not_finite(&self, n_free: usize) -> Option<usize> {
        let is_wrong = |block: &usize| {
            !has_square(&self.x[*block]) || (*block < n_free && !has_square(&self.v[*block]))
        };
        (0..self.x.len()).find(is_wrong)
    }
}

/// Whether the square of a vector is a finite number.
fn has_square(vector: &Vector3<f64>) -> bool {
    vector.norm_squared().is_finite()
}
