//! `springs check`: what can be said of a scene without a step.

use super::source::SceneArguments;
use super::{Ending, print};
use anyhow::Context as _;
use springs::inspect::{Check, CheckError};

#[derive(clap::Args)]
pub(crate) struct CheckArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn check(arguments: &CheckArguments) -> anyhow::Result<Ending> {
    let source = arguments.scene.load()?;
    let check = match Check::of(&source.scene, &source.options, &source.inputs) {
        Ok(check) => check,
        Err(CheckError::Setup(error)) => return Err(source.advised(&error).into()),
        Err(error) => return Err(error.into()),
    };
    if arguments.json {
        let json = serde_json::to_string_pretty(&check).context("a check has a JSON form")?;
        print(&(json + "\n"))?;
    } else {
        print(&check.to_string())?;
    }
    Ok(Ending::Done)
}
