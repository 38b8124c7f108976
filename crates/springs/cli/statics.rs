//! What the commands of statics share: arguments, the equilibrium, and their folder.

use super::output::{Output, REPORT, SCENE, open_folder, remove_all_but};
use super::source::{Source, at_most_useful, statics_options, stem_of};
use super::{Advised, Ending, Unwritten, say, say_advised};
use serde::Serialize;
use springs::io::{
    FrameMembers, NotFound, REACTIONS, RunEnd, RunPlan, SPRINGS, SettleReport, SinkKind as _,
    TrajectoryFrame, WriteError, write_report, write_scene,
};
use springs::scene::{Scene, Start, Vector3};
use springs::statics::{Equilibrium, Options, StaticsError, Status};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(clap::Args)]
pub(crate) struct StaticsArguments {
    /// The scene file; `-` reads standard input
    #[arg(value_name = "SCENE.ron")]
    scene: PathBuf,
    /// Folder to write into [default: the scene's name without its ending; `scene` for standard input]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads that may be used; results do not depend on it, and more than 256 are not used [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    threads: Option<u32>,
    /// No summary
    #[arg(long)]
    quiet: bool,
    /// Replace the results of another run
    #[arg(long)]
    force: bool,
}

/// A command of statics on its way.
pub(crate) struct Work {
    begin: Instant,
    pub(crate) source: Source,
    pub(crate) options: Options,
    folder: PathBuf,
    force: bool,
    quiet: bool,
}

/// A folder that nobody else writes into.
pub(crate) struct Folder {
    pub(crate) path: PathBuf,
    _lock: Option<File>,
}

impl StaticsArguments {
    /// Reads the scene, if there is a folder for the results.
    pub(crate) fn begin(&self) -> Result<Work, Advised> {
        let begin = Instant::now();
        let folder = self.out.clone().unwrap_or_else(|| stem_of(&self.scene));
        Output::check(&folder, &self.scene, self.force)?;
        let mut source = Source::read(&self.scene)?;
        source.options.threads = self.threads.map_or(0, at_most_useful);
        Ok(Work {
            begin,
            options: statics_options(&source.options),
            source,
            folder,
            force: self.force,
            quiet: self.quiet,
        })
    }
}

impl Work {
    pub(crate) fn scene(&self) -> &Scene {
        &self.source.scene
    }

    /// A report that nothing is found in yet.
    pub(crate) fn report(&self) -> SettleReport {
        let scene = self.scene();
        SettleReport {
            springs_version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.name.clone(),
            status: "failed".to_owned(),
            nodes: scene.nodes.len(),
            springs: scene.springs.len(),
            seconds: self.begin.elapsed().as_secs_f64(),
            ..SettleReport::default()
        }
    }

    /// The report of an equilibrium.
    pub(crate) fn report_of(&self, equilibrium: &Equilibrium) -> SettleReport {
        let loose_nodes = match &equilibrium.status {
            Status::Stable => Vec::new(),
            Status::Unstable { nodes } | Status::Mechanism { nodes } => nodes.clone(),
        };
        SettleReport {
            status: equilibrium.status.name().to_owned(),
            residual: Some(equilibrium.residual),
            largest_force: Some(equilibrium.largest_force),
            negative_pivots: Some(equilibrium.negative_pivots),
            zero_pivots: Some(equilibrium.zero_pivots),
            loose_nodes,
            iterations: Some(equilibrium.iterations),
            ..self.report()
        }
    }

    /// Makes the folder of the results and locks it.
    pub(crate) fn folder(&self) -> anyhow::Result<Folder> {
        Ok(Folder {
            _lock: open_folder(&self.folder, self.force)?,
            path: self.folder.clone(),
        })
    }

    /// Ends where no equilibrium was found: that is reported, unless the scene is wrong.
    pub(crate) fn not_found(
        &self,
        report: SettleReport,
        error: &StaticsError,
    ) -> anyhow::Result<Ending> {
        let advised = self.source.advised_of_statics(error);
        if !error.is_not_found() {
            return Err(advised.into());
        }
        let (reason, advice) = (error.to_string(), advised.advice.as_deref());
        self.end_without(&self.folder()?, report, (&reason, advice), &[])
    }

