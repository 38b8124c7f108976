//! Forces of linear springs along runs, several springs at once.

use crate::run::{LANES, Run};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use springs_math::SAFE_SQUARES;
use springs_math::spring::{self, Spring};
use std::ops::Range;

/// The numbers of linear springs along runs, slot by slot; zero where a slot has no
/// spring.
#[derive(Clone, Debug)]
pub(crate) struct LinearRuns {
    stiffnesses: Vec<f64>,
    rest_lengths: Vec<f64>,
}

/// The slots of each run within those of all.
fn slots(runs: &[Run]) -> impl Iterator<Item = (&Run, Range<usize>)> {
    runs.iter().scan(0, |begin, run| {
        let slots = *begin..*begin + run.n_slots;
        *begin = slots.end;
        Some((run, slots))
    })
}

impl LinearRuns {
    /// Of springs with these laws and ends.
    pub(crate) fn new(runs: &[Run], ends: &[[u32; 2]], law: impl Fn(usize) -> Spring) -> Self {
        let n_slots = runs.iter().map(|run| run.n_slots).sum();
        let mut numbers = Self {
            stiffnesses: vec![0.0; n_slots],
            rest_lengths: vec![0.0; n_slots],
        };
        for (run, slots) in slots(runs) {
            for index in run.connections.clone() {
                let slot = slots.start + ends[index][0] as usize - run.first;
                let law = law(index);
                numbers.stiffnesses[slot] = law.stiffness;
                numbers.rest_lengths[slot] = law.rest_length;
            }
        }
        numbers
    }

    /// Adds what [`spring::force`] gives for each spring in turn, with the same bits, to
    /// the forces in N.
    ///
    /// # Panics
    ///
    /// If a slice is shorter than the number of free blocks.
    pub(crate) fn add_forces(&self, runs: &[Run], x: &[Vector3<f64>], forces: &mut [Vector3<f64>]) {
        Arch::new().dispatch(AddForces {
            numbers: self,
            runs,
            x: bytemuck::cast_slice(x),
            forces: bytemuck::cast_slice_mut(forces),
        });
    }
}

struct AddForces<'a> {
    numbers: &'a LinearRuns,
    runs: &'a [Run],
    /// Coordinates of one block after the other, as are the forces.
    x: &'a [f64],
    forces: &'a mut [f64],
}

impl WithSimd for AddForces<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (run, slots) in slots(self.runs) {
            let (stiffnesses, _) = self.numbers.stiffnesses[slots.clone()].as_chunks();
            let (rest_lengths, _) = self.numbers.rest_lengths[slots].as_chunks();
            let (first, second) = (3 * run.first, 3 * (run.first + run.offset));
            let (starts, _) = self.x[first..][..3 * run.n_slots].as_chunks();
            let (ends, _) = self.x[second..][..3 * run.n_slots].as_chunks();
            let laws = stiffnesses.iter().zip(rest_lengths);
            let mut at = 0;
            for ((start, end), law) in starts.iter().zip(ends).zip(laws) {
                let forces = of_lanes(simd, [start, end], law);
                // The second end first: with an offset below the number of lanes, a
                // block is the second end of an earlier spring than it is the first of.
                let on_end = lanes_at(self.forces, second + at);
                for (sum, force) in on_end.iter_mut().zip(&forces) {
                    *sum -= force;
                }
                let on_start = lanes_at(self.forces, first + at);
                for (sum, force) in on_start.iter_mut().zip(&forces) {
                    *sum += force;
                }
                at += 3 * LANES;
            }
        }
    }
}

/// Coordinates of the blocks at one end.
type Ends = [f64; 3 * LANES];
/// A number of each spring.
type Lanes = [f64; LANES];

#[inline(always)]
fn lanes_at(vectors: &mut [f64], at: usize) -> &mut Ends {
    let lanes = &mut vectors[at..at + 3 * LANES];
    lanes.try_into().expect("as many as there are")
}

/// Forces on the first ends of as many springs as there are lanes.
#[inline(always)]
fn of_lanes<S: Simd>(
    simd: S,
    [start, end]: [&Ends; 2],
    (stiffnesses, rest_lengths): (&Lanes, &Lanes),
) -> Ends {
    let mut forces = [0.0; 3 * LANES];
    for c in 0..3 * LANES {
        forces[c] = end[c] - start[c];
    }
    let mut squares = [0.0; LANES];
    for c in 0..LANES {
        let [x, y, z] = [forces[3 * c], forces[3 * c + 1], forces[3 * c + 2]];
        squares[c] = x * x + y * y + z * z;
    }
    let mut per_lengths = [0.0; LANES];
    if !divide(
        simd,
        &squares,
        (stiffnesses, rest_lengths),
        &mut per_lengths,
    ) {
        one_by_one([start, end], (stiffnesses, rest_lengths), &mut forces);
        return forces;
    }
    for c in 0..LANES {
        forces[3 * c] *= per_lengths[c];
        forces[3 * c + 1] *= per_lengths[c];
        forces[3 * c + 2] *= per_lengths[c];
    }
    forces
}

