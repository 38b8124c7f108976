//! The linear systems of methods with a matrix.

use crate::work::timed;
use crate::{HiddenState, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, Linearization, Motion, Projection, System, Weights};
use springs_scene::Solution;
use springs_solver::{Options, Price, Route, SolveError, Solver, Subspace};

/// Forces and matrix of a method at one state, and the solver of their systems.
pub(crate) struct LinearSystem {
    solver: Solver,
    out: Linearization,
    solution: Solution,
    /// Whether the matrix is that of springs of rest length zero, which does
    /// not depend on the state.
    is_isotropic: bool,
    /// Whether it depends on nothing but the weights, and those of the last one.
    is_constant: bool,
    weights: Option<Weights>,
    /// Bound on the square of the angular frequency, in 1/s².
    frequency_square: f64,
    /// The right-hand side and the residual of a solution that is refined.
    rhs: Vec<Vector3<f64>>,
    residual: Vec<Vector3<f64>>,
    setup: Work,
}

/// What becomes of negative across stiffness.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum OnDemand {
    /// It stays, but is clamped if the matrix turns out indefinite.
    Clamp,
    /// Always the projection that is given.
    Always,
}

/// A system to be assembled and solved.
pub(crate) struct Linearized<'a> {
    pub(crate) at: Evaluation<'a>,
    pub(crate) on_demand: OnDemand,
    pub(crate) purpose: Purpose,
}

/// What a solution is for, which says how precise it must be. Only iterations
/// make a difference of it: direct solutions are right to rounding.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// The result of a step of order 1 or 2.
    Step,
    /// A result of high order.
    HighOrder,
    /// A correction that is checked afterwards.
    Correction,
    /// An estimate of an error.
    Estimate,
}

impl Purpose {
    /// The part of the solution that may be wrong.
    fn accuracy(self, solution: Solution) -> f64 {
        match (self, solution) {
            (Self::Estimate, _) => 1e-2,
            (_, Solution::Strict) | (Self::HighOrder, _) => 1e-11,
            (Self::Correction, Solution::Sufficient) => 1e-3,
            (Self::Step, Solution::Sufficient) => 1e-6,
        }
    }
}

/// Whether the matrix of a method has the Hessian itself wherever that is
/// positive definite.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hessian {
    Exact,
    /// Other across stiffness may take its place.
    Altered,
}

/// From this ratio of stiffness and mass in the matrix, c²ω²/1, on, solutions are
/// refined: a relative error of momentum of 1e-16 times that matters.
const WORTH_REFINING: f64 = 1e7;

/// How systems of a scene are solved.
fn options(system: &System, hessian: Hessian) -> Options<'_> {
    Options {
        positions: Some(blocks_of(&system.initial_positions()[..system.n_free()])),
        threads: system.threads(),
        // A factor that is made once costs nothing.
        route: match is_constant(system, hessian) {
            true => Route::Double,
            false => Route::Auto,
        },
        subspace: match system.motion() {
            Motion::Line(line) => Subspace::Line(line.into()),
            Motion::Space | Motion::Plane(_) if is_isotropic(system, hessian) => {
                Subspace::Isotropic
            }
            Motion::Plane(basis) => Subspace::Plane(basis.map(Into::into)),
            Motion::Space => Subspace::Space,
        },
    }
}

/// Whether the matrix depends on nothing but the step size.
fn is_constant(system: &System, hessian: Hessian) -> bool {
    let is_line = matches!(system.motion(), Motion::Line(_));
    is_isotropic(system, hessian) || (is_line && system.dashpots().is_empty())
}

fn is_isotropic(system: &System, hessian: Hessian) -> bool {
    hessian == Hessian::Exact && system.is_isotropic()
}

/// Memory, in bytes, that the solver of an implicit method begins with.
///
/// # Errors
///
/// If it cannot be counted.
pub fn solver_memory(system: &System) -> Result<u64, SolveError> {
    let pairs = system.pattern().pairs();
    Solver::memory(system.n_free(), pairs, options(system, Hessian::Exact))
}

/// What systems of a scene will cost, roughly.
pub(crate) fn price(system: &System) -> Result<Price, SolveError> {
    let pairs = system.pattern().pairs();
    Solver::price(system.n_free(), pairs, options(system, Hessian::Exact))
}

impl LinearSystem {
    /// Orders and factorizes symbolically.
    pub(crate) fn new(system: &System, hessian: Hessian) -> Result<Self, SolveError> {
        let mut setup = Work::default();
        setup.counts.symbolic_factorizations += 1;
        let pairs = system.pattern().pairs();
        Ok(Self {
            solver: Solver::analyze(system.n_free(), pairs, options(system, hessian))?,
            out: system.linearization(),
            solution: system.solution(),
            is_isotropic: is_isotropic(system, hessian),
            is_constant: is_constant(system, hessian),
            weights: None,
            frequency_square: system.frequency_bound().powi(2),
            rhs: Vec::new(),
            residual: Vec::new(),
            setup,
        })
    }

