//! Form finding by force densities.

use crate::StaticsError;
use crate::equations::{in_node_order, largest, numbers_mut, unpacked, vectors};
use nalgebra::Vector3;
use springs_assembly::{System, compile};
use springs_scene::Scene;
use springs_solver::Indefinite;

/// The form in which springs with the given force densities q = T/l, in N/m, balance loads
/// and weight (Schek, Comput. Methods Appl. Mech. Eng. 3, 1974): one linear system, Σ q
/// (x_i − x_j) = F_i for every free node. Fixed nodes stay where they are at the time 0, and
/// guides count. Stiffnesses and rest lengths of the springs play no part, only who joins
/// whom; masses do. Struts have negative densities.
///
/// Gives the position of every node, in m.
///
/// # Errors
///
/// If the scene has problems, there is not one density for each spring, or they leave a
/// node free to move.
pub fn form_of_densities(
    scene: &Scene,
    densities: &[f64],
) -> Result<Vec<Vector3<f64>>, StaticsError> {
    let springs = scene.springs.len();
    if densities.len() != springs {
        let found = densities.len();
        return Err(StaticsError::WrongNumberOfDensities { found, springs });
    }
    let system = compile(scene)?;
    let numbering = system.numbering();
    let n_free = system.n_free();
    let mut x = system.initial_positions().to_vec();
    let (mut pairs, mut diagonal) = (Vec::new(), vec![0.0; n_free]);
    for (spring, &q) in scene.springs.iter().zip(densities) {
        let ends = spring.nodes.map(|node| numbering.block(node));
        for end in ends.into_iter().filter(|&end| end < n_free) {
            diagonal[end] += q;
        }
        if ends.iter().all(|&end| end < n_free) {
            let [a, b] = ends.map(|end| end as u32);
            pairs.push(([a.min(b), a.max(b)], q));
        }
    }
    pairs.sort_by_key(|(pair, _)| *pair);
    pairs.dedup_by(|next, kept| {
        let is_same = next.0 == kept.0;
        if is_same {
            kept.1 += next.1;
        }
        is_same
    });
    let along = projections(&system);
    let blocks = diagonal.iter().zip(&along).map(|(&q, along)| {
        // Across guides nothing moves.
        let q_across = if q == 0.0 { 1.0 } else { q.abs() };
        let [xx, xy, xz, yy, yz, zz] = *along;
        let across = [1.0 - xx, -xy, -xz, 1.0 - yy, -yz, 1.0 - zz];
        std::array::from_fn(|entry| q * along[entry] + q_across * across[entry])
    });
    let blocks: Vec<[f64; 6]> = blocks.collect();
    let off_diagonal = pairs.iter().map(|([a, b], q)| {
        let product = unpacked(&along[*a as usize]) * unpacked(&along[*b as usize]) * -*q;
        let mut rows = [0.0; 9];
        rows.copy_from_slice(product.transpose().as_slice());
        rows
    });
    let off_diagonal: Vec<[f64; 9]> = off_diagonal.collect();

    // For the way from where the nodes are, which guides keep to.
    let mut rhs = weights(scene, &system);
    system.add_loads(0.0, &mut rhs);
    for (spring, &q) in scene.springs.iter().zip(densities) {
        let [a, b] = spring.nodes.map(|node| numbering.block(node));
        for (own, other) in [(a, b), (b, a)] {
            if own < n_free {
                rhs[own] += (x[other] - x[own]) * q;
            }
        }
    }
    system.project_onto_guides(&mut rhs);
    let pairs: Vec<[u32; 2]> = pairs.into_iter().map(|(pair, _)| pair).collect();
    let mut solver = Indefinite::analyze(n_free, &pairs, None)?;
    let inertia = solver.set_matrix(&blocks, &off_diagonal)?;
    if inertia.zero > 0 {
        let direction = solver.zero_directions().next().unwrap_or_default();
        let (block, _) = largest(vectors(&direction));
        let node = numbering.node(block);
        return Err(StaticsError::NoForm { node });
    }
    solver.solve_in_place(numbers_mut(&mut rhs))?;
    for (x, moved) in x.iter_mut().zip(&rhs) {
        *x += moved;
    }
    Ok(in_node_order(&system, &x))
}

/// m g of the free blocks, in N.
fn weights(scene: &Scene, system: &System) -> Vec<Vector3<f64>> {
    let masses = system.masses().iter();
    masses.map(|mass| scene.gravity * *mass).collect()
}

/// What guides let free at every free block, packed.
fn projections(system: &System) -> Vec<[f64; 6]> {
    let columns = [0, 1, 2].map(|axis| {
        let mut units = vec![Vector3::ith(axis, 1.0); system.n_free()];
        system.project_onto_guides(&mut units);
        units
    });
    let [x, y, z] = &columns;
    let blocks = x.iter().zip(y).zip(z);
    blocks
        .map(|((x, y), z)| [x.x, x.y, x.z, y.y, y.z, z.z])
        .collect()
}
