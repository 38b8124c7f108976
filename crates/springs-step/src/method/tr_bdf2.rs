//! TR-BDF2: a trapezoidal stage, then a backward difference stage.

use crate::flows::Impulses;
use crate::implicit::linear::Damping;
use crate::implicit::stage::{Stage, StageProblem};
use crate::implicit::tensions::Tensions;
use crate::vectors::{largest, largest_magnitude};
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::System;
use springs_scene::RunOptions;
use springs_solver::{Interrupt, SolveError};

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
///
/// # Error of a step
///
/// The local errors of a step are e_x = 2Kh·δ(v) and e_v = 2Kh·δ(a), with
/// δ(y) = y₀/γ − y_γ/(γ(1−γ)) + y₁/(1−γ). They do not change with the frame of
/// reference, because the weights of δ add up to zero. As usual for stiff
/// systems they pass once through (1 − cJ)⁻¹ with c = γh/2, the matrix of the
/// stages:
///
///   z_x = (M + cD + c²S)⁻¹ ((M + cD) e_x + cM e_v),   z_v = (z_x − e_x)/c.
///
/// An error z_x of positions stays. An error z_v of velocities moves positions
/// by no more than z_v/ω in a vibration of frequency ω, and by no more than
/// T z_v in the time T that is left. Both are met by solving once with the
/// springs as they are,
///
///   w = (M + TD + T²S)⁻¹ T²M z_v,
///
/// which is z_v·min(1/ω², T²) for each vibration up to a factor 2: by the
/// inequality of Cauchy and Schwarz √(‖z_v‖·‖w‖) is not below the sum of what
/// the vibrations move. The two are a quarter of a period apart, so a step adds
/// (‖z_x‖² + ‖z_v‖·‖w‖)^½ to the error of positions, which is no more than
/// ‖z_x‖ + T‖z_v‖: only if that is too large the system is solved.
///
/// Errors of a fast vibration of amplitude A do not add up without end: it is
/// never further than 2A from where it should be. Its error in a step is
/// z_v = |K|h³ω⁴A, so its share of that bound is z_v/ω times
/// 2/(|K|h²Tω³) = (τω)⁻³ with τ³ = ½|K|h²T, where that is below 1. Vibrations
/// with τω > 1 are therefore damped in z_x, z_v and w, twice with
/// (M + τD + τ²S)⁻¹M: a factor (1 + τ²ω²)⁻² in place of min(1, (τω)⁻³). Without
/// that, a step that has once become short enough for vibrations too small to
/// matter would stay so.
///
/// What the springs leave of the errors is found anew only now and then.
pub struct TrBdf2 {
    stage: Stage,
    momenta: Vec<Vector3<f64>>,
    before: State,
    middle: State,
    /// Forces at start, middle and end of the step, in N.
    forces: [Vec<Vector3<f64>>; 3],
    /// Whether those at the start are known.
    is_started: bool,
    tensions: Tensions,
    goal: Option<Goal>,
    /// z_v of the last step, in m/s, and w/T².
    errors: Vec<Vector3<f64>>,
    moved: Vec<Vector3<f64>>,
    last: LastErrors,
    response: Response,
    /// √(‖w‖/‖z_v‖), in s: for how long an error of velocities moves positions.
    time_scale: f64,
    impulses: Impulses,
}

/// The weight of the forces at start and middle in a step; that of the end is
/// [`D`].
const START_AND_MIDDLE: f64 = 0.25 * std::f64::consts::SQRT_2;
/// What errors are held against.
#[derive(Clone, Copy)]
struct Goal {
    /// Rate, in m/s, at which stages may add to the error of positions.
    stage_rate: f64,
    /// Simulated time at the end, in s.
    duration: f64,
}

/// Sizes of the errors of a step.
#[derive(Clone, Copy, Default)]
struct LastErrors {
    step_size: f64,
    /// T, in s.
    left: f64,
    /// ‖z_x‖, in m, and ‖z_v‖, in m/s.
    positions: f64,
    velocities: f64,
    /// Where z_x is largest.
    block: usize,
}

