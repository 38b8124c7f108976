//! The matrix M + h²H of the scenes in motion, at h = 1/60 s: ordering and
//! symbolic factorization, and then, by every strategy, taking a matrix and
//! solving with it, strictly (1e-11) and sufficiently for a step (1e-6).

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use springs::assembly::{Evaluation, Linearization, OffDiagonal, Projection, Weights};
use springs::scene::{Method, Scene, StepControl};
use springs::solver::{NearNullSpace, Options, Solver, Strategy};
use springs::step::Simulation;

const H: f64 = 1.0 / 60.0;

/// The scene after a quarter of a second: its matrix and right-hand side.
fn in_motion(scene: &Scene) -> (Simulation, Linearization, Vec<f64>) {
    let mut scene = scene.clone();
    scene.settings.method = Method::LinearlyImplicitEuler;
    scene.settings.step = StepControl::Fixed(H);
    let mut simulation = Simulation::new(&scene).expect("a sound scene");
    for _ in 0..15 {
        simulation.step().expect("a step");
    }
    let (system, state) = (simulation.stepper().system(), simulation.stepper().state());
    let at = Evaluation {
        projection: Projection::Clamp,
        ..Evaluation::new(&state.x, &state.v, Weights::of_step(H))
    };
    let mut out = system.linearization();
    system.linearize(&at, &mut out);
    let momenta = system.masses().iter().zip(&state.v).zip(&out.forces);
    let rhs = momenta.flat_map(|((m, v), f)| <[f64; 3]>::from(v * *m + f * H));
    let rhs = rhs.collect();
    (simulation, out, rhs)
}

fn solver(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("solver");
    for scene in common::scenes() {
        let (simulation, out, b) = in_motion(&scene);
        let (system, matrix) = (simulation.stepper().system(), &out.matrix);
        let pairs = system.pattern().pairs();
        let n_free = system.n_free();
        let positions: Vec<[f64; 3]> = system.initial_positions()[..n_free]
            .iter()
            .map(|position| (*position).into())
            .collect();
        let analyze = |strategy| {
            let options = Options {
                positions: Some(&positions),
                strategy,
                near_null_space: NearNullSpace::RigidMotions,
                ..Options::default()
            };
            Solver::analyze(n_free, pairs, options).expect("enough memory")
        };
        let present: Vec<[f64; 3]> = simulation.stepper().state().x[..n_free]
            .iter()
            .map(|position| (*position).into())
            .collect();
        let id = |what: &str| BenchmarkId::new(what, &scene.name);
        group.bench_function(id("symbolic"), |bencher| {
            bencher.iter(|| analyze(Strategy::Double));
        });
        let OffDiagonal::Symmetric(pairs) = matrix.off_diagonal() else {
            panic!("springs have symmetric blocks");
        };
        let mut strategies = vec![(Strategy::Double, "double"), (Strategy::Auto, "automatic")];
        // Without fill there is only one strategy.
        if !scene.name.starts_with("chain") {
            strategies.push((Strategy::Iterative, "iterative"));
        }
        for (strategy, name) in strategies {
            let mut solver = analyze(strategy);
            let take = |solver: &mut Solver| {
                solver.set_positions(&present);
                solver
                    .set_matrix(matrix.diagonal(), pairs)
                    .expect("positive definite");
            };
            group.bench_function(id(&format!("matrix, {name}")), |bencher| {
                bencher.iter(|| take(&mut solver));
            });
            for (accuracy, how) in [(1e-11, "strict"), (1e-6, "sufficient")] {
                let mut x = b.clone();
                group.bench_function(id(&format!("solution, {name}, {how}")), |bencher| {
                    bencher.iter(|| {
                        x.copy_from_slice(&b);
                        solver.solve_in_place(&mut x, accuracy).expect("definite");
                    });
                });
            }
        }
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = common::criterion();
    targets = solver
}
criterion_main!(benches);
