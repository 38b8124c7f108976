//! Forces and Hessian blocks of linear springs along runs.

use super::{LANES, Laws, LinearRuns, NO_SPRING, Run, divide};
use crate::lanes::{
    Ends, Lanes, add_to_ends, differences, dots, lanes_at, set_vector_at, vector_at,
};
use crate::matrix::PairBlock;
use crate::sums::Sums;
use crate::{Evaluation, Projection};
use pulp::{Arch, Simd, WithSimd};
use springs_math::spring::{self, Spring};

impl LinearRuns {
    /// Adds what [`spring::linearize`] gives for each spring in turn, with the same bits:
    /// forces, in N, and blocks times the weight of the stiffness. `pairs` has the pair of the matrix of
    /// each spring.
    ///
    /// # Panics
    ///
    /// If the sums do not have all blocks and pairs of the runs.
    pub(crate) fn linearize<P: PairBlock>(
        &self,
        (runs, pairs): (&[Run], &[u32]),
        at: &Evaluation<'_>,
        sums: &mut Sums<'_, P>,
    ) {
        Arch::new().dispatch(Linearize {
            numbers: self,
            runs,
            pairs,
            x: bytemuck::cast_slice(at.x),
            at,
            first_block: sums.first_block,
            first_pair: sums.first_pair,
            forces: bytemuck::cast_slice_mut(sums.forces),
            diagonal: sums.diagonal.as_flattened_mut(),
            off_diagonal: sums.pairs,
        });
    }
}

struct Linearize<'a, P> {
    numbers: &'a LinearRuns,
    runs: &'a [Run],
    pairs: &'a [u32],
    x: &'a [f64],
    at: &'a Evaluation<'a>,
    first_block: usize,
    first_pair: usize,
    /// Numbers of one block after the other: three of a force, six of a diagonal block.
    forces: &'a mut [f64],
    diagonal: &'a mut [f64],
    off_diagonal: &'a mut [P],
}

impl<P: PairBlock> WithSimd for Linearize<'_, P> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (at, weight) = (self.at, self.at.weights.stiffness);
        self.numbers.each_lanes(self.runs, |ends, law, springs| {
            let how = Across {
                springs,
                carried: at.carried,
                projection: at.projection,
                is_projected: is_projected(at, ends),
            };
            let x = ends.map(|block| lanes_at(self.x, block));
            let (forces, blocks) = linearized(simd, x, law, (&how, weight));
            let ends = ends.map(|block| block - self.first_block);
            add_to_ends(simd, self.forces, ends, &forces);
            add_to_diagonal(self.diagonal, ends, &blocks);
            for (place, &spring) in springs.iter().enumerate() {
                if spring != NO_SPRING {
                    let pair = self.pairs[spring as usize] as usize - self.first_pair;
                    self.off_diagonal[pair].subtract_symmetric(&blocks.at(place));
                }
            }
        });
    }
}

/// Packed blocks of all lanes: four entries of each, and the other two, followed by zeros.
struct Blocks {
    most: [[f64; 4]; LANES],
    rest: [[f64; 4]; LANES],
}

impl Blocks {
    const ZERO: Self = Self {
        most: [[0.0; 4]; LANES],
        rest: [[0.0; 4]; LANES],
    };

    /// The packed block of a lane.
    #[inline(always)]
    fn at(&self, place: usize) -> [f64; 6] {
        let ([a, b, c, d], [e, f, ..]) = (self.most[place], self.rest[place]);
        [a, b, c, d, e, f]
    }
}

/// What is taken for the stiffnesses across springs.
struct Across<'a> {
    springs: &'a [u32; LANES],
    /// Tensions, by spring, in N.
    carried: Option<&'a [f64]>,
    projection: Projection,
    /// Which of them are projected; `None`: all.
    is_projected: Option<[bool; LANES]>,
}

impl Across<'_> {
    /// The tension that a method carried for a spring, or 0 N in a slot without one.
    #[inline(always)]
    fn carried(&self, place: usize) -> Option<f64> {
        let carried = self.carried?;
        match self.springs[place] {
            NO_SPRING => Some(0.0),
            spring => Some(carried[spring as usize]),
        }
    }

    fn projection(&self, place: usize) -> Projection {
        match self.is_projected {
            Some(is_projected) if !is_projected[place] => Projection::None,
            _ => self.projection,
        }
    }

    /// Projected stiffnesses, in N/m, with those at present.
    #[inline(always)]
    fn of<S: Simd>(
        &self,
        simd: S,
        present: &Lanes,
        stiffnesses: &Lanes,
        inverses: &Lanes,
    ) -> Lanes {
        let mut plain = *present;
        if self.carried.is_some() {
            for (place, plain) in plain.iter_mut().enumerate() {
                *plain = self.carried(place).unwrap_or(0.0);
            }
            let (plain, _) = S::as_mut_simd_f64s(&mut plain);
            let [inverses, stiffnesses] = [inverses, stiffnesses].map(|of| S::as_simd_f64s(of).0);
            for (plain, (&inverse, &k)) in plain.iter_mut().zip(inverses.iter().zip(stiffnesses)) {
                *plain = simd.min_f64s(simd.mul_f64s(*plain, inverse), k);
            }
        }
        let zero = simd.splat_f64s(0.0);
        let mut across = plain;
        let (lanes, _) = S::as_mut_simd_f64s(&mut across);
        // One loop for each, without a choice inside.
        match self.projection {
            Projection::None => {}
            Projection::Clamp => lanes
                .iter_mut()
                .for_each(|lanes| *lanes = simd.max_f64s(*lanes, zero)),
            Projection::Absolute => lanes
                .iter_mut()
                .for_each(|lanes| *lanes = simd.abs_f64s(*lanes)),
            Projection::Drop => lanes.fill(zero),
        }
        if let Some(is_projected) = self.is_projected {
            for (across, (plain, is_projected)) in
                across.iter_mut().zip(plain.iter().zip(is_projected))
            {
                *across = if is_projected { *across } else { *plain };
            }
        }
        across
    }
}