/// What the springs leave of the errors of a step, as it was last found by solving:
/// mostly it is the same for many steps.
#[derive(Clone, Copy, Default)]
struct Response {
    /// Of ‖z_x‖ and ‖z_v‖, as parts.
    positions: f64,
    velocities: f64,
    /// ‖w‖/‖z_v‖, in s².
    moved: f64,
    /// The errors at that time.
    errors: LastErrors,
    /// Steps until it is found anew, and how many there were the last time.
    pause: u32,
    last_pause: u32,
}

/// Twice as many steps go by whenever it was found to be the same.
const SHORTEST_PAUSE: u32 = 4;
const LONGEST_PAUSE: u32 = 32;
/// It is the same within this factor.
const SAME: f64 = 1.5;
/// It is found anew when errors or steps have become larger by these factors.
const GROWN: f64 = 2.0;
const LONGER: f64 = 1.5;

impl Response {
    /// Whether it holds for these errors.
    fn serves(&self, now: &LastErrors) -> bool {
        let then = &self.errors;
        self.pause > 0
            && now.positions <= GROWN * then.positions
            && now.velocities <= GROWN * then.velocities
            && now.step_size <= LONGER * then.step_size
            && then.step_size <= LONGER * now.step_size
    }

    /// √(‖w‖/‖z_v‖), in s.
    fn time_scale(&self) -> f64 {
        if self.velocities > 0.0 {
            (self.moved / self.velocities).sqrt()
        } else {
            0.0
        }
    }

    /// What a step with these errors adds to that of positions.
    fn estimate(&self, errors: &LastErrors, block: usize) -> ErrorEstimate {
        let velocities = self.velocities * errors.velocities;
        let moved = self.moved * errors.velocities;
        let positions = self.positions * errors.positions;
        ErrorEstimate {
            rate: positions.hypot((velocities * moved).sqrt()) / errors.step_size,
            exponent: EXPONENT,
            block,
        }
    }

    /// With a pause that says how well the one before did.
    fn after(self, before: &Self) -> Self {
        let is_same = |now: f64, then: f64| now <= SAME * then && then <= SAME * now;
        let same = is_same(self.positions, before.positions)
            && is_same(self.velocities, before.velocities)
            && is_same(self.moved, before.moved);
        let pause = if same {
            (2 * before.last_pause).clamp(SHORTEST_PAUSE, LONGEST_PAUSE)
        } else {
            SHORTEST_PAUSE
        };
        Self {
            pause,
            last_pause: pause,
            ..self
        }
    }

    fn archive(&mut self, archive: &mut Archive) {
        let LastErrors {
            step_size,
            left,
            positions,
            velocities,
            ..
        } = &mut self.errors;
        for real in [step_size, left, positions, velocities] {
            archive.real(real);
        }
        for real in [&mut self.positions, &mut self.velocities, &mut self.moved] {
            archive.real(real);
        }
        archive.count(&mut self.pause);
        archive.count(&mut self.last_pause);
    }
}

/// τ³/(|K|h²T).
const SATURATION: f64 = 0.5;

/// The error per time is proportional to h².
const EXPONENT: f64 = 2.0;

/// In steps, the longest time T over which an error of velocities is taken to
/// move positions. Without a bound a step over a jump of the force would be
/// refused whatever its size.
const LONGEST_TIME: f64 = 1e4;

/// The same when it is decided how precisely stages are solved.
const LONGEST_TIME_SCALE: f64 = 1e3;

/// The part of the tolerance that stages may be off by.
const STAGE_ACCURACY: f64 = 0.03;

