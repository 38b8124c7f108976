//! A bound on the lowest frequency without a factorization: Rayleigh and Ritz.

use nalgebra::{DMatrix, SymmetricEigen, Vector3};
use springs_assembly::{Evaluation, Motion, System, Weights};
use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_2;

/// Below this part of the largest frequency squared a motion is one that nothing resists:
/// rounding of lengths leaves so much.
const ZERO: f64 = 1e-13;

/// A shape that is this part of others, or less, adds nothing to them.
const DEPENDENT: f64 = 1e-8;

/// A bound from above on the lowest angular frequency of a system about its initial
/// positions, in rad/s; `None` where nothing holds it, or nothing has a mass. Zero if nothing resists a
/// motion; −κ if one grows as e^{κt}.
///
/// It is the least of Rayleigh's quotients uᵀK u / uᵀM u over the shapes that are, along
/// the axes of the [motion](System::motion), d or sin(π d / 2 d_max) in the number d of
/// couplings between a node and the next one that is held: six products with K.
pub fn lowest_frequency_bound(system: &System) -> Option<f64> {
    let distances = distances_from_supports(system)?;
    let masses = system.masses();
    let furthest = f64::from(*distances.iter().max()?);
    let profiles: [&dyn Fn(f64) -> f64; 2] =
        [&|d| d / furthest, &|d| (FRAC_PI_2 * d / furthest).sin()];
    let axes = match system.motion() {
        Motion::Space => vec![Vector3::x(), Vector3::y(), Vector3::z()],
        Motion::Plane(axes) => axes.to_vec(),
        Motion::Line(axis) => vec![axis],
    };
    let inner = |a: &[Vector3<f64>], b: &[Vector3<f64>]| -> f64 {
        let terms = a.iter().zip(b).zip(masses);
        terms.map(|((a, b), mass)| mass * a.dot(b)).sum()
    };
    // Orthonormal in the mass.
    let mut shapes: Vec<Vec<Vector3<f64>>> = Vec::new();
    for profile in profiles {
        for axis in &axes {
            let along = |d: &u32| axis * profile(f64::from(*d));
            let mut shape: Vec<_> = distances.iter().map(along).collect();
            system.project_onto_guides(&mut shape);
            let before = inner(&shape, &shape);
            // Twice, since once leaves rounding.
            for other in shapes.iter().chain(&shapes) {
                let part = inner(&shape, other);
                let terms = shape.iter_mut().zip(other);
                terms.for_each(|(shape, other)| *shape -= part * other);
            }
            let left = inner(&shape, &shape);
            if left > DEPENDENT * before {
                shape.iter_mut().for_each(|x| *x /= left.sqrt());
                shapes.push(shape);
            }
        }
    }
    let n = shapes.len();
    if n == 0 {
        return None;
    }
    let at = Evaluation::new(
        system.initial_positions(),
        system.initial_velocities(),
        Weights::STIFFNESS,
    );
    let mut y = vec![Vector3::zeros(); system.numbering().n_nodes()];
    let mut product = vec![Vector3::zeros(); system.n_free()];
    let mut quotients = DMatrix::zeros(n, n);
    for column in 0..n {
        y[..system.n_free()].copy_from_slice(&shapes[column]);
        system.product(&at, &y, &mut product);
        for row in 0..n {
            let terms = shapes[row].iter().zip(&product);
            quotients[(row, column)] = terms.map(|(a, b)| a.dot(b)).sum::<f64>();
        }
    }
    let squares = SymmetricEigen::new(0.5 * (&quotients + quotients.transpose())).eigenvalues;
    let least = squares.min();
    let largest = system.frequency_bound_of_massive_nodes().powi(2);
    let scale = if largest.is_finite() {
        largest
    } else {
        squares.amax()
    };
    match least {
        square if square.abs() <= ZERO * scale => Some(0.0),
        square => Some(square.signum() * square.abs().sqrt()),
    }
}

/// Couplings between each free block and the next one that a fixed node or a guide holds,
/// that node included; those that nothing holds have none. `None` if nothing holds any.
fn distances_from_supports(system: &System) -> Option<Vec<u32>> {
    let n = system.n_free();
    let mut distances = vec![0; n];
    let mut queue = VecDeque::new();
    let anchored = system.anchored().map(|[block, _]| block);
    for block in anchored.chain(system.guided()) {
        if distances[block] == 0 {
            distances[block] = 1;
            queue.push_back(block);
        }
    }
    if queue.is_empty() {
        return None;
    }
    let mut neighbours = vec![Vec::new(); n];
    for &[a, b] in system.pattern().pairs() {
        let [a, b] = [a as usize, b as usize];
        neighbours[a].push(b);
        neighbours[b].push(a);
    }
    while let Some(block) = queue.pop_front() {
        for &next in &neighbours[block] {
            if distances[next] == 0 {
                distances[next] = distances[block] + 1;
                queue.push_back(next);
            }
        }
    }
    Some(distances)
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_assembly::{Compilation, compile_with};
    use springs_scene::{Node, Scene};
    use std::f64::consts::PI;

    /// A bar of unit masses and springs in a row, held at its first node, and at its last
    /// one, too, if that is wanted; `tension` in N.
    fn row(n: usize, tension: f64, both: bool) -> Scene {
        let mut scene = Scene::default();
        for node in 0..=n {
            let position = Vector3::x() * node as f64;
            scene.add_node(if node == 0 || both && node == n {
                Node::fixed(position)
            } else {
                Node {
                    mass: 1.0,
                    ..Node::at(position)
                }
            });
        }
        for node in 0..n {
            let spring = scene.add_spring(node, node + 1, 100.0);
            scene.springs[spring].rest_length = 1.0 - tension / 100.0;
        }
        scene
    }

    /// In all directions, though the scene is on a line.
    fn bound(scene: &Scene) -> Option<f64> {
        let system = compile_with(scene, Compilation::complete()).unwrap();
        lowest_frequency_bound(&system)
    }

    /// A taut row of n springs between two fixed nodes vibrates across at
    /// 2 √(T/(m l)) sin(π/2n), in closed form.
    #[test]
    fn a_taut_string_is_bounded_closely() {
        for n in [4, 20, 100] {
            let exact = 2.0 * f64::sqrt(2.0) * (0.5 * PI / n as f64).sin();
            let bound = bound(&row(n, 2.0, true)).unwrap();
            assert!(bound >= exact * (1.0 - 1e-12), "{bound} {exact}");
            assert!(bound < 1.05 * exact, "{bound} {exact}");
        }
    }

    #[test]
    fn what_nothing_resists_or_grows_is_told() {
        assert_eq!(bound(&row(50, 0.0, true)), Some(0.0));
        assert!(bound(&row(5, -3.0, true)).unwrap() < 0.0);
        let mut free = row(5, 0.0, false);
        free.nodes[0].fixed = false;
        assert_eq!(bound(&free), None);
    }
}
