//! What several tests need.

// Every test binary takes what it needs.
#![allow(dead_code, unused_imports, unreachable_pub)]

#[path = "../../crates/springs-step/tests/common/mod.rs"]
mod scenes;
pub mod workspace;

pub use scenes::*;

use std::path::{Path, PathBuf};

/// The scenes of the examples.
pub fn real_scenes() -> impl Iterator<Item = PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    let entries = std::fs::read_dir(folder).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|ending| ending == "ron"))
}
