//! A few moments of a run side by side, as an SVG picture.

mod drawing;
mod strains;
mod view;

pub use drawing::filmstrip;

use nalgebra::Vector3;

/// One moment of a run.
#[derive(Clone, Debug)]
pub struct Panel {
    /// In s.
    pub time: f64,
    /// Position of every node of the scene, in m.
    pub positions: Vec<Vector3<f64>>,
}
