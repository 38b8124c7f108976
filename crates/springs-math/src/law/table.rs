//! A law through points.

use super::powers::strain;
use crate::spring::{LengthLaw, Spring};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use nalgebra::ComplexField;

/// A point of a [`Table`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// ε.
    pub strain: f64,
    /// T, in N.
    pub tension: f64,
}

/// What keeps a [`Table`] from being a law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TableError {
    /// A curve needs two points.
    TooFewPoints {
        /// Number of points.
        n_points: usize,
    },
    /// A strain or tension, or the slope to the next point, is not finite.
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// Strains must rise from point to point.
    NotAscending {
        /// Index of the point that is not beyond the one before it.
        point: usize,
    },
    /// The strain refers to a length that is not positive and finite.
    RestLength {
        /// The length, in m.
        rest_length: f64,
    },
    /// T < 0 at every length, however large: the spring has no rest length.
    NeverAtRest,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewPoints { n_points } => {
                write!(f, "a table needs two points, this one has {n_points}")
            }
            Self::NotFinite { point } => write!(
                f,
                "the strain or tension of point {point} of a table, or the slope to the next \
                 point, is not a finite number"
            ),
            Self::NotAscending { point } => write!(
                f,
                "the strain of point {point} of a table is not above that of the point before it"
            ),
            Self::RestLength { rest_length } => write!(
                f,
                "strain needs a positive rest length, not {rest_length} m"
            ),
            Self::NeverAtRest => {
                write!(f, "a spring that pushes at every length has no rest length")
            }
        }
    }
}

impl core::error::Error for TableError {}

/// Monotone cubics through points (ε, T): T is C¹, and it rises, falls or stays where
/// the points do.
///
/// Slopes at the points are those of the parabola through a point and its neighbours,
/// at the ends those of the line to the neighbour, and zero at a point that is higher
/// or lower than both neighbours, or as high as one; then they are reduced until
/// the pair at the ends of each piece, over the slope Δ of the line between them, lies
/// within the circle α² + β² ≤ 9 (Fritsch & Carlson, SIAM J. Numer. Anal. 17, 1980,
/// p. 238), each by the stronger reduction of its two pieces so that the order of the
/// points does not matter. Beyond the ends T goes on along lines with the slopes there.
///
/// V is the integral of the cubics, exact up to rounding, and zero at the rest length.
/// Copies share the curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    curve: Arc<Curve>,
    rest_length: f64,
}

impl Table {
    /// The law through `points` in ascending order, at strains ε = l/`rest_length` − 1
    /// with the length in m.
    ///
    /// The [rest length](LengthLaw::rest_length) of the law is where T is zero: where
    /// it is several times, there where ε is nearest to 0; 0 m if T > 0 at all lengths.
    pub fn new(points: &[Point], rest_length: f64) -> Result<Self, TableError> {
        let curve = Arc::new(Curve::through(points)?);
        Self { curve, rest_length }.with_rest_length(rest_length)
    }

    /// The same curve, at strains that refer to another length, in m.
    pub fn with_rest_length(&self, rest_length: f64) -> Result<Self, TableError> {
        if !(rest_length > 0.0 && rest_length.is_finite()) {
            return Err(TableError::RestLength { rest_length });
        }
        Ok(Self {
            curve: Arc::clone(&self.curve),
            rest_length,
        })
    }
}

impl LengthLaw for Table {
    fn energy(&self, length: f64) -> f64 {
        let (piece, x) = self.curve.at(strain(length, self.rest_length));
        self.rest_length * (piece.energy + piece.integral(x))
    }

    fn tension(&self, length: f64) -> f64 {
        let (piece, x) = self.curve.at(strain(length, self.rest_length));
        piece.tension(x)
    }

    fn stiffness(&self, length: f64) -> f64 {
        let (piece, x) = self.curve.at(strain(length, self.rest_length));
        let slope = piece.slope(x);
        // Of a curve that never falls a slope below zero is rounding.
        let slope = if self.curve.never_falls {
            slope.max(0.0)
        } else {
            slope
        };
        slope / self.rest_length
    }

    /// The largest k; infinite if T(0) > 0.
    fn largest_stiffness(&self) -> f64 {
        self.curve.steepest / self.rest_length
    }

    /// The length at which T is zero, in m, see [`Table::new`].
    fn rest_length(&self) -> f64 {
        self.rest_length * (1.0 + self.curve.rest_strain)
    }

    fn set_spring(&mut self, spring: Spring) {
        self.rest_length = spring.rest_length;
    }

    fn is_convex(&self) -> bool {
        self.curve.never_falls
    }
}

