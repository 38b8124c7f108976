//! The implicit stage that all converged methods share, and its Newton solver.

use crate::implicit::corrections::{Chord, Goal, Progress, SLOW};
use crate::implicit::linear::{Damping, LinearSystem, Linearized, OnDemand, Purpose};
use crate::implicit::solver_options::Hessian;
use crate::vectors::{largest, largest_magnitude, momenta_of, spread};
use crate::{Archive, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, Projection, System, Weights};
use springs_scene::RunOptions;
use springs_solver::{Interrupt, SolveError};

/// Solver of M v = p + c f(x, v), x = q + c v for the velocities v of a stage.
///
/// Newton's method with filtered tensions: the tension T of each spring is an
/// unknown of its own, so that the across stiffness T/l of the matrix follows
/// the solution instead of the false stretch that turning a stiff spring gives.
/// At convergence T = K(l − l₀), so the answer is that of the plain method.
/// Negative across stiffness is clamped only when the matrix turns out
/// indefinite. A matrix with a factor serves several corrections, and, where
/// asked for, the stage after (chord iteration), as long as it is cheaper to go
/// on than to make a new one. If that has not converged after a dozen iterations, Newton's
/// method on the velocities alone, with the energy of the step as merit
/// function and Armijo's rule, makes some progress first; and so in turns.
pub(crate) struct Stage {
    linear: LinearSystem,
    /// Correction of the velocities; zero for fixed blocks.
    delta: Vec<Vector3<f64>>,
    start: State,
    trial: State,
    tensions: Vec<f64>,
    /// Of springs with a free end, at the start of the stage, in m.
    largest_coordinate: f64,
    chord: Chord,
    /// The first correction of the last stage, in m/s.
    first: f64,
    /// Momenta with what loads give; only used where there are any.
    momenta: Vec<Vector3<f64>>,
}

/// What kind of correction is wanted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Iteration {
    /// With filtered tensions; clamped on demand.
    Filtered,
    /// With the springs' own tensions; clamped on demand.
    Primal,
    /// With the springs' own tensions, clamped.
    Clamped,
}

/// What came of a descent.
enum Descent {
    Converged,
    /// The merit is lower than before.
    Progress,
    Stuck,
}

/// What a stage starts from. Positions of fixed blocks are those at its time.
pub(crate) struct StageProblem<'a> {
    /// c, in s.
    pub(crate) c: f64,
    /// Its time, in s, at which loads are taken.
    pub(crate) time: f64,
    /// p, one per free block, in kg·m/s.
    pub(crate) momenta: &'a [Vector3<f64>],
    /// Error of velocities, in m/s, that may be left; `None`: right to rounding.
    pub(crate) accuracy: Option<f64>,
    /// Whether the matrix of the stage solved last, of the same step and with the same c,
    /// may serve.
    pub(crate) goes_on: bool,
}

/// Forces on massless nodes below this part of the largest are in balance.
const BALANCED: f64 = 1e-9;
/// Part of a step that is as good as no time, and one in which velocities hardly
/// change but can be told from positions.
const NO_TIME: f64 = 1e-8;
const SHORT_TIME: f64 = 1e-3;

/// Matrices that are tried with filtered tensions, and corrections with any of them.
const FILTERED_ITERATIONS: usize = 12;
const FILTERED_CORRECTIONS: usize = 60;
/// The first correction with a matrix of the stage before is thrown away if it exceeds
/// the first one there so many times.
const LARGER: f64 = 2.0;
const PRIMAL_ITERATIONS: usize = 24;
/// Corrections that a factor serves where old matrices are used, at best: four to eight.
/// They need no assembly either.
const CHORD_USES: f64 = 8.0;
/// Rounds of both, if each makes progress; fewer where a shorter step can be
/// made instead.
const ROUNDS: usize = 40;
const ROUNDS_OF_ADAPTIVE_STEPS: usize = 2;
const MOST_HALVINGS: usize = 30;
/// Relative accuracy that a stage is solved to, if rounding allows.
const WANTED: f64 = 1e-13;
/// Rounding errors of sums of a few numbers, relative to them.
const ULPS: f64 = 8.0 * f64::EPSILON;
/// Armijo's constant.
const SUFFICIENT: f64 = 1e-4;

