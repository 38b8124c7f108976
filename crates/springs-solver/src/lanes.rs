//! Several numbers that the same is done to.

use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

/// W numbers, of independent blocks; each operation is that of every one of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes<const W: usize>(pub(crate) [f64; W]);

impl<const W: usize> Lanes<W> {
    #[inline(always)]
    pub(crate) const fn splat(x: f64) -> Self {
        Self([x; W])
    }

    #[inline(always)]
    pub(crate) fn reciprocal(self) -> Self {
        let mut result = self.0;
        for x in &mut result {
            *x = 1.0 / *x;
        }
        Self(result)
    }

    /// Of each array the same numbers, side by side.
    #[inline(always)]
    pub(crate) fn of<const N: usize>(arrays: &[[f64; N]; W]) -> [Self; N] {
        std::array::from_fn(|k| Self(std::array::from_fn(|lane| arrays[lane][k])))
    }

    /// One of the arrays that lie side by side.
    #[inline(always)]
    pub(crate) fn lane<const N: usize>(numbers: &[Self; N], lane: usize) -> [f64; N] {
        std::array::from_fn(|k| numbers[k].0[lane])
    }
}

impl<const W: usize> Add for Lanes<W> {
    type Output = Self;

    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for lane in 0..W {
            self.0[lane] += other.0[lane];
        }
        self
    }
}

impl<const W: usize> Sub for Lanes<W> {
    type Output = Self;

    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for lane in 0..W {
            self.0[lane] -= other.0[lane];
        }
        self
    }
}

impl<const W: usize> Mul for Lanes<W> {
    type Output = Self;

    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for lane in 0..W {
            self.0[lane] *= other.0[lane];
        }
        self
    }
}

impl<const W: usize> AddAssign for Lanes<W> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const W: usize> SubAssign for Lanes<W> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
