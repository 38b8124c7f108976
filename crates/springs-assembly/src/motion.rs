//! Where the motion of a scene stays.

use nalgebra::Vector3;

/// Where the motion stays because of symmetry: everything lies and moves in one
/// plane or on one line, so nothing pushes out of it.
///
/// The Hessian of springs in a plane couples nothing in it with anything across,
/// so the system matrix falls into two blocks, and the right-hand side across is
/// zero; likewise on a line. Nodes and velocities lie there up to rounding of the
/// largest, and every spring and dashpot up to 1e-10 of its own length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// No such symmetry.
    Space,
    /// In the plane of two orthonormal vectors.
    Plane([Vector3<f64>; 2]),
    /// Along a unit vector.
    Line(Vector3<f64>),
}

/// Coordinates are off a plane or line by rounding, up to so many units in the
/// last place.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// A force along a connection has no part across if that would be below this part
/// of it: what rounding of coordinates makes of short connections far from the
/// origin.
const ACROSS: f64 = 1e-10;

/// Vectors of one kind, with what a difference from zero is compared with.
struct Kind {
    vectors: Vec<Vector3<f64>>,
    size: f64,
}

impl Motion {
    /// Directions that nodes move in.
    pub fn dimension(&self) -> usize {
        match self {
            Self::Space => 3,
            Self::Plane(_) => 2,
            Self::Line(_) => 1,
        }
    }

    /// Whether a force along `direction` has a part across the plane or line.
    pub(crate) fn is_left_by(&self, direction: &Vector3<f64>) -> bool {
        let along: &[Vector3<f64>] = match self {
            Self::Space => return false,
            Self::Plane(basis) => basis,
            Self::Line(line) => std::slice::from_ref(line),
        };
        without(direction, along).norm() > ACROSS * direction.norm()
    }

    /// Where all `positions` lie, and where `velocities` and `gravity` point.
    pub(crate) fn of(
        positions: &[Vector3<f64>],
        velocities: &[Vector3<f64>],
        gravity: &Vector3<f64>,
    ) -> Self {
        let Some(origin) = positions.first() else {
            return Self::Space;
        };
        let largest = |vectors: &[Vector3<f64>]| {
            let sizes = vectors.iter().map(|vector| vector.amax());
            sizes.fold(0.0, f64::max)
        };
        let kinds = [
            Kind {
                vectors: positions.iter().map(|x| x - origin).collect(),
                size: largest(positions),
            },
            Kind {
                vectors: velocities.to_vec(),
                size: largest(velocities),
            },
            Kind {
                vectors: vec![*gravity],
                size: gravity.amax(),
            },
        ];
        match (along_axes(&kinds), along_any(&kinds)) {
            // A line across axes, in a plane of theirs.
            (Some(Self::Plane(_)), Self::Line(line)) => Self::Line(line),
            (Some(along_axes), _) => along_axes,
            (None, along_any) => along_any,
        }
    }
}

/// The plane or line of coordinate axes that everything lies in, exactly.
fn along_axes(kinds: &[Kind]) -> Option<Motion> {
    let is_used = |axis: usize| {
        let vectors = kinds.iter().flat_map(|kind| &kind.vectors);
        vectors.into_iter().any(|vector| vector[axis] != 0.0)
    };
    let axes: Vec<Vector3<f64>> = (0..3)
        .filter(|&axis| is_used(axis))
        .map(|axis| Vector3::ith(axis, 1.0))
        .collect();
    match axes[..] {
        [] => Some(Motion::Line(Vector3::x())),
        [line] => Some(Motion::Line(line)),
        [first, second] => Some(Motion::Plane([first, second])),
        _ => None,
    }
}

/// The part of a vector across orthonormal directions.
fn without(vector: &Vector3<f64>, directions: &[Vector3<f64>]) -> Vector3<f64> {
    let remove = |rest: Vector3<f64>, u: &Vector3<f64>| rest - u * u.dot(&rest);
    directions.iter().fold(*vector, remove)
}

