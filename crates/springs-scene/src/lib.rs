//! Mass-spring scenes as plain data.
//!
//! A [`Scene`] holds nodes, springs, gravity and the settings of a simulation.
//! It knows no formula, matrix or file. [`Scene::problems`] lists everything
//! that is wrong with it, [`generate`] makes chains, cloths and blocks.
//!
//! ```
//! use springs_scene::{Node, Scene, Vector3};
//!
//! let mut scene = Scene::default();
//! let hook = scene.add_node(Node::fixed(Vector3::zeros()));
//! let weight = scene.add_node(Node {
//!     mass: 0.2,
//!     ..Node::at(Vector3::new(0.0, 0.0, -1.0))
//! });
//! scene.add_spring(hook, weight, 100.0);
//! assert_eq!(scene.springs[0].rest_length, 1.0);
//! assert!(scene.problems().is_empty());
//!
//! scene.springs[0].stiffness = -1.0;
//! let problem = &scene.problems()[0];
//! assert_eq!(problem.path().to_string(), "springs[0].stiffness");
//! ```

pub mod generate;
mod islands;
mod law;
mod load;
mod output;
mod path;
mod prescribed;
mod pretension;
mod problem;
mod problems;
mod scene;
mod settings;
mod text;

pub use islands::{Island, Partition};
pub use law::{LawFault, LawField, LawForm, Quantity, SpringLaw};
pub use load::{Load, OverTime};
pub use nalgebra::Vector3;
pub use output::{Output, Probe, ProbeQuantity, Probed};
pub use path::Path;
pub use prescribed::{Displacement, PrescribedMotion};
pub use pretension::{AxialStiffness, PretensionError, rest_length_under};
pub use problem::Problem;
pub use problems::out_of_order;
pub use scene::{BreakLimit, Guide, NamedMotion, NoDampingRatio, Node, Rayleigh, Scene, Spring};
pub use settings::{
    LinearTolerance, Method, RunOptions, Settings, Start, StepControl, Tangent, UnknownName,
};
pub use text::{printable, printable_within};
