//! The same bits on any number of threads, and solutions that are right.

use springs_solver::{NearNullSpace, Options, Solver, Strategy};
use springs_threads::with_threads;

/// Springs between neighbours in a box of nodes, whose numbers go by turns with this stride.
struct Net {
    positions: Vec<[f64; 3]>,
    pairs: Vec<[u32; 2]>,
    diagonal: Vec<[f64; 6]>,
    upper: Vec<[f64; 6]>,
}

impl Net {
    fn new([nx, ny, nz]: [usize; 3], stride: usize, stiffness: f64) -> Self {
        let n = nx * ny * nz;
        let number = |x, y, z| ((x * ny + y) * nz + z) * stride % n;
        let mut net = Self {
            positions: vec![[0.0; 3]; n],
            pairs: Vec::new(),
            diagonal: vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; n],
            upper: Vec::new(),
        };
        for (x, y, z) in (0..n).map(|k| (k / nz / ny, k / nz % ny, k % nz)) {
            let bent = (0.3 * y as f64).sin();
            net.positions[number(x, y, z)] = [x as f64, y as f64, z as f64 + bent];
            let ends = [
                (x + 1, y, z),
                (x, y + 1, z),
                (x, y, z + 1),
                (x + 1, y + 1, z),
            ];
            for (a, b, c) in ends
                .into_iter()
                .filter(|&(a, b, c)| a < nx && b < ny && c < nz)
            {
                let pair = [number(x, y, z), number(a, b, c)];
                net.pairs.push(pair.map(|end| end as u32));
            }
        }
        for &pair in &net.pairs {
            let [a, b] = pair.map(|end| net.positions[end as usize]);
            let d: [f64; 3] = std::array::from_fn(|axis| b[axis] - a[axis]);
            let square: f64 = d.iter().map(|d| d * d).sum();
            let entry = |i: usize, j: usize| stiffness * d[i] * d[j] / square;
            let block = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|(i, j)| entry(i, j));
            for end in pair {
                for (sum, entry) in net.diagonal[end as usize].iter_mut().zip(block) {
                    *sum += entry;
                }
            }
            net.upper.push(block.map(|entry| -entry));
        }
        net
    }

    fn solve(&self, near_null_space: NearNullSpace) -> (Vec<f64>, u64) {
        let options = Options {
            positions: Some(&self.positions),
            strategy: Strategy::Iterative,
            near_null_space,
            threads: 8,
            ..Options::default()
        };
        let mut solver = Solver::analyze(self.positions.len(), &self.pairs, options).unwrap();
        solver.set_positions(&self.positions);
        solver.set_matrix(&self.diagonal, &self.upper).unwrap();
        let mut x: Vec<f64> = (0..3 * self.positions.len())
            .map(|k| (0.7 * k as f64).sin())
            .collect();
        let b = x.clone();
        solver.solve_in_place(&mut x, 1e-12).unwrap();
        let (blocks, _) = x.as_chunks::<3>();
        let mut left = b;
        let mut subtract = |row: usize, block: &[f64; 6], x: &[f64; 3]| {
            let [a, b, c, d, e, f] = *block;
            for (axis, row_of_block) in [[a, b, c], [b, d, e], [c, e, f]].iter().enumerate() {
                let product: f64 = row_of_block.iter().zip(x).map(|(a, x)| a * x).sum();
                left[3 * row + axis] -= product;
            }
        };
        for (row, block) in self.diagonal.iter().enumerate() {
            subtract(row, block, &blocks[row]);
        }
        for (pair, block) in self.pairs.iter().zip(&self.upper) {
            let [a, b] = pair.map(|end| end as usize);
            subtract(a, block, &blocks[b]);
            subtract(b, block, &blocks[a]);
        }
        let largest = left.iter().fold(0.0f64, |most, left| most.max(left.abs()));
        assert!(largest < 1e-9, "{largest:e}");
        let counts = solver.counts();
        assert_eq!(counts.factorizations, 0);
        (x, counts.iterations)
    }
}

/// Nets and blocks in many stretches, in two and in one, with numbers in order and mixed up.
#[test]
fn iterations_have_the_same_bits() {
    for (sides, stride) in [
        ([61, 61, 1], 1),
        ([61, 61, 1], 1009),
        ([13, 13, 13], 1),
        ([300, 5, 2], 1),
        ([300, 5, 2], 1009),
        ([9, 9, 9], 100),
    ] {
        let net = Net::new(sides, stride, 1e2);
        for near_null_space in [NearNullSpace::Translations, NearNullSpace::RigidMotions] {
            let alone = net.solve(near_null_space);
            for threads in [2, 3, 8] {
                let together = with_threads(threads, || net.solve(near_null_space));
                assert!(alone == together, "{sides:?} {stride} {threads}");
            }
        }
    }
}

/// Numbers that are mixed up cost no iterations.
#[test]
fn numbering_does_not_matter() {
    let iterations = |stride| {
        let net = Net::new([61, 61, 1], stride, 1e2);
        net.solve(NearNullSpace::RigidMotions).1
    };
    let (in_order, mixed) = (iterations(1), iterations(1009));
    assert!(mixed <= in_order + in_order / 4, "{mixed} and {in_order}");
}
