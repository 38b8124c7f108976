//! What a solver takes is what was forecast, and little more than its factor.

use allocation_counter::measure;
use springs_solver::{Options, Solver};

/// A ring, each block with one more that hangs on it.
fn ring_with_pendants(n: u32) -> (usize, Vec<[u32; 2]>) {
    let ends = (0..n).flat_map(|k| [[k, (k + 1) % n], [k, n + k]]);
    (2 * n as usize, ends.collect())
}

/// The complete bipartite graph.
fn bipartite(a: u32, b: u32) -> (usize, Vec<[u32; 2]>) {
    let ends = (0..b).flat_map(|k| (0..a).map(move |i| [i, a + k]));
    ((a + b) as usize, ends.collect())
}

fn grid(n: u32) -> (usize, Vec<[u32; 2]>) {
    let right = (0..n * n).filter(|k| k % n + 1 < n).map(|k| [k, k + 1]);
    let down = (0..n * (n - 1)).map(|k| [k, k + n]);
    ((n * n) as usize, right.chain(down).collect())
}

/// Forecast, and the most that was allocated at once, in bytes.
fn bytes((n_blocks, pairs): &(usize, Vec<[u32; 2]>), threads: usize) -> [f64; 2] {
    let options = Options {
        threads,
        ..Options::default()
    };
    let forecast = Solver::memory(*n_blocks, pairs, options).unwrap();
    let most = measure(|| {
        let mut solver = Solver::analyze(*n_blocks, pairs, options).unwrap();
        let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; *n_blocks];
        for &block in pairs.as_flattened() {
            for entry in [0, 3, 5] {
                diagonal[block as usize][entry] += 1.0;
            }
        }
        let off_diagonal = vec![[-1.0, 0.0, 0.0, -1.0, 0.0, -1.0]; pairs.len()];
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        let mut x = vec![1.0; 3 * n_blocks];
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        // A + 1 and −1 for each pair: the solution of ones is one.
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-11));
    });
    [forecast as f64, most.bytes_max as f64]
}

/// Paths of fronts with many branches: what each branch adds above it is as small
/// as what it touches there.
#[test]
fn a_ring_with_pendants_takes_linear_memory() {
    let [small, large] = [1000, 10_000].map(|n| bytes(&ring_with_pendants(n), 2));
    for (small, large) in small.into_iter().zip(large) {
        // Ten times, where all branches times all columns above them were a hundred.
        assert!(large < 15.0 * small, "{small} and {large} bytes");
    }
    // Of a ring block three blocks of the factor at least, of a pendant two.
    let factor = 8.0 * 9.0 * 5.0 * 10_000.0;
    let [forecast, most] = large;
    assert!(forecast < 5.0 * factor, "{forecast} of {factor}");
    assert!(most < 10.0 * factor, "{most} of {factor}");
    assert!(most < 2.5 * forecast, "{most} of {forecast}");
}

/// Many fronts with one parent: their updates are not all there at once.
#[test]
fn a_bipartite_graph_takes_little_more_than_its_factor() {
    let factor = 8.0 * (9.0 * 100.0 * 3000.0 + 300.0 * 300.0);
    for threads in [1, 2] {
        let [forecast, most] = bytes(&bipartite(100, 3000), threads);
        assert!(forecast < 3.0 * factor, "{forecast} of {factor}");
        assert!(most < 5.0 * factor, "{most} of {factor}");
    }
}

#[test]
fn forecasts_of_ordinary_graphs_are_right() {
    // The dense kernels get buffers of their own when a thread first calls them.
    bytes(&grid(40), 1);
    for n in [30, 60] {
        let [forecast, most] = bytes(&grid(n), 1);
        assert!(
            forecast < most && most < 1.5 * forecast,
            "{n}: {most} of {forecast}"
        );
    }
}

/// However updates wait and whoever computes them.
#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for (n_blocks, pairs) in [bipartite(40, 900), ring_with_pendants(3000)] {
        let solution = |threads| {
            let options = Options {
                threads,
                ..Options::default()
            };
            let mut solver = Solver::analyze(n_blocks, &pairs, options).unwrap();
            let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; n_blocks];
            let mut off_diagonal = Vec::new();
            for (k, pair) in pairs.iter().enumerate() {
                let u = [1.0, (k as f64).sin(), (2.0 * k as f64).cos()];
                let entries = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
                let block = entries.map(|(row, column)| u[row] * u[column]);
                for &end in pair {
                    for (sum, entry) in diagonal[end as usize].iter_mut().zip(block) {
                        *sum += entry;
                    }
                }
                off_diagonal.push(block.map(|entry| -entry));
            }
            solver.set_matrix(&diagonal, &off_diagonal).unwrap();
            let mut x: Vec<f64> = (0..3 * n_blocks).map(|row| (row as f64).sin()).collect();
            solver.solve_in_place(&mut x, 1e-11).unwrap();
            x
        };
        let alone = solution(1);
        assert!(
            [2, 3, 8]
                .into_iter()
                .all(|threads| solution(threads) == alone)
        );
    }
}
