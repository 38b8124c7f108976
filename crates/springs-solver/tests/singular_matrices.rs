//! A matrix that is singular but for rounding is refused, however its rounding
//! falls out: in every direction, on every strategy and in every kind of front.

use springs_solver::{Options, SolveError, Solver, Strategy, Subspace};

type Vector = [f64; 3];

/// A sequence of numbers in −1 … 1 that look random (an LCG of Knuth).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005);
        self.0 = self.0.wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / 2f64.powi(52) - 1.0
    }

    fn direction(&mut self) -> Vector {
        loop {
            let u = [self.next(), self.next(), self.next()];
            if (0.01..1.0).contains(&dot(&u, &u)) {
                return unit(u);
            }
        }
    }
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn unit(u: Vector) -> Vector {
    let length = dot(&u, &u).sqrt();
    u.map(|x| x / length)
}

/// (1,1,1), (1,2,3), random ones, and all of them turned by 90° about each axis.
fn directions(n_random: usize) -> Vec<Vector> {
    let mut random = Random(1);
    let mut all = vec![unit([1.0; 3]), unit([1.0, 2.0, 3.0]), [0.0, 0.0, 1.0]];
    all.extend((0..n_random).map(|_| random.direction()));
    let turned = |[x, y, z]: Vector| [[x, y, z], [-y, x, z], [z, y, -x], [x, -z, y]];
    all.into_iter().flat_map(turned).collect()
}

/// Matrices under construction: springs of stiffness k along n and of a share of
/// it across.
struct Matrix {
    pairs: Vec<[u32; 2]>,
    diagonal: Vec<[f64; 6]>,
    off_diagonal: Vec<[f64; 6]>,
}

impl Matrix {
    fn new(n_blocks: usize, pairs: Vec<[u32; 2]>) -> Self {
        Self {
            diagonal: vec![[0.0; 6]; n_blocks],
            off_diagonal: vec![[0.0; 6]; pairs.len()],
            pairs,
        }
    }

    fn add_mass(&mut self, block: usize, mass: f64) {
        for entry in [0, 3, 5] {
            self.diagonal[block][entry] += mass;
        }
    }

    /// From a block to the next one, or to something fixed.
    fn add_spring(&mut self, ends: [Option<u32>; 2], k: f64, across: f64, n: Vector) {
        let of = |row: usize, column: usize| {
            let unit = if row == column { 1.0 } else { 0.0 };
            across * k * unit + (k - across * k) * n[row] * n[column]
        };
        let block = [of(0, 0), of(0, 1), of(0, 2), of(1, 1), of(1, 2), of(2, 2)];
        for end in ends.into_iter().flatten() {
            for (sum, entry) in self.diagonal[end as usize].iter_mut().zip(block) {
                *sum += entry;
            }
        }
        if let [Some(a), Some(b)] = ends {
            let is_it = |pair: &[u32; 2]| *pair == [a, b] || *pair == [b, a];
            let pair = self.pairs.iter().position(is_it).unwrap();
            for (sum, entry) in self.off_diagonal[pair].iter_mut().zip(block) {
                *sum -= entry;
            }
        }
    }

    /// Whether a solver gives a solution for b.
    fn solve(&self, solver: &mut Solver, b: impl Fn(usize) -> f64) -> Result<(), SolveError> {
        solver.set_matrix(&self.diagonal, &self.off_diagonal)?;
        let mut x: Vec<f64> = (0..3 * self.diagonal.len()).map(b).collect();
        solver.solve_in_place(&mut x, 1e-11)
    }
}

fn chain(n: u32) -> Vec<[u32; 2]> {
    (1..n).map(|b| [b - 1, b]).collect()
}

fn ring(n: u32) -> Vec<[u32; 2]> {
    let mut pairs = chain(n);
    pairs.push([n - 1, 0]);
    pairs
}

fn complete(n: u32) -> Vec<[u32; 2]> {
    (0..n).flat_map(|b| (0..b).map(move |a| [a, b])).collect()
}

/// Block 1 has no mass and sits between block 0, which is held, and block 2, which
/// has a mass; the blocks after that hang on each other.
fn collinear(n_blocks: usize, pairs: Vec<[u32; 2]>, k: f64, across: f64, n: Vector) -> Matrix {
    let mut matrix = Matrix::new(n_blocks, pairs);
    matrix.add_spring([None, Some(0)], k, 1.0, n);
    matrix.add_spring([Some(0), Some(1)], k, across, n);
    matrix.add_spring([Some(1), Some(2)], 1.7 * k, across, n);
    for block in 2..n_blocks {
        matrix.add_mass(block, 1.0);
        if block > 2 {
            let m = unit([n[1], 0.3 - n[2], n[0]]);
            matrix.add_spring([Some(block as u32 - 1), Some(block as u32)], k, 0.01, m);
        }
    }
    matrix
}

const ROUTES: [Strategy; 3] = [Strategy::Double, Strategy::Iterative, Strategy::Auto];

