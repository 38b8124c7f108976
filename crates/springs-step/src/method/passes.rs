//! Passes of explicit methods over all free blocks.

use crate::vectors::{WIDTH, numbers_mut};
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use springs_threads::{share_of_pass, share_of_pass_here, share_out};

/// Blocks that are worked off at once.
const LANES: usize = WIDTH / 3;

/// Adds a·`kick` to the velocities, and then v·`drift` to the positions.
pub(super) fn kick_and_drift(
    a: &[Vector3<f64>],
    kick: f64,
    v: &mut [Vector3<f64>],
    drift: f64,
    x: &mut [Vector3<f64>],
) {
    // As many as there are free blocks.
    let n_free = a.len();
    let (v, x) = (&mut v[..n_free], &mut x[..n_free]);
    let Some(share) = share_of_pass_here(n_free) else {
        return kick_and_drift_at_once(a, kick, v, drift, x);
    };
    let states = v.chunks_mut(share).zip(x.chunks_mut(share));
    share_out(a.chunks(share).zip(states), |(a, (v, x))| {
        kick_and_drift_at_once(a, kick, v, drift, x);
    });
}

fn kick_and_drift_at_once(
    a: &[Vector3<f64>],
    kick: f64,
    v: &mut [Vector3<f64>],
    drift: f64,
    x: &mut [Vector3<f64>],
) {
    let a: &[f64] = bytemuck::cast_slice(a);
    let (v, x) = (numbers_mut(v), numbers_mut(x));
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for ((x, v), a) in x.iter_mut().zip(v).zip(a) {
                *v += a * kick;
                *x += *v * drift;
            }
        },
    );
}

/// Adds a·`kick` to the velocities; gives the kinetic energy, in J, that there is then, if
/// that and the squares of all positions and velocities are finite numbers.
pub(super) fn last_kick(
    a: &[Vector3<f64>],
    kick: f64,
    v: &mut [Vector3<f64>],
    x: &[Vector3<f64>],
    masses: &[f64],
) -> Option<f64> {
    // As many as there are free blocks.
    let n_free = a.len();
    let (free, fixed) = x.split_at(n_free);
    let v = &mut v[..n_free];
    let work = |((a, v), (x, masses)): ((&[_], &mut [_]), (&[_], &[f64]))| {
        Arch::new().dispatch(LastKick {
            a: bytemuck::cast_slice::<Vector3<f64>, f64>(a),
            kick,
            v: numbers_mut(v),
            x: bytemuck::cast_slice::<Vector3<f64>, f64>(x),
            masses,
        })
    };
    let [twice, squares] = match share_of_pass(n_free) {
        None => work(((a, v), (free, masses))),
        Some(share) => {
            let kicked = a.chunks(share).zip(v.chunks_mut(share));
            let others = free.chunks(share).zip(masses.chunks(share));
            let sums = share_out(kicked.zip(others), work);
            let add = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a + c, b + d];
            sums.into_iter().fold([0.0; 2], add)
        }
    };
    let fixed: &[f64] = bytemuck::cast_slice(fixed);
    let squares = fixed.iter().fold(squares, |sum, x| sum + x * x);
    let kinetic = 0.5 * twice;
    (squares.is_finite() && kinetic.is_finite()).then_some(kinetic)
}

/// Gives Σ m v² with the velocities that have had their kick, and Σ x².
struct LastKick<'a> {
    a: &'a [f64],
    kick: f64,
    v: &'a mut [f64],
    x: &'a [f64],
    masses: &'a [f64],
}

impl WithSimd for LastKick<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> [f64; 2] {
        let mut twice = [0.0; WIDTH];
        let mut squares = [0.0; WIDTH];
        let (v, v_rest) = self.v.as_chunks_mut::<WIDTH>();
        let (a, a_rest) = self.a.as_chunks::<WIDTH>();
        let (x, x_rest) = self.x.as_chunks::<WIDTH>();
        let (masses, masses_rest) = self.masses.as_chunks::<LANES>();
        for ((v, a), (x, mass)) in v.iter_mut().zip(a).zip(x.iter().zip(masses)) {
            let [m, n, o, p] = *mass;
            let mass = [m, m, m, n, n, n, o, o, o, p, p, p];
            // One simple loop for each, which compilers turn into a few instructions.
            for (v, a) in v.iter_mut().zip(a) {
                *v += a * self.kick;
            }
            for (sum, (v, mass)) in twice.iter_mut().zip(v.iter().zip(&mass)) {
                *sum += v * v * mass;
            }
            for (sum, x) in squares.iter_mut().zip(x) {
                *sum += x * x;
            }
        }
        for (c, ((v, a), x)) in v_rest.iter_mut().zip(a_rest).zip(x_rest).enumerate() {
            *v += a * self.kick;
            twice[c] += *v * *v * masses_rest[c / 3];
            squares[c] += x * x;
        }
        [twice.iter().sum(), squares.iter().sum()]
    }
}

