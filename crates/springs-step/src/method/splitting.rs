//! Explicit kick–drift–kick methods: velocity Verlet and the compositions of
//! Blanes and Moan.

use super::passes::{kick_and_drift, last_kick};
use crate::flows::Impulses;
use crate::work::timed;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;

/// A symmetric composition of kicks v += b h M⁻¹f(x, v) and drifts x += a h v,
/// beginning and ending with a kick. The last force of a step is the first of
/// the next.
///
/// Symplectic and time-reversible without dashpots: linear and angular momentum
/// are kept to rounding, the energy error stays bounded.
pub struct Splitting {
    order: u32,
    kicks: Vec<f64>,
    drifts: Vec<f64>,
    /// At the start of the step before, at the start of the step, and at its end.
    last_accelerations: Vec<Vector3<f64>>,
    accelerations: Vec<Vector3<f64>>,
    next_accelerations: Vec<Vector3<f64>>,
    /// Velocities that the dashpots see, now and at the start of the step; empty
    /// without dashpots.
    seen: Vec<Vector3<f64>>,
    seen_at_start: Vec<Vector3<f64>>,
    accelerations_are_known: bool,
    impulses: Impulses,
    /// At the end of the last step, in J, if everything is finite.
    kinetic_energy: Option<f64>,
}

impl Splitting {
    /// Velocity Verlet: order 2, one force a step, stable for hω < 2 (Swope et
    /// al., J. Chem. Phys. 76, 1982).
    ///
    /// Forces that depend on velocities are taken at the velocity predicted for
    /// the end of the step, which keeps order 2 (Groot and Warren, J. Chem.
    /// Phys. 107, 1997, with λ = 1).
    pub fn velocity_verlet(system: &System) -> Self {
        Self::symmetric(system, 2, &[0.5], &[1.0])
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
        )
    }

    /// Mirrors the first half of a composition. One kick more than drifts stand
    /// in the whole, so the middle is a drift if both halves are as long, and a
    /// kick otherwise.
    fn symmetric(system: &System, order: u32, kicks: &[f64], drifts: &[f64]) -> Self {
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
            seen_at_start: seen.clone(),
            seen,
            accelerations_are_known: false,
            impulses: Impulses::new(system),
            kinetic_energy: None,
        }
    }

    /// Those of the last step.
    pub(crate) fn last_flows(&self) -> &Flows {
        self.impulses.flows()
    }

    /// The last accepted step is taken back; without dashpots only.
    pub(crate) fn go_back(&mut self) {
        std::mem::swap(&mut self.accelerations, &mut self.last_accelerations);
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

    fn accelerate(
        system: &System,
        (time, x, v): (f64, &[Vector3<f64>], &[Vector3<f64>]),
        accelerations: &mut [Vector3<f64>],
        work: &mut Work,
    ) {
        timed(&mut work.phases.assembly, || {
            system.accelerations(time, x, v, accelerations);
        });
        work.counts.force_evaluations += 1;
    }
}

impl Method for Splitting {
    fn order(&self) -> u32 {
        self.order
    }

    fn restart(&mut self) {
        self.accelerations_are_known = false;
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
            Self::accelerate(system, start, &mut self.accelerations, work);
            self.accelerations_are_known = true;
            if is_damped {
                self.seen_at_start.copy_from_slice(&state.v);
            }
        }
        self.impulses.begin(system, &state.v);
        if is_damped {
            self.seen.copy_from_slice(&state.v);
        }
        let seen = if is_damped {
            &self.seen_at_start
        } else {
            &state.v
        };
        let first_kick = self.kicks[0] * h;
        self.impulses
            .add_all_but_loads(system, first_kick, &state.x, seen);
        let mut kicked_at = interval.start;
        let (start, next) = (&self.accelerations, &mut self.next_accelerations);
        let mut elapsed = 0.0;
        for (stage, drift) in self.drifts.iter().enumerate() {
            let (kick, next_kick) = (self.kicks[stage] * h, self.kicks[stage + 1] * h);
            let drift = drift * h;
            elapsed += drift;
            let now = if stage == 0 { start } else { &*next };
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
            Self::accelerate(system, (time, &state.x, seen), next, work);
            self.impulses
                .add_all_but_loads(system, next_kick, &state.x, seen);
            kicked_at = time;
        }
        let kick = self.kicks[self.drifts.len()] * h;
        let last = (&state.v[..], &self.next_accelerations[..]);
        self.impulses.add_kick(system, kick, kicked_at, last);
        let accelerations = &self.next_accelerations;
        self.kinetic_energy =
            last_kick(accelerations, kick, &mut state.v, &state.x, system.masses());
        self.impulses.finish(system, &state.v);
        Ok(None)
    }

    fn archive(&mut self, archive: &mut Archive) {
        archive.flag(&mut self.accelerations_are_known);
        archive.vectors(&mut self.last_accelerations);
        archive.vectors(&mut self.accelerations);
        archive.vectors(&mut self.seen_at_start);
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.last_accelerations, &mut self.accelerations);
        std::mem::swap(&mut self.accelerations, &mut self.next_accelerations);
        std::mem::swap(&mut self.seen_at_start, &mut self.seen);
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }

    fn kinetic_energy(&self) -> Option<f64> {
        self.kinetic_energy
    }
}
