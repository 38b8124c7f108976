//! The balance of forces of a system at the time 0.

use crate::Options;
use nalgebra::{Matrix3, Vector3};
use springs_assembly::{
    Evaluation, Linearization, OffDiagonal, PACKED, Projection, System, Weights,
};
use springs_solver::{Indefinite, Packing, SolveError, Solver};

/// Forces may be left up to this part of the largest one.
const BALANCED: f64 = 1e-10;
/// What rounding of coordinates makes of lengths, in units of rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Forces, energy and stiffness of a system with its loads times a factor.
pub(crate) struct Equations<'a> {
    pub(crate) system: &'a System,
    /// Of the loads.
    pub(crate) factor: f64,
    /// At the time 0, in N.
    loads: Vec<Vector3<f64>>,
    /// Guided blocks, and what projects onto the directions that they are held in.
    across: Vec<(usize, Matrix3<f64>)>,
    at_rest: Vec<Vector3<f64>>,
    out: Linearization,
    /// Diagonal blocks of the stiffness, positive across guides.
    diagonal: Vec<[f64; 6]>,
    /// What is stiff at each block, in N/m; above zero.
    scales: Vec<f64>,
    /// What may be stiff at each block, in N/m, where springs are slack now; zero where
    /// there is no bound.
    bounds: Vec<f64>,
}

/// Energy in J, and what rounding may make of it.
#[derive(Clone, Copy)]
pub(crate) struct Potential {
    pub(crate) energy: f64,
    pub(crate) rounding: f64,
}

/// Zero for what is infinite.
fn finite(bounds: Vec<f64>) -> Vec<f64> {
    let finite = |bound: f64| if bound.is_finite() { bound } else { 0.0 };
    bounds.into_iter().map(finite).collect()
}

impl<'a> Equations<'a> {
    pub(crate) fn new(system: &'a System) -> Self {
        let n_free = system.n_free();
        let mut loads = vec![Vector3::zeros(); n_free];
        system.add_loads(0.0, &mut loads);
        Self {
            factor: 1.0,
            loads,
            across: across_guides(system),
            at_rest: vec![Vector3::zeros(); system.numbering().n_nodes()],
            out: system.linearization(),
            diagonal: vec![[0.0; 6]; n_free],
            scales: vec![1.0; n_free],
            bounds: finite(system.stiffness_bounds()),
            system,
        }
    }

    pub(crate) fn n_free(&self) -> usize {
        self.loads.len()
    }

    /// The loads of factor 1, in N.
    pub(crate) fn loads(&self) -> &[Vector3<f64>] {
        &self.loads
    }

