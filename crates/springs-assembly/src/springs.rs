//! Springs as force emitters.

use crate::batch::Connections;
use crate::{Evaluation, ForceEmitter, Linearization, Numbering, PACKED, Projection};
use nalgebra::Vector3;
use springs_math::lanes::{LANES, Lane, Separations, tension};
use springs_math::{Separation, spring};
use springs_scene::Scene;
use std::ops::Range;

/// All springs that have a stiffness, evaluated [`LANES`] at a time.
#[derive(Clone, Debug)]
pub struct Springs {
    pub(crate) connections: Connections,
    stiffness: Vec<f64>,
    rest_length: Vec<f64>,
    scene_index: Vec<usize>,
}

/// Springs `start..start + count`, side by side.
struct Group {
    start: usize,
    count: usize,
    stiffness: Lane,
    tension: Lane,
    separations: Separations<3>,
}

impl Springs {
    pub(crate) fn new(scene: &Scene, numbering: &Numbering) -> Self {
        let (connections, order) =
            Connections::new(scene, numbering, |spring| spring.stiffness > 0.0);
        let springs = || order.iter().map(|&index| &scene.springs[index]);
        Self {
            connections,
            stiffness: springs().map(|spring| spring.stiffness).collect(),
            rest_length: springs().map(|spring| spring.rest_length).collect(),
            scene_index: order,
        }
    }

