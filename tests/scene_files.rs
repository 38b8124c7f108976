//! Scene files read back bit for bit, and in every spelling that is promised.

mod common;

use common::{Random, tangle};
use springs::io::{parse_scene, read_scene, scene_to_string};
use springs::scene::generate::{Material, block, chain, cloth};
use springs::scene::{
    Guide, Method, OverTime, Probe, ProbeQuantity, Probed, RunOptions, Scene, StepControl, Tangent,
    Vector3,
};
use springs::step::Simulation;

fn bits(scene: &Scene) -> Vec<u64> {
    let nodes = scene.nodes.iter().flat_map(|node| {
        let vectors = [node.position, node.velocity];
        let numbers: Vec<f64> = vectors
            .iter()
            .flatten()
            .copied()
            .chain([node.mass])
            .collect();
        numbers
    });
    let springs = scene.springs.iter().flat_map(|spring| {
        [
            spring.stiffness,
            spring.rest_length,
            spring.mass,
            spring.damping,
        ]
    });
    let gravity = scene.gravity.iter().copied();
    gravity
        .chain(nodes)
        .chain(springs)
        .map(f64::to_bits)
        .collect()
}

#[test]
fn written_scenes_read_back_to_the_same_bits() {
    let mut odd = tangle(20, 1);
    let mut random = Random(77);
    for node in &mut odd.nodes {
        // Any bits of numbers that a scene may hold: subnormal, huge, negative zero.
        for number in node.position.iter_mut().chain(node.velocity.iter_mut()) {
            let bits =
                (random.unit() * 2f64.powi(63)) as u64 ^ ((random.unit() * 1e9) as u64) << 40;
            let candidate = f64::from_bits(bits);
            *number = if candidate.abs() < 1e140 {
                candidate
            } else {
                -0.0
            };
        }
    }
    odd.nodes[3].velocity = Vector3::repeat(-0.0);
    odd.name = "quotes \" and \\ and \n lines, µ".to_owned();
    odd.settings.tangent = Some(Tangent::Filtered);
    odd.settings.step = StepControl::Tolerance(1e-300);
    odd.settings.method = Method::VelocityVerlet;
    let scenes = [
        Scene::default(),
        chain(5, Material::of_chain(5)),
        cloth(5, Material::of_cloth()),
        block(3, Material::of_block()),
        odd,
    ];
    for scene in scenes {
        let text = scene_to_string(&scene, &RunOptions::default());
        let back = parse_scene("test", &text).unwrap().0;
        assert_eq!(back, scene);
        assert_eq!(bits(&back), bits(&scene));
    }
}

#[test]
fn both_brackets_integers_comments_and_short_forms_are_read() {
    let plain = "Scene(
        version: 1,
        gravity: (0, 0, -10),
        nodes: [(position: (0, 0, 0), fixed: true), (position: (3, 4, 0), mass: 2)],
        springs: [(nodes: (0, 1), stiffness: 7)],
    )";
    let expected = parse_scene("plain", plain).unwrap().0;
    assert_eq!(expected.springs[0].rest_length, 5.0);
    assert_eq!(expected.settings.method, Method::Auto);
    assert_eq!(expected.settings.duration, 1.0);
    let spellings = [
        "(version: 1, gravity: [0, 0, -10.0],
         nodes: ((position: [0, 0, 0], fixed: true), (mass: 2.0, position: [3, 4, 0])),
         springs: ((stiffness: 7e0, nodes: [0, 1],),),)",
        "\u{feff}#![enable(implicit_some)]
         // a comment
         Scene(version: 1, /* another */ gravity: (0, 0, -1e1),
         nodes: [(position: (0, 0, 0), fixed: true), (position: (3, 4, 0), mass: 2)],
         springs: [(nodes: (0, 1), stiffness: 7, rest_length: 5)], simulation: ())",
    ];
    for text in spellings {
        assert_eq!(parse_scene("spelling", text).unwrap().0, expected);
    }
}

