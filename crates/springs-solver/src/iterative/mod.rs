//! Solution by iteration.

mod conjugate_gradients;
mod multilevel;
mod rows;

pub(crate) use conjugate_gradients::{ConjugateGradients, Ending, Until};
pub(crate) use multilevel::Multilevel;
pub(crate) use rows::Rows;
