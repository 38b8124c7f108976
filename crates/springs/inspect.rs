//! What is in a scene, what a run will leave out, and what looks wrong.

use springs_assembly::System;
use springs_scene::{Method, Scene, Spring};
use springs_step::{Choice, Pace};
use std::collections::HashMap;

/// Advice about a scene, as sentences.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inspection {
    /// What a run leaves out, and why that changes nothing.
    pub skipped: Vec<String>,
    /// What is legal but probably not meant.
    pub suspicious: Vec<String>,
}

/// Looks through a sound scene that will be simulated as `choice` says.
pub fn inspect(scene: &Scene, system: &System, choice: &Choice) -> Inspection {
    let mut inspection = Inspection::default();
    list_skipped(scene, choice, &mut inspection.skipped);
    let suspicious = &mut inspection.suspicious;
    list_odd_springs(scene, suspicious);
    list_islands(scene, suspicious);
    list_odd_masses(scene, suspicious);
    list_odd_steps(system, choice, suspicious);
    inspection
}

/// "3 springs", "1 spring".
pub fn count(n: usize, what: &str) -> String {
    match n {
        1 => format!("1 {what}"),
        _ => format!("{n} {what}s"),
    }
}

/// "springs 3, 4, 5 and 12 more".
fn name_them(what: &str, indices: &[usize]) -> String {
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

fn list_skipped(scene: &Scene, choice: &Choice, skipped: &mut Vec<String>) {
    let fixed = scene.nodes.iter().filter(|node| node.fixed).count();
    if fixed > 0 {
        skipped.push(format!(
            "{} unknowns of {}: fixed nodes are prescribed, not solved for",
            3 * fixed,
            count(fixed, "fixed node"),
        ));
    }
    if !choice.has_matrix() {
        skipped.push("all matrices: the method is explicit".to_owned());
    }
    let is_fixed = |spring: &Spring| spring.nodes.iter().all(|&node| scene.nodes[node].fixed);
    let fixed_springs = indices(scene, is_fixed);
    if !fixed_springs.is_empty() {
        skipped.push(format!(
            "forces of {}: both ends are fixed, so they only have energy",
            name_them("spring", &fixed_springs)
        ));
    }
    if scene.springs.iter().all(|spring| spring.damping == 0.0) {
        skipped.push("damping: no spring has any".to_owned());
    }
    if scene.gravity == springs_scene::Vector3::zeros() {
        skipped.push("gravity: there is none".to_owned());
    }
}

fn list_odd_springs(scene: &Scene, suspicious: &mut Vec<String>) {
    let dead = indices(scene, |spring| {
        spring.stiffness == 0.0 && spring.damping == 0.0
    });
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
fn list_islands(scene: &Scene, suspicious: &mut Vec<String>) {
    let mut island: Vec<usize> = (0..scene.nodes.len()).collect();
    fn root(island: &mut [usize], mut node: usize) -> usize {
        while island[node] != node {
            island[node] = island[island[node]];
            node = island[node];
        }
        node
    }
    for spring in &scene.springs {
        let [a, b] = spring.nodes.map(|node| root(&mut island, node));
        island[a.max(b)] = a.min(b);
    }
    let mut held = vec![false; scene.nodes.len()];
    for (node, state) in scene.nodes.iter().enumerate() {
        let root = root(&mut island, node);
        held[root] |= state.fixed;
    }
    let floating: Vec<usize> = (0..scene.nodes.len())
        .filter(|&node| island[node] == node && !held[node])
        .collect();
    if floating.is_empty() || scene.gravity == springs_scene::Vector3::zeros() {
        return;
    }
    suspicious.push(format!(
        "{} with {}: no fixed node holds {}, so gravity makes {} fall for ever",
        count(floating.len(), "part"),
        name_them("node", &floating),
        if floating.len() == 1 { "it" } else { "them" },
        if floating.len() == 1 { "it" } else { "them" },
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

fn list_odd_steps(system: &System, choice: &Choice, suspicious: &mut Vec<String>) {
    let Pace::Fixed(h) = choice.pace else {
        return;
    };
    let frequency = system.frequency_bound();
    let rate = system.damping_rate_bound();
    match choice.method {
        Method::VelocityVerlet if h * frequency > 2.0 => suspicious.push(format!(
            "the step of {h} s may be unstable with {}: the stiffest node allows {:.2e} s",
            choice.method,
            2.0 / frequency
        )),
        Method::VelocityVerlet if h * rate > 2.0 => suspicious.push(format!(
            "the step of {h} s may be unstable with {}: the strongest dashpots allow {:.2e} s",
            choice.method,
            2.0 / rate
        )),
        Method::LinearlyImplicitEuler if h * frequency > 1.0 && frequency.is_finite() => {
            suspicious.push(format!(
                "the step of {h} s does not resolve the fastest vibrations, \
                 which need less than {:.2e} s; the method damps them out",
                1.0 / frequency
            ));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_assembly::compile;
    use springs_scene::generate::{Material, chain};
    use springs_scene::{Node, Vector3};
    use springs_step::choose;

    fn suspicions(scene: &Scene) -> Vec<String> {
        let system = compile(scene).unwrap();
        let choice = choose(scene, &system).unwrap();
        inspect(scene, &system, &choice).suspicious
    }

    #[test]
    fn a_slow_clean_scene_raises_no_suspicion() {
        let mut scene = chain(3, Material::of_chain(3));
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
