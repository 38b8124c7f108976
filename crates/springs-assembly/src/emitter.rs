//! Emitters: what gives energy, force and force gradient.

use crate::{Linearization, Numbering};
use nalgebra::Vector3;
use springs_math::dashpot::Fading;
use springs_math::spring::Spring;

/// A batch of terms of one kind: the only door to forces. Springs, dashpots and
/// gravity come through it, and so does what somebody else writes; see
/// [`Terms`](crate::Terms) for terms given by kernels alone.
///
/// `x` and `v` hold all blocks, in m and m/s; `forces` and the like only the free
/// ones, and everything is added to what is there. A *stencil* is the list of
/// blocks that one term depends on. What joins fixed blocks only has energy, and
/// nothing else.
pub trait Emitter: Send + Sync {
    /// What its energy or heat is called in the energy ledger.
    fn name(&self) -> &str;

    /// What may be relied on.
    fn nature(&self) -> Nature;

    /// Takes note of which node is which block; called once, first.
    fn number(&mut self, numbering: &Numbering);

    /// Hands over the stencils with a free block, always in the same order.
    fn each_stencil(&self, visit: &mut dyn FnMut(&[u32]));

    /// Takes note of where its blocks are in the matrix: for every stencil in order,
    /// and in it for every two free blocks (first and second, first and third, …),
    /// the index of their pair in the pattern.
    fn place(&mut self, pairs: &[u32]);

    /// Potential energy, in J; zero if it has none.
    fn energy(&self, x: &[Vector3<f64>]) -> f64;

    /// The part of it, in J, that forces on free blocks come from.
    fn energy_on_free_blocks(&self, x: &[Vector3<f64>]) -> f64 {
        self.energy(x)
    }

    /// Adds the forces that depend on positions alone, in N: −∂V/∂x.
    fn add_forces(&self, x: &[Vector3<f64>], forces: &mut [Vector3<f64>]);

    /// Adds the forces that depend on nothing but time, in N: loads, on free blocks. `time`
    /// in s.
    fn add_loads(&self, time: f64, forces: &mut [Vector3<f64>]) {
        self.each_load(time, &mut |_, block, force| forces[block] += force);
    }

    /// How many loads there are, of one or more forces each, whose work is booked one by
    /// one; none, or a single one, if it does not say.
    fn n_loads(&self) -> usize {
        usize::from(self.nature().is_load)
    }

    /// Hands over every force of a load on a free block, in N, with its load, counted
    /// from 0, and its block: always in the same order.
    fn each_load(&self, _time: f64, _visit: &mut dyn FnMut(usize, usize, &Vector3<f64>)) {}

    /// The same of what forces change by with time, in N/s.
    fn each_load_rate(&self, _time: f64, _visit: &mut dyn FnMut(usize, usize, &Vector3<f64>)) {}

    /// Adds the forces that depend on velocities, in N: those that damp.
    fn add_damping_forces(
        &self,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _forces: &mut [Vector3<f64>],
    ) {
    }

    /// Adds the damping forces on the fixed blocks, in N; the first entry is that of
    /// the first fixed block.
    fn add_damping_reactions(
        &self,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _reactions: &mut [Vector3<f64>],
    ) {
    }

