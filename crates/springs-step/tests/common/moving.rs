//! Scenes that really move, soft to very stiff, short enough that none of them
//! becomes chaotic.

use super::tangle;
use nalgebra::Vector3;
use springs_scene::generate::{Material, block, chain, cloth, disturb};
use springs_scene::{Node, Scene};

pub fn with_gravity(name: &str) -> Scene {
    Scene {
        name: name.to_owned(),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    }
}

/// A mass of 1 kg released level, 1 m from its hook.
pub fn pendulum(stiffness: f64) -> Scene {
    let mut scene = with_gravity(&format!("pendulum, K = {stiffness:e}"));
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, stiffness);
    scene.springs[0].rest_length = 1.0;
    scene
}

/// 20 springs of 0.1 m on a straight line 30° below level, 0.05 kg a node.
pub fn chain_of_20(stiffness: f64) -> Scene {
    let mut scene = with_gravity(&format!("chain of 20, K = {stiffness:e}"));
    let (sin, cos) = 30f64.to_radians().sin_cos();
    for i in 0..=20 {
        let s = 0.1 * f64::from(i);
        scene.add_node(Node {
            mass: 0.05,
            fixed: i == 0,
            velocity: Vector3::new(0.0, if i == 0 { 0.0 } else { 0.01 * s }, 0.0),
            ..Node::at(Vector3::new(s * cos, 0.0, -s * sin))
        });
    }
    for i in 0..20 {
        scene.add_spring(i, i + 1, stiffness);
    }
    scene
}

fn of(stiffness: f64, material: Material) -> Material {
    Material {
        stiffness,
        ..material
    }
}

fn swinging(mut scene: Scene, duration: f64) -> Scene {
    disturb(&mut scene, 1e-4, 5);
    scene.settings.duration = duration;
    scene
}

/// A block that is thrown sideways off the ground, turning.
pub fn thrown(stiffness: f64) -> Scene {
    let mut scene = block(4, of(stiffness, Material::of_block()));
    scene.name = format!("thrown block 4, K = {stiffness:e}");
    for node in &mut scene.nodes {
        node.fixed = false;
        node.velocity = Vector3::new(2.0 * node.position.z, 0.3 * node.position.x, 1.0);
    }
    scene.settings.duration = 0.3;
    scene
}

/// A weight that falls until its line is taut, and is caught by it.
fn caught() -> Scene {
    let mut scene = with_gravity("caught weight");
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 0.1,
        ..Node::at(Vector3::new(0.5, 0.0, -0.6))
    });
    scene.add_node(Node {
        mass: 1.0,
        velocity: Vector3::new(0.3, 0.2, 0.0),
        ..Node::at(Vector3::new(1.0, 0.0, 0.0))
    });
    scene.add_spring(0, 1, 5e3);
    scene.add_spring(1, 2, 5e3);
    scene
}

/// A net of springs without rest length, thrown by its edge, with dashpots.
fn net() -> Scene {
    let mut scene = cloth(6, of(40.0, Material::of_cloth()));
    scene.name = "net without rest lengths".to_owned();
    for spring in &mut scene.springs {
        spring.rest_length = 0.0;
        spring.damping = 0.02;
    }
    scene.settings.duration = 0.5;
    scene
}

/// A chain between a standing and a moving anchor.
fn pulled() -> Scene {
    let mut scene = chain(20, of(5e4, Material::of_chain(20)));
    scene.name = "pulled chain".to_owned();
    if let Some(last) = scene.nodes.last_mut() {
        last.fixed = true;
        last.velocity = Vector3::new(-0.3, 0.5, 1.0);
    }
    swinging(scene, 0.5)
}

/// Two masses that vibrate against each other along their spring while they fly
/// with a common velocity.
pub fn dumbbell(stiffness: f64, amplitude: f64, velocity: f64) -> Scene {
    let mut scene = Scene {
        name: format!("dumbbell, K = {stiffness:e}, at {velocity:e} m/s"),
        ..Scene::default()
    };
    for x in [0.0, 1.0 + amplitude] {
        scene.add_node(Node {
            mass: 1.0,
            velocity: Vector3::new(velocity, 0.0, 0.0),
            ..Node::at(Vector3::new(x, 0.0, 0.0))
        });
    }
    scene.add_spring(0, 1, stiffness);
    scene.springs[0].rest_length = 1.0;
    scene
}

