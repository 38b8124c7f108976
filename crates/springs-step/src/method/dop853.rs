//! DOP853: the explicit Runge–Kutta method of order 8 of Dormand and Prince.

use crate::method::time_scale;
use crate::vectors::spread;
use crate::work::timed;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;

const STAGES: usize = 12;

/// Order 8 with error estimates of order 5 and 3 (Hairer, Nørsett, Wanner:
/// Solving Ordinary Differential Equations I, 1993, II.10; coefficients of
/// their code DOP853).
///
/// Explicit, twelve forces a step, dashpots included: for soft scenes at tight
/// error. Stable up to about hω = 6.
pub struct Dop853 {
    /// dx/dt of each stage: its velocities, all blocks.
    velocities: Vec<Vec<Vector3<f64>>>,
    /// dv/dt of each stage, free blocks.
    accelerations: Vec<Vec<Vector3<f64>>>,
    /// dv/dt at the end of the last step.
    last_acceleration: Vec<Vector3<f64>>,
    stage: State,
    acceleration_is_known: bool,
    /// Heat and work, integrated like positions and velocities.
    flows: Flows,
}

impl Dop853 {
    /// Allocates the workspace.
    pub fn new(system: &System) -> Self {
        let free = vec![Vector3::zeros(); system.n_free()];
        Self {
            velocities: vec![system.initial_velocities().to_vec(); STAGES],
            accelerations: vec![free.clone(); STAGES],
            last_acceleration: free,
            stage: State::initial(system),
            acceleration_is_known: false,
            flows: Flows::default(),
        }
    }

    /// Σ weight·slope of one block: of positions and of velocities.
    fn sum(&self, weights: &[(usize, f64)], block: usize) -> (Vector3<f64>, Vector3<f64>) {
        let mut sums = (Vector3::zeros(), Vector3::zeros());
        for &(stage, weight) in weights {
            sums.0 += self.velocities[stage][block] * weight;
            sums.1 += self.accelerations[stage][block] * weight;
        }
        sums
    }

    /// Local error of each component by the rule of DOP853, as the largest
    /// error of positions, directly or through velocities that are wrong for
    /// `time_scale`.
    fn estimate(&self, h: f64, time_scale: f64) -> (usize, f64) {
        let mut worst = (0, 0.0);
        for block in 0..self.last_acceleration.len() {
            let (x5, v5) = self.sum(&E5, block);
            let (x3, v3) = self.sum(&E3, block);
            let combine = |fifth: Vector3<f64>, third: Vector3<f64>| {
                let (fifth, third) = (fifth.norm_squared(), third.norm_squared());
                let denominator = (fifth + 0.01 * third).sqrt();
                if denominator > 0.0 {
                    h * fifth / denominator
                } else {
                    0.0
                }
            };
            let error = combine(x5, x3) + time_scale * combine(v5, v3);
            if error > worst.1 || error.is_nan() {
                worst = (block, error);
            }
        }
        worst
    }
}

/// Adds what a stage at a state adds to the flows of a step.
fn add_flows(flows: &mut Flows, stage: usize, interval: Interval, system: &System, at: &State) {
    let h = interval.size;
    if let Some((_, weight)) = B.iter().find(|(index, _)| *index == stage) {
        flows.add_powers(
            system,
            weight * h,
            interval.start + C[stage] * h,
            (&at.x, &at.v),
        );
    }
}

fn accelerate(
    system: &System,
    time: f64,
    state: &State,
    accelerations: &mut [Vector3<f64>],
    work: &mut Work,
) {
    timed(&mut work.phases.assembly, || {
        system.accelerations(time, &state.x, &state.v, accelerations);
    });
    work.counts.force_evaluations += 1;
}

impl Method for Dop853 {
    fn order(&self) -> u32 {
        8
    }

    fn restart(&mut self) {
        self.acceleration_is_known = false;
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let (h, n_free) = (interval.size, system.n_free());
        if self.acceleration_is_known {
            self.accelerations[0].copy_from_slice(&self.last_acceleration);
        } else {
            let first = &mut self.accelerations[0];
            accelerate(system, interval.start, state, first, work);
            // One that overflows fails the step, and is not kept.
            self.acceleration_is_known = first.iter().flatten().all(|a| a.is_finite());
            if self.acceleration_is_known {
                self.last_acceleration.copy_from_slice(first);
            }
        }
        self.flows.clear();
        add_flows(&mut self.flows, 0, interval, system, state);
        self.velocities[0].copy_from_slice(&state.v);
        self.stage.v[n_free..].copy_from_slice(&state.v[n_free..]);
        for stage in 1..STAGES {
            for block in 0..n_free {
                let (dx, dv) = self.sum(A[stage], block);
                self.stage.x[block] = state.x[block] + dx * h;
                self.stage.v[block] = state.v[block] + dv * h;
            }
            self.velocities[stage][..n_free].copy_from_slice(&self.stage.v[..n_free]);
            let time = interval.start + C[stage] * h;
            self.stage.x[n_free..].copy_from_slice(&state.x[n_free..]);
            anchors.place(time, &mut self.stage.x, &mut self.stage.v);
            let these = &mut self.accelerations[stage];
            accelerate(system, time, &self.stage, these, work);
            add_flows(&mut self.flows, stage, interval, system, &self.stage);
        }
        let mut change: f64 = 0.0;
        for block in 0..n_free {
            let (dx, dv) = self.sum(&B, block);
            state.x[block] += dx * h;
            state.v[block] += dv * h;
            change = change.max(dv.amax());
        }
        anchors.place(interval.end, &mut state.x, &mut state.v);
        let speed = spread(&state.v);
        let (block, error) = self.estimate(h, time_scale(speed, change, h));
        let estimate = ErrorEstimate {
            rate: error / h,
            exponent: 7.0,
            block,
        };
        Ok(Some(estimate.of_better_result(speed)))
    }

