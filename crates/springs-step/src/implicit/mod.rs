//! What implicit methods share: linear systems of a step, stages, estimates.

pub(crate) mod checked_solver;
pub(crate) mod components;
pub(crate) mod corrections;
pub(crate) mod linear;
pub(crate) mod moving_frame;
pub(crate) mod response;
pub(crate) mod solver_options;
pub(crate) mod stage;
pub(crate) mod tensions;