    /// Forces on the free blocks, in N.
    pub(crate) fn forces(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); self.n_free()];
        self.system.static_forces(x, &mut forces);
        for (force, load) in forces.iter_mut().zip(&self.loads) {
            *force += load * self.factor;
        }
        forces
    }

    pub(crate) fn potential(&self, x: &[Vector3<f64>]) -> Potential {
        let mut lines = self.system.potential_on_free_blocks(x);
        let (mut energy, mut size) = (0.0, 0.0);
        for line in lines.iter_mut() {
            energy += *line;
            size += line.abs();
        }
        for (load, x) in self.loads.iter().zip(x) {
            let work = self.factor * load.dot(x);
            energy -= work;
            size += work.abs();
        }
        Potential {
            energy,
            rounding: ROUNDING * size,
        }
    }

    /// Takes the stiffness at `x`, with carried tensions in place of the present ones.
    pub(crate) fn linearize(
        &mut self,
        x: &[Vector3<f64>],
        carried: Option<&[f64]>,
        projection: Projection,
    ) {
        let at = Evaluation {
            projection,
            carried,
            ..Evaluation::new(x, &self.at_rest, Weights::STIFFNESS)
        };
        self.system.linearize(&at, &mut self.out);
        self.diagonal.copy_from_slice(self.out.matrix.diagonal());
        for (scale, block) in self.scales.iter_mut().zip(&self.diagonal) {
            *scale = largest_entry(block);
        }
        for (block, across) in &self.across {
            let along = Matrix3::identity() - across;
            let free = along * unpacked(&self.diagonal[*block]) * along;
            self.scales[*block] = free.amax();
        }
        for (scale, bound) in self.scales.iter_mut().zip(&self.bounds) {
            *scale = scale.max(*bound);
        }
        let largest = self.scales.iter().copied().fold(0.0, f64::max);
        let least = if largest > 0.0 { 1e-9 * largest } else { 1.0 };
        for scale in &mut self.scales {
            *scale = scale.max(least);
        }
        for (block, across) in &self.across {
            add(&mut self.diagonal[*block], &(across * self.scales[*block]));
        }
    }

    /// What is stiff at each block, in N/m.
    pub(crate) fn scales(&self) -> &[f64] {
        &self.scales
    }

    pub(crate) fn diagonal(&self) -> &[[f64; 6]] {
        &self.diagonal
    }

    pub(crate) fn off_diagonal(&self) -> springs_solver::OffDiagonal<'_> {
        match self.out.matrix.off_diagonal() {
            OffDiagonal::Symmetric(blocks) => blocks.into(),
            OffDiagonal::General(blocks) => blocks.into(),
        }
    }

    /// The diagonal with a multiple of the identity added to each block: `of_block` times
    /// the part along guides.
    pub(crate) fn shifted_diagonal(&self, of_block: impl Fn(usize) -> f64) -> Vec<[f64; 6]> {
        let mut diagonal = self.diagonal.clone();
        for (block, packed) in diagonal.iter_mut().enumerate() {
            add(packed, &(Matrix3::identity() * of_block(block)));
        }
        for (block, across) in &self.across {
            add(&mut diagonal[*block], &(across * -of_block(*block)));
        }
        diagonal
    }

    /// K y on the free blocks, in N, at the last linearization.
    pub(crate) fn product(&self, y: &[Vector3<f64>], product: &mut [Vector3<f64>]) {
        self.out.matrix.multiply(y, product);
    }

    pub(crate) fn project(&self, vectors: &mut [Vector3<f64>]) {
        for (block, across) in &self.across {
            let vector = &mut vectors[*block];
            *vector -= across * *vector;
        }
    }

    /// The largest tension of a spring or force from outside, in N.
    pub(crate) fn largest_force(&self, x: &[Vector3<f64>]) -> f64 {
        let mut largest = self.loads.iter().fold(0.0f64, |largest, load| {
            largest.max((load * self.factor).amax())
        });
        self.system.each_tension(x, None, &mut |_, tension| {
            largest = largest.max(tension.abs());
        });
        largest
    }

    /// Whether forces on all blocks are balanced: up to a part of the largest force and what
    /// rounding of coordinates makes of the stiffness there.
    pub(crate) fn is_balanced(&self, x: &[Vector3<f64>], forces: &[Vector3<f64>]) -> bool {
        let least = BALANCED * self.largest_force(x);
        let rounding = ROUNDING * self.system.largest_coordinate(x);
        let mut blocks = forces.iter().zip(&self.scales);
        blocks.all(|(force, scale)| {
            let limit = least.max(rounding * scale);
            // What is not a number is not balanced.
            force.iter().all(|force| force.abs() <= limit)
        })
    }

    /// A solver of systems with this pattern whose matrix is positive definite.
    pub(crate) fn solver(&self, options: &Options) -> Result<Solver, SolveError> {
        let mut solver = self.analyzed(options.threads.max(1))?;
        solver.set_interrupt(&options.interrupt);
        Ok(solver)
    }

    fn analyzed(&self, threads: usize) -> Result<Solver, SolveError> {
        let options = springs_solver::Options {
            positions: Some(self.positions()),
            threads,
            packing: if self.system.has_symmetric_blocks() {
                Packing::Symmetric
            } else {
                Packing::General
            },
            ..Default::default()
        };
        Solver::analyze(self.n_free(), self.system.pattern().pairs(), options)
    }

    /// The same where it may be anything.
    pub(crate) fn indefinite_solver(&self, options: &Options) -> Result<Indefinite, SolveError> {
        let (pairs, positions) = (self.system.pattern().pairs(), self.positions());
        let mut solver = Indefinite::analyze(self.n_free(), pairs, Some(positions))?;
        solver.set_interrupt(&options.interrupt);
        // Slack cables have none of the stiffness that they may have.
        solver.set_sizes(&self.bounds);
        Ok(solver)
    }

    fn positions(&self) -> &[[f64; 3]] {
        bytemuck::cast_slice(&self.system.initial_positions()[..self.n_free()])
    }
}

/// Guided blocks, and what projects onto the directions across their guides.
fn across_guides(system: &System) -> Vec<(usize, Matrix3<f64>)> {
    let mut across: Vec<_> = system
        .guided()
        .map(|block| (block, Matrix3::identity()))
        .collect();
    for axis in 0..3 {
        let mut units = vec![Vector3::ith(axis, 1.0); system.n_free()];
        system.project_onto_guides(&mut units);
        for (block, across) in &mut across {
            let mut column = across.column_mut(axis);
            column -= units[*block];
        }
    }
    across
}

fn largest_entry(block: &[f64; 6]) -> f64 {
    block.iter().fold(0.0, |most, entry| most.max(entry.abs()))
}

pub(crate) fn unpacked(packed: &[f64; 6]) -> Matrix3<f64> {
    let mut whole = Matrix3::zeros();
    for (&(row, column), value) in PACKED.iter().zip(packed) {
        whole[(row, column)] = *value;
        whole[(column, row)] = *value;
    }
    whole
}

fn add(packed: &mut [f64; 6], block: &Matrix3<f64>) {
    for (value, &entry) in packed.iter_mut().zip(&PACKED) {
        *value += block[entry];
    }
}

/// What blocks have, by the nodes of the scene.
pub(crate) fn in_node_order(system: &System, blocks: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut nodes = vec![Vector3::zeros(); blocks.len()];
    system.numbering().scatter(blocks, &mut nodes);
    nodes
}

/// Vectors as plain numbers.
pub(crate) fn numbers_mut(vectors: &mut [Vector3<f64>]) -> &mut [f64] {
    bytemuck::cast_slice_mut(vectors)
}

/// Plain numbers as vectors.
pub(crate) fn vectors(numbers: &[f64]) -> &[Vector3<f64>] {
    bytemuck::cast_slice(numbers)
}

/// Where the largest component is, and its magnitude; what is not a number is largest.
pub(crate) fn largest(vectors: &[Vector3<f64>]) -> (usize, f64) {
    let sizes = vectors.iter().map(|vector| {
        let is_number = vector.iter().all(|x| !x.is_nan());
        if is_number { vector.amax() } else { f64::NAN }
    });
    let largest = sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    largest.unwrap_or((0, 0.0))
}
