//! From a scene to the global mass, force and sparse Hessian.
//!
//! [`compile`] numbers the nodes (free ones first), lumps the masses, sorts the
//! springs into batches and fixes the sparsity pattern. The resulting
//! [`System`] fills forces and matrices for any positions and velocities,
//! without sorting or allocating. It knows neither solvers nor time nor files.
//!
//! The three concepts of the note's section 2 are three modules: degrees of
//! freedom ([`Numbering`]), elements that carry mass ([`Element`]), and force
//! emitters with their gradient ([`ForceEmitter`]: [`Springs`], [`Dashpots`],
//! [`Gravity`]).
//!
//! Global vectors are slices of one `Vector3` per node in compiled order; a
//! node in that order is a *block*. Unknowns are the free blocks, a prefix.
//! f = −∂V/∂x and H = +∂²V/∂x².
//!
//! ```
//! use springs_assembly::{Evaluation, Projection, Weights, compile};
//! use springs_scene::generate::{Material, chain};
//!
//! let system = compile(&chain(3, Material::of_chain(3)))?;
//! assert_eq!(system.n_free(), 3);
//!
//! let mut linearization = system.linearization();
//! let at = Evaluation {
//!     x: system.initial_positions(),
//!     v: system.initial_velocities(),
//!     projection: Projection::None,
//!     tensions: None,
//!     dashpot_tension: false,
//!     weights: Weights::STIFFNESS,
//! };
//! system.linearize(&at, &mut linearization);
//! let stiffness: Vec<(usize, usize, f64)> = linearization.matrix.triplets().collect();
//! assert!(stiffness.contains(&(0, 0, 6e4)));
//! # Ok::<(), springs_assembly::CompileError>(())
//! ```

mod batch;
mod compile;
mod dashpots;
mod dofs;
mod elements;
mod emitter;
mod gravity;
mod matrix;
mod motion;
mod springs;
mod system;

pub use compile::{CompileError, compile};
pub use dashpots::Dashpots;
pub use dofs::Numbering;
pub use elements::{Element, PointMasses, SpringMasses};
pub use emitter::{Evaluation, ForceEmitter, Projection, Weights};
pub use gravity::Gravity;
pub use matrix::{BlockMatrix, BlockPattern, PACKED};
pub use motion::Motion;
pub use springs::Springs;
pub use system::{Energy, Linearization, System, machine_threads};
