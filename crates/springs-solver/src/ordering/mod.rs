//! Orders of elimination.
//!
//! Blocks are ordered, not scalars: that gives the same fill at a fraction of the
//! time, because the scalars of a block have the same neighbours.

mod dissection;
mod elimination;
mod forest;
mod graph;
mod lists;
mod minimum_degree;
mod schedule;

pub use elimination::elimination_order;
pub(crate) use elimination::{Elimination, NONE, best_elimination};
pub(crate) use forest::Forest;
pub(crate) use lists::Lists;
pub(crate) use schedule::{AT_ONCE, Joint, NO_PARENT, Part, Schedule, Turn};
