//! A frame that moves along with a system.

use nalgebra::Vector3;
use springs_assembly::System;

/// Velocities relative to one that all coupled nodes have in common.
///
/// An iterative solution is precise relative to its size. If that is velocities,
/// what all have in common must not count: the motion within is what matters.
pub(crate) struct MovingFrame {
    /// Whether each free block has a spring or a dashpot. The others are solved
    /// without iteration and stay as they are.
    is_coupled: Vec<bool>,
    velocity: Vector3<f64>,
    /// Velocities of all blocks in the frame, in m/s.
    pub(crate) relative: Vec<Vector3<f64>>,
}

impl MovingFrame {
    pub(crate) fn new(system: &System) -> Self {
        let mut is_coupled = vec![false; system.n_free()];
        for pair in system.pattern().pairs() {
            pair.iter()
                .for_each(|&block| is_coupled[block as usize] = true);
        }
        for [free, _] in system.anchored() {
            is_coupled[free] = true;
        }
        Self {
            is_coupled,
            velocity: Vector3::zeros(),
            relative: vec![Vector3::zeros(); system.numbering().n_nodes()],
        }
    }

    /// Moves with the fixed blocks that springs or dashpots join to free ones, in
    /// the mean of these joints, or else with the center of mass of the coupled
    /// blocks. `v` are the velocities of all blocks.
    pub(crate) fn enter(&mut self, system: &System, v: &[Vector3<f64>]) {
        let (mut weight, mut sum) = (0.0, Vector3::zeros());
        for [_, fixed] in system.anchored() {
            weight += 1.0;
            sum += v[fixed];
        }
        if weight == 0.0 {
            let free = system.masses().iter().zip(v).zip(&self.is_coupled);
            for ((mass, v), _) in free.filter(|(_, is_coupled)| **is_coupled) {
                weight += mass;
                sum += v * *mass;
            }
        }
        self.velocity = if weight > 0.0 && system.may_all_have(&(sum / weight)) {
            sum / weight
        } else {
            Vector3::zeros()
        };
        for (relative, v) in self.relative.iter_mut().zip(v) {
            *relative = v - self.velocity;
        }
        for (block, _) in self.is_coupled.iter().enumerate().filter(|(_, is)| !**is) {
            self.relative[block] = v[block];
        }
    }

    /// Makes velocities of free blocks in the frame those at rest.
    pub(crate) fn leave(&self, velocities: &mut [Vector3<f64>]) {
        let velocities = velocities.iter_mut().zip(&self.is_coupled);
        for (v, _) in velocities.filter(|(_, is_coupled)| **is_coupled) {
            *v += self.velocity;
        }
    }
}