    /// Adds forces that depend on positions alone, `damping`·D and `stiffness`·H, and what anchors bring, in one pass.
    ///
    /// H = ∂²V/∂x² in N/m; D = −∂f/∂v in N·s/m.
    fn linearize(&self, at: &Evaluation<'_>, out: &mut Linearization);

    /// Adds the products of `y` with what [`Self::linearize`] adds to the matrix,
    /// term by term: differences of `y` come first where terms depend on differences
    /// of positions, so that uniform motion gives exactly nothing, however stiff
    /// they are.
    fn add_products(&self, at: &Evaluation<'_>, y: &[Vector3<f64>], products: &mut [Vector3<f64>]);

    /// Appends numbers that all products at one state have in common; none by default.
    fn prepare_products(&self, _at: &Evaluation<'_>, _numbers: &mut Vec<f64>) {}

    /// The same as [`Self::add_products`], but for rounding, with the numbers of
    /// [`Self::prepare_products`] for the same state.
    fn add_prepared_products(
        &self,
        at: &Evaluation<'_>,
        _numbers: &[f64],
        y: &[Vector3<f64>],
        products: &mut [Vector3<f64>],
    ) {
        self.add_products(at, y, products);
    }

    /// Adds to every free block half of a bound, in N/m, on the eigenvalues of the
    /// Hessians of its terms at any positions; infinite if there is none. A spring
    /// adds its stiffness to both ends.
    fn add_stiffness_bounds(&self, bounds: &mut [f64]);

    /// The same, in N·s/m, of D.
    fn add_damping_bounds(&self, _bounds: &mut [f64]) {}

    /// Heat that damping forces produce, in W.
    fn dissipation(&self, _x: &[Vector3<f64>], _v: &[Vector3<f64>]) -> f64 {
        0.0
    }

    /// Adds to `works`, in J, what each fixed block gives in a time `h`, in s, against its
    /// forces that depend on positions alone: −h f·v, in the order of the fixed blocks.
    fn add_anchor_works(
        &self,
        _h: f64,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _works: &mut [f64],
    ) {
    }

    /// The same against its damping forces.
    fn add_damping_anchor_works(
        &self,
        _h: f64,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _works: &mut [f64],
    ) {
    }

    /// Adds what [`Self::add_anchor_works`] in a time of 1 s changes by when all blocks move
    /// on by `y`, in m, and forces change as linearized at `at`, without its damping:
    /// v·(`stiffness`·H y) of each fixed block.
    fn add_anchor_work_changes(
        &self,
        _at: &Evaluation<'_>,
        _y: &[Vector3<f64>],
        _works: &mut [f64],
    ) {
    }

    /// Adds the work that each fixed block does against others, in J, when they go from
    /// `start` to `end` at constant velocities in a time `h`, in s, and gives the heat that
    /// becomes of it, in J.
    fn add_works_between_fixed(
        &self,
        _start: &[Vector3<f64>],
        _end: &[Vector3<f64>],
        _h: f64,
        _works: &mut [f64],
    ) -> f64 {
        0.0
    }

    /// How many numbers a method may carry from step to step for it, such as a tension
    /// of each spring, which stand for the present ones in its Hessian.
    fn n_carried(&self) -> usize {
        0
    }

    /// Hands over the free blocks of the term of each of these numbers, none where it joins
    /// fixed ones only, and half of a bound, in N/m, on the eigenvalues of its Hessian.
    fn each_carried_term(&self, _visit: &mut dyn FnMut(&[u32], f64)) {}

    /// Adds to every free block what its terms give, in N/m, against a move of that block
    /// alone, with carried numbers in place of those at `x`.
    fn add_own_stiffness(&self, _x: &[Vector3<f64>], _carried: &[f64], _own: &mut [OwnStiffness]) {}

    /// Adds −`scale`·(dH/dt)·v to all blocks, fixed ones too, in N for a scale in s², as far as
    /// it acts along springs with a free end: dH/dt is how its Hessian, with carried numbers,
    /// changes when all blocks move on with `v`.
    fn add_turning_forces(
        &self,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _carried: &[f64],
        _scale: f64,
        _forces: &mut [Vector3<f64>],
    ) {
    }

    /// The terms alone whose carried numbers are `kept` and that have a free block, with
    /// blocks known, and which of these numbers each of its own is; `None` if it cannot be
    /// taken apart.
    fn part(&self, _numbering: &Numbering, _kept: &[bool]) -> Option<(Box<dyn Emitter>, Vec<u32>)> {
        None
    }

    /// These numbers at `x`.
    fn carried(&self, _x: &[Vector3<f64>], _carried: &mut [f64]) {}

    /// These numbers as predicted for positions x + h·v, to first order in h.
    fn predict_carried(
        &self,
        _x: &[Vector3<f64>],
        _v: &[Vector3<f64>],
        _h: f64,
        _carried: &mut [f64],
    ) {
    }

    /// Adds the forces that depend on positions and velocities, in N, to all blocks,
    /// fixed ones too, with the numbers that a method carried in place of those at `x`.
    fn add_forces_on_all(
        &self,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
        n_free: usize,
        _carried: Option<&[f64]>,
        forces: &mut [Vector3<f64>],
    ) {
        self.add_forces(x, forces);
        self.add_damping_forces(x, v, forces);
        self.add_damping_reactions(x, v, &mut forces[n_free..]);
    }

    /// Adds loads as [`Self::add_loads`] does, to fixed blocks, too.
    fn add_loads_on_all(&self, time: f64, forces: &mut [Vector3<f64>]) {
        self.add_loads(time, forces);
    }

    /// Hands over the tension, in N, of each spring of the list that it was made from:
    /// the one that a method carried, or that at `x`.
    fn each_tension(
        &self,
        _x: &[Vector3<f64>],
        _carried: Option<&[f64]>,
        _visit: &mut dyn FnMut(usize, f64),
    ) {
    }

    /// Hands over the energy, in J, of each spring of the list that it was made from.
    fn each_energy(&self, _x: &[Vector3<f64>], _visit: &mut dyn FnMut(usize, f64)) {}

    /// Whether what its terms give may [change for good](Self::update_memory).
    fn has_memory(&self) -> bool {
        false
    }

    /// Changes for good what lasts of having come to `x`, asked at the start and after
    /// every step that stands, with the numbers that a method carried in place of those
    /// at `x`. Stencils, bounds and what may be relied on stay as they are.
    fn update_memory(
        &mut self,
        _x: &[Vector3<f64>],
        _carried: Option<&[f64]>,
        _update: &mut MemoryUpdate,
    ) {
    }

    /// Hands over the free blocks and the tension, in N, of every spring that
    /// [`Self::update_memory`] would break at `x`.
    fn each_breaking(&self, _x: &[Vector3<f64>], _visit: &mut dyn FnMut(&[u32], f64)) {}

    /// Hands over the numbers that its terms remember, always in the same order, to be
    /// saved or replaced.
    fn each_memory(&mut self, _visit: &mut dyn FnMut(&mut f64)) {}

    /// Hands over its springs that are broken, by their indices in the list that it was
    /// made from, ascending.
    fn each_broken(&self, _visit: &mut dyn FnMut(usize)) {}

    /// Hands over its springs that have yielded, in any order, and by how much, in m.
    fn each_yielded(&self, _visit: &mut dyn FnMut(usize, f64)) {}

    /// Takes note of all springs of the scene that are broken, ascending: what goes with
    /// them, such as their dashpots, gives nothing as long as they are.
    fn follow_broken(&mut self, _springs: &[usize]) {}

    /// What is carried of broken springs is zero.
    fn clear_broken(&self, _carried: &mut [f64]) {}

    /// Takes new numbers of the springs of the list that it was made from. Stencils, what
    /// lasts of where it has been, and what may be relied on stay as they are.
    fn change_springs(&mut self, _springs: &[SpringNumbers]) {}

    /// Takes the force on each block, in N, that it gives beside its own loads from now on.
    fn set_forces(&mut self, _forces: &[Vector3<f64>]) {}

    /// How many terms a projection makes a difference to.
    fn count_projected(&self, _at: &Evaluation<'_>) -> usize {
        0
    }

    /// The energy, in J, of terms that are notably strained; all of it where that has
    /// no meaning.
    fn energy_beyond(&self, _notable: Notable, x: &[Vector3<f64>]) -> f64 {
        self.energy(x)
    }

    /// The energy, in J, that rounding of coordinates is good for.
    fn energy_of_rounding(&self, _x: &[Vector3<f64>]) -> f64 {
        0.0
    }

    /// The spring that pulls or pushes most at a block; what is not a number pulls
    /// most.
    fn most_strained_at(&self, _block: usize, _x: &[Vector3<f64>]) -> Option<Strained> {
        None
    }
}

/// What the terms of carried numbers give, in N/m, against a move of one block alone: symmetric
/// 3 × 3 matrices, in the order of [`PACKED`](crate::PACKED).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnStiffness {
    /// Without these numbers: along springs.
    pub along: [f64; 6],
    /// What those of them bring that are positive: across springs that pull.
    pub across: [f64; 6],
}

/// The numbers of a spring that may change between steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringNumbers {
    /// K and l₀.
    pub spring: Spring,
    /// c of its dashpot, in N·s/m.
    pub damping: f64,
    /// Where that acts.
    pub fading: Fading,
}

/// From where on a change of length is notable: both of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notable {
    /// As a part of the rest length.
    pub strain: f64,
    /// In m.
    pub stretch: f64,
}

