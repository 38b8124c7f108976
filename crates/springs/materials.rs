//! What the springs of a scene file come to, material by material, and which of it no
//! material is like: most often a wrong unit.

use crate::inspect::{count, name_them};
use crate::proportions::rounded;
use springs_io::{Inputs, SpringInput};
use springs_scene::{Scene, Spring, SpringLaw, printable};
use std::ops::RangeInclusive;

/// Ranges of K, l₀, m and c in SI units for each material of a file and for the springs
/// without one, and how many springs have which law; nothing where a file has neither
/// materials nor laws. `number` writes a number.
pub fn ranges(scene: &Scene, inputs: &Inputs, number: fn(f64) -> String) -> Vec<String> {
    if inputs.springs.is_empty() && scene.laws.is_empty() {
        return Vec::new();
    }
    let mut of_materials = vec![Vec::new(); inputs.materials.len()];
    let mut has_material = vec![false; scene.springs.len()];
    for input in &inputs.springs {
        if let Some(material) = input.material {
            of_materials[material].push(input.spring);
            has_material[input.spring] = true;
        }
    }
    let without = (0..scene.springs.len()).filter(|&spring| !has_material[spring]);
    let named = inputs.materials.iter().map(|name| printable(name));
    let named = named
        .map(|name| format!("material {name}"))
        .zip(of_materials);
    let rest = ("without a material".to_owned(), without.collect());
    let groups = named.chain([rest]);
    let groups = groups.filter(|(_, springs)| !springs.is_empty());
    let lines = groups.map(|(name, springs)| line(scene, &name, &springs, number));
    let mut lines: Vec<String> = lines.collect();
    let mut by_law: Vec<(&SpringLaw, usize)> = Vec::new();
    for law in scene.springs.iter().filter_map(|spring| spring.law) {
        let law = &scene.laws[law];
        match by_law
            .iter_mut()
            .find(|(known, _)| known.name() == law.name())
        {
            Some((_, springs)) => *springs += 1,
            None => by_law.push((law, 1)),
        }
    }
    if !by_law.is_empty() {
        let laws = by_law.iter();
        let laws = laws.map(|(law, springs)| format!("{law} of {}", count(*springs, "spring")));
        lines.push(format!("laws: {}", laws.collect::<Vec<_>>().join(", ")));
    }
    lines
}

fn line(scene: &Scene, name: &str, springs: &[usize], number: fn(f64) -> String) -> String {
    let range = |symbol: &str, unit: &str, of: &dyn Fn(usize) -> f64| {
        let values = springs.iter().map(|&spring| of(spring));
        let (least, most) = values.fold((f64::INFINITY, 0.0), |(least, most), value| {
            (value.min(least), value.max(most))
        });
        let (least, most) = (number(least), number(most));
        if least == most {
            format!("{symbol} {least} {unit}")
        } else {
            format!("{symbol} {least} to {most} {unit}")
        }
    };
    let ranges = [
        range("K", "N/m", &|spring| scene.springs[spring].stiffness),
        range("l₀", "m", &|spring| scene.springs[spring].rest_length),
        range("m", "kg", &|spring| scene.springs[spring].mass),
        range("c", "N·s/m", &|spring| scene.dashpot(spring)),
    ];
    let n = count(springs.len(), "spring");
    format!("{n}, {name}: {}", ranges.join(", "))
}

/// From aerogel to osmium, in kg/m³, with room to spare.
const DENSITIES: RangeInclusive<f64> = 1.0..=3e4;
/// From gels to diamond, in Pa.
const MODULI: RangeInclusive<f64> = 1e3..=2e12;
/// How fast sound runs along a bar, from gels to diamond, in m/s.
const SPEEDS: RangeInclusive<f64> = 5.0..=2e4;
/// More than this is seldom meant of a strain at the start.
const MOST_STRAINED: f64 = 0.1;

/// What no material is like, as sentences.
pub fn suspicious(scene: &Scene, inputs: &Inputs) -> Vec<String> {
    let mut suspicious = Vec::new();
    let mut tell = |of: &dyn Fn(&SpringInput, &Spring) -> Option<f64>,
                    says: &dyn Fn(&str, f64) -> String| {
        let found = inputs.springs.iter().filter_map(|input| {
            let value = of(input, &scene.springs[input.spring])?;
            Some((input.spring, value))
        });
        let (springs, values): (Vec<usize>, Vec<f64>) = found.unzip();
        if let Some(&first) = values.first() {
            suspicious.push(says(&name_them("spring", &springs), first));
        }
    };
    let outside = |value: f64, range: &RangeInclusive<f64>| {
        (value > 0.0 && !range.contains(&value)).then_some(value)
    };
    tell(
        &|input, spring| outside(spring.mass / (input.area? * spring.rest_length), &DENSITIES),
        &|springs, density| {
            format!(
                "{springs}: {} kg/m³ by mass and cross section, which no material has; are mass \
                 per length in kg/m, density in kg/m³, area in m² and diameter in m?",
                rounded(density)
            )
        },
    );
    tell(
        &|input, spring| outside(spring.stiffness * spring.rest_length / input.area?, &MODULI),
        &|springs, modulus| {
            format!(
                "{springs}: Young's modulus is {} Pa by stiffness and cross section, which no \
                 material has; is E in Pa (1 GPa is 1e9 Pa), area in m², diameter in m?",
                rounded(modulus)
            )
        },
    );
    tell(
        &|input, spring| {
            let speed = spring.rest_length * (spring.stiffness / spring.mass).sqrt();
            outside(speed, &SPEEDS).filter(|_| input.is_by_length && speed.is_finite())
        },
        &|springs, speed| {
            format!(
                "{springs}: sound would run along at {} m/s, and in no material it does; is EA \
                 in N, E in Pa, mass per length in kg/m, density in kg/m³?",
                rounded(speed)
            )
        },
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
                "{springs}: strained by {} % at the start by what is said of the tension; is \
                 pretension in N, force density in N/m, prestrain no percentage?",
                rounded(100.0 * strain)
            )
        },
    );
    suspicious
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
            assert_eq!(
                suspicious(&scene, &inputs),
                Vec::<String>::new(),
                "{material}"
            );
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
            let said = suspicious(&scene, &inputs).join("\n");
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
        let lines = ranges(&scene, &inputs, |value| value.to_string());
        let expected = [
            "2 springs, material b: K 2 to 3 N/m, l₀ 2 to 3 m, m 4 to 6 kg, c 3 N·s/m",
            "1 spring, without a material: K 7 N/m, l₀ 3 m, m 0 kg, c 0 N·s/m",
            "laws: TensionOnly of 2 springs",
        ];
        assert_eq!(lines, expected);
        assert!(ranges(&Scene::default(), &Inputs::default(), |_| String::new()).is_empty());
    }
}
