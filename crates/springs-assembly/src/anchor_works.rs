//! Work that fixed blocks do against each other, block by block.

use nalgebra::Vector3;

/// Simpson's rule: places on a way of length 1, and their weights.
const SIMPSON: [(f64, f64); 3] = [(0.0, 1.0 / 6.0), (0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0)];

/// The part that each of N fixed blocks has in the `work`, in J, that they do together
/// against the forces between them while they go straight along `ways`, in m, at constant
/// velocities. `forces` gives those on them, in N, at a fraction of the way.
///
/// The work of each is an integral of order 4; what these miss together is theirs in
/// proportion, so that the sum is `work` and a block that stands does none.
pub(crate) fn share_out<const N: usize>(
    work: f64,
    ways: [Vector3<f64>; N],
    forces: impl Fn(f64) -> [Vector3<f64>; N],
) -> [f64; N] {
    let mut works = [0.0; N];
    for (place, weight) in SIMPSON {
        let forces = forces(place);
        for (work, (force, way)) in works.iter_mut().zip(forces.iter().zip(&ways)) {
            *work -= weight * force.dot(way);
        }
    }
    let missing = work - works.iter().sum::<f64>();
    let mut sizes = works.map(f64::abs);
    if sizes.iter().all(|&size| size == 0.0) {
        sizes = ways.map(|way| way.norm());
    }
    let total: f64 = sizes.iter().sum();
    if total > 0.0 {
        for (work, size) in works.iter_mut().zip(sizes) {
            *work += missing * (size / total);
        }
    }
    works
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear spring of 1 N/m and no rest length between two blocks: its force is the
    /// distance, and the work of each a quadratic integral.
    #[test]
    fn works_are_integrals_and_their_sum_is_given() {
        let (a, b) = (Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0));
        let ways = [Vector3::new(1.0, 0.0, 0.0), Vector3::new(3.0, 1.0, 0.0)];
        let forces = |place: f64| {
            let force = (b + ways[1] * place) - (a + ways[0] * place);
            [force, -force]
        };
        // d(s) = (2 + 2s, s, 0): −∫ d·(1, 0, 0) = −3, ∫ d·(3, 1, 0) = 9 + ½.
        let together = 0.5 * (17.0 - 4.0);
        let works = share_out(together, ways, forces);
        assert!((works[0] + 3.0).abs() < 1e-14 && (works[1] - 9.5).abs() < 1e-14);
        // What the rule misses is shared out.
        let works = share_out(together + 0.125, ways, forces);
        assert!((works[0] + works[1] - together - 0.125).abs() < 1e-14);
    }

    #[test]
    fn what_stands_does_no_work() {
        let ways = [Vector3::zeros(), Vector3::x()];
        let forces = |place: f64| [Vector3::x() * place.exp(), Vector3::x() * -place.exp()];
        let works = share_out(1f64.exp() - 1.0, ways, forces);
        assert_eq!(works, [0.0, 1f64.exp() - 1.0]);
        assert_eq!(share_out(0.0, [Vector3::zeros(); 2], forces), [0.0; 2]);
        // No force where the rule looks.
        let nowhere = |_| [Vector3::zeros(); 2];
        assert_eq!(share_out(1.0, ways, nowhere), [0.0, 1.0]);
    }
}
