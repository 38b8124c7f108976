//! Linear springs along runs, several at once.

mod linearization;
mod prepared;

use crate::Projection;
use crate::lanes::{
    Ends, Lanes, Safety, add_to_ends, differences, dots, lanes_at, set_vector_at, slots, vector_at,
};
use crate::matrix::times;
use crate::run::{LANES, Run};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use springs_math::Separation;
use springs_math::spring::{self, LengthLaw, Spring};

/// The numbers of linear springs along runs, slot by slot; zero where a slot has no
/// spring.
#[derive(Clone, Debug)]
pub(crate) struct LinearRuns {
    stiffnesses: Vec<f64>,
    rest_lengths: Vec<f64>,
    /// Which spring each slot has, or [`NO_SPRING`].
    springs: Vec<u32>,
}

/// In a slot without one.
const NO_SPRING: u32 = u32::MAX;

impl LinearRuns {
    /// Of springs with these laws and ends.
    pub(crate) fn new(runs: &[Run], ends: &[[u32; 2]], law: impl Fn(usize) -> Spring) -> Self {
        let n_slots = slots(runs).last().map_or(0, |(_, slots)| slots.end);
        let mut numbers = Self {
            stiffnesses: vec![0.0; n_slots],
            rest_lengths: vec![0.0; n_slots],
            springs: vec![NO_SPRING; n_slots],
        };
        for (run, slots) in slots(runs) {
            for index in run.connections.clone() {
                let slot = slots.start + ends[index][0] as usize - run.first;
                let law = law(index);
                numbers.stiffnesses[slot] = law.stiffness;
                numbers.rest_lengths[slot] = law.rest_length;
                numbers.springs[slot] = index as u32;
            }
        }
        numbers
    }

    /// Adds what [`spring::force`] gives for each spring in turn, with the same bits, to
    /// the forces in N, which are those of the blocks from `first` on.
    ///
    /// # Panics
    ///
    /// If a slice does not have all blocks of the runs.
    pub(crate) fn add_forces(
        &self,
        runs: &[Run],
        x: &[Vector3<f64>],
        (first, forces): (usize, &mut [Vector3<f64>]),
    ) {
        Arch::new().dispatch(AddForces {
            numbers: self,
            runs,
            x: bytemuck::cast_slice(x),
            first,
            forces: bytemuck::cast_slice_mut(forces),
        });
    }

    /// Adds the products of `weight` times the Hessians and `y` on the first ends, and
    /// their negatives on the second ends: of [`spring::linearize`] but for rounding. The
    /// products are those of the blocks from `first` on.
    ///
    /// # Panics
    ///
    /// If a slice does not have all blocks of the runs.
    pub(crate) fn add_products(
        &self,
        runs: &[Run],
        x: &[Vector3<f64>],
        (projection, weight): (Projection, f64),
        y: &[Vector3<f64>],
        (first, products): (usize, &mut [Vector3<f64>]),
    ) {
        Arch::new().dispatch(AddProducts {
            numbers: self,
            runs,
            x: bytemuck::cast_slice(x),
            projection,
            weight,
            y: bytemuck::cast_slice(y),
            first,
            products: bytemuck::cast_slice_mut(products),
        });
    }

    /// Energy of all, in J: the sum of what the law gives for each, but for rounding.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than free blocks.
    pub(crate) fn energy(&self, runs: &[Run], x: &[Vector3<f64>]) -> f64 {
        Arch::new().dispatch(SumOfEnergies {
            numbers: self,
            runs,
            x: bytemuck::cast_slice(x),
        })
    }

    /// Hands over the blocks at the first and the second end of the first of all lanes,
    /// the laws, and the springs.
    #[inline(always)]
    fn each_lanes(&self, runs: &[Run], mut visit: impl FnMut([usize; 2], Laws<'_>, &[u32; LANES])) {
        for (run, slots) in slots(runs) {
            let (stiffnesses, _) = self.stiffnesses[slots.clone()].as_chunks();
            let (rest_lengths, _) = self.rest_lengths[slots.clone()].as_chunks();
            let (springs, _) = self.springs[slots].as_chunks();
            let mut block = run.first;
            for (law, springs) in stiffnesses.iter().zip(rest_lengths).zip(springs) {
                visit([block, block + run.offset], law, springs);
                block += LANES;
            }
        }
    }
}

struct AddForces<'a> {
    numbers: &'a LinearRuns,
    runs: &'a [Run],
    /// Coordinates of one block after the other, as are the forces.
    x: &'a [f64],
    /// Block of the first force.
    first: usize,
    forces: &'a mut [f64],
}

