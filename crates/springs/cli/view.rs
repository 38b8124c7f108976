//! `springs view`: a page to look at a finished run in a browser.

use super::output::{SCENE, quoted};
use super::{Advised, Ending, Unwritten, say};
use springs::io::read_scene;
use springs::view::{ViewError, write_page};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct ViewArguments {
    /// The folder of a run that wrote npz, or csv and springs
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Say nothing about the page
    #[arg(long)]
    quiet: bool,
}

pub(crate) fn view(arguments: &ViewArguments) -> anyhow::Result<Ending> {
    let folder = &arguments.folder;
    let path = folder.join(SCENE);
    if !path.exists() {
        let message = format!(
            "the folder {} holds no run: it has no {SCENE}",
            quoted(folder)
        );
        let advice = Some(AGAIN.to_owned());
        return Err(Advised { message, advice }.into());
    }
    let (scene, _) = read_scene(&path)?;
    let page = write_page(folder, &scene).map_err(|error| match error {
        ViewError::Write(error) => anyhow::Error::from(Unwritten::from(error)),
        other => Advised {
            message: other.to_string(),
            advice: Some(AGAIN.to_owned()),
        }
        .into(),
    })?;
    if !arguments.quiet {
        say(&invitation(&page));
    }
    Ok(Ending::Done)
}

const AGAIN: &str = "`springs run SCENE.ron --out DIR --view` simulates a scene, writes its frames and ends with the page";

/// What to do with the page.
pub(super) fn invitation(page: &Path) -> String {
    format!("  open {} in a browser", page.display())
}
