//! A solver that is asked to stop does so, and is as good as new afterwards.

use springs_solver::{Interrupt, Options, SolveError, Solver, Strategy};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

const SIDE: u32 = 14;
const N_BLOCKS: usize = (SIDE * SIDE * SIDE) as usize;

/// The pairs of a cubic grid.
fn grid() -> Vec<[u32; 2]> {
    let index = |i: u32, j: u32, k: u32| (k * SIDE + j) * SIDE + i;
    let mut pairs = Vec::new();
    for k in 0..SIDE {
        for j in 0..SIDE {
            for i in 0..SIDE {
                let neighbours = [(i + 1, j, k), (i, j + 1, k), (i, j, k + 1)];
                for (i2, j2, k2) in neighbours {
                    if i2.max(j2).max(k2) < SIDE {
                        pairs.push([index(i, j, k), index(i2, j2, k2)]);
                    }
                }
            }
        }
    }
    pairs
}

fn identity(s: f64) -> [f64; 6] {
    [s, 0.0, 0.0, s, 0.0, s]
}

fn solved(solver: &mut Solver, n_pairs: usize, diagonal: f64) -> Result<Vec<f64>, SolveError> {
    solver.set_matrix(
        &vec![identity(diagonal); N_BLOCKS],
        &vec![identity(-1.0); n_pairs],
    )?;
    let mut x: Vec<f64> = (0..3 * N_BLOCKS).map(|k| (k as f64).sin()).collect();
    solver.solve_in_place(&mut x, 1e-11)?;
    Ok(x)
}

#[test]
fn work_under_way_ends() {
    let pairs = grid();
    for (strategy, threads) in [
        (Strategy::Double, 1),
        (Strategy::Double, 2),
        (Strategy::Iterative, 1),
    ] {
        let options = Options {
            strategy,
            threads,
            ..Options::default()
        };
        let flag = Arc::new(AtomicBool::new(false));
        let mut solver = Solver::analyze(N_BLOCKS, &pairs, options).unwrap();
        let expected = solved(&mut solver, pairs.len(), 6.001).unwrap();
        solver.set_interrupt(&Interrupt::from(flag.clone()));
        // Sooner or later the flag is raised while there is something to stop.
        let interrupted = (0..200).any(|k| {
            flag.store(false, Ordering::SeqCst);
            let raised = flag.clone();
            let raise = thread::spawn(move || {
                thread::sleep(Duration::from_micros(50 * k));
                raised.store(true, Ordering::SeqCst);
            });
            let result = solved(&mut solver, pairs.len(), 6.001);
            let was_raised = flag.load(Ordering::SeqCst);
            raise.join().unwrap();
            assert!(was_raised || result.is_ok(), "{strategy:?}");
            result == Err(SolveError::Interrupted)
        });
        assert!(interrupted, "{strategy:?} with {threads} threads");
        let solve = |solver: &mut Solver| solver.solve_in_place(&mut vec![1.0; 3 * N_BLOCKS], 1e-3);
        assert_eq!(solve(&mut solver), Err(SolveError::NoMatrix));
        flag.store(false, Ordering::SeqCst);
        assert_eq!(solved(&mut solver, pairs.len(), 6.001).unwrap(), expected);
    }
}

#[test]
fn nothing_is_begun_after_a_request() {
    let flag = Arc::new(AtomicBool::new(true));
    // A forest is eliminated another way.
    let pairs: Vec<[u32; 2]> = (1..N_BLOCKS as u32).map(|k| [k - 1, k]).collect();
    let mut solver = Solver::analyze(N_BLOCKS, &pairs, Options::default()).unwrap();
    solver.set_interrupt(&Interrupt::from(flag));
    let result = solved(&mut solver, pairs.len(), 3.0);
    assert_eq!(result, Err(SolveError::Interrupted));
    assert_eq!(solver.counts().factorizations, 0);
    solver.set_interrupt(&Interrupt::default());
    assert!(solved(&mut solver, pairs.len(), 3.0).is_ok());
}
