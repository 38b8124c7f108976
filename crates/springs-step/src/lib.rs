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
mod archive;
mod control;
mod error;
mod flows;
mod implicit;
mod ledger;
mod method;
mod run;
mod state;
mod threads;
mod vectors;
mod work;

pub use anchors::Anchors;
pub use archive::{Archive, ForeignState};
pub use control::choice::{Choice, Pace};
pub use control::costs::{CostModel, StepSizes};
pub use control::plan::StepPlan;
pub use error::{Cause, MethodError, SetupError, StepError, Suspect};
pub use flows::{BlockWorks, Flows};
pub use implicit::solver_options::solver_memory;
pub use ledger::Ledger;
pub use method::dop853::Dop853;
pub use method::doubling::Doubling;
pub use method::filtered_leapfrog::FilteredLeapfrog;
pub use method::implicit_euler::ImplicitEuler;
pub use method::implicit_midpoint::ImplicitMidpoint;
pub use method::linearly_implicit_euler::LinearlyImplicitEuler;
pub use method::rodas4::Rodas4;
pub use method::splitting::Splitting;
pub use method::table::{Properties, ToleranceKind, methods, properties};
pub use method::tr_bdf2::TrBdf2;
pub use method::verlet_pairs::VerletPairs;
pub use method::{ErrorEstimate, Interval, Method};
pub use run::breaks::Break;
pub use run::dense_output::interpolate;
pub use run::islands::Islands;
pub use run::members::{Members, Peak, Reaction};
pub use run::observer::{Account, Frame, Observer, Outcome, Patience, Samples};
pub use run::part::Part;
pub use run::probes::Sample;
pub use run::record::StepRecord;
pub use run::simulation::{ChangeError, Simulation, Switch};
pub use run::stepper::Stepper;
pub use run::works::{SupportWork, Works};
pub use state::{NodeStates, State};
pub use threads::threads;
pub use work::{Counts, Phases, Work};
