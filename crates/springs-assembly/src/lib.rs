//! From a scene to the global mass, force and sparse Hessian.
//!
//! [`compile`] numbers the nodes (free ones first), lumps the masses, sorts the
//! springs into batches and fixes the sparsity pattern. The resulting
//! [`System`] fills forces and matrices for any positions and velocities,
//! without sorting or allocating. It knows neither solvers nor time nor files.
//!
//! The three concepts of the note's section 2 are three modules: degrees of
//! freedom ([`Numbering`]), elements that carry mass ([`Element`]), and force
//! emitters with their gradient ([`Emitter`]: [`Springs`], [`Dashpots`], gravity,
//! and whatever [`Terms`] somebody writes, see [`compile_with`]).
//!
//! Global vectors are slices of one `Vector3` per node in compiled order; a
//! node in that order is a *block*. Unknowns are the free blocks, a prefix.
//! f = −∂V/∂x and H = +∂²V/∂x².
//!
//! ```
//! use springs_assembly::{Evaluation, Weights, compile};
//! use springs_scene::generate::{Material, chain};
//!
//! let system = compile(&chain(3, Material::of_chain(3)))?;
//! assert_eq!(system.n_free(), 3);
//!
//! let mut linearization = system.linearization();
//! let (x, v) = (system.initial_positions(), system.initial_velocities());
//! let at = Evaluation::new(x, v, Weights::STIFFNESS);
//! system.linearize(&at, &mut linearization);
//! let stiffness: Vec<(usize, usize, f64)> = linearization.matrix.triplets().collect();
//! assert!(stiffness.contains(&(0, 0, 6e4)));
//! # Ok::<(), springs_assembly::CompileError>(())
//! ```

mod anchor_works;
mod compile;
mod connections;
mod dashpots;
mod dofs;
mod drag;
mod elements;
mod emitter;
mod energy;
mod gravity;
mod guides;
mod lanes;
mod laws;
mod linear_runs;
mod loads;
mod matrix;
mod motion;
mod prescribed;
mod run;
mod segments;
mod sorting;
mod springs;
mod sums;
mod system;
mod terms;

pub use compile::{Compilation, CompileError, compile, compile_with};
pub use dashpots::Dashpots;
pub use dofs::Numbering;
pub use elements::{Element, PointMasses, SpringMasses};
pub use emitter::{
    BrokenSpring, Emitter, Evaluation, MemoryUpdate, Nature, Notable, OwnStiffness, Projection,
    SpringNumbers, StiffnessKind, Strained, Weights,
};
pub use energy::{Energy, Lines};
pub use loads::{History, Loads};
pub use matrix::{BlockMatrix, BlockPattern, OffDiagonal, PACKED};
pub use motion::Motion;
pub use prescribed::Prescribed;
pub use springs::{SpringBetween, Springs};
pub use system::{Linearization, PreparedProducts, System, SystemPart};
pub use terms::{Term, Terms};
