//! The scene that a command is about, with what the command line changes.

use super::Advised;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use springs::io::{Finding, Inputs, SceneError, parse_scene_with_inputs, read_text};
use springs::scene::{
    LinearTolerance, Method, Path as ScenePath, RunOptions, Scene, StepControl, Tangent,
};
use springs::sinks::output_problem;
use springs::statics::{Equilibrium, StaticsError};
use springs::step::SetupError;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A scene file and settings that replace those in it.
#[derive(clap::Args)]
pub(crate) struct SceneArguments {
    /// The scene file; `-` reads standard input
    #[arg(value_name = "SCENE.ron")]
    scene: PathBuf,
    /// Time integration method
    #[arg(long, value_name = "NAME", value_parser = methods())]
    method: Option<Method>,
    /// How the across-spring stiffness enters the matrix
    #[arg(long, value_name = "NAME", value_parser = tangents())]
    tangent: Option<Tangent>,
    /// Step size in seconds
    #[arg(
        long,
        value_name = "H",
        conflicts_with = "tolerance",
        allow_negative_numbers = true
    )]
    step: Option<f64>,
    /// Error of positions in metres to choose steps by
    #[arg(long, value_name = "TOL", allow_negative_numbers = true)]
    tolerance: Option<f64>,
    /// Simulated time in seconds
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    duration: Option<f64>,
    /// How precisely linear systems are solved by iteration: sufficient, strict
    #[arg(long, alias = "solution", value_name = "HOW")]
    linear_tolerance: Option<LinearTolerance>,
    /// Make steps that fail in shorter ones
    #[arg(long, alias = "rescue")]
    substeps: bool,
    /// Let parts sleep that can move no further than this, in metres
    #[arg(long, value_name = "REACH", allow_negative_numbers = true)]
    sleep: Option<f64>,
    /// Leave nothing out: what a scene does not need is computed all the same
    #[arg(long)]
    no_skip: bool,
    /// Threads that may be used; results do not depend on it, and more than 256 are not used [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
}

/// Reads the name of a method; `--help` lists them.
pub(crate) fn methods() -> impl TypedValueParser<Value = Method> {
    names(Method::ALL.iter().map(|one| (one.kebab_name(), one.name())))
}

fn tangents() -> impl TypedValueParser<Value = Tangent> {
    names(
        Tangent::ALL
            .iter()
            .map(|one| (one.kebab_name(), one.name())),
    )
}

/// Reads a name in kebab-case, or as in scene files.
fn names<T>(
    names: impl Iterator<Item = (&'static str, &'static str)>,
) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: std::error::Error + Send + Sync> + Clone + Send + Sync + 'static,
{
    let names = names.map(|(kebab_name, name)| PossibleValue::new(kebab_name).alias(name));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<T>())
}

impl SceneArguments {
    /// The scene file.
    pub(crate) fn path(&self) -> &Path {
        &self.scene
    }

    /// As [`stem_of`] the scene file.
    pub(crate) fn stem(&self) -> PathBuf {
        stem_of(&self.scene)
    }

    /// The first argument that settles what a study tries out.
    pub(crate) fn chooses_method_or_step(&self) -> Option<&'static str> {
        let given = [
            ("--method", self.method.is_some()),
            ("--tangent", self.tangent.is_some()),
            ("--step", self.step.is_some()),
            ("--tolerance", self.tolerance.is_some()),
        ];
        let first = given.into_iter().find(|(_, is_given)| *is_given);
        first.map(|(flag, _)| flag)
    }

    /// The scene file and [`Self::flags`], as they are typed into a shell.
    pub(crate) fn arguments(&self) -> Vec<String> {
        let mut arguments = vec![quoted(&self.scene.display().to_string())];
        arguments.extend(self.flags());
        arguments
    }

    /// All arguments that were given but the scene file, method, tangent, step and
    /// tolerance. Numbers read back to the same bits.
    pub(crate) fn flags(&self) -> Vec<String> {
        let mut flags = Vec::new();
        let mut add = |flag: &str, value: Option<String>| {
            if let Some(value) = value {
                flags.extend([flag.to_owned(), value]);
            }
        };
        add("--duration", self.duration.map(|t| format!("{t:?}")));
        add(
            "--linear-tolerance",
            self.linear_tolerance.map(|how| how.to_string()),
        );
        add("--sleep", self.sleep.map(|reach| format!("{reach:?}")));
        add("--threads", self.threads.map(|n| n.to_string()));
        for (flag, is_given) in [("--substeps", self.substeps), ("--no-skip", self.no_skip)] {
            if is_given {
                flags.push(flag.to_owned());
            }
        }
        flags
    }

    /// Fields of `simulation` that are not those of the file. A method brings its
    /// own tangent.
    fn replaced(&self) -> Vec<&'static str> {
        let fields = [
            ("method", self.method.is_some()),
            ("tangent", self.method.is_some() || self.tangent.is_some()),
            ("step", self.step.is_some()),
            ("tolerance", self.tolerance.is_some()),
            ("duration", self.duration.is_some()),
            ("linear_tolerance", self.linear_tolerance.is_some()),
            ("sleep", self.sleep.is_some()),
            ("substeps", self.substeps),
        ];
        let replaced = fields.into_iter().filter(|(_, is_replaced)| *is_replaced);
        replaced.map(|(field, _)| field).collect()
    }

    /// Reads the scene. All that is wrong with it becomes one error.
    pub(crate) fn load(&self) -> Result<Source, Advised> {
        let mut source = Source::read(&self.scene)?;
        let (scene, options) = (&mut source.scene, &mut source.options);
        let settings = &mut scene.settings;
        if let Some(method) = self.method {
            // The tangent in the file was meant for the method there.
            settings.method = method;
            settings.tangent = None;
        }
        settings.tangent = self.tangent.or(settings.tangent);
        settings.duration = self.duration.unwrap_or(settings.duration);
        if let Some(step) = self.step {
            settings.step = StepControl::Fixed(step);
        }
        if let Some(tolerance) = self.tolerance {
            settings.step = StepControl::Tolerance(tolerance);
        }
        options.sleep = self.sleep.or(options.sleep);
        options.substeps |= self.substeps;
        options.skip = !self.no_skip;
        options.linear_tolerance = self.linear_tolerance.unwrap_or(options.linear_tolerance);
        options.threads = self.threads.map_or(options.threads, at_most_useful);
        // The file was sound, so only what the command line said can be wrong.
        let problems = scene.problems().into_iter().chain(options.problems());
        match problems.into_iter().next() {
            None => {
                source.replaced = self.replaced();
                match output_problem(&source.scene) {
                    None => Ok(source),
                    Some(problem) => {
                        let path = ScenePath::Output("write");
                        Err(source.located(&problem, Some(path), None))
                    }
                }
            }
            Some(problem) => Err(Advised {
                message: format!("on the command line, {problem}"),
                advice: problem.advice().map(str::to_owned),
            }),
        }
    }
}

