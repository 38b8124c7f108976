//! Changes between steps: springs, forces and how anchors move.

use super::Simulation;
use crate::control::choose::first_step;
use crate::control::controller::Schedule;
use crate::{Archive, SetupError};
use nalgebra::Vector3;
use springs_assembly::Compilation;
use springs_scene::{Path, Problem, RunOptions, Scene};

/// A simulation cannot be changed like this.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// It was compiled for a scene that stays as it is.
    #[error("the simulation was not made to be changed (see Simulation::changeable)")]
    NotChangeable,
    /// There is not one number or vector for each.
    #[error("there are {found} values for {expected} {of}")]
    Count {
        /// Of what, such as "springs".
        of: &'static str,
        /// How many there are.
        expected: usize,
        /// How many values were given.
        found: usize,
    },
    /// A velocity was given to a node that is not fixed.
    #[error("node {node} is not fixed, so its velocity cannot be prescribed")]
    NotFixed {
        /// The node.
        node: usize,
    },
    /// The scene would be wrong.
    #[error(transparent)]
    Problem(#[from] Problem),
}

/// What may be changed, as it is now.
pub(super) struct Controls {
    /// With the springs that act now, and all else as at the start.
    scene: Scene,
    /// Forces that were set, in N, by node.
    forces: Vec<Vector3<f64>>,
    /// Of fixed nodes, in m/s, by node, without those of motions; zero for free ones.
    anchor_velocities: Vec<Vector3<f64>>,
}

impl Controls {
    fn new(scene: &Scene) -> Self {
        let velocity = |node: &springs_scene::Node| {
            if node.fixed {
                node.velocity
            } else {
                Vector3::zeros()
            }
        };
        Self {
            scene: scene.clone(),
            forces: vec![Vector3::zeros(); scene.nodes.len()],
            anchor_velocities: scene.nodes.iter().map(velocity).collect(),
        }
    }

    fn archive(&mut self, archive: &mut Archive) {
        for spring in &mut self.scene.springs {
            archive.real(&mut spring.stiffness);
            archive.real(&mut spring.rest_length);
        }
        archive.vectors(&mut self.forces);
        archive.vectors(&mut self.anchor_velocities);
    }
}

fn count(of: &'static str, expected: usize, found: usize) -> Result<(), ChangeError> {
    if found == expected {
        Ok(())
    } else {
        Err(ChangeError::Count {
            of,
            expected,
            found,
        })
    }
}

impl Simulation {
    /// [`Self::with_options`] of a scene whose springs, forces and anchors may be changed
    /// between steps, by [`Self::set_rest_lengths`] and the like. The pattern of the
    /// matrix stays as it is, and nothing is compiled anew. Nothing is left out: springs
    /// between the same nodes stay apart, and motion is in space.
    ///
    /// What a change does to the energy of springs where they are is
    /// [work](crate::Ledger::control_work) of whoever changes them; that of forces and
    /// anchors is done while they act, and booked as that of loads and anchors. Methods
    /// hear of it as where springs break: those that filter tensions keep them, others
    /// start afresh. A controller of step sizes begins anew with short ones, and `Auto`
    /// compares methods again as soon as their price has changed. Equal steps that trial
    /// runs settled at the start stay as they are.
    ///
    /// States within the last step are to be asked for before a change.
    ///
    /// # Errors
    ///
    /// If the scene is wrong or the method cannot move it.
    pub fn changeable(scene: &Scene, options: &RunOptions) -> Result<Self, SetupError> {
        let compilation = Compilation {
            may_change: true,
            ..Compilation::default()
        };
        let mut simulation = Self::compiled(scene, options, compilation)?;
        simulation.controls = Some(Box::new(Controls::new(scene)));
        Ok(simulation)
    }

    /// The scene with the stiffnesses and rest lengths that act now, and all else as at
    /// the start; `None` if it cannot be changed.
    pub fn changed_scene(&self) -> Option<&Scene> {
        self.controls.as_ref().map(|controls| &controls.scene)
    }

    /// The forces that were set, in N, by node; none if it cannot be changed.
    pub fn set_forces_now(&self) -> &[Vector3<f64>] {
        let controls = self.controls.as_ref();
        controls.map_or(&[], |controls| &controls.forces)
    }

    /// The velocities of fixed nodes without those of motions, in m/s, by node, zero for
    /// free ones; none if it cannot be changed.
    pub fn anchor_velocities(&self) -> &[Vector3<f64>] {
        let controls = self.controls.as_ref();
        controls.map_or(&[], |controls| &controls.anchor_velocities)
    }

    /// Gives each spring of the scene a rest length, in m, from now on. Where a law gives
    /// tensions by strain, the stiffness follows from it.
    ///
    /// # Errors
    ///
    /// If it is not [changeable](Self::changeable), or a spring cannot have that rest
    /// length; then nothing has changed.
    pub fn set_rest_lengths(&mut self, rest_lengths: &[f64]) -> Result<(), ChangeError> {
        self.change_springs(rest_lengths, |scene, index, rest_length| {
            let spring = &mut scene.springs[index];
            spring.rest_length = rest_length;
            let law = spring.law.map(|law| &scene.laws[law]);
            if let Some(own) = law.and_then(|law| law.own_axial_stiffness()) {
                spring.stiffness = own / rest_length;
            }
        })
    }

