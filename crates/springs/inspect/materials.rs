//! What the springs of a scene file come to, material by material, and which of it no
//! material is like: most often a wrong unit.

use super::range::Range;
use super::warning::Warnings;
use super::words::rounded;
use serde::Serialize;
use springs_io::{Inputs, SpringInput};
use springs_scene::{Scene, Spring};
use std::ops::RangeInclusive;

/// What the springs of a material come to, or those without one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MaterialRanges {
    /// The material; `None`: of the springs that have none.
    pub material: Option<String>,
    /// How many springs.
    pub springs: usize,
    /// K, in N/m.
    pub stiffness: Range,
    /// l₀, in m.
    pub rest_length: Range,
    /// m, in kg.
    pub mass: Range,
    /// c, in N·s/m.
    pub damping: Range,
}

/// A law, and how many springs have it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct LawCount {
    /// Its name in scene files.
    pub law: String,
    /// How many springs have one of that name.
    pub springs: usize,
}

/// Ranges for each material of a file that springs have, then for springs without one.
pub(super) fn ranges(scene: &Scene, inputs: &Inputs) -> Vec<MaterialRanges> {
    let mut of_materials = vec![Vec::new(); inputs.materials.len()];
    let mut has_material = vec![false; scene.springs.len()];
    for input in &inputs.springs {
        if let Some(material) = input.material {
            of_materials[material].push(input.spring);
            has_material[input.spring] = true;
        }
    }
    let without = (0..scene.springs.len()).filter(|&spring| !has_material[spring]);
    let named = inputs.materials.iter().cloned().map(Some);
    let groups = named.zip(of_materials).chain([(None, without.collect())]);
    let ranges = groups.filter_map(|(material, springs)| {
        let range = |of: &dyn Fn(usize) -> f64| {
            Range::of(springs.iter().map(|&spring| (spring, of(spring))))
        };
        Some(MaterialRanges {
            material,
            springs: springs.len(),
            stiffness: range(&|spring| scene.springs[spring].stiffness)?,
            rest_length: range(&|spring| scene.springs[spring].rest_length)?,
            mass: range(&|spring| scene.springs[spring].mass)?,
            damping: range(&|spring| scene.dashpot(spring))?,
        })
    });
    ranges.collect()
}

/// How many springs have which law, the linear one left out.
pub(super) fn laws(scene: &Scene) -> Vec<LawCount> {
    let mut counts: Vec<LawCount> = Vec::new();
    for law in scene.springs.iter().filter_map(|spring| spring.law) {
        let law = &scene.laws[law];
        match counts.iter_mut().find(|known| known.law == law.name()) {
            Some(known) => known.springs += 1,
            None => counts.push(LawCount {
                law: law.name().to_owned(),
                springs: 1,
            }),
        }
    }
    counts
}

/// From aerogel to osmium, in kg/m³, with room to spare.
const DENSITIES: RangeInclusive<f64> = 1.0..=3e4;
/// From gels to diamond, in Pa.
const MODULI: RangeInclusive<f64> = 1e3..=2e12;
/// How fast sound runs along a bar, from gels to diamond, in m/s.
const SPEEDS: RangeInclusive<f64> = 5.0..=2e4;
/// More than this is seldom meant of a strain at the start.
const MOST_STRAINED: f64 = 0.1;

/// Moduli that metals and concrete have, in MPa; and the density, in kg/m³, from which on no material
/// is so soft as these would be in Pa.
const MODULI_IN_MPA: RangeInclusive<f64> = 1e4..=4.5e5;
const NOT_SO_SOFT: f64 = 1500.0;
/// No spring is thicker than this part of its length.
const MOST_STOUT: f64 = 1.0;