    /// Ends without an equilibrium, with what was written so far.
    pub(crate) fn end_without(
        &self,
        folder: &Folder,
        mut report: SettleReport,
        (reason, advice): (&str, Option<&str>),
        written: &[&str],
    ) -> anyhow::Result<Ending> {
        report.failure = Some(NotFound {
            reason: reason.to_owned(),
        });
        folder.report(&report)?;
        folder.remove_others(&[written, &[REPORT]].concat());
        say_advised(reason, advice);
        Ok(Ending::Failed)
    }

    /// Says something, unless it is to be quiet.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet {
            say(text);
        }
    }

    /// Writes the scene at rest in its equilibrium, and what springs and supports carry.
    pub(crate) fn write(
        &self,
        folder: &Folder,
        equilibrium: &Equilibrium,
    ) -> Result<(), Unwritten> {
        let mut scene = self.scene().clone();
        equilibrium.write_to(&mut scene);
        scene.settings.start = Start::AsGiven;
        let free = scene.nodes.iter_mut().filter(|node| !node.fixed);
        free.for_each(|node| node.velocity = Vector3::zeros());
        write_scene(&folder.path.join(SCENE), &scene, &self.source.options)?;
        Ok(write_members(&folder.path, &scene, equilibrium)?)
    }
}

/// `springs.csv` and `reactions.csv`, with one frame.
fn write_members(
    folder: &Path,
    scene: &Scene,
    equilibrium: &Equilibrium,
) -> Result<(), WriteError> {
    let reactions = equilibrium.reactions.iter();
    let reactions: Vec<_> = reactions.map(|one| (one.node, one.force)).collect();
    let springs = scene.springs.iter().enumerate();
    let broken: Vec<usize> = springs
        .clone()
        .filter_map(|(index, spring)| spring.broken.then_some(index))
        .collect();
    let yielded: Vec<usize> = springs
        .filter_map(|(index, spring)| (spring.yielded != 0.0).then_some(index))
        .collect();
    let at_rest = vec![Vector3::zeros(); scene.nodes.len()];
    let frame = TrajectoryFrame {
        index: 0,
        time: 0.0,
        positions: &equilibrium.positions,
        velocities: &at_rest,
        members: Some(FrameMembers {
            springs: &scene.springs,
            tensions: &equilibrium.tensions,
            reactions: &reactions,
            broken: &broken,
            yielded: &yielded,
        }),
    };
    let plan = RunPlan {
        scene,
        intervals: 1,
    };
    for table in [&SPRINGS, &REACTIONS] {
        let mut sink = table.begin(folder, &plan)?;
        sink.frame(&frame)?;
        sink.finish(&RunEnd {
            scene,
            time: 0.0,
            peaks: &[],
        })?;
    }
    Ok(())
}

impl Folder {
    pub(crate) fn report(&self, report: &impl Serialize) -> Result<(), Unwritten> {
        Ok(write_report(&self.path.join(REPORT), report)?)
    }

    /// Removes what is left of an older run.
    pub(crate) fn remove_others(&self, written: &[&str]) {
        remove_all_but(&self.path, |name| written.contains(&name));
    }
}

/// The files of [`Work::write`] and the report.
pub(crate) fn equilibrium_files() -> [&'static str; 4] {
    [SCENE, REPORT, SPRINGS.file, REACTIONS.file]
}

/// A line about an equilibrium.
pub(crate) fn sentence(equilibrium: &Equilibrium) -> String {
    sentence_from("as given", equilibrium)
}

/// The same of one that was looked for from a `start`, which is said if it is that.
pub(crate) fn sentence_from(start: &str, equilibrium: &Equilibrium) -> String {
    let Equilibrium {
        residual,
        iterations,
        ..
    } = equilibrium;
    let how = match iterations {
        0 => start.to_owned(),
        1 => "after 1 iteration".to_owned(),
        iterations => format!("after {iterations} iterations"),
    };
    let left = format!("no force above {residual:.1e} N is left; {how}");
    let most = |nodes: &[usize]| {
        let nodes: Vec<String> = nodes.iter().map(usize::to_string).collect();
        let word = if nodes.len() == 1 { "node" } else { "nodes" };
        format!("{word} {}", nodes.join(", "))
    };
    match &equilibrium.status {
        Status::Stable => format!("stable equilibrium, {left}"),
        Status::Unstable { nodes } => format!(
            "unstable equilibrium ({} negative pivots, most at {}), {left}",
            equilibrium.negative_pivots,
            most(nodes)
        ),
        Status::Mechanism { nodes } => format!(
            "mechanism ({} motions that nothing resists, most at {}), {left}",
            equilibrium.zero_pivots,
            most(nodes)
        ),
    }
}