/// T(ε) in N, piece by piece.
#[derive(Clone, Debug, PartialEq)]
struct Curve {
    /// The strains of the points.
    strains: Vec<f64>,
    /// Below the first point, between one and the next, beyond the last.
    pieces: Vec<Piece>,
    /// ε with T = 0; −1 if there is none and T > 0.
    rest_strain: f64,
    /// The largest slope dT/dε, in N, not negative; infinite if T > 0 at ε = −1.
    steepest: f64,
    never_falls: bool,
}

/// T = c₀ + c₁x + c₂x² + c₃x³, in N, with x = ε − `start`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start: f64,
    coefficients: [f64; 4],
    /// ∫ T dε from rest to `start`, in N.
    energy: f64,
}

impl Piece {
    fn line(start: f64, tension: f64, slope: f64) -> Self {
        Self {
            start,
            coefficients: [tension, slope, 0.0, 0.0],
            energy: 0.0,
        }
    }

    /// Hermite's cubic from `a` to `b`, with the slopes there in N.
    fn between(a: Point, b: Point, [slope_a, slope_b]: [f64; 2]) -> Self {
        let step = b.strain - a.strain;
        let mean = (b.tension - a.tension) / step;
        let second = (3.0 * mean - 2.0 * slope_a - slope_b) / step;
        let third = (slope_a + slope_b - 2.0 * mean) / step / step;
        Self {
            start: a.strain,
            coefficients: [a.tension, slope_a, second, third],
            energy: 0.0,
        }
    }

    fn integral(&self, x: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        x * (c0 + x * (c1 / 2.0 + x * (c2 / 3.0 + x * (c3 / 4.0))))
    }

    fn tension(&self, x: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        c0 + x * (c1 + x * (c2 + x * c3))
    }

    fn slope(&self, x: f64) -> f64 {
        let [_, c1, c2, c3] = self.coefficients;
        c1 + x * (2.0 * c2 + x * (3.0 * c3))
    }

    /// The largest slope in 0 ≤ x ≤ `step`.
    fn steepest(&self, step: f64) -> f64 {
        let [_, _, c2, c3] = self.coefficients;
        let ends = self.slope(0.0).max(self.slope(step));
        let top = -c2 / (3.0 * c3);
        if c3 < 0.0 && top > 0.0 && top < step {
            ends.max(self.slope(top))
        } else {
            ends
        }
    }

    /// Where T is zero in `from` ≤ ε ≤ `to`, if it is: all of it, or a point.
    fn zero(&self, from: f64, to: f64) -> Option<(f64, f64)> {
        if self.coefficients == [0.0; 4] {
            return Some((from, to));
        }
        let tension = |strain: f64| self.tension(strain - self.start);
        if to == f64::INFINITY {
            let [c0, c1, ..] = self.coefficients;
            let zero = self.start - c0 / c1;
            return (zero >= from && zero.is_finite()).then_some((zero, zero));
        }
        for end in [from, to] {
            if tension(end) == 0.0 {
                return Some((end, end));
            }
        }
        let is_positive = tension(to) > 0.0;
        if (tension(from) > 0.0) == is_positive {
            return None;
        }
        let (mut low, mut high) = (from, to);
        loop {
            let middle = 0.5 * low + 0.5 * high;
            if middle <= low || middle >= high {
                return Some((low, low));
            }
            if (tension(middle) > 0.0) == is_positive {
                high = middle;
            } else {
                low = middle;
            }
        }
    }
}

impl Curve {
    fn through(points: &[Point]) -> Result<Self, TableError> {
        let n_points = points.len();
        let ([first, ..], [.., last]) = (points, points) else {
            return Err(TableError::TooFewPoints { n_points });
        };
        if n_points < 2 {
            return Err(TableError::TooFewPoints { n_points });
        }
        let not_finite = |point: &Point| !(point.strain.is_finite() && point.tension.is_finite());
        if let Some(point) = points.iter().position(not_finite) {
            return Err(TableError::NotFinite { point });
        }
        for (point, pair) in points.windows(2).enumerate() {
            let step = pair[1].strain - pair[0].strain;
            if step <= 0.0 {
                return Err(TableError::NotAscending { point: point + 1 });
            }
            if !((pair[1].tension - pair[0].tension) / step).is_finite() {
                return Err(TableError::NotFinite { point });
            }
        }

        let slopes = slopes(points);
        let mut pieces = Vec::with_capacity(n_points + 1);
        pieces.push(Piece::line(first.strain, first.tension, slopes[0]));
        for (pair, slopes) in points.windows(2).zip(slopes.windows(2)) {
            pieces.push(Piece::between(pair[0], pair[1], [slopes[0], slopes[1]]));
        }
        let last_slope = slopes[n_points - 1];
        pieces.push(Piece::line(last.strain, last.tension, last_slope));
        let not_finite = |piece: &Piece| piece.coefficients.iter().any(|c| !c.is_finite());
        if let Some(piece) = pieces.iter().position(not_finite) {
            let point = piece.saturating_sub(1);
            return Err(TableError::NotFinite { point });
        }
        for index in 1..=n_points {
            let before = &pieces[index - 1];
            let step = pieces[index].start - before.start;
            pieces[index].energy = before.energy + before.integral(step);
        }

        let mut curve = Self {
            strains: points.iter().map(|point| point.strain).collect(),
            pieces,
            rest_strain: 0.0,
            steepest: 0.0,
            never_falls: points
                .windows(2)
                .all(|pair| pair[1].tension >= pair[0].tension),
        };
        curve.rest_strain = curve.find_rest()?;
        let (piece, x) = curve.at(curve.rest_strain);
        let energy = piece.energy + piece.integral(x);
        for piece in &mut curve.pieces {
            piece.energy -= energy;
        }
        curve.steepest = curve.find_steepest();
        Ok(curve)
    }

