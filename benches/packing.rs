//! Off-diagonal blocks of nine numbers beside symmetric ones of six, on one thread:
//! factorization and solution, preparation and iteration. Prints a table in
//! Markdown.
//!
//! ```text
//! cargo bench --bench packing
//! ```

#[path = "common/patterns.rs"]
mod patterns;

use patterns::{Pattern, Turns, block, cloth, general_blocks, symmetric_blocks};
use springs::solver::{Options, Packing, Solver, Strategy};

const SECONDS: f64 = 2.0;
const ACCURACY: f64 = 1e-8;

fn analyze(pattern: &Pattern, packing: Packing, strategy: Strategy) -> Solver {
    let options = Options {
        positions: Some(&pattern.positions),
        strategy,
        packing,
        ..Options::default()
    };
    Solver::analyze(pattern.positions.len(), &pattern.pairs, options).expect("enough memory")
}

fn solve(solver: &mut Solver, b: &[f64], x: &mut [f64]) {
    x.copy_from_slice(b);
    solver.solve_in_place(x, ACCURACY).expect("definite");
}

/// One row: the two pieces of work, and how often each does what is compared.
fn row(name: &str, what: &str, turns: &Turns, counts: [u64; 2]) {
    let [six, nine] = counts.map(|count| count as f64);
    let (ratio, spread) = turns.ratio(1, 0);
    let scale = six / nine;
    println!(
        "| {name} | {what} | {:.3} | {:.3} | {:.2} ± {:.2} |",
        turns.milliseconds(0) / six,
        turns.milliseconds(1) / nine,
        ratio * scale,
        spread * scale
    );
}

fn main() {
    println!("| pattern | what | six numbers, ms | nine, ms | ratio |");
    println!("| --- | --- | --- | --- | --- |");
    for pattern in [cloth(64), cloth(128), block(12), block(16)] {
        let (six_diagonal, six) = symmetric_blocks(&pattern, 10.0);
        let (nine_diagonal, nine) = general_blocks(&pattern, 10.0);
        let n_rows = 3 * pattern.positions.len();
        let b: Vec<f64> = (0..n_rows).map(|row| (row as f64).sin()).collect();
        let (mut x, mut y) = (b.clone(), b.clone());
        for (strategy, matrix, solution) in [
            (Strategy::Double, "factorization", "solution"),
            (Strategy::Iterative, "preparation", "iteration"),
        ] {
            let mut first = analyze(&pattern, Packing::Symmetric, strategy);
            let mut second = analyze(&pattern, Packing::General, strategy);
            let turns = Turns::take(
                SECONDS,
                &mut [
                    &mut || first.set_matrix(&six_diagonal, &six).expect("definite"),
                    &mut || second.set_matrix(&nine_diagonal, &nine).expect("definite"),
                ],
            );
            row(&pattern.name, matrix, &turns, [1, 1]);
            solve(&mut first, &b, &mut x);
            solve(&mut second, &b, &mut y);
            let iterations = [&first, &second].map(|solver| solver.counts().iterations.max(1));
            let turns = Turns::take(
                SECONDS,
                &mut [&mut || solve(&mut first, &b, &mut x), &mut || {
                    solve(&mut second, &b, &mut y)
                }],
            );
            row(&pattern.name, solution, &turns, iterations);
        }
    }
}
