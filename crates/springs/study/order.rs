//! The order of a method, where its runs show one.

use super::Trial;

/// Slopes between runs next to each other must agree to this.
const SPREAD: f64 = 0.35;
/// Numbers of steps must differ by this factor to give a slope.
const APART: f64 = 1.25;
/// Slopes that are looked at, and the least number of them.
const MOST: usize = 4;
const FEWEST: usize = 2;

/// How fast the error falls with the number of steps: the mean of the slopes,
/// both logarithmic, between the finest runs of one method. None unless three
/// runs at least, of errors that are neither worthless nor those of the
/// reference, have slopes that agree: elsewhere the error does not fall as a
/// power of the step, and there is no order.
pub(super) fn observed_order(trials: &[&Trial]) -> Option<f64> {
    let mut runs: Vec<(f64, f64)> = trials
        .iter()
        .filter(|trial| !trial.at_floor && !trial.worthless && trial.error > 0.0)
        .map(|trial| (trial.steps as f64, trial.error))
        .collect();
    runs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let slopes: Vec<f64> = runs
        .windows(2)
        .map(|pair| {
            let [fine, coarse] = [pair[0], pair[1]];
            if fine.0 > APART * coarse.0 {
                (coarse.1 / fine.1).ln() / (fine.0 / coarse.0).ln()
            } else {
                f64::NAN
            }
        })
        .collect();
    let agrees = |slope: &&f64| (**slope - slopes[0]).abs() <= SPREAD && **slope > 0.0;
    let agreeing: Vec<f64> = slopes
        .iter()
        .take(MOST)
        .take_while(agrees)
        .copied()
        .collect();
    let mean = agreeing.iter().sum::<f64>() / agreeing.len() as f64;
    (agreeing.len() >= FEWEST).then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Setting;

    fn order_of(runs: &[(u64, f64)]) -> Option<f64> {
        let trial = |&(steps, error): &(u64, f64)| Trial {
            method: "dop853".to_owned(),
            setting: Setting::Tolerance(1.0),
            steps,
            seconds: 1.0,
            repeats: 1,
            error,
            error_over_time: error,
            at_floor: error < 1e-12,
            worthless: error > 0.1,
        };
        let trials: Vec<Trial> = runs.iter().map(trial).collect();
        observed_order(&trials.iter().collect::<Vec<_>>())
    }

    #[test]
    fn powers_of_the_step_have_an_order() {
        let runs: Vec<(u64, f64)> = (0..8).map(|k| (10 << k, 3.0 * 0.25f64.powi(k))).collect();
        assert!((order_of(&runs).unwrap() - 2.0).abs() < 1e-12);
    }

    /// Where stability sets the step, errors fall though steps do not get more.
    #[test]
    fn plateaus_and_accidents_have_none() {
        assert_eq!(order_of(&[(500, 3e-7), (501, 1e-8), (502, 4e-9)]), None);
        assert_eq!(order_of(&[(100, 1e-2), (200, 1e-2), (400, 1e-2)]), None);
        assert_eq!(order_of(&[(100, 1e-2), (200, 1e-4), (400, 9e-5)]), None);
        assert_eq!(order_of(&[(100, 1e-2), (200, 2.5e-3)]), None);
        assert_eq!(order_of(&[(100, 0.5), (200, 1e-2), (400, 2.5e-3)]), None);
        assert_eq!(order_of(&[(100, 1e-2), (200, 2.5e-3), (400, 1e-14)]), None);
        assert_eq!(order_of(&[]), None);
    }
}
