//! Minimum-degree ordering.

use super::graph::UpperGraph;
use crate::SolveError;
use dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// The block that is eliminated k-th, for each k: one with the fewest neighbours
/// then, nearly (Amestoy, Davis and Duff, SIAM J. Matrix Anal. 17, 1996).
pub(crate) fn minimum_degree(
    n_blocks: usize,
    pairs: &[[u32; 2]],
) -> Result<Vec<usize>, SolveError> {
    let natural: Vec<usize> = (0..n_blocks).collect();
    let graph = UpperGraph::new(&natural, pairs)?;
    let too_large = SolveError::TooLarge { n_blocks };
    let mut order = vec![0usize; n_blocks];
    let mut position = vec![0usize; n_blocks];
    let scratch = amd::order_scratch::<usize>(n_blocks, graph.rows.len());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large)?;
    // The ordering reads parts of its workspace before it writes them.
    memory.fill(std::mem::MaybeUninit::new(0));
    let pattern = SymbolicSparseColMatRef::new_checked(
        n_blocks,
        n_blocks,
        &graph.column_starts,
        None,
        &graph.rows,
    );
    amd::order(
        &mut order,
        &mut position,
        pattern,
        amd::Control::default(),
        MemStack::new(&mut memory),
    )
    .map_err(|_| too_large)?;
    Ok(order)
}
