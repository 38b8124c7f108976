//! RODAS4: a Rosenbrock method of order 4.

use crate::flows::BlockWorks;
use crate::implicit::linear::{LinearSystem, Purpose};
use crate::implicit::solver_options::Hessian;
use crate::method::time_scale;
use crate::vectors::{largest, spread};
use crate::work::timed;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, System, Weights};
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
    /// Works of anchors and loads: unknowns beside positions and velocities, of which
    /// these are the u of each stage, in J.
    works: [BlockWorks; STAGES],
    /// What their powers change by with time, in W/s, while velocities stay.
    work_drift: BlockWorks,
    flows: Flows,
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
            works: Default::default(),
            work_drift: BlockWorks::default(),
            flows: Flows::default(),
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

    /// Begins a step with the works: the powers of anchors change with their own way, those
    /// of loads with time. `change_at` has the Hessian at the start.
    fn begin_works(
        &mut self,
        (system, anchors): (&System, &Anchors),
        (start, state): (f64, &State),
        change_at: &Evaluation<'_>,
    ) {
        let n_free = system.n_free();
        self.work_drift.clear();
        if system.any_anchor_moves(&state.v) {
            let (drift, along) = (self.work_drift.with_anchors(system), &mut self.stage.x);
            along[..n_free].fill(Vector3::zeros());
            along[n_free..].copy_from_slice(&state.v[n_free..]);
            system.add_anchor_work_changes(change_at, along, drift);
            if anchors.accelerations(start, along) {
                system.add_anchor_works(1.0, &state.x, along, drift);
            }
        }
        if system.has_loads() {
            let drift = self.work_drift.with_loads(system);
            system.each_load_rate(start, |load, block, rate| {
                drift[load] += rate.dot(&state.v[block]);
            });
        }
    }

    /// The works of a stage that is solved, by the powers at its time and how they change
    /// with its u from the start of the step.
    fn add_work(
        &mut self,
        system: &System,
        (stage, h): (usize, f64),
        [start, time]: [f64; 2],
        change_at: &Evaluation<'_>,
    ) {
        let (earlier, rest) = self.works.split_at_mut(stage);
        let (works, slopes, at) = (&mut rest[0], &self.stages[stage], &self.stage);
        works.clear();
        if system.any_anchor_moves(&at.v) {
            let anchors = works.with_anchors(system);
            system.add_anchor_works(1.0, &at.x, &at.v, anchors);
            system.add_anchor_work_changes(change_at, &slopes.x, anchors);
        }
        if system.has_loads() {
            let loads = works.with_loads(system);
            system.each_load(time, |load, block, force| {
                loads[load] += force.dot(&at.v[block]);
            });
            system.each_load(start, |load, block, force| {
                loads[load] += force.dot(&slopes.v[block]);
            });
        }
        for (weight, earlier) in C[stage].iter().zip(earlier) {
            works.add_times(earlier, weight / h);
        }
        works.add_times(&self.work_drift, GAMMAS[stage] * h);
        works.scale(GAMMA * h);
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
        let change_at = Evaluation {
            weights: Weights::STIFFNESS,
            ..at
        };
        self.begin_works((system, anchors), (interval.start, state), &change_at);
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
            self.add_work(system, (stage, h), [interval.start, time], &change_at);
        }
        let (last, earlier) = self.works.split_last().expect("there are stages");
        self.flows.works.copy_from(last);
        for (weight, works) in A[STAGES - 1].iter().zip(earlier) {
            self.flows.works.add_times(works, *weight);
        }
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

    fn flows(&self) -> Option<&Flows> {
        Some(&self.flows)
    }
}