/// What no material is like.
pub(super) fn list(scene: &Scene, inputs: &Inputs, warnings: &mut Warnings) {
    let mut tell = |of: &dyn Fn(&SpringInput, &Spring) -> Option<f64>,
                    says: &dyn Fn(&str, f64) -> String,
                    suggestion: &str| {
        let found = inputs.springs.iter().filter_map(|input| {
            let value = of(input, &scene.springs[input.spring])?;
            Some((input.spring, value))
        });
        let (springs, values): (Vec<usize>, Vec<f64>) = found.unzip();
        if let Some(&first) = values.first() {
            warnings.of_springs(&springs, |named| says(named, first), suggestion);
        }
    };
    let outside = |value: f64, range: &RangeInclusive<f64>| {
        (value > 0.0 && !range.contains(&value)).then_some(value)
    };
    let density = |input: &SpringInput, spring: &Spring| {
        Some(spring.mass / (input.area? * spring.rest_length))
    };
    let modulus = |input: &SpringInput, spring: &Spring| {
        Some(spring.stiffness * spring.rest_length / input.area?)
    };
    tell(
        &|input, spring| outside(density(input, spring)?, &DENSITIES),
        &|springs, density| {
            format!(
                "{springs}: {} kg/m³ by mass and cross section, which no material has",
                rounded(density)
            )
        },
        "are mass per length in kg/m, density in kg/m³, area in m² and diameter in m?",
    );
    tell(
        &|input, spring| outside(modulus(input, spring)?, &MODULI),
        &|springs, modulus| {
            format!(
                "{springs}: Young's modulus is {} Pa by stiffness and cross section, which no \
                 material has",
                rounded(modulus)
            )
        },
        "is E in Pa (1 GPa is 1e9 Pa), area in m², diameter in m?",
    );
    tell(
        &|input, spring| {
            let (modulus, density) = (modulus(input, spring)?, density(input, spring)?);
            let is_soft = density > 0.0 && density < NOT_SO_SOFT;
            (MODULI_IN_MPA.contains(&modulus) && !is_soft).then_some(modulus)
        },
        &|springs, modulus| {
            format!(
                "{springs}: Young's modulus is {} Pa, softer than rubber, but a number that \
                 metals have in MPa",
                rounded(modulus)
            )
        },
        "is E in Pa? 210000 MPa, as of steel, is 2.1e11",
    );
    tell(
        &|input, spring| {
            let thickness = input.area?.sqrt();
            let is_stout = thickness > MOST_STOUT * spring.rest_length && spring.rest_length > 0.0;
            is_stout.then_some(thickness)
        },
        &|springs, thickness| {
            format!(
                "{springs}: about {} m thick by the cross section, and shorter than that",
                rounded(thickness)
            )
        },
        "is area in m² (1 mm² is 1e-6 m²), diameter in m?",
    );
    tell(
        &|input, spring| {
            let speed = spring.rest_length * (spring.stiffness / spring.mass).sqrt();
            outside(speed, &SPEEDS).filter(|_| input.is_by_length && speed.is_finite())
        },
        &|springs, speed| {
            format!(
                "{springs}: sound would run along at {} m/s, and in no material it does",
                rounded(speed)
            )
        },
        "is EA in N, E in Pa, mass per length in kg/m, density in kg/m³?",
    );
    tell(
        &|input, spring| {
            let [a, b] = spring.nodes.map(|node| &scene.nodes[node]);
            let strain = a.distance(b) / spring.rest_length - 1.0;
            let is_large = strain.abs() > MOST_STRAINED && strain.is_finite();
            (input.is_prestressed && is_large).then_some(strain)
        },
        &|springs, strain| {
            format!(
                "{springs}: strained by {} % at the start by what is said of the tension",
                rounded(100.0 * strain)
            )
        },
        "is pretension in N, force density in N/m, prestrain no percentage?",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_io::parse_scene_with_inputs;

    /// A spring of 2 m.
    fn read(material: &str, spring: &str) -> (Scene, Inputs) {
        let text = format!(
            "Scene(version: 1, materials: {{\"wire\": ({material})}},
            nodes: [(position: (0, 0, 0), fixed: true), (position: (2, 0, 0), mass: 1)],
            springs: [(nodes: (0, 1), material: \"wire\"{spring})])"
        );
        let (scene, _, inputs) = parse_scene_with_inputs("scene.ron", &text).unwrap();
        (scene, inputs)
    }

    fn said(scene: &Scene, inputs: &Inputs) -> String {
        let mut warnings = Warnings::default();
        list(scene, inputs, &mut warnings);
        warnings.to_string()
    }

    #[test]
    fn real_materials_raise_no_suspicion() {
        for (material, spring) in [
            // A steel wire rope, an ACSR conductor, a spider's thread, a rubber cord, cork.
            (
                "E: 1e11, diameter: 0.02, density: 5000",
                ", pretension: 20e3",
            ),
            ("EA: 2.95e7, mass_per_length: 1.628, damping_ratio: 0.1", ""),
            (
                "E: 1e10, diameter: 3e-6, density: 1300",
                ", prestrain: 0.02",
            ),
            (
                "E: 1e6, diameter: 0.01, density: 950, law: TensionOnly()",
                "",
            ),
            ("E: 2e7, area: 1e-2, density: 160", ""),
            ("law: Power(exponent: 1.5)", ", stiffness: 1e9, mass: 1e-3"),
        ] {
            let (scene, inputs) = read(material, spring);
            assert_eq!(said(&scene, &inputs), "", "{material}");
        }
    }

    #[test]
    fn wrong_units_are_noticed() {
        for (material, spring, part) in [
            // In GPa, g/cm³, mm, kN/m and g/m.
            (
                "E: 100, diameter: 0.02, density: 5000",
                "",
                "no material it does",
            ),
            ("E: 10, diameter: 0.02", "", "Young's modulus is 10 Pa"),
            // In MPa, and in mm².
            ("E: 210000, diameter: 0.02", "", "have in MPa; is E in Pa?"),
            (
                "E: 70e3, diameter: 0.02, density: 2700",
                "",
                "have in MPa; is E in Pa?",
            ),
            ("E: 2.1e11, area: 314", "", "about 18 m thick"),
            ("E: 1e11, diameter: 0.02, density: 0.5", "", "0.5 kg/m³"),
            (
                "E: 1e11, diameter: 20, density: 7850, damping: 1",
                ", mass: 1",
                "kg/m³ by mass",
            ),
            ("EA: 1e9, mass_per_length: 0.4", "", "run along at 50000"),
            (
                "EA: 2.95e7, mass_per_length: 0.001",
                "",
                "run along at 1.7e5",
            ),
            (
                "EA: 1e4, mass_per_length: 0.1",
                ", pretension: 5000",
                "strained by 50",
            ),
            (
                "EA: 1e4, mass_per_length: 0.1",
                ", prestrain: 0.3",
                "strained by 30",
            ),
        ] {
            let (scene, inputs) = read(material, spring);
            let said = said(&scene, &inputs);
            assert!(said.contains(part), "{material}: {part} in\n{said}");
        }
    }

    #[test]
    fn ranges_are_those_of_each_material() {
        let text = "Scene(version: 1,
            materials: {\"a\": (EA: 6), \"b\": (EA: 6, mass_per_length: 2, damping: 3, law: TensionOnly())},
            nodes: [(position: (0, 0, 0), fixed: true), (position: (2, 0, 0), mass: 1), (position: (5, 0, 0))],
            springs: [(nodes: (0, 1), material: \"b\"), (nodes: (1, 2), material: \"b\"),
                (nodes: (1, 2), stiffness: 7)])";
        let (scene, _, inputs) = parse_scene_with_inputs("scene.ron", text).unwrap();
        let ranges = ranges(&scene, &inputs);
        let said = ranges.iter().map(|of| {
            let names = of.material.as_deref().unwrap_or("none");
            let values = [&of.stiffness, &of.rest_length, &of.mass, &of.damping];
            format!(
                "{} {names}: {}",
                of.springs,
                values.map(Range::to_string).join(", ")
            )
        });
        let expected = ["2 b: 2 to 3, 2 to 3, 4 to 6, 3", "1 none: 7, 3, 0, 0"];
        assert_eq!(said.collect::<Vec<_>>(), expected);
        let laws = laws(&scene);
        assert_eq!((laws[0].law.as_str(), laws[0].springs), ("TensionOnly", 2));
        assert!(super::ranges(&Scene::default(), &Inputs::default()).is_empty());
    }
}
