//! Products with the Hessians of linear springs along runs that are made many times.

use super::{LinearRuns, divide, sums_of_multiples};
use crate::Projection;
use crate::lanes::{Ends, Lanes, add_to_ends, differences, dots, lanes_at};
use crate::run::{LANES, Run};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};

/// Numbers of eight slots: three of m, and one of a, each.
const NUMBERS: usize = 4 * LANES;

impl LinearRuns {
    /// Appends what `weight` times the Hessian is in each slot of all runs: a·1 + m mᵀ, of which
    /// numbers have m and a. Says whether it is: not where a spring is too short or too long for
    /// its square, or less stiff along itself than across.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than blocks of the runs.
    pub(crate) fn prepare(
        &self,
        runs: &[Run],
        x: &[Vector3<f64>],
        (projection, weight): (Projection, f64),
        numbers: &mut Vec<f64>,
    ) -> bool {
        Arch::new().dispatch(Prepare {
            of_springs: self,
            runs,
            x: bytemuck::cast_slice(x),
            projection,
            weight,
            numbers,
        })
    }

    /// Adds the products of `y` and what was [prepared](Self::prepare) for all runs on the first
    /// ends of some, and their negatives on the second ends. The products are those of the blocks
    /// from `first` on.
    ///
    /// # Panics
    ///
    /// If a slice does not have all blocks or slots of the runs.
    pub(crate) fn add_prepared(
        &self,
        runs: &[Run],
        numbers: &[f64],
        y: &[Vector3<f64>],
        (first, products): (usize, &mut [Vector3<f64>]),
    ) {
        let Some(run) = runs.first() else {
            return;
        };
        Arch::new().dispatch(AddPrepared {
            of_springs: self,
            runs,
            numbers: &numbers[4 * run.first_slot..],
            y: bytemuck::cast_slice(y),
            first,
            products: bytemuck::cast_slice_mut(products),
        });
    }
}

struct Prepare<'a> {
    of_springs: &'a LinearRuns,
    runs: &'a [Run],
    x: &'a [f64],
    projection: Projection,
    weight: f64,
    numbers: &'a mut Vec<f64>,
}

impl WithSimd for Prepare<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let mut is_given = true;
        self.of_springs.each_lanes(self.runs, |at, law, _| {
            let mut m = differences(at.map(|at| lanes_at(self.x, at)));
            let squares = dots(&m, &m);
            let mut per_lengths = [0.0; LANES];
            is_given &= divide(simd, &squares, law, &mut per_lengths, None);
            let mut across = per_lengths.map(|per_length| self.projection.apply(per_length));
            let mut scales = [0.0; LANES];
            for c in 0..LANES {
                scales[c] = self.weight * (law.0[c] - across[c]) / squares[c];
                across[c] *= self.weight;
            }
            is_given &= scales.iter().all(|scale| *scale >= 0.0);
            for c in 0..LANES {
                let scale = scales[c].sqrt();
                for entry in &mut m[3 * c..3 * c + 3] {
                    *entry *= scale;
                }
            }
            self.numbers.extend_from_slice(&m);
            self.numbers.extend_from_slice(&across);
        });
        is_given
    }
}

struct AddPrepared<'a> {
    of_springs: &'a LinearRuns,
    runs: &'a [Run],
    /// From the first slot of the runs on.
    numbers: &'a [f64],
    y: &'a [f64],
    /// Block of the first product.
    first: usize,
    products: &'a mut [f64],
}

impl WithSimd for AddPrepared<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (numbers, _) = self.numbers.as_chunks::<NUMBERS>();
        let mut numbers = numbers.iter();
        self.of_springs.each_lanes(self.runs, |at, _, _| {
            let numbers = numbers.next().expect("prepared for all slots");
            let (m, across) = numbers.split_at(3 * LANES);
            let m: &Ends = m.try_into().expect("three a slot");
            let across: &Lanes = across.try_into().expect("one a slot");
            let [start, end] = at.map(|at| lanes_at(self.y, at));
            // The product is that of the block and y₀ − y₁.
            let dy = differences([end, start]);
            let products = sums_of_multiples((across, &dy), (&dots(m, &dy), m));
            let sums = at.map(|block| block - self.first);
            add_to_ends(simd, self.products, sums, &products);
        });
    }
}
