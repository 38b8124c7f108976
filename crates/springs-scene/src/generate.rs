//! Chains, cloths and blocks of springs, one unit long by default, and networks of points.

use crate::{Method, Node, Scene, Settings, StepControl};
use nalgebra::Vector3;

/// What the springs of a generated scene are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// K of every spring, in N/m.
    pub stiffness: f64,
    /// Total mass in kg, shared over the springs in proportion to rest length, or equally
    /// over the nodes of a network.
    pub mass: f64,
    /// Damping c of every spring, in N·s/m.
    pub damping: f64,
    /// Length of the chain, or of an edge of the cloth or block, in m; a network has that of
    /// its points.
    pub size: f64,
}

impl Material {
    /// Of a chain with `springs` springs: K = 1e4·N N/m, 1 kg, 1 m.
    pub fn of_chain(springs: usize) -> Self {
        Self {
            stiffness: 1e4 * springs as f64,
            mass: 1.0,
            damping: 0.0,
            size: 1.0,
        }
    }

    /// Of a cloth: K = 1e3 N/m, 1 kg, 1 m.
    pub fn of_cloth() -> Self {
        Self {
            stiffness: 1e3,
            mass: 1.0,
            damping: 0.0,
            size: 1.0,
        }
    }

    /// Of a block: K = 1e4 N/m, 10 kg, 1 m.
    pub fn of_block() -> Self {
        Self {
            stiffness: 1e4,
            mass: 10.0,
            damping: 0.0,
            size: 1.0,
        }
    }
}

/// Gravity of the generated scenes but networks, in m/s²: downward along z.
pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A chain of `springs` springs along x, hanging from node 0.
///
/// Nodes i = 0…N at (i/N, 0, 0)·size; springs (i, i + 1).
pub fn chain(springs: usize, material: Material) -> Scene {
    let mut scene = empty(format!("chain {springs}"));
    for i in 0..=springs {
        let x = fraction(i, springs) * material.size;
        scene.add_node(Node::at(Vector3::new(x, 0.0, 0.0)));
    }
    scene.nodes[0].fixed = true;
    for i in 0..springs {
        scene.add_spring(i, i + 1, material.stiffness);
    }
    finish(scene, material)
}

/// A level cloth of n × n nodes, hanging from two corners.
///
/// Node j·n + i at (i, j, 0)/(n − 1)·size. Structural springs along the rows
/// and columns, shear springs along both diagonals of every cell, bend springs
/// to the second neighbours along rows and columns. Nodes (0, 0) and (n − 1, 0)
/// are fixed.
pub fn cloth(n: usize, material: Material) -> Scene {
    let mut scene = empty(format!("cloth {n}"));
    let index = |i: usize, j: usize| j * n + i;
    for j in 0..n {
        for i in 0..n {
            let (x, y) = (fraction(i, n.saturating_sub(1)), fraction(j, n - 1));
            scene.add_node(Node::at(Vector3::new(x, y, 0.0) * material.size));
        }
    }
    if n > 0 {
        scene.nodes[index(0, 0)].fixed = true;
        scene.nodes[index(n - 1, 0)].fixed = true;
    }
    // Structural, shear, bend: each as an offset from a node.
    for (di, dj) in [(1, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2)] {
        for j in 0..n {
            for i in 0..n {
                let Some(other_i) = i.checked_add_signed(di) else {
                    continue;
                };
                if other_i < n && j + dj < n {
                    scene.add_spring(index(i, j), index(other_i, j + dj), material.stiffness);
                }
            }
        }
    }
    finish(scene, material)
}

