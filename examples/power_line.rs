//! A scene built in code: an overhead power line, checked against the elastic
//! catenary.
//!
//! ACSR "Drake" conductor (1.628 kg/m, axial stiffness EA ≈ 34.7 MN) over a
//! span of 300 m, strung straight between two towers of equal height and let
//! go. It swings down and settles under damping. With `--scene` the program
//! prints the scene file instead: that is `examples/scenes/power-line.ron`.
//!
//! ```text
//! cargo run --example power_line
//! ```

use springs::scene::{Method, Node, RunOptions, Scene, Settings, StepControl, Tangent, Vector3};
use springs::step::Simulation;

/// Mass per length of the conductor, in kg/m.
const MASS_PER_LENGTH: f64 = 1.628;
/// Axial stiffness EA, in N.
const AXIAL_STIFFNESS: f64 = 34.7e6;
/// Distance of the towers, which is the unstretched length too, in m.
const SPAN: f64 = 300.0;
const GRAVITY: f64 = 9.81;
/// Damping per stiffness, in s; much more than a real conductor has, so that
/// the line settles within a minute.
const RELAXATION_TIME: f64 = 0.5;

/// The line in `segments` springs, straight and unstretched.
pub fn power_line(segments: usize) -> Scene {
    let mut scene = Scene {
        name: "power line, ACSR Drake over 300 m".to_owned(),
        gravity: Vector3::new(0.0, 0.0, -GRAVITY),
        settings: Settings {
            method: Method::LinearlyImplicitEuler,
            tangent: Some(Tangent::Filtered),
            step: StepControl::Fixed(0.01),
            duration: 60.0,
            ..Settings::default()
        },
        ..Scene::default()
    };
    let length = SPAN / segments as f64;
    for i in 0..=segments {
        scene.add_node(Node {
            fixed: i == 0 || i == segments,
            ..Node::at(Vector3::new(i as f64 * length, 0.0, 0.0))
        });
    }
    for i in 0..segments {
        let spring = scene.add_spring(i, i + 1, AXIAL_STIFFNESS / length);
        scene.springs[spring].rest_length = length;
        scene.springs[spring].damping = RELAXATION_TIME * AXIAL_STIFFNESS / length;
    }
    scene.share_mass(MASS_PER_LENGTH * SPAN);
    scene
}

/// The elastic catenary of the line: Irvine, Cable Structures (1981), chapter 1.
pub struct Catenary {
    /// Horizontal tension, in N.
    pub horizontal_tension: f64,
}

impl Catenary {
    const WEIGHT: f64 = MASS_PER_LENGTH * GRAVITY;

    /// Solves for the horizontal tension by bisection: the span falls as the
    /// tension does.
    pub fn of_the_line() -> Self {
        let (mut low, mut high) = (1e2, 1e7);
        while high - low > 1e-9 * low {
            let middle = 0.5 * (low + high);
            let catenary = Self {
                horizontal_tension: middle,
            };
            if 2.0 * catenary.offset(0.5 * SPAN).0 < SPAN {
                low = middle
            } else {
                high = middle
            }
        }
        Self {
            horizontal_tension: low,
        }
    }

    /// Horizontal and vertical distance from the lowest point to the point at
    /// unstretched arc length `s`, all in m.
    fn offset(&self, s: f64) -> (f64, f64) {
        let h = self.horizontal_tension;
        let slope = Self::WEIGHT * s / h;
        let x = h * s / AXIAL_STIFFNESS + h / Self::WEIGHT * slope.asinh();
        let rise = h / Self::WEIGHT * (slope.hypot(1.0) - 1.0);
        (x, rise + Self::WEIGHT * s * s / (2.0 * AXIAL_STIFFNESS))
    }

    /// Position of the point at `fraction` of the unstretched length, in m.
    pub fn position(&self, fraction: f64) -> Vector3<f64> {
        let s = (fraction - 0.5) * SPAN;
        let (x, z) = self.offset(s);
        Vector3::new(0.5 * SPAN + x, 0.0, z - self.sag())
    }

    /// Depth of the lowest point below the towers, in m.
    pub fn sag(&self) -> f64 {
        self.offset(0.5 * SPAN).1
    }
}

/// Largest distance of a node from its place on the catenary, in m.
pub fn deviation(positions: &[Vector3<f64>]) -> f64 {
    let catenary = Catenary::of_the_line();
    let segments = positions.len() - 1;
    let distance = |(i, position): (usize, &Vector3<f64>)| {
        (position - catenary.position(i as f64 / segments as f64)).norm()
    };
    positions
        .iter()
        .enumerate()
        .map(distance)
        .fold(0.0, f64::max)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = power_line(60);
    if std::env::args().any(|argument| argument == "--scene") {
        print!(
            "{}",
            springs::io::scene_to_string(&scene, &RunOptions::default())
        );
        return Ok(());
    }
    let mut simulation = Simulation::new(&scene)?;
    simulation.run(1, &mut ())?;
    let positions = &simulation.nodes().positions;
    let catenary = Catenary::of_the_line();
    println!(
        "elastic catenary: horizontal tension {:.1} kN, sag {:.3} m",
        catenary.horizontal_tension / 1e3,
        catenary.sag()
    );
    println!(
        "after {} s: sag {:.3} m, largest deviation {:.1e} m",
        simulation.stepper().time(),
        -positions[30].z,
        deviation(positions)
    );
    Ok(())
}
