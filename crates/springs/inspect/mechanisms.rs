//! Maxwell's count: motions that no change of length resists.

use serde::Serialize;
use springs_scene::{Guide, Scene};
use springs_step::{Islands, Part};
use std::collections::HashSet;

/// A part of the scene with more directions to move in than springs that could resist.
///
/// This is a count (Maxwell 1864) and no rank: a part that is not listed may be a
/// mechanism, too, where springs stand in each other's way. `springs settle` finds out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Mechanism {
    /// The first node of the part.
    pub first_node: usize,
    /// Directions that its free nodes can move in: three each, two in a plane, one on a
    /// line, less what guides hold.
    pub directions: usize,
    /// Pairs of nodes that springs join, at least one of them free.
    pub joined_pairs: usize,
    /// Motions of the whole part as a rigid body, where few fixed nodes or none hold it.
    pub rigid_motions: usize,
    /// At least so many independent motions change no length, rigid ones left out.
    pub motions: usize,
}

/// The parts that are mechanisms by count, those of the most motions first.
pub(super) fn mechanisms(scene: &Scene, islands: &Islands) -> Vec<Mechanism> {
    let parts = islands.parts().iter();
    let mut found: Vec<Mechanism> = parts.filter_map(|part| mechanism(scene, part)).collect();
    found.sort_by_key(|one| (usize::MAX - one.motions, one.first_node));
    found
}

fn mechanism(scene: &Scene, part: &Part) -> Option<Mechanism> {
    let island = part.island();
    let dimension = part.simulation().system().motion().dimension();
    let mut directions = 0;
    let (mut n_fixed, mut has_guides) = (0, false);
    for node in island.nodes.iter().map(|&node| &scene.nodes[node]) {
        has_guides |= node.guide.is_some();
        directions += match node.guide {
            _ if node.fixed => 0,
            None => dimension,
            Some(Guide::Held(axes)) => axes.iter().filter(|is_held| !**is_held).count(),
            Some(Guide::Along(_)) => 1,
        };
        n_fixed += usize::from(node.fixed);
    }
    let mut joined = HashSet::new();
    for spring in island.springs.iter().map(|&spring| &scene.springs[spring]) {
        let [a, b] = spring.nodes;
        if spring.is_elastic() && !(scene.nodes[a].fixed && scene.nodes[b].fixed) {
            joined.insert([a.min(b), a.max(b)]);
        }
    }
    // Nodes without springs move as they like, and are told elsewhere.
    if joined.is_empty() {
        return None;
    }
    let rigid_motions = if has_guides {
        0
    } else {
        rigid_motions(dimension, n_fixed)
    };
    let resisted = joined.len() + rigid_motions;
    (directions > resisted).then(|| Mechanism {
        first_node: island.nodes[0],
        directions,
        joined_pairs: joined.len(),
        rigid_motions,
        motions: directions - resisted,
    })
}

/// Motions of a body that some fixed points leave, if these lie as they mostly do.
fn rigid_motions(dimension: usize, n_fixed: usize) -> usize {
    match (dimension, n_fixed) {
        (3, 0) => 6,
        (3, 1) | (2, 0) => 3,
        (3, 2) | (2, 1) | (1, 0) => 1,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_scene::{Node, Vector3};

    fn found(points: &[([f64; 3], bool)], pairs: &[[usize; 2]]) -> Vec<Mechanism> {
        let mut scene = Scene::default();
        for &(point, fixed) in points {
            let position = Vector3::from(point);
            scene.add_node(Node {
                mass: 1.0,
                fixed,
                ..Node::at(position)
            });
        }
        for &[a, b] in pairs {
            scene.add_spring(a, b, 1.0);
        }
        mechanisms(&scene, &Islands::new(&scene).unwrap())
    }

    /// A quadrilateral of four bars, one side fixed, moves in one way in its plane; a
    /// diagonal stops it.
    #[test]
    fn a_four_bar_linkage_has_one_motion_in_its_plane() {
        let points = [
            ([0.0, 0.0, 0.0], true),
            ([1.0, 0.0, 0.0], true),
            ([1.0, 1.0, 0.0], false),
            ([0.0, 1.0, 0.0], false),
        ];
        let sides = [[1, 2], [2, 3], [3, 0]];
        let found_one = found(&points, &sides);
        assert_eq!(found_one.len(), 1);
        assert_eq!((found_one[0].motions, found_one[0].directions), (1, 4));
        // A second spring of the same nodes resists nothing more.
        assert_eq!(found(&points, &[[1, 2], [2, 3], [3, 0], [3, 2]]), found_one);
        assert_eq!(found(&points, &[[1, 2], [2, 3], [3, 0], [0, 2]]), []);
    }

    /// Free in space, a tetrahedron is rigid; without one of its edges it has a hinge.
    #[test]
    fn a_free_tetrahedron_is_rigid() {
        let points = [
            ([0.0, 0.0, 0.0], false),
            ([1.0, 0.0, 0.0], false),
            ([0.0, 1.0, 0.0], false),
            ([0.0, 0.0, 1.0], false),
        ];
        let edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        assert_eq!(found(&points, &edges), []);
        let hinge = found(&points, &edges[..5]);
        assert_eq!((hinge[0].motions, hinge[0].rigid_motions), (1, 6));
    }
}
