//! The tolerance against the error that a run ends with. `cargo bench --bench
//! tolerance` makes the whole table.

mod common;

use common::moving::moving_scenes;
use common::{distance, growth, reference, solved};
use springs_scene::Method;

/// The error stays within ten times the tolerance, or more where the scene
/// itself makes errors grow, and falls with it.
#[test]
fn the_error_follows_the_tolerance() {
    for scene in moving_scenes() {
        let (reference, trusted) = reference(&scene);
        assert!(trusted < 1e-8, "{}: {trusted:e}", scene.name);
        let growth = growth(&scene, &reference).max(1.0);
        let is_damped = scene.springs.iter().any(|spring| spring.damping > 0.0);
        for method in [
            Method::TrBdf2,
            Method::Dop853,
            Method::Rodas4,
            Method::ImplicitEuler,
            Method::ImplicitMidpoint,
            Method::VelocityVerlet,
            Method::BlanesMoan4,
            Method::BlanesMoan6,
        ] {
            let treats_dashpots = !matches!(
                method,
                Method::Rodas4 | Method::BlanesMoan4 | Method::BlanesMoan6
            );
            if is_damped && !treats_dashpots {
                continue;
            }
            let (mut last, mut last_tolerance) = (f64::INFINITY, f64::INFINITY);
            // Order 1 takes too many steps for more.
            let n = if method == Method::ImplicitEuler {
                2
            } else {
                3
            };
            for tolerance in &[1e-1, 1e-2, 1e-3][..n] {
                let error = distance(&solved(&scene, method, *tolerance), &reference);
                let what = format!("{}, {method}, {tolerance:e}: {error:e}", scene.name);
                assert!(error < 10.0 * growth * tolerance, "{what}");
                // A result much better than what the tolerance and the growth
                // of errors come to is luck, and need not be had again.
                let was_careful = last < 0.1 * growth * last_tolerance;
                assert!(error <= last || was_careful, "{what} after {last:e}");
                (last, last_tolerance) = (error, *tolerance);
            }
        }
    }
}
