//! Scenes on which simulators explode, hang or turn to not-a-number.

use super::Random;
use nalgebra::Vector3;
use springs_scene::generate::{Material, block, chain, cloth};
use springs_scene::{Node, Scene, StepControl};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn named(name: &str, step: f64, steps: f64) -> Scene {
    let mut scene = Scene {
        name: name.to_owned(),
        gravity: GRAVITY,
        ..Scene::default()
    };
    scene.settings.step = StepControl::Fixed(step);
    scene.settings.duration = steps * step;
    scene
}

fn like(name: &str, scene: Scene, step: f64, steps: f64) -> Scene {
    Scene {
        nodes: scene.nodes,
        springs: scene.springs,
        ..named(name, step, steps)
    }
}

fn weight(position: Vector3<f64>) -> Node {
    Node {
        mass: 1.0,
        ..Node::at(position)
    }
}

/// Two nodes in one place, joined by springs with and without a rest length.
fn coincident() -> Scene {
    let mut scene = named("coincident nodes", 1e-2, 100.0);
    scene.add_node(Node::fixed(Vector3::zeros()));
    for _ in 0..3 {
        scene.add_node(weight(Vector3::x()));
    }
    scene.add_spring(0, 1, 100.0);
    scene.add_spring(1, 2, 100.0);
    let pushing = scene.add_spring(2, 3, 100.0);
    scene.springs[pushing].rest_length = 0.5;
    scene.add_spring(0, 3, 100.0);
    scene
}

/// Two masses shot through each other along a line.
fn shot_through() -> Scene {
    let mut scene = named("shot through", 1e-2, 100.0);
    scene.gravity = Vector3::zeros();
    for side in [-1.0, 1.0] {
        scene.add_node(Node {
            velocity: Vector3::x() * (-side * 10.0),
            ..weight(Vector3::x() * side)
        });
    }
    let spring = scene.add_spring(0, 1, 10.0);
    scene.springs[spring].rest_length = 0.1;
    scene
}

/// Ten nodes between fixed ends, squeezed to 80 %.
fn column(imperfection: f64) -> Scene {
    let name = if imperfection == 0.0 {
        "column, straight"
    } else {
        "column, bent by 1e-3"
    };
    let mut scene = named(name, 1e-2, 100.0);
    scene.gravity = Vector3::zeros();
    for k in 0..12 {
        let x = 0.8 * f64::from(k) / 11.0;
        let bend = imperfection * (std::f64::consts::PI * x / 0.8).sin();
        let mut node = Node {
            mass: 0.05,
            ..Node::at(Vector3::new(x, bend, 0.0))
        };
        node.fixed = k == 0 || k == 11;
        scene.add_node(node);
        if k > 0 {
            let spring = scene.add_spring(k as usize - 1, k as usize, 500.0);
            scene.springs[spring].rest_length = 1.0 / 11.0;
        }
    }
    scene
}

/// A cloth with one half on the other.
fn folded() -> Scene {
    let mut cloth = cloth(9, Material::of_cloth());
    for node in &mut cloth.nodes {
        if node.position.x > 0.5 {
            node.position.x = 1.0 - node.position.x;
        }
    }
    like("cloth folded flat", cloth, 5e-3, 100.0)
}

/// All nodes of a cloth in one point, up to 1e-9 m.
fn collapsed() -> Scene {
    let mut cloth = cloth(5, Material::of_cloth());
    let mut random = Random(3);
    for node in &mut cloth.nodes {
        node.position = random.vector(1e-9);
    }
    like("cloth in one point", cloth, 1e-3, 100.0)
}

/// A cloth stretched a hundredfold and let go.
fn stretched() -> Scene {
    let mut cloth = cloth(6, Material::of_cloth());
    for node in &mut cloth.nodes {
        node.position *= 100.0;
    }
    like("cloth stretched 100 times", cloth, 1e-3, 200.0)
}

/// A chain of alternating light and heavy masses.
fn mass_ratio() -> Scene {
    let mut chain = chain(8, Material::of_chain(8));
    for (k, node) in chain.nodes.iter_mut().enumerate() {
        node.mass = if k % 2 == 0 { 1e3 } else { 1e-6 };
    }
    like("masses 1 : 1e9", chain, 1e-2, 50.0)
}

/// A block from soft to rigid springs.
fn stiffness_ratio() -> Scene {
    let mut block = block(4, Material::of_block());
    for (k, spring) in block.springs.iter_mut().enumerate() {
        spring.stiffness = 10f64.powi(k as i32 % 13);
    }
    like("stiffnesses 1 : 1e12", block, 1e-2, 50.0)
}

/// Dashpots that hold everything still.
fn overdamped() -> Scene {
    let mut cloth = cloth(5, Material::of_cloth());
    for spring in &mut cloth.springs {
        spring.damping = 1e9;
    }
    like("dashpots of 1e9", cloth, 1e-2, 50.0)
}

/// Far away, tiny, and of other units.
fn scaled(name: &str, length: f64, mass: f64, far: f64) -> Scene {
    let cloth = cloth(5, Material::of_cloth());
    let mut scene = like(name, cloth, 5e-3, 60.0);
    scene.gravity *= length;
    for node in &mut scene.nodes {
        node.position = node.position * length + Vector3::repeat(far * length);
    }
    for spring in &mut scene.springs {
        spring.rest_length *= length;
        spring.stiffness *= mass;
        spring.mass *= mass;
    }
    scene
}

/// Nodes without springs, springs without effect, an island that falls, another
/// that stands still.
fn leftovers() -> Scene {
    let mut scene = named("leftovers", 1e-2, 50.0);
    for k in 0..3 {
        scene.add_node(Node::fixed(Vector3::x() * f64::from(k)));
    }
    scene.add_spring(0, 1, 1e3);
    let none = scene.add_spring(1, 2, 0.0);
    scene.springs[none].rest_length = 7.0;
    for k in 0..4 {
        scene.add_node(weight(Vector3::new(f64::from(k), 5.0, 0.0)));
    }
    scene.add_spring(3, 4, 1e3);
    scene.add_spring(3, 4, 1e3);
    scene.add_spring(4, 3, 1e-3);
    scene
}

/// All of them, each with a step that an engineer might try.
pub fn hard_scenes() -> Vec<Scene> {
    vec![
        coincident(),
        shot_through(),
        column(0.0),
        column(1e-3),
        folded(),
        collapsed(),
        stretched(),
        mass_ratio(),
        stiffness_ratio(),
        overdamped(),
        scaled("a millionth in size", 1e-6, 1.0, 0.0),
        scaled("a million in size", 1e6, 1.0, 0.0),
        scaled("a millionth in mass", 1.0, 1e-6, 0.0),
        scaled("a million metres away", 1.0, 1.0, 1e6),
        leftovers(),
    ]
}
