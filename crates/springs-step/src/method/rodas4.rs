//! RODAS4: a Rosenbrock method of order 4.

use crate::flows::work_on;
use crate::implicit::linear::{LinearSystem, Purpose};
use crate::implicit::solver_options::Hessian;
use crate::method::time_scale;
use crate::vectors::{largest, spread};
use crate::work::timed;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, Lines, System, Weights};
use springs_scene::RunOptions;
use springs_solver::{Interrupt, SolveError};

/// Order 4 with an embedded result of order 3, L-stable, linearly implicit: one
/// factorization and six solutions a step (Hairer and Wanner: Solving Ordinary
/// Differential Equations II, 1996, IV.7; coefficients of their code RODAS).
///
/// For tight error at moderate stiffness; at extreme stiffness its order drops.
/// The method needs the exact Jacobian. So it does not treat dashpots, whose
/// Jacobian is not symmetric, and where the matrix is not positive definite a
/// step fails; with a tolerance a shorter one is then tried.
pub struct Rodas4 {
    linear: LinearSystem,
    /// u of each stage: of positions and of velocities, free blocks.
    stages: [Slopes; STAGES],
    /// Where the stage is evaluated.
    stage: State,
    forces: Vec<Vector3<f64>>,
    /// ∂f/∂t by moving anchors, in N/s.
    drift: Vec<Vector3<f64>>,
    /// Work of the anchors in the last step, in J: one more unknown.
    anchor_work: f64,
    load_work: f64,
}

#[derive(Clone)]
struct Slopes {
    /// All blocks; zero for the fixed ones.
    x: Vec<Vector3<f64>>,
    v: Vec<Vector3<f64>>,
}

const STAGES: usize = 6;
const GAMMA: f64 = 0.25;
const ALPHA: [f64; STAGES] = [0.0, 0.386, 0.21, 0.63, 1.0, 1.0];
const GAMMAS: [f64; STAGES] = [0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0];
const A5: [f64; 4] = [
    1.221224509226641,
    6.019134481288629,
    12.53708332932087,
    -0.687886036105895,
];
const A: [&[f64]; STAGES] = [
    &[],
    &[1.544],
    &[0.9466785280815826, 0.2557011698983284],
    &[3.314825187068521, 2.896124015972201, 0.9986419139977817],
    &A5,
    &[A5[0], A5[1], A5[2], A5[3], 1.0],
];
const C: [&[f64]; STAGES] = [
    &[],
    &[-5.6688],
    &[-2.430093356833875, -0.2063599157091915],
    &[-0.1073529058151375, -9.594562251023355, -20.47028614809616],
    &[
        7.496443313967647,
        -10.24680431464352,
        -33.99990352819905,
        11.7089089320616,
    ],
    &[
        8.083246795921522,
        -7.981132988064893,
        -31.52159432874371,
        16.31930543123136,
        -6.058818238834054,
    ],
];

/// The loads at the start of a step.
struct LoadsAtStart {
    /// In N.
    forces: Vec<Vector3<f64>>,
    /// What their power changes by with time, in W/s, while velocities stay.
    drift: f64,
}

impl LoadsAtStart {
    fn of(system: &System, time: f64, state: &State) -> Self {
        let zeros = vec![Vector3::zeros(); system.n_free()];
        let (mut forces, mut rates) = (zeros.clone(), zeros);
        system.add_loads(time, &mut forces);
        system.add_load_rates(time, &mut rates);
        Self {
            forces,
            drift: work_on(&rates, &state.v),
        }
    }
}

impl Rodas4 {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System, options: &RunOptions) -> Result<Self, SolveError> {
        let zeros = vec![Vector3::zeros(); system.n_free()];
        let slopes = Slopes {
            x: vec![Vector3::zeros(); system.numbering().n_nodes()],
            v: zeros.clone(),
        };
        Ok(Self {
            linear: LinearSystem::new(system, Hessian::Unclamped, options)?,
            stages: std::array::from_fn(|_| slopes.clone()),
            stage: State::initial(system),
            forces: zeros.clone(),
            drift: zeros,
            anchor_work: 0.0,
            load_work: 0.0,
        })
    }

    /// Σ weight·u over the earlier stages, of one block.
    fn sum(&self, weights: &[f64], block: usize) -> (Vector3<f64>, Vector3<f64>) {
        let mut sums = (Vector3::zeros(), Vector3::zeros());
        for (weight, stage) in weights.iter().zip(&self.stages) {
            sums.0 += stage.x[block] * *weight;
            sums.1 += stage.v[block] * *weight;
        }
        sums
    }

    /// Solves (1/(hγ) − J) u = r for one stage, where r stands in its slopes.
    ///
    /// With J = [[0, 1], [−M⁻¹H, 0]] the velocities drop out:
    /// (M + (hγ)²H) u_x = hγ M(r_x + hγ r_v), u_v = u_x/(hγ) − r_x.
    fn solve(
        &mut self,
        system: &System,
        stage: usize,
        h: f64,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let c = GAMMA * h;
        let slopes = &mut self.stages[stage];
        let known = system.masses().iter().zip(&slopes.x).zip(&slopes.v);
        for (rhs, ((m, rx), rv)) in self.forces.iter_mut().zip(known) {
            *rhs = (rx + rv * c) * (c * m);
        }
        self.linear
            .solve(&mut self.forces, Purpose::HighOrder, work)?;
        for ((x, v), solved) in slopes.x.iter_mut().zip(&mut slopes.v).zip(&self.forces) {
            *v = solved / c - *x;
            *x = *solved;
        }
        Ok(())
    }
}

