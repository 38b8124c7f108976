//! A system of some of the springs of another one.

use nalgebra::Vector3;
use springs_assembly::{Evaluation, System, Weights, compile};
use springs_scene::generate::{Material, cloth};
use springs_scene::{Guide, Node, Scene, SpringLaw};

/// A cloth with springs that only pull, anchors, and one spring twice.
fn scene() -> Scene {
    let mut scene = cloth(5, Material::of_cloth());
    for (index, node) in scene.nodes.iter_mut().enumerate() {
        let i = index as f64;
        node.position += Vector3::new((0.7 * i).sin(), (1.3 * i).cos(), (2.1 * i).sin()) * 0.05;
        node.fixed = index % 11 == 3;
    }
    scene.laws.push(SpringLaw::TensionOnly { blend: 0.0 });
    for spring in scene.springs.iter_mut().step_by(7) {
        spring.law = Some(0);
    }
    let twice = scene.springs[1];
    scene.springs.push(twice);
    scene
}

fn of_springs(system: &System, y: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let x = system.initial_positions();
    let at = Evaluation::new(x, system.initial_velocities(), Weights::STIFFNESS);
    let zeros = vec![Vector3::zeros(); system.n_free()];
    let (mut forces, mut product) = (zeros.clone(), zeros);
    system.static_forces(x, &mut forces);
    system.product(&at, y, &mut product);
    (forces, product)
}

/// Forces and Hessians of two parts are those of the whole.
#[test]
fn parts_add_up_to_the_whole() {
    let mut scene = scene();
    scene.gravity = Vector3::zeros();
    let system = compile(&scene).unwrap();
    let kept: Vec<bool> = (0..system.n_carried())
        .map(|index| index % 3 == 1)
        .collect();
    let others: Vec<bool> = kept.iter().map(|kept| !kept).collect();
    let parts = [&kept, &others].map(|kept| system.part(kept).unwrap());
    let y: Vec<Vector3<f64>> = (0..scene.nodes.len())
        .map(|i| Vector3::from_fn(|axis, _| (1.7 * i as f64 + axis as f64).sin()))
        .collect();
    let (forces, product) = of_springs(&system, &y);
    let [of_first, of_second] = [0, 1].map(|which: usize| of_springs(&parts[which].system, &y));
    let mut n_live = 0;
    system.each_carried_term(|blocks, _| n_live += usize::from(!blocks.is_empty()));
    assert_eq!(parts[0].of_whole.len() + parts[1].of_whole.len(), n_live);
    for block in 0..system.n_free() {
        let force = of_first.0[block] + of_second.0[block] - forces[block];
        let changed = of_first.1[block] + of_second.1[block] - product[block];
        assert!(
            force.norm() < 1e-9 * (1.0 + forces[block].norm()),
            "{force}"
        );
        assert!(
            changed.norm() < 1e-9 * (1.0 + product[block].norm()),
            "{changed}"
        );
    }
    for part in &parts {
        let (mut of_part, mut of_all) = (
            vec![0.0; part.of_whole.len()],
            vec![0.0; system.n_carried()],
        );
        part.system
            .carried(system.initial_positions(), &mut of_part);
        system.carried(system.initial_positions(), &mut of_all);
        for (tension, &whole) in of_part.iter().zip(&part.of_whole) {
            assert_eq!(*tension, of_all[whole as usize]);
        }
    }
}

/// Where something else is in the matrix there are none.
#[test]
fn damping_and_guides_keep_a_system_together() {
    let mut damped = scene();
    damped.springs[0].damping = 1.0;
    let mut dragged = scene();
    dragged.nodes[0] = Node {
        drag: Some(0.1),
        ..dragged.nodes[0]
    };
    let mut guided = scene();
    guided.nodes[0].guide = Some(Guide::Held([true, false, false]));
    for scene in [damped, dragged, guided] {
        let system = compile(&scene).unwrap();
        assert!(system.part(&vec![true; system.n_carried()]).is_none());
    }
}
