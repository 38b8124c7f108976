//! What springs make of errors of velocities.

use crate::vectors::largest_magnitude;
use crate::work::timed;
use crate::{Method, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, PreparedProducts, Projection, System, Weights};

/// Solves (M + TD + T²S) y = M e: with the matrix of a method, or by conjugate
/// gradients with the masses as preconditioner and products spring by spring.
#[derive(Default)]
pub(crate) struct Response {
    y: Vec<Vector3<f64>>,
    /// M⁻¹ times the residual.
    residual: Vec<Vector3<f64>>,
    direction: Vec<Vector3<f64>>,
    product: Vec<Vector3<f64>>,
    prepared: PreparedProducts,
}

/// The residual may be this part of the solution: an estimate needs no more.
const ACCURACY: f64 = 0.3;
/// A bound that is found in fewer iterations is better than more of them.
const MOST_ITERATIONS: u32 = 32;

impl Response {
    /// y = (M + TD + T²S)⁻¹M e by the matrix of the method, with T = `time_scale`
    /// in s and S the Hessian with its negative across stiffness clamped; `None` if
    /// there is no matrix or it cannot be solved with.
    pub(crate) fn by_matrix(
        &mut self,
        method: &mut dyn Method,
        (system, state): (&System, &State),
        time_scale: f64,
        errors: &[Vector3<f64>],
        work: &mut Work,
    ) -> Option<&mut Vec<Vector3<f64>>> {
        self.y.clear();
        self.y.extend_from_slice(errors);
        let is_solved = method.damp_vibrations(system, state, time_scale, &mut self.y, work);
        is_solved.then_some(&mut self.y)
    }

    /// A bound on the largest component of the same y without a matrix. Products
    /// are not counted: what a single trial step costs would seem to be what every
    /// step costs.
    ///
    /// What is still missing after an iteration is no more than M⁻¹ times the
    /// residual, because the matrix is no less than M. Gives the number of iterations,
    /// too.
    pub(crate) fn bound(
        &mut self,
        (system, state): (&System, &State),
        time_scale: f64,
        errors: &[Vector3<f64>],
        work: &mut Work,
    ) -> (f64, u32) {
        let masses = system.masses();
        let mut bound = largest_magnitude(errors);
        let mut remaining = product(masses, errors, errors);
        if masses.contains(&0.0) || remaining == 0.0 {
            return (bound, 0);
        }
        let at = Evaluation {
            projection: Projection::Clamp,
            ..Evaluation::new(&state.x, &state.v, Weights::of_step(time_scale))
        };
        let zeros = std::iter::repeat_n(Vector3::zeros(), errors.len());
        self.y.clear();
        self.y.extend(zeros.clone());
        self.product.clear();
        self.product.extend(zeros);
        for vectors in [&mut self.residual, &mut self.direction] {
            vectors.clear();
            vectors.extend_from_slice(errors);
        }
        timed(&mut work.phases.assembly, || {
            system.prepare_products(&at, &mut self.prepared);
        });
        let mut n_iterations = 0;
        while n_iterations < MOST_ITERATIONS {
            n_iterations += 1;
            timed(&mut work.phases.assembly, || {
                system.prepared_product(&at, &self.prepared, &self.direction, &mut self.product);
            });
            let products = self.direction.iter().zip(&self.product);
            let length = remaining / products.map(|(d, p)| d.dot(p)).sum::<f64>();
            for (block, mass) in masses.iter().enumerate() {
                self.y[block] += self.direction[block] * length;
                self.residual[block] -= self.product[block] * (length / mass);
            }
            let (found, missing) = (
                largest_magnitude(&self.y),
                largest_magnitude(&self.residual),
            );
            bound = bound.min(found + missing);
            if missing <= ACCURACY * found {
                break;
            }
            let last = remaining;
            remaining = product(masses, &self.residual, &self.residual);
            for (direction, residual) in self.direction.iter_mut().zip(&self.residual) {
                *direction = residual + *direction * (remaining / last);
            }
        }
        (bound, n_iterations)
    }
}

/// aᵀM b.
fn product(masses: &[f64], a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let terms = masses.iter().zip(a.iter().zip(b));
    terms.map(|(mass, (a, b))| mass * a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImplicitEuler;
    use springs_assembly::compile;
    use springs_scene::RunOptions;
    use springs_scene::generate::{Material, cloth};

    /// Errors from the stiffest to the smoothest, and times from less than a
    /// vibration to many.
    #[test]
    fn the_bound_is_little_more_than_the_solution() {
        let system = compile(&cloth(6, Material::of_cloth())).unwrap();
        let state = State::initial(&system);
        let work = &mut Work::default();
        let mut method = ImplicitEuler::new(&system, &RunOptions::default()).unwrap();
        let mut response = Response::default();
        let at = (&system, &state);
        for waves in [0.1, 1.0, 2.0, 3.0] {
            let wave = |k| Vector3::new(1.0, 0.5, -0.3) * (waves * k as f64).cos();
            let errors: Vec<_> = (0..system.n_free()).map(wave).collect();
            for angle in [0.1, 1.0, 10.0, 100.0] {
                let time = angle / system.frequency_bound();
                let y = response.by_matrix(&mut method, at, time, &errors, work);
                let exact = largest_magnitude(y.unwrap());
                let (bound, _) = response.bound(at, time, &errors, work);
                let what = format!("{waves}, {angle}: {bound} for {exact}");
                // Iterations are given up before long times are met exactly.
                let most = if angle > 10.0 { 4.0 } else { 1.4 };
                assert!(bound > 0.95 * exact && bound < most * exact, "{what}");
            }
        }
    }
}
