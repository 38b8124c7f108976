//! The study of a scene: a reference that can be trusted, errors measured
//! against it, files, interruption.

use springs::assembly::compile;
use springs::scene::generate::{Material, chain, disturb};
use springs::scene::{Method, Scene};
use springs::study::{
    Fate, Options, Setting, StudyError, csv, diagram, recommendations, stability, stability_csv,
    stability_diagram, study, table,
};
use std::ops::ControlFlow;
use std::process::Command;
use std::time::Duration;

fn scene() -> Scene {
    let mut scene = chain(
        8,
        Material {
            stiffness: 2e3,
            ..Material::of_chain(8)
        },
    );
    disturb(&mut scene, 1e-3, 1);
    scene.settings.duration = 0.3;
    scene
}

fn options(methods: &[Method]) -> Options {
    Options {
        methods: methods.to_vec(),
        budget: Duration::from_secs(3),
        repeats: 1,
    }
}

#[test]
fn errors_fall_with_the_order_of_the_method() {
    let methods = [Method::VelocityVerlet, Method::BlanesMoan4, Method::TrBdf2];
    let study = study(&scene(), &options(&methods), &mut |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(study.reference.uncertainty < 1e-8, "{:?}", study.reference);
    assert!(!study.interrupted && study.refused.is_empty());
    for (method, order) in [("velocity-verlet", 2.0), ("blanes-moan4", 4.0)] {
        let mut errors = Vec::new();
        for trial in &study.trials {
            if trial.method == method && !trial.at_floor && trial.error < 1e-3 {
                errors.push(trial.error);
            }
        }
        assert!(errors.len() >= 2, "{method}: {errors:?}");
        let last = &errors[errors.len() - 2..];
        let observed = (last[0] / last[1]).log2();
        assert!((observed - order).abs() < 0.3, "{method}: {errors:?}");
    }
    for trial in study
        .trials
        .iter()
        .filter(|trial| trial.method == "tr-bdf2")
    {
        let Setting::Tolerance(tolerance) = trial.setting else {
            panic!("tr-bdf2 is swept over tolerances");
        };
        assert!(trial.error < 10.0 * tolerance, "{trial:?}");
    }
    assert_eq!(csv(&study).lines().count(), 1 + study.trials.len());
    assert_eq!(table(&study).lines().count(), 1 + study.trials.len());
    assert!(recommendations(&study)[0].starts_with("for 1e"));
    let picture = diagram(&study);
    for method in methods {
        assert!(picture.contains(method.kebab_name()), "{method}");
    }
}

#[test]
fn a_stop_keeps_what_there_is() {
    let mut trials_begun = 0;
    let mut watch = |progress: springs::study::Progress<'_>| {
        trials_begun += usize::from(progress.what.starts_with("velocity-verlet"));
        match trials_begun > 3 {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let study = study(&scene(), &options(&[Method::VelocityVerlet]), &mut watch).unwrap();
    assert!(study.interrupted);
    assert!(study.trials.len() <= 3);
}

#[test]
fn a_stop_before_the_reference_is_an_error() {
    let stopped = study(&scene(), &options(&[Method::TrBdf2]), &mut |_| {
        ControlFlow::Break(())
    });
    assert!(matches!(stopped, Err(StudyError::Stopped)));
}

#[test]
fn methods_that_cannot_are_left_out_with_a_reason() {
    let mut damped = scene();
    damped.springs[2].damping = 0.1;
    let methods = [Method::BlanesMoan4, Method::VelocityVerlet];
    let study = study(&damped, &options(&methods), &mut |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(study.refused.len(), 1);
    assert!(study.refused[0].1.contains("dashpots"));
}

#[test]
fn the_command_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rope.ron");
    std::fs::write(&file, springs::io::scene_to_string(&scene())).unwrap();
    let run = |extra: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_springs"))
            .current_dir(folder.path())
            .args([
                "study",
                "rope.ron",
                "--budget",
                "1",
                "--methods",
                "tr-bdf2,dop853",
            ])
            .args(extra)
            .output()
            .unwrap()
    };
    let output = run(&[]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    assert!(output.stdout.is_empty());
    assert!(
        said.contains("reference by") && said.contains("m use "),
        "{said}"
    );
    for name in ["study.csv", "study.json", "study.svg"] {
        assert!(folder.path().join("rope").join(name).exists(), "{name}");
    }
    assert_eq!(run(&[]).status.code(), Some(2), "not over another study");
    assert!(run(&["--force", "--quiet"]).status.success());
}

/// Velocity Verlet is stable up to hω = 2, whatever the stiffness; the bound of
/// the frequencies is nearly sharp for a chain.
#[test]
fn the_stability_map_shows_the_stability_limit() {
    let scene = scene();
    let methods = [Method::VelocityVerlet, Method::TrBdf2];
    let map = stability(&scene, &options(&methods), &mut |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let bound = compile(&scene).unwrap().frequency_bound();
    let (mut stable, mut unstable) = (0, 0);
    for trial in &map.trials {
        let is_stable = !matches!(trial.fate, Fate::Gained | Fate::Failed);
        let angle = trial.step * bound * trial.stiffness_factor.sqrt();
        if trial.method == "velocity-verlet" && angle < 1.9 {
            assert!(is_stable, "hω ≤ {angle}: {trial:?}");
            stable += 1;
        }
        // One that has time to grow.
        let n_steps = scene.settings.duration / trial.step;
        if trial.method == "velocity-verlet" && angle > 2.5 && n_steps > 60.0 {
            assert!(!is_stable, "hω ≤ {angle}: {trial:?}");
            unstable += 1;
        }
    }
    assert!(stable > 5 && unstable > 5, "{stable}, {unstable}");
    let rows = stability_csv(&map).lines().count();
    assert_eq!(rows, map.trials.len() + 1);
    assert!(stability_diagram(&map).starts_with("<svg"));
}
