//! Once warm, a step allocates nothing; the pattern is factorized once.

mod common;

use allocation_counter::measure;
use common::{tangle, with};
use springs_scene::generate::{Material, block, chain};
use springs_scene::{Method, Scene, Tangent};
use springs_step::{NodeStates, Simulation, Stepper};

fn variants(scene: &Scene) -> Vec<Scene> {
    let implicit = Tangent::ALL
        .iter()
        .map(|&tangent| with(scene, Method::LinearlyImplicitEuler, Some(tangent), 0.05));
    implicit
        .chain([with(scene, Method::VelocityVerlet, None, 1e-4)])
        .collect()
}

#[test]
fn a_warm_step_allocates_nothing() {
    // Simplicial and supernodal, with dashpots, moving anchors and clamping.
    let scenes = [
        chain(40, Material::of_chain(40)),
        block(5, Material::of_block()),
        tangle(40, 8),
    ];
    for scene in scenes.iter().flat_map(variants) {
        let h = match scene.settings.step {
            springs_scene::StepControl::Fixed(h) => h,
            _ => unreachable!(),
        };
        let mut stepper = Stepper::new(&scene).unwrap();
        let mut nodes = NodeStates::of(&scene);
        let mut steps = |n: usize| {
            for _ in 0..n {
                stepper.step(&mut nodes, h).unwrap();
            }
        };
        steps(2);
        let allocations = measure(|| steps(20)).count_total;
        let (name, settings) = (&scene.name, &scene.settings);
        assert_eq!(allocations, 0, "{name}: {settings:?}");
    }
}

#[test]
fn the_pattern_is_factorized_once() {
    let mut scene = block(4, Material::of_block());
    scene.settings.duration = 2.0;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.run(10, &mut ()).unwrap();
    let counts = simulation.work().counts;
    assert_eq!(counts.steps, 120);
    assert_eq!(counts.symbolic_factorizations, 1);
    assert!(counts.factorizations >= 120);
    assert_eq!(counts.solves, 120);
}