/// Tensions over lengths, in N/m; says whether all lengths are safe to be taken from
/// their squares and all results are finite.
#[inline(always)]
fn divide<S: Simd>(
    simd: S,
    squares: &Lanes,
    (stiffnesses, rest_lengths): (&Lanes, &Lanes),
    per_lengths: &mut Lanes,
) -> bool {
    let one = simd.splat_f64s(1.0);
    let (mut least, mut most, mut odd) = (one, one, simd.splat_f64s(0.0));
    let (squares, _) = S::as_simd_f64s(squares);
    let (stiffnesses, _) = S::as_simd_f64s(stiffnesses);
    let (rest_lengths, _) = S::as_simd_f64s(rest_lengths);
    let (per_lengths, _) = S::as_mut_simd_f64s(per_lengths);
    let laws = stiffnesses.iter().zip(rest_lengths);
    for (per_length, (&square, (&k, &l0))) in per_lengths.iter_mut().zip(squares.iter().zip(laws)) {
        let length = simd.sqrt_f64s(square);
        let tension = simd.mul_f64s(k, simd.sub_f64s(length, l0));
        *per_length = simd.div_f64s(tension, length);
        least = simd.min_f64s(least, square);
        most = simd.max_f64s(most, square);
        // Zero, unless it is infinite or not a number.
        odd = simd.add_f64s(odd, simd.sub_f64s(*per_length, *per_length));
    }
    simd.reduce_min_f64s(least) >= *SAFE_SQUARES.start()
        && simd.reduce_max_f64s(most) <= *SAFE_SQUARES.end()
        && simd.reduce_sum_f64s(odd) == 0.0
}

/// The same where one of the springs is very short or long, or broken off the numbers.
#[cold]
#[inline(never)]
fn one_by_one(
    [start, end]: [&Ends; 2],
    (stiffnesses, rest_lengths): (&Lanes, &Lanes),
    forces: &mut Ends,
) {
    forces.fill(0.0);
    let ends = start.chunks_exact(3).zip(end.chunks_exact(3));
    let laws = stiffnesses.iter().zip(rest_lengths);
    for ((force, (start, end)), (&stiffness, &rest_length)) in
        forces.chunks_exact_mut(3).zip(ends).zip(laws)
    {
        if stiffness == 0.0 {
            // Most likely a slot without a spring.
            continue;
        }
        let law = Spring {
            stiffness,
            rest_length,
        };
        let ends = [start, end].map(Vector3::from_column_slice);
        force.copy_from_slice(spring::force(law, &ends[0], &ends[1]).as_slice());
    }
}

#[cfg(test)]
mod tests {
    use crate::{Emitter, Numbering, SpringBetween, Springs};
    use nalgebra::Vector3;
    use springs_math::spring::Spring;

    /// Numbers in [0, 1) that look random.
    struct Dice(u64);

    impl Dice {
        fn roll(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// A net of 30 by 40 nodes with springs to neighbours at all of these distances, some
    /// left out, in any order and direction.
    fn net(dice: &mut Dice) -> Vec<SpringBetween<Spring>> {
        let mut springs = Vec::new();
        for offset in [1, 2, 7, 8, 29, 30, 31, 60] {
            for node in 0..1200 - offset {
                if dice.roll() < 0.1 {
                    continue;
                }
                let mut nodes = [node, node + offset];
                if dice.roll() < 0.5 {
                    nodes.swap(0, 1);
                }
                let law = Spring {
                    stiffness: 100.0 * dice.roll(),
                    rest_length: dice.roll(),
                };
                springs.push(SpringBetween { nodes, law });
            }
        }
        springs.sort_by_cached_key(|_| dice.roll().to_bits());
        springs
    }

    /// Bit by bit, where springs are of usual lengths, and where some are too short or too
    /// long to be squared, have coincident ends, or are no numbers at all.
    #[test]
    fn forces_are_those_of_springs_one_by_one() {
        let mut dice = Dice(1);
        let is_fixed = (0..1200).map(|node| node % 300 == 17);
        let numbering = Numbering::new(is_fixed);
        let mut springs = Springs::new("springs", &net(&mut dice));
        springs.number(&numbering);
        let one_by_one = springs.clone().one_by_one();
        for share in [0.0, 0.02, 1.0] {
            for odd in [0.0, 1e-170, 1e170, f64::NAN, f64::INFINITY] {
                let mut coordinate = || {
                    if dice.roll() < share {
                        odd
                    } else {
                        dice.roll() - 0.5
                    }
                };
                let x = Vec::from_iter((0..1200).map(|_| Vector3::from_fn(|_, _| coordinate())));
                let of = |springs: &Springs| {
                    let mut forces = vec![Vector3::repeat(1.0); numbering.n_free()];
                    springs.add_forces(&x, &mut forces);
                    // What is not a number may have any sign.
                    let bits = |f: f64| if f.is_nan() { 0 } else { f.to_bits() };
                    Vec::from_iter(forces.iter().map(|f| f.map(bits)))
                };
                assert!(of(&springs) == of(&one_by_one), "{share} {odd}");
            }
        }
    }
}
