//! How much across stiffness steps need in their matrix.

use nalgebra::{Matrix3, Vector3};
use springs_assembly::{OwnStiffness, System};

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
            let held = Matrix3::from_diagonal_element(mass) + own.along * filter;
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

/// tr(B⁻¹A) of symmetric matrices.
fn trace_of_ratio(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|column| b.column(column).into_owned());
    let [yz, zx, xy] = [y.cross(&z), z.cross(&x), x.cross(&y)];
    // Rows of B⁻¹ are these over the determinant.
    let sum = yz.dot(&a.column(0)) + zx.dot(&a.column(1)) + xy.dot(&a.column(2));
    sum / x.dot(&yz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_assembly::compile;
    use springs_scene::{Node, Scene};

    #[test]
    fn traces_are_those_of_the_inverse() {
        let a = Matrix3::new(3.0, -0.4, 0.7, -0.4, 2.0, 0.1, 0.7, 0.1, 5.0);
        let b = Matrix3::new(6.0, 1.5, -0.3, 1.5, 4.0, 0.8, -0.3, 0.8, 1.0);
        let expected = (b.try_inverse().unwrap() * a).trace();
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
