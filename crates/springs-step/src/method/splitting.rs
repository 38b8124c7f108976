//! Explicit kick–drift–kick methods: velocity Verlet and the compositions of
//! Blanes and Moan.

use super::passes::{add_to_errors, kick_and_drift, last_kick};
use crate::flows::Impulses;
use crate::method::weighing::Weighing;
use crate::work::timed;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::SolveError;

/// A symmetric composition of kicks v += b h M⁻¹f(x, v) and drifts x += a h v,
/// beginning and ending with a kick. The last force of a step is the first of
/// the next.
///
/// Symplectic and time-reversible without dashpots: linear and angular momentum
/// are kept to rounding, the energy error stays bounded.
///
/// Compositions of Blanes and Moan estimate their errors with the accelerations aᵢ of
/// their stages alone, once steps of [changing size](Method::expect_changing_steps) are
/// expected: e_v = h Σ dᵢ aᵢ and e_x = h² Σ gᵢ aᵢ. The weights d and g are such that, whatever
/// the forces, both are of the order of the method's own errors, but for e_v of order 6, which
/// is of one less: they are orthogonal to all conditions of Runge–Kutta–Nyström methods of
/// lower order (Hairer, Nørsett, Wanner: Solving Ordinary Differential Equations I, 1993,
/// II.14).
pub struct Splitting {
    order: u32,
    kicks: Vec<f64>,
    drifts: Vec<f64>,
    /// At the start of the step before, at the start of the step, and at its end.
    last_accelerations: Vec<Vector3<f64>>,
    accelerations: Vec<Vector3<f64>>,
    next_accelerations: Vec<Vector3<f64>>,
    /// Velocities that the dashpots see, now, at the start of the step and at that of the
    /// step before; empty without dashpots.
    seen: Vec<Vector3<f64>>,
    seen_at_start: Vec<Vector3<f64>>,
    last_seen: Vec<Vector3<f64>>,
    accelerations_are_known: bool,
    /// The forces that damp at the start of the step were the last ones evaluated.
    damping_is_evaluated: bool,
    impulses: Impulses,
    /// At the end of the last step, in J, if everything is finite.
    kinetic_energy: Option<f64>,
    error_weights: Option<ErrorWeights>,
    /// Where errors are estimated.
    weighing: Option<Weighing>,
}

/// Weights of the accelerations of all stages in errors of a step.
///
/// In a vibration of angular frequency ω with z = hω they give about the true error e of
/// the method, over all of its stable range: e_x is 0.7 e to 2 e, and e_v/ω is e_x/z with
/// SRKN₁₁ᵇ, and with SRKN₆ᵇ e at z = 0.9 (1.5 e for slow ones, e/50 at 4.6).
#[derive(Clone, Copy)]
struct ErrorWeights {
    /// The first half of g, for positions; the other half is the same with the sign changed.
    positions: &'static [f64],
    /// The first half of d, for velocities, with the middle if there is one.
    velocities: &'static [f64],
    /// The other half of d is the same, and not with the sign changed.
    are_even: bool,
    /// The errors of a step are in proportion to this power of the step size and one more.
    order: u32,
    /// Up to this z vibrations are told. Beyond it SRKN₆ᵇ makes them grow or swell by far more
    /// than e_x.
    largest_angle: f64,
}

/// For SRKN₆ᵇ. Both errors are of the order of the method itself.
const OF_SRKN6: ErrorWeights = ErrorWeights {
    positions: &[
        -0.0032949424604711715,
        0.01552602989630708,
        0.006588268792504265,
        0.0,
    ],
    velocities: &[
        -0.00048259170462670495,
        0.024692571190478713,
        -0.012079774037222324,
        -0.024260410897259357,
    ],
    are_even: true,
    order: 4,
    largest_angle: 4.5,
};

