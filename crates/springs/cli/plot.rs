//! `springs plot`: pictures of the tables of a finished run.

use super::{Advised, Ending, Unwritten, say};
use springs::plots::{PLOTS, PlotError, plot};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct PlotArguments {
    /// The folder of a run that wrote energy, steps or springs, or has probes
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Say nothing about the pictures
    #[arg(long)]
    quiet: bool,
}

pub(crate) fn plot_command(arguments: &PlotArguments) -> anyhow::Result<Ending> {
    let folder = &arguments.folder;
    let pictures = plot(folder).map_err(|error| match error {
        PlotError::Write(error) => anyhow::Error::from(Unwritten::from(error)),
        PlotError::Nothing { .. } => {
            let tables: Vec<&str> = PLOTS.iter().map(|plot| plot.table).collect();
            let advice = format!(
                "`springs run SCENE.ron --write energy,steps,springs` writes tables; drawn are {}",
                tables.join(", ")
            );
            Advised {
                message: error.to_string(),
                advice: Some(advice),
            }
            .into()
        }
        other => Advised {
            message: other.to_string(),
            advice: None,
        }
        .into(),
    })?;
    if !arguments.quiet {
        let (pictures, folder) = (pictures.join(", "), folder.display());
        say(&format!("  wrote {pictures} into {folder}"));
    }
    Ok(Ending::Done)
}
