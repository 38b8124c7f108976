//! Corrections by motions of aggregates.

use super::aggregates::{Aggregates, Reach};
use super::motions::{Along, Body, Idle, Motion, Place, Point};
use super::multilevel::Multilevel;
use super::rows::Rows;
use crate::block::{add, packed, place, rows};
use crate::direct::Direct;
use crate::{NearNullSpace, Options, Price, SolveError};
use springs_threads::share_out;

/// A subspace in which matrices of D × D blocks are solved: motions of aggregates of
/// blocks.
pub(crate) trait CoarseSpace<const D: usize, const P: usize, const Q: usize>:
    Send + Sync
{
    /// Takes the places of the blocks.
    fn set_places(&mut self, places: &[Place]);

    /// Prepares for a matrix.
    ///
    /// # Errors
    ///
    /// If the coarse matrix, and so the matrix, is not positive definite.
    fn set(&mut self, matrix: &Rows<P, Q>) -> Result<(), SolveError>;

    /// Solves for the motion of the aggregates that takes away what the residual `r` does to
    /// such motions.
    fn solve(&mut self, r: &[[f64; D]]);

    /// Adds that motion to some blocks, the first of which is `begin`.
    fn prolong(&self, begin: usize, z: &mut [[f64; D]]);

    /// Both, for all blocks.
    fn correct(&mut self, r: &[[f64; D]], z: &mut [[f64; D]]) {
        self.solve(r);
        self.prolong(0, z);
    }

    /// In bytes; `None` if it cannot be counted.
    fn memory(&self) -> Option<u64>;
}

/// Makes the coarse space of a pattern.
pub(crate) type MakeCoarse<const D: usize, const P: usize, const Q: usize> =
    fn(&Pattern<'_>) -> Result<Box<dyn CoarseSpace<D, P, Q>>, SolveError>;

/// The pattern of a matrix and how it is to be coarsened.
#[derive(Clone)]
pub(crate) struct Pattern<'a> {
    pub(crate) n_blocks: usize,
    /// Row and column of the blocks, in their order.
    pairs: Vec<[u32; 2]>,
    pub(crate) options: Options<'a>,
    /// A coarse matrix whose factor would cost more than so many iterations, with a
    /// solution for each of them, is made smaller or has a coarser one itself.
    usual_iterations: f64,
}

impl<'a> Pattern<'a> {
    pub(crate) fn of<const P: usize, const Q: usize>(
        matrix: &Rows<P, Q>,
        options: Options<'a>,
        usual_iterations: f64,
    ) -> Self {
        Self {
            n_blocks: matrix.n_blocks(),
            pairs: matrix.pairs().collect(),
            options,
            usual_iterations,
        }
    }
}

/// Translations of aggregates.
pub(crate) fn translations<const D: usize, const P: usize, const Q: usize>(
    pattern: &Pattern<'_>,
) -> Result<Box<dyn CoarseSpace<D, P, Q>>, SolveError> {
    let coarse = Motions::<Along, D, P, Q, D, P, Q>::new(pattern, translations)?;
    Ok(Box::new(coarse))
}

/// In space: what is asked for.
pub(crate) fn in_space<const P: usize, const Q: usize>(
    pattern: &Pattern<'_>,
) -> Result<Box<dyn CoarseSpace<3, P, Q>>, SolveError> {
    match pattern.options.near_null_space {
        NearNullSpace::Translations => translations(pattern),
        NearNullSpace::RigidMotions => {
            let coarse = Motions::<Point<3>, 3, P, Q, 6, 21, 36>::new(pattern, bodies_in_space)?;
            Ok(Box::new(coarse))
        }
    }
}

/// In a plane: what is asked for.
pub(crate) fn in_plane<const P: usize, const Q: usize>(
    pattern: &Pattern<'_>,
) -> Result<Box<dyn CoarseSpace<2, P, Q>>, SolveError> {
    match pattern.options.near_null_space {
        NearNullSpace::Translations => translations(pattern),
        NearNullSpace::RigidMotions => {
            let coarse = Motions::<Point<2>, 2, P, Q, 3, 6, 9>::new(pattern, bodies_in_plane)?;
            Ok(Box::new(coarse))
        }
    }
}