    /// Number of springs in the batch.
    pub fn len(&self) -> usize {
        self.connections.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index in the scene of the spring at `index` of the batch.
    ///
    /// # Panics
    ///
    /// If there is no such spring.
    pub fn scene_index(&self, index: usize) -> usize {
        self.scene_index[index]
    }

    fn material(&self, index: usize) -> spring::Spring {
        spring::Spring {
            stiffness: self.stiffness[index],
            rest_length: self.rest_length[index],
        }
    }

    /// Calls `visit` for all springs of `range`, group by group.
    #[inline(always)]
    fn for_each_group(
        &self,
        range: Range<usize>,
        x: &[Vector3<f64>],
        mut visit: impl FnMut(&Group),
    ) {
        for start in range.clone().step_by(LANES) {
            let count = LANES.min(range.end - start);
            let mut dx = [[0.0; LANES]; 3];
            let mut stiffness = [0.0; LANES];
            let mut rest_length = [0.0; LANES];
            for k in 0..LANES {
                // A short group is filled up with its last spring.
                let index = start + k.min(count - 1);
                let difference = self.connections.difference(index, x);
                for axis in 0..3 {
                    dx[axis][k] = difference[axis];
                }
                stiffness[k] = self.stiffness[index];
                rest_length[k] = self.rest_length[index];
            }
            let separations = Separations::of(&dx);
            visit(&Group {
                start,
                count,
                stiffness,
                tension: tension(&stiffness, &rest_length, &separations.length),
                separations,
            });
        }
    }

    #[inline(always)]
    fn add_group_forces(&self, group: &Group, forces: &mut [Vector3<f64>]) {
        let [x, y, z] = group
            .separations
            .direction
            .map(|u| -> Lane { std::array::from_fn(|k| u[k] * group.tension[k]) });
        for k in 0..group.count {
            let force = Vector3::new(x[k], y[k], z[k]);
            self.connections.add_force(group.start + k, force, forces);
        }
    }

    /// Blocks B of a group times `weight`, spring by spring.
    #[inline(always)]
    fn blocks(
        &self,
        group: &Group,
        tensions: Option<&[f64]>,
        weight: f64,
        project: impl Fn(f64) -> f64,
    ) -> [[f64; 6]; LANES] {
        let tension = match tensions {
            None => group.tension,
            Some(given) => std::array::from_fn(|k| given[group.start + k.min(group.count - 1)]),
        };
        let separations = &group.separations;
        let across = separations.across_stiffness(&group.stiffness, &tension, project);
        let weighted = |lane: &Lane| -> Lane { std::array::from_fn(|k| weight * lane[k]) };
        let (along, across) = (weighted(&group.stiffness), weighted(&across));
        let entries =
            PACKED.map(|(row, column)| separations.block_entry(row, column, &along, &across));
        std::array::from_fn(|k| std::array::from_fn(|entry| entries[entry][k]))
    }

    fn linearize_with(
        &self,
        project: impl Fn(f64) -> f64 + Copy,
        at: &Evaluation<'_>,
        out: &mut Linearization,
    ) {
        let weight = at.weights.stiffness;
        self.for_each_group(self.connections.interior(), at.x, |group| {
            self.add_group_forces(group, &mut out.forces);
            let blocks = self.blocks(group, at.tensions, weight, project);
            for (index, block) in (group.start..).zip(&blocks).take(group.count) {
                self.connections.add_block(index, block, &mut out.matrix);
            }
        });
        self.for_each_group(self.connections.anchored(), at.x, |group| {
            self.add_group_forces(group, &mut out.forces);
            let blocks = self.blocks(group, at.tensions, weight, project);
            for (index, block) in (group.start..).zip(&blocks).take(group.count) {
                self.connections.add_anchored_block(index, block, at.v, out);
            }
        });
    }

    /// T = K(l − l₀) of every spring with a free end, in N; zero for the rest.
    ///
    /// # Panics
    ///
    /// If `tensions` does not have one entry per spring of the batch.
    pub fn tensions(&self, x: &[Vector3<f64>], tensions: &mut [f64]) {
        assert_eq!(tensions.len(), self.len(), "one entry per spring");
        self.for_each_group(self.connections.live(), x, |group| {
            tensions[group.start..][..group.count].copy_from_slice(&group.tension[..group.count]);
        });
    }

    /// The tensions predicted for positions x + h·v, in N: T = K(l − l₀) at `x`
    /// plus K times the linear change of the length.
    ///
    /// # Panics
    ///
    /// If `tensions` does not have one entry per spring of the batch.
    pub fn predict_tensions(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        h: f64,
        tensions: &mut [f64],
    ) {
        self.tensions(x, tensions);
        for (index, tension) in tensions
            .iter_mut()
            .enumerate()
            .take(self.connections.live().end)
        {
            let u = Separation::of(&self.connections.difference(index, x)).direction;
            let change = h * u.dot(&self.connections.difference(index, v));
            *tension += self.stiffness[index] * change;
        }
    }

    /// How many springs with a free end have a negative tension: their own, or
    /// the given one.
    pub fn count_compressed(&self, x: &[Vector3<f64>], tensions: Option<&[f64]>) -> usize {
        let mut count = 0;
        self.for_each_group(self.connections.live(), x, |group| {
            for k in 0..group.count {
                let tension = tensions.map_or(group.tension[k], |given| given[group.start + k]);
                count += usize::from(tension < 0.0 && group.separations.length[k] > 0.0);
            }
        });
        count
    }

    /// Adds the stiffness of each spring, in N/m, to its free blocks.
    pub(crate) fn add_stiffness_sums(&self, sums: &mut [f64]) {
        self.connections.add_to_ends(&self.stiffness, sums);
    }

    /// Power, in W, that the anchors have to give to move against the springs.
    pub(crate) fn anchor_power(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        n_free: usize,
    ) -> f64 {
        self.connections.anchor_power(v, n_free, |index| {
            let dx = self.connections.difference(index, x);
            spring::force(self.material(index), &Vector3::zeros(), &dx)
        })
    }
}

impl ForceEmitter for Springs {
    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let energy = |index| {
            let dx = self.connections.difference(index, x);
            spring::energy(self.material(index), &Vector3::zeros(), &dx)
        };
        (0..self.len()).map(energy).sum()
    }

    fn add_forces(&self, x: &[Vector3<f64>], _v: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for index in self.connections.live() {
            let dx = self.connections.difference(index, x);
            let force = spring::force(self.material(index), &Vector3::zeros(), &dx);
            self.connections.add_force(index, force, forces);
        }
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        match at.projection {
            Projection::None => self.linearize_with(|across| across, at, out),
            Projection::Clamp => self.linearize_with(|across| across.max(0.0), at, out),
            Projection::Absolute => self.linearize_with(f64::abs, at, out),
            Projection::Drop => self.linearize_with(|_| 0.0, at, out),
        }
    }
}
