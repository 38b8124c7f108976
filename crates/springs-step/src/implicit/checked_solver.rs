//! A solver that looks at the whole of its matrices.

use nalgebra::Vector3;
use springs_assembly::{OffDiagonal, PACKED};
use springs_solver::{
    Counts, Interrupt, Options, Price, SolveError, Solver, Strategy, StrategyState, Subspace,
};

/// A [`Solver`] that takes a matrix only if all of it is positive definite, also
/// the part across a plane or line that it does not solve.
pub(crate) struct CheckedSolver {
    solver: Solver,
    across: Option<Across>,
    counts: CheckCounts,
}

/// What was done for the part that is not solved.
#[derive(Clone, Copy, Default)]
pub(crate) struct CheckCounts {
    pub(crate) symbolic_factorizations: u64,
    pub(crate) factorizations: u64,
}

/// The part of a matrix across a plane or line.
///
/// The matrix couples nothing there with anything along, and both directions
/// across a line are alike; so one number per block is the whole of it.
struct Across {
    n_blocks: usize,
    pairs: Vec<[u32; 2]>,
    positions: Vec<[f64; 3]>,
    threads: usize,
    interrupt: Interrupt,
    normal: Vector3<f64>,
    /// Made when it is first needed.
    solver: Option<Solver>,
    /// Diagonal entries minus the magnitudes of the others in their rows.
    excess: Vec<f64>,
}

/// A row is dominated by its diagonal entry if that exceeds the others by more
/// than this part of it: far more than rounding.
const DOMINANT: f64 = 1e-12;

impl CheckedSolver {
    /// As [`Solver::analyze`]; if there is a normal of the plane or line that
    /// solutions lie in, the matrix is looked at in its direction, too.
    pub(crate) fn analyze(
        n_blocks: usize,
        pairs: &[[u32; 2]],
        options: Options<'_>,
        normal: Option<Vector3<f64>>,
    ) -> Result<Self, SolveError> {
        Ok(Self {
            solver: Solver::analyze(n_blocks, pairs, options)?,
            across: normal.map(|normal| Across {
                n_blocks,
                pairs: pairs.to_vec(),
                positions: options.positions.unwrap_or_default().to_vec(),
                threads: options.threads,
                interrupt: Interrupt::default(),
                normal,
                solver: None,
                excess: vec![0.0; n_blocks],
            }),
            counts: CheckCounts::default(),
        })
    }

    /// As [`Solver::set_interrupt`].
    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.solver.set_interrupt(interrupt);
        if let Some(across) = &mut self.across {
            across.interrupt = interrupt.clone();
            if let Some(solver) = &mut across.solver {
                solver.set_interrupt(interrupt);
            }
        }
    }

    pub(crate) fn strategy_state(&mut self) -> &mut StrategyState {
        self.solver.strategy_state()
    }

    /// As [`Solver::expect_uses`].
    pub(crate) fn expect_uses(&mut self, uses: f64) {
        self.solver.expect_uses(uses);
    }

    /// As [`Solver::set_positions`].
    pub(crate) fn set_positions(&mut self, positions: &[[f64; 3]]) {
        self.solver.set_positions(positions);
    }

    /// As [`Solver::factor_price`].
    pub(crate) fn factor_price(&self) -> Price {
        self.solver.factor_price()
    }

    /// What was done so far for solutions.
    pub(crate) fn counts(&self) -> Counts {
        self.solver.counts()
    }

    /// What was done since this was asked last for the part across.
    pub(crate) fn take_check_counts(&mut self) -> CheckCounts {
        std::mem::take(&mut self.counts)
    }

    /// As [`Solver::set_matrix`].
    pub(crate) fn set_matrix(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: &OffDiagonal,
    ) -> Result<(), SolveError> {
        // In planes and on lines, blocks are symmetric.
        if let (Some(across), OffDiagonal::Symmetric(off_diagonal)) =
            (&mut self.across, off_diagonal)
        {
            across.check(diagonal, off_diagonal, &mut self.counts)?;
        }
        self.solver.set_matrix(diagonal, for_solver(off_diagonal))
    }

    /// As [`Solver::solve_in_place`].
    pub(crate) fn solve_in_place(
        &mut self,
        rhs: &mut [f64],
        accuracy: f64,
    ) -> Result<(), SolveError> {
        self.solver.solve_in_place(rhs, accuracy)
    }
}

impl Across {
    /// Whether the part across is positive definite: because every diagonal entry
    /// dominates its row, or because there is a factor.
    fn check(
        &mut self,
        diagonal: &[[f64; 6]],
        off_diagonal: &[[f64; 6]],
        counts: &mut CheckCounts,
    ) -> Result<(), SolveError> {
        for (excess, block) in self.excess.iter_mut().zip(diagonal) {
            *excess = stiffness_along(&self.normal, block) * (1.0 - DOMINANT);
        }
        for (pair, block) in self.pairs.iter().zip(off_diagonal) {
            let entry = stiffness_along(&self.normal, block).abs();
            for block in pair {
                self.excess[*block as usize] -= entry;
            }
        }
        if self.excess.iter().all(|excess| *excess > 0.0) {
            return Ok(());
        }
        let solver = match &mut self.solver {
            Some(solver) => solver,
            empty => {
                counts.symbolic_factorizations += 1;
                let options = Options {
                    positions: Some(&self.positions[..]).filter(|all| !all.is_empty()),
                    threads: self.threads,
                    // Only a factor is sure.
                    strategy: Strategy::Double,
                    subspace: Subspace::Line(self.normal.into()),
                    ..Options::default()
                };
                let solver = empty.insert(Solver::analyze(self.n_blocks, &self.pairs, options)?);
                solver.set_interrupt(&self.interrupt);
                solver
            }
        };
        let before = solver.counts().factorizations;
        let done = solver.set_matrix(diagonal, off_diagonal);
        counts.factorizations += solver.counts().factorizations - before;
        done
    }
}

/// Blocks as the solver takes them.
pub(crate) fn for_solver(off_diagonal: &OffDiagonal) -> springs_solver::OffDiagonal<'_> {
    match off_diagonal {
        OffDiagonal::Symmetric(blocks) => springs_solver::OffDiagonal::Symmetric(blocks),
        OffDiagonal::General(blocks) => springs_solver::OffDiagonal::General(blocks),
    }
}

/// nᵀB n of a packed block.
fn stiffness_along(normal: &Vector3<f64>, block: &[f64; 6]) -> f64 {
    let terms = PACKED.iter().zip(block).map(|(&(row, column), entry)| {
        let twice = if row == column { 1.0 } else { 2.0 };
        twice * entry * normal[row] * normal[column]
    });
    terms.sum()
}
