//! What the examples print is what is known of their scenes.

use std::path::Path;
use std::process::Command;

/// Standard output of an example, which holds finite numbers only.
fn output(example: &str) -> String {
    let mut command = Command::new(env!("CARGO"));
    command.args(["run", "--quiet", "--example", example]);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().expect("cargo runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{example}: {error}");
    let text = String::from_utf8(output.stdout).expect("text");
    for word in text.split_whitespace() {
        let word = word.trim_matches(|c: char| !c.is_alphanumeric());
        let is_number = !["nan", "inf"].contains(&word.to_lowercase().as_str());
        assert!(is_number, "{example} prints {word}:\n{text}");
    }
    text
}

/// The numbers of a text, in order.
fn numbers(text: &str) -> Vec<f64> {
    let words = text.split(|c: char| c.is_whitespace() || "(),".contains(c));
    words.filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn stiffness_matrix_has_the_frequencies_of_a_string() {
    let text = output("stiffness_matrix");
    let (_, table) = text.split_once("ideal string\n").expect("a table");
    let rows: Vec<Vec<f64>> = table.lines().map(numbers).collect();
    assert_eq!(rows.len(), 5, "{text}");
    // 50 springs on 1 m, stretched by 1 %, and 1 kg in all:
    // √(T/μ)/2L with the tension T of one spring.
    let spring = springs::scene::generate::Material::of_chain(50).stiffness;
    let fundamental = 0.5 * (spring * 0.01 / 50.0 / 1.01).sqrt();
    for (mode, row) in (1..).zip(&rows) {
        let &[number, of_springs, ideal] = &row[..] else {
            panic!("{row:?}");
        };
        assert_eq!(number, f64::from(mode));
        assert!(
            (ideal - number * fundamental).abs() < 1e-4 * ideal,
            "{text}"
        );
        // Discrete strings are lower, by (π k/N)²/24.
        let lower = (number * std::f64::consts::PI / 50.0).powi(2) / 24.0;
        assert!((of_springs / ideal - 1.0 + lower).abs() < 1e-4, "{text}");
    }
}

#[test]
fn own_solver_finds_the_equilibrium() {
    let text = output("own_solver");
    let last = numbers(text.lines().last().expect("a line"));
    let &[x, y, z] = &last[..] else {
        panic!("{text}");
    };
    // Three springs of 200 N/m and 1 m carry 2 kg.
    let hooks = [[1.0, 0.0, 0.0], [-0.5, 0.8, 0.0], [-0.5, -0.8, 0.2]];
    let mut force = [0.0, 0.0, -2.0 * 9.81];
    for hook in hooks {
        let d = [hook[0] - x, hook[1] - y, hook[2] - z];
        let length = d.iter().map(|d| d * d).sum::<f64>().sqrt();
        for (force, d) in force.iter_mut().zip(d) {
            *force += 200.0 * (1.0 - 1.0 / length) * d;
        }
    }
    // Six decimals are printed.
    let left = force.into_iter().map(f64::abs).fold(0.0, f64::max);
    assert!(left < 1e-3, "{left:e} N:\n{text}");
}

#[test]
fn custom_loop_gets_there() {
    let text = output("custom_loop");
    let found = numbers(&text);
    // Half a metre per second at every second pass; level takes √(2 g l), in
    // more than so many pushes.
    assert!(
        found[0] >= (2.0f64 * 9.81 * 2.0).sqrt() / 0.5 - 1.0,
        "{text}"
    );
    assert!(found[1] < 120.0, "{text}");
}

#[test]
fn power_line_hangs_as_the_catenary() {
    let text = output("power_line");
    let found = numbers(&text);
    let &[tension, sag, _, of_springs, deviation] = &found[..] else {
        panic!("{text}");
    };
    assert!(tension > 0.0);
    assert!((sag - of_springs).abs() < 0.01 * sag, "{text}");
    assert!(deviation < 0.01 * sag, "{text}");
}

#[test]
fn own_emitter_hangs_as_deep_as_a_beam() {
    let text = output("own_emitter");
    let depth_after = |word: &str| -> f64 {
        let (_, rest) = text.split_once(word).expect("a line of it");
        numbers(rest)[0]
    };
    let exact = depth_after("(3 EI) =");
    // The difference of second order: a quarter with each halving.
    let off = ["4 pieces:", "8 pieces:", "16 pieces:"].map(|word| depth_after(word) / exact - 1.0);
    assert!(off[1] < 0.3 * off[0], "{text}");
    assert!(off[2] < 0.3 * off[1], "{text}");
    assert!((0.0..0.005).contains(&off[2]), "{text}");
}

#[test]
fn a_soliton_of_a_law_of_ones_own_is_as_in_closed_form() {
    let text = output("toda_soliton");
    let after = |words: &str| -> Vec<f64> {
        let (_, rest) = text.split_once(words).expect("a line of it");
        let line = rest.lines().next().unwrap_or_default();
        let words = line.split_whitespace();
        words.filter_map(|word| word.parse().ok()).collect()
    };
    // β/κ and mβ²/b with β = √(ab/m) sinh κ; frames are 0.1 s apart.
    let (a, b, mass, kappa): (f64, f64, f64, f64) = (2.0, 1.5, 1.2, 0.6);
    let beta = (a * b / mass).sqrt() * kappa.sinh();
    for (words, allowed) in [("closed form:", 1e-4), ("found:", 5e-3)] {
        let [speed, height] = after(words)[..] else {
            panic!("{text}");
        };
        assert!((speed * kappa / beta - 1.0).abs() < allowed, "{text}");
        assert!(
            (height * b / (mass * beta * beta) - 1.0).abs() < allowed,
            "{text}"
        );
    }
    for (method, order) in [("velocity-verlet", 2), ("tr-bdf2", 2)] {
        let [coarse, fine] = ["0.1", "0.05"].map(|step| {
            let off = after(&format!("{method}, step {step} s: off by"));
            off[0]
        });
        assert!(
            fine < 1e-2 && (coarse / fine).log2() > f64::from(order) - 0.1,
            "{text}"
        );
    }
    assert!(
        after("blanes-moan4, step 0.05 s: off by")[0] < 1e-6,
        "{text}"
    );
    let picture = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/toda-soliton/probes.svg");
    let drawn = std::fs::read_to_string(picture).unwrap();
    for part in [
        "soliton of the Toda chain",
        "spring 20",
        "spring 50",
        "tension (N)",
    ] {
        assert!(drawn.contains(part), "{part}");
    }
}
