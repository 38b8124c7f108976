//! Energies, line by line.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Index, IndexMut, Mul};

/// One number for each emitter of a system, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lines([f64; Lines::MOST]);

impl Lines {
    /// Emitters of a system at most.
    pub const MOST: usize = 16;
    /// The line of linear springs.
    pub const ELASTIC: usize = 0;
    /// The line of gravity.
    pub const GRAVITY: usize = 1;
    /// The line of dashpots.
    pub const DASHPOTS: usize = 2;
    /// The line of loads, whose work is a flow of its own.
    pub const LOADS: usize = 3;
    /// The line of drag.
    pub const DRAG: usize = 4;
    /// The line of springs with laws beside the linear one.
    pub const LAWS: usize = 5;
    /// The line of springs that can break, whatever their laws.
    pub const BREAKABLE: usize = 6;
    /// The first line of other emitters.
    pub const OTHERS: usize = 7;

    /// All lines together.
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }

    /// The lines one by one.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.0.iter_mut()
    }
}

impl Index<usize> for Lines {
    type Output = f64;

    fn index(&self, line: usize) -> &f64 {
        &self.0[line]
    }
}

impl IndexMut<usize> for Lines {
    fn index_mut(&mut self, line: usize) -> &mut f64 {
        &mut self.0[line]
    }
}

impl Add for Lines {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl AddAssign for Lines {
    fn add_assign(&mut self, other: Self) {
        for (line, other) in self.0.iter_mut().zip(other.0) {
            *line += other;
        }
    }
}

impl Mul<f64> for Lines {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|line| line * factor))
    }
}

/// Mechanical energy, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// ½ Σ m v² of the free nodes.
    pub kinetic: f64,
    /// Potential energy of each emitter: ½ Σ K(l − l₀)² of all springs, −Σ m g·x of
    /// the free nodes, …
    pub potential: Lines,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential.sum()
    }

    /// Of the springs of a scene.
    pub fn elastic(&self) -> f64 {
        let lines = [Lines::ELASTIC, Lines::LAWS, Lines::BREAKABLE];
        lines.map(|line| self.potential[line]).iter().sum()
    }

    /// Of gravity.
    pub fn gravity(&self) -> f64 {
        self.potential[Lines::GRAVITY]
    }
}

impl Add for Energy {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            kinetic: self.kinetic + other.kinetic,
            potential: self.potential + other.potential,
        }
    }
}

impl Sum for Energy {
    fn sum<I: Iterator<Item = Self>>(energies: I) -> Self {
        energies.fold(Self::default(), Add::add)
    }
}
