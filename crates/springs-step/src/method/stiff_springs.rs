//! The springs that steps of some size do not resolve, and a system of these alone.

use crate::implicit::linear::LinearSystem;
use crate::implicit::solver_options::Hessian;
use nalgebra::Vector3;
use springs_assembly::{Motion, System, SystemPart};
use springs_scene::RunOptions;
use springs_solver::{Interrupt, SolveError};

/// Of the springs at a node of mass m those are soft, the softest first, whose stiffnesses
/// add up to h²·(2/m)·ΣK ≤ this: what they do by themselves is stable with explicit steps
/// up to 4.
const LIMIT: f64 = 2.0;
/// A matrix with fewer springs is worth having if it has no more than this part of all.
const WORTH_IT: f64 = 0.5;
/// Springs are of one kind if their stiffnesses over masses are within this factor.
const OF_ONE_KIND: f64 = 30.0;

/// A system of stiff springs with its solver.
pub(super) struct StiffSprings {
    pub(super) system: System,
    pub(super) linear: LinearSystem,
    /// As [`stiff_springs`] gave it.
    pub(super) kept: Vec<bool>,
    /// Which number that methods may carry each of its tensions is in the whole system.
    of_whole: Vec<u32>,
    /// Tensions that the matrix is made with, in N, and then those that the step predicts.
    pub(super) tensions: Vec<f64>,
}

impl StiffSprings {
    /// `None` if they cannot be told apart from the rest.
    pub(super) fn new(
        system: &System,
        kept: Vec<bool>,
        options: &RunOptions,
        interrupt: &Interrupt,
    ) -> Result<Option<Self>, SolveError> {
        let Some(SystemPart { system, of_whole }) = system.part(&kept) else {
            return Ok(None);
        };
        let mut linear = LinearSystem::with_factor(&system, Hessian::Altered, options)?;
        linear.set_interrupt(interrupt);
        Ok(Some(Self {
            tensions: vec![0.0; of_whole.len()],
            system,
            linear,
            kept,
            of_whole,
        }))
    }

    /// Takes their tensions from those of all springs, in N.
    pub(super) fn take_tensions(&mut self, of_all: &[f64]) {
        for (tension, &whole) in self.tensions.iter_mut().zip(&self.of_whole) {
            *tension = of_all[whole as usize];
        }
    }

    /// Puts the tensions of all springs, in N, at positions `x`: these as predicted for
    /// x + `time`·v, the others as they are there.
    pub(super) fn predict_tensions(
        &mut self,
        whole: &System,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        time: f64,
        of_all: &mut [f64],
    ) {
        self.system.predict_carried(x, v, time, &mut self.tensions);
        whole.carried(x, of_all);
        for (tension, &whole) in self.tensions.iter().zip(&self.of_whole) {
            of_all[whole as usize] = *tension;
        }
    }
}

/// Whether stiffnesses over masses are about the same everywhere, so that all springs are
/// stiff or none is.
pub(crate) fn is_of_one_kind(system: &System) -> bool {
    let masses = system.masses();
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    system.each_carried_term(|blocks, stiffness| {
        for &block in blocks {
            let per_mass = stiffness / masses[block as usize];
            (least, most) = (least.min(per_mass), most.max(per_mass));
        }
    });
    most <= OF_ONE_KIND * least
}

/// For every number that methods may carry, whether its spring is stiff for steps of size
/// `h`, in s; `None` where a matrix of these alone is not worth having or not possible.
///
/// A spring is soft if at both ends it and all that are not stiffer are, so that neither
/// order nor names matter.
pub(crate) fn stiff_springs(system: &System, h: f64) -> Option<Vec<bool>> {
    let is_whole = system.is_damped() || system.has_memory() || system.guided().next().is_some();
    if is_whole || matches!(system.motion(), Motion::Line(_)) || is_of_one_kind(system) {
        return None;
    }
    let masses = system.masses();
    let mut of_blocks: Vec<Vec<f64>> = vec![Vec::new(); system.n_free()];
    system.each_carried_term(|blocks, stiffness| {
        for &block in blocks {
            of_blocks[block as usize].push(stiffness);
        }
    });
    // Up to which stiffness springs are soft at each block.
    let limits: Vec<f64> = of_blocks
        .iter_mut()
        .zip(masses)
        .map(|(stiffnesses, mass)| {
            stiffnesses.sort_unstable_by(f64::total_cmp);
            let (mut limit, mut sum) = (0.0, 0.0);
            for same in stiffnesses.chunk_by(|a, b| a == b) {
                sum += same.iter().sum::<f64>();
                if 2.0 * h * h * sum > LIMIT * mass {
                    break;
                }
                limit = same[0];
            }
            limit
        })
        .collect();
    let (mut stiff, mut n_free, mut n_stiff) = (Vec::new(), 0, 0);
    system.each_carried_term(|blocks, stiffness| {
        let is_stiff = blocks
            .iter()
            .any(|&block| stiffness > limits[block as usize]);
        stiff.push(is_stiff);
        n_free += usize::from(!blocks.is_empty());
        n_stiff += usize::from(is_stiff);
    });
    let is_worth_it = n_stiff > 0 && n_stiff as f64 <= WORTH_IT * n_free as f64;
    is_worth_it.then_some(stiff)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use springs_assembly::compile;
    use springs_scene::{Node, Scene};

    /// A row of bars joined by cables, between two anchors.
    fn bars(n: u32, bar: f64, cable: f64) -> Scene {
        let mut scene = Scene::default();
        for i in 0..=n {
            scene.add_node(Node {
                fixed: i == 0 || i == n,
                mass: 1.0,
                ..Node::at(Vector3::new(f64::from(i), 0.1 * f64::from(i % 3), 0.0))
            });
        }
        for i in 0..n as usize {
            scene.add_spring(i, i + 1, if i % 3 == 1 { bar } else { cable });
        }
        scene
    }

    #[test]
    fn springs_that_steps_do_not_resolve_are_stiff() {
        let system = compile(&bars(9, 1e6, 1e2)).unwrap();
        let stiff = |h: f64| stiff_springs(&system, h);
        let found = stiff(1e-2).unwrap();
        assert_eq!(found.iter().filter(|&&is| is).count(), 3);
        let part = system.part(&found).unwrap();
        assert_eq!(part.system.n_carried(), 3);
        assert_eq!(part.system.pattern().pairs().len(), 3);
        assert!(part.of_whole.iter().all(|&whole| found[whole as usize]));
        // Neither where all are stiff nor where none is.
        assert_eq!(stiff(1.0), None);
        assert_eq!(stiff(1e-4), None);
        // Of one kind.
        assert_eq!(
            stiff_springs(&compile(&bars(9, 1e3, 1e2)).unwrap(), 0.03),
            None
        );
    }
}
