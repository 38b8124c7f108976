//! What is in a scene, what a run will leave out, and what looks wrong.

use crate::proportions;
use springs_assembly::Motion;
use springs_scene::{Scene, Spring};
use springs_step::{Islands, Pace, Part, Simulation};
use std::collections::HashMap;

/// Something that a run leaves out.
#[derive(Clone, Debug, PartialEq, Eq)]
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

fn is_dead(spring: &Spring) -> bool {
    !spring.is_elastic() && spring.damping == 0.0
}

/// What is legal but probably not meant, as sentences.
pub fn suspicious(scene: &Scene, islands: &Islands) -> Vec<String> {
    let mut suspicious = Vec::new();
    list_odd_springs(scene, &mut suspicious);
    list_floating(scene, &mut suspicious);
    list_odd_masses(scene, &mut suspicious);
    proportions::list(scene, &mut suspicious);
    // The part with the fastest vibrations has the most to say about steps.
    let frequency = |part: &&Simulation| part.stepper().system().frequency_bound();
    let parts = islands.parts().iter().map(Part::simulation);
    let fastest = parts.max_by(|a, b| frequency(a).total_cmp(&frequency(b)));
    fastest
        .into_iter()
        .for_each(|part| list_odd_steps(part, &mut suspicious));
    suspicious
}

/// "3 springs", "1 spring".
pub fn count(n: usize, what: &str) -> String {
    match n {
        1 => format!("1 {what}"),
        _ => format!("{n} {what}s"),
    }
}

/// "springs 3, 4, 5 and 12 more".
pub(crate) fn name_them(what: &str, indices: &[usize]) -> String {
    const NAMED: usize = 3;
    let named: Vec<String> = indices.iter().take(NAMED).map(usize::to_string).collect();
    let list = named.join(", ");
    match indices.len() {
        1 => format!("{what} {list}"),
        n if n <= NAMED => format!("{what}s {list}"),
        n => format!("{what}s {list} and {} more", n - NAMED),
    }
}

fn indices(scene: &Scene, wanted: impl Fn(&Spring) -> bool) -> Vec<usize> {
    let springs = scene.springs.iter().enumerate();
    springs
        .filter_map(|(index, spring)| wanted(spring).then_some(index))
        .collect()
}

fn list_odd_springs(scene: &Scene, suspicious: &mut Vec<String>) {
    let dead = indices(scene, is_dead);
    if !dead.is_empty() {
        suspicious.push(format!(
            "{} without stiffness and damping: only mass comes from them",
            name_them("spring", &dead)
        ));
    }
    let length = |spring: &Spring| {
        let [a, b] = spring.nodes.map(|node| scene.nodes[node].position);
        (a - b).norm()
    };
    let coincident = indices(scene, |spring| {
        length(spring) == 0.0 && spring.rest_length > 0.0
    });
    if !coincident.is_empty() {
        suspicious.push(format!(
            "{}: the two nodes coincide but the rest length is not zero, \
             so the spring has no direction and pushes nowhere",
            name_them("spring", &coincident)
        ));
    }
    let strained = indices(scene, |spring| {
        spring.rest_length > 0.0 && (length(spring) / spring.rest_length - 1.0).abs() > 0.5
    });
    if !strained.is_empty() {
        suspicious.push(format!(
            "{}: more than 50 % longer or shorter than at rest when the run starts",
            name_them("spring", &strained)
        ));
    }
    let mut first_of_pair: HashMap<[usize; 2], usize> = HashMap::new();
    let duplicates: Vec<usize> = (0..scene.springs.len())
        .filter(|&index| {
            let [a, b] = scene.springs[index].nodes;
            let pair = [a.min(b), a.max(b)];
            *first_of_pair.entry(pair).or_insert(index) != index
        })
        .collect();
    if !duplicates.is_empty() {
        suspicious.push(format!(
            "{}: another spring joins the same two nodes already; their forces add up",
            name_them("spring", &duplicates)
        ));
    }
}

