//! A law of one's own: the exponential springs of Toda's chain, along which a soliton
//! goes as its closed form says, and a picture of it.
//!
//! ```text
//! cargo run --example toda_soliton
//! ```
//!
//! V = (a/b) e^{−br} + a r with r = l − l₀ has the soliton
//!
//!   e^{−br} − 1 = (mβ²/ab) sech²(κn − βt),  β = √(ab/m) sinh κ
//!
//! (Toda, J. Phys. Soc. Japan 22, 1967, p. 431). It is b q = ln(τₙ/τₙ₊₁) with
//! τₙ = 1 + e^{2(κn − βt)} for the displacements q, where rₙ = qₙ − qₙ₋₁. The program starts from it, lets a method
//! that knows nothing of it make the steps, and prints how far both are apart. What four
//! springs push with while it passes is drawn into `target/toda-soliton/probes.svg`.

use springs::assembly::{SpringBetween, Springs};
use springs::math::spring::LengthLaw;
use springs::plots::plot;
use springs::scene::{Method, Node, RunOptions, Scene, StepControl, Vector3};
use springs::step::{Frame, NodeStates, Observer, Simulation};
use std::error::Error;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// V = (a/b) e^{−br} + a r with r = l − l₀.
#[derive(Clone, Copy)]
struct Toda {
    /// In N.
    a: f64,
    /// In 1/m.
    b: f64,
    /// l₀, in m.
    rest_length: f64,
}

impl LengthLaw for Toda {
    fn energy(&self, length: f64) -> f64 {
        let r = length - self.rest_length;
        self.a / self.b * (-self.b * r).exp() + self.a * r
    }

    fn tension(&self, length: f64) -> f64 {
        -self.a * (-self.b * (length - self.rest_length)).exp_m1()
    }

    fn stiffness(&self, length: f64) -> f64 {
        self.a * self.b * (-self.b * (length - self.rest_length)).exp()
    }

    fn largest_stiffness(&self) -> f64 {
        f64::INFINITY
    }

    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    fn is_convex(&self) -> bool {
        true
    }
}

const LAW: Toda = Toda {
    a: 2.0,
    b: 1.5,
    rest_length: 1.0,
};
/// In kg.
const MASS: f64 = 1.2;
const KAPPA: f64 = 0.6;
/// Free masses, between two fixed ones far from the soliton.
const N: usize = 90;
/// Where it is at the start.
const START: f64 = 15.5;
/// In s.
const DURATION: f64 = 30.0;
/// Springs that are drawn: spring n is between the masses n − 1 and n.
const SHOWN: [usize; 4] = [20, 30, 40, 50];

/// β, in rad/s.
fn beta() -> f64 {
    (LAW.a * LAW.b / MASS).sqrt() * KAPPA.sinh()
}

/// Displacement in m and velocity in m/s of mass n at a time in s, in closed form.
fn closed_form(n: usize, time: f64) -> (f64, f64) {
    let phase = |n: usize| 2.0 * (KAPPA * (n as f64 - START) - beta() * time);
    let (now, next) = (phase(n), phase(n + 1));
    let share = |phase: f64| 1.0 / (1.0 + (-phase).exp());
    let displacement = (now.exp().ln_1p() - next.exp().ln_1p()) / LAW.b;
    let velocity = 2.0 * beta() / LAW.b * (share(next) - share(now));
    (displacement, velocity)
}

/// The chain as the closed form has it at time 0, without springs.
fn chain() -> Scene {
    let mut scene = Scene::default();
    for n in 0..N + 2 {
        let is_fixed = n == 0 || n == N + 1;
        let (displacement, velocity) = closed_form(n, 0.0);
        scene.add_node(Node {
            mass: MASS,
            fixed: is_fixed,
            velocity: Vector3::x() * if is_fixed { 0.0 } else { velocity },
            ..Node::at(Vector3::x() * (LAW.rest_length * n as f64 + displacement))
        });
    }
    scene.settings.duration = DURATION;
    scene
}

/// Largest distance of a mass from where the closed form has it at a time in s, in m.
fn deviation(nodes: &NodeStates, time: f64) -> f64 {
    let masses = nodes.positions.iter().enumerate();
    let off = masses.map(|(n, at)| {
        let expected = LAW.rest_length * n as f64 + closed_form(n, time).0;
        (at.x - expected).abs()
    });
    off.fold(0.0, f64::max)
}

/// Keeps a table of what the shown springs push with, as probes of a run do, and when each
/// pushes most.
#[derive(Default)]
struct Pushes {
    table: String,
    peaks: [(f64, f64); SHOWN.len()],
}

impl Observer for Pushes {
    fn frame(&mut self, frame: Frame<'_>) -> ControlFlow<()> {
        let (time, x) = (frame.time, &frame.nodes.positions);
        for (spring, peak) in SHOWN.iter().zip(&mut self.peaks) {
            let tension = LAW.tension(x[*spring].x - x[spring - 1].x);
            writeln!(self.table, "{time:?},spring,{spring},tension,{tension:?}")
                .expect("writing to a string");
            if -tension > peak.0 {
                *peak = (-tension, time);
            }
        }
        ControlFlow::Continue(())
    }
}

/// The nodes at the end of a run with a method and a step in s.
fn run(
    method: Method,
    step: f64,
    frames: usize,
    observer: &mut dyn Observer,
) -> Result<NodeStates, Box<dyn Error>> {
    let mut scene = chain();
    scene.settings.method = method;
    scene.settings.step = StepControl::Fixed(step);
    let springs: Vec<_> = (0..=N)
        .map(|n| SpringBetween {
            nodes: [n, n + 1],
            law: LAW,
        })
        .collect();
    let emitter = Box::new(Springs::new("Toda springs", &springs));
    let mut simulation = Simulation::with_emitters(&scene, &RunOptions::default(), vec![emitter])?;
    simulation.run(frames, observer)?;
    Ok(simulation.nodes().clone())
}

fn main() -> Result<(), Box<dyn Error>> {
    let height = MASS * beta().powi(2) / LAW.b;
    println!("closed form: {:.4} masses/s, {height:.4} N", beta() / KAPPA);
    let mut pushes = Pushes {
        table: "time,item,index,quantity,value\n".to_owned(),
        ..Pushes::default()
    };
    run(Method::BlanesMoan4, 0.05, 300, &mut pushes)?;
    let [first, .., last] = pushes.peaks;
    let passed = (SHOWN[SHOWN.len() - 1] - SHOWN[0]) as f64;
    println!(
        "found:       {:.4} masses/s, {:.4} N",
        passed / (last.1 - first.1),
        last.0
    );
    for method in [Method::VelocityVerlet, Method::BlanesMoan4, Method::TrBdf2] {
        for step in [0.1, 0.05] {
            let nodes = run(method, step, 1, &mut ())?;
            let off = deviation(&nodes, DURATION);
            println!("{method}, step {step} s: off by {off:.2e} m");
        }
    }
    let folder = Path::new("target/toda-soliton");
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("probes.csv"), pushes.table)?;
    // The title of the picture.
    let about = r#"{ "scene": "soliton of the Toda chain" }"#;
    std::fs::write(folder.join("report.json"), about)?;
    for picture in plot(folder)? {
        println!("wrote {}", folder.join(picture).display());
    }
    Ok(())
}
