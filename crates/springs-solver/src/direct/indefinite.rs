//! Factors L D Lᵀ of matrices that may be indefinite or singular.

use super::fronts::Fronts;
use super::pivoting::{Dense, Pivot};
use crate::block::{columns, rows};
use crate::ordering::best_elimination;
use crate::packing::{OffDiagonal, Upper};
use crate::storage::zeros;
use crate::{Interrupt, SolveError};

/// How many pivots are positive, negative and zero. By Sylvester's law of inertia the
/// matrix has as many such eigenvalues, as far as zero can be told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inertia {
    /// Above zero.
    pub positive: usize,
    /// Below zero.
    pub negative: usize,
    /// No further from zero than [`Indefinite::ZERO`].
    pub zero: usize,
}

/// A solver of A x = b with symmetric matrices that may be indefinite, by a
/// multifrontal factorization L D Lᵀ with pivots of one and two rows; rows without a
/// pivot that is large enough in their front go on to the next one (Duff and Reid, ACM
/// TOMS 9, 1983). On one thread.
///
/// ```
/// use springs_solver::{Indefinite, Inertia};
///
/// let mut factor = Indefinite::analyze(1, &[], None)?;
/// let inertia = factor.set_matrix(&[[0.0, 2.0, 0.0, 0.0, 0.0, 0.0]], &[[0.0; 6]; 0])?;
/// assert_eq!(inertia, Inertia { positive: 1, negative: 1, zero: 1 });
/// let mut x = [2.0, 4.0, 0.0];
/// factor.solve_in_place(&mut x)?;
/// assert_eq!(x, [2.0, 1.0, 0.0]);
/// # Ok::<(), springs_solver::SolveError>(())
/// ```
pub struct Indefinite {
    n_blocks: usize,
    n_pairs: usize,
    order: Vec<usize>,
    fronts: Fronts,
    upper: Upper,
    /// By front, children first.
    parts: Vec<Part>,
    /// What diagonal blocks may come to.
    sizes: Vec<f64>,
    /// What the entries of every block row and column were multiplied with.
    scales: Vec<f64>,
    /// Where scalars are in the front at work.
    position: Vec<u32>,
    has_matrix: bool,
    interrupt: Interrupt,
}

/// The pivots of one front, and their columns of L.
struct Part {
    /// Scalars in the order of elimination: those of the pivots, then the others.
    rows: Vec<u32>,
    pivots: Vec<Pivot>,
    /// Scalars of the pivots.
    n_eliminated: usize,
    /// By columns, as high as there are rows.
    l: Vec<f64>,
}

/// What a front leaves for its parent.
struct Update {
    rows: Vec<u32>,
    /// The first of them, as many as had no pivot.
    n_delayed: usize,
    /// Lower triangle, by columns.
    a: Vec<f64>,
}

impl Indefinite {
    /// Pivots count as zero up to this, where every block of the diagonal is scaled
    /// such that its largest entry, or its [size](Self::set_sizes) if that is larger, is one:
    /// of a node with springs of stiffness K, up to about 1e-11 K.
    pub const ZERO: f64 = 1e-11;

    /// Orders and factorizes symbolically, as [`Solver::analyze`](crate::Solver::analyze).
    ///
    /// # Errors
    ///
    /// If a pair is not two different blocks below `n_blocks` or stands twice, or if
    /// there is not enough memory.
    ///
    /// # Panics
    ///
    /// If there are positions, but not one per block.
    pub fn analyze(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        positions: Option<&[[f64; 3]]>,
    ) -> Result<Self, SolveError> {
        let elimination = best_elimination(n_blocks, pairs, positions)?;
        Ok(Self {
            n_blocks,
            n_pairs: pairs.len(),
            fronts: Fronts::new(&elimination),
            order: elimination.order,
            upper: Upper::new(pairs),
            parts: Vec::new(),
            sizes: vec![0.0; n_blocks],
            scales: vec![1.0; n_blocks],
            position: vec![0; 3 * n_blocks],
            has_matrix: false,
            interrupt: Interrupt::default(),
        })
    }

