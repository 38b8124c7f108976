//! Springs from arrays: from what engineers know of them to K, l0, m and c.

use crate::arrays::{each, pairs};
use crate::errors::Fault;
use crate::law::law;
use pyo3::prelude::*;
use springs::scene::{AxialStiffness, NoDampingRatio, Scene, Spring, SpringLaw, rest_length_under};

/// The arguments of `Scene.springs` beside the nodes.
pub(crate) struct Given<'a, 'py> {
    pub(crate) stiffness: Option<&'a Bound<'py, PyAny>>,
    pub(crate) axial_stiffness: Option<&'a Bound<'py, PyAny>>,
    pub(crate) rest_length: Option<&'a Bound<'py, PyAny>>,
    pub(crate) pretension: Option<&'a Bound<'py, PyAny>>,
    pub(crate) prestrain: Option<&'a Bound<'py, PyAny>>,
    pub(crate) mass: Option<&'a Bound<'py, PyAny>>,
    pub(crate) mass_per_length: Option<&'a Bound<'py, PyAny>>,
    pub(crate) damping: Option<&'a Bound<'py, PyAny>>,
    pub(crate) damping_ratio: Option<&'a Bound<'py, PyAny>>,
    pub(crate) law: Option<&'a Bound<'py, PyAny>>,
}

/// Springs that are not yet in the scene, and damping ratios of them by their indices there.
pub(crate) struct Made {
    pub(crate) springs: Vec<Spring>,
    pub(crate) law: Option<SpringLaw>,
    pub(crate) ratios: Vec<(usize, f64)>,
}

type Numbers = Option<Vec<f64>>;

/// Of several arguments one at most.
fn one_of(given: &[(&str, &Numbers)]) -> PyResult<()> {
    let names: Vec<&str> = given
        .iter()
        .filter(|(_, numbers)| numbers.is_some())
        .map(|(name, _)| *name)
        .collect();
    match names[..] {
        [] | [_] => Ok(()),
        _ => {
            let message = format!(
                "springs have {}: one of them is enough",
                names.join(" and ")
            );
            Err(Fault::scene(message).into())
        }
    }
}