fn bodies_in_space(pattern: &Pattern<'_>) -> Result<Box<dyn CoarseSpace<6, 21, 36>>, SolveError> {
    let coarse = Motions::<Body<3>, 6, 21, 36, 6, 21, 36>::new(pattern, bodies_in_space)?;
    Ok(Box::new(coarse))
}

fn bodies_in_plane(pattern: &Pattern<'_>) -> Result<Box<dyn CoarseSpace<3, 6, 9>>, SolveError> {
    let coarse = Motions::<Body<2>, 3, 6, 9, 3, 6, 9>::new(pattern, bodies_in_plane)?;
    Ok(Box::new(coarse))
}

/// A coarse space of M motions an aggregate, in which blocks take part as `T`s. The
/// matrix in it has M × M blocks: MP numbers a diagonal one, MQ another.
struct Motions<
    T,
    const D: usize,
    const P: usize,
    const Q: usize,
    const M: usize,
    const MP: usize,
    const MQ: usize,
> {
    aggregates: Aggregates,
    /// Of each block.
    motions: Vec<T>,
    /// Of each aggregate.
    places: Vec<Place>,
    /// Aggregates with rotations that move none of their nodes.
    idle: Vec<(usize, Idle)>,
    diagonal: Vec<[f64; MP]>,
    off_diagonal: Vec<[f64; MQ]>,
    vector: Vec<[f64; M]>,
    solver: Solver<M, MP, MQ>,
}

/// What solves in the coarse space.
enum Solver<const M: usize, const MP: usize, const MQ: usize> {
    Direct(Box<Direct<M, MP>>),
    Level(Box<Level<M, MP, MQ>>),
}

/// One application of the next coarser preconditioner.
struct Level<const M: usize, const MP: usize, const MQ: usize> {
    matrix: Rows<MP, MQ>,
    preconditioner: Multilevel<M, MP, MQ>,
    solution: Vec<[f64; M]>,
}

/// Aggregates, or pairs of them, in a share of the work.
const A_SHARE: usize = 64;

/// Stiffness of rotations that move nothing, as a part of that of translations.
const IDLE_STIFFNESS: f64 = 1e-6;

impl<
    T: Motion<D, M>,
    const D: usize,
    const P: usize,
    const Q: usize,
    const M: usize,
    const MP: usize,
    const MQ: usize,
