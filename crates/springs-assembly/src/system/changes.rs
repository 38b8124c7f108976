//! What may change between steps.

use super::System;
use crate::laws::fading;
use crate::{Lines, SpringNumbers};
use nalgebra::Vector3;
use springs_math::spring::Spring;
use springs_scene::Scene;

impl System {
    /// Stiffnesses, rest lengths and dampings of all springs become those of `scene`. The
    /// pattern of the matrix and what lasts of where the system has been stay.
    ///
    /// Only of a system that [may change](crate::Compilation::may_change), from a scene
    /// that differs in nothing else.
    ///
    /// # Panics
    ///
    /// If the scene has fewer springs.
    pub fn change_springs(&mut self, scene: &Scene) {
        let springs = scene.springs.iter().enumerate();
        let numbers = springs.map(|(index, spring)| SpringNumbers {
            spring: Spring {
                stiffness: spring.stiffness,
                rest_length: spring.rest_length,
            },
            damping: scene.dashpot(index),
            fading: fading(scene, index),
        });
        let numbers: Vec<SpringNumbers> = numbers.collect();
        for emitter in self.emitters.iter_mut().take(Lines::OTHERS) {
            emitter.change_springs(&numbers);
        }
        self.find_bounds();
    }

    /// Sets the forces, in N, that act on the nodes beside all others from now on: loads,
    /// whose work is booked as such. Only of a system that
    /// [may change](crate::Compilation::may_change).
    ///
    /// # Panics
    ///
    /// If there is not one for each node, or the system may not change.
    pub fn set_forces(&mut self, forces: &[Vector3<f64>]) {
        let mut blocks = vec![Vector3::zeros(); forces.len()];
        self.numbering.gather(forces, &mut blocks);
        for emitter in self.emitters.iter_mut().take(Lines::OTHERS) {
            emitter.set_forces(&blocks);
        }
    }
}
