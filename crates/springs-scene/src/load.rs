//! Forces on nodes from outside.

use nalgebra::Vector3;
use std::f64::consts::TAU;

/// A force on each of some nodes, wherever they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// A name for people; may be empty.
    pub name: String,
    /// Indices of the nodes, from 0.
    pub nodes: Vec<usize>,
    /// On each of them, in N.
    pub force: Vector3<f64>,
    /// What the force is multiplied by.
    pub over_time: OverTime,
}

/// A factor as a function of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum OverTime {
    /// 1.
    #[default]
    Constant,
    /// 0 before `from`, 1 after `to`, and a straight line between; times in s.
    Ramp {
        /// When it begins to rise.
        from: f64,
        /// When it has risen.
        to: f64,
    },
    /// sin(2π·`frequency`·t + `phase`).
    Sine {
        /// In Hz.
        frequency: f64,
        /// In rad.
        phase: f64,
    },
    /// Straight lines between points (time in s, factor), in the order of time; constant
    /// before the first and after the last.
    Table(Vec<[f64; 2]>),
}

impl OverTime {
    /// The factor at a time in s.
    pub fn factor(&self, time: f64) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Ramp { from, to } => ((time - from) / (to - from)).clamp(0.0, 1.0),
            Self::Sine { frequency, phase } => (TAU * frequency * time + phase).sin(),
            Self::Table(points) => match piece(points, time) {
                Ok([[t0, f0], [t1, f1]]) => f0 + (f1 - f0) * ((time - t0) / (t1 - t0)),
                Err(factor) => factor,
            },
        }
    }

    /// What the factor changes by with time, in 1/s; at a kink, what it does after.
    pub fn rate(&self, time: f64) -> f64 {
        match self {
            Self::Constant => 0.0,
            Self::Ramp { from, to } => {
                if (*from..*to).contains(&time) {
                    1.0 / (to - from)
                } else {
                    0.0
                }
            }
            Self::Sine { frequency, phase } => {
                let rate = TAU * frequency;
                rate * (rate * time + phase).cos()
            }
            Self::Table(points) => match piece(points, time) {
                Ok([[t0, f0], [t1, f1]]) => (f1 - f0) / (t1 - t0),
                Err(_) => 0.0,
            },
        }
    }

    /// All that it is made of.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Constant => Vec::new(),
            Self::Ramp { from, to } => vec![*from, *to],
            Self::Sine { frequency, phase } => vec![*frequency, *phase],
            Self::Table(points) => points.as_flattened().to_vec(),
        }
    }

    /// Times in s at which the rate jumps.
    pub fn kinks(&self) -> Vec<f64> {
        match self {
            Self::Constant | Self::Sine { .. } => Vec::new(),
            Self::Ramp { from, to } => vec![*from, *to],
            Self::Table(points) => points.iter().map(|[time, _]| *time).collect(),
        }
    }

    /// In s; infinite where nothing is repeated.
    pub fn period(&self) -> f64 {
        match self {
            Self::Sine { frequency, .. } => frequency.abs().recip(),
            Self::Constant | Self::Ramp { .. } | Self::Table(_) => f64::INFINITY,
        }
    }

    /// The same for somebody whose time begins `start` s later.
    pub fn after(&self, start: f64) -> Self {
        match self {
            Self::Constant => Self::Constant,
            Self::Ramp { from, to } => Self::Ramp {
                from: from - start,
                to: to - start,
            },
            Self::Sine { frequency, phase } => Self::Sine {
                frequency: *frequency,
                phase: (phase + TAU * (frequency * start).fract()).rem_euclid(TAU),
            },
            Self::Table(points) => {
                let later = |[time, factor]: &[f64; 2]| [time - start, *factor];
                Self::Table(points.iter().map(later).collect())
            }
        }
    }
}

/// The two points of a table around a time, or the factor beyond its ends.
fn piece(points: &[[f64; 2]], time: f64) -> Result<[[f64; 2]; 2], f64> {
    let after = points.partition_point(|[point, _]| *point <= time);
    match (points.get(after.wrapping_sub(1)), points.get(after)) {
        (Some(before), Some(after)) => Ok([*before, *after]),
        (Some([_, factor]), None) | (None, Some([_, factor])) => Err(*factor),
        (None, None) => Err(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> [OverTime; 4] {
        [
            OverTime::Constant,
            OverTime::Ramp { from: 0.5, to: 2.0 },
            OverTime::Sine {
                frequency: 0.7,
                phase: 0.3,
            },
            OverTime::Table(vec![[0.25, 1.0], [1.0, -2.0], [1.5, 0.5]]),
        ]
    }

    #[test]
    fn rates_are_slopes_and_shifts_shift() {
        for over_time in all() {
            let later = over_time.after(0.4);
            for k in 0..50 {
                // No kink.
                let time = 0.013 + 0.07 * f64::from(k);
                let slope = over_time.factor(time + 1e-6) - over_time.factor(time - 1e-6);
                let off = over_time.rate(time) - slope / 2e-6;
                assert!(off.abs() < 1e-6, "{over_time:?} at {time}: {off}");
                let off = later.factor(time - 0.4) - over_time.factor(time);
                assert!(off.abs() < 1e-12, "{over_time:?} at {time}: {off}");
            }
        }
    }

    #[test]
    fn ends_are_constant() {
        let [_, ramp, _, table] = all();
        assert_eq!([ramp.factor(0.0), ramp.factor(9.0)], [0.0, 1.0]);
        assert_eq!([table.factor(0.0), table.factor(9.0)], [1.0, 0.5]);
        assert_eq!(table.factor(1.25), -0.75);
        assert_eq!([table.rate(0.0), table.rate(9.0)], [0.0, 0.0]);
    }
}
