//! Dashpots along runs, several at once.

use crate::lanes::{
    Ends, Lanes, Safety, add_to_ends, differences, dots, lanes_at, set_vector_at, slots, vector_at,
};
use crate::run::{LANES, Run};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use springs_math::dashpot::{self, Dashpot};

/// c of dashpots along runs, slot by slot, in N·s/m; zero where a slot has none.
#[derive(Clone, Debug)]
pub(super) struct DashpotRuns(Vec<f64>);

/// Two vectors of every block: positions and velocities.
type Pair<'a> = [&'a [Vector3<f64>]; 2];

impl DashpotRuns {
    /// Of dashpots with these ends.
    pub(super) fn new(runs: &[Run], ends: &[[u32; 2]], damping: impl Fn(usize) -> f64) -> Self {
        let n_slots = slots(runs).last().map_or(0, |(_, slots)| slots.end);
        let mut numbers = vec![0.0; n_slots];
        for (run, slots) in slots(runs) {
            for index in run.connections.clone() {
                numbers[slots.start + ends[index][0] as usize - run.first] = damping(index);
            }
        }
        Self(numbers)
    }

    /// Adds `weight` times the forces of [`dashpot::force`] at positions and velocities to
    /// sums, which are those of the blocks from `first` on; the same but for rounding.
    ///
    /// # Panics
    ///
    /// If a slice does not have all blocks of the runs.
    pub(super) fn add_forces(
        &self,
        runs: &[Run],
        state: Pair<'_>,
        weight: f64,
        (first, sums): (usize, &mut [Vector3<f64>]),
    ) {
        Arch::new().dispatch(AddForces {
            numbers: self,
            runs,
            state: state.map(bytemuck::cast_slice),
            weight,
            first,
            sums: bytemuck::cast_slice_mut(sums),
        });
    }

    /// The heat that they produce at positions and velocities, in W; of
    /// [`dashpot::dissipation`] but for rounding.
    ///
    /// # Panics
    ///
    /// If a slice does not have all blocks of the runs.
    pub(super) fn dissipation(&self, runs: &[Run], state: Pair<'_>) -> f64 {
        Arch::new().dispatch(SumOfHeats {
            numbers: self,
            runs,
            state: state.map(bytemuck::cast_slice),
        })
    }

    /// Hands over the blocks at the first and the second end of the first of all lanes, and c.
    #[inline(always)]
    fn each_lanes(&self, runs: &[Run], mut visit: impl FnMut([usize; 2], &Lanes)) {
        for (run, slots) in slots(runs) {
            let (damping, _) = self.0[slots].as_chunks();
            let mut block = run.first;
            for damping in damping {
                visit([block, block + run.offset], damping);
                block += LANES;
            }
        }
    }
}

struct AddForces<'a> {
    numbers: &'a DashpotRuns,
    runs: &'a [Run],
    /// Coordinates of one block after the other, as are the sums.
    state: [&'a [f64]; 2],
    weight: f64,
    /// Block of the first sum.
    first: usize,
    sums: &'a mut [f64],
}

impl WithSimd for AddForces<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.numbers.each_lanes(self.runs, |at, damping| {
            let [x, v] = self.state;
            let state = [at.map(|at| lanes_at(x, at)), at.map(|at| lanes_at(v, at))];
            let forces = forces_of(simd, state, damping, self.weight);
            add_to_ends(simd, self.sums, at.map(|block| block - self.first), &forces);
        });
    }
}

struct SumOfHeats<'a> {
    numbers: &'a DashpotRuns,
    runs: &'a [Run],
    state: [&'a [f64]; 2],
}

impl WithSimd for SumOfHeats<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let mut sums = [0.0; LANES];
        self.numbers.each_lanes(self.runs, |at, damping| {
            let [x, v] = self.state;
            let state = [at.map(|at| lanes_at(x, at)), at.map(|at| lanes_at(v, at))];
            let heats = heats_of(simd, state, damping);
            for (sum, heat) in sums.iter_mut().zip(&heats) {
                *sum += heat;
            }
        });
        sums.iter().sum()
    }
}

/// Forces on the first ends, times a weight: c (w·Δx)/l² Δx.
#[inline(always)]
fn forces_of<S: Simd>(simd: S, state: [[&Ends; 2]; 2], damping: &Lanes, weight: f64) -> Ends {
    // One by one: `map` would not be compiled for the instructions at hand.
    let [x, v] = state;
    let (mut forces, speeds) = (differences(x), differences(v));
    let squares = dots(&forces, &forces);
    let mut factors = dots(&forces, &speeds);
    if !divide(simd, &squares, damping, &mut factors) {
        return forces_one_by_one(state, damping, weight);
    }
    for factor in &mut factors {
        *factor *= weight;
    }
    for c in 0..LANES {
        forces[3 * c] *= factors[c];
        forces[3 * c + 1] *= factors[c];
        forces[3 * c + 2] *= factors[c];
    }
    forces
}

