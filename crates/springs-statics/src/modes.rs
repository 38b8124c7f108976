//! Vibrations about an equilibrium.

use crate::equations::{Equations, in_node_order, largest, vectors};
use crate::{Options, StaticsError};
use nalgebra::{Matrix3, Vector3};
use springs_assembly::{Projection, compile};
use springs_scene::Scene;
use springs_solver::{
    Eigenpair, Indefinite, Inertia, LowestEigenpairs, Pencil, SolveError, Solver, all_eigenpairs,
    lowest_eigenpairs,
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
    /// Whether these are as many as were asked for, and the lowest ones. Else iteration stalled,
    /// and these are modes, but others may be missing between them.
    pub is_complete: bool,
}

/// Dense matrices take less time than iteration where more than this part of all modes, one by
/// so many, is asked for, and fit into memory up to so many unknowns.
const DENSE_FROM: usize = 6;
const MOST_DENSE: usize = 6000;
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
/// A large part of all modes is found by dense matrices, up to rounding of the highest
/// frequency squared. Else they are found by iteration, and that none is missing is checked by
/// Sylvester's law: as many pivots of K − ω² M are negative as there are modes below ω.
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
        solver: equations.solver(options)?,
        indefinite: equations.indefinite_solver(options)?,
        equations: &equations,
        masses,
    };
    let n_all = problem.n_all();
    if n_all == 0 {
        return Err(StaticsError::NoMass);
    }
    let inertia = problem.inertia(0.0)?;
    problem.shift()?;
    let Found { pairs, is_complete } = problem.complete(count.min(n_all), n_all)?;

    let mut modes = Modes {
        frequencies: Vec::new(),
        shapes: Vec::new(),
        n_negative: inertia.negative,
        n_zero: inertia.zero,
        n_all,
        is_complete,
    };
    for (index, pair) in pairs.iter().enumerate() {
        // Where some are missing, indices say nothing.
        let grows = if is_complete {
            index < inertia.negative
        } else {
            pair.value < 0.0
        };
        let frequency = if grows {
            -pair.value.abs().sqrt()
        } else if is_complete && index < inertia.negative + inertia.zero {
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

/// Eigenpairs, and whether none is missing.
struct Found {
    pairs: Vec<Eigenpair>,
    is_complete: bool,
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

    /// The `count` lowest eigenpairs, and whether none is missing.
    fn complete(&mut self, count: usize, n_all: usize) -> Result<Found, StaticsError> {
        let n = 3 * self.masses.len();
        let dense_is_possible = n <= MOST_DENSE;
        if dense_is_possible && DENSE_FROM * count > n_all {
            return self.dense(count);
        }
        // One more, to see how far it is away.
        let mut found = self.iterate((count + 1).min(n_all))?;
        if !found.is_complete && dense_is_possible {
            return self.dense(count);
        }
        found.pairs.truncate(count);
        Ok(found)
    }

    /// By iteration, with larger and larger blocks until none is missing.
    fn iterate(&mut self, count: usize) -> Result<Found, StaticsError> {
        let mut block = BLOCK;
        loop {
            let LowestEigenpairs {
                pairs,
                is_converged,
            } = self.pairs(count, block)?;
            // Above the last of these that the next one is apart from.
            let is_apart = |below: usize| {
                let (low, high) = (pairs[below - 1].value, pairs[below].value);
                high - low > APART * low.abs().max(high.abs())
            };
            let below = (1..pairs.len()).rev().find(|&below| is_apart(below));
            let is_complete = is_converged
                && match below {
                    None => true,
                    Some(below) => {
                        let middle = 0.5 * (pairs[below - 1].value + pairs[below].value);
                        self.inertia(middle)?.negative <= below
                    }
                };
            block *= 2;
            if is_complete || !is_converged || block > MOST_BLOCK {
                return Ok(Found { pairs, is_complete });
            }
        }
    }

    /// All of them, by dense matrices; the first `count`.
    fn dense(&self, count: usize) -> Result<Found, StaticsError> {
        let n_blocks = self.masses.len();
        let directions = self.directions();
        let n = directions.len();
        let mut image = vec![Vector3::zeros(); n_blocks];
        let mut unit = image.clone();
        let mut stiffness = vec![0.0; n * n];
        for (column, (block, direction)) in directions.iter().enumerate() {
            unit[*block] = *direction;
            self.equations.product(&unit, &mut image);
            unit[*block] = Vector3::zeros();
            let rows = &mut stiffness[column * n..][..n];
            for (entry, (block, direction)) in rows.iter_mut().zip(&directions) {
                *entry = direction.dot(&image[*block]);
            }
        }
        let masses: Vec<f64> = directions
            .iter()
            .map(|(block, _)| self.masses[*block])
            .collect();
        let all = all_eigenpairs(n, |i, j| stiffness[j * n + i], &masses)?;
        let pairs = all.into_iter().take(count).map(|pair| {
            let mut vector = vec![Vector3::zeros(); n_blocks];
            for ((block, direction), part) in directions.iter().zip(&pair.vector) {
                vector[*block] += direction * *part;
            }
            Eigenpair {
                value: pair.value,
                vector: vector.iter().flatten().copied().collect(),
            }
        });
        Ok(Found {
            pairs: pairs.collect(),
            is_complete: true,
        })
    }

    /// Blocks and directions of unit length, across each other, in which they may move.
    fn directions(&self) -> Vec<(usize, Vector3<f64>)> {
        let axes = [0, 1, 2].map(|axis| {
            let mut units = vec![Vector3::ith(axis, 1.0); self.masses.len()];
            self.equations.project(&mut units);
            units
        });
        let of_block = |block: usize| {
            let [x, y, z] = [0, 1, 2].map(|axis| axes[axis][block]);
            // Onto what guides leave free: of eigenvalues 1 and 0.
            let along = Matrix3::from_columns(&[x, y, z]).symmetric_eigen();
            let free = (0..3).filter(|&k| along.eigenvalues[k] > 0.5);
            let free = free.map(|k| (block, along.eigenvectors.column(k).into_owned()));
            free.collect::<Vec<_>>()
        };
        (0..self.masses.len()).flat_map(of_block).collect()
    }

    fn pairs(&mut self, count: usize, block: usize) -> Result<LowestEigenpairs, SolveError> {
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
