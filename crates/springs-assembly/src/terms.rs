//! Emitters from kernels of single terms.

use crate::anchor_works::share_out;
use crate::{Emitter, Evaluation, Linearization, Nature, Numbering, Projection, StiffnessKind};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// An energy and a damping of N nodes: the kernel of a term, without indices.
///
/// `x` and `v` are those of its nodes, in m and m/s.
pub trait Term<const N: usize>: Send + Sync {
    /// V, in J.
    fn energy(&self, x: &[Vector3<f64>; N]) -> f64;

    /// −∂V/∂x of each node, in N.
    fn forces(&self, x: &[Vector3<f64>; N]) -> [Vector3<f64>; N];

    /// ∂²V/∂xᵢ∂xⱼ at (i, j), in N/m.
    fn hessian(&self, x: &[Vector3<f64>; N]) -> [[Matrix3<f64>; N]; N];

    /// The Hessian with its negative eigenvalues projected; that of the whole 3N × 3N
    /// matrix, unless the term knows better.
    fn projected_hessian(
        &self,
        x: &[Vector3<f64>; N],
        projection: Projection,
    ) -> [[Matrix3<f64>; N]; N] {
        project(self.hessian(x), projection)
    }

    /// A bound on the eigenvalues of the Hessian at any positions, in N/m; infinite
    /// if there is none.
    fn largest_stiffness(&self) -> f64;

    /// Whether there are damping forces.
    fn is_damped(&self) -> bool {
        false
    }

    /// Whether forces are parallel to where its nodes are apart, or to their
    /// velocities, so that motion in a plane or on a line stays there.
    fn is_central(&self) -> bool {
        false
    }

    /// The forces that depend on velocities, in N: those that damp.
    fn damping_forces(&self, _x: &[Vector3<f64>; N], _v: &[Vector3<f64>; N]) -> [Vector3<f64>; N] {
        [Vector3::zeros(); N]
    }

    /// −∂f/∂v of the damping forces, in N·s/m: symmetric, positive semidefinite.
    fn damping(&self, _x: &[Vector3<f64>; N], _v: &[Vector3<f64>; N]) -> [[Matrix3<f64>; N]; N] {
        [[Matrix3::zeros(); N]; N]
    }

    /// A bound on the eigenvalues of the damping matrix, in N·s/m.
    fn largest_damping(&self) -> f64 {
        0.0
    }
}

/// Terms of one kind as an emitter.
#[derive(Clone, Debug)]
pub struct Terms<const N: usize, T> {
    name: String,
    terms: Vec<T>,
    /// Nodes of the scene until they are numbered; then blocks.
    stencils: Vec<[u32; N]>,
    n_free: u32,
    /// Of the pairs of each stencil with a free block, one after the other.
    pairs: Vec<u32>,
}

impl<const N: usize, T: Term<N>> Terms<N, T> {
    /// Terms on nodes of a scene; `name` is their line in the energy ledger.
    pub fn new(name: &str, terms: impl IntoIterator<Item = ([usize; N], T)>) -> Self {
        let terms = terms.into_iter();
        let (stencils, terms) = terms
            .map(|(nodes, term)| (nodes.map(|node| node as u32), term))
            .unzip();
        Self {
            name: name.to_owned(),
            terms,
            stencils,
            n_free: 0,
            pairs: Vec::new(),
        }
    }

    fn is_free(&self, block: u32) -> bool {
        block < self.n_free
    }

    fn all(&self) -> impl Iterator<Item = (&T, &[u32; N])> {
        self.terms.iter().zip(&self.stencils)
    }

    /// Those with a free block.
    fn live(&self) -> impl Iterator<Item = (&T, &[u32; N])> {
        let is_live = |stencil: &[u32; N]| stencil.iter().any(|&block| self.is_free(block));
        self.all().filter(move |(_, stencil)| is_live(stencil))
    }

    fn of<V: Copy>(stencil: &[u32; N], values: &[V]) -> [V; N] {
        stencil.map(|block| values[block as usize])
    }

    /// Adds −h f·v of each fixed block of a stencil.
    fn add_works_of_fixed(
        &self,
        (stencil, forces): (&[u32; N], [Vector3<f64>; N]),
        h: f64,
        v: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        let fixed = stencil.iter().zip(forces);
        for (&block, force) in fixed.filter(|(block, _)| !self.is_free(**block)) {
            works[(block - self.n_free) as usize] -= h * force.dot(&v[block as usize]);
        }
    }