    /// What its solver has learned; the matrix itself is made anew.
    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        let experience = self.solver.experience();
        state.real(&mut experience.iterations);
        state.flag(&mut experience.is_iterative);
        state.count(&mut experience.pause);
        state.count(&mut experience.next_pause);
        if state.is_loading() {
            self.weights = None;
        }
    }

    /// What its construction took.
    pub(crate) fn setup(&self) -> Work {
        self.setup
    }

    /// What was linearized last.
    pub(crate) fn linearization(&mut self) -> &mut Linearization {
        &mut self.out
    }

    /// Forces and matrix; then `fill` makes the right-hand side of them in `x`,
    /// which becomes the solution. Springs that are clamped on demand
    /// are counted. Gives what was linearized in the end.
    pub(crate) fn linearize_and_solve<'a>(
        &mut self,
        system: &System,
        Linearized {
            at,
            on_demand,
            purpose,
        }: Linearized<'a>,
        mut fill: impl FnMut(&mut Linearization, &mut [Vector3<f64>]),
        x: &mut [Vector3<f64>],
        work: &mut Work,
    ) -> Result<Evaluation<'a>, MethodError> {
        let first = match on_demand {
            OnDemand::Clamp => Projection::None,
            OnDemand::Always => at.projection,
        };
        let mut attempt = |projection, work: &mut Work| {
            self.linearize(system, Evaluation { projection, ..at }, work)?;
            timed(&mut work.phases.assembly, || fill(&mut self.out, x));
            let at = self.taken(Evaluation { projection, ..at });
            self.solve_refined(system, &at, x, purpose, work)?;
            Ok(at)
        };
        match attempt(first, work) {
            Err(_) if on_demand == OnDemand::Clamp => {
                let clamped = system.springs().count_compressed(at.x, at.tensions);
                work.counts.clamped_springs += clamped as u64;
                attempt(Projection::Clamp, work)
            }
            done => done,
        }
    }

    /// What is really linearized: a matrix that does not depend on the state
    /// does not depend on tensions either.
    fn taken<'a>(&self, at: Evaluation<'a>) -> Evaluation<'a> {
        Evaluation {
            tensions: at.tensions.filter(|_| !self.is_isotropic),
            ..at
        }
    }

    /// Forces and matrix, ready for solutions.
    pub(crate) fn linearize(
        &mut self,
        system: &System,
        at: Evaluation<'_>,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        work.counts.linearizations += 1;
        if self.is_constant && self.weights == Some(at.weights) {
            // So is what anchors bring: they do not change their velocities.
            timed(&mut work.phases.assembly, || {
                system.forces(at.x, at.v, &mut self.out.forces);
            });
            return Ok(());
        }
        let at = self.taken(at);
        timed(&mut work.phases.assembly, || {
            system.linearize(&at, &mut self.out);
        });
        let before = self.solver.counts();
        let matrix = &self.out.matrix;
        let done = timed(&mut work.phases.factorization, || {
            self.solver
                .set_matrix(matrix.diagonal(), matrix.off_diagonal())
        });
        work.counts.factorizations += self.solver.counts().factorizations - before.factorizations;
        self.weights = done.is_ok().then_some(at.weights);
        done.map_err(MethodError::of)
    }

    /// Solves with the last matrix. Where stiffness hides the masses in its
    /// sums, the solution is refined once, with the residual term by term.
    fn solve_refined(
        &mut self,
        system: &System,
        at: &Evaluation<'_>,
        x: &mut [Vector3<f64>],
        purpose: Purpose,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let stiffness = at.weights.stiffness * self.frequency_square;
        let is_hidden = stiffness > at.weights.mass * WORTH_REFINING && stiffness.is_finite();
        if !is_hidden {
            return self.solve(x, purpose, work);
        }
        self.rhs.clear();
        self.rhs.extend_from_slice(x);
        self.solve(x, purpose, work)?;
        let mut residual = std::mem::take(&mut self.residual);
        residual.resize(x.len(), Vector3::zeros());
        timed(&mut work.phases.assembly, || {
            system.product(at, x, &mut residual);
        });
        for (r, b) in residual.iter_mut().zip(&self.rhs) {
            *r = b - *r;
        }
        let done = self.solve(&mut residual, purpose, work);
        for (x, r) in x.iter_mut().zip(&residual) {
            *x += r;
        }
        work.counts.refinements += 1;
        self.residual = residual;
        done
    }

    /// Solves with the last matrix, in place.
    pub(crate) fn solve(
        &mut self,
        rhs: &mut [Vector3<f64>],
        purpose: Purpose,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let before = self.solver.counts();
        let accuracy = purpose.accuracy(self.solution);
        let done = timed(&mut work.phases.solve, || {
            self.solver.solve_in_place(numbers_mut(rhs), accuracy)
        });
        let after = self.solver.counts();
        work.counts.solves += 1;
        work.counts.factorizations += after.factorizations - before.factorizations;
        work.counts.solver_iterations += after.iterations - before.iterations;
        if done.is_err() {
            // The solver has let go of the matrix.
            self.weights = None;
        }
        done.map_err(MethodError::of)
    }

    /// What a method with a matrix does for [`crate::Method::answer`], where S
    /// is the Hessian with its across stiffness from the given tensions,
    /// clamped. The matrix takes the place of the last one.
    pub(crate) fn answer(
        &mut self,
        system: &System,
        state: &State,
        tensions: Option<&[f64]>,
        time_scale: f64,
        errors: &mut [Vector3<f64>],
        work: &mut Work,
    ) -> bool {
        let at = Evaluation {
            x: &state.x,
            v: &state.v,
            projection: Projection::Clamp,
            tensions,
            dashpot_tension: false,
            weights: Weights::of_step(time_scale),
        };
        self.linearize(system, at, work)
            .and_then(|()| self.solve(errors, Purpose::Estimate, work))
            .is_ok()
    }
}

/// Vectors as plain numbers.
pub(crate) fn numbers_mut(vectors: &mut [Vector3<f64>]) -> &mut [f64] {
    bytemuck::cast_slice_mut(vectors)
}

/// Vectors as plain arrays.
fn blocks_of(vectors: &[Vector3<f64>]) -> &[[f64; 3]] {
    bytemuck::cast_slice(vectors)
}