/// A mass on a very soft spring whose other end leaves at 100 m/s: forces change
/// so slowly that only velocities tell the error of a step.
pub fn towed() -> Scene {
    let mut scene = Scene {
        name: "towed softly".to_owned(),
        ..Scene::default()
    };
    scene.add_node(Node {
        velocity: Vector3::new(100.0, 0.0, 0.0),
        ..Node::fixed(Vector3::x())
    });
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::zeros())
    });
    scene.add_spring(0, 1, 1e-4);
    scene.settings.duration = 10.0;
    scene
}

/// A weight on a spring and a dashpot, drawn sideways by a slow hook.
pub fn drawn() -> Scene {
    let mut scene = pendulum(1e4);
    scene.name = "slowly drawn weight".to_owned();
    scene.nodes[0].velocity = Vector3::new(0.02, 0.05, 0.0);
    scene.nodes[1].position = Vector3::new(0.0, 0.0, -1.0);
    scene.springs[0].damping = 20.0;
    scene.settings.duration = 4.0;
    scene
}

/// A mass that is whirled round on two springs in a row whose middle has no mass,
/// and starts where they are not in balance; and the one spring that they equal.
pub fn without_middle_mass() -> (Scene, Scene) {
    let mut one = pendulum(500.0);
    one.name = "massless middle, one spring".to_owned();
    one.gravity = Vector3::zeros();
    one.nodes[1].position = Vector3::new(1.02, 0.0, 0.0);
    one.nodes[1].velocity = Vector3::new(0.0, 4.0, 0.0);
    let mut two = Scene {
        name: "massless middle".to_owned(),
        ..Scene::default()
    };
    two.add_node(one.nodes[0]);
    two.add_node(one.nodes[1]);
    two.add_node(Node::at(Vector3::new(0.4, 0.0, 0.0)));
    for (a, b) in [(0, 2), (2, 1)] {
        let spring = two.add_spring(a, b, 1000.0);
        two.springs[spring].rest_length = 0.5;
    }
    (two, one)
}

pub fn moving_scenes() -> Vec<Scene> {
    let mut sideways = swinging(block(3, of(200.0, Material::of_block())), 0.5);
    sideways.name = "block 3 sideways".to_owned();
    sideways.gravity = Vector3::new(9.81, 0.0, 0.0);
    let mut damped = tangle(6, 5);
    damped.name = "damped tangle".to_owned();
    damped.settings.duration = 0.4;
    let mut chain_of_20 = chain_of_20(1e6);
    chain_of_20.settings.duration = 0.6;
    let mut soft_chain = swinging(chain(20, of(2e3, Material::of_chain(20))), 0.5);
    soft_chain.name = "soft chain".to_owned();
    let mut soft_cloth = swinging(cloth(6, of(50.0, Material::of_cloth())), 0.4);
    soft_cloth.name = "cloth 6, K = 50".to_owned();
    let mut stiff_cloth = swinging(cloth(6, of(1e5, Material::of_cloth())), 0.3);
    stiff_cloth.name = "cloth 6, K = 1e5".to_owned();
    vec![
        pendulum(60.0),
        pendulum(1e4),
        pendulum(1e8),
        soft_chain,
        chain_of_20,
        pulled(),
        soft_cloth,
        stiff_cloth,
        sideways,
        thrown(1e3),
        thrown(1e6),
        caught(),
        net(),
        damped,
        dumbbell(1e2, 0.05, 0.0),
        dumbbell(1e2, 0.05, 1e3),
        dumbbell(1e4, 0.01, 0.0),
        dumbbell(1e4, 0.01, 1e3),
        towed(),
        drawn(),
        thrown_past_hook(1e-3, 0.3, 1.0),
    ]
}

/// A weight of 1 kg thrown at 1 m/s past a hook, to which a soft spring of 1 m joins
/// it. The force turns round while it passes within the distance `closest` in m;
/// the rest is almost free flight.
pub fn thrown_past_hook(closest: f64, stiffness: f64, duration: f64) -> Scene {
    let mut scene = Scene {
        name: format!("thrown past a hook at {closest:e} m, K = {stiffness:e}"),
        ..Scene::default()
    };
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        velocity: Vector3::x(),
        ..Node::at(Vector3::new(-0.1, closest, 0.0))
    });
    let spring = scene.add_spring(0, 1, stiffness);
    scene.springs[spring].rest_length = 1.0;
    scene.settings.duration = duration;
    scene
}
