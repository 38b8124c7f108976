//! Symmetric matrices of blocks, by rows.

use super::stretches::{Stretches, parts};
use crate::SolveError;
use crate::block::{Rounding, add, dot, invert, subtract, times, times_transposed, transposed};
use crate::ordering::by_breadth;
use crate::storage::filled;
use pulp::Arch;
use springs_threads::share_out;
use std::ops::Range;

/// A symmetric matrix D + L + Lᵀ: the diagonal with P numbers a block, and L, which couples
/// each block with those that sweeps come to before it, with Q numbers a block, row by row
/// with ascending columns. Blocks are kept as they stand in Lᵀ.
pub(crate) struct Rows<const P: usize, const Q: usize> {
    stretches: Stretches,
    /// The caller's block of each.
    order: Vec<u32>,
    starts: Vec<usize>,
    rows: Vec<u32>,
    columns: Vec<u32>,
    /// Which of the caller's pairs each entry is.
    sources: Vec<u32>,
    diagonal: Vec<[f64; P]>,
    blocks: Vec<[f64; Q]>,
}

/// Of so many numbers each.
type Blocks<const N: usize> = Vec<[f64; N]>;

/// What a sweep reads and writes of a window that begins `at` some block.
pub(crate) struct Window<'a, const D: usize> {
    pub(crate) at: usize,
    pub(crate) x: &'a mut [[f64; D]],
    /// What is left of the right-hand side.
    pub(crate) rest: &'a mut [[f64; D]],
}