    /// Gives each spring of the scene a stiffness, in N/m, from now on.
    ///
    /// # Errors
    ///
    /// As [`Self::set_rest_lengths`]; springs whose law gives tensions by itself have no
    /// other stiffness.
    pub fn set_stiffnesses(&mut self, stiffnesses: &[f64]) -> Result<(), ChangeError> {
        self.change_springs(stiffnesses, |scene, index, stiffness| {
            scene.springs[index].stiffness = stiffness;
        })
    }

    /// Sets the force on each node, in N, that acts from now on beside the loads of the
    /// scene, until another one is set.
    ///
    /// # Errors
    ///
    /// If it is not [changeable](Self::changeable), or a force is not finite.
    pub fn set_forces(&mut self, forces: &[Vector3<f64>]) -> Result<(), ChangeError> {
        let controls = self.controls.as_mut().ok_or(ChangeError::NotChangeable)?;
        count("nodes", controls.forces.len(), forces.len())?;
        all_finite("force", forces)?;
        if controls.forces == forces {
            return Ok(());
        }
        controls.forces.copy_from_slice(forces);
        self.end_step();
        self.stepper.change(|system| system.set_forces(forces));
        self.note_change();
        Ok(())
    }

    /// Sets the velocities, in m/s, that fixed nodes have from now on beside the motions
    /// that they follow, by node; those of free nodes must be zero.
    ///
    /// # Errors
    ///
    /// If it is not [changeable](Self::changeable), or a velocity is not finite or of a
    /// free node.
    pub fn set_anchor_velocities(&mut self, v: &[Vector3<f64>]) -> Result<(), ChangeError> {
        let controls = self.controls.as_mut().ok_or(ChangeError::NotChangeable)?;
        let nodes = &controls.scene.nodes;
        count("nodes", nodes.len(), v.len())?;
        all_finite("velocity", v)?;
        let is_wrong = |node: &usize| !nodes[*node].fixed && v[*node] != Vector3::zeros();
        if let Some(node) = (0..nodes.len()).find(is_wrong) {
            return Err(ChangeError::NotFixed { node });
        }
        if controls.anchor_velocities == v {
            return Ok(());
        }
        controls.anchor_velocities.copy_from_slice(v);
        self.end_step();
        self.stepper.set_anchor_velocities(v);
        self.stepper.scatter(&mut self.nodes);
        self.note_change();
        Ok(())
    }

    fn change_springs(
        &mut self,
        numbers: &[f64],
        change: impl Fn(&mut Scene, usize, f64),
    ) -> Result<(), ChangeError> {
        let controls = self.controls.as_mut().ok_or(ChangeError::NotChangeable)?;
        count("springs", controls.scene.springs.len(), numbers.len())?;
        let before = controls.scene.springs.clone();
        for (index, &number) in numbers.iter().enumerate() {
            change(&mut controls.scene, index, number);
        }
        if controls.scene.springs == before {
            return Ok(());
        }
        if let Some(problem) = controls.scene.problem_of_springs() {
            controls.scene.springs = before;
            return Err(problem.into());
        }
        self.end_step();
        let before = self.energy().elastic();
        let controls = self.controls.as_ref().expect("there are some");
        let scene = &controls.scene;
        self.stepper.change(|system| system.change_springs(scene));
        self.books.ledger.control_work += self.energy().elastic() - before;
        self.note_change();
        Ok(())
    }

    /// Forces from here on are others than those that led here.
    fn note_change(&mut self) {
        self.ahead = None;
        if let Schedule::Adaptive(controller) = &mut self.schedule {
            let fastest = self.stepper.system().frequency_bound();
            let short = first_step(controller.duration(), fastest);
            controller.begin_with(short.min(controller.step_size()));
        }
    }

    /// Hands over what was changed, before all else that was compiled with it.
    pub(super) fn archive_controls(&mut self, archive: &mut Archive) {
        let Some(controls) = &mut self.controls else {
            return;
        };
        controls.archive(archive);
        archive.real(&mut self.books.ledger.control_work);
        self.stepper.archive_anchors(archive);
        if archive.is_loading() {
            if controls.scene.problem_of_springs().is_some() {
                return archive.refuse();
            }
            self.stepper.change(|system| {
                system.change_springs(&controls.scene);
                system.set_forces(&controls.forces);
            });
        }
    }
}

/// Of a field of the nodes.
fn all_finite(field: &'static str, vectors: &[Vector3<f64>]) -> Result<(), ChangeError> {
    for (node, vector) in vectors.iter().enumerate() {
        if let Some(&value) = vector.iter().find(|value| !value.is_finite()) {
            let path = Path::Node(node, Some(field));
            return Err(Problem::NotFinite { path, value }.into());
        }
    }
    Ok(())
}