/// A block of n × n × n nodes standing on its lowest layer.
///
/// Node (k·n + j)·n + i at (i, j, k)/(n − 1)·size; springs along the lattice
/// edges and along both diagonals of every lattice face. Layer k = 0 is fixed.
pub fn block(n: usize, material: Material) -> Scene {
    let mut scene = empty(format!("block {n}"));
    let index = |[i, j, k]: [usize; 3]| (k * n + j) * n + i;
    let lattice =
        || (0..n).flat_map(move |k| (0..n).flat_map(move |j| (0..n).map(move |i| [i, j, k])));
    for [i, j, k] in lattice() {
        let corner = Vector3::new(fraction(i, n - 1), fraction(j, n - 1), fraction(k, n - 1));
        scene.add_node(Node {
            fixed: k == 0,
            ..Node::at(corner * material.size)
        });
    }
    const OFFSETS: [[isize; 3]; 9] = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 1, 0],
        [-1, 1, 0],
        [1, 0, 1],
        [-1, 0, 1],
        [0, 1, 1],
        [0, -1, 1],
    ];
    for offset in OFFSETS {
        for cell in lattice() {
            let other: [Option<usize>; 3] =
                std::array::from_fn(|axis| cell[axis].checked_add_signed(offset[axis]));
            if let [Some(i), Some(j), Some(k)] = other
                && i.max(j).max(k) < n
            {
                scene.add_spring(index(cell), index([i, j, k]), material.stiffness);
            }
        }
    }
    finish(scene, material)
}

/// An elastic network: springs between all points, in m, that are no further apart than
/// `cutoff`, in m, at rest as they are; equal masses on the nodes, no gravity. Springs
/// (i, j), i < j, in that order.
pub fn network(points: &[Vector3<f64>], cutoff: f64, material: Material) -> Scene {
    let mut scene = empty(format!("network {}", points.len()));
    scene.gravity = Vector3::zeros();
    let mass = material.mass / points.len() as f64;
    for &point in points {
        scene.add_node(Node {
            mass,
            ..Node::at(point)
        });
    }
    // Those that are near along x follow each other.
    let mut along_x: Vec<usize> = (0..points.len()).collect();
    along_x.sort_by(|&a, &b| points[a].x.total_cmp(&points[b].x));
    let mut pairs = Vec::new();
    for (place, &a) in along_x.iter().enumerate() {
        let later = along_x[place + 1..].iter();
        let near = later.take_while(|&&b| points[b].x - points[a].x <= cutoff);
        let near = near.filter(|&&b| scene.nodes[a].distance(&scene.nodes[b]) <= cutoff);
        pairs.extend(near.map(|&b| [a.min(b), a.max(b)]));
    }
    pairs.sort_unstable();
    for [a, b] in pairs {
        scene.add_spring(a, b, material.stiffness);
    }
    finish(
        scene,
        Material {
            mass: 0.0,
            ..material
        },
    )
}

/// Moves every free node by a random amount, up to `amplitude` in m in each
/// coordinate; the same `seed` gives the same disturbance. Rest lengths stay.
pub fn disturb(scene: &mut Scene, amplitude: f64, seed: u64) {
    let mut random = SplitMix64(seed);
    for node in scene.nodes.iter_mut().filter(|node| !node.fixed) {
        for coordinate in &mut node.position {
            *coordinate += amplitude * (2.0 * random.unit() - 1.0);
        }
    }
}

/// The generator of Steele, Lea and Flood (OOPSLA 2014): small, and the same on
/// every machine.
struct SplitMix64(u64);

