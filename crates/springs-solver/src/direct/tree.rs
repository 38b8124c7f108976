//! Chains, trees and forests: elimination without fill.

use crate::FactorSize;
use crate::block::{
    Rounding, backward, columns, divide, forward, is_symmetric, ldlt, packed, rows,
};
use crate::lanes::Lanes;
use crate::ordering::{AT_ONCE, Forest, Joint, NO_PARENT, NONE, Part, Schedule, Turn};
use crate::storage::filled;
use springs_threads::{share_out, threads_here};

type Pair = Lanes<AT_ONCE>;

/// A factorization L D Lᵀ of a matrix whose graph is a forest: every block column of L
/// has one block below the diagonal at most, that of its parent. Independent columns are
/// eliminated two at a time, since each waits for the one before.
pub(crate) struct Tree<const D: usize, const P: usize> {
    branches: Vec<Branches<D, P>>,
    /// Above all others.
    top: Branches<D, P>,
    joints: Vec<Joint>,
    n_blocks: usize,
    n_pairs: usize,
}

/// Part of a forest.
struct Branches<const D: usize, const P: usize> {
    turns: Vec<[Turn; AT_ONCE]>,
    couplings: Vec<[Coupling; AT_ONCE]>,
    n_sums: usize,
    factor: Vec<Columns<D, P>>,
    x: Vec<[Pair; D]>,
    /// What the diagonal blocks have less by their children.
    sums: Places<P>,
    /// The same of right-hand sides; then solutions of parents.
    vectors: Places<D>,
}

/// The block that joins a block to its parent.
#[derive(Clone, Copy)]
struct Coupling {
    pair: u32,
    /// Whether the parent has the block in its column.
    is_transposed: bool,
}

/// Columns of the factor.
#[derive(Clone, Copy)]
struct Columns<const D: usize, const P: usize> {
    /// L and D⁻¹ of the diagonal block.
    diagonal: [Pair; P],
    /// L in the row of the parent, row by row.
    below: [[Pair; D]; D],
}

impl<const D: usize, const P: usize> Tree<D, P> {
    /// `None` if the graph has cycles.
    pub(crate) fn new(n_blocks: usize, pairs: &[[u32; 2]]) -> Option<Self> {
        let forest = Forest::new(n_blocks, pairs)?;
        let Schedule { parts, joints } = Schedule::new(&forest);
        let parts = parts.into_iter().map(|part| Branches::new(&forest, part));
        let mut branches: Vec<_> = parts.collect();
        Some(Self {
            top: branches.pop()?,
            branches,
            joints,
            n_blocks,
            n_pairs: pairs.len(),
        })
    }

    pub(crate) fn size(&self) -> FactorSize {
        let roots = self.n_blocks - self.n_pairs;
        let counts = [(self.n_pairs, 2), (roots, 1)];
        let mut size = FactorSize::default();
        for (columns, blocks) in counts {
            size.add(D, columns, blocks);
        }
        size
    }

    /// In bytes.
    pub(crate) fn symbolic_memory(&self) -> u64 {
        let joints = size_of::<Joint>() * self.joints.len();
        self.parts().map(Branches::symbolic_memory).sum::<u64>() + joints as u64
    }

    /// In bytes.
    pub(crate) fn factor_memory(&self) -> u64 {
        self.parts().map(Branches::factor_memory).sum()
    }

    fn parts(&self) -> impl Iterator<Item = &Branches<D, P>> {
        self.branches.iter().chain([&self.top])
    }

    /// Makes room for a factor, once; `None` if there is not enough memory.
    pub(crate) fn allocate(&mut self) -> Option<()> {
        let mut parts = self.branches.iter_mut().chain([&mut self.top]);
        parts.try_for_each(Branches::allocate)
    }

    /// Fails with the block of a pivot that is not positive.
    pub(crate) fn factorize<const Q: usize>(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
        rounding: Rounding,
    ) -> Result<(), usize> {
        let factorize =
            |part: &mut Branches<D, P>| part.factorize(diagonal, off_diagonal, rounding);
        let done = share_out(&mut self.branches, |branch| {
            branch.sums.clear();
            factorize(branch)
        });
        done.into_iter().collect::<Result<(), usize>>()?;
        self.top.sums.clear();
        for joint in &self.joints {
            let sum = self.branches[joint.part].sums.at(joint.from);
            self.top.sums.add(joint.to, sum);
        }
        factorize(&mut self.top)
    }

    pub(crate) fn solve_in_place(&mut self, rhs: &mut [[f64; D]]) {
        let b = &*rhs;
        share_out(&mut self.branches, |branch| {
            branch.vectors.clear();
            branch.forward(b);
        });
        self.top.vectors.clear();
        for joint in &self.joints {
            let sum = self.branches[joint.part].vectors.at(joint.from);
            self.top.vectors.add(joint.to, sum);
        }
        self.top.forward(b);
        self.top.backward(Some(&mut *rhs));
        for joint in &self.joints {
            let x = self.top.vectors.at(joint.to);
            self.branches[joint.part].vectors.set(joint.from, x);
        }
        if threads_here() <= 1 {
            for branch in &mut self.branches {
                branch.backward(Some(&mut *rhs));
            }
            return;
        }
        share_out(&mut self.branches, |branch| branch.backward(None));
        for branch in &self.branches {
            branch.copy_solution(rhs);
        }
    }
}

