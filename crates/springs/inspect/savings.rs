//! What a run leaves out because the scene does not need it.

use super::springs::{indices, is_dead};
use super::words::{count, name_them};
use serde::Serialize;
use springs_assembly::Motion;
use springs_scene::{Scene, Spring};
use springs_step::{Islands, Part, Simulation};

/// Something that a run leaves out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Saving {
    /// What was found.
    pub what: String,
    /// What that saves.
    pub saves: String,
    /// When leaving it out changes nothing.
    pub exact: String,
}

/// What a run of the scene leaves out, as it was compiled into `islands`.
pub fn skipped(scene: &Scene, islands: &Islands) -> Vec<Saving> {
    let mut savings = Savings(Vec::new());
    list_forces(scene, &mut savings);
    if !islands.largest().simulation().choice().options.skip {
        return savings.0;
    }
    let systems = || {
        let parts = islands.parts().iter();
        parts.map(|part| part.simulation().stepper().system())
    };
    if islands.parts().len() > 1 {
        savings.add(
            format!(
                "{} that are not coupled",
                count(islands.parts().len(), "part")
            ),
            "one method, step and solver for all: each has its own, and they run side by side"
                .to_owned(),
            "always: the matrix falls apart into theirs",
        );
    }
    let merged: usize = systems().map(springs_assembly::System::n_merged).sum();
    if merged > 0 {
        savings.add(
            format!(
                "{} beside another one between the same nodes",
                count(merged, "spring")
            ),
            format!("{} of {}", count(merged, "spring"), scene.springs.len()),
            "because their rest lengths are the same, so that K = ΣK gives the same force \
             and Hessian, clamped or not; clamped springs are counted as one",
        );
    }
    let unknowns_in = |dimension: usize| -> usize {
        let here = systems()
            .filter(|system| system.n_free() > 0 && system.motion().dimension() == dimension);
        here.map(|system| 3 * system.n_free()).sum()
    };
    for (dimension, where_to) in [(2, "in one plane"), (1, "on one line")] {
        let unknowns = unknowns_in(dimension);
        if unknowns > 0 {
            let left = unknowns / 3 * dimension;
            savings.add(
                format!("nodes, velocities, anchors and gravity {where_to}"),
                format!("{} unknowns of {unknowns} in the systems", unknowns - left),
                "because nothing pushes out of there, so they would be zero; \
                 that the matrix is positive definite across, too, is checked",
            );
        }
    }
    let asleep = islands
        .parts()
        .iter()
        .filter(|part| part.asleep_since() == Some(0.0));
    let asleep: usize = asleep.map(|part| part.island().nodes.len()).sum();
    if asleep > 0 {
        savings.add(
            format!("{} at rest", count(asleep, "node")),
            "all their steps".to_owned(),
            "because nothing moves and nothing pushes, to the last bit",
        );
    }
    list_matrices(islands, &mut savings);
    savings.0
}

/// The list as it grows.
struct Savings(Vec<Saving>);

impl Savings {
    fn add(&mut self, what: String, saves: String, exact: &str) {
        self.0.push(Saving {
            what,
            saves,
            exact: exact.to_owned(),
        });
    }
}

/// Forces that there are none of.
fn list_forces(scene: &Scene, savings: &mut Savings) {
    let is_fixed = |spring: &Spring| spring.nodes.iter().all(|&node| scene.nodes[node].fixed);
    let fixed_springs = indices(scene, is_fixed);
    if !fixed_springs.is_empty() {
        savings.add(
            format!(
                "both ends of {} are fixed",
                name_them("spring", &fixed_springs)
            ),
            format!("the forces of {}", count(fixed_springs.len(), "spring")),
            "always: they only have energy, which is counted",
        );
    }
    let dead = indices(scene, is_dead);
    if !dead.is_empty() {
        savings.add(
            format!(
                "{} without stiffness and damping",
                name_them("spring", &dead)
            ),
            format!("the forces of {}", count(dead.len(), "spring")),
            "always: only mass comes from them, which is counted",
        );
    }
    if !scene.has_dashpots() {
        savings.add(
            "no spring has a damping".to_owned(),
            "the damping matrix and the heat of dashpots".to_owned(),
            "always",
        );
    }
    if scene.gravity == springs_scene::Vector3::zeros() {
        savings.add(
            "there is no gravity".to_owned(),
            "its force".to_owned(),
            "always",
        );
    }
}

/// Matrices that are not needed, or only once.
fn list_matrices(islands: &Islands, savings: &mut Savings) {
    let parts = || islands.parts().iter().map(Part::simulation);
    let unknowns = |wanted: &dyn Fn(&Simulation) -> bool| -> usize {
        let wanted = parts().filter(|part| wanted(part));
        wanted
            .map(|part| 3 * part.stepper().system().n_free())
            .sum()
    };
    let explicit = unknowns(&|part| !part.needs_trials() && !part.choice().has_matrix());
    if explicit > 0 {
        savings.add(
            format!("an explicit method moves {explicit} unknowns"),
            "their matrix and its factorizations".to_owned(),
            "always: the method has none",
        );
    }
    let is_constant = |part: &Simulation| {
        let system = part.stepper().system();
        part.choice().has_constant_matrix(system)
    };
    let constant = unknowns(&is_constant);
    if constant > 0 {
        savings.add(
            format!("the matrix of {constant} unknowns depends on the step size alone"),
            "all factorizations but those where the step size changes".to_owned(),
            "because rest lengths are zero or motion is on a line, without dashpots",
        );
    }
    let is_isotropic = |part: &Simulation| {
        let system = part.stepper().system();
        let is_line = matches!(system.motion(), Motion::Line(_));
        part.choice().has_isotropic_matrix(system) && !is_line
    };
    let isotropic = unknowns(&is_isotropic);
    if isotropic > 0 {
        savings.add(
            "all rest lengths are zero".to_owned(),
            format!("one matrix of {} unknowns serves x, y and z", isotropic / 3),
            "because every block is K·I",
        );
    }
}
