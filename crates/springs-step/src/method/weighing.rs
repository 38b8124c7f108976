//! Weighing errors of positions and velocities of a step.

use crate::implicit::response::Response;
use crate::method::time_scale;
use crate::vectors::{LargestSum, largest_change, largest_magnitude, largest_sum, spread};
use crate::{Archive, ErrorEstimate, Method, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;

/// Errors e_x of positions and e_v of velocities of a step, and what they add to the error
/// at the end.
///
/// An error of velocities moves positions by no more than e_v/ω in a vibration
/// of frequency ω, and by T e_v in free motion, where T is the time in which the
/// motion itself changes. As in [`crate::TrBdf2`] both are met by
///
///   w = (M + TD + T²S)⁻¹ T²M e_v,
///
/// and a step adds ‖e_x‖ + (‖e_v‖·‖w‖)^½ to the error of positions. That is no
/// more than ‖e_x‖ + T‖e_v‖: only if that is too large the system is solved,
/// with the matrix of the method or, if it has none, by conjugate gradients. Even
/// then Ω of ‖w‖/‖e_v‖ = 1/(1/T² + Ω²), the frequency that e_v seems to have, is
/// mostly the last one. Methods with a matrix damp what their steps do not
/// resolve, so such vibrations are damped in e_v first.
pub(crate) struct Weighing {
    /// The power of the step size that both are in proportion to, over a step.
    order: u32,
    /// Velocities at the start of the last step, in m/s, and e_x and e_v at its end.
    velocities: Vec<Vector3<f64>>,
    errors_of_positions: Vec<Vector3<f64>>,
    errors: Vec<Vector3<f64>>,
    /// ‖e_x‖ + T‖e_v‖, where it is, and ‖e_x‖ and ‖e_v‖.
    largest: LargestSum,
    step_size: f64,
    /// T, in s.
    time_scale: f64,
    stiffness: Stiffness,
    response: Response,
}

/// What was last found out of how springs hold errors of velocities back.
#[derive(Clone, Copy, Default)]
struct Stiffness {
    /// Ω, in rad/s.
    frequency: f64,
    /// ‖e_v‖ at that time, in m/s, and over the power of the step size that it is in proportion
    /// to.
    errors: [f64; 2],
    /// Estimates until it is found out anew, and when that was last done.
    pause: u32,
    last_pause: u32,
    /// How often in a row it was found to be the same.
    times_same: u32,
}

/// Estimates that are made with one Ω: twice as many whenever it was found to be the
/// same.
const SHORTEST_PAUSE: u32 = 16;
/// At least so many for each iteration of conjugate gradients, which then cost about a
/// tenth of the steps.
const ESTIMATES_PER_ITERATION: u32 = 8;
const LONGEST_PAUSE: u32 = 256;
/// It is the same within this factor.
const SAME: f64 = 1.5;
/// It is found out anew when errors have grown so many times, and not as they do with steps:
/// they may be other ones; twice as many whenever it was found to be the same, up to the largest.
const GROWN: f64 = 2.0;
const MOST_GROWN: f64 = 8.0;

/// Which part of the difference between two halves of a step and the whole is the error of
/// the halves, with a method of this order.
pub(crate) fn part_of_difference(order: u32) -> f64 {
    1.0 / (2f64.powi(order as i32) - 1.0)
}

impl Weighing {
    /// For errors that are in proportion to this power of the step size, over a step.
    pub(crate) fn new(system: &System, order: u32) -> Self {
        Self {
            order,
            velocities: vec![Vector3::zeros(); system.n_free()],
            errors_of_positions: vec![Vector3::zeros(); system.n_free()],
            errors: vec![Vector3::zeros(); system.n_free()],
            largest: LargestSum::default(),
            step_size: 0.0,
            time_scale: 0.0,
            stiffness: Stiffness::default(),
            response: Response::default(),
        }
    }

    /// As if no step had been made.
    pub(crate) fn restart(&mut self) {
        self.stiffness = Stiffness::default();
    }

    /// A step begins with these velocities.
    pub(crate) fn begin(&mut self, v: &[Vector3<f64>]) {
        let n_free = self.velocities.len();
        self.velocities.copy_from_slice(&v[..n_free]);
    }

    /// e_x in m and e_v in m/s of the free blocks, to be set before [`Self::estimate`].
    pub(crate) fn errors(&mut self) -> [&mut [Vector3<f64>]; 2] {
        [&mut self.errors_of_positions, &mut self.errors]
    }

    /// The estimate of a step of size `h` in s that ended at `state`.
    pub(crate) fn estimate(&mut self, h: f64, state: &State) -> ErrorEstimate {
        let n_free = self.velocities.len();
        let acceleration = largest_change(&state.v[..n_free], &self.velocities) / h;
        self.time_scale = time_scale(spread(&state.v), acceleration, h);
        self.largest = largest_sum(&self.errors_of_positions, self.time_scale, &self.errors);
        self.step_size = h;
        self.told(self.largest.sum)
    }

    /// The part ‖e_x‖, which no second estimate is below.
    pub(crate) fn least_estimate(&self) -> ErrorEstimate {
        self.told(self.largest.of_each[0])
    }

    /// [`Self::estimate`] with w of the documentation of the type, by the matrix of `method` if
    /// it has one.
    pub(crate) fn second_estimate(
        &mut self,
        method: &mut dyn Method,
        at: (&System, &State),
        work: &mut Work,
    ) -> ErrorEstimate {
        let (h, errors) = (self.step_size, &mut self.errors);
        if let Some(damped) = self.response.by_matrix(method, at, h, errors, work) {
            std::mem::swap(damped, errors);
            self.largest.of_each[1] = largest_magnitude(errors);
        }
        let [positions, velocities] = self.largest.of_each;
        let time = self.time_of_errors(method, at, velocities, work);
        self.told(positions + time * velocities)
    }

    fn told(&self, error: f64) -> ErrorEstimate {
        ErrorEstimate {
            rate: error / self.step_size,
            exponent: f64::from(self.order),
            block: self.largest.block,
        }
    }

    /// (‖w‖/‖e_v‖)^½, in s, for e_v of size `error` in m/s.
    fn time_of_errors(
        &mut self,
        method: &mut dyn Method,
        at: (&System, &State),
        error: f64,
        work: &mut Work,
    ) -> f64 {
        let (time, last) = (self.time_scale, &mut self.stiffness);
        let errors = [1.0, self.step_size.powi(self.order as i32 + 1)].map(|power| error / power);
        last.pause = last.pause.saturating_sub(1);
        let grown = (GROWN * 2f64.powi(last.times_same as i32)).min(MOST_GROWN);
        let mut both = errors.iter().zip(&last.errors);
        let have_grown = both.all(|(now, last)| *now > grown * last);
        if error > 0.0 && (last.pause == 0 || have_grown) {
            let (response, e_v) = (&mut self.response, &self.errors);
            let (left, n_iterations) = match response.by_matrix(method, at, time, e_v, work) {
                Some(left) => (largest_magnitude(left), 0),
                None => response.bound(at, time, e_v, work),
            };
            let frequency = (error / left - 1.0).max(0.0).sqrt() / time;
            let is_same = (frequency / SAME..=frequency * SAME).contains(&last.frequency);
            let pause = if is_same {
                (2 * last.last_pause).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
            } else {
                SHORTEST_PAUSE.max(ESTIMATES_PER_ITERATION * n_iterations)
            };
            *last = Stiffness {
                frequency,
                errors,
                pause,
                last_pause: pause,
                times_same: if is_same { last.times_same + 1 } else { 0 },
            };
        }
        time.recip().hypot(last.frequency).recip()
    }

    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        archive.real(&mut self.stiffness.frequency);
        for error in &mut self.stiffness.errors {
            archive.real(error);
        }
        archive.count(&mut self.stiffness.pause);
        archive.count(&mut self.stiffness.last_pause);
        archive.count(&mut self.stiffness.times_same);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Anchors, Doubling, ImplicitMidpoint, Interval, Splitting, VerletPairs};
    use springs_assembly::compile;
    use springs_scene::RunOptions;
    use springs_scene::generate::{Material, cloth};

    /// From steps that resolve all vibrations to the longest, and with errors that have grown
    /// since stiffness was last found out and that have not.
    #[test]
    fn sharp_estimates_are_between_the_least_and_twice_the_first() {
        let mut scene = cloth(5, Material::of_cloth());
        for (index, node) in scene.nodes.iter_mut().enumerate() {
            let phase = 1.3 * index as f64;
            node.velocity = Vector3::new(phase.sin(), phase.cos(), (2.0 * phase).sin()) * 0.3;
        }
        let system = compile(&scene).unwrap();
        let midpoint = ImplicitMidpoint::new(&system, &RunOptions::default()).unwrap();
        let mut methods: [Box<dyn Method>; 4] = [
            Box::new(VerletPairs::new(&system)),
            Box::new(Splitting::blanes_moan_4(&system)),
            Box::new(Splitting::blanes_moan_6(&system)),
            Box::new(Doubling::new(&system, Box::new(midpoint))),
        ];
        let work = &mut Work::default();
        for (which, method) in methods.iter_mut().enumerate() {
            method.expect_changing_steps(&system).unwrap();
            for angle in [0.01, 0.1, 1.0, 1.9, 0.1] {
                let mut state = State::initial(&system);
                let anchors = Anchors::new(&system, &state);
                let size = angle / system.frequency_bound();
                let interval = Interval {
                    start: 0.0,
                    end: size,
                    size,
                };
                let first = method.step(&system, &anchors, interval, &mut state, work);
                let first = first.unwrap().unwrap().rate;
                let least = method.least_estimate().unwrap().rate;
                let second = method.second_estimate(&system, &state, work).unwrap().rate;
                // The largest errors of positions and of velocities may be at two nodes.
                assert!(
                    least > 0.0 && least <= second && second <= 2.0 * first,
                    "{which}, {angle}: {least:e} {second:e} {first:e}"
                );
            }
        }
    }

    /// Errors of velocities e h³: with the same e and longer steps they grow and are the same
    /// ones, with a larger e and shorter steps they do not grow; with a larger e and the same
    /// steps they are other ones.
    #[test]
    fn stiffness_is_found_out_anew_when_errors_are_other_ones() {
        let system = compile(&cloth(5, Material::of_cloth())).unwrap();
        let state = State::initial(&system);
        let method = &mut Splitting::velocity_verlet(&system);
        let mut weighing = Weighing::new(&system, 2);
        let shortest = 0.1 / system.frequency_bound();
        let mut is_found_out = |e: f64, longer: f64| {
            let h = longer * shortest;
            let [e_x, e_v] = weighing.errors();
            e_x.fill(Vector3::repeat(1e-9));
            e_v.fill(Vector3::repeat(e * longer.powi(3)));
            weighing.begin(&state.v);
            weighing.estimate(h, &state);
            let before = weighing.stiffness.errors;
            weighing.second_estimate(method, (&system, &state), &mut Work::default());
            weighing.stiffness.errors != before
        };
        assert!(is_found_out(1e-6, 1.0));
        assert!(!is_found_out(1e-6, 1.0));
        assert!(!is_found_out(1e-6, 3.0));
        assert!(!is_found_out(0.3e-6, 3.0));
        assert!(!is_found_out(5e-6, 0.5));
        // Uniform errors have no frequency, which was found to be the same as at first.
        assert!(!is_found_out(3e-6, 1.0));
        assert!(is_found_out(5e-6, 1.0));
        assert!(!is_found_out(30e-6, 1.0));
        assert!(is_found_out(50e-6, 1.0));
    }
}