> Motions<T, D, P, Q, M, MP, MQ>
{
    fn new(pattern: &Pattern<'_>, next: MakeCoarse<M, MP, MQ>) -> Result<Self, SolveError> {
        let &Pattern {
            n_blocks,
            ref pairs,
            options,
            usual_iterations,
        } = pattern;
        let options = Options {
            positions: None,
            ..options
        };
        let dearest = usual_iterations * Price::of_iteration::<P, Q>(n_blocks, pairs.len());
        let coarsened = |reach| {
            let aggregates = Aggregates::new(n_blocks, pairs, reach);
            let direct = Direct::<M, MP>::new(aggregates.n, &aggregates.pairs, options)?;
            let price = Price::with_factor(direct.size().entries, direct.size().flops);
            let is_cheap = price.matrix + usual_iterations * price.solution <= dearest;
            Ok((aggregates, direct, is_cheap))
        };
        let mut coarse = coarsened(Reach::Neighbours)?;
        if !coarse.2 {
            coarse = coarsened(Reach::SecondNeighbours)?;
        }
        let (aggregates, direct, is_cheap) = coarse;
        let n = aggregates.n;
        let solver = if is_cheap || n == n_blocks {
            Solver::Direct(Box::new(direct))
        } else {
            let matrix = Rows::new(n, &aggregates.pairs);
            let coarse = Pattern::of(&matrix, options, usual_iterations);
            Solver::Level(Box::new(Level {
                preconditioner: Multilevel::new(&coarse, next)?,
                matrix,
                solution: vec![[0.0; M]; n],
            }))
        };
        Ok(Self {
            motions: vec![T::at([0.0; 3], 1.0); n_blocks],
            places: vec![Place::default(); n],
            idle: Vec::new(),
            diagonal: vec![[0.0; MP]; n],
            off_diagonal: vec![[0.0; MQ]; aggregates.pairs.len()],
            vector: vec![[0.0; M]; n],
            solver,
            aggregates,
        })
    }

    /// The matrix that all motions see, aggregate by aggregate and pair by pair.
    fn project_all(&mut self, matrix: &Rows<P, Q>) {
        let Self {
            aggregates,
            motions,
            diagonal,
            off_diagonal,
            ..
        } = self;
        let (aggregates, motions) = (&*aggregates, &*motions);
        let of_entry = |entry: usize| {
            let pair = matrix.pair(entry).map(|block| block as usize);
            let [left, right] = pair.map(|block| &motions[block]);
            (pair, projected(left, &matrix.blocks()[entry], right))
        };
        share_out(shares(diagonal), |(begin, sums)| {
            for (aggregate, sum) in (begin..).zip(sums) {
                *sum = [0.0; MP];
                for &block in aggregates.members.of(aggregate) {
                    let (block, motion) = (block as usize, &motions[block as usize]);
                    add_packed(sum, &projected(motion, &matrix.diagonal()[block], motion));
                }
                for &entry in aggregates.inside.of(aggregate) {
                    // It stands above and below the diagonal.
                    let (_, projected) = of_entry(entry as usize);
                    add_packed(sum, &projected);
                    add_packed(sum, &transposed(&projected));
                }
            }
        });
        share_out(shares(off_diagonal), |(begin, sums)| {
            for (pair, sum) in (begin..).zip(sums) {
                *sum = [0.0; MQ];
                for &entry in aggregates.between.of(pair) {
                    let ([row, column], mut projected) = of_entry(entry as usize);
                    if aggregates.of_block[row] > aggregates.of_block[column] {
                        projected = transposed(&projected);
                    }
                    for (i, row) in projected.iter().enumerate() {
                        for (j, entry) in row.iter().enumerate().skip(first_of_row::<M, MQ>(i)) {
                            sum[place::<M, MQ>(i, j)] += entry;
                        }
                    }
                }
            }
        });
    }

    /// Gives rotations that move nothing a stiffness, or they would make the matrix
    /// singular.
    fn hold_idle(&mut self) {
        let n_translations = M - T::N_ROTATIONS;
        for (aggregate, idle) in &self.idle {
            let block = &mut self.diagonal[*aggregate];
            let translations = (0..n_translations).map(|k| block[packed::<M>(k, k)]);
            let stiffness = IDLE_STIFFNESS * translations.sum::<f64>() / n_translations as f64;
            for i in 0..T::N_ROTATIONS {
                for j in i..T::N_ROTATIONS {
                    let part = match idle {
                        Idle::About(axis) => axis[i] * axis[j],
                        Idle::All if i == j => 1.0,
                        Idle::All => 0.0,
                    };
                    block[packed::<M>(n_translations + i, n_translations + j)] += stiffness * part;
                }
            }
        }
    }
}

impl<
    T: Motion<D, M>,
    const D: usize,
    const P: usize,
    const Q: usize,
    const M: usize,
    const MP: usize,
    const MQ: usize,
