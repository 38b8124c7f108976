//! What a run or a simulation starts from.

use crate::arrays::{Floats, each};
use crate::errors::Fault;
use crate::statics::started;
use pyo3::prelude::*;
use springs::scene::{RunOptions, Scene, Start, Vector3};
use springs::step::NodeStates;

/// The scene as it starts: from what has x, or as it says itself.
pub(crate) fn scene_at(
    py: Python<'_>,
    scene: Scene,
    start: Option<&Bound<'_, PyAny>>,
    options: &RunOptions,
) -> PyResult<Scene> {
    match start {
        Some(start) => start_from(scene, start),
        None => started(py, scene, options),
    }
}

/// Puts the nodes where `start` has them: its `x` (n, 3), or the last of (f, n, 3), and its
/// `v` if it has one. What is `broken` or has `yielded` there (k,) has done so here.
fn start_from(mut scene: Scene, start: &Bound<'_, PyAny>) -> PyResult<Scene> {
    let n = scene.nodes.len();
    let last = |what: &'static str| -> PyResult<Option<Vec<Vector3<f64>>>> {
        let Some(array) = start.getattr_opt(what)?.filter(|array| !array.is_none()) else {
            return Ok(None);
        };
        let floats = Floats::new(what, &array)?;
        match floats.shape() {
            [frames, _, _] if *frames > 0 => {
                Floats::new(what, &array.get_item(*frames - 1)?)?.n_vectors(n)
            }
            _ => floats.n_vectors(n),
        }
        .map(Some)
    };
    let Some(positions) = last("x")? else {
        let message = "start must have positions x, such as the result of a run";
        return Err(Fault::scene(message).into());
    };
    let velocities = last("v")?.unwrap_or_else(|| vec![Vector3::zeros(); n]);
    let nodes = NodeStates {
        positions,
        velocities,
    };
    nodes.write_to(&mut scene);
    let of_springs = |what: &'static str| match start.getattr_opt(what)? {
        Some(array) => each(what, Some(&array), scene.springs.len()),
        None => Ok(None),
    };
    let (broken, yielded) = (of_springs("broken")?, of_springs("yielded")?);
    for (index, spring) in scene.springs.iter_mut().enumerate() {
        if let Some(broken) = &broken {
            spring.broken = broken[index] != 0.0;
        }
        if let Some(yielded) = &yielded {
            spring.yielded = yielded[index];
        }
    }
    scene.settings.start = Start::AsGiven;
    Ok(scene)
}