    /// The piece at a strain, and x in it.
    #[inline]
    fn at(&self, strain: f64) -> (&Piece, f64) {
        let index = self.strains.partition_point(|&start| start <= strain);
        let piece = &self.pieces[index];
        (piece, strain - piece.start)
    }

    /// From where to where a piece goes.
    fn ends(&self, piece: usize) -> (f64, f64) {
        let from = piece.checked_sub(1).map(|before| self.strains[before]);
        let to = self.strains.get(piece).copied();
        (from.unwrap_or(-1.0), to.unwrap_or(f64::INFINITY))
    }

    /// The strain nearest to 0, from −1 on, at which T is zero; −1 if T > 0 everywhere.
    fn find_rest(&self) -> Result<f64, TableError> {
        let mut nearest: Option<f64> = None;
        for (index, piece) in self.pieces.iter().enumerate() {
            let (from, to) = self.ends(index);
            let from = from.max(-1.0);
            if to < from {
                continue;
            }
            if let Some((low, high)) = piece.zero(from, to) {
                let zero = 0f64.clamp(low, high);
                nearest = match nearest {
                    Some(other) if other.abs() <= zero.abs() => nearest,
                    _ => Some(zero),
                };
            }
        }
        let (piece, x) = self.at(-1.0);
        match nearest {
            Some(zero) => Ok(zero),
            None if piece.tension(x) > 0.0 => Ok(-1.0),
            None => Err(TableError::NeverAtRest),
        }
    }

    /// With T(0) ≤ 0 at the length 0, T/l is a mean of k from 0 to l, or less, and no
    /// larger than the largest k.
    fn find_steepest(&self) -> f64 {
        let (piece, x) = self.at(-1.0);
        if piece.tension(x) > 0.0 {
            return f64::INFINITY;
        }
        let steepest = (0..self.pieces.len()).map(|index| {
            let (from, to) = self.ends(index);
            let piece = &self.pieces[index];
            // Lines have one slope.
            if index == 0 || to == f64::INFINITY {
                piece.slope(0.0)
            } else {
                piece.steepest(to - from)
            }
        });
        steepest.fold(0.0, f64::max)
    }
}

/// dT/dε at each of two or more points, in N.
fn slopes(points: &[Point]) -> Vec<f64> {
    let step = |piece: usize| points[piece + 1].strain - points[piece].strain;
    let mean = |piece: usize| (points[piece + 1].tension - points[piece].tension) / step(piece);
    let n_pieces = points.len() - 1;
    let parabola = |point: usize| {
        if point == 0 || point == n_pieces {
            return mean(point.min(n_pieces - 1));
        }
        let (before, after) = (mean(point - 1), mean(point));
        let rise_or_fall = before > 0.0 && after > 0.0 || before < 0.0 && after < 0.0;
        if !rise_or_fall {
            return 0.0;
        }
        let weight = step(point) / (step(point - 1) + step(point));
        weight * before + (1.0 - weight) * after
    };
    // By how much a piece reduces the slopes at its ends; those of a flat one are zero.
    let reduction = |piece: usize| {
        if mean(piece) == 0.0 {
            return 1.0;
        }
        let [a, b] = [piece, piece + 1].map(|point| parabola(point) / mean(piece));
        let radius = ComplexField::sqrt(a * a + b * b);
        if radius > 3.0 { 3.0 / radius } else { 1.0 }
    };
    let reduced = |point: usize| {
        let before = point.checked_sub(1).map_or(1.0, reduction);
        let after = if point < n_pieces {
            reduction(point)
        } else {
            1.0
        };
        parabola(point) * f64::min(before, after)
    };
    (0..points.len()).map(reduced).collect()
}