/// c (w·Δx)²/l².
#[inline(always)]
fn heats_of<S: Simd>(simd: S, state: [[&Ends; 2]; 2], damping: &Lanes) -> Lanes {
    let [x, v] = state;
    let (dx, speeds) = (differences(x), differences(v));
    let (squares, rates) = (dots(&dx, &dx), dots(&dx, &speeds));
    let mut heats = rates;
    if divide(simd, &squares, damping, &mut heats) {
        for (heat, rate) in heats.iter_mut().zip(&rates) {
            *heat *= rate;
        }
        return heats;
    }
    for (place, heat) in heats.iter_mut().enumerate() {
        let [x, v] = state.map(|ends| ends.map(|end| vector_at(end, place)));
        let dashpot = Dashpot {
            damping: damping[place],
        };
        *heat = if dashpot.damping == 0.0 {
            0.0
        } else {
            dashpot::dissipation(dashpot, x.each_ref(), v.each_ref())
        };
    }
    heats
}

/// Makes c (w·Δx)/l² of w·Δx; says whether all l² are safe and all results are finite.
#[inline(always)]
fn divide<S: Simd>(simd: S, squares: &Lanes, damping: &Lanes, factors: &mut Lanes) -> bool {
    let mut safety = Safety::new(simd);
    let (squares, _) = S::as_simd_f64s(squares);
    let (damping, _) = S::as_simd_f64s(damping);
    let (factors, _) = S::as_mut_simd_f64s(factors);
    for (factor, (&square, &c)) in factors.iter_mut().zip(squares.iter().zip(damping)) {
        *factor = simd.div_f64s(simd.mul_f64s(c, *factor), square);
        safety.note(square, *factor);
    }
    safety.is_given()
}

/// The same where one of the dashpots is very short or long, or something is not a finite
/// number.
#[cold]
#[inline(never)]
fn forces_one_by_one(state: [[&Ends; 2]; 2], damping: &Lanes, weight: f64) -> Ends {
    let mut forces = [0.0; 3 * LANES];
    for (place, &damping) in damping.iter().enumerate() {
        if damping != 0.0 {
            let [x, v] = state.map(|ends| ends.map(|end| vector_at(end, place)));
            let force = dashpot::force(Dashpot { damping }, x.each_ref(), v.each_ref());
            set_vector_at(&mut forces, place, &(force * weight));
        }
    }
    forces
}

#[cfg(test)]
mod tests {
    use super::super::Dashpots;
    use crate::linear_runs::tests::{Dice, net};
    use crate::{Emitter, Evaluation, Numbering, Weights};
    use nalgebra::Vector3;

    /// To rounding, where dashpots are of usual lengths, and where some are too short or too
    /// long to be squared or have coincident ends.
    #[test]
    fn what_they_give_is_what_dashpots_one_by_one_give() {
        let mut dice = Dice(5);
        let numbering = Numbering::new((0..1200).map(|node| node % 300 == 17));
        let springs = net(&mut dice);
        let dashpots: Vec<_> = springs
            .iter()
            .map(|spring| (spring.nodes, dice.roll()))
            .collect();
        let mut dashpots = Dashpots::new(&dashpots);
        dashpots.number(&numbering);
        assert!(dashpots.connections.runs().len() > 5);
        let one_by_one = Dashpots {
            in_runs: None,
            ..dashpots.clone()
        };
        for (share, odd) in [(0.0, 0.0), (0.02, 1e-170), (0.02, 1e170), (0.02, 0.0)] {
            let mut vectors = || {
                let mut coordinate = || {
                    if dice.roll() < share {
                        odd
                    } else {
                        dice.roll() - 0.5
                    }
                };
                let vector = |_| Vector3::from_fn(|_, _| coordinate());
                Vec::from_iter((0..1200).map(vector))
            };
            let (mut x, v, y) = (vectors(), vectors(), vectors());
            x[101] = x[100];
            let of = |dashpots: &Dashpots| {
                let mut sums = [(); 2].map(|()| vec![Vector3::zeros(); numbering.n_free()]);
                dashpots.add_damping_forces(&x, &v, &mut sums[0]);
                let at = Evaluation::new(&x, &v, Weights::of_damping(0.3));
                dashpots.add_products(&at, &y, &mut sums[1]);
                (sums, dashpots.dissipation(&x, &v))
            };
            let ((fast, heat), (plain, plain_heat)) = (of(&dashpots), of(&one_by_one));
            for (fast, plain) in fast.iter().flatten().zip(plain.iter().flatten()) {
                assert!((fast - plain).norm() <= 1e-13 * plain.norm().max(1.0));
            }
            let is_same = (heat - plain_heat).abs() <= 1e-13 * plain_heat;
            assert!(is_same || heat == plain_heat, "{heat} {plain_heat}");
        }
    }
}
