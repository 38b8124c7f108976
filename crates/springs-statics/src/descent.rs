//! Downhill to where forces are balanced.

mod steps;

use self::steps::FIRST_DAMPING;
use crate::equations::{Equations, Potential, largest, numbers_mut, vectors};
use crate::{Options, StaticsError};
use nalgebra::Vector3;
use springs_assembly::Projection;
use springs_solver::{Indefinite, Inertia, SolveError, Solver};

/// Steps of implicit Euler, so to speak, with masses that are in proportion to stiffnesses.
///
/// A step from x₀ goes to the least of V(x) + μ/2 (x − x₀)ᵀ S (x − x₀), where S is what is
/// stiff at each node, by Newton's method: (H + μS) d = f − μS (x − x₀). H has the tensions
/// that the last iteration predicted to first order in place of the present ones: it is the
/// matrix of the equations in which tensions are unknowns of their own, so that steps may be
/// as long as soft directions want them, however stiff springs are. Where it is not positive
/// definite, negative terms are clamped. As steps succeed, μ goes to zero, and a step
/// becomes one of Newton's method for the equilibrium.
pub(crate) struct Descent<'a> {
    pub(crate) equations: Equations<'a>,
    solver: Solver,
    indefinite: Indefinite,
    options: &'a Options,
    pub(crate) iterations: usize,
    /// Extent of everything, in m.
    size: f64,
    /// The last μ that made a matrix positive definite.
    shift: f64,
    /// Whether less than that did not do.
    is_indefinite: bool,
    /// Of the two steps that there are then.
    prefers_clamped: bool,
    /// Steps until both are made again.
    until_comparison: u32,
    /// The last one that was needed for a step to lead down.
    hard: f64,
}

/// A state on the way.
#[derive(Clone)]
struct Point {
    x: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
    potential: Potential,
    /// Tensions and the like as predicted.
    carried: Vec<f64>,
}

/// Nothing that is held goes further than this, in sizes of the scene.
const CARRIED_OFF: f64 = 1e6;
/// Steps of Newton's method alone at the end.
const MOST_POLISHING: usize = 20;
/// μ of steps that only stiff directions are moved by, and how many there are.
const REFINING: f64 = 1e-6;
const MOST_REFINEMENTS: usize = 4;
/// Times that damped steps begin anew after those.
const MOST_ROUNDS: usize = 4;

impl<'a> Descent<'a> {
    pub(crate) fn new(equations: Equations<'a>, options: &'a Options) -> Result<Self, SolveError> {
        let x = equations.system.initial_positions();
        let first = x.first().copied().unwrap_or_default();
        let (mut low, mut high) = (first, first);
        for x in x {
            (low, high) = (low.inf(x), high.sup(x));
        }
        let size = (high - low).norm();
        Ok(Self {
            indefinite: equations.indefinite_solver(options)?,
            size: if size > 0.0 { size } else { 1.0 },
            solver: equations.solver(options)?,
            equations,
            options,
            shift: 0.0,
            is_indefinite: false,
            prefers_clamped: false,
            until_comparison: 0,
            hard: 0.0,
            iterations: 0,
        })
    }

    /// Extent of everything, in m.
    pub(crate) fn size(&self) -> f64 {
        self.size
    }

    /// Whether forces are balanced at x.
    pub(crate) fn is_balanced(&mut self, x: &[Vector3<f64>]) -> Result<bool, StaticsError> {
        let forces = self.equations.forces(x);
        self.check(&forces)?;
        self.linearize(x);
        Ok(self.equations.is_balanced(x, &forces))
    }

    /// Ends if it is asked to stop.
    pub(crate) fn hear(&self) -> Result<(), StaticsError> {
        if self.options.interrupt.is_requested() {
            return Err(SolveError::Interrupted.into());
        }
        Ok(())
    }

    fn check(&self, forces: &[Vector3<f64>]) -> Result<(), StaticsError> {
        self.hear()?;
        let (block, size) = largest(forces);
        if size.is_finite() {
            return Ok(());
        }
        let node = self.equations.system.numbering().node(block);
        Err(StaticsError::NotFinite { node })
    }

    /// Brings x to where forces are balanced.
    pub(crate) fn run(&mut self, x: &mut [Vector3<f64>]) -> Result<(), StaticsError> {
        let start = x.to_vec();
        let mut best = f64::INFINITY;
        for _ in 0..MOST_ROUNDS {
            let done = self.damped(x, &start)? || self.polish(x)?;
            if done {
                return Ok(());
            }
            let left = largest(&self.equations.forces(x)).1;
            if left >= 0.5 * best || self.iterations >= self.options.most_iterations {
                break;
            }
            best = left;
        }
        let (block, residual) = largest(&self.equations.forces(x));
        Err(StaticsError::NotBalanced {
            node: self.equations.system.numbering().node(block),
            residual,
            iterations: self.iterations,
        })
    }

    fn point(&self, x: Vec<Vector3<f64>>, carried: Vec<f64>) -> Point {
        Point {
            forces: self.equations.forces(&x),
            potential: self.equations.potential(&x),
            x,
            carried,
        }
    }

