//! How far a system can still move from where it is.

use crate::State;
use crate::implicit::checked_solver::for_solver;
use crate::implicit::solver_options::{Hessian, Steps, positions_of, solver_options};
use crate::vectors::{blocks_of, numbers_mut};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, Linearization, Motion, Projection, System, Weights};
use springs_solver::{Solver, StrategyState};

/// Finds out whether a system is at rest: exactly, or up to small motion about a
/// stable equilibrium.
pub(crate) struct Sleep {
    /// Of the Hessian, as the methods have theirs; `None` if it cannot be analyzed.
    solver: Option<Solver>,
    out: Linearization,
    toward: Vec<Vector3<f64>>,
    slowest: Vec<Vector3<f64>>,
}

/// Inverse iterations for the softest direction of the Hessian.
const ITERATIONS: usize = 8;

impl Sleep {
    pub(crate) fn new(system: &System, threads: usize) -> Self {
        let zeros = vec![Vector3::zeros(); system.n_free()];
        let positions = positions_of(system);
        let (hessian, steps) = (Hessian::Exact, Steps::Changing);
        let (options, _) = solver_options(system, hessian, steps, positions, threads);
        Self {
            solver: Solver::analyze(system.n_free(), system.pattern().pairs(), options).ok(),
            out: system.linearization(),
            toward: zeros.clone(),
            slowest: zeros,
        }
    }

    /// Whether nothing moves and nothing pushes, to the last bit.
    pub(crate) fn is_exact(system: &System, state: &State) -> bool {
        let mut forces = vec![Vector3::zeros(); system.n_free()];
        system.forces(state.time, &state.x, &state.v, &mut forces);
        let still = |vectors: &[Vector3<f64>]| vectors.iter().all(|v| *v == Vector3::zeros());
        let may_begin = system.has_loads() || !system.prescribed().is_empty();
        still(&state.v) && still(&forces) && !may_begin
    }

    /// How far, in m, any node can still get from where it is: to the
    /// equilibrium by the Hessian H, x + H⁻¹f, and from there as far as the
    /// energy E = ½ fᵀH⁻¹f + ½ vᵀM v reaches in the softest direction, √(2E/λ),
    /// to first order. `None` where fixed nodes move, loads change, or H, in the plane or along
    /// the line that the motion stays in, is not positive definite, so that motion
    /// need not end, or where springs may break.
    pub(crate) fn reach(&mut self, system: &System, state: &State) -> Option<f64> {
        if system.any_anchor_moves(&state.v) || system.has_loads() || system.has_memory() {
            return None;
        }
        let at = Evaluation {
            // Along a line there is K u uᵀ only.
            projection: if matches!(system.motion(), Motion::Line(_)) {
                Projection::Drop
            } else {
                Projection::None
            },
            ..Evaluation::new(&state.x, &state.v, Weights::STIFFNESS)
        };
        system.linearize(&at, &mut self.out);
        let solver = self.solver.as_mut()?;
        // The same state is judged the same way, whatever came before.
        *solver.strategy_state() = StrategyState::default();
        let matrix = &self.out.matrix;
        solver.set_positions(blocks_of(&state.x[..system.n_free()]));
        let set = solver.set_matrix(matrix.diagonal(), for_solver(matrix.off_diagonal()));
        set.ok()?;
        let mut solve = |x: &mut [Vector3<f64>]| solver.solve_in_place(numbers_mut(x), 1e-6).ok();

        self.toward.copy_from_slice(&self.out.forces);
        solve(&mut self.toward)?;
        let products = self.toward.iter().zip(&self.out.forces);
        let potential: f64 = products.map(|(d, f)| 0.5 * d.dot(f)).sum();
        let energy = potential + system.kinetic_energy(&state.v);

        let mut softness = 0.0;
        for (k, x) in self.slowest.iter_mut().enumerate() {
            // Anything that no direction is orthogonal to.
            *x = Vector3::new(1.0, 0.7, 0.4) + Vector3::repeat((k as f64).sin());
        }
        for _ in 0..ITERATIONS {
            let length = norm(&self.slowest);
            self.slowest.iter_mut().for_each(|x| *x /= length);
            solve(&mut self.slowest)?;
            softness = norm(&self.slowest);
        }
        let farthest = self.toward.iter().map(Vector3::norm).fold(0.0, f64::max);
        Some(farthest + (2.0 * energy * softness).sqrt())
    }
}

fn norm(vectors: &[Vector3<f64>]) -> f64 {
    let squares = vectors.iter().map(Vector3::norm_squared);
    squares.sum::<f64>().sqrt()
}
