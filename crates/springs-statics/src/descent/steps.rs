//! Steps that lead down.

use super::{Descent, Point};
use crate::StaticsError;
use crate::equations::{largest, numbers_mut};
use nalgebra::Vector3;
use springs_assembly::Projection;
use springs_solver::SolveError;

/// What becomes of a step.
enum Attempt {
    /// Solved for; and whether it was cut to the reach.
    Solved(Point, bool),
    /// Its matrix is not positive definite.
    Indefinite,
    /// Newton's method does not converge.
    Diverged,
}

/// μ to begin with, that of which no damping is left, and that of which no step is.
pub(super) const FIRST_DAMPING: f64 = 1e-2;
const LEAST_DAMPING: f64 = 1e-17;
const MOST_DAMPING: f64 = 1e4;
/// The same where more of it makes the matrix positive definite.
const LEAST_SHIFT: f64 = 1e-12;
const MOST_SHIFT: f64 = 1.0;
/// Newton iterations of a step.
const MOST_CORRECTIONS: usize = 8;
/// A step is solved for when the last of them is this part of it.
const SOLVED: f64 = 0.03;
/// Iterations must shrink by this much, except the first.
const CONTRACTION: f64 = 0.7;
/// Steps between two of which the better one of two ways is taken.
const COMPARISONS: u32 = 2;
/// What μ is multiplied with after steps that succeed at once, and after those that do not.
const EASIER: f64 = 0.1;
const HARDER: f64 = 8.0;

