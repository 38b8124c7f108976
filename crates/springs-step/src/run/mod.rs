//! The way through a duration: steps, frames, parts, sleep.

pub(crate) mod breaks;
pub(crate) mod dense_output;
pub(crate) mod frames;
pub(crate) mod islands;
pub(crate) mod members;
pub(crate) mod observer;
pub(crate) mod part;
pub(crate) mod probes;
pub(crate) mod record;
pub(crate) mod simulation;
pub(crate) mod sleep;
pub(crate) mod stepper;
pub(crate) mod works;
