//! Ordering and symbolic factorization, numeric factorization, solution, for
//! the matrix M + h²H of the scenes at h = 1/60 s.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use springs::assembly::{Evaluation, Projection, Weights, compile};
use springs::solver::{Options, SparseCholesky};

fn solver(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("solver");
    for scene in common::scenes() {
        let system = compile(&scene).expect("a sound scene");
        let at = Evaluation {
            x: system.initial_positions(),
            v: system.initial_velocities(),
            projection: Projection::Clamp,
            tensions: None,
            dashpot_tension: false,
            weights: Weights::of_step(1.0 / 60.0),
        };
        let mut out = system.linearization();
        system.linearize(&at, &mut out);
        let matrix = &out.matrix;
        let pairs = system.pattern().pairs();

        let id = |what| BenchmarkId::new(what, &scene.name);
        let n_free = system.n_free();
        let positions: Vec<[f64; 3]> = system.initial_positions()[..n_free]
            .iter()
            .map(|position| (*position).into())
            .collect();
        let analyze = || {
            let options = Options {
                positions: Some(&positions),
                ..Options::default()
            };
            SparseCholesky::analyze(n_free, pairs, options).expect("enough memory")
        };
        group.bench_function(id("symbolic"), |bencher| bencher.iter(analyze));
        let mut cholesky = analyze();
        group.bench_function(id("factorization"), |bencher| {
            bencher.iter(|| {
                cholesky
                    .factorize(matrix.diagonal(), matrix.off_diagonal())
                    .expect("positive definite")
            });
        });
        let mut rhs = vec![1.0; 3 * n_free];
        group.bench_function(id("solve"), |bencher| {
            bencher.iter(|| {
                rhs.fill(1.0);
                cholesky.solve_in_place(&mut rhs).expect("a factor");
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = common::criterion();
    targets = solver
}
criterion_main!(benches);