impl WithSimd for AddForces<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.numbers.each_lanes(self.runs, |at, law, _| {
            let ends = at.map(|at| lanes_at(self.x, at));
            let forces = forces_of(simd, ends, law);
            let sums = at.map(|block| block - self.first);
            add_to_ends(simd, self.forces, sums, &forces);
        });
    }
}

struct SumOfEnergies<'a> {
    numbers: &'a LinearRuns,
    runs: &'a [Run],
    x: &'a [f64],
}

impl WithSimd for SumOfEnergies<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let mut sums = [0.0; LANES];
        self.numbers.each_lanes(self.runs, |at, law, _| {
            let ends = at.map(|at| lanes_at(self.x, at));
            let energies = energies_of(simd, ends, law);
            for (sum, energy) in sums.iter_mut().zip(&energies) {
                *sum += energy;
            }
        });
        sums.iter().sum()
    }
}

struct AddProducts<'a> {
    numbers: &'a LinearRuns,
    runs: &'a [Run],
    x: &'a [f64],
    projection: Projection,
    weight: f64,
    y: &'a [f64],
    /// Block of the first product.
    first: usize,
    products: &'a mut [f64],
}

impl WithSimd for AddProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (projection, weight) = (self.projection, self.weight);
        self.numbers.each_lanes(self.runs, |at, law, _| {
            let [x, y] = [self.x, self.y].map(|vectors| at.map(|at| lanes_at(vectors, at)));
            let mut products = products_of(simd, x, law, projection, y);
            for product in &mut products {
                *product *= weight;
            }
            let sums = at.map(|block| block - self.first);
            add_to_ends(simd, self.products, sums, &products);
        });
    }
}

/// Stiffnesses and rest lengths.
type Laws<'a> = (&'a Lanes, &'a Lanes);

/// Forces on the first ends.
#[inline(always)]
fn forces_of<S: Simd>(simd: S, x: [&Ends; 2], laws: Laws<'_>) -> Ends {
    let mut forces = differences(x);
    let squares = dots(&forces, &forces);
    let mut per_lengths = [0.0; LANES];
    if !divide(simd, &squares, laws, &mut per_lengths, None) {
        return forces_one_by_one(x, laws);
    }
    for c in 0..LANES {
        forces[3 * c] *= per_lengths[c];
        forces[3 * c + 1] *= per_lengths[c];
        forces[3 * c + 2] *= per_lengths[c];
    }
    forces
}

/// Tensions over lengths, in N/m; says whether all lengths are safe to be taken from
/// their squares and all results are finite. If the inverses of lengths are wanted, too, in
/// 1/m, tensions are multiplied by them: as [`spring::linearize`] does, and not
/// [`spring::force`].
#[inline(always)]
fn divide<S: Simd>(
    simd: S,
    squares: &Lanes,
    (stiffnesses, rest_lengths): Laws<'_>,
    per_lengths: &mut Lanes,
    mut inverses: Option<&mut Lanes>,
) -> bool {
    let (one, mut safety) = (simd.splat_f64s(1.0), Safety::new(simd));
    let (squares, _) = S::as_simd_f64s(squares);
    let (stiffnesses, _) = S::as_simd_f64s(stiffnesses);
    let (rest_lengths, _) = S::as_simd_f64s(rest_lengths);
    let (per_lengths, _) = S::as_mut_simd_f64s(per_lengths);
    let mut inverses = inverses
        .as_mut()
        .map(|inverses| S::as_mut_simd_f64s(*inverses).0);
    let laws = stiffnesses.iter().zip(rest_lengths);
    let lanes = per_lengths.iter_mut().zip(squares.iter().zip(laws));
    for (lane, (per_length, (&square, (&k, &l0)))) in lanes.enumerate() {
        let length = simd.sqrt_f64s(square);
        let tension = simd.mul_f64s(k, simd.sub_f64s(length, l0));
        *per_length = match &mut inverses {
            None => simd.div_f64s(tension, length),
            Some(inverses) => {
                inverses[lane] = simd.div_f64s(one, length);
                simd.mul_f64s(tension, inverses[lane])
            }
        };
        safety.note(square, *per_length);
    }
    safety.is_given()
}

