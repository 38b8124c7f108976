//! Drag on nodes.

use crate::{Term, Terms};
use nalgebra::{Matrix3, Vector3};

/// The force −b v on a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drag {
    /// b, in N·s/m.
    pub(crate) damping: f64,
}

impl Drag {
    /// The same on all nodes given; nothing if b is zero.
    pub(crate) fn on(nodes: impl Iterator<Item = usize>, damping: f64) -> Terms<1, Self> {
        let nodes = nodes.filter(|_| damping > 0.0);
        Terms::new("drag", nodes.map(|node| ([node], Self { damping })))
    }
}

impl Term<1> for Drag {
    fn energy(&self, _x: &[Vector3<f64>; 1]) -> f64 {
        0.0
    }

    fn forces(&self, _x: &[Vector3<f64>; 1]) -> [Vector3<f64>; 1] {
        [Vector3::zeros()]
    }

    fn hessian(&self, _x: &[Vector3<f64>; 1]) -> [[Matrix3<f64>; 1]; 1] {
        [[Matrix3::zeros()]]
    }

    fn largest_stiffness(&self) -> f64 {
        0.0
    }

    fn is_damped(&self) -> bool {
        true
    }

    fn is_central(&self) -> bool {
        true
    }

    fn damping_forces(&self, _x: &[Vector3<f64>; 1], [v]: &[Vector3<f64>; 1]) -> [Vector3<f64>; 1] {
        [v * -self.damping]
    }

    fn damping(&self, _x: &[Vector3<f64>; 1], _v: &[Vector3<f64>; 1]) -> [[Matrix3<f64>; 1]; 1] {
        [[Matrix3::identity() * self.damping]]
    }

    fn largest_damping(&self) -> f64 {
        self.damping
    }
}
