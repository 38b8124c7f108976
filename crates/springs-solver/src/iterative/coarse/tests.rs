use super::*;
use crate::block::{add, dot, place, times};

/// Springs between neighbours in a grid of points, and masses.
struct Net<const D: usize, const P: usize> {
    positions: Vec<[f64; D]>,
    rows: Rows<P, P>,
}

impl<const D: usize, const P: usize> Net<D, P> {
    fn new(side: u32, position: impl Fn(f64, f64) -> [f64; D]) -> Self {
        let mut pairs = Vec::new();
        let mut positions = Vec::new();
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            positions.push(position(f64::from(i), f64::from(j)));
            let ends = [(i + 1, j), (i, j + 1), (i + 1, j + 1)];
            let inside = ends.into_iter().filter(|&(k, l)| k.max(l) < side);
            pairs.extend(inside.map(|(k, l)| [i * side + j, k * side + l]));
        }
        let mut diagonal = vec![[0.0; P]; positions.len()];
        for block in &mut diagonal {
            for axis in 0..D {
                block[place::<D, P>(axis, axis)] = 0.1;
            }
        }
        let mut off_diagonal = Vec::new();
        for pair in &pairs {
            let [a, b]: [[f64; D]; 2] = pair.map(|block: u32| positions[block as usize]);
            let d: [f64; D] = std::array::from_fn(|axis| b[axis] - a[axis]);
            let mut block = [0.0; P];
            for i in 0..D {
                for j in i..D {
                    block[place::<D, P>(i, j)] = 100.0 * d[i] * d[j] / dot(&d, &d);
                }
            }
            for &end in pair {
                add(&mut diagonal[end as usize], block);
            }
            off_diagonal.push(block.map(|entry| -entry));
        }
        let mut rows = Rows::new(positions.len(), &pairs);
        rows.set::<D>(&diagonal, &off_diagonal);
        Self { positions, rows }
    }

    fn product(&self, x: &[[f64; D]]) -> Vec<[f64; D]> {
        let diagonal = self.rows.diagonal().iter().zip(x);
        let mut product: Vec<_> = diagonal.map(|(block, x)| times(block, x)).collect();
        for ([row, column], block) in self.rows.pairs().zip(self.rows.blocks()) {
            let [row, column] = [row, column].map(|block| block as usize);
            add(&mut product[row], times(block, &x[column]));
            add(&mut product[column], times(block, &x[row]));
        }
        product
    }

    /// What is left of a motion after the correction of what the matrix does to it, as a
    /// part of the motion.
    fn left(&self, make: MakeCoarse<D, P, P>, motion: impl Fn(&[f64; D]) -> [f64; D]) -> f64 {
        let options = Options {
            near_null_space: NearNullSpace::RigidMotions,
            ..Options::default()
        };
        let pattern = Pattern::of(&self.rows, options, 1e9);
        let mut coarse = make(&pattern).unwrap();
        let place = |position: &[f64; D]| {
            let mut centre = [0.0; 3];
            centre[..D].copy_from_slice(position);
            Place::node(centre)
        };
        let places: Vec<Place> = self.positions.iter().map(place).collect();
        coarse.set_places(&places);
        coarse.set(&self.rows).unwrap();
        let x: Vec<[f64; D]> = self.positions.iter().map(motion).collect();
        let mut z = vec![[0.0; D]; x.len()];
        coarse.correct(&self.product(&x), &mut z);
        let size = x.as_flattened().iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let differences = z.as_flattened().iter().zip(x.as_flattened());
        differences.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size
    }
}

#[test]
fn rigid_motions_in_space_are_in_the_coarse_space() {
    let bent = Net::<3, 6>::new(13, |i, j| [i, j, (0.5 * i).sin() + 10.0]);
    let flat = Net::<3, 6>::new(13, |i, j| [i, 0.6 * j, 0.8 * j]);
    for net in [bent, flat] {
        let rigid = |&[x, y, z]: &[f64; 3]| {
            let [p, q, r] = [0.3, -0.7, 0.2];
            [1.0 + q * z - r * y, r * x - p * z, p * y - q * x]
        };
        let left = net.left(in_space, rigid);
        assert!(left < 1e-11, "{left:e}");
        let left = net.left(translations, rigid);
        assert!(left > 1e-2, "{left:e}");
    }
}

