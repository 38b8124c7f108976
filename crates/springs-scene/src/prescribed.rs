//! Motions that fixed nodes follow.

use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A displacement as a function of time, which fixed nodes are moved by beside
/// x₀ + v t.
#[derive(Clone, Debug, PartialEq)]
pub enum PrescribedMotion {
    /// `amplitude`·sin(2π·`frequency`·t + `phase`).
    Sine {
        /// In m.
        amplitude: Vector3<f64>,
        /// In Hz.
        frequency: f64,
        /// In rad.
        phase: f64,
    },
    /// Through points (time in s, displacement in m), in the order of time, at rest at
    /// both ends and beyond. Between points each component is a monotone cubic, whose
    /// slopes at the points are the harmonic means of Fritsch and Butland (SIAM J. Sci.
    /// Stat. Comput. 5, 1984): velocities are continuous, and nothing overshoots.
    Table(Arc<[(f64, Vector3<f64>)]>),
}

/// What a motion is at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// In m.
    pub displacement: Vector3<f64>,
    /// In m/s.
    pub velocity: Vector3<f64>,
    /// In m/s².
    pub acceleration: Vector3<f64>,
}

impl Displacement {
    fn at_rest(displacement: Vector3<f64>) -> Self {
        Self {
            displacement,
            velocity: Vector3::zeros(),
            acceleration: Vector3::zeros(),
        }
    }
}

impl PrescribedMotion {
    /// What it is at a time in s; a table without points is no displacement.
    pub fn at(&self, time: f64) -> Displacement {
        match self {
            Self::Sine {
                amplitude,
                frequency,
                phase,
            } => {
                let rate = TAU * frequency;
                let (sine, cosine) = (rate * time + phase).sin_cos();
                Displacement {
                    displacement: amplitude * sine,
                    velocity: amplitude * (rate * cosine),
                    acceleration: amplitude * (-rate * rate * sine),
                }
            }
            Self::Table(points) => {
                let after = points.partition_point(|(point, _)| *point <= time);
                if after == 0 || after == points.len() {
                    let nearest = points.get(after).or(points.last());
                    let displacement = nearest.map_or(Vector3::zeros(), |(_, at)| *at);
                    return Displacement::at_rest(displacement);
                }
                piece(points, after - 1, time)
            }
        }
    }

    /// All that it is made of.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Sine {
                amplitude,
                frequency,
                phase,
            } => vec![amplitude.x, amplitude.y, amplitude.z, *frequency, *phase],
            Self::Table(points) => {
                let points = points.iter();
                points
                    .flat_map(|(time, at)| [*time, at.x, at.y, at.z])
                    .collect()
            }
        }
    }

    /// Times in s at which the acceleration jumps.
    pub fn kinks(&self) -> Vec<f64> {
        match self {
            Self::Sine { .. } => Vec::new(),
            Self::Table(points) => points.iter().map(|(time, _)| *time).collect(),
        }
    }

    /// In s; infinite where nothing is repeated.
    pub fn period(&self) -> f64 {
        match self {
            Self::Sine { frequency, .. } => frequency.abs().recip(),
            Self::Table(_) => f64::INFINITY,
        }
    }

    /// The same for somebody whose time begins `start` s later.
    pub fn after(&self, start: f64) -> Self {
        match self {
            Self::Sine {
                amplitude,
                frequency,
                phase,
            } => Self::Sine {
                amplitude: *amplitude,
                frequency: *frequency,
                phase: (phase + TAU * (frequency * start).fract()).rem_euclid(TAU),
            },
            Self::Table(points) => {
                let later = points.iter().map(|(time, at)| (time - start, *at));
                Self::Table(later.collect())
            }
        }
    }
}

