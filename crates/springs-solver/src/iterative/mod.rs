//! Solution by iteration.

mod aggregates;
mod coarse;
mod conjugate_gradients;
mod motions;
mod multilevel;
mod rows;
mod stretches;

pub(crate) use coarse::{MakeCoarse, Pattern, in_plane, in_space, translations};
pub(crate) use conjugate_gradients::{ConjugateGradients, Ending, Until};
pub(crate) use motions::Place;
pub(crate) use multilevel::Multilevel;
pub(crate) use rows::Rows;