impl<const D: usize, const P: usize> Branches<D, P> {
    fn new(forest: &Forest, part: Part) -> Self {
        let coupling = |turn: Turn| {
            let block = turn.block;
            let pair = if turn.parent == NO_PARENT {
                NONE
            } else {
                forest.pairs[block as usize]
            };
            Coupling {
                pair,
                // The upper triangle has the block in the row of the smaller one.
                is_transposed: block < forest.parents[block as usize],
            }
        };
        Self {
            couplings: part.turns.iter().map(|turn| turn.map(coupling)).collect(),
            turns: part.turns,
            n_sums: part.n_sums,
            factor: Vec::new(),
            x: Vec::new(),
            sums: Places(Vec::new()),
            vectors: Places(Vec::new()),
        }
    }

    fn symbolic_memory(&self) -> u64 {
        let of_turn = size_of::<[Turn; AT_ONCE]>() + size_of::<[Coupling; AT_ONCE]>();
        (of_turn * self.turns.len()) as u64
    }

    fn factor_memory(&self) -> u64 {
        let of_turn = size_of::<Columns<D, P>>() + size_of::<[Pair; D]>();
        let of_sum = size_of::<[f64; P]>() + size_of::<[f64; D]>();
        (of_turn * self.turns.len() + of_sum * self.n_sums) as u64
    }

    fn allocate(&mut self) -> Option<()> {
        if self.factor.len() < self.turns.len() {
            let zero = Pair::splat(0.0);
            let columns = Columns {
                diagonal: [zero; P],
                below: [[zero; D]; D],
            };
            self.factor = filled(columns, self.turns.len())?;
            self.x = filled([zero; D], self.turns.len())?;
        }
        if self.sums.0.is_empty() {
            self.sums = Places::new(self.n_sums)?;
            self.vectors = Places::new(self.n_sums)?;
        }
        Some(())
    }

    fn factorize<const Q: usize>(
        &mut self,
        diagonal: &[[f64; P]],
        off_diagonal: &[[f64; Q]],
        rounding: Rounding,
    ) -> Result<(), usize> {
        let turns = self.turns.iter().zip(&self.couplings);
        for ((turn, couplings), columns) in turns.zip(&mut self.factor) {
            let before = both(turn, |turn| diagonal[turn.block as usize]);
            let sums = self.sums.take(turn.map(|turn| turn.sum));
            let errors = both(&before, |block| rounding.diagonal_errors(block));
            let mut block = Pair::of(&before);
            for (entry, sum) in block.iter_mut().zip(sums) {
                *entry -= sum;
            }
            let (factor, is_positive) = ldlt::<D, P, AT_ONCE>(&block, &Pair::of(&errors));
            for (turn, is_positive) in turn.iter().zip(is_positive) {
                if !is_positive {
                    return Err(turn.block as usize);
                }
            }
            let rows = both(couplings, |coupling| coupling.block::<D, Q>(off_diagonal));
            columns.diagonal = factor;
            let mut scaled = [[Pair::splat(0.0); D]; D];
            for row in 0..D {
                let of_row = std::array::from_fn(|column| {
                    Lanes([rows[0][row][column], rows[1][row][column]])
                });
                scaled[row] = forward(&factor, of_row);
                columns.below[row] = divide(&factor, scaled[row]);
            }
            let mut update = [Pair::splat(0.0); P];
            for row in 0..D {
                for column in row..D {
                    update[packed::<D>(row, column)] = dot(&columns.below[row], &scaled[column]);
                }
            }
            self.sums.add_both(turn.map(|turn| turn.parent), &update);
        }
        Ok(())
    }

    fn forward(&mut self, b: &[[f64; D]]) {
        let columns = self.factor.iter().zip(&self.turns);
        for ((columns, turn), x) in columns.zip(&mut self.x) {
            let b = Pair::of(&both(turn, |turn| b[turn.block as usize]));
            let sums = self.vectors.take(turn.map(|turn| turn.sum));
            let mut y = b;
            for row in 0..D {
                y[row] -= sums[row];
            }
            let y = forward(&columns.diagonal, y);
            let mut above = [Pair::splat(0.0); D];
            for (above, row) in above.iter_mut().zip(&columns.below) {
                *above = dot(row, &y);
            }
            self.vectors.add_both(turn.map(|turn| turn.parent), &above);
            *x = divide(&columns.diagonal, y);
        }
    }

