use super::*;
use springs_io::{parse_scene_with_inputs, scene_to_string};
use springs_scene::StepControl;
use springs_solver::Interrupt;

const TEXT: &str = r#"Scene(
    version: 1,
    gravity: (0, 0, -10),
    materials: {"wire": (EA: 1000, damping_ratio: 0.1), "rod": (EA: 5000, damping: 3)},
    nodes: [
        (position: (0, 0, 0), fixed: true),
        (position: (2, 0, 0), mass: 0.5),
        (position: (4, 0, 0), mass: 0.5),
    ],
    springs: [(nodes: (0, 1), material: "wire"), (nodes: (1, 2), material: "rod")],
    loads: [(nodes: [2], force: (0, 0, -3))],
    simulation: (step: 0.01, duration: 0.1),
)"#;

fn subject() -> Subject {
    let (scene, options, inputs) = parse_scene_with_inputs("scene.ron", TEXT).unwrap();
    Subject {
        scene,
        options,
        inputs,
    }
}

fn set(name: &str, value: f64) -> Result<Subject, SettingError> {
    subject().with(&[name.parse()?], &[value])
}

/// What is set is what a file with these numbers in it says.
#[test]
fn settings_are_as_if_they_stood_in_the_file() {
    for (name, value, from, to) in [
        ("materials.wire.EA", 3000.0, "EA: 1000", "EA: 3000"),
        ("materials.wire.EA*", 3.0, "EA: 1000", "EA: 3000"),
        (
            "materials.wire.damping_ratio",
            0.2,
            "ratio: 0.1",
            "ratio: 0.2",
        ),
        (
            "materials.wire.damping_ratio*",
            2.0,
            "ratio: 0.1",
            "ratio: 0.2",
        ),
        ("materials.rod.damping", 4.0, "damping: 3", "damping: 4"),
        ("springs[0].stiffness", 250.0, "EA: 1000", "EA: 500"),
        ("springs[1:2].EA", 2.0, "EA: 5000", "EA: 2"),
        ("gravity", 5.0, "-10", "-5"),
        ("gravity*", 0.5, "-10", "-5"),
        ("drag", 0.5, "version: 1", "version: 1, drag: 0.5"),
        (
            "damping.mass",
            0.5,
            "version: 1",
            "version: 1, damping: (mass: 0.5)",
        ),
        ("nodes.mass", 0.25, "mass: 0.5", "mass: 0.25"),
        ("loads", 3.0, "-3", "-9"),
        ("loads[0]", 3.0, "-3", "-9"),
        ("step", 0.02, "step: 0.01", "step: 0.02"),
        ("step*", 2.0, "step: 0.01", "step: 0.02"),
        ("tolerance", 1e-4, "step: 0.01", "tolerance: 1e-4"),
        ("duration", 0.5, "duration: 0.1", "duration: 0.5"),
        (
            "springs[0].rest_length",
            1.0,
            r#"material: "wire""#,
            r#"material: "wire", rest_length: 1, EA: 500"#,
        ),
        (
            "springs[0].pretension",
            25.0,
            r#"material: "wire""#,
            r#"material: "wire", stiffness: 500, pretension: 25"#,
        ),
    ] {
        let file = if name == "nodes.mass" {
            // The fixed node has the mass, too, and it does not matter.
            let fixed = "fixed: true";
            TEXT.replace(from, to)
                .replace(fixed, "fixed: true, mass: 0.25")
        } else {
            TEXT.replacen(from, to, 1)
        };
        let (expected, ..) = parse_scene_with_inputs("scene.ron", &file).unwrap();
        let found = set(name, value).unwrap();
        let options = found.options;
        assert_eq!(
            scene_to_string(&found.scene, &options),
            scene_to_string(&expected, &options),
            "{name}"
        );
    }
    let StepControl::Fixed(step) = set("step", 0.25).unwrap().scene.settings.step else {
        panic!("a step was set");
    };
    assert_eq!(step, 0.25);
}