impl SplitMix64 {
    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// i/n, or 0 for a single node.
fn fraction(i: usize, n: usize) -> f64 {
    if n == 0 { 0.0 } else { i as f64 / n as f64 }
}

fn empty(name: String) -> Scene {
    Scene {
        name,
        gravity: GRAVITY,
        ..Scene::default()
    }
}

/// One second of the note's own step at 60 steps a second.
fn finish(mut scene: Scene, material: Material) -> Scene {
    scene.share_mass(material.mass);
    for spring in &mut scene.springs {
        spring.damping = material.damping;
    }
    scene.settings = Settings {
        method: Method::LinearlyImplicitEuler,
        step: StepControl::Fixed(1.0 / 60.0),
        ..Settings::default()
    };
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total_mass(scene: &Scene) -> f64 {
        scene.node_masses().iter().sum()
    }

    #[test]
    fn chain_as_defined() {
        let scene = chain(4, Material::of_chain(4));
        assert_eq!(scene.nodes.len(), 5);
        assert_eq!(scene.nodes[3].position, Vector3::new(0.75, 0.0, 0.0));
        assert_eq!(scene.springs.len(), 4);
        assert_eq!(scene.springs[2].nodes, [2, 3]);
        assert_eq!(scene.springs[2].stiffness, 4e4);
        assert_eq!(scene.springs[2].rest_length, 0.25);
        assert!(scene.nodes[0].fixed && !scene.nodes[4].fixed);
        assert!((total_mass(&scene) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn cloth_as_defined() {
        let n = 5;
        let scene = cloth(n, Material::of_cloth());
        assert_eq!(scene.nodes.len(), n * n);
        assert_eq!(
            scene.nodes[2 * n + 3].position,
            Vector3::new(0.75, 0.5, 0.0)
        );
        let structural = 2 * n * (n - 1);
        let shear = 2 * (n - 1) * (n - 1);
        let bend = 2 * n * (n - 2);
        assert_eq!(scene.springs.len(), structural + shear + bend);
        let fixed: Vec<usize> = (0..n * n).filter(|&node| scene.nodes[node].fixed).collect();
        assert_eq!(fixed, [0, n - 1]);
        assert!((total_mass(&scene) - 1.0).abs() < 1e-14);
        assert!(scene.problems().is_empty());
    }

    #[test]
    fn block_as_defined() {
        let n = 4;
        let scene = block(n, Material::of_block());
        assert_eq!(scene.nodes.len(), n * n * n);
        let node = scene.nodes[(3 * n + 2) * n + 1].position;
        assert!((node - Vector3::new(1.0, 2.0, 3.0) / 3.0).norm() < 1e-15);
        let edges = 3 * n * n * (n - 1);
        let diagonals = 3 * 2 * n * (n - 1) * (n - 1);
        assert_eq!(scene.springs.len(), edges + diagonals);
        assert_eq!(scene.nodes.iter().filter(|node| node.fixed).count(), n * n);
        assert!((total_mass(&scene) - 10.0).abs() < 1e-13);
        let mut pairs: Vec<_> = scene.springs.iter().map(|spring| spring.nodes).collect();
        pairs.iter_mut().for_each(|pair| pair.sort_unstable());
        pairs.sort_unstable();
        pairs.dedup();
        assert_eq!(pairs.len(), scene.springs.len(), "no spring stands twice");
    }

    #[test]
    fn networks_join_what_is_near() {
        let points = [[0.0, 0.0, 2.0], [3.0, 0.0, 0.0], [0.0; 3], [-0.5, 1.0, 2.0]];
        let points = points.map(Vector3::from);
        let material = Material {
            stiffness: 7.0,
            ..Material::of_block()
        };
        let scene = network(&points, 2.5, material);
        let pairs: Vec<[usize; 2]> = scene.springs.iter().map(|spring| spring.nodes).collect();
        assert_eq!(pairs, [[0, 2], [0, 3], [2, 3]]);
        assert_eq!(scene.springs[0].rest_length, 2.0);
        assert_eq!(scene.node_masses(), [2.5; 4]);
        assert_eq!(network(&points, 1.0, material).springs.len(), 0);
        assert_eq!(network(&points, 9.0, material).springs.len(), 6);
    }

    #[test]
    fn smallest_sizes_do_not_trip() {
        for n in 0..3 {
            let cloth = cloth(n, Material::of_cloth());
            assert_eq!(cloth.nodes.len(), n * n);
            assert_eq!(block(n, Material::of_block()).nodes.len(), n * n * n);
            assert_eq!(chain(n, Material::of_chain(n)).nodes.len(), n + 1);
        }
        assert_eq!(network(&[], 1.0, Material::of_block()).nodes.len(), 0);
    }

    #[test]
    fn a_disturbance_repeats_and_spares_fixed_nodes() {
        let still = cloth(4, Material::of_cloth());
        let (mut a, mut b) = (still.clone(), still.clone());
        disturb(&mut a, 1e-3, 7);
        disturb(&mut b, 1e-3, 7);
        assert_eq!(a, b);
        assert_eq!(a.springs, still.springs);
        for (disturbed, node) in a.nodes.iter().zip(&still.nodes) {
            let moved = (disturbed.position - node.position).amax();
            assert!(if node.fixed {
                moved == 0.0
            } else {
                moved > 0.0 && moved <= 1e-3
            });
        }
        disturb(&mut b, 1e-3, 8);
        assert_ne!(a, b);
    }
}