/// Supports in all their forms.
#[test]
fn supports_read_back() {
    let text = r#"Scene(version: 1, nodes: [
        (position: (0, 0, 0), fixed: "xyz"),
        (position: (1, 0, 0), mass: 2, fixed: "zx"),
        (position: (2, 0, 0), mass: 2, fixed: false, slides: (1, 0, -2)),
    ])"#;
    let scene = parse_scene("supports.ron", text).unwrap().0;
    assert!(scene.nodes[0].fixed && scene.nodes[0].guide.is_none());
    assert_eq!(scene.nodes[1].guide, Some(Guide::Held([true, false, true])));
    let direction = Vector3::new(1.0, 0.0, -2.0);
    assert_eq!(scene.nodes[2].guide, Some(Guide::Along(direction)));
    let written = scene_to_string(&scene, &RunOptions::default());
    assert!(written.contains(r#"fixed: "xz""#), "{written}");
    assert_eq!(parse_scene("again.ron", &written).unwrap().0, scene);
}

/// Motions in all their forms but files.
#[test]
fn motions_read_back() {
    let text = r#"Scene(version: 1,
        motions: {
            "shake \"1\"": Sine(amplitude: (0, 0.5, 1e-3), frequency: 2.5, phase: 1),
            "lift": Table([(0, (0, 0, 0)), (1.5, [0, 0, 0.2])]),
        },
        nodes: [
            (position: (0, 0, 0), fixed: true, motion: "lift"),
            (position: (1, 0, 0), fixed: true, velocity: (1, 0, 0), motion: "shake \"1\""),
        ],
    )"#;
    let scene = parse_scene("motions.ron", text).unwrap().0;
    let followed: Vec<_> = scene.nodes.iter().map(|node| node.motion).collect();
    assert_eq!(followed, [Some(1), Some(0)]);
    // Half way up a smooth rise.
    let half_way = scene.displacement(0, 0.75).unwrap().displacement.z;
    assert!((half_way - 0.1).abs() < 1e-15);
    let written = scene_to_string(&scene, &RunOptions::default());
    assert_eq!(parse_scene("again.ron", &written).unwrap().0, scene);
}

/// Loads in all their forms, and drag.
#[test]
fn loads_and_drag_read_back() {
    let text = "Scene(version: 1, drag: 0.25, damping: (mass: 0.5, stiffness: 1e-3),
        nodes: [(position: (0, 0, 0), mass: 1), (position: (1, 0, 0), mass: 2, drag: 0)],
        loads: [
            (nodes: [0, 1], force: (0, 0, -100)),
            (nodes: [1], force: (1, 2, 3), over_time: Ramp(from: 0.5, to: 2)),
            (nodes: [0], force: (0, 1, 0), over_time: Sine(frequency: 2.5)),
            (nodes: [1], force: (0, 1, 0), over_time: Table([(0, 0), (2, 100), (2.5, -1e-3)])),
        ],
    )";
    let scene = parse_scene("loads.ron", text).unwrap().0;
    assert_eq!(scene.drag, 0.25);
    assert_eq!(
        [scene.nodes[0].drag, scene.nodes[1].drag],
        [None, Some(0.0)]
    );
    assert_eq!(scene.damping.stiffness, 1e-3);
    assert_eq!(scene.loads.len(), 4);
    assert_eq!(scene.loads[0].nodes, [0, 1]);
    assert_eq!(scene.loads[1].over_time.factor(1.25), 0.5);
    assert_eq!(scene.loads[2].over_time.factor(0.1), 1.0);
    assert_eq!(scene.loads[3].over_time.factor(1.0), 50.0);
    let again = parse_scene(
        "again.ron",
        &scene_to_string(&scene, &RunOptions::default()),
    )
    .unwrap()
    .0;
    assert_eq!(again, scene);
}

/// The example of the scene format, as users know it.
#[test]
fn outputs_read_back() {
    let text = r#"Scene(
        version: 1,
        groups: { "deck": [1, 0] },
        nodes: [(position: (0, 0, 0), mass: 1), (position: (1, 0, 0), mass: 1)],
        springs: [(nodes: (0, 1), stiffness: 1)],
        output: (
            write: [Csv, Springs, Npz],
            frames: 600,
            probes: [
                (node: 1, of: [Position, Velocity], every: 0.001),
                (nodes: "deck", of: [Energy]),
                (spring: 0, of: [Length, Strain, Tension]),
                (springs: [0, 0], of: [Energy], every: 2),
            ],
        ),
    )"#;
    let (scene, options) = parse_scene("it", text).unwrap();
    assert_eq!(scene.output.write, ["csv", "springs", "npz"]);
    assert_eq!(scene.output.frames, Some(600));
    let probe = |on, of: &[ProbeQuantity], every| Probe {
        on,
        of: of.to_vec(),
        every,
    };
    use ProbeQuantity::{Energy, Length, Position, Strain, Tension, Velocity};
    let expected = [
        probe(Probed::Nodes(vec![1]), &[Position, Velocity], Some(0.001)),
        probe(Probed::Nodes(vec![1, 0]), &[Energy], None),
        probe(Probed::Springs(vec![0]), &[Length, Strain, Tension], None),
        probe(Probed::Springs(vec![0, 0]), &[Energy], Some(2.0)),
    ];
    assert_eq!(scene.output.probes, expected);
    let again = parse_scene("it", &scene_to_string(&scene, &options)).unwrap();
    assert_eq!(again.0, scene);
}

