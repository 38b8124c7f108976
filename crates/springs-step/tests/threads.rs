//! The same bits on any number of threads.

mod common;

use common::with;
use springs_scene::generate::{Material, cloth, disturb};
use springs_scene::{Method, RunOptions, Scene};
use springs_step::Simulation;

fn run(scene: &Scene, threads: usize) -> Simulation {
    let options = RunOptions::default().with_threads(threads);
    let mut simulation = Simulation::with_options(scene, &options).unwrap();
    simulation.run(1, &mut ()).unwrap();
    simulation
}

/// A cloth large enough for its factorization to be shared out.
#[test]
fn every_method_gives_the_same_bits() {
    let mut scene = cloth(36, Material::of_cloth());
    for spring in &mut scene.springs {
        spring.damping = 0.0;
        // Explicit methods are stable at the step below.
        spring.stiffness *= 0.05;
    }
    disturb(&mut scene, 1e-3, 3);
    scene.settings.duration = 0.004;
    for &method in Method::ALL {
        if method == Method::Auto {
            continue;
        }
        let scene = with(&scene, method, None, 0.001);
        let alone = run(&scene, 1);
        for threads in [2, 3, 8] {
            let together = run(&scene, threads);
            assert_eq!(alone.nodes(), together.nodes(), "{method}, {threads}");
            assert_eq!(alone.work().counts, together.work().counts, "{method}");
        }
    }
}

/// A cloth large enough for its explicit steps to be shared out, with an odd number of
/// nodes, some of them fixed, dashpots and moving corners.
#[test]
fn explicit_methods_give_the_same_bits_on_large_scenes() {
    let mut scene = cloth(151, Material::of_cloth());
    disturb(&mut scene, 1e-3, 3);
    scene.settings.duration = 2e-5;
    for (node, of) in scene.nodes.iter_mut().enumerate() {
        of.fixed |= node % 997 == 5;
        if of.fixed {
            of.velocity.z = 0.3;
        }
    }
    for method in [
        Method::VelocityVerlet,
        Method::BlanesMoan4,
        Method::BlanesMoan6,
        Method::Dop853,
    ] {
        let mut scene = with(&scene, method, None, 1e-5);
        if method != Method::VelocityVerlet {
            scene
                .springs
                .iter_mut()
                .for_each(|spring| spring.damping = 0.0);
        }
        let alone = run(&scene, 1);
        assert_eq!(alone.work().counts.steps, 2);
        for threads in [2, 3, 8] {
            let together = run(&scene, threads);
            assert!(alone.nodes() == together.nodes(), "{method}, {threads}");
            assert_eq!(alone.energy(), together.energy(), "{method}, {threads}");
        }
    }
}
