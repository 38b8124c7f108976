//! Vibrations about an equilibrium.

use crate::equations::{Equations, in_node_order, largest, vectors};
use crate::{Options, StaticsError};
use nalgebra::Vector3;
use springs_assembly::{Projection, compile};
use springs_scene::Scene;
use springs_solver::{
    Eigenpair, Indefinite, Inertia, Pencil, SolveError, Solver, lowest_eigenpairs,
};

/// The lowest modes of a scene, K u = ω² M u.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Modes {
    /// ω/2π in Hz, ascending. Of a motion that grows as e^{κt} it is −κ/2π; of one that
    /// nothing resists, zero.
    pub frequencies: Vec<f64>,
    /// How far each node goes, by mode; the largest component is 1. Up to a part of 1e-9,
    /// modes of equal frequency in any combination.
    pub shapes: Vec<Vec<Vector3<f64>>>,
    /// Modes that grow.
    pub n_negative: usize,
    /// Modes that nothing resists, as far as pivots of the stiffness tell: see
    /// [`Indefinite::ZERO`].
    pub n_zero: usize,
    /// How many modes there are: three for each node with a mass, less what guides hold.
    pub n_all: usize,
}

/// Vectors of iteration to begin with, and the most.
const BLOCK: usize = 6;
const MOST_BLOCK: usize = 48;
/// First shift below zero where the stiffness is not positive definite, as a part of the
/// largest stiffness per mass, and what it grows by.
const FIRST_SHIFT: f64 = 1e-6;
const GROWTH: f64 = 16.0;
/// Eigenvalues that are further apart than this part of their size are told apart.
const APART: f64 = 1e-6;

/// The `count` lowest modes about the scene as it is, or all if there are fewer. It should be
/// in [equilibrium](crate::settle). Nodes without mass follow the others; damping does
/// nothing.
///
/// That none is missing is checked by Sylvester's law: as many pivots of K − ω² M are
/// negative as there are modes below ω.
///
/// # Errors
///
/// If the scene has problems, nothing has a mass, or massless nodes are loose.
pub fn modes(scene: &Scene, count: usize, options: &Options) -> Result<Modes, StaticsError> {
    let system = compile(scene)?;
    let masses = system.masses();
    let mut equations = Equations::new(&system);
    equations.linearize(system.initial_positions(), None, Projection::None);
    let mut problem = Problem {
        solver: equations.solver(options.threads.max(1))?,
        indefinite: equations.indefinite_solver()?,
        equations: &equations,
        masses,
    };
    problem.solver.set_interrupt(&options.interrupt);
    let n_all = problem.n_all();
    if n_all == 0 {
        return Err(StaticsError::NoMass);
    }
    let inertia = problem.inertia(0.0)?;
    problem.shift()?;
    let count = count.min(n_all);
    // One more, to see how far it is away.
    let pairs = problem.complete((count + 1).min(n_all), count)?;

    let mut modes = Modes {
        frequencies: Vec::new(),
        shapes: Vec::new(),
        n_negative: inertia.negative,
        n_zero: inertia.zero,
        n_all,
    };
    for (index, pair) in pairs.iter().enumerate() {
        let frequency = if index < inertia.negative {
            -pair.value.abs().sqrt()
        } else if index < inertia.negative + inertia.zero {
            0.0
        } else {
            pair.value.abs().sqrt()
        };
        modes.frequencies.push(frequency / std::f64::consts::TAU);
        let shape = vectors(&pair.vector);
        let (block, size) = largest(shape);
        let scale = shape[block][shape[block].iamax()].signum() / size;
        let mut blocks = vec![Vector3::zeros(); system.numbering().n_nodes()];
        for (scaled, shape) in blocks.iter_mut().zip(shape) {
            *scaled = shape * scale;
        }
        modes.shapes.push(in_node_order(&system, &blocks));
    }
    Ok(modes)
}

struct Problem<'a> {
    equations: &'a Equations<'a>,
    /// Of the free blocks, in kg.
    masses: &'a [f64],
    solver: Solver,
    indefinite: Indefinite,
}

