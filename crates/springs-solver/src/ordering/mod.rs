//! Orders of elimination.
//!
//! Blocks are ordered, not scalars: that gives the same fill at a fraction of the
//! time, because the scalars of a block have the same neighbours.

mod band;
mod dissection;
mod elimination;
mod graph;
mod lists;
mod minimum_degree;

pub(crate) use band::by_breadth;
pub use elimination::elimination_order;
pub(crate) use elimination::{Elimination, NONE, best_elimination};
pub(crate) use lists::Lists;