    /// Whom to hear while a matrix is factorized: asked to stop, that ends soon with
    /// [`SolveError::Interrupted`].
    pub fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
    }

    /// What the diagonal blocks may come to, where that is more than what they are: so that
    /// what is left of something large counts as zero.
    ///
    /// # Panics
    ///
    /// If there is not one size for each block row.
    pub fn set_sizes(&mut self, sizes: &[f64]) {
        assert_eq!(sizes.len(), self.n_blocks, "one size per row");
        self.sizes.copy_from_slice(sizes);
    }

    /// Factorizes the matrix with the given blocks.
    ///
    /// # Errors
    ///
    /// If there is not enough memory, an entry of a diagonal block is not finite, or it is
    /// interrupted.
    ///
    /// # Panics
    ///
    /// If there is not one diagonal block per block row and one off-diagonal block per
    /// pair.
    pub fn set_matrix<'a>(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: impl Into<OffDiagonal<'a>>,
    ) -> Result<Inertia, SolveError> {
        let off_diagonal = off_diagonal.into();
        assert_eq!(diagonal.len(), self.n_blocks, "one diagonal block per row");
        assert_eq!(off_diagonal.len(), self.n_pairs, "one block per pair");
        self.has_matrix = false;
        self.set_scales(diagonal)?;
        match off_diagonal {
            OffDiagonal::Symmetric(blocks) => self.factorize(diagonal, blocks)?,
            OffDiagonal::General(blocks) => {
                let mut upper = std::mem::take(&mut self.upper);
                let done = self.factorize(diagonal, upper.of(blocks));
                self.upper = upper;
                done?;
            }
        }
        self.has_matrix = true;
        Ok(self.inertia())
    }

    fn set_scales(&mut self, diagonal: &[[f64; 6]]) -> Result<(), SolveError> {
        let with_sizes = self.scales.iter_mut().zip(&self.sizes);
        for (block, ((scale, size), entries)) in with_sizes.zip(diagonal).enumerate() {
            if entries.iter().any(|entry| !entry.is_finite()) {
                return Err(SolveError::NotPositiveDefinite { block });
            }
            let largest = entries
                .iter()
                .fold(*size, |most: f64, entry| most.max(entry.abs()));
            *scale = if largest > 0.0 {
                1.0 / largest.sqrt()
            } else {
                1.0
            };
        }
        Ok(())
    }

    fn factorize<const Q: usize>(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; Q]],
    ) -> Result<(), SolveError> {
        let n_blocks = self.n_blocks;
        let too_large = SolveError::TooLarge { n_blocks };
        self.parts.clear();
        let mut waiting: Vec<Option<Update>> = Vec::new();
        waiting.resize_with(self.fronts.len(), || None);
        for front in 0..self.fronts.len() {
            let children = self.fronts.children(front).iter();
            let children = children.filter_map(|&child| waiting[child as usize].take());
            let children: Vec<Update> = children.collect();
            let (mut scalars, n_summed) = self.scalars(front, &children);
            let n = scalars.len();
            let mut a = zeros(n * n).ok_or(too_large)?;
            self.assemble(front, n, diagonal, off_diagonal, &mut a);
            for child in &children {
                self.add(child, n, &mut a);
            }
            let parent = self.fronts.parent(front);
            let mut dense = Dense {
                n,
                a: &mut a,
                rows: &mut scalars,
                limit: Self::ZERO,
            };
            let pivots = dense.eliminate(n_summed, parent.is_none(), &self.interrupt);
            let pivots = pivots.ok_or(SolveError::Interrupted)?;
            let widths = pivots.iter().map(|pivot| pivot.width());
            let n_eliminated: usize = widths.sum();
            if parent.is_some() {
                let size = n - n_eliminated;
                let mut rest = zeros(size * size).ok_or(too_large)?;
                for (column, target) in rest.chunks_exact_mut(size.max(1)).enumerate() {
                    let from = (n_eliminated + column) * n + n_eliminated;
                    target[column..].copy_from_slice(&a[from + column..from + size]);
                }
                waiting[front] = Some(Update {
                    rows: scalars[n_eliminated..].to_vec(),
                    n_delayed: n_summed - n_eliminated,
                    a: rest,
                });
            }
            a.truncate(n_eliminated * n);
            a.shrink_to_fit();
            self.parts.push(Part {
                rows: scalars,
                pivots,
                n_eliminated,
                l: a,
            });
        }
        Ok(())
    }

    /// The scalars of a front in the order of elimination, and how many of them have
    /// got all their entries: its own, and those that children had no pivot for.
    fn scalars(&mut self, front: usize, children: &[Update]) -> (Vec<u32>, usize) {
        let of_block = |block: u32| (0..3).map(move |axis| 3 * block + axis);
        let own = self.fronts.first[front]..self.fronts.first[front + 1];
        let mut scalars: Vec<u32> = own.flat_map(of_block).collect();
        for child in children {
            scalars.extend(&child.rows[..child.n_delayed]);
        }
        let n_summed = scalars.len();
        let below = self.fronts.rows(front).iter();
        scalars.extend(below.flat_map(|&block| of_block(block)));
        for (place, &scalar) in (0..).zip(&scalars) {
            self.position[scalar as usize] = place;
        }
        (scalars, n_summed)
    }

    /// The entries of the matrix in a front, scaled.
    fn assemble<const Q: usize>(
        &self,
        front: usize,
        n: usize,
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; Q]],
        a: &mut [f64],
    ) {
        let fronts = &self.fronts;
        let first = fronts.first[front] as usize;
        let n_columns = fronts.n_columns(front);
        // The k-th block row of the front: its place and that of its block.
        let block_row = |k: usize| {
            let column = match k.checked_sub(n_columns) {
                None => first + k,
                Some(below) => fronts.rows(front)[below] as usize,
            };
            (self.position[3 * column] as usize, self.order[column])
        };
        let mut put = |row: usize, column: usize, by_rows: [[f64; 3]; 3]| {
            let ((row, row_block), (column, column_block)) = (block_row(row), block_row(column));
            let scale = self.scales[row_block] * self.scales[column_block];
            for (i, values) in by_rows.iter().enumerate() {
                for (j, value) in values.iter().enumerate() {
                    let (row, column) = (row + i, column + j);
                    if row >= column {
                        a[column * n + row] = value * scale;
                    }
                }
            }
        };
        for (column, &block) in fronts.blocks(front).iter().enumerate() {
            put(column, column, rows::<3, 6>(&diagonal[block as usize]));
        }
        for entry in fronts.entries(front) {
            let block = &off_diagonal[entry.pair as usize];
            let (row, column) = (entry.row as usize, entry.column as usize);
            if row > column {
                put(row, column, rows::<3, Q>(block));
            } else {
                put(column, row, columns::<3, Q>(block));
            }
        }
    }

    /// Adds what a child left.
    fn add(&self, child: &Update, n: usize, a: &mut [f64]) {
        let size = child.rows.len();
        for (j, &column) in child.rows.iter().enumerate() {
            let column = self.position[column as usize] as usize;
            for (i, &row) in child.rows.iter().enumerate().skip(j) {
                let row = self.position[row as usize] as usize;
                a[column.min(row) * n + column.max(row)] += child.a[j * size + i];
            }
        }
    }

    fn inertia(&self) -> Inertia {
        let mut inertia = Inertia::default();
        for pivot in self.parts.iter().flat_map(|part| &part.pivots) {
            match pivot {
                Pivot::Zero => inertia.zero += 1,
                Pivot::One(d) if *d > 0.0 => inertia.positive += 1,
                Pivot::One(_) => inertia.negative += 1,
                Pivot::Two([first, cross, second]) => {
                    if first * second < cross * cross {
                        inertia.positive += 1;
                        inertia.negative += 1;
                    } else if *first > 0.0 {
                        inertia.positive += 2;
                    } else {
                        inertia.negative += 2;
                    }
                }
            }
        }
        inertia
    }

    /// Replaces b by a solution of A x = b. Zero pivots give zeros: where b is not in
    /// the range of the matrix, the rest is solved for.
    ///
    /// # Errors
    ///
    /// If there is no matrix.
    ///
    /// # Panics
    ///
    /// If `b` does not have three entries per block row.
    pub fn solve_in_place(&self, b: &mut [f64]) -> Result<(), SolveError> {
        assert_eq!(b.len(), 3 * self.n_blocks, "three entries per block row");
        if !self.has_matrix {
            return Err(SolveError::NoMatrix);
        }
        let mut y = self.ordered(b);
        for part in &self.parts {
            part.forward(&mut y);
        }
        for part in &self.parts {
            part.divide(&mut y);
        }
        self.backward(&mut y, b);
        Ok(())
    }

    /// Directions x in which xᵀ A x is negative, independent of each other, one for
    /// each negative pivot.
    pub fn negative_directions(&self) -> impl Iterator<Item = Vec<f64>> {
        self.directions(|pivot| match *pivot {
            Pivot::One(d) if d < 0.0 => vec![[1.0, 0.0]],
            Pivot::Two([first, cross, second]) => {
                let (mean, half) = (0.5 * (first + second), 0.5 * (first - second));
                let radius = half.hypot(cross);
                let both = [mean - radius, mean + radius].into_iter();
                let negative = both.filter(|value| *value < 0.0);
                negative
                    .map(|value| eigenvector(first - value, cross, second - value))
                    .collect()
            }
            _ => Vec::new(),
        })
    }

    /// Directions x with A x = 0, independent of each other, one for each zero pivot.
    pub fn zero_directions(&self) -> impl Iterator<Item = Vec<f64>> {
        self.directions(|pivot| match pivot {
            Pivot::Zero => vec![[1.0, 0.0]],
            _ => Vec::new(),
        })
    }

    /// What some vectors at the pivots come to, scaled to a largest entry of one.
    fn directions(&self, of: impl Fn(&Pivot) -> Vec<[f64; 2]>) -> impl Iterator<Item = Vec<f64>> {
        let pivots = self.parts.iter().flat_map(|part| {
            let mut row = 0;
            part.pivots.iter().map(move |pivot| {
                let rows = &part.rows[row..row + pivot.width()];
                row += pivot.width();
                (pivot, rows)
            })
        });
        let begins = pivots
            .flat_map(move |(pivot, rows)| of(pivot).into_iter().map(move |begin| (begin, rows)));
        begins.map(|(begin, rows)| {
            let mut y = vec![0.0; 3 * self.n_blocks];
            for (&row, value) in rows.iter().zip(begin) {
                y[row as usize] = value;
            }
            let mut x = vec![0.0; 3 * self.n_blocks];
            self.backward(&mut y, &mut x);
            let largest = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            x.iter_mut().for_each(|x| *x /= largest);
            x
        })
    }

    /// Into the order of elimination, scaled.
    fn ordered(&self, b: &[f64]) -> Vec<f64> {
        let blocks = self.order.iter();
        let scaled = blocks.flat_map(|&block| {
            let scale = self.scales[block];
            b[3 * block..3 * block + 3].iter().map(move |b| b * scale)
        });
        scaled.collect()
    }

    /// L⁻ᵀ y, in the order of the caller.
    fn backward(&self, y: &mut [f64], x: &mut [f64]) {
        for part in self.parts.iter().rev() {
            part.backward(y);
        }
        for (y, &block) in y.as_chunks::<3>().0.iter().zip(&self.order) {
            let scale = self.scales[block];
            for (x, y) in x[3 * block..3 * block + 3].iter_mut().zip(y) {
                *x = y * scale;
            }
        }
    }
}