/// For SRKN₁₁ᵇ. That of positions is of the order of the method itself, that of velocities of
/// one less.
const OF_SRKN11: ErrorWeights = ErrorWeights {
    positions: &HALF_OF_SRKN11,
    velocities: &HALF_OF_SRKN11,
    are_even: false,
    order: 5,
    largest_angle: f64::INFINITY,
};

const HALF_OF_SRKN11: [f64; 6] = [
    0.0003681868748325809,
    -0.005335963692186853,
    -0.006995673137780308,
    0.004490090147824518,
    0.0020037283274758717,
    0.005381369157980688,
];

impl ErrorWeights {
    /// g and d of stage `i` of `n`.
    fn of_stage(self, i: usize, n: usize) -> [f64; 2] {
        let mirrored = i.min(n - 1 - i);
        let sign = if i > mirrored { -1.0 } else { 1.0 };
        let of_velocities = self.velocities[mirrored];
        [
            sign * self.positions[mirrored],
            if self.are_even {
                of_velocities
            } else {
                sign * of_velocities
            },
        ]
    }
}

impl Splitting {
    /// Velocity Verlet: order 2, one force a step, stable for hω < 2 (Swope et
    /// al., J. Chem. Phys. 76, 1982).
    ///
    /// Forces that depend on velocities are taken at the velocity predicted for
    /// the end of the step, which keeps order 2 (Groot and Warren, J. Chem.
    /// Phys. 107, 1997, with λ = 1).
    pub fn velocity_verlet(system: &System) -> Self {
        Self::symmetric(system, 2, &[0.5], &[1.0], None)
    }

    /// Order 4, six forces a step: SRKN₆ᵇ of Blanes and Moan, J. Comput. Appl.
    /// Math. 142 (2002), table 3. For forces that do not depend on velocities.
    pub fn blanes_moan_4(system: &System) -> Self {
        let b = [0.0829844064174052, 0.396309801498368, -0.0390563049223486];
        let a = [0.245298957184271, 0.604872665711080];
        Self::symmetric(
            system,
            4,
            &[b[0], b[1], b[2], 1.0 - 2.0 * (b[0] + b[1] + b[2])],
            &[a[0], a[1], 0.5 - (a[0] + a[1])],
            Some(OF_SRKN6),
        )
    }

    /// Order 6, eleven forces a step: SRKN₁₁ᵇ of the same paper. For forces that
    /// do not depend on velocities.
    pub fn blanes_moan_6(system: &System) -> Self {
        let b = [
            0.0414649985182624,
            0.198128671918067,
            -0.0400061921041533,
            0.0752539843015807,
            -0.0115113874206879,
        ];
        let a = [
            0.123229775946271,
            0.290553797799558,
            -0.127049212625417,
            -0.246331761062075,
            0.357208872795928,
        ];
        let (last_b, middle_a) = (
            0.5 - b.iter().sum::<f64>(),
            1.0 - 2.0 * a.iter().sum::<f64>(),
        );
        Self::symmetric(
            system,
            6,
            &[b[0], b[1], b[2], b[3], b[4], last_b],
            &[a[0], a[1], a[2], a[3], a[4], middle_a],
            Some(OF_SRKN11),
        )
    }

    /// Mirrors the first half of a composition. One kick more than drifts stand
    /// in the whole, so the middle is a drift if both halves are as long, and a
    /// kick otherwise.
    fn symmetric(
        system: &System,
        order: u32,
        kicks: &[f64],
        drifts: &[f64],
        error_weights: Option<ErrorWeights>,
    ) -> Self {
        let middle_is_drift = kicks.len() == drifts.len();
        let mirror = |half: &[f64], shared: bool| -> Vec<f64> {
            let mirrored = half.iter().rev().skip(usize::from(shared));
            half.iter().chain(mirrored).copied().collect()
        };
        let seen = if system.is_damped() {
            system.initial_velocities().to_vec()
        } else {
            Vec::new()
        };
        Self {
            order,
            kicks: mirror(kicks, !middle_is_drift),
            drifts: mirror(drifts, middle_is_drift),
            last_accelerations: vec![Vector3::zeros(); system.n_free()],
            accelerations: vec![Vector3::zeros(); system.n_free()],
            next_accelerations: vec![Vector3::zeros(); system.n_free()],
            last_seen: seen.clone(),
            seen_at_start: seen.clone(),
            seen,
            accelerations_are_known: false,
            damping_is_evaluated: false,
            impulses: Impulses::new(system),
            kinetic_energy: None,
            error_weights,
            weighing: None,
        }
    }

