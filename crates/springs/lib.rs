//! Mass-spring simulation.
//!
//! One name for the crates of the workspace, for someone who runs scenes:
//!
//! | module | crate | holds |
//! | --- | --- | --- |
//! | [`math`] | `springs-math` | energy, force and Hessian kernels |
//! | [`scene`] | `springs-scene` | scenes as plain data, generators, validation |
//! | [`assembly`] | `springs-assembly` | global mass, force and sparse Hessian |
//! | [`solver`] | `springs-solver` | solution of sparse systems |
//! | [`statics`] | `springs-statics` | equilibrium, load paths, modes, form finding |
//! | [`step`] | `springs-step` | methods, time loop, frames, report |
//! | [`io`] | `springs-io` | scene files, trajectories, reports |
//!
//! and what belongs to no single one of them: [`report`], [`inspect`],
//! [`sinks`], [`filmstrip`], [`plots`], [`view`], [`study`] and [`sweep`].
//!
//! ```
//! use springs::scene::generate::{Material, cloth};
//! use springs::step::{Outcome, Simulation};
//!
//! let scene = cloth(8, Material::of_cloth());
//! let mut simulation = Simulation::new(&scene)?;
//! assert_eq!(simulation.run(60, &mut ())?, Outcome::Finished);
//! assert!(simulation.nodes().positions[63].z < 0.0, "the cloth falls");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod drawing;
pub mod filmstrip;
pub mod inspect;
pub mod plots;
pub mod report;
pub mod sinks;
pub mod study;
pub mod sweep;
pub mod view;

pub use springs_assembly as assembly;
pub use springs_io as io;
pub use springs_math as math;
pub use springs_scene as scene;
pub use springs_solver as solver;
pub use springs_statics as statics;
pub use springs_step as step;

/// The programs in the README and the guide run as they are.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
#[doc = include_str!("../../docs/guide/src/library.md")]
mod guide {}
