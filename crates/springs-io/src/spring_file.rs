//! Springs and materials of the scene file, field by field.

use crate::law_file::LawEntry;
use crate::scene_file::{NodeIndex, Real, Tuple};
use serde::Deserialize;
use springs_scene::BreakLimit;

/// A spring. What most scenes do without is apart, so that they pay nothing for it.
#[derive(Deserialize)]
#[serde(from = "SpringFields")]
pub(crate) struct SpringEntry {
    pub(crate) nodes: [usize; 2],
    pub(crate) stiffness: Option<f64>,
    pub(crate) rest_length: Option<f64>,
    pub(crate) mass: Option<f64>,
    pub(crate) damping: Option<f64>,
    pub(crate) more: Option<Box<More>>,
}

/// What else a spring may have.
#[derive(Default)]
pub(crate) struct More {
    pub(crate) material: Option<String>,
    pub(crate) pretension: Option<f64>,
    pub(crate) prestrain: Option<f64>,
    pub(crate) force_density: Option<f64>,
    pub(crate) broken: bool,
    pub(crate) yielded: f64,
    pub(crate) properties: MaterialEntry,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Spring")]
struct SpringFields {
    nodes: Tuple<2, NodeIndex>,
    stiffness: Option<Real>,
    rest_length: Option<Real>,
    mass: Option<Real>,
    damping: Option<Real>,
    material: Option<String>,
    pretension: Option<Real>,
    prestrain: Option<Real>,
    force_density: Option<Real>,
    #[serde(rename = "EA")]
    axial_stiffness: Option<Real>,
    #[serde(rename = "E")]
    modulus: Option<Real>,
    area: Option<Real>,
    diameter: Option<Real>,
    mass_per_length: Option<Real>,
    density: Option<Real>,
    damping_ratio: Option<Real>,
    law: Option<LawEntry>,
    breaks_at: Option<LimitEntry>,
    broken: Option<bool>,
    yielded: Option<Real>,
}

impl From<SpringFields> for SpringEntry {
    fn from(fields: SpringFields) -> Self {
        let number = |real: Option<Real>| real.map(|real| real.0);
        let numbers = [
            fields.pretension,
            fields.prestrain,
            fields.force_density,
            fields.axial_stiffness,
            fields.modulus,
            fields.area,
            fields.diameter,
            fields.mass_per_length,
            fields.density,
            fields.damping_ratio,
            fields.yielded,
        ];
        let has_more = fields.material.is_some()
            || fields.law.is_some()
            || fields.breaks_at.is_some()
            || fields.broken.is_some()
            || numbers.iter().any(Option::is_some);
        let more = has_more.then(|| {
            Box::new(More {
                material: fields.material,
                pretension: number(fields.pretension),
                prestrain: number(fields.prestrain),
                force_density: number(fields.force_density),
                broken: fields.broken.unwrap_or(false),
                yielded: number(fields.yielded).unwrap_or(0.0),
                properties: MaterialEntry {
                    axial_stiffness: fields.axial_stiffness,
                    modulus: fields.modulus,
                    area: fields.area,
                    diameter: fields.diameter,
                    mass_per_length: fields.mass_per_length,
                    density: fields.density,
                    damping: None,
                    damping_ratio: fields.damping_ratio,
                    law: fields.law,
                    breaks_at: fields.breaks_at,
                },
            })
        });
        Self {
            nodes: fields.nodes.0.map(|index| index.0),
            stiffness: number(fields.stiffness),
            rest_length: number(fields.rest_length),
            mass: number(fields.mass),
            damping: number(fields.damping),
            more,
        }
    }
}

/// What springs have in common.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, rename = "Material")]
pub(crate) struct MaterialEntry {
    #[serde(rename = "EA")]
    pub(crate) axial_stiffness: Option<Real>,
    #[serde(rename = "E")]
    pub(crate) modulus: Option<Real>,
    pub(crate) area: Option<Real>,
    pub(crate) diameter: Option<Real>,
    pub(crate) mass_per_length: Option<Real>,
    pub(crate) density: Option<Real>,
    pub(crate) damping: Option<Real>,
    pub(crate) damping_ratio: Option<Real>,
    pub(crate) law: Option<LawEntry>,
    pub(crate) breaks_at: Option<LimitEntry>,
}

/// Where springs break.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, rename = "BreaksAt")]
pub(crate) enum LimitEntry {
    Strain(Real),
    Force(Real),
}

impl LimitEntry {
    pub(crate) fn limit(self) -> BreakLimit {
        match self {
            Self::Strain(Real(strain)) => BreakLimit::Strain(strain),
            Self::Force(Real(force)) => BreakLimit::Force(force),
        }
    }
}