#[test]
fn rigid_motions_in_a_plane_are_in_the_coarse_space() {
    let net = Net::<2, 3>::new(13, |i, j| [i + 0.1 * j * j, j]);
    let rigid = |&[x, y]: &[f64; 2]| [1.0 - 0.4 * y, 2.0 + 0.4 * x];
    let left = net.left(in_plane, rigid);
    assert!(left < 1e-12, "{left:e}");
}

/// Of aggregates that turn: what is left of a motion of all of them.
#[test]
fn rigid_motions_of_bodies_are_those_of_their_nodes() {
    let node = |x: f64, y: f64, z: f64| Place::node([x, y, z]);
    let nodes = [
        node(0.0, 0.0, 0.0),
        node(1.0, 0.0, 0.5),
        node(0.0, 2.0, 0.0),
        node(3.0, 1.0, 1.0),
    ];
    let pair = Place::around(nodes[..2].iter());
    let other = Place::around(nodes[2..].iter());
    let bodies = [pair, other];
    let whole = Place::around(bodies.iter());
    let at_once = Place::around(nodes.iter());
    for axis in 0..3 {
        assert!((whole.centre[axis] - at_once.centre[axis]).abs() < 1e-15);
    }
    assert!((whole.radius - at_once.radius).abs() < 1e-15);
    let motion = [1.0, -2.0, 0.5, 0.3, -0.1, 0.7];
    for (k, node) in nodes.iter().enumerate() {
        let body = &bodies[k / 2];
        let of_body = Body::<3>::in_whole(body, &whole).prolong(&motion);
        let in_turn: [f64; 3] = Point::<3>::in_whole(node, body).prolong(&of_body);
        let direct: [f64; 3] = Point::<3>::in_whole(node, &at_once).prolong(&motion);
        for axis in 0..3 {
            assert!((in_turn[axis] - direct[axis]).abs() < 1e-15);
        }
    }
}

#[test]
fn restrictions_are_transposed_prolongations() {
    let whole = Place {
        weight: 2.0,
        centre: [0.5, 0.0, 0.0],
        radius: 1.5,
    };
    let block = Place {
        weight: 1.0,
        centre: [1.0, -2.0, 0.25],
        radius: 0.5,
    };
    check::<Point<3>, 3, 6>(&block, &whole);
    check::<Point<2>, 2, 3>(&block, &whole);
    check::<Body<3>, 6, 6>(&block, &whole);
    check::<Body<2>, 3, 3>(&block, &whole);
    check::<Along, 3, 3>(&block, &whole);
}

fn check<T: Motion<D, M>, const D: usize, const M: usize>(block: &Place, whole: &Place) {
    let motion = T::in_whole(block, whole);
    let x: [f64; M] = std::array::from_fn(|k| (k as f64 + 0.5).sin());
    let f: [f64; D] = std::array::from_fn(|k| (2.0 * k as f64 + 1.0).cos());
    let work = dot(&motion.prolong(&x), &f) - dot(&x, &motion.restrict(&f));
    assert!(work.abs() < 1e-15, "{work:e}");
}

#[test]
fn nodes_on_a_line_do_not_turn_about_it() {
    let nodes = |points: &[[f64; 3]]| points.iter().map(|&x| Place::node(x)).collect::<Vec<_>>();
    let idle = |nodes: &[Place]| Place::around(nodes.iter()).idle_rotations(nodes.iter());
    assert_eq!(idle(&nodes(&[[1e6, 2.0, 3.0]; 3])), Some(Idle::All));
    let line = nodes(&[
        [1e4, 0.0, 0.0],
        [1e4 + 0.3, 0.0, 0.4],
        [1e4 + 0.6, 0.0, 0.8],
    ]);
    let Some(Idle::About(axis)) = idle(&line) else {
        panic!("on a line");
    };
    let along = dot(&axis, &[0.6, 0.0, 0.8]).abs();
    assert!((along - 1.0).abs() < 1e-12);
    let off = nodes(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 1e-3, 0.0]]);
    assert_eq!(idle(&off), None);
}