/// Any plane or line that everything lies in, up to rounding.
fn along_any(kinds: &[Kind]) -> Motion {
    let mut directions: Vec<Vector3<f64>> = Vec::new();
    loop {
        // Whatever sticks out the most, relative to its kind.
        let mut most = (0.0, Vector3::zeros());
        for kind in kinds.iter().filter(|kind| kind.size > 0.0) {
            for vector in &kind.vectors {
                let rest = without(vector, &directions);
                let relative = rest.norm() / kind.size;
                if relative > most.0 {
                    most = (relative, rest);
                }
            }
        }
        match (most.0 <= ROUNDING, &directions[..]) {
            (true, [line]) => return Motion::Line(*line),
            (true, [first, second]) => return Motion::Plane([*first, *second]),
            (_, [_, _]) | (true, _) => return Motion::Space,
            _ => {
                // Twice, so that it is orthogonal to the last digit.
                let direction = without(&most.1.normalize(), &directions);
                directions.push(direction.normalize());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn plane() -> Vec<Vector3<f64>> {
        let at = |i: u32, j: u32| Vector3::new(0.3 * f64::from(i), 0.7 * f64::from(j) - 1.0, 0.0);
        (0..5).flat_map(|i| (0..4).map(move |j| at(i, j))).collect()
    }

    #[test]
    fn planes_and_lines_are_found_in_any_orientation() {
        let still = [Vector3::zeros(); 2];
        let down = Vector3::new(0.0, -9.81, 0.0);
        let plain = Motion::of(&plane(), &still, &down);
        assert_eq!(plain, Motion::Plane([Vector3::x(), Vector3::y()]));
        let line: Vec<_> = (0..9)
            .map(|k| Vector3::y() * (0.1 * f64::from(k)))
            .collect();
        assert_eq!(Motion::of(&line, &still, &down), Motion::Line(Vector3::y()));

        for k in 0..20 {
            let angle = f64::from(k);
            let turn = Rotation3::from_euler_angles(angle, 0.3 * angle, 1.0 - angle);
            let moved = |vectors: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
                let shift = Vector3::new(3.0, -2.0, 10.0);
                vectors.iter().map(|x| turn * x + shift).collect()
            };
            let Motion::Plane([u, v]) = Motion::of(&moved(&plane()), &still, &(turn * down)) else {
                panic!("turned by {angle}");
            };
            let normal = turn * Vector3::z();
            assert!(u.dot(&normal).abs() < 1e-14 && v.dot(&normal).abs() < 1e-14);
            assert!(u.dot(&v).abs() < 1e-15);
            // With k = 0 it lies in a plane of axes, too.
            let on_line = Motion::of(&moved(&line), &still, &(turn * down));
            assert!(matches!(on_line, Motion::Line(_)), "{on_line:?}");
        }
    }

    #[test]
    fn a_connection_may_leave_where_its_nodes_do_not() {
        let plane = Motion::Plane([Vector3::x(), Vector3::y()]);
        assert!(!plane.is_left_by(&Vector3::new(1.0, 2.0, 1e-11)));
        assert!(plane.is_left_by(&Vector3::new(0.0, 0.0, 5e-12)));
        assert!(!plane.is_left_by(&Vector3::zeros()));
        assert!(Motion::Line(Vector3::x()).is_left_by(&Vector3::new(1.0, 1e-9, 0.0)));
        assert!(!Motion::Space.is_left_by(&Vector3::z()));
    }

    #[test]
    fn whatever_points_out_of_the_plane_is_seen() {
        let still = [Vector3::zeros(); 2];
        let out = Vector3::new(0.0, 0.0, 1e-9);
        let down = Vector3::new(0.0, -9.81, 0.0);
        assert_eq!(Motion::of(&plane(), &still, &out), Motion::Space);
        assert_eq!(Motion::of(&plane(), &[out], &down), Motion::Space);
        let mut bent = plane();
        bent[7] += out;
        assert_eq!(Motion::of(&bent, &still, &down), Motion::Space);
        assert_eq!(Motion::of(&[], &[], &down), Motion::Space);
    }
}
