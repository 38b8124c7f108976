//! A preconditioner whose conjugate gradients take nearly the same number of
//! iterations for any size.

use super::coarse::{CoarseSpace, MakeCoarse, Pattern};
use super::motions::Place;
use super::rows::{Rows, Window};
use super::stretches::parts;
use crate::SolveError;
use crate::block::{Rounding, add_multiple};
use springs_threads::share_out;
use std::ops::Range;

/// A sweep of Gauss and Seidel, a correction by motions of aggregates of blocks, and the
/// sweep backwards.
///
/// Aggregates are neighbourhoods in the graph (as in Vaněk, Mandel and Brezina,
/// Computing 56, 1996, but not smoothed). The coarse matrix is one of blocks again; it
/// is factorized, or, where that would be much work, has a coarser one itself.
pub(crate) struct Multilevel<const D: usize, const P: usize, const Q: usize> {
    inverses: Vec<[f64; P]>,
    rounding: Rounding,
    coarse: Box<dyn CoarseSpace<D, P, Q>>,
    /// After the sweep down and the correction what the sweep up starts from, then its change.
    x: Vec<[f64; D]>,
    rest: Vec<[f64; D]>,
}

/// Takes a residual r to r − length·product.
#[derive(Clone, Copy)]
pub(crate) struct Step<'a, const D: usize> {
    pub(crate) product: &'a [[f64; D]],
    pub(crate) length: f64,
}

impl<const D: usize, const P: usize, const Q: usize> Multilevel<D, P, Q> {
    pub(crate) fn new(
        pattern: &Pattern<'_>,
        make_coarse: MakeCoarse<D, P, Q>,
    ) -> Result<Self, SolveError> {
        let n_blocks = pattern.n_blocks;
        Ok(Self {
            inverses: vec![[0.0; P]; n_blocks],
            rounding: Rounding::of(pattern.options.subspace),
            coarse: make_coarse(pattern)?,
            x: vec![[0.0; D]; n_blocks],
            rest: vec![[0.0; D]; n_blocks],
        })
    }

    /// Memory, in bytes; `None` if it cannot be counted.
    pub(crate) fn memory(&self) -> Option<u64> {
        let own = (8 * P + 16 * D) * self.inverses.len();
        Some(own as u64 + self.coarse.memory()?)
    }

    /// Takes the places of the blocks.
    pub(crate) fn set_places(&mut self, places: &[Place]) {
        self.coarse.set_places(places);
    }

    /// Prepares for a matrix.
    ///
    /// # Errors
    ///
    /// If that of a block or the coarse matrix, and so the matrix, is not
    /// positive definite.
    pub(crate) fn set(&mut self, matrix: &Rows<P, Q>) -> Result<(), SolveError> {
        matrix.invert_diagonal::<D>(&mut self.inverses, self.rounding)?;
        self.coarse.set(matrix)
    }

    /// See [`CoarseSpace::correct`].
    pub(crate) fn correct(&mut self, r: &[[f64; D]], z: &mut [[f64; D]]) {
        self.coarse.correct(r, z);
    }

