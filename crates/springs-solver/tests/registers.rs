//! What runs after a factorization is as fast as what ran before it.

use springs_solver::{Options, Solver};
use std::hint::black_box;
use std::time::Instant;

/// Plain code for registers of 128 bits: seconds, the least of many attempts.
fn seconds() -> f64 {
    let x = black_box(vec![1.5f64; 512]);
    let mut y = black_box(vec![0.5f64; 512]);
    let once = |_| {
        let start = Instant::now();
        for _ in 0..20 {
            for (y, x) in y.iter_mut().zip(&x) {
                *y = (*y + x * 0.125) / (1.0 + x * x).sqrt();
            }
            black_box(&mut y);
        }
        start.elapsed().as_secs_f64()
    };
    (0..50).map(once).fold(f64::INFINITY, f64::min)
}

/// The kernels of wide fronts leave vector registers dirty, which makes plain code
/// several times slower to the end of the thread on processors where that matters.
#[test]
fn plain_code_is_as_fast_after_a_factorization_as_before() {
    let before = seconds();
    for n_blocks in (5..70).chain([150]) {
        let ends = (0..n_blocks).flat_map(|b| (0..b).map(move |a| [a, b]));
        let pairs: Vec<[u32; 2]> = ends.collect();
        let diagonal = vec![[200.0, 0.0, 0.0, 200.0, 0.0, 200.0]; n_blocks as usize];
        let off_diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; pairs.len()];
        let mut solver = Solver::analyze(n_blocks as usize, &pairs, Options::default()).unwrap();
        solver.set_matrix(&diagonal, &off_diagonal).unwrap();
        let after_matrix = seconds();
        let mut x = vec![1.0; 3 * n_blocks as usize];
        solver.solve_in_place(&mut x, 1e-11).unwrap();
        let after = seconds().max(after_matrix);
        assert!(
            after < 2.0 * before,
            "{n_blocks} blocks: {after:e} s instead of {before:e} s"
        );
    }
}