impl Notable {
    /// Whether a length is, in m.
    pub fn contains(&self, length: f64, rest_length: f64) -> bool {
        (length - rest_length).abs() > self.stretch.max(self.strain * rest_length)
    }
}

/// What may be relied on of an emitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nature {
    /// Number of terms that have a stencil; without any there are neither forces of
    /// positions or velocities nor a matrix.
    pub n_terms: usize,
    /// How many terms of the scene became part of others.
    pub n_merged: usize,
    /// Of its Hessian.
    pub stiffness: StiffnessKind,
    /// Whether its forces on free blocks are the same everywhere and always.
    pub is_constant: bool,
    /// Whether it has forces that depend on time.
    pub is_load: bool,
    /// Whether it has forces that depend on velocities.
    pub is_damped: bool,
    /// Whether terms join two blocks each and act along the line between them, or
    /// equally in all directions. Then they keep motion in a plane or on a line.
    pub is_central: bool,
    /// Whether blocks off the diagonal of the matrix are symmetric.
    pub has_symmetric_blocks: bool,
}

/// What a Hessian is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StiffnessKind {
    /// Zero.
    None,
    /// Multiples of the identity that never change.
    Isotropic,
    /// As far as it is along a line that all motion stays on, with
    /// [`Projection::Drop`], it never changes.
    ConstantAlongLines,
    /// Any.
    Variable,
}

