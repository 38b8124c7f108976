//! Iteration with rigid motions as near null space: solutions, iterations and frames of
//! reference.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use springs_solver::{NearNullSpace, Options, SolveError, Solver, Strategy, Subspace};

/// Springs of stiffness K between points, with a mass at each.
struct Net {
    positions: Vec<Vector3<f64>>,
    pairs: Vec<[u32; 2]>,
    stiffness: f64,
    mass: f64,
}

impl Net {
    /// A sheet with diagonals, bent unless it is flat.
    fn sheet(side: u32, bend: f64, stiffness: f64) -> Self {
        let at = |i: u32, j: u32| i * side + j;
        let mut net = Self {
            positions: Vec::new(),
            pairs: Vec::new(),
            stiffness,
            mass: 1.0,
        };
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            let (x, y) = (f64::from(i), f64::from(j));
            let z = bend * ((0.7 * x).sin() + (0.5 * y).cos());
            net.positions.push(Vector3::new(x, y, z));
            let ends = [
                (i + 1, j),
                (i, j + 1),
                (i + 1, j + 1),
                (i + 2, j),
                (i, j + 2),
            ];
            let inside = ends.into_iter().filter(|&(k, l)| k.max(l) < side);
            net.pairs.extend(inside.map(|(k, l)| [at(i, j), at(k, l)]));
            if i + 1 < side && j > 0 {
                net.pairs.push([at(i, j), at(i + 1, j - 1)]);
            }
        }
        net
    }

    fn blocks(&self) -> (Vec<[f64; 6]>, Vec<[f64; 6]>) {
        let packed = |m: Matrix3<f64>| [m.m11, m.m12, m.m13, m.m22, m.m23, m.m33];
        let mut diagonal = vec![Matrix3::identity() * self.mass; self.positions.len()];
        let mut off_diagonal = Vec::new();
        for pair in &self.pairs {
            let [a, b] = pair.map(|block| self.positions[block as usize]);
            // Springs at rest; coincident nodes are held together.
            let block = match (b - a).try_normalize(0.0) {
                Some(n) => n * n.transpose() * self.stiffness,
                None => Matrix3::identity() * self.stiffness,
            };
            pair.iter().for_each(|&end| diagonal[end as usize] += block);
            off_diagonal.push(packed(-block));
        }
        (diagonal.into_iter().map(packed).collect(), off_diagonal)
    }

    fn rhs(&self, turn: &Rotation3<f64>) -> Vec<f64> {
        let force = |k: usize| {
            let k = k as f64;
            turn * Vector3::new(k.sin(), (0.1 * k).cos(), 1.0)
        };
        let forces = (0..self.positions.len()).map(force);
        forces.flat_map(<[f64; 3]>::from).collect()
    }

    /// Solution, to 1e-10 in the norm of the matrix, and iterations.
    fn solve(
        &self,
        rhs: &[f64],
        near_null_space: NearNullSpace,
        (subspace, threads): (Subspace, usize),
    ) -> Result<(Vec<f64>, u64), SolveError> {
        let positions: Vec<[f64; 3]> = self.positions.iter().map(|&x| x.into()).collect();
        let options = Options {
            positions: Some(&positions),
            strategy: Strategy::Iterative,
            near_null_space,
            subspace,
            threads,
            ..Options::default()
        };
        let mut solver = Solver::analyze(positions.len(), &self.pairs, options)?;
        let (diagonal, off_diagonal) = self.blocks();
        solver.set_matrix(&diagonal, &off_diagonal)?;
        let mut x = rhs.to_vec();
        solver.solve_in_place(&mut x, 1e-10)?;
        assert_eq!(solver.counts().factorizations, 0);
        Ok((x, solver.counts().iterations))
    }

    fn dense(&self) -> DMatrix<f64> {
        let n = 3 * self.positions.len();
        let mut dense = DMatrix::identity(n, n) * self.mass;
        let (_, off_diagonal) = self.blocks();
        for (pair, b) in self.pairs.iter().zip(off_diagonal) {
            let block = Matrix3::new(b[0], b[1], b[2], b[1], b[3], b[4], b[2], b[4], b[5]);
            let [a, b] = pair.map(|block| 3 * block as usize);
            for (row, column, sign) in [(a, a, -1.0), (b, b, -1.0), (a, b, 1.0), (b, a, 1.0)] {
                let mut view = dense.fixed_view_mut::<3, 3>(row, column);
                view += block * sign;
            }
        }
        dense
    }
}