/// A file's name without its ending; `scene` where that would be no folder of its own.
pub(crate) fn stem_of(scene: &Path) -> PathBuf {
    let stem = scene.file_stem().unwrap_or_default();
    if [".", "..", "-", ""].iter().any(|name| stem == *name) {
        "scene".into()
    } else {
        stem.into()
    }
}

/// No machine does more at once; more threads than this only take memory.
const MOST_THREADS: u32 = 256;

/// Threads that are used when so many may be.
pub(crate) fn at_most_useful(threads: u32) -> usize {
    threads.min(MOST_THREADS) as usize
}

/// The options of statics.
pub(crate) fn statics_options(run: &RunOptions) -> springs::statics::Options {
    springs::statics::Options::default().with_threads(springs::step::threads(run))
}

/// A scene and the text it came from.
pub(crate) struct Source {
    pub(crate) scene: Scene,
    pub(crate) options: RunOptions,
    /// How the file gives its springs.
    pub(crate) inputs: Inputs,
    file: String,
    text: String,
    /// Fields of `simulation` that come from the command line.
    replaced: Vec<&'static str>,
}

/// A word as a shell reads it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./,+=".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

impl Source {
    /// Reads a scene file; `-` is standard input. All that is wrong with it becomes one
    /// error.
    pub(crate) fn read(scene: &Path) -> Result<Self, Advised> {
        let (file, text) = if scene == Path::new("-") {
            let file = "standard input".to_owned();
            let text = read_text(&file, Ok(std::io::stdin().lock()));
            (file, text)
        } else {
            let file = scene.display().to_string();
            let text = read_text(&file, File::open(scene));
            (file, text)
        };
        let text = text.map_err(advised)?;
        let (scene, options, inputs) = parse_scene_with_inputs(&file, &text).map_err(advised)?;
        Ok(Self {
            scene,
            options,
            inputs,
            file,
            text,
            replaced: Vec::new(),
        })
    }

    /// Finds the equilibrium that the scene starts from, if it asks for one.
    pub(crate) fn start(&mut self) -> Result<Option<Equilibrium>, StaticsError> {
        if self.scene.settings.start == springs::scene::Start::AsGiven {
            return Ok(None);
        }
        let options = statics_options(&self.options);
        let (started, equilibrium) = springs::statics::start(&self.scene, &options)?;
        self.scene = started;
        Ok(equilibrium)
    }

    /// Writes the text of the scene to another file.
    pub(crate) fn copy_to(&self, path: &Path) -> std::io::Result<()> {
        std::fs::write(path, &self.text)
    }

    /// Why the scene cannot be simulated, with the place in its file.
    pub(crate) fn advised(&self, error: &SetupError) -> Advised {
        self.located(&error.to_string(), error.path(), error.advice())
    }

    /// The same of statics.
    pub(crate) fn advised_of_statics(&self, error: &StaticsError) -> Advised {
        self.located(&error.to_string(), error.path(), error.advice())
    }

    fn located(&self, error: &str, path: Option<ScenePath>, advice: Option<&str>) -> Advised {
        let Some(path) = path else {
            return Advised {
                message: format!("{}: {error}", self.file),
                advice: advice.map(str::to_owned),
            };
        };
        if let ScenePath::Simulation(field) = path
            && self.replaced.contains(&field)
        {
            return Advised {
                message: format!("on the command line, {error}"),
                advice: advice.map(str::to_owned),
            };
        }
        let finding = Finding::at(&self.text, path, error.to_string(), advice);
        Advised {
            message: shown(&self.file, &finding),
            advice: finding.advice,
        }
    }
}

/// The finding and the line that it is about.
fn shown(file: &str, finding: &Finding) -> String {
    let excerpt = &finding.excerpt;
    if excerpt.is_empty() {
        format!("{file}:{finding}")
    } else {
        format!("{file}:{finding}\n{excerpt}")
    }
}

/// At most this many of the things wrong with a scene are told.
const MOST_FINDINGS: usize = 20;

fn advised(error: SceneError) -> Advised {
    let SceneError::Wrong { file, findings } = &error else {
        return Advised {
            message: error.to_string(),
            advice: None,
        };
    };
    let first = findings.iter().take(MOST_FINDINGS);
    let first: Vec<String> = first.map(|finding| shown(file, finding)).collect();
    let mut message = first.join("\nerror: ");
    if findings.len() > MOST_FINDINGS {
        message += "\nerror: … and more of the like";
    }
    Advised {
        message,
        advice: findings[0].advice.clone(),
    }
}
