//! Elimination orders and their trees.

use super::dissection::nested_dissection;
use super::graph::UpperGraph;
use super::minimum_degree::minimum_degree;
use crate::{FactorSize, SolveError};

/// No parent.
pub(crate) const NONE: u32 = u32::MAX;

/// An elimination order with its tree, children before parents and subtrees
/// contiguous.
pub(crate) struct Elimination {
    /// Block of the caller that is eliminated k-th.
    pub(crate) order: Vec<usize>,
    pub(crate) graph: UpperGraph,
    pub(crate) parents: Vec<u32>,
    /// Blocks in each column of the factor, the diagonal included.
    pub(crate) counts: Vec<usize>,
}

impl Elimination {
    /// Sorts an order such that subtrees are contiguous, which changes nothing
    /// in the factor.
    pub(crate) fn new(order: &[usize], pairs: &[[u32; 2]]) -> Result<Self, SolveError> {
        let graph = UpperGraph::new(&inverse(order), pairs)?;
        let parents = elimination_tree(&graph);
        let sorted = postorder(&parents);
        let order: Vec<usize> = sorted.iter().map(|&k| order[k]).collect();
        let graph = UpperGraph::new(&inverse(&order), pairs)?;
        let parents = elimination_tree(&graph);
        let counts = graph.column_counts()?;
        Ok(Self {
            order,
            graph,
            parents,
            counts,
        })
    }

    /// Of the factor, with blocks of the given dimension.
    pub(crate) fn size(&self, dimension: usize) -> FactorSize {
        let mut size = FactorSize::default();
        for &blocks in &self.counts {
            size.add(dimension, 1, blocks);
        }
        size
    }
}

/// Parent of each column (Liu, ACM TOMS 12, 1986).
fn elimination_tree(graph: &UpperGraph) -> Vec<u32> {
    let n = graph.n_blocks();
    let (mut parents, mut ancestors) = (vec![NONE; n], vec![NONE; n]);
    for column in 0..n {
        for &row in &graph.rows[graph.column(column)] {
            let mut at = row;
            loop {
                let above = ancestors[at];
                if above == column as u32 {
                    break;
                }
                ancestors[at] = column as u32;
                if above == NONE {
                    parents[at] = column as u32;
                    break;
                }
                at = above as usize;
            }
        }
    }
    parents
}

/// Columns such that children stand before parents and subtrees are contiguous.
fn postorder(parents: &[u32]) -> Vec<usize> {
    let n = parents.len();
    // Lists of children, smallest first.
    let (mut first, mut next) = (vec![NONE; n], vec![NONE; n]);
    let mut roots = Vec::new();
    for node in (0..n).rev() {
        match parents[node] {
            NONE => roots.push(node),
            parent => {
                next[node] = first[parent as usize];
                first[parent as usize] = node as u32;
            }
        }
    }
    let mut order = Vec::with_capacity(n);
    let mut stack = roots;
    while let Some(&node) = stack.last() {
        match first[node] {
            NONE => {
                order.push(node);
                stack.pop();
            }
            child => {
                first[node] = next[child as usize];
                stack.push(child as usize);
            }
        }
    }
    order
}

fn inverse(order: &[usize]) -> Vec<usize> {
    let mut position = vec![0; order.len()];
    for (k, &block) in order.iter().enumerate() {
        position[block] = k;
    }
    position
}

/// Factorizations below this many operations are not worth a second order.
const WORTH_DISSECTION: f64 = 1e7;

/// The order that takes the fewest operations.
pub(crate) fn best_elimination(
    n_blocks: usize,
    pairs: &[[u32; 2]],
    positions: Option<&[[f64; 3]]>,
) -> Result<Elimination, SolveError> {
    let minimum = Elimination::new(&minimum_degree(n_blocks, pairs)?, pairs)?;
    let Some(positions) = positions.filter(|_| minimum.size(3).flops > WORTH_DISSECTION) else {
        return Ok(minimum);
    };
    assert_eq!(positions.len(), n_blocks, "one position per block");
    let dissected = Elimination::new(&nested_dissection(pairs, positions)?, pairs)?;
    if dissected.size(3).flops < minimum.size(3).flops {
        Ok(dissected)
    } else {
        Ok(minimum)
    }
}

/// The blocks in the order in which factors eliminate them: minimum degree or, with
/// positions, nested dissection, whichever takes fewer operations. Subtrees of the
/// elimination tree are contiguous, as supernodal factorizations by others need it.
///
/// # Errors
///
/// As [`Solver::analyze`](crate::Solver::analyze).
///
/// # Panics
///
/// If there are positions, but not one per block.
pub fn elimination_order(
    n_blocks: usize,
    pairs: &[[u32; 2]],
    positions: Option<&[[f64; 3]]>,
) -> Result<Vec<usize>, SolveError> {
    Ok(best_elimination(n_blocks, pairs, positions)?.order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subtrees_are_contiguous_after_sorting() {
        // A tree: 0-2, 1-3, 2-4, 3-4.
        let parents = [2, 3, 4, 4, NONE];
        assert_eq!(postorder(&parents), [0, 2, 1, 3, 4]);
    }

    #[test]
    fn the_size_of_the_factor_is_counted() {
        // A chain: each of the columns but the last has two blocks.
        let pairs: Vec<[u32; 2]> = (1..10).map(|block| [block - 1, block]).collect();
        let size = best_elimination(10, &pairs, None).unwrap().size(3);
        assert_eq!(size.flops, 9.0 * 3.0 * 36.0 + 3.0 * 9.0);
        assert_eq!(size.entries, 9.0 * 18.0 + 9.0);
    }
}
