//! Equilibria as loads grow, past limit points.

use crate::descent::Descent;
use crate::equations::{Equations, in_node_order, numbers_mut};
use crate::{Options, StaticsError};
use nalgebra::Vector3;
use springs_assembly::compile;
use springs_scene::Scene;

/// Equilibria along a path.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoadPath {
    /// In order, limit points among them.
    pub points: Vec<PathPoint>,
    /// Where it ends.
    pub end: PathEnd,
}

/// Where a path ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEnd {
    /// At load factor 1.
    WholeLoad,
    /// At the most points that were asked for.
    MostPoints,
    /// Where it could not be followed further.
    Lost,
}

/// An equilibrium on a path.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PathPoint {
    /// What the loads of the scene are multiplied with.
    pub factor: f64,
    /// How far the loaded nodes have gone along their loads since factor 0, in m: the mean
    /// weighted with the loads, Σ F·u / Σ |F|.
    pub displacement: f64,
    /// Negative pivots of the stiffness; zero on a stable part of the path.
    pub negative_pivots: usize,
    /// Whether the load factor has a maximum or minimum here.
    pub is_limit: bool,
    /// Of every node, in m.
    pub positions: Vec<Vector3<f64>>,
}

/// First step, as a part of the whole load.
const FIRST_STEP: f64 = 0.02;
/// Nothing moves further in a step, in sizes of the scene.
const LONGEST_STEP: f64 = 0.05;
/// Nor does the load factor change by more.
const LARGEST_STEP: f64 = 0.1;
/// The direction turns by no more in a step: its cosine.
const LEAST_COSINE: f64 = 0.9;
/// Of the first step, below which a path counts as lost.
const SHORTEST_STEP: f64 = 1e-8;
/// Corrections of a step, and as many as are well spent.
const MOST_CORRECTIONS: usize = 12;
const GOOD_CORRECTIONS: f64 = 4.0;
/// At a limit point the load factor changes by no larger part of the path.
const LEVEL: f64 = 1e-7;
/// Until then.
const MOST_REFINEMENTS: usize = 60;

/// Follows the equilibrium of a scene from none of its loads to all of them, or over as many
/// points, limit points not counted: gravity is there all the time. Pseudo-arclength
/// continuation (Keller, Applications of Bifurcation Theory, 1977), the length being that of
/// displacements in sizes of the scene together with that of the load factor. It goes on over
/// limit points, which are located, and keeps to its branch where others cross it.
///
/// # Errors
///
/// If the scene has problems or no loads, or there is no equilibrium without them.
pub fn trace(
    scene: &Scene,
    most_points: usize,
    options: &Options,
) -> Result<LoadPath, StaticsError> {
    let system = compile(scene)?;
    let mut equations = Equations::new(&system);
    let loads = equations.loads().to_vec();
    let total: f64 = loads.iter().map(Vector3::norm).sum();
    if total == 0.0 {
        let are_later = scene
            .loads
            .iter()
            .any(|load| load.force != Vector3::zeros());
        return Err(if are_later {
            StaticsError::NoLoadsYet
        } else {
            StaticsError::NoLoads
        });
    }
    equations.factor = 0.0;
    let mut x = system.initial_positions().to_vec();
    let mut descent = Descent::new(equations, options)?;
    if !descent.is_balanced(&x)? {
        descent.run(&mut x)?;
    }
    let size = descent.size();
    let mut tracer = Tracer {
        start: x.clone(),
        total,
        loads,
        size,
        descent,
        last_negative: 0,
    };
    tracer.follow(x, most_points)
}

struct Tracer<'a> {
    descent: Descent<'a>,
    start: Vec<Vector3<f64>>,
    loads: Vec<Vector3<f64>>,
    /// Σ |F|, in N.
    total: f64,
    size: f64,
    /// At the last tangent.
    last_negative: usize,
}

/// A state on the path.
#[derive(Clone)]
struct State {
    x: Vec<Vector3<f64>>,
    factor: f64,
}