/// Σ weight·u over the earlier stages.
fn weighted(weights: &[f64], values: &[f64]) -> f64 {
    let products = weights.iter().zip(values).map(|(weight, u)| weight * u);
    products.sum()
}

impl Method for Rodas4 {
    fn order(&self) -> u32 {
        4
    }

    fn setup(&self) -> Work {
        self.linear.setup()
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.linear.expect_changing_steps(system)
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.linear.set_interrupt(interrupt);
    }

    fn restart(&mut self) {}

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let (h, n_free) = (interval.size, system.n_free());
        let c = GAMMA * h;
        let at = Evaluation::new(&state.x, &state.v, Weights::of_step(c));
        self.linear.linearize(system, at, work)?;
        work.counts.force_evaluations += 1;
        // The load of the anchors is −(hγ)²H v over them.
        for (drift, load) in self
            .drift
            .iter_mut()
            .zip(&self.linear.linearization().anchor_load)
        {
            *drift = load / (c * c);
        }
        system.add_load_rates(interval.start, &mut self.drift);
        self.stage.v.copy_from_slice(&state.v);
        let anchors_move = system.any_anchor_moves(&state.v);
        let change_at = Evaluation {
            weights: Weights::STIFFNESS,
            ..at
        };
        // The power of the anchors changes with their own way, and with u.
        let mut power_drift = 0.0;
        if anchors_move {
            self.stage.x[..n_free].fill(Vector3::zeros());
            self.stage.x[n_free..].copy_from_slice(&state.v[n_free..]);
            power_drift = system.anchor_power_change(&change_at, &self.stage.x);
            if anchors.accelerations(interval.start, &mut self.stage.x) {
                power_drift += system.anchor_power(&state.x, &self.stage.x);
            }
        }
        let mut works = [0.0; STAGES];
        let mut load_works = [0.0; STAGES];
        let loads = system
            .has_loads()
            .then(|| LoadsAtStart::of(system, interval.start, state));
        for stage in 0..STAGES {
            for block in 0..n_free {
                let (dx, dv) = self.sum(A[stage], block);
                self.stage.x[block] = state.x[block] + dx;
                self.stage.v[block] = state.v[block] + dv;
            }
            self.stage.x[n_free..].copy_from_slice(&state.x[n_free..]);
            let time = interval.start + ALPHA[stage] * h;
            anchors.place(time, &mut self.stage.x, &mut self.stage.v);
            timed(&mut work.phases.assembly, || {
                system.forces(time, &self.stage.x, &self.stage.v, &mut self.forces);
            });
            work.counts.force_evaluations += u64::from(stage > 0);
            for block in 0..n_free {
                let (cx, cv) = self.sum(C[stage], block);
                let force = self.forces[block] + self.drift[block] * (GAMMAS[stage] * h);
                self.stages[stage].x[block] = self.stage.v[block] + cx / h;
                self.stages[stage].v[block] = force / system.masses()[block] + cv / h;
            }
            self.solve(system, stage, h, work)?;
            if anchors_move {
                let known = weighted(C[stage], &works) / h + GAMMAS[stage] * h * power_drift;
                let power = system.anchor_power(&self.stage.x, &self.stage.v);
                let change = system.anchor_power_change(&change_at, &self.stages[stage].x);
                works[stage] = c * (power + change + known);
            }
            if let Some(loads) = &loads {
                let known = weighted(C[stage], &load_works) / h + GAMMAS[stage] * h * loads.drift;
                self.forces.fill(Vector3::zeros());
                system.add_loads(time, &mut self.forces);
                let power = work_on(&self.forces, &self.stage.v);
                let change = work_on(&loads.forces, &self.stages[stage].v);
                load_works[stage] = c * (power + change + known);
            }
        }
        let total = |works: &[f64; STAGES]| weighted(A[STAGES - 1], works) + works[STAGES - 1];
        self.anchor_work = total(&works);
        self.load_work = total(&load_works);
        // The last stage was evaluated at the embedded result; its u leads on
        // to the result, and is the estimate of the error.
        let mut change: f64 = 0.0;
        for block in 0..n_free {
            let v = self.stage.v[block] + self.stages[STAGES - 1].v[block];
            change = change.max((v - state.v[block]).amax());
            state.x[block] = self.stage.x[block] + self.stages[STAGES - 1].x[block];
            state.v[block] = v;
        }
        anchors.place(interval.end, &mut state.x, &mut state.v);
        let last = &self.stages[STAGES - 1];
        let speed = spread(&state.v);
        let ((block, of_x), (_, of_v)) = (largest(&last.x), largest(&last.v));
        let estimate = ErrorEstimate {
            rate: (of_x + time_scale(speed, change / h, h) * of_v) / h,
            exponent: 3.0,
            block,
        };
        Ok(Some(estimate.of_better_result(speed)))
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.linear.archive(archive);
    }

    fn accept(&mut self) {}

    fn flows(&self) -> Option<Flows> {
        Some(Flows {
            heat: Lines::default(),
            anchor_work: self.anchor_work,
            load_work: self.load_work,
        })
    }
}
