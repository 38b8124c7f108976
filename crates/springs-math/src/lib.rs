//! Energy, force and Hessian kernels of mass-spring systems.
//!
//! Formulas of one term at a time, for someone with their own solver: the
//! [`spring`] with its [laws](law), the [`dashpot`] along a spring and [`gravity`].
//! Functions are generic over the dimension `D` = 1, 2 or 3, allocate nothing (only
//! laws that are made of lists own them), and know neither node indices nor matrices
//! nor time. [`spring::linearize`] gives force and block of a spring in space at once,
//! for inner loops.
//!
//! Signs, once: a force is f = −∂V/∂x and a Hessian is H = +∂²V/∂x². With
//! Δx = x₁ − x₀, the force on node 0 of a stretched spring points along +Δx.
//! "Eq. n" is equation n of the note *Springs* (2013).
//!
//! ```
//! use nalgebra::Vector3;
//! use springs_math::spring::{self, Spring};
//!
//! let spring = Spring { stiffness: 100.0, rest_length: 1.0 };
//! let (x0, x1) = (Vector3::zeros(), Vector3::new(0.0, 0.0, 1.5));
//! assert_eq!(spring::energy(spring, &x0, &x1), 12.5);
//! assert_eq!(spring::force(spring, &x0, &x1), Vector3::new(0.0, 0.0, 50.0));
//! ```
//!
//! Without the default feature `std` the crate is `no_std` and needs `alloc`.

#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

pub mod dashpot;
pub mod gravity;
pub mod law;
mod separation;
pub mod spring;

pub use separation::{COINCIDENT, SAFE_SQUARES, Separation};