    /// Adds what the accelerations `a` of stage `i` say of the errors of a step of size `h`.
    fn add_to_errors(&mut self, i: usize, h: f64) {
        let (Some(weights), Some(weighing)) = (self.error_weights, &mut self.weighing) else {
            return;
        };
        let [g, d] = weights.of_stage(i, self.kicks.len());
        let a = if i == 0 {
            &self.accelerations
        } else {
            &self.next_accelerations
        };
        add_to_errors(a, [g * h * h, d * h], i == 0, weighing.errors());
    }

    /// Those of the last step.
    pub(crate) fn last_flows(&self) -> &Flows {
        self.impulses.flows()
    }

    /// The last accepted step is taken back.
    pub(crate) fn go_back(&mut self) {
        std::mem::swap(&mut self.accelerations, &mut self.last_accelerations);
        std::mem::swap(&mut self.seen_at_start, &mut self.last_seen);
        self.damping_is_evaluated = false;
    }

    /// Accelerations at the start and at the end of the last accepted step, and at the
    /// end of the one made since, in m/s².
    pub(crate) fn last_accelerations(&self) -> [&[Vector3<f64>]; 3] {
        [
            &self.last_accelerations,
            &self.accelerations,
            &self.next_accelerations,
        ]
    }

    /// Accelerations at a time, positions and velocities; forces that damp stay evaluated.
    fn accelerate(
        system: &System,
        (time, x, v): (f64, &[Vector3<f64>], &[Vector3<f64>]),
        accelerations: &mut [Vector3<f64>],
        impulses: &mut Impulses,
        work: &mut Work,
    ) {
        timed(&mut work.phases.assembly, || {
            let forces = system.static_forces(x, accelerations);
            impulses.evaluate_damping(system, x, v);
            for damping in impulses.evaluated() {
                for (force, damping) in forces.iter_mut().zip(damping) {
                    *force += damping;
                }
            }
            system.add_loads(time, forces);
            system.divide_by_masses(forces);
        });
        work.counts.force_evaluations += 1;
    }
}

impl Method for Splitting {
    fn order(&self) -> u32 {
        self.order
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        let new = |weights: ErrorWeights| Weighing::new(system, weights.order);
        self.weighing = self.error_weights.map(new);
        Ok(())
    }

    fn longest_step(&self, system: &System) -> f64 {
        let fastest = system.frequency_bound();
        match self.error_weights {
            Some(weights) if fastest.is_finite() => weights.largest_angle / fastest,
            _ => f64::INFINITY,
        }
    }