impl TrBdf2 {
    /// Allocates the workspace and factorizes symbolically. For steps of fixed
    /// size: stages are solved to rounding, and errors are not estimated.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System, options: &RunOptions) -> Result<Self, SolveError> {
        let zeros = vec![Vector3::zeros(); system.n_free()];
        Ok(Self {
            stage: Stage::new(system, options)?,
            momenta: zeros.clone(),
            before: State::initial(system),
            middle: State::initial(system),
            errors: zeros.clone(),
            moved: zeros.clone(),
            last: LastErrors::default(),
            response: Response::default(),
            time_scale: 0.0,
            forces: [zeros.clone(), zeros.clone(), zeros],
            is_started: false,
            tensions: Tensions::new(system),
            impulses: Impulses::new(system),
            goal: None,
        })
    }

    /// The same for steps that are chosen from the error: each estimates what it
    /// adds to the error of positions at the end of `duration`, in s, and its
    /// stages are solved only as accurately as `tolerance`, in m, needs.
    pub fn with_tolerance(self, tolerance: f64, duration: f64) -> Self {
        Self {
            goal: Some(Goal {
                stage_rate: STAGE_ACCURACY * tolerance / duration,
                duration,
            }),
            ..self
        }
    }

    /// Solves a stage at a time in s from q in the positions of `state`, and stores the force
    /// that the solution implies.
    fn solve(
        &mut self,
        system: &System,
        (c, time): (f64, f64),
        state: &mut State,
        force: usize,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let h = c / D;
        let time_scale = self.time_scale.clamp(h, LONGEST_TIME_SCALE * h);
        let problem = StageProblem {
            c,
            time,
            momenta: &self.momenta,
            accuracy: self.goal.map(|goal| goal.stage_rate * h / time_scale),
            // Both stages of a step have the same c.
            goes_on: force == 2,
        };
        self.stage
            .solve(system, &problem, state, &mut self.tensions.end, work)?;
        let momenta = system.masses().iter().zip(&state.v).zip(&self.momenta);
        for (f, ((m, v), p)) in self.forces[force].iter_mut().zip(momenta) {
            *f = (v * *m - p) / c;
        }
        Ok(())
    }

    /// What the springs leave of the errors of the last step, and where that moves most.
    fn find_response(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<(Response, usize)> {
        let last = self.last;
        let damping = |time_scale, passes| Damping {
            carried: Some(&self.tensions.end),
            time_scale,
            passes,
        };
        let (of_positions, of_velocities) = (&mut self.momenta, &mut self.errors);
        // w/T².
        let moved = &mut self.moved;
        moved.copy_from_slice(of_velocities);
        let stage = &mut self.stage;
        if !stage.damp_vibrations(system, state, damping(last.left, 1), [moved], work) {
            return None;
        }
        let (mut positions, mut velocities) = (last.positions, last.velocities);
        let tau = (SATURATION * K.abs() * last.step_size.powi(2) * last.left).cbrt();
        if tau * system.frequency_bound() > 1.0 {
            let all = [&mut *of_positions, &mut *moved, &mut *of_velocities].map(|v| &mut v[..]);
            if !stage.damp_vibrations(system, state, damping(tau, 2), all, work) {
                return None;
            }
            positions = largest_magnitude(of_positions);
            velocities = largest_magnitude(of_velocities);
        }
        let (block, moved) = largest(moved);
        let part = |left: f64, whole: f64| if whole > 0.0 { left / whole } else { 0.0 };
        let response = Response {
            positions: part(positions, last.positions),
            velocities: part(velocities, last.velocities),
            moved: part(last.left.powi(2) * moved, last.velocities),
            errors: last,
            pause: 0,
            last_pause: 0,
        };
        Some((response, block))
    }

    /// z_x, into the momenta, and z_v, into the errors, of the step of size `h`
    /// just made, which ended at `state`.
    fn estimate(
        &mut self,
        system: &System,
        state: &State,
        h: f64,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let c = D * h;
        let weights = [
            1.0 / GAMMA,
            -1.0 / (GAMMA * (1.0 - GAMMA)),
            1.0 / (1.0 - GAMMA),
        ]
        .map(|weight| 2.0 * K * h * weight);
        let difference = |values: [&[Vector3<f64>]; 3], block: usize| {
            let terms = values.iter().zip(weights);
            terms.fold(Vector3::zeros(), |sum, (values, weight)| {
                sum + values[block] * weight
            })
        };
        let velocities = [&*self.before.v, &*self.middle.v, &*state.v];
        for (block, error) in self.errors.iter_mut().enumerate() {
            *error = difference(velocities, block);
        }
        self.stage
            .multiply_inertia(system, state, c, &self.errors, &mut self.momenta);
        let forces = self.forces.each_ref().map(Vec::as_slice);
        let masses = system.masses();
        for (block, sum) in self.momenta.iter_mut().enumerate() {
            // Forces on what has no mass are rounding errors.
            if masses[block] > 0.0 {
                *sum += difference(forces, block) * c;
            }
        }
        self.stage.filter(&mut self.momenta, work)?;
        let known = self.momenta.iter().zip(masses);
        for (error, (filtered, mass)) in self.errors.iter_mut().zip(known) {
            *error = if *mass > 0.0 {
                (filtered - *error) / c
            } else {
                Vector3::zeros()
            };
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

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.stage.set_interrupt(interrupt);
    }

    fn restart(&mut self) {
        self.tensions.forget();
        self.is_started = false;
        self.response = Response::default();
    }

    fn springs_broke(&mut self, system: &System) {
        self.tensions.clear_broken(system);
        self.is_started = false;
        self.response = Response::default();
        // Nodes without mass go where the others hold them now.
        if system.masses().contains(&0.0) {
            self.restart();
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
        let (h, n_free) = (interval.size, system.n_free());
        let c = D * h;
        if !self.is_started {
            let start = interval.start;
            self.stage
                .settle_massless(system, (start, h), state, work)?;
            let forces = &mut self.forces[0];
            match self.tensions.known() {
                // Where springs broke, the others keep theirs.
                Some(tensions) => {
                    system.forces_of_carried(start, (&state.x, &state.v), tensions, forces);
                }
                None => system.forces(start, &state.x, &state.v, forces),
            }
            work.counts.force_evaluations += 1;
        }
        self.tensions.begin(system, &state.x);
        self.before.x.copy_from_slice(&state.x);
        self.before.v.copy_from_slice(&state.v);
        let weight = START_AND_MIDDLE * h;
        self.impulses.begin(system, &state.v);
        self.impulses
            .add(system, weight, interval.start, &state.x, &state.v);

        // Trapezoidal to t + γh: v_γ = v + ½γh(a + a_γ), x_γ likewise.
        for block in 0..n_free {
            let v = state.v[block];
            self.momenta[block] = v * system.masses()[block] + self.forces[0][block] * c;
            state.x[block] += v * c;
        }
        let middle = interval.start + GAMMA * h;
        anchors.place(middle, &mut state.x, &mut state.v);
        self.solve(system, (c, middle), state, 1, work)?;
        self.middle.x.copy_from_slice(&state.x);
        self.middle.v.copy_from_slice(&state.v);
        self.impulses
            .add(system, weight, middle, &state.x, &state.v);

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
        anchors.place(interval.end, &mut state.x, &mut state.v);
        self.solve(system, (c, interval.end), state, 2, work)?;
        self.impulses
            .add(system, c, interval.end, &state.x, &state.v);
        self.impulses.finish(system, &state.v);
        let Some(goal) = self.goal else {
            return Ok(None);
        };
        self.estimate(system, state, h, work)?;
        let (block, positions) = largest(&self.momenta);
        self.last = LastErrors {
            step_size: h,
            left: (goal.duration - interval.start).clamp(h, LONGEST_TIME * h),
            positions,
            velocities: largest_magnitude(&self.errors),
            block,
        };
        Ok(Some(ErrorEstimate {
            rate: (positions + self.last.left * self.last.velocities) / h,
            exponent: EXPONENT,
            block,
        }))
    }

    /// With w and τ of the documentation of the type, as they are or as they were found to
    /// be last.
    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        if self.response.serves(&self.last) {
            let estimate = self.response.estimate(&self.last, self.last.block);
            // Nothing is refused for what was found of other steps.
            let allowed = self
                .goal
                .map_or(0.0, |goal| goal.stage_rate / STAGE_ACCURACY);
            if estimate.rate <= allowed {
                self.response.pause -= 1;
                self.time_scale = self.response.time_scale();
                return Some(estimate);
            }
        }
        let (response, block) = self.find_response(system, state, work)?;
        self.response = response.after(&self.response);
        self.time_scale = self.response.time_scale();
        Some(self.response.estimate(&self.last, block))
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.stage.archive(archive);
        self.tensions.archive(archive);
        archive.flag(&mut self.is_started);
        archive.vectors(&mut self.forces[0]);
        archive.real(&mut self.time_scale);
        self.response.archive(archive);
    }

    fn accept(&mut self) {
        self.tensions.accept();
        self.forces.swap(0, 2);
        self.is_started = true;
    }

    fn tensions(&self) -> Option<&[f64]> {
        Some(&self.tensions.start)
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }
}