impl Problem<'_> {
    /// How many modes there are: the rank of M.
    fn n_all(&self) -> usize {
        let mut of_axes = 0.0;
        for axis in 0..3 {
            let mut units = vec![Vector3::ith(axis, 1.0); self.masses.len()];
            self.equations.project(&mut units);
            let massive = units.iter().zip(self.masses);
            let massive = massive.filter(|(_, mass)| **mass > 0.0);
            of_axes += massive.map(|(unit, _)| unit[axis]).sum::<f64>();
        }
        of_axes.round() as usize
    }

    /// K − σM along guides.
    fn diagonal(&self, shift: f64) -> Vec<[f64; 6]> {
        let of_block = |block: usize| -shift * self.masses[block];
        self.equations.shifted_diagonal(of_block)
    }

    /// Pivots of K − σM.
    fn inertia(&mut self, shift: f64) -> Result<Inertia, SolveError> {
        let diagonal = self.diagonal(shift);
        let off_diagonal = self.equations.off_diagonal();
        self.indefinite.set_matrix(&diagonal, off_diagonal)
    }

    /// Factorizes K − σM with a σ, zero or below, that makes it positive definite.
    fn shift(&mut self) -> Result<(), StaticsError> {
        let with_masses = self.equations.scales().iter().zip(self.masses);
        let ratios = with_masses.filter(|(_, mass)| **mass > 0.0);
        let largest = ratios.map(|(scale, mass)| scale / mass).fold(0.0, f64::max);
        let mut shift = 0.0;
        loop {
            let diagonal = self.diagonal(shift);
            let off_diagonal = self.equations.off_diagonal();
            match self.solver.set_matrix(&diagonal, off_diagonal) {
                Ok(()) => return Ok(()),
                Err(SolveError::NotPositiveDefinite { block }) if shift < -1e6 * largest => {
                    let node = self.equations.system.numbering().node(block);
                    return Err(StaticsError::LooseMasslessNode { node });
                }
                Err(SolveError::NotPositiveDefinite { .. }) => {}
                Err(error) => return Err(error.into()),
            }
            shift = (GROWTH * shift).min(-FIRST_SHIFT * largest);
        }
    }

    /// The lowest eigenpairs, `count` of them after some more were found; none is missing.
    fn complete(&mut self, more: usize, count: usize) -> Result<Vec<Eigenpair>, StaticsError> {
        let mut block = BLOCK;
        loop {
            let mut pairs = self.pairs(more, block)?;
            // Above the last of these that the next one is apart from.
            let is_apart = |below: usize| {
                let (low, high) = (pairs[below - 1].value, pairs[below].value);
                high - low > APART * low.abs().max(high.abs())
            };
            let below = (1..pairs.len()).rev().find(|&below| is_apart(below));
            let is_complete = match below {
                None => true,
                Some(below) => {
                    let middle = 0.5 * (pairs[below - 1].value + pairs[below].value);
                    self.inertia(middle)?.negative <= below
                }
            };
            if is_complete {
                pairs.truncate(count);
                return Ok(pairs);
            }
            block *= 2;
            if block > MOST_BLOCK {
                return Err(SolveError::NotConverged.into());
            }
        }
    }

    fn pairs(&mut self, count: usize, block: usize) -> Result<Vec<Eigenpair>, SolveError> {
        let (equations, masses, solver) = (self.equations, self.masses, &mut self.solver);
        let stiffness = |x: &[f64], y: &mut [f64]| equations.product(vectors(x), vectors_mut(y));
        let mass = |x: &[f64], y: &mut [f64]| {
            let y = vectors_mut(y);
            for (y, (x, mass)) in y.iter_mut().zip(vectors(x).iter().zip(masses)) {
                *y = x * *mass;
            }
            equations.project(y);
        };
        let mut shifted_inverse = |b: &mut [f64]| {
            solver.solve_in_place(b, 1e-13)?;
            equations.project(vectors_mut(b));
            Ok(())
        };
        let mut pencil = Pencil {
            n: 3 * masses.len(),
            stiffness: &stiffness,
            mass: &mass,
            shifted_inverse: &mut shifted_inverse,
        };
        lowest_eigenpairs(&mut pencil, count, block)
    }
}

/// Plain numbers as vectors.
fn vectors_mut(numbers: &mut [f64]) -> &mut [Vector3<f64>] {
    bytemuck::cast_slice_mut(numbers)
}