    /// Damped steps, until forces are balanced, or no step leads down any more.
    fn damped(
        &mut self,
        x: &mut [Vector3<f64>],
        start: &[Vector3<f64>],
    ) -> Result<bool, StaticsError> {
        let system = self.equations.system;
        let mut carried = vec![0.0; system.n_carried()];
        system.carried(x, &mut carried);
        let mut at = self.point(x.to_vec(), carried);
        let mut damping = FIRST_DAMPING;
        let mut reach = 0.5 * self.size;
        let mut done = false;
        while self.iterations < self.options.most_iterations {
            self.check(&at.forces)?;
            self.linearize(&at.x);
            done = self.equations.is_balanced(&at.x, &at.forces);
            if done {
                break;
            }
            self.iterations += 1;
            let Some(next) = self.step(&at, &mut damping, &mut reach)? else {
                break;
            };
            at = next;
            self.check_reach(&at.x, start)?;
        }
        x.copy_from_slice(&at.x);
        Ok(done)
    }

    fn check_reach(&self, x: &[Vector3<f64>], start: &[Vector3<f64>]) -> Result<(), StaticsError> {
        let moves: Vec<_> = x.iter().zip(start).map(|(x, start)| x - start).collect();
        let (block, moved) = largest(&moves);
        if moved < CARRIED_OFF * self.size {
            return Ok(());
        }
        let node = self.equations.system.numbering().node(block);
        Err(StaticsError::CarriedOff { node })
    }

    /// Newton's method itself, to where forces are least. Whether they are balanced there.
    fn polish(&mut self, x: &mut [Vector3<f64>]) -> Result<bool, StaticsError> {
        let n_free = self.equations.n_free();
        let mut next = x.to_vec();
        let mut least = f64::INFINITY;
        for _ in 0..MOST_POLISHING {
            let forces = self.equations.forces(&next);
            let left = largest(&forces).1;
            // What is not a number is not less.
            let is_less = left < least;
            if !is_less {
                break;
            }
            least = left;
            x.copy_from_slice(&next);
            self.linearize(&next);
            if self.equations.is_balanced(x, &forces) {
                return Ok(true);
            }
            self.factorize_stiffness()?;
            self.iterations += 1;
            let mut d = forces;
            self.indefinite.solve_in_place(numbers_mut(&mut d))?;
            if largest(&d).1 > 1e-2 * self.size {
                break;
            }
            for (x, d) in next[..n_free].iter_mut().zip(&d) {
                *x += d;
            }
        }
        Ok(false)
    }

    /// From where forces are balanced to where they are so up to rounding, as far as stiff
    /// directions go: what is left of a tension is a stiffness across the spring, which
    /// must not be taken for one.
    pub(crate) fn refine(&mut self, x: &mut [Vector3<f64>]) -> Result<(), StaticsError> {
        let system = self.equations.system;
        let mut carried = vec![0.0; system.n_carried()];
        let mut forces = self.equations.forces(x);
        for _ in 0..MOST_REFINEMENTS {
            system.carried(x, &mut carried);
            let at = self.point(x.to_vec(), carried.clone());
            let scales = self.equations.scales().to_vec();
            let is_definite = self.factorize(&at, REFINING, &scales, Projection::None)?
                || self.factorize(&at, REFINING, &scales, Projection::Clamp)?;
            if !is_definite {
                break;
            }
            let mut d = forces.clone();
            self.solver.solve_in_place(numbers_mut(&mut d), 1e-10)?;
            self.equations.project(&mut d);
            let mut next = x.to_vec();
            for (x, d) in next.iter_mut().zip(&d) {
                *x += d;
            }
            let left = self.equations.forces(&next);
            let is_better = largest(&left).1 < 0.5 * largest(&forces).1;
            if !is_better {
                break;
            }
            self.iterations += 1;
            x.copy_from_slice(&next);
            forces = left;
        }
        Ok(())
    }

    /// Pivots of the stiffness at x.
    pub(crate) fn inertia(&mut self, x: &[Vector3<f64>]) -> Result<Inertia, StaticsError> {
        self.linearize(x);
        self.factorize_stiffness()
    }

    /// Takes the stiffness at x as it is.
    pub(crate) fn linearize(&mut self, x: &[Vector3<f64>]) {
        self.equations.linearize(x, None, Projection::None);
    }

    /// Makes a factor of the stiffness that was taken last, and counts its pivots.
    pub(crate) fn factorize_stiffness(&mut self) -> Result<Inertia, StaticsError> {
        let (diagonal, off_diagonal) = (self.equations.diagonal(), self.equations.off_diagonal());
        Ok(self.indefinite.set_matrix(diagonal, off_diagonal)?)
    }

    /// The factor of the last [`Self::factorize_stiffness`].
    pub(crate) fn factor(&self) -> &Indefinite {
        &self.indefinite
    }

    /// From an unstable equilibrium, whose pivots were counted last, to a lower place
    /// nearby; `None` if energies do not tell one.
    pub(crate) fn beside(&self, x: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let at = self.equations.potential(x);
        let direction = self.indefinite.negative_directions().next()?;
        let lengths = (2..8).flat_map(|exponent| {
            let length = self.size * 0.1f64.powi(exponent);
            [length, -length]
        });
        let lower = lengths.filter_map(|length| {
            let mut x = x.to_vec();
            for (x, d) in x.iter_mut().zip(vectors(&direction)) {
                *x += d * length;
            }
            let energy = self.equations.potential(&x).energy;
            (energy < at.energy - at.rounding).then_some((energy, x))
        });
        let lowest = lower.min_by(|a, b| a.0.total_cmp(&b.0));
        lowest.map(|(_, x)| x)
    }
}
