//! What the solver of a method's systems is told of them.

use crate::implicit::checked_solver::CheckedSolver;
use crate::threads::threads;
use crate::vectors::blocks_of;
use nalgebra::Vector3;
use springs_assembly::{Motion, System};
use springs_scene::{RunOptions, Tangent};
use springs_solver::{
    NearNullSpace, Options, Packing, Price, SolveError, Solver, Strategy, Subspace,
};

/// Which Hessian the matrix of a method has.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hessian {
    /// The Hessian itself, clamped where that is not positive definite or where
    /// the tangent says so.
    Exact,
    /// The Hessian itself, or the step fails.
    Unclamped,
    /// Other across stiffness may take its place, even where rest lengths are zero.
    Altered,
}

/// What is left of a matrix, where it does not need to be assembled as asked.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reduced {
    /// The whole.
    Whole,
    /// K·I for every spring, whatever the tensions.
    Isotropic,
    /// K u uᵀ for every spring: nothing else acts along the line of all motion.
    Line,
}

/// Whether steps are of one size.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
    Equal,
    Changing,
}

impl Hessian {
    /// Of linearly implicit Euler.
    pub(crate) fn of_tangent(tangent: Tangent) -> Self {
        match tangent {
            Tangent::Exact | Tangent::Clamped | Tangent::Absolute => Self::Exact,
            Tangent::Material | Tangent::Filtered => Self::Altered,
        }
    }
}

/// How systems of a scene, or of some of its blocks at these positions, are
/// solved, and a direction across the plane or line of the motion, in which the
/// matrix must be positive definite, too.
pub(crate) fn solver_options<'a>(
    system: &System,
    hessian: Hessian,
    steps: Steps,
    positions: &'a [[f64; 3]],
    threads: usize,
) -> (Options<'a>, Option<Vector3<f64>>) {
    let subspace = match system.motion() {
        Motion::Line(line) => Subspace::Line(line.into()),
        Motion::Space | Motion::Plane(_) if is_isotropic(system, hessian) => Subspace::Isotropic,
        Motion::Plane(basis) => Subspace::Plane(basis.map(Into::into)),
        Motion::Space => Subspace::Space,
    };
    let normal = match (system.motion(), subspace) {
        (Motion::Plane([u, v]), Subspace::Plane(_)) => Some(u.cross(&v)),
        (Motion::Line(line), _) if is_across_in_doubt(system, hessian) => Some(normal_of(&line)),
        _ => None,
    };
    let options = Options {
        positions: Some(positions),
        threads,
        // A factor that is made once costs nothing.
        strategy: if is_constant(system, hessian) && steps == Steps::Equal {
            Strategy::Double
        } else {
            Strategy::Auto
        },
        subspace,
        packing: if system.has_symmetric_blocks() {
            Packing::Symmetric
        } else {
            Packing::General
        },
        near_null_space: match subspace {
            Subspace::Space | Subspace::Plane(_) => NearNullSpace::RigidMotions,
            _ => NearNullSpace::Translations,
        },
    };
    (options, normal)
}

/// A unit vector across another one.
fn normal_of(line: &Vector3<f64>) -> Vector3<f64> {
    line.cross(&Vector3::ith(line.iamin(), 1.0)).normalize()
}

/// Whether the matrix across a line may not be positive definite: clamping, which
/// changes nothing along the line, does not help massless nodes.
fn is_across_in_doubt(system: &System, hessian: Hessian) -> bool {
    hessian == Hessian::Unclamped || system.masses().contains(&0.0)
}

/// Whether the matrix depends on nothing but the step size.
pub(crate) fn is_constant(system: &System, hessian: Hessian) -> bool {
    reduced(system, hessian) != Reduced::Whole && !system.is_damped()
}

/// Whether one matrix of numbers serves all three directions.
pub(crate) fn is_isotropic(system: &System, hessian: Hessian) -> bool {
    hessian != Hessian::Altered && system.is_isotropic()
}

pub(crate) fn reduced(system: &System, hessian: Hessian) -> Reduced {
    match system.motion() {
        Motion::Line(_)
            if system.is_constant_along_lines() && !is_across_in_doubt(system, hessian) =>
        {
            Reduced::Line
        }
        _ if is_isotropic(system, hessian) => Reduced::Isotropic,
        _ => Reduced::Whole,
    }
}

/// Memory, in bytes, that the solver of an implicit method with equal steps begins
/// with.
///
/// # Errors
///
/// If it cannot be counted.
pub fn solver_memory(system: &System, run: &RunOptions) -> Result<u64, SolveError> {
    let positions = positions_of(system);
    let (options, _) = solver_options(
        system,
        Hessian::Exact,
        Steps::Equal,
        positions,
        threads(run),
    );
    Solver::memory(system.n_free(), system.pattern().pairs(), options)
}

/// What systems of a scene will cost, roughly, with steps of changing size.
pub(crate) fn price(system: &System) -> Result<Price, SolveError> {
    let positions = positions_of(system);
    let (options, _) = solver_options(system, Hessian::Exact, Steps::Changing, positions, 1);
    Solver::price(system.n_free(), system.pattern().pairs(), options)
}

pub(crate) fn checked_solver(
    system: &System,
    hessian: Hessian,
    steps: Steps,
    run: &RunOptions,
) -> Result<CheckedSolver, SolveError> {
    let positions = positions_of(system);
    let (options, normal) = solver_options(system, hessian, steps, positions, threads(run));
    CheckedSolver::analyze(system.n_free(), system.pattern().pairs(), options, normal)
}

/// The same, always with a factor.
pub(crate) fn solver_with_factor(
    system: &System,
    hessian: Hessian,
    run: &RunOptions,
) -> Result<CheckedSolver, SolveError> {
    let positions = positions_of(system);
    let (options, normal) = solver_options(system, hessian, Steps::Equal, positions, threads(run));
    let options = Options {
        strategy: Strategy::Double,
        ..options
    };
    CheckedSolver::analyze(system.n_free(), system.pattern().pairs(), options, normal)
}

/// Positions of the free blocks as plain arrays.
pub(crate) fn positions_of(system: &System) -> &[[f64; 3]] {
    blocks_of(&system.initial_positions()[..system.n_free()])
}