/// Makes the springs between pairs of nodes of a scene.
pub(crate) fn make(scene: &Scene, ij: &Bound<'_, PyAny>, given: &Given<'_, '_>) -> PyResult<Made> {
    let pairs = pairs("ij", ij)?;
    let n = pairs.len();
    let first = scene.springs.len();
    let stiffness = each("stiffness", given.stiffness, n)?;
    let axial_stiffness = each("EA", given.axial_stiffness, n)?;
    let rest_length = each("rest_length", given.rest_length, n)?;
    let pretension = each("pretension", given.pretension, n)?;
    let prestrain = each("prestrain", given.prestrain, n)?;
    let mass = each("mass", given.mass, n)?;
    let mass_per_length = each("mass_per_length", given.mass_per_length, n)?;
    let damping = each("damping", given.damping, n)?;
    let damping_ratio = each("damping_ratio", given.damping_ratio, n)?;
    one_of(&[("stiffness", &stiffness), ("EA", &axial_stiffness)])?;
    one_of(&[
        ("rest_length", &rest_length),
        ("pretension", &pretension),
        ("prestrain", &prestrain),
    ])?;
    one_of(&[("mass", &mass), ("mass_per_length", &mass_per_length)])?;
    one_of(&[("damping", &damping), ("damping_ratio", &damping_ratio)])?;
    let law = law(given.law)?;
    let own = law.as_ref().and_then(SpringLaw::own_axial_stiffness);
    if own.is_some() && (stiffness.is_some() || axial_stiffness.is_some()) {
        let message = "the law gives tensions in N by itself";
        let advice = "leave out stiffness and EA";
        return Err(Fault::scene(message).advised(Some(advice)).into());
    }
    if stiffness.is_none() && axial_stiffness.is_none() && own.is_none() {
        let advice = "give them stiffness in N/m, or EA in N";
        let fault = Fault::scene("springs have no stiffness").advised(Some(advice));
        return Err(fault.into());
    }
    let mut springs = Vec::with_capacity(n);
    for (k, &nodes) in pairs.iter().enumerate() {
        let index = first + k;
        let length = length(scene, index, nodes)?;
        let axial = match (&stiffness, &axial_stiffness, own) {
            (Some(stiffness), _, _) => AxialStiffness::OfSpring(stiffness[k]),
            (_, Some(axial), _) => AxialStiffness::OfMaterial(axial[k]),
            (_, _, own) => AxialStiffness::OfMaterial(own.unwrap_or_default()),
        };
        let rest_length = match (&rest_length, &pretension, &prestrain) {
            (Some(rest_length), _, _) => rest_length[k],
            (_, Some(tension), _) => {
                let found = rest_length_under(tension[k], length, axial, law.as_ref());
                found.map_err(|error| {
                    let what = format!("the pretension of spring {index} is not possible: {error}");
                    Fault::scene(what).at_spring(index)
                })?
            }
            (_, _, Some(strain)) if strain[k] > -1.0 => length / (1.0 + strain[k]),
            (_, _, Some(strain)) => {
                let strain = strain[k];
                let what =
                    format!("spring {index} has a prestrain of {strain}, but it must be above -1");
                return Err(Fault::scene(what).at_spring(index).into());
            }
            _ => length,
        };
        if rest_length == 0.0 && matches!(axial, AxialStiffness::OfMaterial(_)) {
            let what = format!("spring {index} has no length that its stiffness refers to");
            let advice = "give it a rest_length, or a stiffness in N/m";
            let fault = Fault::scene(what).advised(Some(advice));
            return Err(fault.at_spring(index).into());
        }
        let of = |numbers: &Numbers| numbers.as_ref().map_or(0.0, |numbers| numbers[k]);
        let ([first, second], stiffness) = (nodes, axial.stiffness(rest_length));
        springs.push(Spring {
            mass: match &mass_per_length {
                Some(mass) => mass[k] * rest_length,
                None => of(&mass),
            },
            damping: of(&damping),
            ..Spring::between(first, second, stiffness, rest_length)
        });
    }
    let ratios = damping_ratio.unwrap_or_default().into_iter().enumerate();
    Ok(Made {
        springs,
        law,
        ratios: ratios.map(|(k, ratio)| (first + k, ratio)).collect(),
    })
}

fn length(scene: &Scene, spring: usize, nodes: [usize; 2]) -> PyResult<f64> {
    match nodes.map(|node| scene.nodes.get(node).ok_or(node)) {
        [Ok(a), Ok(b)] => Ok(a.distance(b)),
        [Err(node), _] | [_, Err(node)] => {
            let n = scene.nodes.len();
            let what = format!("spring {spring} joins node {node}, but the scene has {n} of them");
            let fault = Fault::scene(what).advised(Some("nodes are counted from 0"));
            Err(fault.at_node(node).at_spring(spring).into())
        }
    }
}

/// Turns damping ratios into dampings, now that nodes have all their masses.
pub(crate) fn damp(scene: &mut Scene, ratios: &[(usize, f64)]) -> PyResult<()> {
    if ratios.is_empty() {
        return Ok(());
    }
    let masses = scene.node_masses();
    for &(index, ratio) in ratios {
        if !(ratio >= 0.0 && ratio.is_finite()) {
            let what =
                format!("the damping ratio of spring {index} must not be negative, but is {ratio}");
            return Err(Fault::scene(what).at_spring(index).into());
        }
        let damping = scene.damping_of_ratio(index, ratio, &masses);
        scene.springs[index].damping = damping.map_err(|none| {
            let fault = Fault::scene(none.to_string()).advised(Some(none.advice()));
            match none {
                NoDampingRatio::Massless { node, .. } => fault.at_node(node).at_spring(index),
                _ => fault.at_spring(index),
            }
        })?;
    }
    Ok(())
}
