//! Compiling a scene, forces alone, and forces with the system matrix.

mod common;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use springs::assembly::{Evaluation, Weights, compile};

fn assembly(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("assembly");
    for scene in common::scenes() {
        group.throughput(Throughput::Elements(scene.springs.len() as u64));
        let id = |what| BenchmarkId::new(what, &scene.name);
        group.bench_function(id("compile"), |bencher| {
            bencher.iter(|| compile(&scene).expect("a sound scene"));
        });
        let system = compile(&scene).expect("a sound scene");
        let (x, v) = (system.initial_positions(), system.initial_velocities());
        let mut out = system.linearization();
        group.bench_function(id("forces"), |bencher| {
            bencher.iter(|| system.forces(0.0, x, v, &mut out.forces));
        });
        let at = Evaluation::new(x, v, Weights::of_step(1.0 / 60.0));
        group.bench_function(id("forces and matrix"), |bencher| {
            bencher.iter(|| system.linearize(&at, &mut out));
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = common::criterion();
    targets = assembly
}
criterion_main!(benches);