impl Stage {
    pub(crate) fn new(system: &System, options: &RunOptions) -> Result<Self, SolveError> {
        Ok(Self {
            linear: LinearSystem::new(system, Hessian::Exact, options)?,
            delta: vec![Vector3::zeros(); system.numbering().n_nodes()],
            start: State::initial(system),
            trial: State::initial(system),
            tensions: vec![0.0; system.n_carried()],
            largest_coordinate: 0.0,
            chord: Chord::default(),
            first: f64::INFINITY,
            momenta: Vec::new(),
        })
    }

    /// Solves for the stage. `state` holds q in its positions and the first
    /// guess in its velocities; it gets x and v. `tensions` are the first guess
    /// of the tensions and get those of the solution.
    pub(crate) fn solve(
        &mut self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &mut State,
        tensions: &mut [f64],
        work: &mut Work,
    ) -> Result<(), MethodError> {
        // A load is the same whatever comes out: it gives momentum.
        let mut momenta = std::mem::take(&mut self.momenta);
        let with_loads = if system.has_loads() {
            momenta.resize(system.n_free(), Vector3::zeros());
            momenta.fill(Vector3::zeros());
            system.add_loads(problem.time, &mut momenta);
            for (sum, p) in momenta.iter_mut().zip(problem.momenta) {
                *sum = *sum * problem.c + p;
            }
            &momenta
        } else {
            problem.momenta
        };
        let problem = &StageProblem {
            momenta: with_loads,
            ..*problem
        };
        let solved = self.solve_for(system, problem, state, tensions, work);
        self.momenta = momenta;
        solved
    }

    /// The same where loads are among the momenta.
    fn solve_for(
        &mut self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &mut State,
        tensions: &mut [f64],
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let c = problem.c;
        for block in 0..system.n_free() {
            let v = state.v[block];
            state.x[block] += v * c;
        }
        self.tensions.copy_from_slice(tensions);
        if !problem.goes_on {
            // Unless the first correction fails it is found below.
            self.first = f64::INFINITY;
        }
        self.largest_coordinate = system.largest_coordinate(&state.x);
        let rounds = if problem.accuracy.is_some() {
            ROUNDS_OF_ADAPTIVE_STEPS
        } else {
            ROUNDS
        };
        for round in 0..rounds {
            let problem = &StageProblem {
                goes_on: problem.goes_on && round == 0,
                ..*problem
            };
            self.start.x.copy_from_slice(&state.x);
            self.start.v.copy_from_slice(&state.v);
            if self.filtered(system, problem, state, work) {
                tensions.copy_from_slice(&self.tensions);
                return Ok(());
            }
            // Back to where the merit is known to be lower than at first.
            state.x.copy_from_slice(&self.start.x);
            state.v.copy_from_slice(&self.start.v);
            let descent = self.descend(system, problem, state, work)?;
            system.carried(&state.x, &mut self.tensions);
            match descent {
                Descent::Converged => {
                    tensions.copy_from_slice(&self.tensions);
                    return Ok(());
                }
                Descent::Progress => {}
                Descent::Stuck => break,
            }
        }
        Err(MethodError::NotConverged {
            block: largest(&self.delta[..system.n_free()]).0,
        })
    }