/// What changed for good at the end of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemoryUpdate {
    /// Springs that broke, by their indices in the list that their emitter was made from.
    pub broken: Vec<BrokenSpring>,
    /// Energy, in J, that was lost otherwise.
    pub other_energy: f64,
    /// Whether forces jumped, as where springs broke.
    pub is_abrupt: bool,
}

/// A spring that broke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrokenSpring {
    /// Its index.
    pub spring: usize,
    /// What it held, in J, and is lost.
    pub energy: f64,
}

/// A spring under tension or pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strained {
    /// Its index in the scene.
    pub spring: usize,
    /// Its tension, in N.
    pub tension: f64,
    /// Its length, in m.
    pub length: f64,
    /// Its stiffness, in N/m.
    pub stiffness: f64,
}

/// Where and how a system is linearized.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation<'a> {
    /// Positions of all blocks, in m.
    pub x: &'a [Vector3<f64>],
    /// Velocities of all blocks, in m/s. Those of fixed blocks give the anchor
    /// load; those of free ones enter only with `velocity_stiffness`.
    pub v: &'a [Vector3<f64>],
    /// What becomes of negative eigenvalues of terms.
    pub projection: Projection,
    /// For every free block, whether terms that touch it are projected; `None`: all
    /// are.
    pub projected: Option<&'a [bool]>,
    /// What a method [carries along](Emitter::n_carried), that the Hessian is taken
    /// with: tensions in N, whose T/l is the across stiffness; `None`: the present
    /// values.
    pub carried: Option<&'a [f64]>,
    /// Whether H has the positive semidefinite part of what damping forces change by
    /// with positions, such as the across stiffness c(w·u)/l of dashpots that are being
    /// stretched (see `springs_math::dashpot::position_block`).
    pub velocity_stiffness: bool,
    /// What the matrix is made of.
    pub weights: Weights,
}

impl<'a> Evaluation<'a> {
    /// The Hessian as it is, with everything at its present values.
    pub fn new(x: &'a [Vector3<f64>], v: &'a [Vector3<f64>], weights: Weights) -> Self {
        Self {
            x,
            v,
            projection: Projection::None,
            projected: None,
            carried: None,
            velocity_stiffness: false,
            weights,
        }
    }

    /// What becomes of negative eigenvalues of a term that touches these free
    /// blocks.
    pub fn projection_at(&self, free_blocks: &[u32]) -> Projection {
        match self.projected {
            Some(projected) if !free_blocks.iter().any(|&b| projected[b as usize]) => {
                Projection::None
            }
            _ => self.projection,
        }
    }
}

/// Coefficients of a system matrix `mass`·M + `damping`·D + `stiffness`·H.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Of the lumped mass M.
    pub mass: f64,
    /// Of the damping matrix D = −∂f/∂v.
    pub damping: f64,
    /// Of the Hessian H = ∂²V/∂x².
    pub stiffness: f64,
}

impl Weights {
    /// H alone, in N/m.
    pub const STIFFNESS: Self = Self {
        mass: 0.0,
        damping: 0.0,
        stiffness: 1.0,
    };

    /// D alone, in N·s/m, times `damping`.
    pub fn of_damping(damping: f64) -> Self {
        Self {
            mass: 0.0,
            damping,
            stiffness: 0.0,
        }
    }

    /// M + hD + h²H, in kg, of a step of size h in s.
    pub fn of_step(h: f64) -> Self {
        Self {
            mass: 1.0,
            damping: h,
            stiffness: h * h,
        }
    }
}

/// What the matrix takes for negative eigenvalues of a term: for the stiffness T/l of
/// a spring across itself, if it is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// Themselves: the matrix is exact, and may be indefinite.
    None,
    /// Zero: positive semidefinite.
    Clamp,
    /// Their magnitudes: positive semidefinite.
    Absolute,
    /// Zero, and for springs positive stiffness across as well: positive
    /// semidefinite.
    Drop,
}

impl Projection {
    /// What becomes of an across stiffness, in N/m.
    #[inline(always)]
    pub(crate) fn apply(self, across: f64) -> f64 {
        match self {
            Self::None => across,
            Self::Clamp => across.max(0.0),
            Self::Absolute => across.abs(),
            Self::Drop => 0.0,
        }
    }
}