    /// `z` from the residual `r`, which takes a step before: an approximation of the
    /// inverse, symmetric and positive definite. Gives rᵀz.
    pub(crate) fn apply(
        &mut self,
        matrix: &Rows<P, Q>,
        (r, step): (&mut [[f64; D]], Option<Step<'_, D>>),
        z: &mut [[f64; D]],
    ) -> f64 {
        self.sweep_down(matrix, r, step);
        self.coarse.solve(&self.rest);
        self.sweep_up(matrix, r, z)
    }

    fn sweep_down(&mut self, matrix: &Rows<P, Q>, r: &mut [[f64; D]], step: Option<Step<'_, D>>) {
        let (inverses, stretches) = (&self.inverses, matrix.stretches());
        let down = |(rows, r, window): (Range<usize>, &mut [[f64; D]], Window<'_, D>)| {
            if let Some(Step { product, length }) = step {
                add_multiple(r, &product[rows.clone()], -length);
            }
            matrix.sweep_down(rows, inverses, r, window);
        };
        let even = stretches
            .even()
            .zip(parts(r, stretches.even()))
            .zip(parts(&mut self.x, stretches.even()))
            .zip(parts(&mut self.rest, stretches.even()))
            .map(|(((rows, r), x), rest)| {
                let at = rows.start;
                (rows, r, Window { at, x, rest })
            });
        share_out(even, down);
        let odd = stretches
            .odd()
            .zip(parts(r, stretches.odd().map(|(odd, _)| odd)))
            .zip(parts(&mut self.x, stretches.windows()))
            .zip(parts(&mut self.rest, stretches.windows()))
            .map(|((((rows, window), r), x), rest)| {
                let at = window.start;
                (rows, r, Window { at, x, rest })
            });
        share_out(odd, down);
    }

    /// Adds what the coarse space has to add, and sweeps backwards.
    fn sweep_up(&mut self, matrix: &Rows<P, Q>, r: &[[f64; D]], z: &mut [[f64; D]]) -> f64 {
        let (inverses, stretches) = (&self.inverses, matrix.stretches());
        let coarse = &self.coarse;
        let odd = stretches
            .odd()
            .zip(parts(z, stretches.odd().map(|(odd, _)| odd)))
            .zip(parts(&mut self.x, stretches.windows()))
            .zip(parts(&mut self.rest, stretches.windows()));

        let of_odd = share_out(odd, |((((rows, window), z), x), rest)| {
            let at = window.start;
            coarse.prolong(at, x);
            rest.copy_from_slice(&r[window]);
            let r = &r[rows.clone()];
            matrix.sweep_up(rows, inverses, (r, z), Window { at, x, rest })
        });
        let even = stretches
            .even()
            .zip(parts(z, stretches.even()))
            .zip(parts(&mut self.x, stretches.even()))
            .zip(parts(&mut self.rest, stretches.even()));

        let of_even = share_out(even, |(((rows, z), x), rest)| {
            let (at, r) = (rows.start, &r[rows.clone()]);
            matrix.sweep_up(rows, inverses, (r, z), Window { at, x, rest })
        });
        of_odd.iter().chain(&of_even).sum()
    }

    /// Vectors w with A z = r + L w for the `z` that was just made of r.
    ///
    /// The last sweep has solved (D + Lᵀ) z = r − L x, so w = z − x.
    pub(crate) fn change_of_last_sweep(&self) -> &[[f64; D]] {
        &self.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{add, times};
    use crate::iterative::aggregates::{Aggregates, Reach};
    use crate::iterative::{ConjugateGradients, Ending, Until, translations};
    use crate::{Interrupt, Options};

    fn grid(side: u32) -> Vec<[u32; 2]> {
        let node = move |i: u32, j: u32| i * side + j;
        let across =
            (0..side).flat_map(move |i| (1..side).map(move |j| [node(i, j - 1), node(i, j)]));
        let along =
            (1..side).flat_map(move |i| (0..side).map(move |j| [node(i - 1, j), node(i, j)]));
        across.chain(along).collect()
    }

    /// Unit springs in all directions and a mass.
    fn membrane(side: u32, mass: f64) -> Rows<6, 6> {
        let pairs = grid(side);
        let n_blocks = (side * side) as usize;
        let identity = |s: f64| [s, 0.0, 0.0, s, 0.0, s];
        let mut diagonal = vec![identity(mass); n_blocks];
        for &block in pairs.as_flattened() {
            add(&mut diagonal[block as usize], identity(1.0));
        }
        let mut rows = Rows::new(n_blocks, &pairs);
        rows.set::<3>(&diagonal, &vec![identity(-1.0); pairs.len()]);
        rows
    }

    fn multilevel(rows: &Rows<6, 6>, usual_iterations: f64) -> Multilevel<3, 6, 6> {
        let pattern = Pattern::of(rows, Options::default(), usual_iterations);
        Multilevel::new(&pattern, translations).unwrap()
    }

    fn product_of(rows: &Rows<6, 6>, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let diagonal = rows.diagonal().iter().zip(x);
        let mut product: Vec<_> = diagonal.map(|(block, x)| times(block, x)).collect();
        for (pair, block) in rows.pairs().zip(rows.blocks()) {
            let [row, column] = pair.map(|block| block as usize);
            add(&mut product[row], times(block, &x[column]));
            add(&mut product[column], times(block, &x[row]));
        }
        product
    }

    fn iterations(side: u32, usual_iterations: f64) -> u64 {
        // What one block feels reaches ten blocks far.
        let rows = membrane(side, 1e-2);
        let n_blocks = rows.n_blocks();
        let mut multilevel = multilevel(&rows, usual_iterations);
        multilevel.set(&rows).unwrap();
        let mut gradients = ConjugateGradients::new(n_blocks);
        for (block, r) in gradients.residual.iter_mut().enumerate() {
            let t = block as f64;
            *r = [t.sin(), (0.1 * t).cos(), 1.0];
        }
        let b = gradients.residual.clone();
        let mut x = vec![[0.0; 3]; n_blocks];
        let until = Until {
            accuracy: 1e-10,
            most_iterations: 1000,
            interrupt: &Interrupt::default(),
        };
        let ending = gradients.solve(&rows, &mut multilevel, until, &mut x);
        assert_eq!(ending, Ending::Converged);
        let product = product_of(&rows, &x);
        let off = product.as_flattened().iter().zip(b.as_flattened());
        let worst = off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst:e}");
        gradients.iterations
    }

    #[test]
    fn iterations_hardly_grow_with_size() {
        let (small, large) = (iterations(30, 1e9), iterations(120, 1e9));
        assert!(large <= small + small / 2, "{small} and {large}");
    }

    #[test]
    fn a_third_level_converges_too() {
        let (two, three) = (iterations(60, 1e9), iterations(60, 1.0));
        assert!(three <= 3 * two, "{two} and {three}");
    }

    /// Zero sums of the residual: what conserves momentum.
    #[test]
    fn a_correction_leaves_no_sum_on_any_aggregate() {
        let rows = membrane(12, 1.0);
        let mut multilevel = multilevel(&rows, 1e9);
        multilevel.set(&rows).unwrap();
        let b: Vec<[f64; 3]> = (0..144).map(|k| [1.0, f64::from(k).sin(), 2.0]).collect();
        let mut x = vec![[0.0; 3]; 144];
        multilevel.correct(&b, &mut x);
        let product = product_of(&rows, &x);
        let aggregates =
            Aggregates::new(144, &Vec::from_iter(rows.pairs()), Reach::Neighbours).of_block;
        let mut sums = vec![[0.0; 3]; 144];
        for ((b, product), &aggregate) in b.iter().zip(&product).zip(&aggregates) {
            let rest = std::array::from_fn(|axis| b[axis] - product[axis]);
            add(&mut sums[aggregate as usize], rest);
        }
        assert!(sums.as_flattened().iter().all(|sum| sum.abs() < 1e-12));
    }
}