    /// Newton with filtered tensions; says whether it converged. A matrix that
    /// cannot be factorized ends it like any other failure.
    fn filtered(
        &mut self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &mut State,
        work: &mut Work,
    ) -> bool {
        let is_chord_wanted = self.chord.begin();
        let goes_on = problem.goes_on && is_chord_wanted && self.linear.has_factor();
        self.linear
            .expect_uses(if is_chord_wanted { CHORD_USES } else { 1.0 });
        let mut last = f64::INFINITY;
        let (mut is_new, mut was_new, mut n_matrices) = (!goes_on, false, 0);
        for _ in 0..FILTERED_CORRECTIONS {
            let corrected = if !is_new {
                self.corrected_again(system, problem, state, work)
            } else if n_matrices < FILTERED_ITERATIONS {
                n_matrices += 1;
                let direction = self.direction(system, problem, state, Iteration::Filtered, work);
                direction.map(|_| ())
            } else {
                return false;
            };
            if corrected.is_err() {
                return false;
            }
            let size = self.delta_size(system);
            let is_first = last.is_infinite();
            let largest = if is_first {
                LARGER * self.first
            } else {
                SLOW * last
            };
            if !is_new && (size > largest || size.is_nan()) {
                // Thrown away: stiff springs that have turned push far aside.
                is_new = true;
                self.chord.fail();
                continue;
            }
            self.predict(system, state, problem.c);
            self.advance(system, state, problem.c, 1.0);
            if is_first {
                self.first = size;
            }
            let progress = Progress {
                size,
                last,
                is_chord: !is_new,
                is_newton: is_new && was_new,
            };
            was_new = is_new;
            let goal = self.goal(system, problem, state);
            if progress.is_enough(goal) {
                return true;
            }
            // A new matrix is taken to save half of the corrections that are left.
            let saved = 0.5 * progress.corrections_left(goal);
            is_new = !is_chord_wanted
                || !self.linear.has_factor()
                || saved > self.linear.solutions_per_matrix();
            last = size;
        }
        false
    }

    /// Newton on the velocities with Armijo's rule.
    fn descend(
        &mut self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Descent, MethodError> {
        let c = problem.c;
        self.linear.expect_uses(1.0);
        let mut last = f64::INFINITY;
        let first = self.merit(system, problem, state, state).0;
        for iteration in 0..PRIMAL_ITERATIONS {
            let kind = if iteration < PRIMAL_ITERATIONS / 2 {
                Iteration::Primal
            } else {
                Iteration::Clamped
            };
            let slope = self.direction(system, problem, state, kind, work)?;
            let size = self.delta_size(system);
            let progress = Progress {
                size,
                last,
                is_chord: false,
                is_newton: true,
            };
            if progress.is_enough(self.goal(system, problem, state)) {
                self.advance(system, state, c, 1.0);
                return Ok(Descent::Converged);
            }
            last = size;
            // The slope of the merit function along the correction is −slope.
            // Near the solution, rounding of the merit hides it.
            let (merit, rounding) = self.merit(system, problem, state, state);
            let mut fraction = 1.0;
            for _ in 0..MOST_HALVINGS {
                self.trial.x.copy_from_slice(&state.x);
                self.trial.v.copy_from_slice(&state.v);
                let mut trial = std::mem::take(&mut self.trial);
                self.advance(system, &mut trial, c, fraction);
                let (new, _) = self.merit(system, problem, &trial, state);
                self.trial = trial;
                work.counts.force_evaluations += 1;
                if new <= merit + rounding - SUFFICIENT * fraction * slope {
                    break;
                }
                fraction *= 0.5;
            }
            self.advance(system, state, c, fraction);
        }
        let (merit, rounding) = self.merit(system, problem, state, state);
        Ok(if merit < first - rounding {
            Descent::Progress
        } else {
            Descent::Stuck
        })
    }

    /// Linearizes at `state` and solves for the correction; returns its product
    /// with the residual, in J.
    fn direction(
        &mut self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &State,
        kind: Iteration,
        work: &mut Work,
    ) -> Result<f64, MethodError> {
        let c = problem.c;
        let carried = (kind == Iteration::Filtered).then_some(&*self.tensions);
        work.counts.newton_iterations += 1;
        work.counts.force_evaluations += 1;
        let at = Evaluation {
            projection: Projection::Clamp,
            carried,
            velocity_stiffness: true,
            ..Evaluation::new(&state.x, &state.v, Weights::of_step(c))
        };
        let on_demand = match kind {
            Iteration::Clamped => OnDemand::Always,
            _ => OnDemand::Clamp,
        };
        let delta = &mut self.delta[..system.n_free()];
        self.linear.linearize_and_solve(
            system,
            Linearized {
                at,
                on_demand,
                purpose: Purpose::Correction,
            },
            |out, delta| {
                residual(system, problem, state, &mut out.forces, delta);
                // The forces are not needed any more; they keep the residual.
                out.forces.copy_from_slice(delta);
            },
            delta,
            work,
        )?;
        let residual = &self.linear.linearization().forces;
        let products = residual.iter().zip(&*delta).map(|(r, d)| r.dot(d));
        Ok(products.sum())
    }

    /// A correction with the matrix of the last one.
    fn corrected_again(
        &mut self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &State,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        work.counts.newton_iterations += 1;
        work.counts.force_evaluations += 1;
        let delta = &mut self.delta[..system.n_free()];
        let forces = self.linear.static_forces(system, &state.x, work);
        residual(system, problem, state, forces, delta);
        self.linear.solve(delta, Purpose::Correction, work)
    }

    /// Adds a fraction of the correction.
    fn advance(&self, system: &System, state: &mut State, c: f64, fraction: f64) {
        let moving = state.x.iter_mut().zip(&mut state.v);
        for ((x, v), delta) in moving.zip(&self.delta).take(system.n_free()) {
            *v += delta * fraction;
            *x += delta * (fraction * c);
        }
    }

    /// T ← K(l − l₀) plus K times the change of length by the correction.
    fn predict(&mut self, system: &System, state: &State, c: f64) {
        let tensions = &mut self.tensions;
        system.predict_carried(&state.x, &self.delta, c, tensions);
    }

    /// As [`crate::Method::set_interrupt`].
    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.linear.set_interrupt(interrupt);
    }

