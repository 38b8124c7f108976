//! What checkpoints of runs say, and how often they are written.

use serde::{Deserialize, Serialize};
use springs::scene::Scene;
use springs::sinks::Marks;
use springs::sinks::default_intervals;
use springs::step::Islands;
use std::str::FromStr;

/// How often checkpoints are written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Every {
    Steps(u64),
    /// Of simulated time.
    Seconds(f64),
}

/// A whole number is one of steps; anything else is seconds.
impl FromStr for Every {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(steps) = text.parse() {
            return match steps {
                0 => Err("it must be one step at least".to_owned()),
                steps => Ok(Self::Steps(steps)),
            };
        }
        let seconds = text.strip_suffix('s').unwrap_or(text).parse();
        match seconds {
            Ok(seconds) if seconds > 0.0 && f64::is_finite(seconds) => Ok(Self::Seconds(seconds)),
            _ => {
                Err("steps such as 100, or simulated seconds such as 0.5s, are expected".to_owned())
            }
        }
    }
}

/// What a checkpoint says about its run, besides its state.
#[derive(Serialize, Deserialize)]
pub(super) struct About {
    pub(super) springs_version: String,
    /// The scene as it was at the start, as a scene file.
    pub(super) scene: String,
    pub(super) skip: bool,
    pub(super) intervals: usize,
    pub(super) every: Option<Every>,
    pub(super) outputs: Marks,
    /// Energy that moved so far, in J.
    pub(super) turned_over: f64,
}

impl About {
    /// A sound check sum does not make a sound run.
    pub(super) fn check(&self, scene: &Scene, islands: &Islands) -> Result<(), &'static str> {
        let duration = scene.settings.duration;
        let clocks = islands.parts().iter();
        let clocks = clocks.map(|part| part.simulation().stepper().time());
        let mut times = clocks.chain([islands.time()]);
        let nodes = islands.nodes();
        let mut numbers = nodes.positions.iter().chain(&nodes.velocities).flatten();
        let most_intervals = default_intervals(scene).max(u32::MAX as usize);
        if !times.all(|time| (0.0..=duration).contains(&time)) {
            Err("its time is not one of the run")
        } else if !numbers.all(|number| number.is_finite()) {
            Err("a node is nowhere")
        } else if !(1..=most_intervals).contains(&self.intervals) {
            Err("its number of frames is not one of a run")
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_and_seconds_are_told_apart() {
        assert_eq!("100".parse(), Ok(Every::Steps(100)));
        assert_eq!("0.5".parse(), Ok(Every::Seconds(0.5)));
        assert_eq!("2s".parse(), Ok(Every::Seconds(2.0)));
        for bad in ["0", "-1", "0.0", "often", "inf", "nans"] {
            assert!(bad.parse::<Every>().is_err(), "{bad}");
        }
    }
}