/// The cubic from a point to the next one.
fn piece(points: &[(f64, Vector3<f64>)], first: usize, time: f64) -> Displacement {
    let [(t0, x0), (t1, x1)] = [points[first], points[first + 1]];
    let h = t1 - t0;
    let s = (time - t0) / h;
    let [v0, v1] = [first, first + 1].map(|point| slope(points, point));
    let mean = (x1 - x0) / h;
    let bend = mean * 3.0 - v0 * 2.0 - v1;
    let curve = v0 + v1 - mean * 2.0;
    Displacement {
        displacement: x0 + (v0 + (bend + curve * s) * s) * (s * h),
        velocity: v0 + (bend * 2.0 + curve * (3.0 * s)) * s,
        acceleration: (bend * 2.0 + curve * (6.0 * s)) / h,
    }
}

/// The velocity at a point, in m/s.
fn slope(points: &[(f64, Vector3<f64>)], point: usize) -> Vector3<f64> {
    if point == 0 || point + 1 == points.len() {
        return Vector3::zeros();
    }
    let [(t0, x0), (t1, x1), (t2, x2)] = [points[point - 1], points[point], points[point + 1]];
    let (before, after) = (t1 - t0, t2 - t1);
    let of_component = |k: usize| {
        let (a, b) = ((x1[k] - x0[k]) / before, (x2[k] - x1[k]) / after);
        if a * b <= 0.0 {
            return 0.0;
        }
        let (weight_a, weight_b) = (before + 2.0 * after, 2.0 * before + after);
        (weight_a + weight_b) / (weight_a / a + weight_b / b)
    };
    Vector3::new(of_component(0), of_component(1), of_component(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> [PrescribedMotion; 2] {
        let points = [
            (0.2, Vector3::new(0.1, 0.0, 0.0)),
            (0.7, Vector3::new(0.3, -1.0, 0.0)),
            (1.9, Vector3::new(0.4, 0.5, 0.0)),
            (2.0, Vector3::new(2.0, 0.6, 0.0)),
        ];
        [
            PrescribedMotion::Sine {
                amplitude: Vector3::new(0.1, 0.0, -2.0),
                frequency: 0.7,
                phase: 0.4,
            },
            PrescribedMotion::Table(points.into()),
        ]
    }

    #[test]
    fn velocities_and_accelerations_are_slopes_and_shifts_shift() {
        for motion in all() {
            let later = motion.after(0.4);
            for k in 0..100 {
                // No point of the table.
                let time = 0.013 + 0.0231 * f64::from(k);
                let [before, now, after] =
                    [time - 1e-6, time, time + 1e-6].map(|time| motion.at(time));
                let velocity = (after.displacement - before.displacement) / 2e-6;
                assert!((velocity - now.velocity).norm() < 1e-7, "{time}");
                let acceleration = (after.velocity - before.velocity) / 2e-6;
                assert!((acceleration - now.acceleration).norm() < 1e-5, "{time}");
                let shifted = later.at(time - 0.4);
                assert!((shifted.displacement - now.displacement).norm() < 1e-12);
                assert!((shifted.velocity - now.velocity).norm() < 1e-11);
            }
        }
    }

    #[test]
    fn tables_pass_through_their_points_without_overshoot_and_rest_at_the_ends() {
        let [_, table] = all();
        let PrescribedMotion::Table(points) = &table else {
            panic!("a table");
        };
        for (time, at) in points.iter() {
            assert!((table.at(*time).displacement - at).norm() < 1e-15);
        }
        for k in 0..=100 {
            let x = table.at(0.7 + 0.012 * f64::from(k)).displacement;
            assert!(
                (0.3..=0.4).contains(&x.x) && (-1.0..=0.5).contains(&x.y),
                "{x}"
            );
        }
        for time in [-1.0, 0.2, 2.0, 9.0] {
            assert_eq!(table.at(time).velocity, Vector3::zeros());
        }
        let empty = PrescribedMotion::Table([].into());
        assert_eq!(empty.at(1.0), Displacement::at_rest(Vector3::zeros()));
    }
}
