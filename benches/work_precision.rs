//! Run time against error on a fixed set: an elastic pendulum, a chain of 100,
//! a cloth of 16 × 16 and a block of 8 × 8 × 8 nodes, each soft, moderate and
//! very stiff, all really moving.
//!
//! Writes a work-precision diagram and a table of all runs per scene into
//! `target/work-precision`, and prints the quickest method beside the note's
//! own step and velocity Verlet. Seconds per scene may be given:
//!
//! ```text
//! cargo bench --bench work_precision -- 60
//! ```

use springs::scene::generate::{Material, block, chain, cloth};
use springs::scene::{Node, Scene, Vector3};
use springs::study::{Options, Study, Trial, csv, diagram, study};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

fn pendulum(stiffness: f64) -> Scene {
    let mut scene = Scene {
        gravity: Vector3::new(0.0, 0.0, -9.81),
        ..Scene::default()
    };
    scene.add_node(Node::fixed(Vector3::zeros()));
    scene.add_node(Node {
        mass: 1.0,
        ..Node::at(Vector3::x())
    });
    scene.add_spring(0, 1, stiffness);
    scene
}

/// The set, with short times where cloth would become chaotic.
fn scenes() -> Vec<Scene> {
    let of = |stiffness, material| Material {
        stiffness,
        ..material
    };
    let mut scenes = Vec::new();
    for (word, stiffness) in [("soft", 60.0), ("moderate", 1e4), ("very stiff", 1e8)] {
        let mut scene = pendulum(stiffness);
        scene.name = format!("pendulum, {word}");
        scenes.push(scene);
    }
    for (word, stiffness) in [("soft", 2e3), ("moderate", 1e6), ("very stiff", 1e9)] {
        let mut scene = chain(100, of(stiffness, Material::of_chain(100)));
        scene.name = format!("chain 100, {word}");
        scene.settings.duration = 0.5;
        scenes.push(scene);
    }
    for (word, stiffness) in [("soft", 100.0), ("moderate", 1e4), ("very stiff", 1e7)] {
        let mut scene = cloth(16, of(stiffness, Material::of_cloth()));
        scene.name = format!("cloth 16, {word}");
        scene.settings.duration = 0.3;
        scenes.push(scene);
    }
    for (word, stiffness) in [("soft", 200.0), ("moderate", 1e5), ("very stiff", 1e8)] {
        let mut scene = block(8, of(stiffness, Material::of_block()));
        scene.name = format!("block 8, {word}");
        // Thrown sideways off its layer.
        for node in &mut scene.nodes {
            node.fixed = false;
            node.velocity = Vector3::new(2.0 * node.position.z, 0.0, 1.0);
        }
        scene.settings.duration = 0.3;
        scenes.push(scene);
    }
    // A small uneven speed, so that nothing stays symmetric; uneven positions
    // would load very stiff springs.
    for node in scenes.iter_mut().flat_map(|scene| &mut scene.nodes) {
        if !node.fixed {
            let x = node.position;
            let wave = (7.0 * x.x + 5.0 * x.y + 3.0 * x.z).sin();
            node.velocity += Vector3::new(0.0, 0.02 * wave, 0.01 * wave);
        }
    }
    scenes
}

/// The quickest run that reached an error, of one method or of all.
fn quickest<'a>(study: &'a Study, error: f64, method: Option<&str>) -> Option<&'a Trial> {
    let reached = study
        .trials
        .iter()
        .filter(|trial| trial.error <= error && method.is_none_or(|method| trial.method == method));
    reached.min_by(|a, b| a.seconds.total_cmp(&b.seconds))
}

fn seconds(trial: Option<&Trial>) -> String {
    trial.map_or("–".to_owned(), |trial| format!("{:.1e}", trial.seconds))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let budget = std::env::args().find_map(|argument| argument.parse().ok());
    let options = Options {
        budget: Duration::from_secs_f64(budget.unwrap_or(15.0)),
        ..Options::default()
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/work-precision");
    std::fs::create_dir_all(&folder)?;
    println!("| scene | error, m | quickest, s | method | note's step, s | Verlet, s |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for scene in scenes() {
        let study = match study(&scene, &options, &mut |_| ControlFlow::Continue(())) {
            Ok(study) => study,
            Err(error) => {
                println!("| {} | | | {error} | | |", scene.name);
                continue;
            }
        };
        let file = scene.name.replace([',', ' '], "-").replace("--", "-");
        std::fs::write(folder.join(format!("{file}.svg")), diagram(&study))?;
        std::fs::write(folder.join(format!("{file}.csv")), csv(&study))?;
        for error in [1e-2, 1e-3, 1e-4] {
            let best = quickest(&study, error, None);
            println!(
                "| {} | {error:.0e} | {} | {} | {} | {} |",
                scene.name,
                seconds(best),
                best.map_or("–", |trial| &trial.method),
                seconds(quickest(&study, error, Some("linearly-implicit-euler"))),
                seconds(quickest(&study, error, Some("velocity-verlet"))),
            );
        }
    }
    println!("\ndiagrams and tables are in {}", folder.display());
    Ok(())
}
