//! Springs in scene files as engineers give them: what they come to, and that it reads
//! back to the same bits.

use springs::assembly::compile;
use springs::io::{SceneError, parse_scene, parse_scene_with_inputs, scene_to_string};
use springs::scene::{RunOptions, Scene, Spring, SpringLaw};
use std::f64::consts::PI;

/// A fixed node at 0, one of 2 kg at 2 m, and one of 3 kg at 5 m along x.
fn scene(materials: &str, springs: &str) -> Scene {
    let text = format!(
        "Scene(version: 1, materials: {{{materials}}},
        groups: {{\"both\": [1, 2], \"none\": []}},
        nodes: [(position: (0, 0, 0), fixed: true), (position: (2, 0, 0), mass: 2),
            (position: (5, 0, 0), mass: 3)],
        springs: [{springs}],
        loads: [(nodes: \"both\", force: (0, 0, -1))])"
    );
    let scene = parse_scene("scene.ron", &text)
        .unwrap_or_else(|error| panic!("{error}"))
        .0;
    let written = scene_to_string(&scene, &RunOptions::default());
    let back = parse_scene("back.ron", &written)
        .unwrap_or_else(|error| panic!("{error}"))
        .0;
    assert_eq!(back, scene);
    let bits = |scene: &Scene| -> Vec<u64> {
        let numbers = scene.springs.iter().flat_map(|spring| {
            [
                spring.stiffness,
                spring.rest_length,
                spring.mass,
                spring.damping,
            ]
        });
        numbers.map(f64::to_bits).collect()
    };
    assert_eq!(bits(&back), bits(&scene));
    assert_eq!(scene.loads[0].nodes, [1, 2]);
    scene
}

fn only(materials: &str, spring: &str) -> Spring {
    scene(materials, &format!("(nodes: (0, 1), {spring})")).springs[0]
}

fn assert_near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-14 * expected.abs(),
        "{found} is not {expected}"
    );
}

#[test]
fn stiffness_comes_from_the_material() {
    assert_eq!(only("", "EA: 500").stiffness, 250.0);
    assert_eq!(only("", "EA: 500, rest_length: 4").stiffness, 125.0);
    assert_near(only("", "E: 2e11, area: 1e-4").stiffness, 1e7);
    let strut = only(
        "\"strut\": (E: 2e11, diameter: 0.02, density: 7850)",
        "material: \"strut\"",
    );
    assert_near(strut.stiffness, 2e11 * PI * 1e-4 / 2.0);
    assert_near(strut.mass, 7850.0 * PI * 1e-4 * 2.0);
    // Its own goes first, one by one.
    let thick = only(
        "\"strut\": (E: 2e11, diameter: 0.02, density: 7850)",
        "material: \"strut\", diameter: 0.04, mass: 7",
    );
    assert_near(thick.stiffness, 2e11 * PI * 4e-4 / 2.0);
    assert_eq!(thick.mass, 7.0);
    let wire = only(
        "\"wire\": (EA: 500, mass_per_length: 0.4)",
        "material: \"wire\", stiffness: 3",
    );
    assert_eq!((wire.stiffness, wire.mass), (3.0, 0.8));
}

#[test]
fn rest_lengths_come_from_what_springs_have_at_the_start() {
    let tension = |spring: &Spring| spring.stiffness * (2.0 - spring.rest_length);
    let by_material = only("", "EA: 500, pretension: 125, mass_per_length: 0.5");
    assert_eq!((by_material.rest_length, by_material.mass), (1.6, 0.8));
    assert_near(tension(&by_material), 125.0);
    assert_eq!(
        only("", "stiffness: 500, pretension: 125").rest_length,
        1.75
    );
    assert_near(
        only("", "stiffness: 500, pretension: -125").rest_length,
        2.25,
    );
    assert_eq!(only("", "EA: 500, prestrain: 0.25").rest_length, 1.6);
    let by_density = only("", "EA: 500, force_density: 62.5");
    assert_eq!(by_density.rest_length, 1.6);
    let cable = only(
        "\"cable\": (EA: 500, law: TensionOnly())",
        "material: \"cable\", pretension: 125",
    );
    assert_eq!(cable.rest_length, 1.6);
}

#[test]
fn damping_ratios_are_of_the_critical_damping_of_both_ends() {
    // c = 2ζ√(K m) on a fixed node, with the reduced mass of 6/5 kg between the others.
    let found = scene(
        "",
        "(nodes: (1, 0), stiffness: 200, damping_ratio: 0.1),
        (nodes: (1, 2), stiffness: 30, damping_ratio: 0.5)",
    );
    assert_near(found.springs[0].damping, 4.0);
    assert_near(found.springs[1].damping, 6.0);
    // Masses of springs count, whatever comes later in the file.
    let found = scene(
        "",
        "(nodes: (1, 0), stiffness: 200, damping_ratio: 0.1),
        (nodes: (0, 1), stiffness: 1, mass: 12)",
    );
    assert_near(found.springs[0].damping, 8.0);
    let own = only(
        "\"m\": (damping_ratio: 0.1)",
        "material: \"m\", stiffness: 200, damping: 7",
    );
    assert_eq!(own.damping, 7.0);
}

/// A mass on a spring of that ratio dies out as the textbook says: by e^{−2πζ/√(1 − ζ²)}
/// from one swing to the next.
#[test]
fn a_damping_ratio_is_that_of_a_single_oscillator() {
    let mut scene = scene("", "(nodes: (0, 1), stiffness: 200, damping_ratio: 0.1)");
    scene.nodes.truncate(2);
    scene.loads.clear();
    scene.nodes[1].position.x = 2.5;
    scene.springs[0].rest_length = 2.0;
    let (ratio, frequency) = (0.1f64, 10.0);
    let root = (1.0 - ratio * ratio).sqrt();
    scene.settings.duration = 2.0 * PI / (frequency * root);
    scene.settings.method = springs::scene::Method::Dop853;
    scene.settings.step = springs::scene::StepControl::Fixed(1e-3);
    let mut simulation = springs::step::Simulation::new(&scene).unwrap();
    simulation.run(1, &mut ()).unwrap();
    let left = (simulation.nodes().positions[1].x - 2.0) / 0.5;
    let expected = (-2.0 * PI * ratio / root).exp();
    assert!((left - expected).abs() < 1e-11, "{left} {expected}");
}

#[test]
fn laws_are_read_and_shared() {
    let found = scene(
        "\"a\": (law: TensionOnly(blend: 0)), \"b\": (EA: 1, law: Linear)",
        "(nodes: (0, 1), material: \"a\", stiffness: 5),
        (nodes: (0, 1), material: \"b\"),
        (nodes: (0, 1), material: \"a\", law: Linear, stiffness: 5),
        (nodes: (0, 1), stiffness: 5, law: CompressionOnly(blend: 0.25)),
        (nodes: (0, 1), stiffness: 5, law: Bilinear(compression: 2)),
        (nodes: (0, 1), law: Polynomial([1, 0.25])),
        (nodes: (1, 2), law: Polynomial([1, 0.25])),
        (nodes: (0, 1), law: Table([(-1, -7), (0, 0), (0.5, 3)])),
        (nodes: (0, 1), stiffness: 5, law: Limit(strain: 0.1, stiffness: 50, blend: 0.01)),
        (nodes: (0, 1), stiffness: 5, law: Power(exponent: 1.5)),
        (nodes: (0, 1), stiffness: 5, law: TensionOnly(blend: 0))",
    );
    let of: Vec<Option<usize>> = found.springs.iter().map(|spring| spring.law).collect();
    let expected = [0, 9, 9, 1, 2, 3, 3, 4, 5, 6, 0].map(|law| Some(law).filter(|law| *law < 9));
    assert_eq!(of, expected);
    let laws = [
        SpringLaw::TensionOnly { blend: 0.0 },
        SpringLaw::CompressionOnly { blend: 0.25 },
        SpringLaw::Bilinear {
            compression: 2.0,
            blend: SpringLaw::BLEND,
        },
        SpringLaw::Polynomial([1.0, 0.25].into()),
        SpringLaw::Table([[-1.0, -7.0], [0.0, 0.0], [0.5, 3.0]].into()),
        SpringLaw::Limit {
            strain: 0.1,
            stiffness: 50.0,
            blend: 0.01,
        },
        SpringLaw::Power { exponent: 1.5 },
    ];
    assert_eq!(found.laws, laws);
    assert_eq!(found.springs[5].stiffness, 0.5);
    assert_eq!(found.springs[6].stiffness, 1.0 / 3.0);
    assert_eq!(found.springs[7].stiffness, 3.0);
}

#[test]
fn inputs_say_how_springs_were_given() {
    let text = "Scene(version: 1, materials: {\"a\": (EA: 5), \"b\": (E: 5, area: 2)},
        nodes: [(position: (0, 0, 0), fixed: true), (position: (2, 0, 0), mass: 2)],
        springs: [(nodes: (0, 1), stiffness: 1), (nodes: (0, 1), material: \"b\", prestrain: 0.5),
            (nodes: (0, 1), material: \"a\")])";
    let (_, _, inputs) = parse_scene_with_inputs("scene.ron", text).unwrap();
    assert_eq!(inputs.materials, ["a", "b"]);
    let found: Vec<_> = inputs
        .springs
        .iter()
        .map(|input| {
            (
                input.spring,
                input.material,
                input.area,
                input.is_prestressed,
            )
        })
        .collect();
    assert_eq!(
        found,
        [(1, Some(1), Some(2.0), true), (2, Some(0), None, false)]
    );
}

#[test]
fn everything_wrong_is_told_at_once() {
    let text = "Scene(version: 1, materials: {\"a\": (EA: -5)},
        nodes: [(position: (0, 0, 0), fixed: true), (position: (2, 0, 0), mass: 2)],
        springs: [(nodes: (0, 1)), (nodes: (0, 1), material: \"b\"), (nodes: (0, 1), E: 5)],
        loads: [(nodes: \"x\", force: (0, 0, 1))])";
    let Err(SceneError::Wrong { findings, .. }) = parse_scene("scene.ron", text) else {
        panic!("it is wrong");
    };
    let paths: Vec<&str> = findings
        .iter()
        .map(|finding| finding.path.as_str())
        .collect();
    let expected = [
        "materials.a.EA",
        "springs[0]",
        "springs[1].material",
        "springs[2].E",
        "loads[0].nodes",
    ];
    assert_eq!(paths, expected);
}

/// Small pretensions of springs that only pull or push lie within their blend: the scene has
/// them all the same.
#[test]
fn pretension_within_a_blend_is_what_the_spring_has() {
    let stiffnesses = ["EA: 5.2e5", "stiffness: 2.6e5"];
    for (law, tensions) in [
        ("TensionOnly(blend: 1e-3)", [500.0, 0.5, 519.9, 520.1]),
        ("CompressionOnly(blend: 0.1)", [-500.0, -0.5, -519.9, -4e4]),
    ] {
        for (stiffness, tension) in stiffnesses.iter().flat_map(|k| tensions.map(|t| (k, t))) {
            let text = format!(
                "Scene(version: 1, nodes: [(position: (0, 0, 0), fixed: true), \
                 (position: (0, 0, 2), mass: 1)], springs: [(nodes: (0, 1), {stiffness}, \
                 law: {law}, pretension: {tension:?})])"
            );
            let (scene, _) = parse_scene("wire.ron", &text).unwrap();
            let system = compile(&scene).unwrap();
            let mut found = Vec::new();
            let x = system.initial_positions();
            system.each_tension(x, None, &mut |_, tension| found.push(tension));
            let off = (found[0] - tension).abs();
            // Rounding of lengths of 2 m.
            assert!(off < 1e-9, "{law}, {stiffness}: {found:?}, not {tension}");
        }
    }
}