    /// Puts the solution where it is said to, or leaves it in x.
    fn backward(&mut self, mut solution: Option<&mut [[f64; D]]>) {
        self.vectors.set(NO_PARENT, [0.0; D]);
        let columns = self.factor.iter().zip(&self.turns);
        for ((columns, turn), x) in columns.zip(&mut self.x).rev() {
            let above = self.vectors.both(turn.map(|turn| turn.parent));
            let mut z = *x;
            // Last what the parent has last.
            for row in (0..D).rev() {
                for (z, entry) in z.iter_mut().zip(&columns.below[row]) {
                    *z -= *entry * above[row];
                }
            }
            let found = backward(&columns.diagonal, z);
            self.vectors.set_both(turn.map(|turn| turn.sum), &found);
            match &mut solution {
                Some(solution) => copy(turn, &found, solution),
                None => *x = found,
            }
        }
    }

    fn copy_solution(&self, x: &mut [[f64; D]]) {
        for (turn, solution) in self.turns.iter().zip(&self.x) {
            copy(turn, solution, x);
        }
    }
}

/// The first last, in case that a block is there twice.
#[inline(always)]
fn copy<const D: usize>(turn: &[Turn; AT_ONCE], solution: &[Pair; D], x: &mut [[f64; D]]) {
    for (lane, turn) in turn.iter().enumerate().rev() {
        x[turn.block as usize] = Pair::lane(solution, lane);
    }
}

impl Coupling {
    /// In the row of the parent; zero without one.
    #[inline(always)]
    fn block<const D: usize, const Q: usize>(self, off_diagonal: &[[f64; Q]]) -> [[f64; D]; D] {
        match off_diagonal.get(self.pair as usize) {
            None => [[0.0; D]; D],
            Some(block) if is_symmetric::<D, Q>() || !self.is_transposed => rows::<D, Q>(block),
            Some(block) => columns::<D, Q>(block),
        }
    }
}

#[inline(always)]
fn dot<const D: usize>(a: &[Pair; D], b: &[Pair; D]) -> Pair {
    let mut sum = a[0] * b[0];
    for k in 1..D {
        sum += a[k] * b[k];
    }
    sum
}

/// Places of N numbers, two side by side.
struct Places<const N: usize>(Vec<[Pair; N]>);

impl<const N: usize> Places<N> {
    fn new(n: usize) -> Option<Self> {
        Some(Self(filled([Pair::splat(0.0); N], n.div_ceil(2))?))
    }

    fn clear(&mut self) {
        self.0.fill([Pair::splat(0.0); N]);
    }

    #[inline(always)]
    fn at(&self, place: u32) -> [f64; N] {
        Pair::lane(&self.0[place as usize / 2], place as usize % 2)
    }

    #[inline(always)]
    fn set(&mut self, place: u32, numbers: [f64; N]) {
        for (pair, number) in self.0[place as usize / 2].iter_mut().zip(numbers) {
            pair.0[place as usize % 2] = number;
        }
    }

    #[inline(always)]
    fn add(&mut self, place: u32, numbers: [f64; N]) {
        for (pair, number) in self.0[place as usize / 2].iter_mut().zip(numbers) {
            pair.0[place as usize % 2] += number;
        }
    }

    #[inline(always)]
    fn both(&self, places: [u32; AT_ONCE]) -> [Pair; N] {
        match side_by_side(places) {
            Some(index) => self.0[index],
            None => Pair::of(&both(&places, |&place| self.at(place))),
        }
    }

    /// Leaves zeros.
    #[inline(always)]
    fn take(&mut self, places: [u32; AT_ONCE]) -> [Pair; N] {
        let numbers = self.both(places);
        self.set_both(places, &[Pair::splat(0.0); N]);
        numbers
    }

    /// The first counts where both are the same.
    #[inline(always)]
    fn set_both(&mut self, places: [u32; AT_ONCE], numbers: &[Pair; N]) {
        match side_by_side(places) {
            Some(index) => self.0[index] = *numbers,
            None => {
                self.set(places[1], Pair::lane(numbers, 1));
                self.set(places[0], Pair::lane(numbers, 0));
            }
        }
    }

    #[inline(always)]
    fn add_both(&mut self, places: [u32; AT_ONCE], numbers: &[Pair; N]) {
        match side_by_side(places) {
            Some(index) => {
                for (sum, number) in self.0[index].iter_mut().zip(numbers) {
                    *sum += *number;
                }
            }
            None => {
                self.add(places[0], Pair::lane(numbers, 0));
                self.add(places[1], Pair::lane(numbers, 1));
            }
        }
    }
}

#[inline(always)]
fn side_by_side([a, b]: [u32; AT_ONCE]) -> Option<usize> {
    (a % 2 == 0 && b == a + 1).then_some(a as usize / 2)
}

/// The maps of arrays are not always inlined.
#[inline(always)]
fn both<T, R>([a, b]: &[T; AT_ONCE], map: impl Fn(&T) -> R) -> [R; AT_ONCE] {
    [map(a), map(b)]
}