    fn restart(&mut self) {
        self.accelerations_are_known = false;
        if let Some(weighing) = &mut self.weighing {
            weighing.restart();
        }
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let h = interval.size;
        let (is_damped, n_free) = (system.is_damped(), system.n_free());
        if !self.accelerations_are_known {
            let start = (interval.start, &state.x[..], &state.v[..]);
            let accelerations = &mut self.accelerations;
            Self::accelerate(system, start, accelerations, &mut self.impulses, work);
            (self.accelerations_are_known, self.damping_is_evaluated) = (true, true);
            if is_damped {
                self.seen_at_start.copy_from_slice(&state.v);
            }
        }
        self.impulses.begin(system, &state.v);
        if let Some(weighing) = &mut self.weighing {
            weighing.begin(&state.v);
        }
        if is_damped {
            self.seen.copy_from_slice(&state.v);
        }
        let seen = if is_damped {
            &self.seen_at_start
        } else {
            &state.v
        };
        let first_kick = self.kicks[0] * h;
        if !self.damping_is_evaluated {
            self.impulses.evaluate_damping(system, &state.x, seen);
        }
        self.damping_is_evaluated = false;
        self.impulses.add_evaluated(first_kick);
        self.impulses
            .add_anchor_works(system, first_kick, &state.x, seen);
        let mut kicked_at = interval.start;
        let mut elapsed = 0.0;
        for stage in 0..self.drifts.len() {
            let (kick, next_kick) = (self.kicks[stage] * h, self.kicks[stage + 1] * h);
            let drift = self.drifts[stage] * h;
            elapsed += drift;
            self.add_to_errors(stage, h);
            let now = if stage == 0 {
                &self.accelerations
            } else {
                &self.next_accelerations
            };
            self.impulses
                .add_kick(system, kick, kicked_at, (&state.v, now));
            kick_and_drift(now, kick, &mut state.v, drift, &mut state.x);
            if is_damped {
                for ((seen, v), a) in self.seen.iter_mut().zip(&state.v).zip(now) {
                    *seen = *v + a * next_kick;
                }
            }
            let last = stage + 1 == self.drifts.len();
            let time = if last {
                interval.end
            } else {
                interval.start + elapsed
            };
            anchors.place(time, &mut state.x, &mut state.v);
            if is_damped {
                self.seen[n_free..].copy_from_slice(&state.v[n_free..]);
            }
            let seen = if is_damped { &self.seen } else { &state.v };
            let (next, impulses) = (&mut self.next_accelerations, &mut self.impulses);
            Self::accelerate(system, (time, &state.x, seen), next, impulses, work);
            impulses.add_evaluated(next_kick);
            impulses.add_anchor_works(system, next_kick, &state.x, seen);
            kicked_at = time;
        }
        self.add_to_errors(self.drifts.len(), h);
        let kick = self.kicks[self.drifts.len()] * h;
        let last = (&state.v[..], &self.next_accelerations[..]);
        self.impulses.add_kick(system, kick, kicked_at, last);
        let accelerations = &self.next_accelerations;
        self.kinetic_energy =
            last_kick(accelerations, kick, &mut state.v, &state.x, system.masses());
        self.impulses.finish(system, &state.v);
        let weighing = self.weighing.as_mut();
        Ok(weighing.map(|weighing| weighing.estimate(h, state)))
    }

    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let mut weighing = self.weighing.take()?;
        let estimate = weighing.second_estimate(self, (system, state), work);
        self.weighing = Some(weighing);
        Some(estimate)
    }

    fn least_estimate(&self) -> Option<ErrorEstimate> {
        self.weighing.as_ref().map(Weighing::least_estimate)
    }

    fn archive(&mut self, archive: &mut Archive) {
        archive.flag(&mut self.accelerations_are_known);
        archive.vectors(&mut self.last_accelerations);
        archive.vectors(&mut self.accelerations);
        archive.vectors(&mut self.seen_at_start);
        archive.vectors(&mut self.last_seen);
        if archive.is_loading() {
            self.damping_is_evaluated = false;
        }
        if let Some(weighing) = &mut self.weighing {
            weighing.archive(archive);
        }
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.last_accelerations, &mut self.accelerations);
        std::mem::swap(&mut self.accelerations, &mut self.next_accelerations);
        std::mem::swap(&mut self.last_seen, &mut self.seen_at_start);
        std::mem::swap(&mut self.seen_at_start, &mut self.seen);
        self.damping_is_evaluated = true;
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }

    fn kinetic_energy(&self) -> Option<f64> {
        self.kinetic_energy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_assembly::compile;
    use springs_scene::generate::{Material, chain};

    /// The vectors that weights of accelerations have to be orthogonal to, so that what they
    /// give vanishes up to an order, one list an order (the same source, table 14.3). With
    /// those of order 1 to p, h Σ dᵢ aᵢ = O(hᵖ⁺¹).
    fn conditions(method: &Splitting) -> [Vec<Vec<f64>>; 5] {
        let n = method.kicks.len();
        let mut c = vec![0.0; n];
        for i in 1..n {
            c[i] = c[i - 1] + method.drifts[i - 1];
        }
        let apply = |y: &[f64]| -> Vec<f64> {
            let row = |i: usize| (0..i).map(|j| method.kicks[j] * (c[i] - c[j]) * y[j]).sum();
            (0..n).map(row).collect()
        };
        let times =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
        let one = vec![1.0; n];
        let c2 = times(&c, &c);
        let (a1, ac) = (apply(&one), apply(&c));
        [
            vec![one.clone()],
            vec![c.clone()],
            vec![c2.clone(), a1.clone()],
            vec![times(&c2, &c), times(&c, &a1), ac.clone()],
            vec![
                times(&c2, &c2),
                times(&c2, &a1),
                times(&c, &ac),
                times(&a1, &a1),
                apply(&c2),
                apply(&a1),
            ],
        ]
    }

    #[test]
    fn errors_vanish_up_to_the_orders_that_are_claimed() {
        let system = compile(&chain(3, Material::of_chain(3))).unwrap();
        // Errors of positions have another factor of h.
        for (method, orders) in [
            (Splitting::blanes_moan_4(&system), [3, 4]),
            (Splitting::blanes_moan_6(&system), [5, 5]),
        ] {
            let weights = method.error_weights.unwrap();
            let n = method.kicks.len();
            let of = |which: usize| -> Vec<f64> {
                (0..n).map(|i| weights.of_stage(i, n)[which]).collect()
            };
            for (which, order) in orders.into_iter().enumerate() {
                let weights = of(which);
                let misses = |condition: &Vec<f64>| {
                    let sum: f64 = condition.iter().zip(&weights).map(|(a, b)| a * b).sum();
                    sum.abs()
                };
                let conditions = conditions(&method);
                let (kept, next) = conditions.split_at(order);
                for condition in kept.iter().flatten() {
                    assert!(misses(condition) < 1e-16, "{}", misses(condition));
                }
                let largest = next.iter().flatten().map(misses).fold(0.0, f64::max);
                assert!(next.is_empty() || largest > 1e-5, "{largest}");
            }
        }
    }

    /// In a vibration they are about the true error, as far as steps are stable.
    #[test]
    fn errors_of_vibrations_are_about_right() {
        let system = compile(&chain(3, Material::of_chain(3))).unwrap();
        for (method, longest) in [
            (Splitting::blanes_moan_4(&system), 4.6),
            (Splitting::blanes_moan_6(&system), 8.6),
        ] {
            let weights = method.error_weights.unwrap();
            let n = method.kicks.len();
            for k in 2..=20 {
                let z = longest * f64::from(k) / 20.0;
                let (mut error, mut estimate) = (0.0f64, 0.0f64);
                for phase in (0..20).map(|k| 0.05 * std::f64::consts::PI * f64::from(k)) {
                    // x'' = −z²x, h = 1.
                    let (x0, v0) = (phase.cos(), z * phase.sin());
                    let (mut x, mut v, mut e_x) = (x0, v0, 0.0);
                    for i in 0..n {
                        let a = -z * z * x;
                        e_x += weights.of_stage(i, n)[0] * a;
                        v += method.kicks[i] * a;
                        x += method.drifts.get(i).map_or(0.0, |drift| drift * v);
                    }
                    let (sin, cos) = z.sin_cos();
                    let (exact_x, exact_v) = (x0 * cos + v0 / z * sin, v0 * cos - z * x0 * sin);
                    error = error.max((x - exact_x).hypot((v - exact_v) / z));
                    estimate = estimate.max(e_x.abs());
                }
                let ratio = estimate / error;
                assert!((0.6..2.2).contains(&ratio), "{z}: {ratio}");
            }
        }
    }
}
