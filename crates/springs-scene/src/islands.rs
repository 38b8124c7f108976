//! Parts of a scene that are not coupled.

use crate::{Output, Scene};

/// Nodes and springs that act on each other, by their indices in the scene,
/// ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Island {
    /// Its free nodes, and the fixed nodes that its springs are held by.
    pub nodes: Vec<usize>,
    /// Its springs.
    pub springs: Vec<usize>,
}

/// A scene cut apart. Fixed nodes belong to every island that they hold, since
/// nothing passes through them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Partition {
    /// Free nodes that springs connect, in the order of their first nodes.
    pub connected: Vec<Island>,
    /// Free nodes without a spring.
    pub loose: Vec<usize>,
    /// Springs between fixed nodes with their ends, and fixed nodes without a
    /// spring.
    pub fixed: Island,
}

impl Scene {
    /// Cuts the scene into parts that are not coupled.
    ///
    /// # Panics
    ///
    /// If a spring joins a node that does not exist.
    pub fn islands(&self) -> Partition {
        let mut roots: Vec<usize> = (0..self.nodes.len()).collect();
        let is_free = |node: &usize| !self.nodes[*node].fixed;
        for spring in &self.springs {
            if spring.nodes.iter().all(is_free) {
                let [a, b] = spring.nodes.map(|node| root(&mut roots, node));
                roots[a.max(b)] = a.min(b);
            }
        }
        let mut has_spring = vec![false; self.nodes.len()];
        for node in self.springs.iter().flat_map(|spring| spring.nodes) {
            has_spring[node] = true;
        }
        let mut islands = Partition::default();
        // Island of each root.
        let mut island_of = vec![usize::MAX; self.nodes.len()];
        for (node, state) in self.nodes.iter().enumerate() {
            match (state.fixed, has_spring[node]) {
                (true, false) => islands.fixed.nodes.push(node),
                (true, true) => {}
                (false, false) => islands.loose.push(node),
                (false, true) => {
                    let root = root(&mut roots, node);
                    if island_of[root] == usize::MAX {
                        island_of[root] = islands.connected.len();
                        islands.connected.push(Island::default());
                    }
                    islands.connected[island_of[root]].nodes.push(node);
                }
            }
        }
        for (index, spring) in self.springs.iter().enumerate() {
            let island = match spring.nodes.iter().copied().find(is_free) {
                Some(node) => &mut islands.connected[island_of[root(&mut roots, node)]],
                None => &mut islands.fixed,
            };
            island.springs.push(index);
            let held = spring.nodes.iter().filter(|node| !is_free(node));
            island.nodes.extend(held);
        }
        for island in islands.connected.iter_mut().chain([&mut islands.fixed]) {
            island.nodes.sort_unstable();
            island.nodes.dedup();
        }
        islands
    }

    /// The part of the scene with the nodes and springs of an island, without what a run is
    /// to show.
    ///
    /// # Panics
    ///
    /// If a spring of it joins a node that is not in it, or has a law that does not exist.
    pub fn part(&self, island: &Island) -> Self {
        let here = |node: usize| {
            let found = island.nodes.binary_search(&node);
            found.expect("a node of the island")
        };
        let springs = island.springs.iter().map(|&spring| crate::Spring {
            nodes: self.springs[spring].nodes.map(here),
            ..self.springs[spring]
        });
        let mut springs: Vec<crate::Spring> = springs.collect();
        let laws = self.laws_of(&mut springs);
        let loads = self.loads_on(island).into_iter().map(|load| {
            let nodes = self.loads[load].nodes.iter();
            let here = nodes.filter_map(|node| island.nodes.binary_search(node).ok());
            crate::Load {
                nodes: here.collect(),
                ..self.loads[load].clone()
            }
        });
        Self {
            name: self.name.clone(),
            gravity: self.gravity,
            nodes: island.nodes.iter().map(|&node| self.nodes[node]).collect(),
            springs,
            laws,
            loads: loads.collect(),
            motions: self.motions.clone(),
            drag: self.drag,
            damping: self.damping,
            settings: self.settings,
            output: Output::default(),
        }
    }
}

impl Scene {
    /// The laws that some springs have, and their places among these for each.
    fn laws_of(&self, springs: &mut [crate::Spring]) -> Vec<crate::SpringLaw> {
        let mut used: Vec<usize> = springs.iter().filter_map(|spring| spring.law).collect();
        used.sort_unstable();
        used.dedup();
        for law in springs.iter_mut().filter_map(|spring| spring.law.as_mut()) {
            *law = used.binary_search(law).expect("one that is used");
        }
        used.into_iter().map(|law| self.laws[law].clone()).collect()
    }

    /// The loads that act on nodes of an island: their indices, ascending.
    pub fn loads_on(&self, island: &Island) -> Vec<usize> {
        let is_there = |node: &usize| island.nodes.binary_search(node).is_ok();
        let acts = |load: &usize| self.loads[*load].nodes.iter().any(is_there);
        (0..self.loads.len()).filter(acts).collect()
    }
}

fn root(roots: &mut [usize], mut node: usize) -> usize {
    while roots[node] != node {
        roots[node] = roots[roots[node]];
        node = roots[node];
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Node, Vector3};

    #[test]
    fn fixed_nodes_do_not_connect() {
        let mut scene = Scene::default();
        for node in 0..8 {
            let position = Vector3::x() * f64::from(node);
            scene.add_node(match node {
                0 | 3 | 7 => Node::fixed(position),
                _ => Node::at(position),
            });
        }
        for [a, b] in [[0, 1], [1, 2], [0, 4], [3, 0]] {
            scene.add_spring(a, b, 1.0);
        }
        let islands = scene.islands();
        let island = |nodes: &[usize], springs: &[usize]| Island {
            nodes: nodes.to_vec(),
            springs: springs.to_vec(),
        };
        let connected = vec![island(&[0, 1, 2], &[0, 1]), island(&[0, 4], &[2])];
        assert_eq!(islands.connected, connected);
        assert_eq!(islands.loose, [5, 6]);
        assert_eq!(islands.fixed, island(&[0, 3, 7], &[3]));

        let part = scene.part(&islands.connected[1]);
        assert_eq!(part.nodes, [scene.nodes[0], scene.nodes[4]]);
        assert_eq!(part.springs[0].nodes, [0, 1]);
    }

    #[test]
    fn parts_have_the_laws_of_their_springs() {
        let mut scene = Scene::default();
        for node in 0..4 {
            scene.add_node(Node::at(Vector3::x() * f64::from(node)));
        }
        let exponents = [1.0, 2.0, 3.0].map(|exponent| crate::SpringLaw::Power { exponent });
        scene.laws = exponents.to_vec();
        for ([a, b], law) in [
            ([0, 1], Some(2)),
            ([1, 0], Some(0)),
            ([2, 3], Some(2)),
            ([2, 3], None),
        ] {
            let spring = scene.add_spring(a, b, 1.0);
            scene.springs[spring].law = law;
        }
        let parts: Vec<Scene> = scene
            .islands()
            .connected
            .iter()
            .map(|i| scene.part(i))
            .collect();
        let of =
            |part: &Scene| -> Vec<_> { part.springs.iter().map(|spring| spring.law).collect() };
        assert_eq!(of(&parts[0]), [Some(1), Some(0)]);
        assert_eq!(parts[0].laws, [exponents[0].clone(), exponents[2].clone()]);
        assert_eq!(of(&parts[1]), [Some(0), None]);
        assert_eq!(parts[1].laws, [exponents[2].clone()]);
    }
}