/// A unit vector that [a b; b c], which is singular, takes to zero.
fn eigenvector(a: f64, b: f64, c: f64) -> [f64; 2] {
    let (x, y) = if a.abs() > c.abs() { (-b, a) } else { (c, -b) };
    let length = x.hypot(y);
    if length > 0.0 {
        [x / length, y / length]
    } else {
        [1.0, 0.0]
    }
}

impl Pivot {
    fn width(&self) -> usize {
        match self {
            Self::Zero | Self::One(_) => 1,
            Self::Two(_) => 2,
        }
    }
}

impl Part {
    fn columns(&self) -> impl DoubleEndedIterator<Item = (usize, &[f64])> {
        let n = self.rows.len().max(1);
        self.l.chunks_exact(n).take(self.n_eliminated).enumerate()
    }

    /// Rows of L below each column: its pivot takes part where it has two.
    fn forward(&self, y: &mut [f64]) {
        for (column, l) in self.columns() {
            let own = y[self.rows[column] as usize];
            if own != 0.0 {
                for (&row, l) in self.rows.iter().zip(l).skip(column + 1) {
                    y[row as usize] -= l * own;
                }
            }
        }
    }

    fn divide(&self, y: &mut [f64]) {
        let mut row = 0;
        for pivot in &self.pivots {
            let own = self.rows[row] as usize;
            match *pivot {
                Pivot::Zero => y[own] = 0.0,
                Pivot::One(d) => y[own] /= d,
                Pivot::Two([first, cross, second]) => {
                    let other = self.rows[row + 1] as usize;
                    let (p, q) = (first / cross, second / cross);
                    let scale = 1.0 / (cross * (p * q - 1.0));
                    let (a, b) = (y[own], y[other]);
                    y[own] = (q * a - b) * scale;
                    y[other] = (p * b - a) * scale;
                }
            }
            row += pivot.width();
        }
    }

    fn backward(&self, y: &mut [f64]) {
        for (column, l) in self.columns().rev() {
            let mut sum = y[self.rows[column] as usize];
            for (&row, l) in self.rows.iter().zip(l).skip(column + 1) {
                sum -= l * y[row as usize];
            }
            y[self.rows[column] as usize] = sum;
        }
    }
}
