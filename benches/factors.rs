//! Our factors beside those of faer: the same order of elimination, a symbolic
//! factorization that is kept, blocks of one, two and three numbers a side. A
//! factorization begins with the blocks; for faer they are copied to where it
//! wants them. Prints a table in Markdown.
//!
//! ```text
//! cargo bench --bench factors
//! ```

#[path = "common/patterns.rs"]
mod patterns;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::Perm;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use patterns::{Pattern, Turns, block, cloth, symmetric_blocks};
use springs::solver::{Options, Solver, Strategy, Subspace, elimination_order};

const SECONDS: f64 = 2.0;

/// A matrix and its factor by faer, with D × D blocks: the first D rows and columns
/// of ours.
struct Faer {
    dimension: usize,
    /// The upper triangle.
    matrix: SparseColMat<usize, f64>,
    /// Of each value: index among all blocks, first those of the diagonal, and entry.
    sources: Vec<(usize, usize)>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    memory: MemBuffer,
    par: Par,
}

impl Faer {
    fn new(pattern: &Pattern, dimension: usize, par: Par) -> Self {
        let n_blocks = pattern.positions.len();
        let on_diagonal = (0..n_blocks).map(|block| [block, block]);
        let pairs = pattern
            .pairs
            .iter()
            .map(|pair| pair.map(|block| block as usize));
        let mut entries = Vec::new();
        for (index, [a, b]) in on_diagonal.chain(pairs).enumerate() {
            for row in 0..dimension {
                for column in 0..dimension {
                    let at = (dimension * b + column, dimension * a + row);
                    if at.1 <= at.0 {
                        let [low, high] = [row.min(column), row.max(column)];
                        entries.push((at, (index, [0, 2, 3][low] + high)));
                    }
                }
            }
        }
        entries.sort_unstable();
        let n = dimension * n_blocks;
        let starts = (0..=n).map(|column| entries.partition_point(|entry| entry.0.0 < column));
        let rows = entries.iter().map(|entry| entry.0.1).collect();
        let pattern_of_scalars =
            SymbolicSparseColMat::new_checked(n, n, starts.collect(), None, rows);

        let order = elimination_order(n_blocks, &pattern.pairs, Some(&pattern.positions));
        let order = order.expect("a sound pattern");
        let scalars = |block: &usize| {
            let first = dimension * block;
            first..first + dimension
        };
        let forward: Box<[usize]> = order.iter().flat_map(scalars).collect();
        let mut inverse = vec![0; n].into_boxed_slice();
        for (position, &scalar) in forward.iter().enumerate() {
            inverse[scalar] = position;
        }
        let order = Perm::new_checked(forward, inverse, n);
        let symbolic = factorize_symbolic_cholesky(
            pattern_of_scalars.as_ref(),
            Side::Upper,
            SymmetricOrdering::Custom(order.as_ref()),
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..Default::default()
            },
        );
        let symbolic = symbolic.expect("enough memory");
        let factorization = symbolic.factorize_numeric_llt_scratch::<f64>(par, Default::default());
        let scratch = factorization.or(symbolic.solve_in_place_scratch::<f64>(1, par));
        Self {
            dimension,
            matrix: SparseColMat::new(pattern_of_scalars, vec![0.0; entries.len()]),
            sources: entries.iter().map(|entry| entry.1).collect(),
            values: vec![0.0; symbolic.len_val()],
            symbolic,
            memory: MemBuffer::new(scratch),
            par,
        }
    }

    fn factorize(&mut self, diagonal: &[[f64; 6]], off_diagonal: &[[f64; 6]]) {
        for (value, &(block, entry)) in self.matrix.val_mut().iter_mut().zip(&self.sources) {
            *value = match block.checked_sub(diagonal.len()) {
                None => diagonal[block][entry],
                Some(pair) => off_diagonal[pair][entry],
            };
        }
        let done = self.symbolic.factorize_numeric_llt(
            &mut self.values,
            self.matrix.as_ref(),
            Side::Upper,
            LltRegularization::default(),
            self.par,
            MemStack::new(&mut self.memory),
            Default::default(),
        );
        done.expect("a positive definite matrix");
    }

    fn solve(&mut self, x: &mut [f64]) {
        let n = x.len();
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(x, n, 1),
            self.par,
            MemStack::new(&mut self.memory),
        );
    }
}