    /// `damping`·D + `stiffness`·H of a term.
    fn matrix(&self, term: &T, stencil: &[u32; N], at: &Evaluation<'_>) -> [[Matrix3<f64>; N]; N] {
        let (x, v) = (Self::of(stencil, at.x), Self::of(stencil, at.v));
        let mut free = [0; N];
        let mut n_free = 0;
        for &block in stencil.iter().filter(|&&block| self.is_free(block)) {
            free[n_free] = block;
            n_free += 1;
        }
        let projection = at.projection_at(&free[..n_free]);
        let mut matrix = if projection == Projection::None {
            term.hessian(&x)
        } else {
            term.projected_hessian(&x, projection)
        };
        for entry in matrix.as_flattened_mut() {
            *entry *= at.weights.stiffness;
        }
        if term.is_damped() {
            let damping = term.damping(&x, &v);
            let damping = damping.as_flattened();
            for (entry, damping) in matrix.as_flattened_mut().iter_mut().zip(damping) {
                *entry += damping * at.weights.damping;
            }
        }
        matrix
    }
}

/// Replaces the negative eigenvalues of a symmetric matrix of N × N blocks.
fn project<const N: usize>(
    hessian: [[Matrix3<f64>; N]; N],
    projection: Projection,
) -> [[Matrix3<f64>; N]; N] {
    let whole = DMatrix::from_fn(3 * N, 3 * N, |row, column| {
        hessian[row / 3][column / 3][(row % 3, column % 3)]
    });
    let mut eigen = whole.symmetric_eigen();
    for value in eigen.eigenvalues.iter_mut() {
        *value = match projection {
            Projection::None => *value,
            Projection::Clamp | Projection::Drop => value.max(0.0),
            Projection::Absolute => value.abs(),
        };
    }
    let whole = eigen.recompose();
    std::array::from_fn(|row| {
        std::array::from_fn(|column| whole.fixed_view::<3, 3>(3 * row, 3 * column).into_owned())
    })
}

impl<const N: usize, T: Term<N>> Emitter for Terms<N, T> {
    fn name(&self) -> &str {
        &self.name
    }

    fn nature(&self) -> Nature {
        Nature {
            n_terms: self.terms.len(),
            n_merged: 0,
            stiffness: if self
                .terms
                .iter()
                .all(|term| term.largest_stiffness() == 0.0)
            {
                StiffnessKind::None
            } else {
                StiffnessKind::Variable
            },
            is_constant: false,
            is_load: false,
            is_damped: self.terms.iter().any(Term::is_damped),
            is_central: self.terms.iter().all(Term::is_central),
            has_symmetric_blocks: N == 1,
        }
    }

    fn number(&mut self, numbering: &Numbering) {
        self.n_free = numbering.n_free() as u32;
        for block in self.stencils.as_flattened_mut() {
            *block = numbering.block(*block as usize) as u32;
        }
    }

    fn each_stencil(&self, visit: &mut dyn FnMut(&[u32])) {
        self.live().for_each(|(_, stencil)| visit(stencil));
    }

    fn place(&mut self, pairs: &[u32]) {
        self.pairs = pairs.to_vec();
    }

    fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        let energies = self.all();
        energies
            .map(|(term, stencil)| term.energy(&Self::of(stencil, x)))
            .sum()
    }

    fn energy_on_free_blocks(&self, x: &[Vector3<f64>]) -> f64 {
        let energies = self.live();
        energies
            .map(|(term, stencil)| term.energy(&Self::of(stencil, x)))
            .sum()
    }

    fn add_forces(&self, x: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        for (term, stencil) in self.live() {
            let added = term.forces(&Self::of(stencil, x));
            for (&block, force) in stencil.iter().zip(added) {
                if self.is_free(block) {
                    forces[block as usize] += force;
                }
            }
        }
    }

    fn add_damping_forces(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) {
        for (term, stencil) in self.live().filter(|(term, _)| term.is_damped()) {
            let added = term.damping_forces(&Self::of(stencil, x), &Self::of(stencil, v));
            for (&block, force) in stencil.iter().zip(added) {
                if self.is_free(block) {
                    forces[block as usize] += force;
                }
            }
        }
    }

    fn add_damping_reactions(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        reactions: &mut [Vector3<f64>],
    ) {
        for (term, stencil) in self.live().filter(|(term, _)| term.is_damped()) {
            let added = term.damping_forces(&Self::of(stencil, x), &Self::of(stencil, v));
            for (&block, force) in stencil.iter().zip(added) {
                if !self.is_free(block) {
                    reactions[(block - self.n_free) as usize] += force;
                }
            }
        }
    }

    fn add_forces_on_all(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        _n_free: usize,
        _carried: Option<&[f64]>,
        forces: &mut [Vector3<f64>],
    ) {
        for (term, stencil) in self.all() {
            let x = Self::of(stencil, x);
            let mut add = |added: [Vector3<f64>; N]| {
                for (&block, force) in stencil.iter().zip(added) {
                    forces[block as usize] += force;
                }
            };
            add(term.forces(&x));
            if term.is_damped() {
                add(term.damping_forces(&x, &Self::of(stencil, v)));
            }
        }
    }

    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization) {
        self.add_forces(at.x, &mut out.forces);
        let mut pairs = self.pairs.iter();
        for (term, stencil) in self.live() {
            let matrix = self.matrix(term, stencil, at);
            for (i, &row) in stencil.iter().enumerate() {
                if !self.is_free(row) {
                    continue;
                }
                out.matrix.add_diagonal(row, &matrix[i][i]);
                for (j, &column) in stencil.iter().enumerate() {
                    if !self.is_free(column) {
                        let load = matrix[i][j] * at.v[column as usize];
                        out.anchor_load[row as usize] -= load;
                    } else if j > i {
                        let pair = *pairs.next().expect("a place for every pair");
                        out.matrix.add_off_diagonal(pair, row, &matrix[i][j]);
                    }
                }
            }
        }
    }

    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]) {
        for (term, stencil) in self.live() {
            let matrix = self.matrix(term, stencil, at);
            for (i, &row) in stencil.iter().enumerate() {
                for (j, &column) in stencil.iter().enumerate() {
                    if self.is_free(row) && self.is_free(column) {
                        products[row as usize] += matrix[i][j] * y[column as usize];
                    }
                }
            }
        }
    }

    fn add_stiffness_bounds(&self, bounds: &mut [f64]) {
        for (term, stencil) in self.live() {
            for &block in stencil.iter().filter(|&&block| self.is_free(block)) {
                bounds[block as usize] += 0.5 * term.largest_stiffness();
            }
        }
    }

    fn add_damping_bounds(&self, bounds: &mut [f64]) {
        for (term, stencil) in self.live() {
            for &block in stencil.iter().filter(|&&block| self.is_free(block)) {
                bounds[block as usize] += 0.5 * term.largest_damping();
            }
        }
    }

    fn dissipation(&self, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> f64 {
        let damped = self.live().filter(|(term, _)| term.is_damped());
        let heat = |(term, stencil): (&T, &[u32; N])| -> f64 {
            let v = Self::of(stencil, v);
            let forces = term.damping_forces(&Self::of(stencil, x), &v);
            -forces.iter().zip(&v).map(|(f, v)| f.dot(v)).sum::<f64>()
        };
        damped.map(heat).sum()
    }

    fn add_anchor_works(&self, h: f64, x: &[Vector3<f64>], v: &[Vector3<f64>], works: &mut [f64]) {
        for (term, stencil) in self.live() {
            let forces = term.forces(&Self::of(stencil, x));
            self.add_works_of_fixed((stencil, forces), h, v, works);
        }
    }

    fn add_damping_anchor_works(
        &self,
        h: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        works: &mut [f64],
    ) {
        for (term, stencil) in self.live().filter(|(term, _)| term.is_damped()) {
            let forces = term.damping_forces(&Self::of(stencil, x), &Self::of(stencil, v));
            self.add_works_of_fixed((stencil, forces), h, v, works);
        }
    }

    fn add_anchor_work_changes(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], works: &mut [f64]) {
        for (term, stencil) in self.live() {
            let hessian = term.hessian(&Self::of(stencil, at.x));
            let forces = hessian.map(|row| {
                let products = row.iter().zip(stencil);
                let sum: Vector3<f64> = products.map(|(h, &block)| h * y[block as usize]).sum();
                -sum
            });
            let weight = at.weights.stiffness;
            self.add_works_of_fixed((stencil, forces), weight, at.v, works);
        }
    }

    /// Of terms on fixed blocks alone, the work is the change of their energy.
    fn add_works_between_fixed(
        &self,
        start: &[Vector3<f64>],
        end: &[Vector3<f64>],
        _h: f64,
        works: &mut [f64],
    ) -> f64 {
        let is_between = |(_, stencil): &(&T, &[u32; N])| {
            let is_fixed = stencil.iter().all(|&block| !self.is_free(block));
            is_fixed && Self::of(stencil, start) != Self::of(stencil, end)
        };
        for (term, stencil) in self.all().filter(is_between) {
            let (start, end) = (Self::of(stencil, start), Self::of(stencil, end));
            let ways = std::array::from_fn(|node| end[node] - start[node]);
            let at = |place: f64| std::array::from_fn(|node| start[node].lerp(&end[node], place));
            let work = term.energy(&end) - term.energy(&start);
            let shares = share_out(work, ways, |place| term.forces(&at(place)));
            for (&block, share) in stencil.iter().zip(shares) {
                works[(block - self.n_free) as usize] += share;
            }
        }
        0.0
    }
}
