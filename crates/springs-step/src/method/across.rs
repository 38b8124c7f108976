//! How much across stiffness steps need in their matrix.

use nalgebra::Vector3;
use springs_assembly::{OwnStiffness, PACKED, System};

/// Up to this, steps of velocity Verlet with across stiffness need none of it in their
/// matrix; twice this, half of it, and so on. They are stable to 4, but along with other
/// vibrations, at angles that change with the motion, they are not: taut saddle-shaped nets
/// diverge with 1.
const HARMLESS: f64 = 0.3;

/// Across stiffness in the matrix of filtered leapfrog.
///
/// Tensions there hold springs against turning: needed where nothing else does (a taut net
/// off its plane), since such vibrations may be far too fast for the step. But they hold back
/// a body that turns as a whole, and where more springs meet than it takes, tensions that
/// come of the step are far above those that matter. So each spring gets the part
/// 1 − s₀/s of its tension, with s = 2h² tr((m I + αh²A)⁻¹G) of the node at its ends where that
/// is larger; A and G are what springs give along and across against a move of that node
/// alone.
pub(super) struct Across {
    own: Vec<OwnStiffness>,
    /// Of the tensions at each block.
    parts: Vec<f64>,
}

impl Across {
    pub(super) fn new(system: &System) -> Self {
        Self {
            own: vec![OwnStiffness::default(); system.n_free()],
            parts: vec![0.0; system.n_free()],
        }
    }

    /// Leaves of `tensions`, in N, what a matrix M + `filter`·S needs at positions `x` for
    /// steps of size `h`, in s; `filter` = αh², in s².
    pub(super) fn leave_needed(
        &mut self,
        system: &System,
        x: &[Vector3<f64>],
        (h, filter): (f64, f64),
        tensions: &mut [f64],
    ) {
        system.own_stiffness(x, tensions, &mut self.own);
        let blocks = self.own.iter().zip(system.masses());
        for (part, (own, &mass)) in self.parts.iter_mut().zip(blocks) {
            let mut held = own.along.map(|along| along * filter);
            for diagonal in [0, 3, 5] {
                held[diagonal] += mass;
            }
            let ratio = 2.0 * h * h * trace_of_ratio(&own.across, &held);
            // Massless blocks may be held by nothing else.
            let is_needed = mass == 0.0 || !ratio.is_finite();
            *part = if is_needed {
                1.0
            } else {
                (1.0 - HARMLESS / ratio).max(0.0)
            };
        }
        let mut tensions = tensions.iter_mut();
        system.each_carried_term(|blocks, _| {
            let tension = tensions.next().expect("one for each term");
            let parts = blocks.iter().map(|&block| self.parts[block as usize]);
            *tension = tension.max(0.0) * parts.fold(0.0, f64::max);
        });
    }
}

/// tr(B⁻¹A) of symmetric packed matrices.
fn trace_of_ratio(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    let [xx, xy, xz, yy, yz, zz] = *b;
    // B⁻¹ is these over the determinant.
    let cofactors = [
        yy * zz - yz * yz,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xx * zz - xz * xz,
        xy * xz - xx * yz,
        xx * yy - xy * xy,
    ];
    let determinant = xx * cofactors[0] + xy * cofactors[1] + xz * cofactors[2];
    let mut trace = 0.0;
    for (&(row, column), (a, cofactor)) in PACKED.iter().zip(a.iter().zip(&cofactors)) {
        trace += if row == column { 1.0 } else { 2.0 } * a * cofactor;
    }
    trace / determinant
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use springs_assembly::compile;
    use springs_scene::{Node, Scene};

    #[test]
    fn traces_are_those_of_the_inverse() {
        let a = Matrix3::new(3.0, -0.4, 0.7, -0.4, 2.0, 0.1, 0.7, 0.1, 5.0);
        let b = Matrix3::new(6.0, 1.5, -0.3, 1.5, 4.0, 0.8, -0.3, 0.8, 1.0);
        let expected = (b.try_inverse().unwrap() * a).trace();
        let [a, b] = [a, b].map(|matrix| PACKED.map(|entry| matrix[entry]));
        assert!((trace_of_ratio(&a, &b) / expected - 1.0).abs() < 1e-14);
    }

    /// A node between anchors at ±1 m along some axes, pulled at by springs of 1e6 N/m.
    fn node_between(axes: usize) -> System {
        let mut scene = Scene::default();
        scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::zeros())
        });
        for axis in 0..axes {
            for side in [-1.0, 1.0] {
                let anchor = scene.add_node(Node::fixed(Vector3::ith(axis, side)));
                scene.add_spring(0, anchor, 1e6);
            }
        }
        compile(&scene).unwrap()
    }

    #[test]
    fn tensions_are_left_where_nothing_else_holds() {
        for (axes, h, expected) in [
            // A string: s = 2h²·2·2T/m of two directions; s₀/s is left out.
            (1, 1e-1, 1.0 - HARMLESS / (2.0 * 1e-2 * 4.0 * 50.0)),
            (1, 1e-3, 0.0),
            // Held in every direction, by far more than tensions do.
            (3, 1e-1, 0.0),
        ] {
            let system = node_between(axes);
            let mut tensions = vec![50.0; system.n_carried()];
            tensions[0] = -10.0;
            tensions[1] = 100.0;
            let x = system.initial_positions();
            let steps = (h, 0.3 * h * h);
            Across::new(&system).leave_needed(&system, x, steps, &mut tensions);
            assert_eq!(tensions[0], 0.0);
            assert!(
                (tensions[1] - 100.0 * expected).abs() < 1e-10,
                "{tensions:?}"
            );
        }
    }
}