/// Adds a times each factor to the errors, or sets them to that.
pub(super) fn add_to_errors(
    a: &[Vector3<f64>],
    factors: [f64; 2],
    are_set: bool,
    [e_x, e_v]: [&mut [Vector3<f64>]; 2],
) {
    let work = |(a, (e_x, e_v)): (&[_], (&mut [_], &mut [_]))| {
        Arch::new().dispatch(AddToErrors {
            a: bytemuck::cast_slice::<Vector3<f64>, f64>(a),
            factors,
            are_set,
            errors: [numbers_mut(e_x), numbers_mut(e_v)],
        });
    };
    let Some(share) = share_of_pass_here(a.len()) else {
        return work((a, (e_x, e_v)));
    };
    let errors = e_x.chunks_mut(share).zip(e_v.chunks_mut(share));
    share_out(a.chunks(share).zip(errors), work);
}

struct AddToErrors<'a> {
    a: &'a [f64],
    factors: [f64; 2],
    are_set: bool,
    errors: [&'a mut [f64]; 2],
}

impl WithSimd for AddToErrors<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let ([of_x, of_v], [e_x, e_v]) = (self.factors, self.errors);
        let errors = self.a.iter().zip(e_x.iter_mut().zip(e_v));
        if self.are_set {
            for (a, (e_x, e_v)) in errors {
                *e_x = of_x * a;
                *e_v = of_v * a;
            }
        } else {
            for (a, (e_x, e_v)) in errors {
                *e_x += of_x * a;
                *e_v += of_v * a;
            }
        }
    }
}

/// Sets errors to a₁ − a₀ and 2a₁ − a₀ − a₂, each times its factor.
pub(super) fn set_errors_of_pair(
    factors: [f64; 2],
    accelerations: [&[Vector3<f64>]; 3],
    errors: [&mut [Vector3<f64>]; 2],
) {
    let accelerations = accelerations.map(bytemuck::cast_slice);
    Arch::new().dispatch(ErrorsOfPair {
        factors,
        accelerations,
        errors: errors.map(numbers_mut),
    });
}

struct ErrorsOfPair<'a> {
    factors: [f64; 2],
    accelerations: [&'a [f64]; 3],
    errors: [&'a mut [f64]; 2],
}

impl WithSimd for ErrorsOfPair<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let ([a0, a1, a2], [e_x, e_v]) = (self.accelerations, self.errors);
        let [of_turn, of_bend] = self.factors;
        for ((a0, (a1, a2)), (e_x, e_v)) in a0
            .iter()
            .zip(a1.iter().zip(a2))
            .zip(e_x.iter_mut().zip(e_v))
        {
            let turn = a1 - a0;
            *e_x = of_turn * turn;
            *e_v = of_bend * (turn + (a1 - a2));
        }
    }
}

/// Sets the third to `factor`·(a − b).
pub(super) fn set_multiple_of_difference(
    factor: f64,
    a: &[Vector3<f64>],
    b: &[Vector3<f64>],
    multiple: &mut [Vector3<f64>],
) {
    for (multiple, (a, b)) in multiple.iter_mut().zip(a.iter().zip(b)) {
        *multiple = (a - b) * factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vectors(n: usize, of: impl Fn(f64) -> f64) -> Vec<Vector3<f64>> {
        let component = |index: usize| of(index as f64);
        (0..n)
            .map(|i| Vector3::from_fn(|axis, _| component(3 * i + axis)))
            .collect()
    }

    /// Beside the plain formulas, with numbers of blocks that leave rests of all kinds.
    #[test]
    fn they_do_what_the_formulas_say() {
        for n_free in 0..11 {
            let n = n_free + 2;
            let (mut x, mut v) = (vectors(n, f64::sin), vectors(n, f64::cos));
            let a = vectors(n_free, |i| 0.1 * i);
            let masses: Vec<f64> = (0..n_free).map(|i| 1.0 + i as f64).collect();
            let (mut expected_x, mut expected_v) = (x.clone(), v.clone());
            for i in 0..n_free {
                expected_v[i] += a[i] * 0.3;
                expected_x[i] += expected_v[i] * 0.2;
            }
            kick_and_drift(&a, 0.3, &mut v, 0.2, &mut x);
            assert_eq!((&x, &v), (&expected_x, &expected_v));
            let kinetic = last_kick(&a, 0.7, &mut v, &x, &masses).unwrap();
            let mut expected = 0.0;
            for i in 0..n_free {
                expected_v[i] += a[i] * 0.7;
                expected += 0.5 * masses[i] * expected_v[i].norm_squared();
            }
            assert_eq!(v, expected_v);
            assert!((kinetic - expected).abs() <= 1e-14 * expected);
        }
    }

    #[test]
    fn what_is_not_finite_is_found_wherever_it_is() {
        let n_free = 7;
        let masses = vec![1.0; n_free];
        let a = vec![Vector3::zeros(); n_free];
        for component in 0..3 * n_free {
            for wrong in [f64::NAN, f64::INFINITY, 1e200] {
                let (x, mut v) = (vectors(9, f64::sin), vectors(9, f64::cos));
                numbers_mut(&mut v)[component] = wrong;
                assert_eq!(last_kick(&a, 1.0, &mut v, &x, &masses), None);
            }
        }
        for component in 0..27 {
            let (mut x, mut v) = (vectors(9, f64::sin), vectors(9, f64::cos));
            numbers_mut(&mut x)[component] = f64::NAN;
            assert_eq!(last_kick(&a, 1.0, &mut v, &x, &masses), None);
        }
    }
}
