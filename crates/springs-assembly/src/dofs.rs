//! Degrees of freedom: which node is which block of the global vectors.

use nalgebra::Vector3;
use std::ops::Range;

/// The order of the global vectors: free nodes first, then fixed ones, each in
/// the order of the scene.
#[derive(Clone, Debug)]
pub struct Numbering {
    node_of_block: Vec<u32>,
    block_of_node: Vec<u32>,
    /// Blocks in order whose nodes follow one another, too: the first node of each.
    stretches: Vec<(Range<usize>, usize)>,
    n_free: usize,
}

impl Numbering {
    /// Numbers the nodes for which `fixed` says whether they are fixed.
    pub(crate) fn new(fixed: impl Iterator<Item = bool> + Clone) -> Self {
        let nodes = |wanted: bool| {
            (0u32..)
                .zip(fixed.clone())
                .filter_map(move |(node, fixed)| (fixed == wanted).then_some(node))
        };
        let node_of_block: Vec<u32> = nodes(false).chain(nodes(true)).collect();
        let n_free = nodes(false).count();
        let mut block_of_node = vec![0; node_of_block.len()];
        for (block, &node) in (0u32..).zip(&node_of_block) {
            block_of_node[node as usize] = block;
        }
        let mut stretches: Vec<(Range<usize>, usize)> = Vec::new();
        for (block, &node) in node_of_block.iter().enumerate() {
            let node = node as usize;
            match stretches.last_mut() {
                Some((blocks, first)) if *first + blocks.len() == node => blocks.end += 1,
                _ => stretches.push((block..block + 1, node)),
            }
        }
        Self {
            node_of_block,
            block_of_node,
            stretches,
            n_free,
        }
    }

    /// Number of nodes, which is the number of blocks.
    pub fn n_nodes(&self) -> usize {
        self.node_of_block.len()
    }

    /// Number of free nodes; their blocks are `0..n_free`.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// Whether a block is that of a fixed node.
    pub fn is_fixed(&self, block: u32) -> bool {
        block as usize >= self.n_free
    }

    /// Scene index of the node that is block `block`.
    ///
    /// # Panics
    ///
    /// If there is no such block.
    pub fn node(&self, block: usize) -> usize {
        self.node_of_block[block] as usize
    }

    /// Block of the node with scene index `node`.
    ///
    /// # Panics
    ///
    /// If there is no such node.
    pub fn block(&self, node: usize) -> usize {
        self.block_of_node[node] as usize
    }

    /// From the nodes to the global vector.
    ///
    /// # Panics
    ///
    /// If a slice does not have one entry per node.
    pub fn gather(&self, nodes: &[Vector3<f64>], blocks: &mut [Vector3<f64>]) {
        assert_eq!(nodes.len(), self.n_nodes(), "one entry per node");
        assert_eq!(blocks.len(), self.n_nodes(), "one entry per node");
        for (range, first) in &self.stretches {
            let nodes = &nodes[*first..first + range.len()];
            blocks[range.clone()].copy_from_slice(nodes);
        }
    }

    /// From the global vector back to the nodes.
    ///
    /// # Panics
    ///
    /// If a slice does not have one entry per node.
    pub fn scatter(&self, blocks: &[Vector3<f64>], nodes: &mut [Vector3<f64>]) {
        assert_eq!(nodes.len(), self.n_nodes(), "one entry per node");
        assert_eq!(blocks.len(), self.n_nodes(), "one entry per node");
        for (range, first) in &self.stretches {
            let nodes = &mut nodes[*first..first + range.len()];
            nodes.copy_from_slice(&blocks[range.clone()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_nodes_come_first_and_scatter_undoes_gather() {
        let numbering = Numbering::new([true, false, false, true, false].into_iter());
        assert_eq!(numbering.n_free(), 3);
        let order: Vec<usize> = (0..5).map(|block| numbering.node(block)).collect();
        assert_eq!(order, [1, 2, 4, 0, 3]);
        assert!((0..5).all(|node| numbering.node(numbering.block(node)) == node));

        let nodes: Vec<_> = (0..5).map(|k| Vector3::repeat(k as f64)).collect();
        let mut blocks = vec![Vector3::zeros(); 5];
        numbering.gather(&nodes, &mut blocks);
        assert_eq!(blocks[3].x, 0.0);
        assert_eq!(blocks[2].x, 4.0);
        let mut back = vec![Vector3::zeros(); 5];
        numbering.scatter(&blocks, &mut back);
        assert_eq!(back, nodes);
    }
}
