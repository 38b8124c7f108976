//! When loads and motions change.

use springs_scene::Scene;

/// When loads and motions of a scene change: steps that are chosen from the error end
/// there, and take no more than a part of a period, so that nothing is passed over
/// which no stage of a step has seen.
#[derive(Clone, Debug)]
pub(crate) struct Timetable {
    /// Ascending, in s.
    kinks: Vec<f64>,
    longest_step: f64,
}

/// A period has at least so many steps.
const STEPS_OF_A_PERIOD: f64 = 4.0;
/// Kinks closer than this part of the duration are one.
const CLOSE: f64 = 1e-12;
/// Trial runs begin with no more steps than this.
const MOST_STEPS: f64 = 16384.0;

impl Timetable {
    /// For a run of the duration of the scene.
    pub(crate) fn of(scene: &Scene) -> Self {
        let duration = scene.settings.duration;
        let acting = scene.loads.iter().filter(|load| !load.nodes.is_empty());
        let loads = acting.map(|load| (load.over_time.kinks(), load.over_time.period()));
        let followed = scene.nodes.iter().filter_map(|node| node.motion);
        let mut followed: Vec<usize> = followed.collect();
        followed.sort_unstable();
        followed.dedup();
        let motions = followed.into_iter().map(|motion| {
            let motion = &scene.motions[motion].motion;
            (motion.kinks(), motion.period())
        });
        let (mut kinks, mut period) = (Vec::new(), f64::INFINITY);
        for (times, repeats) in loads.chain(motions) {
            kinks.extend(
                times
                    .into_iter()
                    .filter(|time| (0.0..duration).contains(time)),
            );
            period = period.min(repeats);
        }
        kinks.sort_unstable_by(f64::total_cmp);
        kinks.dedup_by(|next, kept| *next - *kept < CLOSE * duration);
        Self {
            kinks,
            longest_step: period / STEPS_OF_A_PERIOD,
        }
    }

    /// Where a step from `start` has to end at the latest, in s.
    pub(crate) fn end_of_step(&self, start: f64, duration: f64) -> f64 {
        let later = start + CLOSE * duration;
        let next = self.kinks.partition_point(|kink| *kink <= later);
        self.kinks
            .get(next)
            .map_or(duration, |kink| kink.min(duration))
    }

    /// In s.
    pub(crate) fn longest_step(&self) -> f64 {
        self.longest_step
    }

    /// So many equal steps that none is longer than the time between two kinks.
    pub(crate) fn fewest_equal_steps(&self, duration: f64) -> u64 {
        let gaps = self.kinks.windows(2).map(|pair| pair[1] - pair[0]);
        let shortest = gaps.fold(self.longest_step, f64::min);
        // The cast is of a small positive number.
        (duration / shortest).clamp(1.0, MOST_STEPS) as u64
    }
}
