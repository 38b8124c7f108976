//! Connected parts of a matrix.

use crate::implicit::checked_solver::{CheckCounts, CheckedSolver};
use crate::implicit::solver_options::{Hessian, Steps, solver_options};
use crate::vectors::numbers_mut;
use nalgebra::Vector3;
use springs_assembly::{BlockMatrix, OffDiagonal, System};
use springs_solver::{Interrupt, SolveError, StrategyState};

/// The connected parts of the unknowns of a system, and which of them have a
/// matrix that is not positive definite.
pub(crate) struct Components {
    hessian: Hessian,
    /// Which one each block belongs to.
    of_block: Vec<u32>,
    n: usize,
    /// Made when a matrix is first found to be indefinite; not where there is one
    /// part only.
    members: Vec<Member>,
    is_indefinite: Vec<bool>,
    threads: usize,
    interrupt: Interrupt,
}

/// A part with a solver of its own.
struct Member {
    blocks: Vec<u32>,
    pairs: Vec<u32>,
    solver: CheckedSolver,
    positions: Vec<[f64; 3]>,
    diagonal: Vec<[f64; 6]>,
    off_diagonal: OffDiagonal,
    x: Vec<Vector3<f64>>,
}

impl Components {
    pub(crate) fn new(system: &System, hessian: Hessian, threads: usize) -> Self {
        // Roots are the smallest blocks of their trees.
        let mut parents: Vec<u32> = (0..system.n_free() as u32).collect();
        for &[a, b] in system.pattern().pairs() {
            let (a, b) = (root(&mut parents, a), root(&mut parents, b));
            parents[a.max(b) as usize] = a.min(b);
        }
        let mut n = 0;
        let mut of_block = vec![0; parents.len()];
        for block in 0..parents.len() as u32 {
            let root = root(&mut parents, block);
            of_block[block as usize] = if root == block {
                n += 1;
                n - 1
            } else {
                of_block[root as usize]
            };
        }
        Self {
            hessian,
            of_block,
            n: n as usize,
            members: Vec::new(),
            is_indefinite: vec![false; n as usize],
            threads,
            interrupt: Interrupt::default(),
        }
    }

    pub(crate) fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
        for member in &mut self.members {
            member.solver.set_interrupt(interrupt);
        }
    }

    /// Whether there is one part at most.
    pub(crate) fn is_one(&self) -> bool {
        self.n <= 1
    }

    /// Finds out which parts of `matrix` are not positive definite, each as if it
    /// were alone, and counts what that takes. The matrix, at positions `x`, failed as a
    /// whole at `failed`, with this right-hand side.
    pub(crate) fn judge(
        &mut self,
        system: &System,
        x: &[Vector3<f64>],
        matrix: &BlockMatrix,
        (rhs, accuracy): (&[Vector3<f64>], f64),
        failed: usize,
        counts: &mut CheckCounts,
    ) -> Result<(), SolveError> {
        if self.members.is_empty() {
            self.members = self.split(system)?;
            counts.symbolic_factorizations += self.n as u64;
        }
        for (member, is_indefinite) in self.members.iter_mut().zip(&mut self.is_indefinite) {
            *is_indefinite = match member.solve(x, matrix, rhs, accuracy, counts) {
                Ok(()) => false,
                Err(SolveError::NotPositiveDefinite { .. }) => true,
                Err(error) => return Err(error),
            };
        }
        // Rounding may decide otherwise within the whole.
        if !self.is_indefinite.contains(&true) {
            self.is_indefinite[self.of_block[failed] as usize] = true;
        }
        Ok(())
    }

    /// Whether the part of a block was found not to be positive definite.
    pub(crate) fn is_indefinite_at(&self, block: usize) -> bool {
        self.is_indefinite[self.of_block[block] as usize]
    }

    fn split(&self, system: &System) -> Result<Vec<Member>, SolveError> {
        let mut blocks: Vec<Vec<u32>> = vec![Vec::new(); self.n];
        let mut local = vec![0; self.of_block.len()];
        for (block, &component) in self.of_block.iter().enumerate() {
            let blocks = &mut blocks[component as usize];
            local[block] = blocks.len() as u32;
            blocks.push(block as u32);
        }
        let mut pairs: Vec<Vec<u32>> = vec![Vec::new(); self.n];
        for (index, &[a, _]) in system.pattern().pairs().iter().enumerate() {
            pairs[self.of_block[a as usize] as usize].push(index as u32);
        }
        let all_pairs = system.pattern().pairs();
        let parts = blocks.into_iter().zip(pairs).map(|(blocks, pairs)| {
            let ends = pairs.iter().map(|&pair| all_pairs[pair as usize]);
            let ends: Vec<[u32; 2]> = ends.map(|ends| ends.map(|b| local[b as usize])).collect();
            let positions = blocks
                .iter()
                .map(|&b| system.initial_positions()[b as usize]);
            let positions: Vec<[f64; 3]> = positions.map(Into::into).collect();
            let (hessian, steps) = (self.hessian, Steps::Changing);
            let (options, normal) =
                solver_options(system, hessian, steps, &positions, self.threads);
            let mut solver = CheckedSolver::analyze(blocks.len(), &ends, options, normal)?;
            solver.set_interrupt(&self.interrupt);
            Ok(Member {
                solver,
                positions,
                diagonal: vec![[0.0; 6]; blocks.len()],
                off_diagonal: OffDiagonal::zeros(pairs.len(), system.has_symmetric_blocks()),
                x: vec![Vector3::zeros(); blocks.len()],
                blocks,
                pairs,
            })
        });
        parts.collect()
    }
}

impl Member {
    fn solve(
        &mut self,
        positions: &[Vector3<f64>],
        matrix: &BlockMatrix,
        rhs: &[Vector3<f64>],
        accuracy: f64,
        counts: &mut CheckCounts,
    ) -> Result<(), SolveError> {
        for (at, &block) in self.blocks.iter().enumerate() {
            let block = block as usize;
            self.positions[at] = positions[block].into();
            self.diagonal[at] = matrix.diagonal()[block];
            self.x[at] = rhs[block];
        }
        self.off_diagonal.take(matrix.off_diagonal(), &self.pairs);
        // The same matrix is judged the same way, whatever came before.
        *self.solver.strategy_state() = StrategyState::default();
        let before = self.solver.counts().factorizations;
        self.solver.set_positions(&self.positions);
        let set = self.solver.set_matrix(&self.diagonal, &self.off_diagonal);
        let done = set.and_then(|()| {
            self.solver
                .solve_in_place(numbers_mut(&mut self.x), accuracy)
        });
        let check = self.solver.take_check_counts();
        counts.symbolic_factorizations += check.symbolic_factorizations;
        counts.factorizations +=
            check.factorizations + self.solver.counts().factorizations - before;
        done
    }
}

/// The smallest block that a block is connected with as far as is known, with
/// shorter ways from now on.
fn root(parents: &mut [u32], mut block: u32) -> u32 {
    while parents[block as usize] != block {
        let next = parents[parents[block as usize] as usize];
        parents[block as usize] = next;
        block = next;
    }
    block
}