/// Hands over the place and the law of every spring; slots without one have no stiffness.
fn each_spring((stiffnesses, rest_lengths): Laws<'_>, mut visit: impl FnMut(usize, Spring)) {
    let laws = stiffnesses.iter().zip(rest_lengths);
    for (place, (&stiffness, &rest_length)) in laws.enumerate() {
        if stiffness != 0.0 {
            let law = Spring {
                stiffness,
                rest_length,
            };
            visit(place, law);
        }
    }
}

/// The same where one of the springs is very short or long, or something is not a finite
/// number.
#[cold]
#[inline(never)]
fn forces_one_by_one(x: [&Ends; 2], laws: Laws<'_>) -> Ends {
    let mut forces = [0.0; 3 * LANES];
    each_spring(laws, |place, law| {
        let [start, end] = x.map(|x| vector_at(x, place));
        set_vector_at(&mut forces, place, &spring::force(law, &start, &end));
    });
    forces
}

#[inline(always)]
fn energies_of<S: Simd>(simd: S, x: [&Ends; 2], laws: Laws<'_>) -> Lanes {
    let dx = differences(x);
    let squares = dots(&dx, &dx);
    let mut per_lengths = [0.0; LANES];
    let mut energies = [0.0; LANES];
    if divide(simd, &squares, laws, &mut per_lengths, None) {
        let (stiffnesses, rest_lengths) = laws;
        let lengths = squares.map(f64::sqrt);
        for c in 0..LANES {
            let stretch = lengths[c] - rest_lengths[c];
            energies[c] = 0.5 * stiffnesses[c] * stretch * stretch;
        }
        return energies;
    }
    each_spring(laws, |place, law| {
        energies[place] = law.energy(Separation::of(&vector_at(&dx, place)).length);
    });
    energies
}

/// Products on the first ends.
#[inline(always)]
fn products_of<S: Simd>(
    simd: S,
    x: [&Ends; 2],
    laws: Laws<'_>,
    projection: Projection,
    [first, second]: [&Ends; 2],
) -> Ends {
    let dx = differences(x);
    // The product is that of the block and y₀ − y₁.
    let dy = differences([second, first]);
    let squares = dots(&dx, &dx);
    let mut per_lengths = [0.0; LANES];
    if !divide(simd, &squares, laws, &mut per_lengths, None) {
        return products_one_by_one(x, laws, projection, &dy);
    }
    let (stiffnesses, _) = laws;
    let across = per_lengths.map(|per_length| projection.apply(per_length));
    let mut along = dots(&dx, &dy);
    for c in 0..LANES {
        along[c] *= (stiffnesses[c] - across[c]) / squares[c];
    }
    sums_of_multiples((&across, &dy), (&along, &dx))
}

/// a·x + b·y of every spring.
#[inline(always)]
fn sums_of_multiples((a, x): (&Lanes, &Ends), (b, y): (&Lanes, &Ends)) -> Ends {
    let mut sums = [0.0; 3 * LANES];
    for c in 0..LANES {
        sums[3 * c] = a[c] * x[3 * c] + b[c] * y[3 * c];
        sums[3 * c + 1] = a[c] * x[3 * c + 1] + b[c] * y[3 * c + 1];
        sums[3 * c + 2] = a[c] * x[3 * c + 2] + b[c] * y[3 * c + 2];
    }
    sums
}

