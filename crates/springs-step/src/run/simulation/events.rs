//! When something happens.

use super::Simulation;
use crate::{Interval, NodeStates, StepError};

/// Events are found to this part of the step they happen in.
const EVENT_ACCURACY: f64 = 1e-12;
const MOST_BISECTIONS: usize = 60;

impl Simulation {
    /// Steps until `event`, a function of time and state, passes from negative
    /// to zero or above, and returns when that was and the state then; `None`
    /// if it does not happen within the duration. The simulation itself stands
    /// at the end of the step in which it happened, and can go on.
    ///
    /// An event that begins and ends within one step is not seen.
    ///
    /// # Errors
    ///
    /// If a step cannot be made.
    pub fn run_until(
        &mut self,
        mut event: impl FnMut(f64, &NodeStates) -> f64,
    ) -> Result<Option<(f64, NodeStates)>, StepError> {
        let mut before = event(self.stepper.time(), &self.nodes);
        while let Some(interval) = self.step()? {
            let after = event(interval.end, &self.nodes);
            if before < 0.0 && after >= 0.0 {
                return self.locate(interval, event).map(Some);
            }
            before = after;
        }
        Ok(None)
    }

    /// When within the last step an event happens, by bisection.
    fn locate(
        &mut self,
        interval: Interval,
        mut event: impl FnMut(f64, &NodeStates) -> f64,
    ) -> Result<(f64, NodeStates), StepError> {
        let (mut early, mut late) = (interval.start, interval.end);
        let mut found = self.nodes.clone();
        let mut middle_state = self.nodes.clone();
        for _ in 0..MOST_BISECTIONS {
            let middle = 0.5 * (early + late);
            if late - early <= EVENT_ACCURACY * interval.size || middle <= early || middle >= late {
                break;
            }
            self.evaluate(interval, middle, &mut middle_state)?;
            if event(middle, &middle_state) >= 0.0 {
                late = middle;
                std::mem::swap(&mut found, &mut middle_state);
            } else {
                early = middle;
            }
        }
        Ok((late, found))
    }
}