#[test]
fn what_cannot_be_set_is_told() {
    let message = |name, value| set(name, value).unwrap_err().to_string();
    insta::assert_snapshot!([
        message("colour", 1.0),
        message("mass", 1.0),
        message("materials.rope.EA", 1.0),
        message("springs[7].EA", 1.0),
        message("springs[1].damping_ratio*", 2.0),
        message("tolerance*", 2.0),
        message("EA", -1.0),
        message("damping_ratio", -1.0),
        message("duration", -1.0),
    ].join("\n"), @r"
    `colour` cannot be set; of springs stiffness, EA, rest_length, prestrain, pretension, mass, mass_per_length, damping, damping_ratio, as `EA`, `springs.mass`, `springs[3].EA`, `springs[3:10].EA` or `materials.NAME.EA`; of nodes mass, drag, as `nodes.mass` or `nodes[3].mass`; a factor of `loads` or `loads[0]`; gravity, drag, damping.mass, damping.stiffness, step, tolerance, duration; with `*` at the end, a factor of what is there
    `mass` cannot be set; of springs stiffness, EA, rest_length, prestrain, pretension, mass, mass_per_length, damping, damping_ratio, as `EA`, `springs.mass`, `springs[3].EA`, `springs[3:10].EA` or `materials.NAME.EA`; of nodes mass, drag, as `nodes.mass` or `nodes[3].mass`; a factor of `loads` or `loads[0]`; gravity, drag, damping.mass, damping.stiffness, step, tolerance, duration; with `*` at the end, a factor of what is there
    `materials.rope.EA` is nothing in this scene, which has the materials wire, rod
    `springs[7].EA` is nothing in this scene, which has 2 springs, counted from 0
    `springs[1].damping_ratio*` has no value in this scene that could be multiplied
    `tolerance*` has no value in this scene that could be multiplied
    the stiffness of spring 0 must not be negative, but is -0.5
    the damping of spring 0 must not be negative, but is -31.622776601683793
    the simulation's duration must not be negative, but is -1
    ");
}

#[test]
fn plans_that_are_not_possible_are_told() {
    let message = |axes: &[&str], measures: &[&str]| {
        let owned = |words: &[&str]| {
            words
                .iter()
                .map(|&word| word.to_owned())
                .collect::<Vec<_>>()
        };
        Plan::new(subject(), &owned(axes), &owned(measures))
            .unwrap_err()
            .to_string()
    };
    let max = ["max(tension)"];
    insta::assert_snapshot!([
        message(&[], &max),
        message(&["EA"], &max),
        message(&["EA=1,2"], &[]),
        message(&["EA=1,two"], &max),
        message(&["EA=log:0:1:3"], &max),
        message(&["EA=lin:0:1"], &max),
        message(&["EA=1,0,-2"], &max),
        message(&["EA=1,2", "EA=3"], &max),
        message(&["EA=1,2"], &["mean(tension)"]),
        message(&["EA=1,2"], &["max(z[9])"]),
        message(&["EA=1,2"], &["max(tension[1:3])"]),
        message(&["EA=1,2"], &["max(materials.rope.tension)"]),
        message(&["EA=lin:1:2:100000", "drag=lin:1:2:100000"], &max),
    ].join("\n"), @r"
    a sweep needs something to set, as --set EA=log:1e3:1e6:20
    `EA` must be NAME=VALUES, such as EA=log:1e3:1e6:20 or step=0.01,0.02
    a sweep needs something to measure, as --measure 'max(tension)'
    `EA`: `two` is not a finite number
    `EA`: a range in logarithms is between positive numbers
    `EA`: `lin:0:1` is not a range: log:FROM:TO:N and lin:FROM:TO:N have N values, ends included
    `EA` = -2.0: the stiffness of spring 0 must not be negative, but is -1
    `EA` is there twice
    `mean(tension)` is no measure; there are max(Q), min(Q) and final(Q), where Q is tension, strain (as tension[3], tension[3:10] or materials.NAME.tension, of some springs), x, y, z, vx, vy, vz, speed, displacement of a node (as z[3]), speed (of the fastest node), or an energy (kinetic, elastic, gravity, total, anchor_work, dashpot_heat, method, load_work, broken_energy); and steps, rejected_steps, estimated_error, seconds, broken_springs
    `max(z[9])` is nothing in this scene, which has 3 nodes, counted from 0
    `max(tension[1:3])` is nothing in this scene, which has 2 springs, counted from 0
    `max(materials.rope.tension)` is nothing in this scene, which has the materials wire, rod
    1e10 runs are more than 10000000
    ");
}

#[test]
fn values_of_ranges_end_where_they_should() {
    assert_eq!(values("lin:1:2:5").unwrap(), [1.0, 1.25, 1.5, 1.75, 2.0]);
    let log = values("log:1e-3:1e3:7").unwrap();
    for (k, value) in log.iter().enumerate() {
        let expected = 10_f64.powi(k as i32 - 3);
        assert!((value / expected - 1.0).abs() < 1e-14, "{value}");
    }
    assert_eq!((log[0], log[6]), (1e-3, 1e3));
    assert_eq!(values(" 3, 1e2,-0.5").unwrap(), [3.0, 100.0, -0.5]);
}

/// A weight of 2 kg that falls freely from rest for 1 s.
#[test]
fn measures_are_those_of_the_motion() {
    let text = r#"Scene(version: 1, gravity: (0, 0, -10),
        nodes: [(position: (0, 0, 1), mass: 2), (position: (5, 0, 0), fixed: true), (position: (8, 0, 0), fixed: true)],
        materials: {"wire": (EA: 200)},
        springs: [(nodes: (1, 2), material: "wire", rest_length: 2)],
        simulation: (step: 0.01, method: VelocityVerlet, duration: 1))"#;
    let (scene, options, inputs) = parse_scene_with_inputs("scene.ron", text).unwrap();
    let subject = Subject {
        scene,
        options,
        inputs,
    };
    let expected = [
        ("max(z[0])", 1.0),
        ("min(z[0])", -4.0),
        ("final(z[0])", -4.0),
        ("max(speed)", 10.0),
        ("final(speed[0])", 10.0),
        ("min(vz[0])", -10.0),
        ("max(displacement[0])", 5.0),
        ("max(kinetic)", 100.0),
        ("final(gravity)", -80.0),
        ("final(elastic)", 50.0),
        ("max(tension)", 100.0),
        ("final(tension[0])", 100.0),
        ("min(strain)", 0.5),
        ("max(tension[0:1])", 100.0),
        ("final(materials.wire.strain)", 0.5),
        ("steps", 100.0),
        ("rejected_steps", 0.0),
        ("broken_springs", 0.0),
    ];
    let measures: Vec<Measure> = expected
        .iter()
        .map(|(name, _)| name.parse().unwrap())
        .collect();
    let measured = measure(&subject, &measures, &Interrupt::default()).unwrap();
    for ((name, expected), measured) in expected.into_iter().zip(measured) {
        assert!((measured - expected).abs() < 1e-11, "{name}: {measured}");
    }
}

/// The largest error of a run to a tolerance is near it, and there is none to be estimated
/// with steps of one size.
#[test]
fn errors_are_estimated_where_steps_are_chosen_by_them() {
    let measures = ["estimated_error".parse().unwrap()];
    let estimated = |control: &str| {
        let text = format!(
            "Scene(version: 1, nodes: [(position: (0, 0, 0), fixed: true), (position: (2, 0, 0), mass: 1)],
            springs: [(nodes: (0, 1), stiffness: 100, rest_length: 1)],
            simulation: (method: Dop853, duration: 2, {control}))"
        );
        let (scene, _, _) = parse_scene_with_inputs("scene.ron", &text).unwrap();
        measure(&Subject::of(scene), &measures, &Interrupt::default()).unwrap()[0]
    };
    let error = estimated("tolerance: 1e-6");
    assert!((1e-8..=1e-6).contains(&error), "{error}");
    assert!(estimated("step: 0.01").is_nan());
}