/// Nothing holds the massless node across; as soon as something does, there is a
/// solution. Trees, small fronts and dense ones, stiffness from 1e-4 to 1e8.
#[test]
fn a_massless_node_between_collinear_springs_is_found_in_every_direction() {
    for (n_blocks, pairs, n_random) in [
        (4, chain(4), 1000),
        (6, ring(6), 1000),
        (12, complete(12), 300),
        (40, complete(40), 30),
    ] {
        for strategy in ROUTES {
            let options = Options {
                strategy,
                ..Options::default()
            };
            let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
            for (exponent, n) in (-4..=8).cycle().zip(directions(n_random)) {
                let k = 10f64.powi(exponent);
                let mut solve = |across| {
                    let matrix = collinear(n_blocks, pairs.clone(), k, across, n);
                    matrix.solve(&mut solver, |row| (row as f64).cos())
                };
                let found = solve(0.0);
                let expected = Err(SolveError::NotPositiveDefinite { block: 1 });
                assert_eq!(
                    found, expected,
                    "{n_blocks} blocks, {strategy:?}, {k} along {n:?}"
                );
                assert_eq!(
                    solve(1e-6),
                    Ok(()),
                    "{n_blocks} blocks, {strategy:?}, {n:?}"
                );
            }
        }
    }
}

/// Directions in a tilted plane, also along its basis and nearly so, where the
/// sums that reduce blocks to the plane leave rounding of whole blocks.
#[test]
fn a_massless_node_is_found_in_every_plane() {
    let mut random = Random(7);
    for (n_blocks, pairs) in [(4, chain(4)), (6, ring(6)), (40, complete(40))] {
        for trial in 0..1000 {
            let (first, other) = (random.direction(), random.direction());
            let along = dot(&first, &other);
            let second = unit([0, 1, 2].map(|axis| other[axis] - along * first[axis]));
            let angle = match trial % 4 {
                0 => std::f64::consts::FRAC_PI_2 * f64::from(trial % 8 / 4),
                1 => 10f64.powi(-(trial % 9)),
                _ => 3.0 * random.next(),
            };
            let n = [0, 1, 2].map(|axis| angle.cos() * first[axis] + angle.sin() * second[axis]);
            let options = Options {
                subspace: Subspace::Plane([first, second]),
                ..Options::default()
            };
            let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
            let mut solve = |across| {
                let matrix = collinear(n_blocks, pairs.clone(), 1e3, across, n);
                matrix.solve(&mut solver, |row| n[row % 3])
            };
            let expected = Err(SolveError::NotPositiveDefinite { block: 1 });
            assert_eq!(
                solve(0.0),
                expected,
                "angle {angle} in the plane of {first:?}"
            );
            assert_eq!(
                solve(1e-9),
                Ok(()),
                "angle {angle} in the plane of {first:?}"
            );
        }
    }
}

/// Springs without any mass and without anything that holds them. A mass of
/// 1e-12 of their stiffness is enough.
#[test]
fn parts_without_mass_are_found() {
    let mut random = Random(3);
    for subspace in [
        Subspace::Space,
        Subspace::Isotropic,
        Subspace::Line(unit([1.0, 2.0, 3.0])),
    ] {
        for pairs in [chain(2), chain(5), ring(5), chain(30), ring(30)] {
            let n_blocks = pairs
                .iter()
                .flatten()
                .max()
                .map_or(0, |&last| last as usize + 1);
            let options = Options {
                subspace,
                ..Options::default()
            };
            let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
            for _ in 0..100 {
                let mut matrix = Matrix::new(n_blocks, pairs.clone());
                for &[a, b] in &pairs {
                    let k = 2.0 + random.next();
                    matrix.add_spring([Some(a), Some(b)], k, 1.0, [1.0, 0.0, 0.0]);
                }
                let found = matrix.solve(&mut solver, |_| 1.0);
                assert!(
                    matches!(found, Err(SolveError::NotPositiveDefinite { .. })),
                    "{subspace:?}, {n_blocks} blocks: {found:?}"
                );
                matrix.add_mass(n_blocks / 2, 1e-12);
                assert_eq!(matrix.solve(&mut solver, |_| 1.0), Ok(()));
            }
        }
    }
}

/// What is far apart in size, but not singular: rounding of the large entries
/// does not reach the small ones where springs lie along axes.
#[test]
fn extreme_matrices_are_taken() {
    for ratio in [1e-9, 1e9, 1e15, 1e18, 1e30] {
        for n in [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] {
            for (n_blocks, pairs) in [(5, chain(5)), (5, ring(5)), (40, complete(40))] {
                for subspace in [
                    Subspace::Space,
                    Subspace::Plane([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
                ] {
                    let options = Options {
                        subspace,
                        ..Options::default()
                    };
                    let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
                    let mut matrix = Matrix::new(n_blocks, pairs.clone());
                    matrix.add_spring([None, Some(0)], ratio, 0.0, n);
                    for block in 0..n_blocks {
                        matrix.add_mass(block, 1.0);
                        if block > 0 {
                            let ends = [Some(block as u32 - 1), Some(block as u32)];
                            matrix.add_spring(ends, ratio, 0.0, n);
                        }
                    }
                    let solved = matrix.solve(&mut solver, |row| n[row % 3]);
                    assert_eq!(solved, Ok(()), "{ratio:e} along {n:?} in {subspace:?}");
                }
            }
        }
    }
}
