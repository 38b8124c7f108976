//! Strains of springs and their colours.

use super::Panel;
use super::drawing::round;
use nalgebra::Vector3;
use plotters::style::RGBColor;
use springs_scene::{Scene, Spring};

/// Relative change of length; `None` without a rest length.
pub(super) fn strain(spring: &Spring, positions: &[Vector3<f64>]) -> Option<f64> {
    let [a, b] = spring.nodes.map(|node| positions[node]);
    (spring.rest_length > 0.0).then(|| (b - a).norm() / spring.rest_length - 1.0)
}

/// The strains that are told apart.
#[derive(Clone, Copy)]
pub(super) struct Strains {
    /// The strain, either way, that all but one spring in a hundred stay below:
    /// a few extreme springs must not take the colour from the others.
    pub(super) range: f64,
    /// The smallest and the largest.
    ends: [f64; 2],
}

impl Strains {
    pub(super) fn of(scene: &Scene, panels: &[Panel]) -> Self {
        // Those of broken springs say nothing.
        let strains = panels.iter().flat_map(|panel| {
            let springs = scene.springs.iter().enumerate();
            let whole = springs.filter(|(index, _)| panel.broken.binary_search(index).is_err());
            whole.filter_map(|(_, spring)| strain(spring, &panel.positions))
        });
        let strains: Vec<f64> = strains.filter(|strain| strain.is_finite()).collect();
        let ends = strains.iter().fold([0.0f64; 2], |[low, high], &strain| {
            [low.min(strain), high.max(strain)]
        });
        let mut sizes: Vec<f64> = strains.into_iter().map(f64::abs).collect();
        let rank = sizes.len().saturating_sub(1) * 99 / 100;
        let range = if sizes.is_empty() {
            0.0
        } else {
            *sizes.select_nth_unstable_by(rank, f64::total_cmp).1
        };
        Self { range, ends }
    }

    /// Colours that occur.
    pub(super) fn colours(&self) -> std::ops::RangeInclusive<usize> {
        let [low, high] = self.ends.map(|end| colour_of(Some(end), self.range));
        low..=high
    }

    /// What the ends of the legend say.
    pub(super) fn labels(&self) -> [String; 2] {
        let [low, high] = self.ends;
        let percent = |strain: f64| format!("{} %", round(100.0 * strain.abs()));
        let low = match -low {
            0.0 => "0 %".to_owned(),
            size if size > self.range => format!("≤ −{}", percent(self.range)),
            size => format!("−{}", percent(size)),
        };
        let high = match high {
            0.0 => "0 %".to_owned(),
            size if size > self.range => format!("≥ +{}", percent(self.range)),
            size => format!("+{}", percent(size)),
        };
        [low, high]
    }
}

/// Number of different colours, odd so that the middle is neutral.
pub(super) const COLOURS: usize = 17;

/// Compressed blue, neutral grey, stretched red: apart for the colour-blind
/// and in print.
pub(super) fn colour(index: usize) -> RGBColor {
    let middle = (COLOURS / 2) as f64;
    let signed = (index as f64 - middle) / middle;
    let end = if signed < 0.0 {
        [20.0, 80.0, 170.0]
    } else {
        [190.0, 25.0, 40.0]
    };
    let channel = |axis: usize| {
        let share = signed.abs().powf(0.7);
        (190.0 + (end[axis] - 190.0) * share).round() as u8
    };
    RGBColor(channel(0), channel(1), channel(2))
}

pub(super) fn colour_of(strain: Option<f64>, range: f64) -> usize {
    let middle = (COLOURS / 2) as f64;
    match strain {
        Some(strain) if range > 0.0 => {
            (middle + (strain / range).clamp(-1.0, 1.0) * middle).round() as usize
        }
        _ => COLOURS / 2,
    }
}