/// Tables are beside the scene, not where the program runs.
#[test]
fn loads_are_read_from_tables() {
    let folder = tempfile::tempdir().unwrap();
    let table = "t, factor\n0, 0\n0.5, 1e1\r\n\n2, -3\n";
    std::fs::write(folder.path().join("factors.csv"), table).unwrap();
    let scene = r#"Scene(
        version: 1,
        nodes: [(position: (0, 0, 0), mass: 1)],
        loads: [(nodes: [0], force: (0, 0, 1), over_time: Csv("factors.csv"))],
    )"#;
    let path = folder.path().join("scene.ron");
    std::fs::write(&path, scene).unwrap();
    let (scene, _) = read_scene(&path).unwrap();
    let points = vec![[0.0, 0.0], [0.5, 10.0], [2.0, -3.0]];
    assert_eq!(scene.loads[0].over_time, OverTime::Table(points));
}

#[test]
fn the_documented_scene_is_read() {
    let (scene, _) = parse_scene(
        "documented",
        r#"// A weight on two springs; the first end is fixed.
Scene(
    version: 1,
    name: "two springs",
    gravity: (0, 0, -9.81),
    nodes: [
        (position: (0, 0, 0), fixed: true),
        (position: (0.5, 0, 0)),
        (position: (1, 0, 0), velocity: (0, 0, 1), mass: 0.2),
    ],
    springs: [
        (nodes: (0, 1), stiffness: 100, rest_length: 0.5, mass: 0.1, damping: 0.5),
        (nodes: (1, 2), stiffness: 100, mass: 0.1),
    ],
    simulation: (method: LinearlyImplicitEuler, step: 0.01, duration: 2),
)"#,
    )
    .unwrap();
    assert_eq!(scene.nodes[2].velocity.z, 1.0);
    assert_eq!(scene.springs[1].rest_length, 0.5);
    assert_eq!(scene.settings.step, StepControl::Fixed(0.01));
    assert_eq!(scene.settings.method, Method::LinearlyImplicitEuler);
}

/// A field is what gravity is, and the same wherever it points and however it changes.
#[test]
fn fields_act_on_masses() {
    let scene = |fields: &str| {
        let text = format!(
            "Scene(version: 1, {fields}
                nodes: [
                    (position: (0, 0, 0), fixed: true),
                    (position: (1, 0, 0), mass: 2, velocity: (0, 1, 0)),
                    (position: (2, 0.5, 0), fixed: \"y\"),
                ],
                springs: [
                    (nodes: (0, 1), stiffness: 300, mass: 0.5),
                    (nodes: (1, 2), stiffness: 200, mass: 0.25),
                ],
                simulation: (method: Dop853, tolerance: 1e-11, duration: 1.5))"
        );
        parse_scene("fields.ron", &text).unwrap().0
    };
    let end = |scene: &Scene| {
        let mut simulation = Simulation::new(scene).unwrap();
        simulation.run(1, &mut ()).unwrap();
        simulation.nodes().positions.clone()
    };
    let heavy = end(&scene("gravity: (0.5, 0, -9.81),"));
    let pulled = end(&scene("fields: [(acceleration: (0.5, 0, -9.81))],"));
    for (a, b) in heavy.iter().zip(&pulled) {
        assert!((a - b).norm() < 1e-9, "{a} {b}");
    }
    // Half each, one of them over time.
    let half = "fields: [(acceleration: (0.25, 0, -4.905)),
        (acceleration: (0.25, 0, -4.905), over_time: Table([(0, 1), (9, 1)]))],";
    for (a, b) in heavy.iter().zip(&end(&scene(half))) {
        assert!((a - b).norm() < 1e-9, "{a} {b}");
    }
    let error = |over_time: &str| {
        let wrong = format!(
            "Scene(version: 1, nodes: [(position: (0, 0, 0), mass: 1)],
            fields: [(acceleration: (1, 0, 0), over_time: {over_time})])"
        );
        parse_scene("wrong.ron", &wrong).unwrap_err().to_string()
    };
    let empty = error("Table([])");
    assert!(
        empty.contains("wrong.ron:2:") && empty.contains("no points"),
        "{empty}"
    );
    let error = error("Ramp(from: 2, to: 1)");
    assert!(
        error.contains("wrong.ron:2:") && error.contains("not in order"),
        "{error}"
    );
}
