//! What several tests need.

// Every test binary takes what it needs.
#![allow(dead_code, unused_imports, unreachable_pub)]

#[path = "../../crates/springs-step/tests/common/mod.rs"]
mod scenes;
pub mod workspace;

pub use scenes::*;
