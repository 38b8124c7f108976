//! What is in a scene, how it will be simulated, what a run will leave out, and what looks
//! wrong: all that can be said without a step.
//!
//! ```
//! use springs::inspect::Check;
//! use springs::scene::generate::{Material, cloth};
//! use springs::scene::{Load, OverTime, Vector3};
//!
//! let mut scene = cloth(8, Material::of_cloth());
//! scene.loads.push(Load {
//!     name: String::new(),
//!     nodes: vec![],
//!     force: Vector3::z(),
//!     over_time: OverTime::Constant,
//! });
//! let check = Check::of(&scene, &Default::default(), &Default::default())?;
//! assert_eq!(check.contents.springs, 306);
//! assert_eq!(check.warnings[0].message, "load 0 is on no node");
//! println!("{check}");
//! # Ok::<(), springs::inspect::CheckError>(())
//! ```

mod contents;
mod forecast;
mod materials;
mod mechanisms;
mod nodes;
mod plan;
mod proportions;
mod range;
mod savings;
mod springs;
mod steps;
mod supports;
mod text;
mod vibrations;
mod warning;
mod words;

pub use contents::Contents;
pub use forecast::{Forecast, UsualSteps};
pub use materials::{LawCount, MaterialRanges};
pub use mechanisms::Mechanism;
pub use plan::Plan;
pub use range::Range;
pub use savings::{Saving, skipped};
pub use vibrations::Vibrations;
pub use warning::Warning;
pub use words::{count, short, time};

use serde::Serialize;
use springs_io::Inputs;
use springs_scene::{RunOptions, Scene, Start};
use springs_solver::SolveError;
use springs_step::{Islands, SetupError};
use warning::Warnings;

/// What can be said of a scene without a step. Displays as `springs check` prints it, and
/// is serialized as `springs check --json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Check {
    /// The name of the scene; may be empty.
    pub name: String,
    /// What is in it.
    pub contents: Contents,
    /// How it will be simulated, and why so.
    pub plan: Plan,
    /// Between which frequencies it vibrates.
    pub vibrations: Vibrations,
    /// Parts that have more directions to move in than springs that could resist.
    pub mechanisms: Vec<Mechanism>,
    /// What a run will take.
    pub forecast: Forecast,
    /// What a run leaves out without changing the result.
    pub skipped: Vec<Saving>,
    /// What is legal but probably not meant.
    pub warnings: Vec<Warning>,
}

/// Why a scene cannot be checked: a run of it could not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckError {
    /// The scene is wrong, or its method cannot move it.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A linear solver cannot be sized.
    #[error("the solver cannot be sized: {0}")]
    Solver(#[from] SolveError),
}

impl Check {
    /// Of a scene, run as the options say, and what its file says beside it. Compiles it,
    /// and runs nothing, not even the search for the equilibrium that it may start from.
    ///
    /// # Errors
    ///
    /// If a run could not begin.
    pub fn of(scene: &Scene, options: &RunOptions, inputs: &Inputs) -> Result<Self, CheckError> {
        let start = scene.settings.start;
        let mut scene = scene.clone();
        scene.settings.start = Start::AsGiven;
        let islands = Islands::with_options(&scene, options)?;
        let vibrations = Vibrations::of(&islands);
        let mut warnings = Warnings::default();
        springs::list(&scene, &mut warnings);
        supports::list(&scene, inputs, &mut warnings);
        nodes::list(&scene, &mut warnings);
        proportions::list(&scene, &mut warnings);
        materials::list(&scene, inputs, &mut warnings);
        if let Some(part) = vibrations::fastest(&islands) {
            steps::list(part, &vibrations, &mut warnings);
        }
        Ok(Self {
            contents: Contents::of(&scene, inputs, &islands),
            plan: Plan::of(&scene, start, &islands),
            mechanisms: mechanisms::mechanisms(&scene, &islands),
            forecast: Forecast::of(&scene, options, &islands)?,
            skipped: skipped(&scene, &islands),
            vibrations,
            warnings: warnings.0,
            name: scene.name,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_scene::generate::{Material, chain};
    use springs_scene::{Load, Node, OverTime, Vector3};

    fn warnings(scene: &Scene) -> String {
        let inputs = Inputs::default();
        let check = Check::of(scene, &RunOptions::default(), &inputs).unwrap();
        let lines = check.warnings.iter().map(Warning::to_string);
        lines.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_slow_clean_scene_raises_no_warning() {
        let mut scene = chain(3, Material::of_chain(3));
        scene.gravity *= 1e-4;
        scene
            .springs
            .iter_mut()
            .for_each(|spring| spring.stiffness = 1.0);
        assert_eq!(warnings(&scene), "");
    }

    #[test]
    fn every_oddity_is_named() {
        let mut scene = chain(3, Material::of_chain(3));
        scene.add_spring(2, 1, 50.0);
        let dead = scene.add_spring(0, 3, 0.0);
        scene.springs[dead].rest_length = 0.1;
        let loose = scene.add_node(Node::at(Vector3::x()));
        let other = scene.add_node(Node {
            mass: 1e9,
            ..Node::at(Vector3::x())
        });
        let spring = scene.add_spring(loose, other, 10.0);
        scene.springs[spring].rest_length = 1.0;
        scene.add_node(Node {
            mass: 1.0,
            ..Node::at(Vector3::y())
        });
        scene.add_node(Node::fixed(Vector3::y()));
        scene.loads = vec![
            Load {
                name: String::new(),
                nodes: vec![0, 1, 1],
                force: Vector3::z(),
                over_time: OverTime::Constant,
            },
            Load {
                name: String::new(),
                nodes: vec![],
                force: Vector3::z(),
                over_time: OverTime::Constant,
            },
        ];
        let said = warnings(&scene);
        for part in [
            "spring 4 is without stiffness",
            "spring 5: the two nodes coincide",
            "springs 4, 5: more than 50 %",
            "spring 3: another spring",
            "1 part with node 4",
            "node 4 is free but without mass",
            "node 5 is",
            "node 6 is free but at no spring",
            "node 7 is fixed and at no spring",
            "at the place of another node, and no spring",
            "loads on node 0, fixed",
            "load 0 names node 1 more than once",
            "load 1 is on no node",
        ] {
            assert!(said.contains(part), "{part} in:\n{said}");
        }
    }
}
