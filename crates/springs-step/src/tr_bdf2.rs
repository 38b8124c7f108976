//! TR-BDF2: a trapezoidal stage, then a backward difference stage.

use crate::flows::Impulses;
use crate::method::{LONGEST_TIME_SCALE, time_scale};
use crate::stage::{Stage, StageProblem, Tensions, largest};
use crate::{
    Anchors, ErrorEstimate, Flows, HiddenState, Interval, Method, MethodError, State, Work,
};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_solver::SolveError;

/// γ = 2 − √2: both stages then have the same matrix coefficient.
const GAMMA: f64 = 2.0 - std::f64::consts::SQRT_2;
/// γ/2 = (1 − γ)/(2 − γ): the coefficient c/h of both stages.
const D: f64 = 0.5 * GAMMA;
/// Constant of the local error (Hosea and Shampine 1996, eq. 9).
const K: f64 = (-3.0 * GAMMA * GAMMA + 4.0 * GAMMA - 2.0) / (12.0 * (2.0 - GAMMA));

/// The one-step method of Bank et al. (IEEE Trans. CAD 4, 1985) with the error
/// estimate of Hosea and Shampine (Appl. Numer. Math. 20, 1996).
///
/// Order 2, L-stable: the general choice for stiff scenes. Vibrations that the
/// step does not resolve are damped out. Both stages are solved.
pub struct TrBdf2 {
    stage: Stage,
    momenta: Vec<Vector3<f64>>,
    before: State,
    middle: State,
    /// Forces at start, middle and end of the step, in N.
    forces: [Vec<Vector3<f64>>; 3],
    forces_are_known: bool,
    tensions: Tensions,
    /// Rate of errors of positions, in m/s, up to which stages need not be
    /// solved; `None`: to rounding.
    accuracy: Option<f64>,
    /// Errors of the last step as momenta, its size and the time scale of the
    /// motion.
    errors: Vec<Vector3<f64>>,
    step_size: f64,
    time_scale: f64,
    impulses: Impulses,
    flows: Flows,
}

/// The weight of the forces at start and middle in a step; that of the end is
/// [`D`].
const START_AND_MIDDLE: f64 = 0.25 * std::f64::consts::SQRT_2;

/// The error per time is proportional to h².
const EXPONENT: f64 = 2.0;

impl TrBdf2 {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System) -> Result<Self, SolveError> {
        let zeros = vec![Vector3::zeros(); system.n_free()];
        Ok(Self {
            stage: Stage::new(system)?,
            momenta: zeros.clone(),
            before: State::initial(system),
            middle: State::initial(system),
            errors: zeros.clone(),
            step_size: 0.0,
            time_scale: 0.0,
            forces: [zeros.clone(), zeros.clone(), zeros],
            forces_are_known: false,
            tensions: Tensions::new(system),
            impulses: Impulses::new(system),
            flows: Flows::default(),
            accuracy: None,
        })
    }

    /// Solves the stages only as accurately as needed instead of to rounding:
    /// they may add to the error of positions at the rate `accuracy`, in m/s.
    pub fn with_accuracy(self, accuracy: f64) -> Self {
        Self {
            accuracy: Some(accuracy),
            ..self
        }
    }

    /// Solves a stage from q in the positions of `state`, and stores the force
    /// that the solution implies.
    fn solve(
        &mut self,
        system: &System,
        c: f64,
        state: &mut State,
        force: usize,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let h = c / D;
        let time_scale = self.time_scale.clamp(h, LONGEST_TIME_SCALE * h);
        let problem = StageProblem {
            c,
            momenta: &self.momenta,
            accuracy: self.accuracy.map(|rate| rate * h / time_scale),
        };
        self.stage
            .solve(system, &problem, state, &mut self.tensions.end, work)?;
        let momenta = system.masses().iter().zip(&state.v).zip(&self.momenta);
        for (f, ((m, v), p)) in self.forces[force].iter_mut().zip(momenta) {
            *f = (v * *m - p) / c;
        }
        Ok(())
    }
}

impl Method for TrBdf2 {
    fn order(&self) -> u32 {
        2
    }

    fn setup(&self) -> Work {
        self.stage.setup()
    }

    fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.stage.expect_changing_steps(system)
    }

    fn restart(&mut self) {
        self.tensions.forget();
        self.forces_are_known = false;
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
        let c = D * h;
        self.tensions.begin(system, &state.x);
        if !self.forces_are_known {
            system.forces(&state.x, &state.v, &mut self.forces[0]);
            work.counts.force_evaluations += 1;
            self.forces_are_known = true;
        }
        self.before.x.copy_from_slice(&state.x);
        self.before.v.copy_from_slice(&state.v);
        let weight = START_AND_MIDDLE * h;
        self.impulses.begin(system, &state.v);
        self.impulses.add(system, weight, &state.x, &state.v);

        // Trapezoidal to t + γh: v_γ = v + ½γh(a + a_γ), x_γ likewise.
        for block in 0..n_free {
            let v = state.v[block];
            self.momenta[block] = v * system.masses()[block] + self.forces[0][block] * c;
            state.x[block] += v * c;
        }
        anchors.place(interval.start + GAMMA * h, &mut state.x);
        self.solve(system, c, state, 1, work)?;
        self.middle.x.copy_from_slice(&state.x);
        self.middle.v.copy_from_slice(&state.v);
        self.impulses.add(system, weight, &state.x, &state.v);

        // Backward difference through t and t + γh.
        let (near, far) = (
            1.0 / (GAMMA * (2.0 - GAMMA)),
            (1.0 - GAMMA).powi(2) / (GAMMA * (2.0 - GAMMA)),
        );
        for block in 0..n_free {
            let carried = self.middle.v[block] * near - self.before.v[block] * far;
            self.momenta[block] = carried * system.masses()[block];
            state.x[block] = self.middle.x[block] * near - self.before.x[block] * far;
        }
        anchors.place(interval.end, &mut state.x);
        self.solve(system, c, state, 2, work)?;
        self.impulses.add(system, c, &state.x, &state.v);
        self.flows = self.impulses.flows(system, &state.v);

        let [start, middle, end] = &self.forces;
        let differences = start.iter().zip(middle).zip(end);
        for (error, ((f0, fg), f1)) in self.momenta.iter_mut().zip(differences) {
            let second = f0 / GAMMA - fg / (GAMMA * (1.0 - GAMMA)) + f1 / (1.0 - GAMMA);
            *error = second * (2.0 * K * h);
        }
        self.errors.copy_from_slice(&self.momenta);
        self.stage.filter(&mut self.momenta, work)?;
        let (block, error) = largest(&self.momenta);
        let speed = largest(&state.v[..n_free]).1;
        let changes = state.v.iter().zip(&self.before.v).take(n_free);
        let change = changes.map(|(after, before)| (after - before).amax());
        self.step_size = h;
        self.time_scale = time_scale(speed, change.fold(0.0, f64::max) / h, h);
        Ok(Some(ErrorEstimate {
            rate: self.time_scale * error / h,
            exponent: EXPONENT,
            block,
        }))
    }

    /// What an error of velocities does to positions over the time scale of the
    /// motion τ, with springs answering: τ(M + τhS)⁻¹M e instead of τ e.
    ///
    /// An error in a vibration of frequency ω moves positions by e/ω, not by
    /// τ e, and adds up step by step as long as the step resolves the vibration,
    /// hω < 1; the weight τ/(1 + τhω²) is at least that 1/ω there, and falls off
    /// beyond, where L-stability damps.
    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let (tau, tensions) = (self.time_scale, &self.tensions.end);
        let geometric = tau.powf(0.75) * self.step_size.powf(0.25);
        let errors = &mut self.errors;
        let answered = self
            .stage
            .answer(system, state, tensions, geometric, errors, work);
        let (block, error) = largest(&self.errors);
        answered.then_some(ErrorEstimate {
            rate: tau * error / self.step_size,
            exponent: EXPONENT,
            block,
        })
    }

    fn visit(&mut self, state: &mut HiddenState) {
        self.stage.visit(state);
        self.tensions.visit(state);
        state.flag(&mut self.forces_are_known);
        state.vectors(&mut self.forces[0]);
        state.real(&mut self.time_scale);
        state.real(&mut self.step_size);
    }

    fn accept(&mut self) {
        self.tensions.accept();
        self.forces.swap(0, 2);
    }

    fn flows(&self) -> Option<Flows> {
        Some(self.flows)
    }
}