impl<const P: usize, const Q: usize> Rows<P, Q> {
    /// The pattern with the given pairs; all values are zero.
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]]) -> Self {
        let stretches = Stretches::new(n_blocks, pairs);
        Self::with_order((0..n_blocks as u32).collect(), pairs, stretches)
    }

    /// The same, with blocks numbered anew if more of them can then be worked on at once.
    pub(crate) fn renumbered(n_blocks: usize, pairs: &[[u32; 2]]) -> Self {
        let natural = Self::new(n_blocks, pairs);
        if natural.stretches.n_at_once() == Stretches::most(n_blocks) {
            return natural;
        }
        let order = by_breadth(n_blocks, pairs);
        let mut places = vec![0; n_blocks];
        for (place, &block) in (0..).zip(&order) {
            places[block as usize] = place;
        }
        let places = |pair: &[u32; 2]| pair.map(|block| places[block as usize]);
        let pairs: Vec<[u32; 2]> = pairs.iter().map(places).collect();
        let stretches = Stretches::new(n_blocks, &pairs);
        if stretches.n_at_once() > natural.stretches.n_at_once() {
            Self::with_order(order, &pairs, stretches)
        } else {
            natural
        }
    }

    fn with_order(order: Vec<u32>, pairs: &[[u32; 2]], stretches: Stretches) -> Self {
        let n_blocks = order.len();
        let mut entries: Vec<([u32; 2], u32)> = pairs
            .iter()
            .zip(0..)
            .map(|(&pair, source)| (stretches.later_first(pair), source))
            .collect();
        entries.sort_unstable();
        let starts = (0..=n_blocks)
            .map(|row| entries.partition_point(|entry| (entry.0[0] as usize) < row))
            .collect();
        Self {
            stretches,
            order,
            starts,
            rows: entries.iter().map(|entry| entry.0[0]).collect(),
            columns: entries.iter().map(|entry| entry.0[1]).collect(),
            sources: entries.iter().map(|entry| entry.1).collect(),
            diagonal: vec![[0.0; P]; n_blocks],
            blocks: vec![[0.0; Q]; pairs.len()],
        }
    }

    /// Memory of such a matrix, in bytes.
    pub(crate) fn memory(n_blocks: usize, n_pairs: usize) -> u64 {
        ((12 + 8 * P) * n_blocks + (12 + 8 * Q) * n_pairs) as u64
    }

    pub(crate) fn n_blocks(&self) -> usize {
        self.diagonal.len()
    }

    pub(crate) fn n_pairs(&self) -> usize {
        self.blocks.len()
    }

    pub(crate) fn stretches(&self) -> &Stretches {
        &self.stretches
    }

    pub(crate) fn diagonal(&self) -> &[[f64; P]] {
        &self.diagonal
    }

    /// The off-diagonal blocks, in the order of [`pairs`](Self::pairs).
    pub(crate) fn blocks(&self) -> &[[f64; Q]] {
        &self.blocks
    }

    /// The caller's block that one of these is.
    pub(crate) fn source(&self, block: usize) -> usize {
        self.order[block] as usize
    }

    /// The caller's items in the order of these blocks.
    pub(crate) fn of_sources<'a, T>(&'a self, items: &'a [T]) -> impl Iterator<Item = &'a T> {
        self.order.iter().map(|&source| &items[source as usize])
    }

    /// What these blocks have, in the order of the caller.
    pub(crate) fn give_back<T: Copy>(&self, items: &[T], to_sources: &mut [T]) {
        for (item, &source) in items.iter().zip(&self.order) {
            to_sources[source as usize] = *item;
        }
    }

    /// Takes values in the order of the caller, off-diagonal ones as they stand above the
    /// caller's diagonal.
    pub(crate) fn set<const D: usize>(&mut self, diagonal: &[[f64; P]], upper: &[[f64; Q]]) {
        let Self {
            stretches,
            order,
            starts,
            columns,
            sources,
            ..
        } = self;
        let (order, columns, sources) = (&*order, &*columns, &*sources);
        let entries = |rows: &Range<usize>| starts[rows.start]..starts[rows.end];
        let of_entries = stretches.windows().map(|rows| entries(&rows));
        let tasks = stretches
            .windows()
            .zip(parts(&mut self.diagonal, stretches.windows()))
            .zip(parts(&mut self.blocks, of_entries));
        share_out(tasks, |((rows, own), mut blocks)| {
            for (row, own) in rows.zip(own) {
                *own = diagonal[order[row] as usize];
                let entries = starts[row]..starts[row + 1];
                let (of_row, tail) = blocks.split_at_mut(entries.len());
                blocks = tail;
                let from = sources[entries.clone()].iter().zip(&columns[entries]);
                let is_upper = |column: u32| order[column as usize] < order[row];
                for (block, (&source, &column)) in of_row.iter_mut().zip(from) {
                    let value = &upper[source as usize];
                    *block = if is_upper(column) {
                        *value
                    } else {
                        transposed::<D, Q>(value)
                    };
                }
            }
        });
    }

    /// Row and column of a block of Lᵀ.
    #[inline(always)]
    pub(crate) fn pair(&self, entry: usize) -> [u32; 2] {
        [self.columns[entry], self.rows[entry]]
    }

    /// Rows and columns of all of them.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = [u32; 2]> {
        (0..self.n_pairs()).map(|entry| self.pair(entry))
    }

    /// Diagonal and off-diagonal blocks as [`set`](Self::set) takes them; `None` without
    /// enough memory.
    pub(crate) fn by_source<const D: usize>(&self) -> Option<(Blocks<P>, Blocks<Q>)> {
        let mut diagonal = filled([0.0; P], self.diagonal.len())?;
        self.give_back(&self.diagonal, &mut diagonal);
        let mut upper = filled([0.0; Q], self.blocks.len())?;
        let from = self.sources.iter().zip(&self.blocks);
        for (pair, (&source, block)) in self.pairs().zip(from) {
            let [row, column] = pair.map(|block| self.order[block as usize]);
            upper[source as usize] = if row < column {
                *block
            } else {
                transposed::<D, Q>(block)
            };
        }
        Some((diagonal, upper))
    }

    /// Columns in a row of L, and the blocks of Lᵀ there.
    #[inline(always)]
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, &[f64; Q])> {
        let (columns, blocks) = self.entries(row);
        columns.iter().map(|&column| column as usize).zip(blocks)
    }

    /// The same from the last one to the first.
    #[inline(always)]
    fn row_backwards(&self, row: usize) -> impl Iterator<Item = (usize, &[f64; Q])> {
        let (columns, blocks) = self.entries(row);
        let blocks = &blocks[..columns.len()];
        let entries = (0..columns.len()).rev();
        entries.map(move |entry| (columns[entry] as usize, &blocks[entry]))
    }

    #[inline(always)]
    fn entries(&self, row: usize) -> (&[u32], &[[f64; Q]]) {
        let entries = self.starts[row]..self.starts[row + 1];
        (&self.columns[entries.clone()], &self.blocks[entries])
    }

    /// One row of L x, of which x begins at some block.
    #[inline(always)]
    pub(crate) fn lower_row<const D: usize>(
        &self,
        row: usize,
        at: usize,
        x: &[[f64; D]],
    ) -> [f64; D] {
        let mut sum = [0.0; D];
        for (column, block) in self.row(row) {
            add(&mut sum, times_transposed(block, &x[column - at]));
        }
        sum
    }

    /// xᵀA x.
    pub(crate) fn quadratic_form<const D: usize>(&self, x: &[[f64; D]]) -> f64 {
        let of_row = |(row, block): (usize, &[f64; P])| {
            let own = dot(&x[row], &times(block, &x[row]));
            own + 2.0 * dot(&x[row], &self.lower_row(row, 0, x))
        };
        self.diagonal.iter().enumerate().map(of_row).sum()
    }

    /// Solves (D + L) x = r in some rows, with the inverses of the diagonal blocks; r is
    /// of these rows. What is then left of r, −Lᵀx, is in the rest.
    pub(crate) fn sweep_down<const D: usize>(
        &self,
        rows: Range<usize>,
        inverses: &[[f64; P]],
        r: &[[f64; D]],
        Window { at, x, rest }: Window<'_, D>,
    ) {
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (row, r) in rows.zip(r) {
                    let mut sum = *r;
                    subtract(&mut sum, self.lower_row(row, at, x));
                    let here = times(&inverses[row], &sum);
                    (x[row - at], rest[row - at]) = (here, [0.0; D]);
                    for (column, block) in self.row(row) {
                        subtract(&mut rest[column - at], times(block, &here));
                    }
                }
            },
        );
    }

    /// Solves (D + Lᵀ) z = r − L x in some rows, of which r and z are. The rest, which began
    /// as r, is used up, and x becomes z − x. Gives rᵀz.
    pub(crate) fn sweep_up<const D: usize>(
        &self,
        rows: Range<usize>,
        inverses: &[[f64; P]],
        (r, z): (&[[f64; D]], &mut [[f64; D]]),
        Window { at, x, rest }: Window<'_, D>,
    ) -> f64 {
        Arch::new().dispatch(
            #[inline(always)]
            || {
                let mut product = 0.0;
                for (row, (r, z)) in rows.zip(r.iter().zip(z)).rev() {
                    let mut sum = rest[row - at];
                    for (column, block) in self.row_backwards(row) {
                        subtract(&mut sum, times_transposed(block, &x[column - at]));
                    }
                    let here = times(&inverses[row], &sum);
                    for (column, block) in self.row_backwards(row) {
                        subtract(&mut rest[column - at], times(block, &here));
                    }
                    product += dot(r, &here);
                    let x = &mut x[row - at];
                    for axis in 0..D {
                        x[axis] = here[axis] - x[axis];
                    }
                    *z = here;
                }
                product
            },
        )
    }

    /// The inverses of the diagonal blocks.
    ///
    /// # Errors
    ///
    /// If one of them, and so the matrix, is not positive definite.
    pub(crate) fn invert_diagonal<const D: usize>(
        &self,
        inverses: &mut [[f64; P]],
        rounding: Rounding,
    ) -> Result<(), SolveError> {
        let tasks = self.stretches.windows();
        let tasks = tasks.zip(parts(inverses, self.stretches.windows()));
        let done = share_out(tasks, |(rows, inverses)| {
            for (block, inverse) in rows.zip(inverses) {
                let inverted = invert::<D, P>(&self.diagonal[block], rounding);
                *inverse = inverted.ok_or(SolveError::NotPositiveDefinite { block })?;
            }
            Ok(())
        });
        done.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix3};

    /// A matrix with the given pairs, and the same as a dense one.
    fn example(n_blocks: usize, pairs: &[[u32; 2]]) -> (Rows<6, 9>, DMatrix<f64>) {
        let mut rows = Rows::new(n_blocks, pairs);
        let block = |seed: f64| std::array::from_fn(|k| (seed * (k + 1) as f64).sin());
        let off_diagonal: Vec<_> = (0..pairs.len()).map(|k| block(1.0 + k as f64)).collect();
        let diagonal: Vec<[f64; 6]> = (0..n_blocks)
            .map(|k| [9.0, 0.5, -0.5, 8.0, 1.0, 7.0 + (k as f64).cos()])
            .collect();
        rows.set::<3>(&diagonal, &off_diagonal);
        let mut dense = DMatrix::zeros(3 * n_blocks, 3 * n_blocks);
        let full =
            |b: &[f64; 6]| Matrix3::new(b[0], b[1], b[2], b[1], b[3], b[4], b[2], b[4], b[5]);
        for (k, block) in diagonal.iter().enumerate() {
            dense
                .fixed_view_mut::<3, 3>(3 * k, 3 * k)
                .copy_from(&full(block));
        }
        for (&[a, b], block) in pairs.iter().zip(&off_diagonal) {
            let [a, b] = [a.min(b), a.max(b)].map(|block: u32| 3 * block as usize);
            let block = Matrix3::from_row_slice(block);
            dense.fixed_view_mut::<3, 3>(a, b).copy_from(&block);
            dense.fixed_view_mut::<3, 3>(b, a).tr_copy_from(&block);
        }
        assert_eq!(rows.by_source::<3>().unwrap(), (diagonal, off_diagonal));
        (rows, dense)
    }

    fn vector(blocks: &[[f64; 3]]) -> DVector<f64> {
        DVector::from_column_slice(blocks.as_flattened())
    }

    /// Beside dense matrices in the order of the sweeps.
    fn check_sweeps(n: usize, pairs: &[[u32; 2]]) {
        let (rows, dense) = example(n, pairs);
        let stretches = rows.stretches();
        let odd = || stretches.odd().map(|(odd, _)| odd);
        let order: Vec<usize> = stretches.even().chain(odd()).flatten().collect();
        assert_eq!(order.len(), n);
        let mut turn = vec![0; n];
        for (at, &block) in order.iter().enumerate() {
            turn[block] = at;
        }
        let (mut lower, mut diagonal) = (dense.clone(), DMatrix::zeros(3 * n, 3 * n));
        for row in 0..3 * n {
            for column in 0..3 * n {
                if turn[column / 3] >= turn[row / 3] {
                    lower[(row, column)] = 0.0;
                }
                if column / 3 == row / 3 {
                    diagonal[(row, column)] = dense[(row, column)];
                }
            }
        }
        let near = |y: &[[f64; 3]], expected: DVector<f64>| {
            let error = (vector(y) - &expected).amax();
            assert!(error < 1e-13 * (1.0 + expected.amax()), "{error:e}");
        };
        let r: Vec<[f64; 3]> = (0..n).map(|k| [1.0, (k as f64).sin(), -0.5]).collect();
        let products: Vec<_> = (0..n).map(|row| rows.lower_row(row, 0, &r)).collect();
        near(&products, &lower * vector(&r));
        let expected = vector(&r).dot(&(&dense * vector(&r)));
        assert!((rows.quadratic_form(&r) - expected).abs() < 1e-13 * expected.abs());

        let mut inverses = vec![[0.0; 6]; n];
        rows.invert_diagonal::<3>(&mut inverses, Rounding::ByEntry)
            .unwrap();
        let zeros = vec![[0.0; 3]; n];
        let (mut x, mut z, mut rest) = (zeros.clone(), zeros.clone(), zeros);
        fn all<'a>(x: &'a mut [[f64; 3]], rest: &'a mut [[f64; 3]]) -> Window<'a, 3> {
            Window { at: 0, x, rest }
        }
        for part in stretches.even().chain(odd()) {
            let r = &r[part.clone()];
            rows.sweep_down(part, &inverses, r, all(&mut x, &mut rest));
        }
        // One column after the other.
        let solve = |matrix: &DMatrix<f64>, b: &DVector<f64>, order: &[usize]| {
            let (mut b, mut solution) = (b.clone(), DVector::zeros(3 * n));
            for &block in order {
                let own = diagonal.fixed_view::<3, 3>(3 * block, 3 * block);
                let here = own
                    .into_owned()
                    .lu()
                    .solve(&b.fixed_rows::<3>(3 * block))
                    .unwrap();
                solution.fixed_rows_mut::<3>(3 * block).copy_from(&here);
                b -= matrix.columns(3 * block, 3) * here;
            }
            solution
        };
        near(&x, solve(&lower, &vector(&r), &order));
        near(&rest, -lower.transpose() * vector(&x));
        let left = vector(&r) - &lower * vector(&x);
        let backwards: Vec<usize> = order.into_iter().rev().collect();
        let expected = solve(&lower.transpose(), &left, &backwards);
        let change = &expected - vector(&x);
        rest.copy_from_slice(&r);
        let mut product = 0.0;
        for part in stretches
            .even()
            .chain(odd())
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
        {
            let (r, z) = (&r[part.clone()], &mut z[part.clone()]);
            product += rows.sweep_up(part, &inverses, (r, z), all(&mut x, &mut rest));
        }
        near(&z, expected.clone());
        near(&x, change);
        let expected = expected.dot(&vector(&r));
        assert!((product - expected).abs() < 1e-13 * expected.abs());
    }

    /// A chain whose numbers are mixed is one again, and gives its values back.
    #[test]
    fn renumbered_blocks_are_those_of_the_caller() {
        const N: usize = 500;
        let mixed = |k: usize| (k * 37 % N) as u32;
        let pairs: Vec<[u32; 2]> = (1..N).map(|k| [mixed(k - 1), mixed(k)]).collect();
        let mut rows = Rows::<6, 9>::renumbered(N, &pairs);
        assert_eq!(rows.stretches().n_at_once(), 2);
        let diagonal: Vec<[f64; 6]> = (0..N).map(|k| [k as f64; 6]).collect();
        let block = |k| std::array::from_fn(|entry| (10 * k + entry) as f64);
        let upper: Vec<[f64; 9]> = (1..N).map(block).collect();
        rows.set::<3>(&diagonal, &upper);
        assert_eq!(
            rows.by_source::<3>().unwrap(),
            (diagonal.clone(), upper.clone())
        );
        for ([row, column], block) in rows.pairs().zip(rows.blocks()) {
            let [a, b] = [row, column].map(|block| rows.source(block as usize) as u32);
            let pair = pairs
                .iter()
                .position(|pair| *pair == [a, b] || *pair == [b, a])
                .unwrap();
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                let (i_upper, j_upper) = if a < b { (i, j) } else { (j, i) };
                assert_eq!(block[3 * i + j], upper[pair][3 * i_upper + j_upper]);
            }
        }
        let there: Vec<[f64; 6]> = rows.of_sources(&diagonal).copied().collect();
        let mut back = vec![[0.0; 6]; N];
        rows.give_back(&there, &mut back);
        assert_eq!((there.as_slice(), back), (rows.diagonal(), diagonal));
    }

    #[test]
    fn sweeps_equal_dense_ones() {
        check_sweeps(4, &[[2, 0], [1, 2], [3, 1], [0, 3]]);
        // In several stretches.
        let near = (0..399).map(|k| if k % 3 == 0 { [k + 1, k] } else { [k, k + 1] });
        let far = (0..397).step_by(2).map(|k| [k, k + 3]);
        check_sweeps(400, &near.chain(far).collect::<Vec<_>>());
    }
}