    fn archive(&mut self, archive: &mut Archive) {
        archive.flag(&mut self.acceleration_is_known);
        archive.vectors(&mut self.last_acceleration);
    }

    fn accept(&mut self) {
        self.acceleration_is_known = false;
    }

    fn flows(&self) -> Option<&Flows> {
        Some(&self.flows)
    }
}

/// Nodes c of the twelve stages.
const C: [f64; 12] = [
    0.0,
    0.05260015195876773,
    0.0789002279381516,
    0.1183503419072274,
    0.2816496580927726,
    0.3333333333333333,
    0.25,
    0.3076923076923077,
    0.6512820512820513,
    0.6,
    0.8571428571428571,
    1.0,
];
/// Coefficients a of each stage: (earlier stage, factor).
const A: [&[(usize, f64)]; 12] = [
    &[],
    &[(0, 0.05260015195876773)],
    &[(0, 0.0197250569845379), (1, 0.0591751709536137)],
    &[(0, 0.02958758547680685), (2, 0.08876275643042054)],
    &[
        (0, 0.2413651341592667),
        (2, -0.8845494793282861),
        (3, 0.924834003261792),
    ],
    &[
        (0, 0.037037037037037035),
        (3, 0.17082860872947386),
        (4, 0.12546768756682242),
    ],
    &[
        (0, 0.037109375),
        (3, 0.17025221101954405),
        (4, 0.06021653898045596),
        (5, -0.017578125),
    ],
    &[
        (0, 0.03709200011850479),
        (3, 0.17038392571223998),
        (4, 0.10726203044637328),
        (5, -0.015319437748624402),
        (6, 0.008273789163814023),
    ],
    &[
        (0, 0.6241109587160757),
        (3, -3.3608926294469414),
        (4, -0.868219346841726),
        (5, 27.59209969944671),
        (6, 20.154067550477894),
        (7, -43.48988418106996),
    ],
    &[
        (0, 0.47766253643826434),
        (3, -2.4881146199716677),
        (4, -0.590290826836843),
        (5, 21.230051448181193),
        (6, 15.279233632882423),
        (7, -33.28821096898486),
        (8, -0.020331201708508627),
    ],
    &[
        (0, -0.9371424300859873),
        (3, 5.186372428844064),
        (4, 1.0914373489967295),
        (5, -8.149787010746927),
        (6, -18.52006565999696),
        (7, 22.739487099350505),
        (8, 2.4936055526796523),
        (9, -3.0467644718982196),
    ],
    &[
        (0, 2.273310147516538),
        (3, -10.53449546673725),
        (4, -2.0008720582248625),
        (5, -17.9589318631188),
        (6, 27.94888452941996),
        (7, -2.8589982771350235),
        (8, -8.87285693353063),
        (9, 12.360567175794303),
        (10, 0.6433927460157636),
    ],
];
/// Weights b of the result of order 8.
const B: [(usize, f64); 8] = [
    (0, 0.054293734116568765),
    (5, 4.450312892752409),
    (6, 1.8915178993145003),
    (7, -5.801203960010585),
    (8, 0.3111643669578199),
    (9, -0.1521609496625161),
    (10, 0.20136540080403034),
    (11, 0.04471061572777259),
];
/// Weights of the difference to a result of order 5.
const E5: [(usize, f64); 8] = [
    (0, 0.01312004499419488),
    (5, -1.2251564463762044),
    (6, -0.4957589496572502),
    (7, 1.6643771824549864),
    (8, -0.35032884874997366),
    (9, 0.3341791187130175),
    (10, 0.08192320648511571),
    (11, -0.022355307863886294),
];
/// Weights of the difference to a result of order 3.
const E3: [(usize, f64); 8] = [
    (0, -0.18980075407240762),
    (5, 4.450312892752409),
    (6, 1.8915178993145003),
    (7, -5.801203960010585),
    (8, -0.4226823213237919),
    (9, -0.1521609496625161),
    (10, 0.20136540080403034),
    (11, 0.02265179219836082),
];
