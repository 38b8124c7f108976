//! `springs new`: print a scene file.

use super::{Advised, Ending, print};
use springs::io::{read_points, scene_to_string};
use springs::scene::generate::{self, Material};
use springs::scene::{Method, RunOptions, Scene, StepControl, Vector3};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct NewArguments {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(clap::Subcommand)]
enum Kind {
    /// A chain of N springs that hangs from its first node
    Chain {
        /// Number of springs
        #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_NODES))]
        springs: u32,
        #[command(flatten)]
        options: Options,
    },
    /// A level cloth of N × N nodes that hangs from two corners
    Cloth {
        /// Nodes along an edge
        #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000))]
        nodes: u32,
        #[command(flatten)]
        options: Options,
    },
    /// A block of N × N × N nodes that stands on its lowest layer
    Block {
        /// Nodes along an edge
        #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(2..=464))]
        nodes: u32,
        #[command(flatten)]
        options: Options,
    },
    /// An elastic network: springs between all points that are near, without gravity
    Network {
        /// A table of points: rows of x, y, z in m
        #[arg(value_name = "POINTS.csv")]
        points: PathBuf,
        /// The largest distance that a spring spans, in m
        #[arg(long, value_name = "R")]
        cutoff: f64,
        #[command(flatten)]
        options: Options,
    },
}

/// 100 million; a scene file of that size has about 10 GB.
const MOST_NODES: i64 = 100_000_000;

#[derive(clap::Args)]
struct Options {
    /// Stiffness of every spring in N/m [default: chain 1e4·N, cloth 1e3, block and network 1e4]
    #[arg(long, value_name = "K")]
    stiffness: Option<f64>,
    /// Total mass in kg [default: chain and cloth 1, block and network 10]
    #[arg(long, value_name = "M")]
    mass: Option<f64>,
    /// Damping of every spring in N·s/m [default: 0]
    #[arg(long, value_name = "C")]
    damping: Option<f64>,
    /// Length of the chain, or of an edge, in m [default: 1]
    #[arg(long, value_name = "L")]
    size: Option<f64>,
    /// Gravity in m/s² [default: 0,0,-9.81; of a network none]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector)]
    gravity: Option<Vector3<f64>>,
    /// Move every free node by a random amount up to this, in m
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    disturbance: f64,
    /// Which random disturbance
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Time integration method [default: the cheapest for the tolerance]
    #[arg(long, value_name = "NAME", value_parser = super::source::methods())]
    method: Option<Method>,
    /// Steps of this size in seconds, by default of linearly-implicit-euler
    /// [default of that method: 1/60]
    #[arg(long, value_name = "H", conflicts_with = "tolerance")]
    step: Option<f64>,
    /// Error of positions in metres to choose steps by [default: 1e-3 of the size]
    #[arg(long, value_name = "TOL")]
    tolerance: Option<f64>,
    /// Simulated time in seconds [default: 1]
    #[arg(long, value_name = "T")]
    duration: Option<f64>,
}

impl Options {
    fn material(&self, default: Material) -> Material {
        Material {
            stiffness: self.stiffness.unwrap_or(default.stiffness),
            mass: self.mass.unwrap_or(default.mass),
            damping: self.damping.unwrap_or(default.damping),
            size: self.size.unwrap_or(default.size),
        }
    }

    fn apply(&self, scene: &mut Scene) {
        generate::disturb(scene, self.disturbance, self.seed);
        scene.gravity = self.gravity.unwrap_or(scene.gravity);
        let size = scene.size();
        let settings = &mut scene.settings;
        settings.duration = self.duration.unwrap_or(settings.duration);
        (settings.method, settings.step) = match (self.method, self.step, self.tolerance) {
            (method, Some(step), _) => (
                method.unwrap_or(Method::LinearlyImplicitEuler),
                StepControl::Fixed(step),
            ),
            (Some(Method::LinearlyImplicitEuler), None, None) => {
                (Method::LinearlyImplicitEuler, settings.step)
            }
            (method, None, tolerance) => (
                method.unwrap_or(Method::Auto),
                StepControl::Tolerance(tolerance.unwrap_or_else(|| round(1e-3 * size))),
            ),
        };
    }
}

/// Two significant digits, for a file that people read.
fn round(value: f64) -> f64 {
    let text = format!("{value:.1e}");
    text.parse().expect("a number reads back")
}

fn vector(text: &str) -> Result<Vector3<f64>, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| {
            number
                .trim()
                .parse::<f64>()
                .map_err(|error| error.to_string())
        })
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [x, y, z] => Ok(Vector3::new(x, y, z)),
        _ => Err(format!("three numbers are needed, not {}", numbers.len())),
    }
}

pub(crate) fn new(arguments: &NewArguments) -> anyhow::Result<Ending> {
    let (mut scene, options) = match &arguments.kind {
        Kind::Chain { springs, options } => {
            let n = *springs as usize;
            (
                generate::chain(n, options.material(Material::of_chain(n))),
                options,
            )
        }
        Kind::Cloth { nodes, options } => {
            let material = options.material(Material::of_cloth());
            (generate::cloth(*nodes as usize, material), options)
        }
        Kind::Block { nodes, options } => {
            let material = options.material(Material::of_block());
            (generate::block(*nodes as usize, material), options)
        }
        Kind::Network {
            points,
            cutoff,
            options,
        } => {
            if options.size.is_some() {
                return Err(Advised {
                    message: "a network has the size of its points".to_owned(),
                    advice: Some("leave --size out".to_owned()),
                }
                .into());
            }
            let points = read_points(points)?;
            let material = options.material(Material::of_block());
            (generate::network(&points, *cutoff, material), options)
        }
    };
    options.apply(&mut scene);
    if let Some(problem) = scene.problems().first() {
        return Err(Advised {
            message: format!("this would not be a sound scene: {problem}"),
            advice: problem.advice().map(str::to_owned),
        }
        .into());
    }
    print(&scene_to_string(&scene, &RunOptions::default()))?;
    Ok(Ending::Done)
}
