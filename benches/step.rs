//! A whole step of the running simulation, beside the plain reading of the
//! note: the same step with triplets that are rebuilt, sorted and analyzed
//! every time and solved by LDLᵀ, since they may be indefinite; once column by
//! column, as the sparse libraries of the note's time do by default, and once
//! with faer choosing between that and dense kernels. Ours is made twice, too:
//! strictly, which is the very same step, and with sufficient solutions.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Col, Conj, Par, Side};
use nalgebra::{Matrix3, Vector3};
use springs::scene::{LinearTolerance, Method, RunOptions, Scene, StepControl};
use springs::step::{NodeStates, Simulation, Stepper};

const H: f64 = 1.0 / 60.0;

#[derive(Clone, Copy, PartialEq)]
enum Factorization {
    Simplicial,
    Automatic,
}

/// Section 2.1 of the note, read plainly.
fn plain_step(scene: &Scene, nodes: &mut NodeStates, factorization: Factorization) {
    let mut unknown = vec![None; scene.nodes.len()];
    let mut n_free = 0;
    for (node, unknown) in scene.nodes.iter().zip(&mut unknown) {
        if !node.fixed {
            *unknown = Some(n_free);
            n_free += 1;
        }
    }
    let mut triplets = Vec::new();
    let mut rhs = Col::<f64>::zeros(3 * n_free);
    for (node, mass) in scene.node_masses().into_iter().enumerate() {
        let Some(block) = unknown[node] else { continue };
        for axis in 0..3 {
            let row = 3 * block + axis;
            triplets.push(Triplet::new(row, row, mass));
            rhs[row] += mass * (nodes.velocities[node][axis] + H * scene.gravity[axis]);
        }
    }
    for spring in &scene.springs {
        let [a, b] = spring.nodes;
        let dx = nodes.positions[b] - nodes.positions[a];
        let l = dx.norm();
        let force = dx * (spring.stiffness * (l - spring.rest_length) / l);
        let outer = dx * dx.transpose();
        let across = (Matrix3::identity() * (l * l) - outer) * ((l - spring.rest_length) / l);
        let block = (outer + across) * (spring.stiffness / (l * l) * H * H);
        for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            let (Some(row), Some(column)) = (unknown[row], unknown[column]) else {
                continue;
            };
            for i in 0..3 {
                for j in 0..3 {
                    let value = sign * block[(i, j)];
                    triplets.push(Triplet::new(3 * row + i, 3 * column + j, value));
                }
            }
        }
        for (node, sign) in [(a, 1.0), (b, -1.0)] {
            if let Some(block) = unknown[node] {
                for axis in 0..3 {
                    rhs[3 * block + axis] += H * sign * force[axis];
                }
            }
        }
    }
    let n = 3 * n_free;
    let matrix =
        SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets).expect("a sound matrix");
    solve(&matrix, &mut rhs, factorization);
    for (node, block) in unknown.iter().enumerate() {
        let Some(block) = block else { continue };
        let velocity = Vector3::from_fn(|axis, _| rhs[3 * block + axis]);
        nodes.velocities[node] = velocity;
        nodes.positions[node] += velocity * H;
    }
}

fn solve(matrix: &SparseColMat<usize, f64>, rhs: &mut Col<f64>, factorization: Factorization) {
    let symbolic = factorize_symbolic_cholesky(
        matrix.symbolic(),
        Side::Lower,
        SymmetricOrdering::Amd,
        CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: match factorization {
                Factorization::Simplicial => SupernodalThreshold::FORCE_SIMPLICIAL,
                Factorization::Automatic => SupernodalThreshold::AUTO,
            },
            ..CholeskySymbolicParams::default()
        },
    )
    .expect("memory");
    let mut factor = vec![0.0; symbolic.len_val()];
    let scratch = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
    let mut memory =
        MemBuffer::new(scratch.or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq)));
    symbolic
        .factorize_numeric_ldlt(
            &mut factor,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .expect("regular");
    LdltRef::new(&symbolic, &factor).solve_in_place_with_conj(
        Conj::No,
        rhs.as_mat_mut(),
        Par::Seq,
        MemStack::new(&mut memory),
    );
}

/// Both readings make the same step, or the comparison would be worth nothing.
fn check_plain_step(scene: &Scene, factorization: Factorization) {
    let (mut ours, mut plain) = (NodeStates::of(scene), NodeStates::of(scene));
    let strict = RunOptions::default().with_linear_tolerance(LinearTolerance::Strict);
    let mut stepper = Stepper::with_options(scene, &strict).expect("a sound scene");
    stepper.step(&mut ours, H).expect("a step");
    plain_step(scene, &mut plain, factorization);
    let pairs = ours.velocities.iter().zip(&plain.velocities);
    let difference = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(difference < 1e-9, "{}: {difference:e}", scene.name);
}

/// Beyond this many unknowns a plain simplicial step takes seconds.
const MOST_SIMPLICIAL: usize = 13_000;

fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    for scene in common::scenes() {
        let id = |what| BenchmarkId::new(what, &scene.name);
        for (linear_tolerance, what) in [
            (LinearTolerance::Strict, "linearly implicit Euler, strict"),
            (LinearTolerance::Sufficient, "linearly implicit Euler"),
        ] {
            let options = RunOptions::default()
                .with_threads(1)
                .with_linear_tolerance(linear_tolerance);
            let mut nodes = NodeStates::of(&scene);
            let mut stepper = Stepper::with_options(&scene, &options).expect("a sound scene");
            group.bench_function(id(what), |bencher| {
                bencher.iter(|| stepper.step(&mut nodes, H).expect("a step"));
            });
        }

        let is_chain = scene.name.starts_with("chain");
        let is_block_16 = scene.name == "block 16";
        if is_chain || (3 * scene.nodes.len() <= MOST_SIMPLICIAL && !is_block_16) {
            check_plain_step(&scene, Factorization::Simplicial);
            let mut nodes = NodeStates::of(&scene);
            group.bench_function(id("plain reading, simplicial"), |bencher| {
                bencher.iter(|| plain_step(&scene, &mut nodes, Factorization::Simplicial));
            });
        }
        check_plain_step(&scene, Factorization::Automatic);
        let mut nodes = NodeStates::of(&scene);
        group.bench_function(id("plain reading, automatic"), |bencher| {
            bencher.iter(|| plain_step(&scene, &mut nodes, Factorization::Automatic));
        });

        // A step that is stable whatever the stiffness; its cost is the same.
        let mut explicit = scene.clone();
        explicit.settings.method = Method::VelocityVerlet;
        let bound = Stepper::new(&explicit)
            .expect("a sound scene")
            .system()
            .frequency_bound();
        explicit.settings.step = StepControl::Fixed(0.1 / bound);
        explicit.settings.duration = 1e6 / bound;
        let mut simulation = Simulation::new(&explicit).expect("a sound scene");
        group.bench_function(id("velocity Verlet"), |bencher| {
            bencher.iter(|| simulation.step().expect("a step"));
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = common::criterion();
    targets = step
}
criterion_main!(benches);
