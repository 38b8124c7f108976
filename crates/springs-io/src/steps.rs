//! `steps.csv`: the steps of a run.

use crate::table::{Rows, Table};
use serde::Serialize;
use std::io::Write as _;

/// A step, or of a scene in several parts what they came to together. Counts are those since
/// the start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepRow {
    /// At its end, in s.
    pub time: f64,
    /// In s.
    pub step_size: f64,
    /// What it added to the error of positions, by estimate, in m.
    pub error: Option<f64>,
    /// What it was allowed to add, in m.
    pub allowed_error: Option<f64>,
    /// The method.
    pub method: &'static str,
    /// Steps made.
    pub steps: u64,
    /// Steps made and thrown away because their error was too large.
    pub rejected_steps: u64,
    /// Evaluations of all forces.
    pub force_evaluations: u64,
    /// Numeric factorizations.
    pub factorizations: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Iterations of conjugate gradients.
    pub solver_iterations: u64,
}

/// The output `steps`: a row per step; no number where there is no estimate.
pub static STEPS: Table = Table {
    name: "steps",
    about: "steps.csv: size, estimated error and work of every step",
    file: "steps.csv",
    columns: &[
        "time",
        "step_size",
        "error",
        "allowed_error",
        "method",
        "steps",
        "rejected_steps",
        "force_evaluations",
        "factorizations",
        "newton_iterations",
        "solver_iterations",
    ],
    rows: Rows::Steps(row),
};

fn row(step: &StepRow, bytes: &mut Vec<u8>) {
    let StepRow {
        time,
        step_size,
        error,
        allowed_error,
        method,
        steps,
        rejected_steps,
        force_evaluations,
        factorizations,
        newton_iterations,
        solver_iterations,
    } = step;
    let [error, allowed_error] = [error, allowed_error]
        .map(|number| number.map_or(String::new(), |number| format!("{number:?}")));
    writeln!(
        bytes,
        "{time:?},{step_size:?},{error},{allowed_error},{method},{steps},{rejected_steps},\
         {force_evaluations},{factorizations},{newton_iterations},{solver_iterations}"
    )
    .expect("writing to memory");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_not_there_leaves_its_place_empty() {
        let mut step = StepRow {
            time: 0.5,
            step_size: 0.25,
            error: None,
            allowed_error: None,
            method: "velocity-verlet",
            steps: 1,
            rejected_steps: 2,
            force_evaluations: 3,
            factorizations: 4,
            newton_iterations: 5,
            solver_iterations: 6,
        };
        let mut bytes = Vec::new();
        row(&step, &mut bytes);
        (step.error, step.allowed_error) = (Some(1e-9), Some(0.1));
        row(&step, &mut bytes);
        let columns = STEPS.columns.len();
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(
            text,
            "0.5,0.25,,,velocity-verlet,1,2,3,4,5,6\n0.5,0.25,1e-9,0.1,velocity-verlet,1,2,3,4,5,6\n"
        );
        assert!(text.lines().all(|line| line.split(',').count() == columns));
    }
}