> CoarseSpace<D, P, Q> for Motions<T, D, P, Q, M, MP, MQ>
{
    fn set_places(&mut self, places: &[Place]) {
        if T::N_ROTATIONS == 0 {
            return;
        }
        let is_of_nodes = places.iter().all(|place| place.radius == 0.0);
        self.idle.clear();
        for (aggregate, whole) in self.places.iter_mut().enumerate() {
            let members = self.aggregates.members.of(aggregate);
            let blocks = members.iter().map(|&block| &places[block as usize]);
            *whole = Place::around(blocks.clone());
            for (&block, place) in members.iter().zip(blocks.clone()) {
                self.motions[block as usize] = T::in_whole(place, whole);
            }
            // In a plane, all rotations are across it.
            match whole.idle_rotations(blocks).filter(|_| is_of_nodes) {
                Some(Idle::About(_)) if T::N_ROTATIONS < 3 => {}
                Some(idle) => self.idle.push((aggregate, idle)),
                None => {}
            }
        }
        if let Solver::Level(level) = &mut self.solver {
            level.preconditioner.set_places(&self.places);
        }
    }

    fn set(&mut self, matrix: &Rows<P, Q>) -> Result<(), SolveError> {
        self.project_all(matrix);
        self.hold_idle();
        let (diagonal, off_diagonal) = (&self.diagonal, &self.off_diagonal);
        let done = match &mut self.solver {
            Solver::Direct(direct) => direct.factorize(diagonal, off_diagonal),
            Solver::Level(level) => {
                level.matrix.set::<M>(diagonal, off_diagonal);
                level.preconditioner.set(&level.matrix)
            }
        };
        done.map_err(|error| match error {
            SolveError::NotPositiveDefinite { block } => SolveError::NotPositiveDefinite {
                block: self.aggregates.members.of(block)[0] as usize,
            },
            other => other,
        })
    }

    fn solve(&mut self, r: &[[f64; D]]) {
        let (aggregates, motions) = (&self.aggregates, &self.motions);
        share_out(shares(&mut self.vector), |(begin, vector)| {
            for (aggregate, sum) in (begin..).zip(vector) {
                *sum = [0.0; M];
                for &block in aggregates.members.of(aggregate) {
                    let block = block as usize;
                    add(sum, motions[block].restrict(&r[block]));
                }
            }
        });
        match &mut self.solver {
            Solver::Direct(direct) => direct.solve_in_place(&mut self.vector),
            Solver::Level(level) => {
                let (r, z) = (&mut self.vector, &mut level.solution);
                level.preconditioner.apply(&level.matrix, (r, None), z);
            }
        }
    }

    fn prolong(&self, begin: usize, z: &mut [[f64; D]]) {
        let motion = match &self.solver {
            Solver::Direct(_) => &self.vector,
            Solver::Level(level) => &level.solution,
        };
        let blocks = begin..begin + z.len();
        let (of_block, motions) = (&self.aggregates.of_block, &self.motions);
        let of_blocks = of_block[blocks.clone()].iter().zip(&motions[blocks]);
        for (z, (&aggregate, of_block)) in z.iter_mut().zip(of_blocks) {
            add(z, of_block.prolong(&motion[aggregate as usize]));
        }
    }

    fn memory(&self) -> Option<u64> {
        let (n_blocks, n) = (self.motions.len(), self.diagonal.len());
        let own = size_of::<T>() * n_blocks
            + (size_of::<Place>() + 8 * (MP + M)) * n
            + 8 * MQ * self.off_diagonal.len();
        let solver = match &self.solver {
            Solver::Direct(direct) => direct.symbolic_memory() + direct.factor_memory()?,
            Solver::Level(level) => {
                Rows::<MP, MQ>::memory(n, self.off_diagonal.len())
                    + (8 * M * n) as u64
                    + level.preconditioner.memory()?
            }
        };
        Some(self.aggregates.memory() + own as u64 + solver)
    }
}

/// Consecutive items, with the number of the first, that are one share of the work.
fn shares<T>(items: &mut [T]) -> impl Iterator<Item = (usize, &mut [T])> {
    (0..).step_by(A_SHARE).zip(items.chunks_mut(A_SHARE))
}

/// LᵀBR of a block B with the motions L of its row and R of its column, by columns.
#[inline(always)]
fn projected<T: Motion<D, M>, const D: usize, const N: usize, const M: usize>(
    left: &T,
    block: &[f64; N],
    right: &T,
) -> [[f64; M]; M] {
    let half = rows::<D, N>(block).map(|row| right.restrict(&row));
    let by_columns: [[f64; M]; M] =
        std::array::from_fn(|column| left.restrict(&half.map(|row| row[column])));
    transposed(&by_columns)
}

#[inline(always)]
fn transposed<const M: usize>(block: &[[f64; M]; M]) -> [[f64; M]; M] {
    std::array::from_fn(|row| std::array::from_fn(|column| block[column][row]))
}

/// Adds the upper triangle of a block.
#[inline(always)]
fn add_packed<const M: usize, const MP: usize>(sum: &mut [f64; MP], block: &[[f64; M]; M]) {
    for (i, row) in block.iter().enumerate() {
        for (j, entry) in row.iter().enumerate().skip(i) {
            sum[packed::<M>(i, j)] += entry;
        }
    }
}

/// The first column of a row of a block of N numbers that is kept.
#[inline(always)]
const fn first_of_row<const M: usize, const N: usize>(row: usize) -> usize {
    if crate::block::is_symmetric::<M, N>() {
        row
    } else {
        0
    }
}

#[cfg(test)]
mod tests;
