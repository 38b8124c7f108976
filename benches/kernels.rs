//! Force and Hessian of springs in cache, in ns per spring: one spring at a
//! time as a full matrix, and eight side by side as six entries.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Vector3};
use springs::assembly::PACKED;
use springs::math::lanes::{LANES, Lane, Separations, tension};
use springs::math::spring::{Spring, force, hessian_block};
use std::hint::black_box;

const GROUPS: usize = 512;
const SPRINGS: usize = GROUPS * LANES;

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
    group.bench_function("one at a time", |bencher| {
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

    let lanes: Vec<[Lane; 3]> = (0..GROUPS)
        .map(|group| {
            std::array::from_fn(|axis| {
                std::array::from_fn(|lane| difference(group * LANES + lane)[axis])
            })
        })
        .collect();
    let (stiffness, rest_length) = ([spring.stiffness; LANES], [spring.rest_length; LANES]);
    let mut out = vec![([[0.0; LANES]; 3], [[0.0; LANES]; 6]); GROUPS];
    group.bench_function("eight side by side", |bencher| {
        bencher.iter(|| {
            for ((forces, blocks), dx) in out.iter_mut().zip(&lanes) {
                let separations = Separations::of(dx);
                let tension = tension(&stiffness, &rest_length, &separations.length);
                let across = separations.across_stiffness(&stiffness, &tension, |s| s);
                *forces = separations
                    .direction
                    .map(|u| std::array::from_fn(|k| u[k] * tension[k]));
                *blocks = PACKED
                    .map(|(row, column)| separations.block_entry(row, column, &stiffness, &across));
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