/// Parts of the scene that nothing holds.
fn list_floating(scene: &Scene, suspicious: &mut Vec<String>) {
    if scene.gravity == springs_scene::Vector3::zeros() {
        return;
    }
    let islands = scene.islands();
    let is_free = |&&node: &&usize| !scene.nodes[node].fixed;
    let connected = islands.connected.iter();
    let floating = connected.filter(|island| island.nodes.iter().all(|node| is_free(&node)));
    let mut floating: Vec<usize> = floating.map(|island| island.nodes[0]).collect();
    floating.extend(&islands.loose);
    floating.sort_unstable();
    if floating.is_empty() {
        return;
    }
    let them = if floating.len() == 1 { "it" } else { "them" };
    suspicious.push(format!(
        "{} with {}: no fixed node holds {them}, so gravity makes {them} fall for ever",
        count(floating.len(), "part"),
        name_them("node", &floating),
    ));
}

fn list_odd_masses(scene: &Scene, suspicious: &mut Vec<String>) {
    let masses = scene.node_masses();
    let free = || (0..scene.nodes.len()).filter(|&node| !scene.nodes[node].fixed);
    let massless: Vec<usize> = free().filter(|&node| masses[node] == 0.0).collect();
    if !massless.is_empty() {
        suspicious.push(format!(
            "{} free but without mass: only springs hold {}, and explicit methods refuse {}",
            name_them("node", &massless),
            if massless.len() == 1 { "it" } else { "them" },
            if massless.len() == 1 { "it" } else { "them" },
        ));
    }
    let heavy = || free().filter(|&node| masses[node] > 0.0);
    let by_mass = |a: &usize, b: &usize| masses[*a].total_cmp(&masses[*b]);
    if let (Some(light), Some(heavy)) = (heavy().min_by(by_mass), heavy().max_by(by_mass)) {
        let ratio = masses[heavy] / masses[light];
        if ratio > 1e6 {
            suspicious.push(format!(
                "node {heavy} is {ratio:.1e} times as heavy as node {light}; is a unit wrong?"
            ));
        }
    }
}

fn list_odd_steps(simulation: &Simulation, suspicious: &mut Vec<String>) {
    let (system, choice) = (simulation.stepper().system(), simulation.choice());
    let Pace::Fixed(h) = choice.pace else {
        return;
    };
    let Some(row) = choice.properties() else {
        return;
    };
    let method = choice.method;
    let frequency = system.frequency_bound();
    if let Some(angle) = row.stable_angle {
        let rate = system.damping_rate_bound();
        for (bound, what) in [
            (frequency, "stiffest node allows"),
            (rate, "strongest dashpots allow"),
        ] {
            if h * bound > angle && bound.is_finite() {
                suspicious.push(format!(
                    "the step of {h} s may be unstable with {method}: the {what} {:.2e} s",
                    angle / bound
                ));
                return;
            }
        }
    } else if row.order == 1 && h * frequency > 1.0 && frequency.is_finite() {
        suspicious.push(format!(
            "the step of {h} s does not resolve the fastest vibrations, \
             which need less than {:.2e} s; the method damps them out",
            1.0 / frequency
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_scene::generate::{Material, chain};
    use springs_scene::{Node, Vector3};

    fn suspicions(scene: &Scene) -> Vec<String> {
        suspicious(scene, &Islands::new(scene).unwrap())
    }

    #[test]
    fn a_slow_clean_scene_raises_no_suspicion() {
        let mut scene = chain(3, Material::of_chain(3));
        scene.gravity *= 1e-4;
        scene
            .springs
            .iter_mut()
            .for_each(|spring| spring.stiffness = 1.0);
        assert_eq!(suspicions(&scene), Vec::<String>::new());
    }

    #[test]
    fn every_oddity_is_named() {
        let mut scene = chain(3, Material::of_chain(3));
        scene.add_spring(2, 1, 50.0);
        let dead = scene.add_spring(0, 3, 0.0);
        scene.springs[dead].rest_length = 0.1;
        let loose = scene.add_node(Node::at(Vector3::x()));
        let other = scene.add_node(Node {
            mass: 1e9,
            ..Node::at(Vector3::x())
        });
        let spring = scene.add_spring(loose, other, 10.0);
        scene.springs[spring].rest_length = 1.0;
        let said = suspicions(&scene).join("\n");
        for part in [
            "spring 4 without stiffness",
            "spring 5: the two nodes coincide",
            "springs 4, 5: more than 50 %",
            "spring 3: another spring",
            "1 part with node 4",
            "node 4 free but without mass",
            "node 5 is",
        ] {
            assert!(said.contains(part), "{part} in:\n{said}");
        }
    }
}
