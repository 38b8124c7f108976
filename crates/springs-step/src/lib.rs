//! Time integration of mass-spring scenes.
//!
//! [`Simulation`] runs a scene from its settings and hands out frames;
//! [`Islands`] does so for each part of a scene that does not feel the others, and
//! can be saved and resumed;
//! [`Stepper`] makes single steps for someone who writes their own loop; a
//! [`Method`] is one way to make a step, and others can be added from outside.
//!
//! ```
//! use springs_scene::generate::{Material, chain};
//! use springs_step::{NodeStates, Stepper};
//!
//! let scene = chain(10, Material::of_chain(10));
//! let mut nodes = NodeStates::of(&scene);
//! let mut stepper = Stepper::new(&scene)?;
//! while stepper.time() < 0.5 {
//!     stepper.step(&mut nodes, 1.0 / 60.0)?;
//! }
//! assert!(nodes.positions[10].z < -0.4, "the chain swings down");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod anchors;
mod auto;
mod checked_solver;
mod choice;
mod choose;
mod components;
mod controller;
mod dop853;
mod doubling;
mod error;
mod filtered_leapfrog;
mod flows;
mod frame;
mod frames;
mod hidden;
mod implicit_euler;
mod implicit_midpoint;
mod interpolate;
mod islands;
mod ledger;
mod linear;
mod linearly_implicit_euler;
mod method;
mod methods;
mod observer;
mod parallel;
mod plan;
mod response;
mod rest;
mod rodas4;
mod simulation;
mod splitting;
mod stage;
mod state;
mod stepper;
mod tr_bdf2;
mod trials;
mod work;

pub use anchors::Anchors;
pub use choice::{Choice, Pace};
pub use dop853::Dop853;
pub use doubling::Doubling;
pub use error::{Cause, MethodError, SetupError, StepError, Suspect};
pub use filtered_leapfrog::FilteredLeapfrog;
pub use flows::Flows;
pub use hidden::{ForeignState, HiddenState};
pub use implicit_euler::ImplicitEuler;
pub use implicit_midpoint::ImplicitMidpoint;
pub use interpolate::interpolate;
pub use islands::{Islands, Part};
pub use ledger::Ledger;
pub use linear::solver_memory;
pub use linearly_implicit_euler::LinearlyImplicitEuler;
pub use method::{ErrorEstimate, Interval, Method};
pub use methods::{Properties, ToleranceKind, methods, properties};
pub use observer::{Account, Frame, Observer, Outcome, Patience};
pub use plan::StepPlan;
pub use rodas4::Rodas4;
pub use simulation::{Simulation, Switch};
pub use splitting::Splitting;
pub use state::{NodeStates, State};
pub use stepper::Stepper;
pub use tr_bdf2::TrBdf2;
pub use work::{Counts, Phases, Work};
