//! Which method and which steps: settings, controller, trial runs, and the choice of
//! methods.

pub(crate) mod auto;
pub(crate) mod choice;
pub(crate) mod choose;
pub(crate) mod controller;
pub(crate) mod costs;
pub(crate) mod plan;
pub(crate) mod timetable;
pub(crate) mod trials;