use NearNullSpace::{RigidMotions, Translations};
const SPACE: (Subspace, usize) = (Subspace::Space, 1);

fn off(a: &[f64], b: &[f64]) -> f64 {
    let size = b.iter().fold(0.0, |size: f64, b| size.max(b.abs()));
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max) / size
}

/// With aggregates of one node, of nodes on a line and of nodes at one point, too.
#[test]
fn solutions_equal_dense_ones() {
    let bent = Net::sheet(12, 0.3, 1e3);
    let flat = Net::sheet(12, 0.0, 1e3);
    let mut odd = Net::sheet(9, 0.3, 1e3);
    let n = odd.positions.len() as u32;
    // Alone; a straight chain; coincident ones.
    odd.positions.push(Vector3::new(50.0, 0.0, 0.0));
    let line = (0..8).map(|k| Vector3::new(1.0, 2.0, 2.0) * f64::from(k));
    odd.positions.extend(line);
    odd.pairs.extend((n + 1..n + 8).map(|k| [k, k + 1]));
    odd.positions.extend([Vector3::new(-9.0, 1.0, 0.5); 3]);
    odd.pairs.extend([[n + 9, n + 10], [n + 10, n + 11]]);
    for (name, net) in [("bent", bent), ("flat", flat), ("odd", odd)] {
        let rhs = net.rhs(&Rotation3::identity());
        let (x, _) = net.solve(&rhs, RigidMotions, SPACE).unwrap();
        let expected = net.dense().lu().solve(&DVector::from_vec(rhs)).unwrap();
        let error = off(&x, expected.as_slice());
        assert!(error < 1e-9, "{name}: {error:e}");
    }
}

#[test]
fn a_plane_has_the_solution_of_the_whole() {
    let turn = Rotation3::from_euler_angles(0.4, -0.3, 0.8);
    let mut net = Net::sheet(20, 0.0, 1e4);
    for position in &mut net.positions {
        *position = turn * *position;
    }
    let basis = [turn * Vector3::x(), turn * Vector3::y()];
    let forces = (0..net.positions.len()).map(|k| basis[0] * (k as f64).sin() + basis[1]);
    let rhs: Vec<f64> = forces.flat_map(<[f64; 3]>::from).collect();
    let plane = Subspace::Plane(basis.map(Into::into));
    let (x, iterations) = net.solve(&rhs, RigidMotions, (plane, 1)).unwrap();
    let (whole, _) = net.solve(&rhs, RigidMotions, SPACE).unwrap();
    // 1e-10 in the norm of the matrix, whose condition is below 1e6.
    assert!(off(&x, &whole) < 1e-7, "{:e}", off(&x, &whole));
    let (_, of_translations) = net.solve(&rhs, Translations, (plane, 1)).unwrap();
    assert!(
        3 * iterations <= 2 * of_translations,
        "{iterations} and {of_translations}"
    );
}

#[test]
fn stiff_nets_take_half_as_many_iterations() {
    for stiffness in [1e4, 1e7] {
        let net = Net::sheet(40, 0.3, stiffness);
        let rhs = net.rhs(&Rotation3::identity());
        let iterations = |space| net.solve(&rhs, space, SPACE).unwrap().1;
        let (rigid, translations) = (iterations(RigidMotions), iterations(Translations));
        assert!(
            2 * rigid <= translations,
            "{stiffness:e}: {rigid} and {translations}"
        );
    }
}

