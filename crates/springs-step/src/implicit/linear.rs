//! The linear systems of methods with a matrix.

use crate::implicit::checked_solver::{CheckCounts, CheckedSolver};
use crate::implicit::components::Components;
use crate::implicit::solver_options::{
    Hessian, Reduced, Steps, checked_solver, is_constant, reduced, solver_with_factor,
};
use crate::threads::threads;
use crate::vectors::{blocks_of, numbers_mut};
use crate::work::timed;
use crate::{Archive, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, Linearization, Projection, System, Weights};
use springs_scene::{LinearTolerance, RunOptions};
use springs_solver::{Interrupt, Price, SolveError, StrategyState};

/// Forces and matrix of a method at one state, and the solver of their systems.
pub(crate) struct LinearSystem {
    solver: CheckedSolver,
    hessian: Hessian,
    components: Components,
    out: Linearization,
    run: RunOptions,
    reduced: Reduced,
    /// Whether the matrix depends on nothing but the weights, and those of the
    /// last one with the velocities of the fixed blocks at that time.
    is_constant: bool,
    weights: Option<Weights>,
    /// Weights of a constant matrix that was factorized, and counted, before the
    /// state was loaded.
    counted: Option<Weights>,
    anchor_velocities: Vec<Vector3<f64>>,
    /// The right-hand side and the residual of a solution that is refined.
    rhs: Vec<Vector3<f64>>,
    residual: Vec<Vector3<f64>>,
    /// For every free block, whether its part gets a clamped matrix.
    projected: Vec<bool>,
    setup: Work,
    /// What the solver has learned of the matrices of estimates.
    of_estimates: StrategyState,
    interrupt: Interrupt,
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
    fn accuracy(self, asked: LinearTolerance) -> f64 {
        match (self, asked) {
            (Self::Estimate, _) => 1e-2,
            (_, LinearTolerance::Strict) | (Self::HighOrder, _) => 1e-11,
            (Self::Correction, LinearTolerance::Sufficient) => 1e-3,
            (Self::Step, LinearTolerance::Sufficient) => 2e-7,
        }
    }
}

/// From this ratio of stiffness and mass in the matrix, c²ω²/1, on, solutions are
/// refined: a relative error of momentum of 1e-16 times that matters.
const WORTH_REFINING: f64 = 1e7;

impl LinearSystem {
    /// Orders and factorizes symbolically.
    pub(crate) fn new(
        system: &System,
        hessian: Hessian,
        run: &RunOptions,
    ) -> Result<Self, SolveError> {
        let solver = checked_solver(system, hessian, Steps::Equal, run)?;
        Ok(Self::with_solver(system, hessian, run, solver))
    }

    /// The same, always with a factor: it learns nothing that would have to be saved.
    pub(crate) fn with_factor(
        system: &System,
        hessian: Hessian,
        run: &RunOptions,
    ) -> Result<Self, SolveError> {
        let solver = solver_with_factor(system, hessian, run)?;
        Ok(Self::with_solver(system, hessian, run, solver))
    }

    fn with_solver(
        system: &System,
        hessian: Hessian,
        run: &RunOptions,
        mut solver: CheckedSolver,
    ) -> Self {
        let mut setup = Work::default();
        setup.counts.symbolic_factorizations += 1;
        Self {
            of_estimates: *solver.strategy_state(),
            solver,
            hessian,
            components: Components::new(system, hessian, threads(run)),
            out: system.linearization(),
            run: *run,
            reduced: reduced(system, hessian),
            is_constant: is_constant(system, hessian),
            weights: None,
            counted: None,
            anchor_velocities: system.initial_velocities()[system.n_free()..].to_vec(),
            rhs: Vec::new(),
            residual: Vec::new(),
            projected: Vec::new(),
            setup,
            interrupt: Interrupt::default(),
        }
    }

    /// What a matrix and a solution with a factor cost.
    pub(crate) fn factor_price(&self) -> Price {
        self.solver.factor_price()
    }

