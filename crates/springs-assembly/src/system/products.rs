//! Products with the system matrix, term by term.

use crate::{Evaluation, System, Weights};
use nalgebra::Vector3;

/// What products with one matrix have in common.
#[derive(Clone, Debug, Default)]
pub struct PreparedProducts {
    numbers: Vec<f64>,
    /// Where those of each emitter end.
    ends: Vec<usize>,
}

impl System {
    /// The product of the system matrix at `at` and `y` on the free blocks, term
    /// by term instead of through the assembled matrix: what is lost there in
    /// sums of stiffnesses far above the masses is kept here.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn product(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], product: &mut [Vector3<f64>]) {
        self.begin_product(at, y, product);
        self.each_with_carried(at, |_, emitter, at| emitter.add_products(at, y, product));
        self.guides.project(product);
    }

    /// Prepares for [products](Self::prepared_product) at `at` with several `y`.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn prepare_products(&self, at: &Evaluation<'_>, prepared: &mut PreparedProducts) {
        let PreparedProducts { numbers, ends } = prepared;
        numbers.clear();
        ends.clear();
        self.each_with_carried(at, |_, emitter, at| {
            emitter.prepare_products(at, numbers);
            ends.push(numbers.len());
        });
    }

    /// [`Self::product`], but for rounding, where it was prepared for the same `at`: in less than
    /// half of the time for linear springs along runs.
    ///
    /// # Panics
    ///
    /// If a slice is too short, or nothing was prepared for this system.
    pub fn prepared_product(
        &self,
        at: &Evaluation<'_>,
        prepared: &PreparedProducts,
        y: &[Vector3<f64>],
        product: &mut [Vector3<f64>],
    ) {
        self.begin_product(at, y, product);
        let mut begin = 0;
        self.each_with_carried(at, |line, emitter, at| {
            let end = prepared.ends[line];
            emitter.add_prepared_products(at, &prepared.numbers[begin..end], y, product);
            begin = end;
        });
        self.guides.project(product);
    }

    /// Adds the product of `damping`·D and `y` on the free blocks; next to nothing to
    /// compute where nothing damps.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn add_damping_product(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        damping: f64,
        y: &[Vector3<f64>],
        product: &mut [Vector3<f64>],
    ) {
        let at = Evaluation::new(x, v, Weights::of_damping(damping));
        for (_, emitter) in self.damped() {
            emitter.add_products(&at, y, product);
        }
        self.guides.project(product);
    }

    /// The part of the masses.
    fn begin_product(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], product: &mut [Vector3<f64>]) {
        for (p, (mass, y)) in product.iter_mut().zip(self.masses.iter().zip(y)) {
            *p = y * (at.weights.mass * mass);
        }
    }
}
