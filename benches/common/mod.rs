//! The scenes that all benchmarks share.

// Every benchmark takes what it needs.
#![allow(dead_code, unreachable_pub)]

use criterion::Criterion;
use springs::scene::Scene;
use springs::scene::generate::{Material, block, chain, cloth};
use std::time::Duration;

/// Short runs: a whole `cargo bench` is a matter of minutes.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args()
}

/// Chains of 1e3 to 1e5 springs, cloths of 16² to 128² nodes, blocks of 8³ to
/// 16³, with the default materials of the generators.
pub fn scenes() -> Vec<Scene> {
    let mut scenes = Vec::new();
    for n in [1_000, 10_000, 100_000] {
        scenes.push(chain(n, Material::of_chain(n)));
    }
    for n in [16, 32, 64, 128] {
        scenes.push(cloth(n, Material::of_cloth()));
    }
    for n in [8, 12, 16] {
        scenes.push(block(n, Material::of_block()));
    }
    scenes
}
