//! A loop of one's own around the stepper.
//!
//! A pendulum is pushed whenever it passes its lowest point, like a swing, until
//! it reaches the height of its hook.
//!
//! ```text
//! cargo run --example custom_loop
//! ```

use springs::scene::{Method, Node, Scene, StepControl, Vector3};
use springs::step::{NodeStates, Stepper};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = Scene {
        name: "swing".to_owned(),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    };
    let hook = scene.add_node(Node::fixed(Vector3::zeros()));
    let seat = scene.add_node(Node {
        mass: 30.0,
        ..Node::at(Vector3::new(0.2, 0.0, -2.0))
    });
    scene.add_spring(hook, seat, 2e5);
    scene.settings.method = Method::VelocityVerlet;
    scene.settings.step = StepControl::Fixed(1e-3);

    let mut stepper = Stepper::new(&scene)?;
    let mut nodes = NodeStates::of(&scene);
    let mut pushes = 0;
    while nodes.positions[seat].z < 0.0 {
        let before = nodes.positions[seat].x;
        stepper.step(&mut nodes, 1e-3)?;
        let after = nodes.positions[seat].x;
        if before < 0.0 && after >= 0.0 {
            // Changing the nodes between steps is all it takes.
            nodes.velocities[seat].x += 0.5;
            pushes += 1;
        }
        if stepper.time() > 120.0 {
            return Err("the swing does not get there".into());
        }
    }
    println!(
        "level with the hook after {pushes} pushes and {:.2} s ({} steps)",
        stepper.time(),
        stepper.steps()
    );
    Ok(())
}
