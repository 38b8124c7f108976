//! Force and Hessian of springs in cache, in ns per spring: by two functions as
//! a full matrix, and at once as six entries.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Vector3};
use springs::math::spring::{Spring, force, hessian_block, linearize};
use std::hint::black_box;

const SPRINGS: usize = 4096;

fn kernels(criterion: &mut Criterion) {
    let spring = Spring {
        stiffness: 100.0,
        rest_length: 0.9,
    };
    let difference = |k: usize| {
        let k = k as f64;
        Vector3::new(k.sin(), (1.3 * k).cos(), 0.4 + (0.7 * k).sin())
    };
    let mut group = criterion.benchmark_group("kernels");
    group.throughput(Throughput::Elements(SPRINGS as u64));

    let differences: Vec<Vector3<f64>> = (0..SPRINGS).map(difference).collect();
    let mut out = vec![(Vector3::zeros(), Matrix3::zeros()); SPRINGS];
    group.bench_function("force, full block", |bencher| {
        bencher.iter(|| {
            for (out, dx) in out.iter_mut().zip(&differences) {
                let origin = Vector3::zeros();
                *out = (
                    force(spring, &origin, dx),
                    hessian_block(spring, &origin, dx),
                );
            }
            black_box(&mut out);
        });
    });

    let mut out = vec![(Vector3::zeros(), [0.0; 6]); SPRINGS];
    group.bench_function("at once, packed", |bencher| {
        bencher.iter(|| {
            for (out, dx) in out.iter_mut().zip(&differences) {
                *out = linearize(spring, None, dx, |across| across);
            }
            black_box(&mut out);
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = common::criterion();
    targets = kernels
}
criterion_main!(benches);