    /// Prepares for steps of changing size, where even a matrix that depends on
    /// nothing else changes often.
    pub(crate) fn expect_changing_steps(&mut self, system: &System) -> Result<(), SolveError> {
        if self.is_constant {
            self.solver = checked_solver(system, self.hessian, Steps::Changing, &self.run)?;
            self.solver.set_interrupt(&self.interrupt);
            self.weights = None;
            self.setup.counts.symbolic_factorizations += 1;
        }
        Ok(())
    }

    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
        self.solver.set_interrupt(interrupt);
        self.components.set_interrupt(interrupt);
    }

    /// What its solver has learned; the matrix itself is made anew, which is not
    /// counted again if it is constant.
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        let strategy_state = self.solver.strategy_state();
        for strategy_state in [strategy_state, &mut self.of_estimates] {
            archive.real(&mut strategy_state.iterations);
            archive.count(&mut strategy_state.solutions);
            archive.flag(&mut strategy_state.is_iterative);
            archive.count(&mut strategy_state.pause);
            archive.count(&mut strategy_state.next_pause);
            archive.flag(&mut strategy_state.has_rotations);
        }
        let constant = self.weights.or(self.counted).filter(|_| self.is_constant);
        let mut counted =
            constant.map(|weights| [weights.mass, weights.damping, weights.stiffness]);
        archive.option(&mut counted, |weights, archive| {
            weights.iter_mut().for_each(|weight| archive.real(weight))
        });
        if archive.is_loading() {
            self.weights = None;
            self.counted = counted.map(|[mass, damping, stiffness]| Weights {
                mass,
                damping,
                stiffness,
            });
        }
    }

    /// What its construction took.
    pub(crate) fn setup(&self) -> Work {
        self.setup
    }

    /// As [`springs_solver::Solver::expect_uses`].
    pub(crate) fn expect_uses(&mut self, uses: f64) {
        self.solver.expect_uses(uses);
    }

    /// How many solutions cost as much as a matrix does, if it gets a factor.
    pub(crate) fn solutions_per_matrix(&self) -> f64 {
        let price = self.factor_price();
        price.matrix / price.solution
    }

    /// Whether the last matrix has a factor, so that further solutions are cheap.
    pub(crate) fn has_factor(&mut self) -> bool {
        !self.solver.strategy_state().is_iterative
    }

    /// Static forces, in N, to be added to.
    pub(crate) fn static_forces(
        &mut self,
        system: &System,
        x: &[Vector3<f64>],
        work: &mut Work,
    ) -> &mut [Vector3<f64>] {
        let forces = &mut self.out.forces;
        timed(&mut work.phases.assembly, || {
            system.static_forces(x, forces)
        });
        forces
    }

    /// What was linearized last.
    pub(crate) fn linearization(&mut self) -> &mut Linearization {
        &mut self.out
    }

    /// Forces and matrix; then `fill` makes the right-hand side of them in `x`,
    /// which becomes the solution. Clamping on demand is a matter of each
    /// connected part: the springs of those parts whose matrix is not positive
    /// definite are clamped, and counted. Gives what was linearized in the end.
    pub(crate) fn linearize_and_solve<'a>(
        &'a mut self,
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
        if on_demand == OnDemand::Always {
            self.attempt(system, at, purpose, &mut fill, x, work)?;
            return Ok(self.taken(at));
        }
        let unclamped = Evaluation {
            projection: Projection::None,
            ..at
        };
        let block = match self.attempt(system, unclamped, purpose, &mut fill, x, work) {
            Err(MethodError::NotPositiveDefinite { block }) => block,
            done => return done.map(|()| self.taken(unclamped)),
        };
        if self.components.is_one() {
            let clamped = Evaluation {
                projection: Projection::Clamp,
                ..at
            };
            work.counts.clamped_springs += system.count_projected(&clamped) as u64;
            self.attempt(system, clamped, purpose, &mut fill, x, work)?;
            return Ok(self.taken(clamped));
        }
        self.judge_parts(system, at.x, purpose, block, work)?;
        let projected = std::mem::take(&mut self.projected);
        let clamped = Evaluation {
            projection: Projection::Clamp,
            projected: Some(&projected),
            ..at
        };
        work.counts.clamped_springs += system.count_projected(&clamped) as u64;
        let done = self.attempt(system, clamped, purpose, &mut fill, x, work);
        self.projected = projected;
        done?;
        Ok(self.taken(Evaluation {
            projection: Projection::Clamp,
            projected: Some(&self.projected),
            ..at
        }))
    }

    /// Linearizes, fills in the right-hand side and solves. If the matrix is not
    /// positive definite, the right-hand side is kept where parts will need it.
    fn attempt(
        &mut self,
        system: &System,
        at: Evaluation<'_>,
        purpose: Purpose,
        fill: &mut impl FnMut(&mut Linearization, &mut [Vector3<f64>]),
        x: &mut [Vector3<f64>],
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let linearized = self.linearize(system, at, work);
        if linearized.is_err() && self.components.is_one() {
            return linearized;
        }
        timed(&mut work.phases.assembly, || fill(&mut self.out, x));
        if !self.components.is_one() {
            self.rhs.clear();
            self.rhs.extend_from_slice(x);
        }
        linearized?;
        let at = self.taken(at);
        self.solve_refined(system, &at, x, purpose, work)
    }

    /// Finds out which connected parts of the last matrix, at positions `x`, which
    /// failed at `block`, are not positive definite, and so which blocks are projected.
    fn judge_parts(
        &mut self,
        system: &System,
        x: &[Vector3<f64>],
        purpose: Purpose,
        block: usize,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let mut counts = CheckCounts::default();
        let accuracy = purpose.accuracy(self.run.linear_tolerance);
        let (matrix, rhs) = (&self.out.matrix, (&self.rhs[..], accuracy));
        let judged = timed(&mut work.phases.factorization, || {
            self.components
                .judge(system, x, matrix, rhs, block, &mut counts)
        });
        count(counts, work);
        judged.map_err(MethodError::of)?;
        let is_indefinite = (0..system.n_free()).map(|b| self.components.is_indefinite_at(b));
        self.projected.clear();
        self.projected.extend(is_indefinite);
        Ok(())
    }

    /// What is really linearized, where it makes no difference along the motion.
    fn taken<'a>(&self, at: Evaluation<'a>) -> Evaluation<'a> {
        match self.reduced {
            Reduced::Whole => at,
            Reduced::Isotropic => Evaluation {
                carried: None,
                ..at
            },
            Reduced::Line => Evaluation {
                projection: Projection::Drop,
                projected: None,
                carried: None,
                velocity_stiffness: false,
                ..at
            },
        }
    }

    /// Forces and matrix, ready for solutions.
    pub(crate) fn linearize(
        &mut self,
        system: &System,
        at: Evaluation<'_>,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        if self.interrupt.is_requested() {
            return Err(MethodError::Interrupted);
        }
        work.counts.linearizations += 1;
        let anchor_velocities = &at.v[system.n_free()..];
        if self.is_constant
            && self.weights == Some(at.weights)
            && self.anchor_velocities[..] == *anchor_velocities
        {
            timed(&mut work.phases.assembly, || {
                system.static_forces(at.x, &mut self.out.forces);
            });
            return Ok(());
        }
        self.anchor_velocities.copy_from_slice(anchor_velocities);
        let at = self.taken(at);
        timed(&mut work.phases.assembly, || {
            if self.is_constant {
                // The same bits whenever it is made; forces as in steps that find it
                // made already.
                let x = system.initial_positions();
                system.linearize(&Evaluation { x, ..at }, &mut self.out);
                system.static_forces(at.x, &mut self.out.forces);
            } else {
                system.linearize(&at, &mut self.out);
            }
        });
        let before = self.solver.counts();
        let matrix = &self.out.matrix;
        let done = timed(&mut work.phases.factorization, || {
            self.solver
                .set_positions(blocks_of(&at.x[..system.n_free()]));
            self.solver
                .set_matrix(matrix.diagonal(), matrix.off_diagonal())
        });
        if self.counted.take() != Some(at.weights) {
            let factorizations = self.solver.counts().factorizations;
            work.counts.factorizations += factorizations - before.factorizations;
        }
        count(self.solver.take_check_counts(), work);
        self.weights = done.is_ok().then_some(at.weights);
        done.map_err(MethodError::of)
    }

    /// Solves with the last matrix. Where stiffness hides the masses in its
    /// sums, the solution is refined once, with the residual term by term; but not
    /// a correction by iteration, which the next correction mends.
    fn solve_refined(
        &mut self,
        system: &System,
        at: &Evaluation<'_>,
        x: &mut [Vector3<f64>],
        purpose: Purpose,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let frequency_square = system.frequency_bound_of_massive_nodes().powi(2);
        let stiffness = at.weights.stiffness * frequency_square;
        let is_hidden = stiffness > at.weights.mass * WORTH_REFINING && stiffness.is_finite();
        let is_mended = purpose == Purpose::Correction && self.solver.strategy_state().is_iterative;
        if !is_hidden || is_mended {
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
        let accuracy = purpose.accuracy(self.run.linear_tolerance);
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

    /// What a method with a matrix does for [`crate::Method::damp_vibrations`],
    /// `passes` times, for several lists of errors with one matrix; S is the
    /// Hessian with what is carried along, clamped. The
    /// matrix takes the place of the last one.
    pub(crate) fn damp_vibrations<const N: usize>(
        &mut self,
        system: &System,
        state: &State,
        Damping {
            carried,
            time_scale,
            passes,
        }: Damping<'_>,
        errors: [&mut [Vector3<f64>]; N],
        work: &mut Work,
    ) -> bool {
        let at = Evaluation {
            projection: Projection::Clamp,
            carried,
            ..Evaluation::new(&state.x, &state.v, Weights::of_step(time_scale))
        };
        // These matrices are stiffer than those of steps, and say nothing about
        // them.
        std::mem::swap(self.solver.strategy_state(), &mut self.of_estimates);
        self.solver.expect_uses(1.0);
        let mut done = self.linearize(system, at, work);
        for errors in errors {
            for _ in 0..passes {
                let of_masses = errors.iter_mut().zip(system.masses());
                of_masses.for_each(|(error, mass)| *error *= *mass);
                done = done.and_then(|()| self.solve(errors, Purpose::Estimate, work));
            }
        }
        std::mem::swap(self.solver.strategy_state(), &mut self.of_estimates);
        done.is_ok()
    }
}

fn count(counts: CheckCounts, work: &mut Work) {
    work.counts.symbolic_factorizations += counts.symbolic_factorizations;
    work.counts.factorizations += counts.factorizations;
}

/// How vibrations are damped in errors of velocities.
#[derive(Clone, Copy)]
pub(crate) struct Damping<'a> {
    /// What the Hessian is taken with, if not the present values.
    pub(crate) carried: Option<&'a [f64]>,
    /// τ, in s.
    pub(crate) time_scale: f64,
    /// How many times.
    pub(crate) passes: usize,
}