    /// As [`crate::Method::expect_changing_steps`].
    pub(crate) fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        self.linear.expect_changing_steps(system)
    }

    /// What its construction took.
    pub(crate) fn setup(&self) -> Work {
        self.linear.setup()
    }

    /// Nothing else is carried from one step to the next.
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        self.linear.archive(archive);
        archive.count(&mut self.chord.pause);
        archive.count(&mut self.chord.last_pause);
    }

    /// With the matrix of the last correction: what is left of a disturbance
    /// of momenta when the springs have answered.
    pub(crate) fn filter(
        &mut self,
        momenta: &mut [Vector3<f64>],
        work: &mut Work,
    ) -> Result<(), MethodError> {
        self.linear.solve(momenta, Purpose::Estimate, work)
    }

    /// (M + cD) y into `products`.
    pub(crate) fn multiply_inertia(
        &self,
        system: &System,
        state: &State,
        c: f64,
        y: &[Vector3<f64>],
        products: &mut [Vector3<f64>],
    ) {
        momenta_of(system, y, products);
        system.add_damping_product(&state.x, &state.v, c, y, products);
    }

    /// Lets free nodes without mass go where their springs are in balance, which
    /// takes no time, and gives them the velocities with which they stay so; all
    /// others stay as they are. At a time in s; `h` is the step that follows, in s.
    ///
    /// A method that starts from forces out of balance would be of order 1, or
    /// carry the imbalance along.
    pub(crate) fn settle_massless(
        &mut self,
        system: &System,
        (time, h): (f64, f64),
        state: &mut State,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        if !system.masses().contains(&0.0) {
            return Ok(());
        }
        let is_massless = |block: &usize| system.masses()[*block] == 0.0;
        let massless: Vec<usize> = (0..system.n_free()).filter(is_massless).collect();
        let mut momenta = vec![Vector3::zeros(); system.n_free()];
        system.forces(time, &state.x, &state.v, &mut momenta);
        work.counts.force_evaluations += 1;
        let forces = massless.iter().map(|&block| momenta[block].amax());
        if forces.fold(0.0, f64::max) <= BALANCED * largest_magnitude(&momenta) {
            return Ok(());
        }
        momenta_of(system, &state.v, &mut momenta);
        let mut tensions = vec![0.0; system.n_carried()];
        system.carried(&state.x, &mut tensions);
        let mut solve = |part: f64, state: &State| {
            let mut solved = state.clone();
            let problem = StageProblem {
                c: part * h,
                time,
                momenta: &momenta,
                accuracy: None,
                goes_on: false,
            };
            self.solve(system, &problem, &mut solved, &mut tensions, work)
                .map(|()| solved)
        };
        let settled = solve(NO_TIME, state)?;
        for &block in &massless {
            state.x[block] = settled.x[block];
        }
        let moving = solve(SHORT_TIME, state)?;
        for &block in &massless {
            state.v[block] = moving.v[block];
        }
        Ok(())
    }

    /// [`LinearSystem::damp_vibrations`] with the system of the stage.
    pub(crate) fn damp_vibrations<const N: usize>(
        &mut self,
        system: &System,
        state: &State,
        damping: Damping<'_>,
        errors: [&mut [Vector3<f64>]; N],
        work: &mut Work,
    ) -> bool {
        self.linear
            .damp_vibrations(system, state, damping, errors, work)
    }

    fn delta_size(&self, system: &System) -> f64 {
        largest_magnitude(&self.delta[..system.n_free()])
    }

    /// What is asked of the corrections of a stage that has come to `state`.
    fn goal(&self, system: &System, problem: &StageProblem<'_>, state: &State) -> Goal {
        Goal {
            rounding: self.rounding(system, problem, state),
            accuracy: problem.accuracy,
        }
    }

    /// The correction, in m/s, from which on the stage is right to rounding:
    /// relative to the velocities, or to what rounding of the positions does to
    /// them through the springs. Free of units, and but for rounding itself the
    /// same in every frame of reference.
    fn rounding(&self, system: &System, problem: &StageProblem<'_>, state: &State) -> f64 {
        let free = &state.v[..system.n_free()];
        let of_velocities = WANTED * spread(&state.v) + ULPS * largest_magnitude(free);
        let c = problem.c;
        let fastest = system.frequency_bound();
        let rate = (c * fastest * fastest).min(1.0 / c);
        of_velocities + ULPS * self.largest_coordinate * rate
    }

    /// ½ vᵀM v − pᵀv + V(x) + ½c·(dissipation with the directions of `at`),
    /// whose slope by v is minus the residual at `at`; and its rounding error.
    fn merit(
        &self,
        system: &System,
        problem: &StageProblem<'_>,
        state: &State,
        at: &State,
    ) -> (f64, f64) {
        let kinetic = system.kinetic_energy(&state.v);
        let mut potential = system.potential_on_free_blocks(&state.x);
        let free = problem.momenta.iter().zip(&state.v);
        let carried: f64 = free.map(|(p, v)| p.dot(v)).sum();
        let heat = 0.5 * problem.c * system.dissipation(&at.x, &state.v).sum();
        let merit = kinetic + potential.sum() - carried + heat;
        potential
            .iter_mut()
            .for_each(|energy| *energy = energy.abs());
        let size = kinetic + potential.sum() + carried.abs() + heat;
        (merit, 1e-13 * size)
    }
}

/// p + c f − M v, in kg·m/s, of static forces, to which those of dashpots are added.
fn residual(
    system: &System,
    problem: &StageProblem<'_>,
    state: &State,
    forces: &mut [Vector3<f64>],
    out: &mut [Vector3<f64>],
) {
    system.add_damping_forces(&state.x, &state.v, forces);
    let known = problem.momenta.iter().zip(forces);
    let momenta = system.masses().iter().zip(&state.v);
    for (((p, f), (m, v)), out) in known.zip(momenta).zip(out) {
        *out = p + *f * problem.c - v * *m;
    }
}