#[cold]
#[inline(never)]
fn products_one_by_one(x: [&Ends; 2], laws: Laws<'_>, projection: Projection, dy: &Ends) -> Ends {
    let dx = differences(x);
    let mut products = [0.0; 3 * LANES];
    each_spring(laws, |place, law| {
        let dx = vector_at(&dx, place);
        let (_, block) = spring::linearize(law, None, &dx, |across| projection.apply(across));
        let product = times(&block, &vector_at(dy, place));
        set_vector_at(&mut products, place, &product);
    });
    products
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::{Emitter, Evaluation, Numbering, Projection, SpringBetween, Springs, Weights};
    use nalgebra::Vector3;
    use springs_math::spring::Spring;

    /// Numbers in [0, 1) that look random.
    pub(crate) struct Dice(pub(crate) u64);

    impl Dice {
        pub(crate) fn roll(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// A net of 30 by 40 nodes with springs to neighbours at all of these distances, some
    /// left out, in any order and direction.
    pub(crate) fn net(dice: &mut Dice) -> Vec<SpringBetween<Spring>> {
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

    /// To rounding, near and far from the origin, with coincident ends and without.
    #[test]
    fn energy_is_the_sum_of_those_of_springs_one_by_one() {
        let mut dice = Dice(3);
        let numbering = Numbering::new((0..1200).map(|node| node % 300 == 17));
        let mut springs = Springs::new("springs", &net(&mut dice));
        springs.number(&numbering);
        let one_by_one = springs.clone().one_by_one();
        for (scale, share) in [(1.0, 0.0), (1.0, 0.1), (1e3, 0.0), (1e-160, 0.0)] {
            let mut coordinate = || {
                if dice.roll() < share {
                    0.0
                } else {
                    dice.roll() * scale
                }
            };
            let x = Vec::from_iter((0..1200).map(|_| Vector3::from_fn(|_, _| coordinate())));
            let (fast, plain) = (springs.energy(&x), one_by_one.energy(&x));
            assert!((fast - plain).abs() < 1e-13 * plain, "{fast} {plain}");
            let [fast, plain] = [&springs, &one_by_one].map(|s| s.energy_on_free_blocks(&x));
            assert!((fast - plain).abs() < 1e-13 * plain, "{fast} {plain}");
        }
    }

    /// To rounding, with every projection; uniform motion gives exactly nothing.
    #[test]
    fn products_are_those_of_springs_one_by_one() {
        let mut dice = Dice(2);
        let numbering = Numbering::new((0..1200).map(|node| node % 300 == 17));
        let mut springs = Springs::new("springs", &net(&mut dice));
        springs.number(&numbering);
        let one_by_one = springs.clone().one_by_one();
        let mut vectors = || {
            let vector = |_| Vector3::from_fn(|_, _| dice.roll() - 0.5);
            Vec::from_iter((0..1200).map(vector))
        };
        let (apart, v, y) = (vectors(), vectors(), vectors());
        // Two nodes that coincide.
        let mut coincident = apart.clone();
        coincident[101] = coincident[100];
        for (x, projection) in [
            (&apart, Projection::None),
            (&apart, Projection::Clamp),
            (&coincident, Projection::None),
            (&coincident, Projection::Clamp),
            (&coincident, Projection::Absolute),
            (&coincident, Projection::Drop),
        ] {
            let at = Evaluation {
                projection,
                ..Evaluation::new(x, &v, Weights::of_step(0.1))
            };
            let mut numbers = Vec::new();
            springs.prepare_products(&at, &mut numbers);
            assert_eq!(numbers.is_empty(), x[100] == x[101]);
            let of = |springs: &Springs, y: &[Vector3<f64>], numbers: Option<&[f64]>| {
                let mut products = vec![Vector3::zeros(); numbering.n_free()];
                match numbers {
                    None => springs.add_products(&at, y, &mut products),
                    Some(numbers) => {
                        springs.add_prepared_products(&at, numbers, y, &mut products);
                    }
                }
                products
            };
            let plain = of(&one_by_one, &y, None);
            // Without what is fixed.
            let uniform = vec![Vector3::new(1.0, 2.0, 3.0); 1200];
            let held = |block: usize| {
                let ends = springs.connections_of(block);
                ends.into_iter().any(|end| numbering.is_fixed(end))
            };
            for numbers in [None, Some(&numbers[..])] {
                for (fast, plain) in of(&springs, &y, numbers).iter().zip(&plain) {
                    assert!((fast - plain).norm() < 1e-13 * plain.norm().max(1.0));
                }
                let nothing = of(&springs, &uniform, numbers);
                for (block, product) in nothing.iter().enumerate() {
                    assert!(held(block) || *product == Vector3::zeros());
                }
            }
        }
    }
}