/// Which of the springs between two times as many blocks touch one whose terms are
/// projected; `None`: all are.
#[inline(always)]
fn is_projected(at: &Evaluation<'_>, ends: [usize; 2]) -> Option<[bool; LANES]> {
    let projected = at.projected?;
    let [first, second] = ends.map(|block| &projected[block..block + LANES]);
    let mut is_projected = [false; LANES];
    for (is_projected, (first, second)) in is_projected.iter_mut().zip(first.iter().zip(second)) {
        *is_projected = first | second;
    }
    Some(is_projected)
}

/// Forces on the first ends, and blocks times a weight.
#[inline(always)]
fn linearized<S: Simd>(
    simd: S,
    x: [&Ends; 2],
    laws: Laws<'_>,
    (how, weight): (&Across<'_>, f64),
) -> (Ends, Blocks) {
    let dx = differences(x);
    let squares = dots(&dx, &dx);
    let (mut per_lengths, mut inverses) = ([0.0; LANES], [0.0; LANES]);
    if !divide(simd, &squares, laws, &mut per_lengths, Some(&mut inverses)) {
        return linearized_one_by_one(&dx, laws, (how, weight));
    }
    let (stiffnesses, _) = laws;
    let across = how.of(simd, &per_lengths, stiffnesses, &inverses);
    let blocks = blocks_of(simd, &dx, &inverses, [stiffnesses, &across], weight);
    let mut forces = dx;
    for c in 0..LANES {
        forces[3 * c] *= per_lengths[c];
        forces[3 * c + 1] *= per_lengths[c];
        forces[3 * c + 2] *= per_lengths[c];
    }
    (forces, blocks)
}

/// Blocks times a weight, from stiffnesses along and across the springs.
#[inline(always)]
fn blocks_of<S: Simd>(
    simd: S,
    dx: &Ends,
    inverses: &Lanes,
    [along, across]: [&Lanes; 2],
    weight: f64,
) -> Blocks {
    let mut components = [[0.0; LANES]; 3];
    for c in 0..LANES {
        for (axis, component) in components.iter_mut().enumerate() {
            component[c] = dx[3 * c + axis];
        }
    }
    let [x, y, z] = components.each_ref().map(|lanes| S::as_simd_f64s(lanes).0);
    let [inverses, along, across] = [inverses, along, across].map(|lanes| S::as_simd_f64s(lanes).0);
    let weight = simd.splat_f64s(weight);
    let zero = simd.splat_f64s(0.0);
    let mut blocks = Blocks::ZERO;
    let (most, _) = S::as_mut_simd_f64s(blocks.most.as_flattened_mut());
    let (rest, _) = S::as_mut_simd_f64s(blocks.rest.as_flattened_mut());
    let (most, _) = most.as_chunks_mut::<4>();
    let (rest, _) = rest.as_chunks_mut::<4>();
    for (c, (most, rest)) in most.iter_mut().zip(rest).enumerate() {
        let more = simd.sub_f64s(along[c], across[c]);
        let [x, y, z] = [x[c], y[c], z[c]].map(|dx| simd.mul_f64s(dx, inverses[c]));
        let [along_x, along_y, along_z] = [x, y, z].map(|u| simd.mul_f64s(u, more));
        let other = |a, b| simd.mul_f64s(weight, simd.mul_f64s(a, b));
        let diagonal = |a, b| {
            let entry = simd.add_f64s(across[c], simd.mul_f64s(a, b));
            simd.mul_f64s(weight, entry)
        };
        // Springs by springs from entries by entries.
        *most = simd.interleave_shfl_f64s([
            diagonal(along_x, x),
            other(along_x, y),
            other(along_x, z),
            diagonal(along_y, y),
        ]);
        *rest = simd.interleave_shfl_f64s([other(along_y, z), diagonal(along_z, z), zero, zero]);
    }
    blocks
}

/// The same where one of the springs is very short or long, or something is not a finite
/// number.
#[cold]
#[inline(never)]
fn linearized_one_by_one(
    dx: &Ends,
    (stiffnesses, rest_lengths): Laws<'_>,
    (how, weight): (&Across<'_>, f64),
) -> (Ends, Blocks) {
    let (mut forces, mut blocks) = ([0.0; 3 * LANES], Blocks::ZERO);
    for place in 0..LANES {
        if how.springs[place] == NO_SPRING {
            continue;
        }
        let law = Spring {
            stiffness: stiffnesses[place],
            rest_length: rest_lengths[place],
        };
        let projection = how.projection(place);
        let dx = vector_at(dx, place);
        let project = |across| projection.apply(across);
        let (force, block) = spring::linearize(law, how.carried(place), &dx, project);
        set_vector_at(&mut forces, place, &force);
        let [a, b, c, d, e, f] = block.map(|entry| weight * entry);
        blocks.most[place] = [a, b, c, d];
        blocks.rest[place] = [e, f, 0.0, 0.0];
    }
    (forces, blocks)
}

/// Adds to the blocks of both ends, in the order of the springs.
#[inline(always)]
fn add_to_diagonal(diagonal: &mut [f64], [first, second]: [usize; 2], blocks: &Blocks) {
    // The second end first, as where forces are added.
    for block in [second, first] {
        let (_, sums) = diagonal.split_at_mut(6 * block);
        let (sums, _) = sums[..6 * LANES].as_chunks_mut::<6>();
        for (place, sum) in sums.iter_mut().enumerate() {
            for (sum, entry) in sum[..4].iter_mut().zip(&blocks.most[place]) {
                *sum += entry;
            }
            for (sum, entry) in sum[4..].iter_mut().zip(&blocks.rest[place]) {
                *sum += entry;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Dice, net};
    use crate::matrix::BlockMatrix;
    use crate::{
        BlockPattern, Emitter, Evaluation, Linearization, Numbering, Projection, Springs, Weights,
    };
    use nalgebra::Vector3;
    use std::sync::Arc;

    /// Bits of all numbers; what is not a number may have any sign.
    fn bits(at: &Linearization) -> Vec<u64> {
        let entries = at.matrix.triplets().map(|(_, _, entry)| entry);
        let vectors = at.forces.iter().chain(&at.anchor_load);
        let numbers = entries.chain(vectors.flat_map(|v| [v.x, v.y, v.z]));
        let bits = |number: f64| {
            if number.is_nan() { 0 } else { number.to_bits() }
        };
        numbers.map(bits).collect()
    }

    /// Bit by bit, with every projection of all and of some, with the tensions that are there
    /// and others, with blocks of both kinds, and with springs that are too short, too long,
    /// or no numbers at all.
    #[test]
    fn linearizations_are_those_of_springs_one_by_one() {
        let mut dice = Dice(5);
        let numbering = Numbering::new((0..1200).map(|node| node % 300 == 17));
        let mut springs = Springs::new("springs", &net(&mut dice));
        springs.number(&numbering);
        let mut stencils = Vec::new();
        springs.each_stencil(&mut |stencil| stencils.push([stencil[0], stencil[1]]));
        stencils.retain(|ends| !numbering.is_fixed(ends[1]));
        let (pattern, pairs) = BlockPattern::from_triplets(numbering.n_free(), &stencils);
        springs.place(&pairs);
        let one_by_one = springs.clone().one_by_one();
        let pattern = Arc::new(pattern);
        let tensions = Vec::from_iter((0..springs.n_carried()).map(|_| 40.0 * dice.roll() - 20.0));
        let projected = Vec::from_iter((0..numbering.n_free()).map(|_| dice.roll() < 0.3));
        let v = Vec::from_iter((0..1200).map(|_| Vector3::from_fn(|_, _| dice.roll())));
        for odd in [0.5, 0.0, 1e-170, 1e170, f64::NAN, f64::INFINITY] {
            let mut coordinate = || {
                let usual = dice.roll() - 0.5;
                if dice.roll() < 0.02 { odd } else { usual }
            };
            let x = Vec::from_iter((0..1200).map(|_| Vector3::from_fn(|_, _| coordinate())));
            for case in 0..32 {
                use Projection::{Absolute, Clamp, Drop, None as Exact};
                let at = Evaluation {
                    projection: [Exact, Clamp, Absolute, Drop][case % 4],
                    carried: (case & 4 != 0).then_some(&tensions[..]),
                    projected: (case & 8 != 0).then_some(&projected[..]),
                    ..Evaluation::new(&x, &v, Weights::of_step(0.1))
                };
                let of = |springs: &Springs| {
                    let zeros = vec![Vector3::zeros(); numbering.n_free()];
                    let mut out = Linearization {
                        forces: zeros.clone(),
                        matrix: BlockMatrix::zeros(pattern.clone(), case & 16 != 0),
                        anchor_load: zeros,
                    };
                    springs.linearize(&at, &mut out);
                    bits(&out)
                };
                assert!(of(&springs) == of(&one_by_one), "{odd} {case}");
            }
        }
    }
}