fn ours(pattern: &Pattern, dimension: usize, threads: usize) -> Solver {
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let options = Options {
        positions: Some(&pattern.positions),
        threads,
        strategy: Strategy::Double,
        subspace: match dimension {
            1 => Subspace::Line(x),
            2 => Subspace::Plane([x, y]),
            _ => Subspace::Space,
        },
        ..Options::default()
    };
    Solver::analyze(pattern.positions.len(), &pattern.pairs, options).expect("enough memory")
}

/// A right-hand side in the subspace, three components a block.
fn right_hand_side(n_blocks: usize, dimension: usize) -> Vec<f64> {
    let component = |k: usize| {
        if k % 3 < dimension {
            (k as f64).sin()
        } else {
            0.0
        }
    };
    (0..3 * n_blocks).map(component).collect()
}

fn compare(pattern: &Pattern, dimension: usize) {
    let n_blocks = pattern.positions.len();
    let (diagonal, off_diagonal) = symmetric_blocks(pattern, 10.0);
    // In a subspace the last matrix would stand: two take turns.
    let other: Vec<[f64; 6]> = diagonal
        .iter()
        .map(|block| block.map(|x| 1.5 * x))
        .collect();
    let mut one = ours(pattern, dimension, 1);
    let mut two = ours(pattern, dimension, 2);
    let mut faer = Faer::new(pattern, dimension, Par::Seq);
    let set = |solver: &mut Solver| {
        for diagonal in [&other, &diagonal] {
            solver
                .set_matrix(diagonal, &off_diagonal)
                .expect("definite");
        }
    };
    let factorization = Turns::take(
        SECONDS,
        &mut [
            &mut || {
                faer.factorize(&other, &off_diagonal);
                faer.factorize(&diagonal, &off_diagonal);
            },
            &mut || set(&mut one),
            &mut || set(&mut two),
        ],
    );
    let b = right_hand_side(n_blocks, dimension);
    let (mut x, mut y) = (b.clone(), b.clone());
    let in_subspace = |k: &usize| k % 3 < dimension;
    let reduced: Vec<f64> = (0..b.len()).filter(in_subspace).map(|k| b[k]).collect();
    let mut z = reduced.clone();
    let solution = Turns::take(
        SECONDS / 2.0,
        &mut [
            &mut || {
                z.copy_from_slice(&reduced);
                faer.solve(&mut z);
            },
            &mut || {
                x.copy_from_slice(&b);
                one.solve_in_place(&mut x, 1e-11).expect("a factor");
            },
            &mut || {
                y.copy_from_slice(&b);
                two.solve_in_place(&mut y, 1e-11).expect("a factor");
            },
        ],
    );
    assert_eq!(x, y, "the same bits");
    let both = (0..b.len()).filter(in_subspace).map(|k| x[k]).zip(&z);
    assert!(both.map(|(x, z)| (x - z).abs()).fold(0.0, f64::max) < 1e-9);
    for (what, turns, repeats) in [
        ("factorization", &factorization, 2.0),
        ("solution", &solution, 1.0),
    ] {
        let cell = |piece| {
            let (ratio, spread) = turns.ratio(piece, 0);
            format!("{ratio:.2} ± {spread:.2}")
        };
        let ms = |piece| turns.milliseconds(piece) / repeats;
        println!(
            "| {} | {} | {what} | {:.3} | {:.3} | {} | {:.3} | {} |",
            pattern.name,
            faer.dimension,
            ms(0),
            ms(1),
            cell(1),
            ms(2),
            cell(2),
        );
    }
}

fn main() {
    println!("| pattern | D | what | faer, ms | ours, ms | ratio | two threads, ms | ratio |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let cloths = [16, 32, 64, 128, 256].map(cloth);
    let blocks = [8, 12, 16, 24].map(block);
    for pattern in cloths.iter().chain(&blocks) {
        for dimension in [3, 2, 1] {
            compare(pattern, dimension);
        }
    }
}