/// Its direction there, of length 1.
#[derive(Clone)]
struct Tangent {
    /// In sizes of the scene.
    x: Vec<Vector3<f64>>,
    factor: f64,
}

impl Tracer<'_> {
    fn follow(
        &mut self,
        x: Vec<Vector3<f64>>,
        most_points: usize,
    ) -> Result<LoadPath, StaticsError> {
        let mut at = State { x, factor: 0.0 };
        let mut tangent = self.tangent(&at, None)?;
        let mut points = vec![self.point(&at, false)];
        let first = FIRST_STEP / tangent.factor.abs().max(FIRST_STEP);
        let mut step = first.min(longest(&tangent));
        let shortest = SHORTEST_STEP * step;
        let mut n_points = 1;
        let mut end = PathEnd::MostPoints;
        while n_points < most_points {
            let Some((next, corrections)) = self.step(&at, &tangent, step)? else {
                step *= 0.5;
                if step < shortest {
                    end = PathEnd::Lost;
                    break;
                }
                continue;
            };
            let ahead = self.tangent(&next, Some(&tangent))?;
            let cosine =
                self.product(&tangent, &ahead.x, 0.0) * self.size + tangent.factor * ahead.factor;
            if cosine < LEAST_COSINE && step > shortest {
                // It may have come to another branch.
                step *= 0.5;
                continue;
            }
            if next.factor >= 1.0 {
                let Some(last) = self.at_whole_load(&at, &next)? else {
                    end = PathEnd::Lost;
                    break;
                };
                self.tangent(&last, Some(&tangent))?;
                points.push(self.point(&last, false));
                end = PathEnd::WholeLoad;
                break;
            }
            let negative = self.last_negative;
            if ahead.factor * tangent.factor < 0.0
                && let Some(limit) = self.limit(&at, &tangent, (step, ahead.factor))?
            {
                points.push(self.point(&limit, true));
            }
            self.last_negative = negative;
            points.push(self.point(&next, false));
            n_points += 1;
            (at, tangent) = (next, ahead);
            let wish = (GOOD_CORRECTIONS / corrections.max(1) as f64).sqrt();
            step *= wish.clamp(0.5, 1.5);
            step = step.min(longest(&tangent));
        }
        Ok(LoadPath { points, end })
    }

    fn point(&self, at: &State, is_limit: bool) -> PathPoint {
        let moved = at.x.iter().zip(&self.start).map(|(x, start)| x - start);
        let work: f64 = self.loads.iter().zip(moved).map(|(f, u)| f.dot(&u)).sum();
        PathPoint {
            factor: at.factor,
            displacement: work / self.total,
            negative_pivots: self.last_negative,
            is_limit,
            positions: in_node_order(self.descent.equations.system, &at.x),
        }
    }

    /// The product of two directions.
    fn product(&self, tangent: &Tangent, x: &[Vector3<f64>], factor: f64) -> f64 {
        let along = tangent.x.iter().zip(x).map(|(t, x)| t.dot(x));
        along.sum::<f64>() / self.size + tangent.factor * factor
    }

    /// On from `before`, or to larger loads.
    fn tangent(&mut self, at: &State, before: Option<&Tangent>) -> Result<Tangent, StaticsError> {
        self.last_negative = self.descent.inertia(&at.x)?.negative;
        let mut x = self.loads.clone();
        self.descent.factor().solve_in_place(numbers_mut(&mut x))?;
        x.iter_mut().for_each(|x| *x /= self.size);
        let squares = x.iter().map(Vector3::norm_squared);
        let mut scale = 1.0 / (squares.sum::<f64>() + 1.0).sqrt();
        if let Some(before) = before {
            let along = before.x.iter().zip(&x).map(|(a, b)| a.dot(b));
            if along.sum::<f64>() + before.factor < 0.0 {
                scale = -scale;
            }
        }
        x.iter_mut().for_each(|x| *x *= scale);
        Ok(Tangent { x, factor: scale })
    }

    /// A step along the tangent, and the corrections that it took.
    fn step(
        &mut self,
        at: &State,
        tangent: &Tangent,
        length: f64,
    ) -> Result<Option<(State, usize)>, StaticsError> {
        let mut guess = at.clone();
        guess.factor += length * tangent.factor;
        for (x, t) in guess.x.iter_mut().zip(&tangent.x) {
            *x += t * (length * self.size);
        }
        self.correct(guess, tangent)
    }

    /// From a guess to the path, across the tangent.
    fn correct(
        &mut self,
        guess: State,
        tangent: &Tangent,
    ) -> Result<Option<(State, usize)>, StaticsError> {
        let mut at = guess.clone();
        for correction in 0..MOST_CORRECTIONS {
            self.descent.equations.factor = at.factor;
            let mut by_forces = self.descent.equations.forces(&at.x);
            if by_forces.iter().flatten().any(|force| !force.is_finite()) {
                return Ok(None);
            }
            self.descent.hear()?;
            self.descent.linearize(&at.x);
            if correction > 0 && self.descent.equations.is_balanced(&at.x, &by_forces) {
                return Ok(Some((at, correction)));
            }
            self.descent.factorize_stiffness()?;
            let mut by_loads = self.loads.clone();
            let factor = self.descent.factor();
            factor.solve_in_place(numbers_mut(&mut by_forces))?;
            factor.solve_in_place(numbers_mut(&mut by_loads))?;
            let off = at.x.iter().zip(&guess.x).map(|(x, guess)| x - guess);
            let off: Vec<_> = off.take(by_forces.len()).collect();
            let left = self.product(tangent, &off, at.factor - guess.factor)
                + self.product(tangent, &by_forces, 0.0);
            let change = -left / self.product(tangent, &by_loads, 1.0);
            at.factor += change;
            for (x, (a, b)) in at.x.iter_mut().zip(by_forces.iter().zip(&by_loads)) {
                *x += a + b * change;
            }
        }
        Ok(None)
    }

    /// The state of factor 1 between two.
    fn at_whole_load(&mut self, at: &State, next: &State) -> Result<Option<State>, StaticsError> {
        let part = (1.0 - at.factor) / (next.factor - at.factor);
        let between = at.x.iter().zip(&next.x).map(|(a, b)| a + (b - a) * part);
        let guess = State {
            x: between.collect(),
            factor: 1.0,
        };
        let only_loads = Tangent {
            x: vec![Vector3::zeros(); self.loads.len()],
            factor: 1.0,
        };
        let corrected = self.correct(guess, &only_loads)?;
        Ok(corrected.map(|(state, _)| state))
    }

    /// Where the load factor is level, within a step whose length and change of the load
    /// factor at its end are given.
    fn limit(
        &mut self,
        at: &State,
        tangent: &Tangent,
        (length, rate): (f64, f64),
    ) -> Result<Option<State>, StaticsError> {
        // Regula falsi that halves the weight of an end that stays (Dowell and Jarratt, BIT
        // 11, 1971).
        let (mut low, mut high) = ((0.0, tangent.factor), (length, rate));
        let mut last_side = 0.0;
        for _ in 0..MOST_REFINEMENTS {
            let middle = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let Some((state, _)) = self.step(at, tangent, middle)? else {
                return Ok(None);
            };
            let rate = self.tangent(&state, Some(tangent))?.factor;
            if rate.abs() < LEVEL {
                return Ok(Some(state));
            }
            let side = rate.signum() * low.1.signum();
            if side > 0.0 {
                low = (middle, rate);
                if last_side == side {
                    high.1 *= 0.5;
                }
            } else {
                high = (middle, rate);
                if last_side == side {
                    low.1 *= 0.5;
                }
            }
            last_side = side;
        }
        Ok(None)
    }
}

/// The longest step in a direction.
fn longest(tangent: &Tangent) -> f64 {
    let (_, moved) = crate::equations::largest(&tangent.x);
    let by_factor = LARGEST_STEP / tangent.factor.abs();
    by_factor.min(LONGEST_STEP / moved)
}
