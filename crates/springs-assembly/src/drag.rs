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
    /// Of the nodes of a scene, where it is not zero.
    pub(crate) fn of_nodes(drags: Vec<f64>) -> Terms<1, Self> {
        let drags = drags.into_iter().enumerate();
        let drags = drags.filter(|(_, damping)| *damping > 0.0);
        Terms::new(
            "drag",
            drags.map(|(node, damping)| ([node], Self { damping })),
        )
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
