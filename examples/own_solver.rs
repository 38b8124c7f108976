//! The kernels alone, with somebody else's solver.
//!
//! A weight hangs from three springs. Newton's method with nalgebra's dense
//! Cholesky finds where it comes to rest; of the workspace only `springs-math`
//! is used.
//!
//! ```text
//! cargo run --example own_solver
//! ```

use nalgebra::{Matrix3, Vector3};
use springs_math::spring::{Spring, force, hessian_block};

fn main() {
    let hooks = [
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::new(-0.5, 0.8, 0.0),
        Vector3::new(-0.5, -0.8, 0.2),
    ];
    let spring = Spring {
        stiffness: 200.0,
        rest_length: 1.0,
    };
    let weight = Vector3::new(0.0, 0.0, -2.0 * 9.81);

    let mut x = Vector3::new(0.1, 0.0, -1.0);
    for iteration in 0.. {
        let total: Vector3<f64> = hooks.iter().map(|hook| force(spring, &x, hook)).sum();
        let residual = total + weight;
        println!("iteration {iteration}: residual {:.1e} N", residual.norm());
        if residual.norm() < 1e-10 {
            break;
        }
        let hessian: Matrix3<f64> = hooks
            .iter()
            .map(|hook| hessian_block(spring, &x, hook))
            .sum();
        let cholesky = hessian.cholesky().expect("three stretched springs hold it");
        x += cholesky.solve(&residual);
    }
    println!("at rest at ({:.6}, {:.6}, {:.6}) m", x.x, x.y, x.z);
}