impl Descent<'_> {
    /// One step that leads down, with as little damping as allows it; `None` if there is
    /// none.
    pub(super) fn step(
        &mut self,
        at: &Point,
        damping: &mut f64,
        reach: &mut f64,
    ) -> Result<Option<Point>, StaticsError> {
        let mut is_first = true;
        while *damping < MOST_DAMPING {
            if let Some((next, is_cut)) = self.best_of(at, *damping, *reach, is_first)? {
                if is_cut {
                    *reach *= 2.0;
                } else if is_first {
                    *damping *= EASIER;
                    if *damping < LEAST_DAMPING {
                        *damping = 0.0;
                    }
                } else {
                    self.hard = *damping;
                }
                return Ok(Some(next));
            }
            // Where it was hard before, it is likely to be so again.
            let least = if is_first {
                self.hard / HARDER
            } else {
                LEAST_DAMPING
            };
            *damping = (HARDER * *damping).max(least).max(LEAST_DAMPING);
            is_first = false;
        }
        *damping = FIRST_DAMPING;
        Ok(None)
    }

    /// The step with the matrix as it is or, where that is not positive definite, one of two:
    /// with negative terms clamped, or with as much more damping as it takes. The first is
    /// better far out, the second where the equilibrium is left that the matrix belongs to, as
    /// in buckling; now and then both are made, and the better one is taken until the next
    /// time. `None` if it does not lead down.
    fn best_of(
        &mut self,
        at: &Point,
        damping: f64,
        reach: f64,
        is_first: bool,
    ) -> Result<Option<(Point, bool)>, StaticsError> {
        if !self.is_indefinite {
            match self.attempt(at, damping, reach, Projection::None)? {
                Attempt::Indefinite => self.is_indefinite = true,
                Attempt::Diverged => return Ok(None),
                Attempt::Solved(next, is_cut) => {
                    let leads_down = self.leads_down(at, &next);
                    return Ok(leads_down.then_some((next, is_cut)));
                }
            }
        }
        let compares = self.until_comparison == 0;
        let mut clamped = None;
        if compares || self.prefers_clamped {
            clamped = self.clamped(at, damping, reach)?;
        }
        let mut shifted = None;
        if compares || clamped.is_none() {
            let change = if is_first { 1.0 / HARDER } else { HARDER };
            self.shift = (self.shift * change).max(HARDER * damping).max(LEAST_SHIFT);
            shifted = self.shifted(at, reach)?;
        }
        if !compares && clamped.is_none() && shifted.is_none() && !self.prefers_clamped {
            clamped = self.clamped(at, damping, reach)?;
        }
        self.until_comparison = match self.until_comparison {
            0 => COMPARISONS,
            left => left - 1,
        };
        Ok(match (clamped, shifted) {
            (Some(clamped), Some(shifted)) => {
                let energy = |one: &(Point, bool)| one.0.potential.energy;
                self.prefers_clamped = energy(&clamped) < energy(&shifted);
                Some(if self.prefers_clamped {
                    clamped
                } else {
                    shifted
                })
            }
            (clamped, shifted) => {
                self.prefers_clamped = clamped.is_some();
                clamped.or(shifted)
            }
        })
    }

    /// The step with negative terms clamped, if it leads down.
    fn clamped(
        &mut self,
        at: &Point,
        damping: f64,
        reach: f64,
    ) -> Result<Option<(Point, bool)>, StaticsError> {
        Ok(match self.attempt(at, damping, reach, Projection::Clamp)? {
            Attempt::Solved(next, is_cut) if self.leads_down(at, &next) => {
                Some((self.further(at, next), is_cut))
            }
            _ => None,
        })
    }

    /// As much further along a step as energy goes down. A clamped matrix is too stiff: many
    /// steps of it would go the same way, and each takes a factor.
    fn further(&self, start: &Point, mut next: Point) -> Point {
        let system = self.equations.system;
        let moves = next.x.iter().zip(&start.x).map(|(x, start)| x - start);
        let mut moves: Vec<Vector3<f64>> = moves.collect();
        loop {
            let x = next.x.iter().zip(&moves).map(|(x, d)| x + d).collect();
            moves.iter_mut().for_each(|d| *d *= 2.0);
            let mut carried = vec![0.0; system.n_carried()];
            system.predict_carried(&start.x, &moves, 1.0, &mut carried);
            let after = self.point(x, carried);
            let change = after.potential.energy - next.potential.energy;
            let is_lower = change < -after.potential.rounding;
            if !is_lower {
                return next;
            }
            next = after;
        }
    }

    /// The step with so much damping that the matrix is positive definite, if it leads down.
    fn shifted(&mut self, at: &Point, reach: f64) -> Result<Option<(Point, bool)>, StaticsError> {
        // Where less damping than last time is enough, none may be.
        self.is_indefinite = false;
        while self.shift < MOST_SHIFT {
            match self.attempt(at, self.shift, reach, Projection::None)? {
                Attempt::Indefinite => {
                    self.is_indefinite = true;
                    self.shift *= HARDER;
                }
                Attempt::Solved(next, is_cut) if self.leads_down(at, &next) => {
                    return Ok(Some((next, is_cut)));
                }
                _ => break,
            }
        }
        Ok(None)
    }

    /// H + μS. Whether it is positive definite.
    pub(super) fn factorize(
        &mut self,
        at: &Point,
        damping: f64,
        scales: &[f64],
        projection: Projection,
    ) -> Result<bool, StaticsError> {
        self.equations
            .linearize(&at.x, Some(&at.carried), projection);
        let of_block = |block: usize| damping * scales[block];
        let diagonal = self.equations.shifted_diagonal(of_block);
        let off_diagonal = self.equations.off_diagonal();
        match self.solver.set_matrix(&diagonal, off_diagonal) {
            Ok(()) => Ok(true),
            Err(SolveError::NotPositiveDefinite { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Where the step leads.
    fn attempt(
        &mut self,
        start: &Point,
        damping: f64,
        reach: f64,
        projection: Projection,
    ) -> Result<Attempt, StaticsError> {
        let system = self.equations.system;
        let scales = self.equations.scales().to_vec();
        let mut move_by = vec![Vector3::zeros(); start.x.len()];
        let mut at = start.clone();
        let mut most = f64::INFINITY;
        let mut is_cut = false;
        for iteration in 0..MOST_CORRECTIONS {
            if !self.factorize(&at, damping, &scales, projection)? {
                return Ok(if iteration == 0 {
                    Attempt::Indefinite
                } else {
                    Attempt::Diverged
                });
            }
            let d = &mut move_by[..scales.len()];
            let moved = at.x.iter().zip(&start.x).map(|(x, start)| x - start);
            let terms = at.forces.iter().zip(moved).zip(&scales);
            for (d, ((force, moved), scale)) in d.iter_mut().zip(terms) {
                *d = force - moved * (damping * scale);
            }
            self.solver.solve_in_place(numbers_mut(d), 1e-10)?;
            self.equations.project(d);
            let length = largest(d).1;
            // What is not a number is not shorter.
            let is_shorter = length <= most;
            if !is_shorter {
                return Ok(Attempt::Diverged);
            }
            if iteration == 0 && length > reach {
                is_cut = true;
                d.iter_mut().for_each(|d| *d *= reach / length);
            }
            if iteration > 0 {
                most = CONTRACTION * length;
            }
            let mut carried = vec![0.0; system.n_carried()];
            system.predict_carried(&at.x, &move_by, 1.0, &mut carried);
            let x = at.x.iter().zip(&move_by).map(|(x, d)| x + d);
            at = self.point(x.collect(), carried);
            let moves: Vec<_> = at.x.iter().zip(&start.x).map(|(x, x0)| x - x0).collect();
            let is_solved = length <= SOLVED * largest(&moves).1;
            if is_solved && iteration > 0 || self.leads_down(start, &at) {
                break;
            }
        }
        Ok(Attempt::Solved(at, is_cut))
    }

    /// Whether the energy decreases or, where rounding hides that, what is left of forces.
    fn leads_down(&self, at: &Point, next: &Point) -> bool {
        let change = next.potential.energy - at.potential.energy;
        let rounding = at.potential.rounding.max(next.potential.rounding);
        if change < -rounding {
            return true;
        }
        let left = |point: &Point| {
            let blocks = point.forces.iter().zip(self.equations.scales());
            blocks
                .map(|(force, scale)| force.norm_squared() / scale)
                .sum::<f64>()
        };
        change <= rounding && left(next) < 0.5 * left(at)
    }
}
