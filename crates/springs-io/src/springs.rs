//! Springs of a scene file: from what engineers know of them, EA, materials,
//! pretension and damping ratios, to K, l₀, m and c.

use crate::law_file::LawEntry;
use crate::read::{Findings, find_named};
use crate::scene_file::Real;
use crate::spring_file::{LimitEntry, MaterialEntry, More, SpringEntry};
use serde::{Deserialize, Serialize};
use springs_scene::{
    AxialStiffness, Node, Path, PretensionError, Scene, Spring, SpringLaw, printable,
    rest_length_under,
};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// What a scene file says and a [`Scene`] does not keep.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// The names of the materials.
    pub materials: Vec<String>,
    /// The groups of nodes: names, and indices as they stand in the file.
    pub groups: Vec<(String, Vec<usize>)>,
    /// Of each spring that is given by more than stiffness, rest length, mass and
    /// damping.
    pub springs: Vec<SpringInput>,
    /// Springs that are given by a damping ratio, and these.
    pub damping_ratios: Vec<(usize, f64)>,
}

/// How a spring is given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SpringInput {
    /// Its index.
    pub spring: usize,
    /// The index of its material.
    pub material: Option<usize>,
    /// Its cross section, in m², if that is known.
    pub area: Option<f64>,
    /// Whether its stiffness comes of EA or E, and its mass of a mass per length or a
    /// density.
    pub is_by_length: bool,
    /// Whether its rest length comes of a tension or a strain.
    pub is_prestressed: bool,
}

/// What becomes of the springs of a file.
pub(crate) struct Resolved {
    pub(crate) springs: Vec<Spring>,
    pub(crate) laws: Vec<SpringLaw>,
    /// Where the file has each law.
    pub(crate) law_places: Vec<Path>,
    pub(crate) inputs: Inputs,
}

/// The springs and laws of a file. Adds what is wrong to `findings`.
pub(crate) fn springs(
    entries: Vec<SpringEntry>,
    materials: &[(String, MaterialEntry)],
    nodes: &[Node],
    findings: &mut Findings<'_>,
) -> Resolved {
    let mut reader = SpringReader {
        materials,
        nodes,
        findings,
        material_laws: Vec::with_capacity(materials.len()),
        known_laws: BTreeMap::new(),
        resolved: Resolved {
            springs: Vec::with_capacity(entries.len()),
            laws: Vec::new(),
            law_places: Vec::new(),
            inputs: Inputs::default(),
        },
    };
    for (index, (name, material)) in materials.iter().enumerate() {
        reader.resolved.inputs.materials.push(name.clone());
        reader.check(Owner::Material(index), material);
        let law = material.law.as_ref().and_then(|entry| entry.0.clone());
        let place = Path::Material(index, Some("law"));
        let law = law.map(|law| {
            let text = format!("{law:?}");
            let index = reader.add_law(law, place);
            reader.known_laws.entry(text).or_insert(index);
            index
        });
        reader.material_laws.push(law);
    }
    for (index, entry) in entries.iter().enumerate() {
        let spring = reader.spring(index, entry);
        reader.resolved.springs.push(spring);
    }
    reader.resolved
}

/// Turns damping ratios of springs into dampings, now that nodes have all their masses.
pub(crate) fn damp(ratios: &[(usize, f64)], scene: &mut Scene, findings: &mut Findings<'_>) {
    if ratios.is_empty() {
        return;
    }
    let Some(masses) = masses_of(scene) else {
        return;
    };
    for &(index, ratio) in ratios {
        match scene.damping_of_ratio(index, ratio, &masses) {
            Ok(damping) => scene.springs[index].damping = damping,
            Err(none) => {
                let path = Path::Spring(index, Some("damping_ratio"));
                findings.push(path, none.to_string(), Some(none.advice()));
            }
        }
    }
}

/// The masses of the nodes, in kg; `None` where springs join nodes that are not there, which
/// is told elsewhere.
pub(crate) fn masses_of(scene: &Scene) -> Option<Vec<f64>> {
    let exists = |spring: &Spring| spring.nodes.iter().all(|&node| node < scene.nodes.len());
    let all_exist = scene.springs.iter().all(exists);
    all_exist.then(|| scene.node_masses())
}

/// Whose field it is.
#[derive(Clone, Copy)]
enum Owner {
    Spring(usize),
    Material(usize),
}

impl Owner {
    fn path(self, field: &'static str) -> Path {
        match self {
            Self::Spring(index) => Path::Spring(index, Some(field)),
            Self::Material(index) => Path::Material(index, Some(field)),
        }
    }
}