/// Turned, and a thousand times its size away.
#[test]
fn iterations_depend_on_no_frame_of_reference() {
    let net = Net::sheet(24, 0.3, 1e5);
    let rhs = net.rhs(&Rotation3::identity());
    let (x, iterations) = net.solve(&rhs, RigidMotions, SPACE).unwrap();
    let turn = Rotation3::from_euler_angles(1.0, 0.2, -2.0);
    let mut turned = Net::sheet(24, 0.3, 1e5);
    for position in &mut turned.positions {
        *position = turn * *position + Vector3::new(2e4, -1e4, 3e4);
    }
    let (y, of_turned) = turned
        .solve(&turned.rhs(&turn), RigidMotions, SPACE)
        .unwrap();
    assert_eq!(iterations, of_turned);
    let back = y
        .chunks(3)
        .map(|y| turn.inverse() * Vector3::from_column_slice(y));
    let back: Vec<f64> = back.flat_map(<[f64; 3]>::from).collect();
    assert!(off(&back, &x) < 1e-7, "{:e}", off(&back, &x));
}

#[test]
fn present_positions_take_the_place_of_those_of_the_options() {
    let net = Net::sheet(24, 0.3, 1e5);
    let rhs = net.rhs(&Rotation3::identity());
    let (_, expected) = net.solve(&rhs, RigidMotions, SPACE).unwrap();
    let past = vec![[0.0; 3]; net.positions.len()];
    let options = Options {
        positions: Some(&past),
        strategy: Strategy::Iterative,
        near_null_space: RigidMotions,
        ..Options::default()
    };
    let mut solver = Solver::analyze(past.len(), &net.pairs, options).unwrap();
    let present: Vec<[f64; 3]> = net.positions.iter().map(|&x| x.into()).collect();
    solver.set_positions(&present);
    let (diagonal, off_diagonal) = net.blocks();
    solver.set_matrix(&diagonal, &off_diagonal).unwrap();
    solver.solve_in_place(&mut rhs.clone(), 1e-10).unwrap();
    assert_eq!(solver.counts().iterations, expected);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let net = Net::sheet(60, 0.3, 1e4);
    let rhs = net.rhs(&Rotation3::identity());
    let [one, three] = [1, 3].map(|threads| {
        let how = (Subspace::Space, threads);
        net.solve(&rhs, RigidMotions, how).unwrap()
    });
    assert!(one == three);
}

/// What floats without mass, and what is not a number.
#[test]
fn singular_matrices_are_refused() {
    let mut net = Net::sheet(16, 0.3, 1e3);
    net.mass = 0.0;
    for mass in [0.0, -1.0, f64::NAN] {
        net.mass = mass;
        let solved = net.solve(&net.rhs(&Rotation3::identity()), RigidMotions, SPACE);
        let refused = matches!(solved, Err(SolveError::NotPositiveDefinite { .. }));
        assert!(refused, "mass {mass}");
    }
}

/// A factor that serves many systems is worth its price.
#[test]
fn uses_of_a_factor_count() {
    let net = Net::sheet(32, 0.3, 1e4);
    let positions: Vec<[f64; 3]> = net.positions.iter().map(|&x| x.into()).collect();
    let options = Options {
        positions: Some(&positions),
        strategy: Strategy::Auto,
        near_null_space: RigidMotions,
        ..Options::default()
    };
    let (diagonal, off_diagonal) = net.blocks();
    let rhs = net.rhs(&Rotation3::identity());
    let factorizations = |uses: f64| {
        let mut solver = Solver::analyze(positions.len(), &net.pairs, options).unwrap();
        solver.expect_uses(uses);
        for _ in 0..4 {
            solver.set_matrix(&diagonal, &off_diagonal).unwrap();
            solver.solve_in_place(&mut rhs.clone(), 1e-6).unwrap();
        }
        solver.counts().factorizations
    };
    assert_eq!(factorizations(1.0), 0);
    assert!(factorizations(20.0) >= 3);
}
