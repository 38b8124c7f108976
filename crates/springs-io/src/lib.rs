//! Reads and writes mass-spring scenes (RON) and writes trajectories and reports.