/// A field that is given, and its value.
type Given = Option<(&'static str, f64)>;

struct SpringReader<'a, 't> {
    materials: &'a [(String, MaterialEntry)],
    nodes: &'a [Node],
    findings: &'a mut Findings<'t>,
    /// The law of each material.
    material_laws: Vec<Option<usize>>,
    /// Laws that springs of their own may share, by their text.
    known_laws: BTreeMap<String, usize>,
    resolved: Resolved,
}

const OTHERWISE: &str = "leave out one of them";
const HOW_STIFF: &str =
    "give it stiffness in N/m, EA in N, E in Pa with area or diameter, or a material that has it";

impl SpringReader<'_, '_> {
    fn find(&mut self, path: Path, message: String, advice: Option<&str>) {
        self.findings.push(path, message, advice);
    }

    fn text(&self, owner: Owner) -> String {
        match owner {
            Owner::Spring(index) => format!("spring {index}"),
            Owner::Material(index) => format!("material `{}`", printable(&self.materials[index].0)),
        }
    }

    /// The one of several fields that is given; more than one are too many.
    fn one_of<const N: usize>(&mut self, owner: Owner, fields: [Given; N]) -> Given {
        let mut given = fields.into_iter().flatten();
        let first = given.next();
        if let (Some((first, _)), Some((second, _))) = (first, given.next()) {
            let message = format!("{} has both {first} and {second}", self.text(owner));
            self.find(owner.path(second), message, Some(OTHERWISE));
        }
        first
    }

    /// What is wrong with fields that both springs and materials have.
    fn check(&mut self, owner: Owner, entry: &MaterialEntry) {
        let positive = [
            ("EA", entry.axial_stiffness),
            ("E", entry.modulus),
            ("area", entry.area),
            ("diameter", entry.diameter),
        ];
        let not_negative = [
            ("mass_per_length", entry.mass_per_length),
            ("density", entry.density),
            ("damping", entry.damping),
            ("damping_ratio", entry.damping_ratio),
        ];
        for (field, value) in fields(positive).into_iter().flatten() {
            if value <= 0.0 {
                self.out_of_range(owner, field, "be greater than zero", value);
            }
        }
        for (field, value) in fields(not_negative).into_iter().flatten() {
            if value < 0.0 {
                self.out_of_range(owner, field, "not be negative", value);
            }
        }
        self.one_of(owner, axial_of(entry));
        self.one_of(owner, section_of(entry));
        self.one_of(owner, mass_of(entry));
        self.one_of(owner, damping_of(entry));
        if let (Owner::Material(_), Some(limit)) = (owner, entry.breaks_at.map(LimitEntry::limit))
            && !limit.is_possible()
        {
            let (text, name, value) = (self.text(owner), limit.name(), limit.value());
            let message = format!(
                "the {name} at which springs of {text} break must not be negative, but is {value}"
            );
            self.find(owner.path("breaks_at"), message, None);
        }
        let law = entry.law.as_ref().and_then(|entry| entry.0.clone());
        if let (Some(law), Some((field, _))) = (&law, axial_of(entry).into_iter().flatten().next())
            && law.own_axial_stiffness().is_some()
        {
            let (text, law) = (self.text(owner), law.name());
            let message = format!("the law of {text}, `{law}`, gives tensions in N by itself");
            let advice = format!("leave out {field}");
            self.find(owner.path(field), message, Some(&advice));
        }
    }

    fn out_of_range(&mut self, owner: Owner, field: &'static str, must: &str, value: f64) {
        let name = field.replace('_', " ");
        let text = self.text(owner);
        let message = format!("the {name} of {text} must {must}, but is {value}");
        self.find(owner.path(field), message, None);
    }

    fn add_law(&mut self, law: SpringLaw, place: Path) -> usize {
        self.resolved.laws.push(law);
        self.resolved.law_places.push(place);
        self.resolved.laws.len() - 1
    }

    fn spring(&mut self, index: usize, entry: &SpringEntry) -> Spring {
        let length = match entry.nodes.map(|node| self.nodes.get(node)) {
            [Some(a), Some(b)] => Some(a.distance(b)),
            // Validation says so.
            _ => None,
        };
        let ([first, second], stiffness) = (entry.nodes, entry.stiffness.unwrap_or(0.0));
        let rest_length = entry.rest_length.or(length).unwrap_or(0.0);
        let mut spring = Spring {
            mass: entry.mass.unwrap_or(0.0),
            damping: entry.damping.unwrap_or(0.0),
            ..Spring::between(first, second, stiffness, rest_length)
        };
        if let Some(more) = &entry.more {
            self.resolve(index, entry, more, length, &mut spring);
        } else if entry.stiffness.is_none() {
            self.find_no_stiffness(index);
        }
        spring
    }

    fn find_no_stiffness(&mut self, index: usize) {
        let message = format!("spring {index} has no stiffness");
        self.find(Path::Spring(index, None), message, Some(HOW_STIFF));
    }

    /// The material of a spring, by its index.
    fn material(&mut self, index: usize, name: &str) -> Option<usize> {
        let known = self.materials.iter().map(|(name, _)| name.as_str());
        let path = Path::Spring(index, Some("material"));
        find_named("material", name, known, path, self.findings)
    }

    /// The law of a spring: its own or that of its material.
    fn law(
        &mut self,
        index: usize,
        own: Option<&LawEntry>,
        material: Option<usize>,
    ) -> Option<usize> {
        let Some(own) = own else {
            return self.material_laws[material?];
        };
        let law = own.0.clone()?;
        let text = format!("{law:?}");
        if let Some(&known) = self.known_laws.get(&text) {
            return Some(known);
        }
        let place = self.add_law(law, Path::Spring(index, Some("law")));
        self.known_laws.insert(text, place);
        Some(place)
    }

    /// Sets what a spring has of its own fields and of those of its material.
    fn resolve(
        &mut self,
        index: usize,
        entry: &SpringEntry,
        more: &More,
        length: Option<f64>,
        spring: &mut Spring,
    ) {
        let owner = Owner::Spring(index);
        let material = match more.material.as_deref() {
            None => None,
            Some(name) => match self.material(index, name) {
                None => return,
                known => known,
            },
        };
        self.check(owner, &more.properties);
        spring.law = self.law(index, more.properties.law.as_ref(), material);
        let materials = self.materials;
        let common = material.and_then(|material| materials[material].1.breaks_at);
        // What is wrong with that of a material is said there.
        let common = common.filter(|limit| limit.limit().is_possible());
        spring.breaks_at = more.properties.breaks_at.or(common).map(LimitEntry::limit);
        spring.broken = more.broken;
        spring.yielded = more.yielded;
        let Some(means) = self.means(index, entry, &more.properties, material) else {
            return;
        };
        let law = spring.law.map(|law| self.resolved.laws[law].clone());
        if law.as_ref().is_some_and(|law| law.fault().is_some()) {
            // Validation says so.
            return;
        }
        let own = law.as_ref().and_then(SpringLaw::own_axial_stiffness);
        let area = means.area.unwrap_or(f64::NAN);
        let axial = match (means.axial, own) {
            (Some(("stiffness", stiffness)), _) => AxialStiffness::OfSpring(stiffness),
            (_, Some(own)) => AxialStiffness::OfMaterial(own),
            (Some(("E", modulus)), None) => AxialStiffness::OfMaterial(modulus * area),
            (Some((_, axial)), None) => AxialStiffness::OfMaterial(axial),
            (None, None) => return self.find_no_stiffness(index),
        };
        let rest = self.one_of(
            owner,
            [
                named("rest_length", entry.rest_length),
                named("pretension", more.pretension),
                named("prestrain", more.prestrain),
                named("force_density", more.force_density),
            ],
        );
        let Some(length) = length else {
            return;
        };
        if let Some((field, value)) = rest {
            match rest_length(field, value, length, axial, law.as_ref()) {
                Ok(rest_length) => spring.rest_length = rest_length,
                Err((message, advice)) => {
                    let name = field.replace('_', " ");
                    let message =
                        format!("the {name} of spring {index} is not possible: {message}");
                    return self.find(owner.path(field), message, Some(advice));
                }
            }
        }
        if spring.rest_length == 0.0 && matches!(axial, AxialStiffness::OfMaterial(_)) {
            let message = format!("spring {index} has no length that its stiffness refers to");
            let advice = "give it a rest_length, or a stiffness in N/m";
            return self.find(Path::Spring(index, None), message, Some(advice));
        }
        spring.stiffness = axial.stiffness(spring.rest_length);
        if let Some((field, value)) = means.mass {
            spring.mass = match field {
                "mass" => value,
                "density" => value * area * spring.rest_length,
                _ => value * spring.rest_length,
            };
        }
        match means.damping {
            Some(("damping_ratio", ratio)) => {
                self.resolved.inputs.damping_ratios.push((index, ratio))
            }
            Some((_, damping)) => spring.damping = damping,
            None => {}
        }
        self.resolved.inputs.springs.push(SpringInput {
            spring: index,
            material,
            area: means.area,
            is_by_length: matches!(axial, AxialStiffness::OfMaterial(_))
                && !matches!(means.mass, None | Some(("mass", _))),
            is_prestressed: !matches!(rest, None | Some(("rest_length", _))),
        });
    }

    /// What of its own fields, or else of those of its material, a spring goes by;
    /// `None` if something is wrong with them.
    fn means(
        &mut self,
        index: usize,
        entry: &SpringEntry,
        own: &MaterialEntry,
        material: Option<usize>,
    ) -> Option<Means> {
        let owner = Owner::Spring(index);
        let none = MaterialEntry::default();
        let materials = self.materials;
        let common = material.map_or(&none, |material| &materials[material].1);
        let first = |fields: [Given; 2]| fields.into_iter().flatten().next();
        let axial = self.one_of(
            owner,
            [named("stiffness", entry.stiffness), first(axial_of(own))],
        );
        let mass = self.one_of(owner, [named("mass", entry.mass), first(mass_of(own))]);
        let damping = [named("damping", entry.damping), first(damping_of(own))];
        let damping = self.one_of(owner, damping);
        let own_section = first(section_of(own));
        let section = own_section.or(first(section_of(common)));
        let means = Means {
            axial: axial.or(first(axial_of(common))),
            area: section.map(|(field, value)| match field {
                "diameter" => PI / 4.0 * value * value,
                _ => value,
            }),
            mass: mass.or(first(mass_of(common))),
            damping: damping.or(first(damping_of(common))),
        };
        let mut is_needed = false;
        for (field, _) in [means.axial, means.mass].into_iter().flatten() {
            if !["E", "density"].contains(&field) {
                continue;
            }
            is_needed = true;
            if means.area.is_none() {
                let message = format!("the {field} of spring {index} needs a cross section");
                let advice = "give area in m² or diameter in m with it";
                self.find(owner.path(field), message, Some(advice));
                return None;
            }
        }
        if let (Some((field, _)), false) = (own_section, is_needed) {
            let message = format!("nothing of spring {index} depends on its {field}");
            let advice = "give E or density with it, or leave it out";
            self.find(owner.path(field), message, Some(advice));
            return None;
        }
        Some(means)
    }
}

/// What a spring goes by.
struct Means {
    axial: Given,
    area: Option<f64>,
    mass: Given,
    damping: Given,
}

/// l₀, in m, or what is wrong and what to do about it.
fn rest_length(
    field: &str,
    value: f64,
    length: f64,
    axial: AxialStiffness,
    law: Option<&SpringLaw>,
) -> Result<f64, (String, &'static str)> {
    let tension = match field {
        "rest_length" => return Ok(value),
        "prestrain" if value > -1.0 => return Ok(length / (1.0 + value)),
        "prestrain" => {
            let message = format!("a strain of {value} would need a negative length");
            return Err((message, "strain is length over rest length, less 1"));
        }
        "force_density" => value * length,
        _ => value,
    };
    rest_length_under(tension, length, axial, law).map_err(|error| {
        let advice = match error {
            PretensionError::NoLength { .. } => "look at its unit and that of the stiffness",
            _ => "give it a rest_length or a prestrain",
        };
        (error.to_string(), advice)
    })
}

fn named(field: &'static str, value: Option<f64>) -> Given {
    value.map(|value| (field, value))
}

fn fields<const N: usize>(fields: [(&'static str, Option<Real>); N]) -> [Given; N] {
    fields.map(|(field, value)| named(field, value.map(|real| real.0)))
}

fn axial_of(entry: &MaterialEntry) -> [Given; 2] {
    fields([("EA", entry.axial_stiffness), ("E", entry.modulus)])
}

fn section_of(entry: &MaterialEntry) -> [Given; 2] {
    fields([("area", entry.area), ("diameter", entry.diameter)])
}

fn mass_of(entry: &MaterialEntry) -> [Given; 2] {
    fields([
        ("mass_per_length", entry.mass_per_length),
        ("density", entry.density),
    ])
}

fn damping_of(entry: &MaterialEntry) -> [Given; 2] {
    fields([
        ("damping", entry.damping),
        ("damping_ratio", entry.damping_ratio),
    ])
}
