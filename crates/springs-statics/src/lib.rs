//! Statics of mass-spring scenes.
//!
//! [`settle`] finds an equilibrium and says whether it is stable, [`trace`] follows one as
//! loads grow, past limit points, [`modes`] finds frequencies and shapes of vibrations about
//! one, and [`form_of_densities`] makes a form from force densities.
//!
//! Loads are those at the time t = 0, and moving supports are where they are then. Drag and
//! dashpots do nothing.
//!
//! ```
//! use springs_scene::{Node, Scene, Vector3};
//! use springs_statics::{Options, Status, settle};
//!
//! let mut scene = Scene {
//!     gravity: Vector3::new(0.0, 0.0, -10.0),
//!     ..Scene::default()
//! };
//! let hook = scene.add_node(Node::fixed(Vector3::zeros()));
//! let weight = scene.add_node(Node {
//!     mass: 0.2,
//!     ..Node::at(Vector3::new(1.0, 0.0, 0.0))
//! });
//! scene.add_spring(hook, weight, 100.0);
//!
//! let equilibrium = settle(&scene, &Options::default())?;
//! assert_eq!(equilibrium.status, Status::Stable);
//! assert!((equilibrium.positions[weight].z + 1.02).abs() < 1e-9);
//! # Ok::<(), springs_statics::StaticsError>(())
//! ```

mod descent;
mod equations;
mod equilibrium;
mod error;
mod form;
mod modes;
mod path;
mod rayleigh;

pub use equilibrium::{Equilibrium, Options, Reaction, Status, settle, settle_system, start};
pub use error::StaticsError;
pub use form::form_of_densities;
pub use modes::{Modes, modes};
pub use path::{LoadPath, PathEnd, PathPoint, trace};
pub use rayleigh::lowest_frequency_bound;
