//! `springs modes`: frequencies and shapes of vibrations about an equilibrium.

use super::signals::Signals;
use super::statics::{StaticsArguments, equilibrium_files, sentence};
use super::{Ending, Unwritten};
use springs::inspect::count;
use springs::io::{MODES, ModesReport, SHAPES, write_modes};
use springs::statics::{modes, settle};

#[derive(clap::Args)]
pub(crate) struct ModesArguments {
    #[command(flatten)]
    work: StaticsArguments,
    /// How many modes, from the lowest frequency on
    #[arg(short = 'n', long = "modes", value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    n: u32,
}

pub(crate) fn modes_command(arguments: &ModesArguments) -> anyhow::Result<Ending> {
    let _signals = Signals::watch();
    let work = arguments.work.begin()?;
    let found = settle(work.scene(), &work.options);
    let equilibrium = match found {
        Ok(equilibrium) => equilibrium,
        Err(error) => return work.not_found(work.report(), &error),
    };
    let mut settled = work.scene().clone();
    equilibrium.write_to(&mut settled);
    let found = modes(&settled, arguments.n as usize, &work.options);
    let found = found.map_err(|error| work.source.advised_of_statics(&error))?;

    let folder = work.folder()?;
    work.write(&folder, &equilibrium)?;
    let positions = &equilibrium.positions;
    write_modes(&folder.path, &found.frequencies, positions, &found.shapes)
        .map_err(Unwritten::from)?;
    folder.report(&ModesReport {
        equilibrium: work.report_of(&equilibrium),
        modes: found.frequencies.len(),
        all_modes: found.n_all,
        negative_modes: found.n_negative,
        zero_modes: found.n_zero,
    })?;
    let mut written = equilibrium_files().to_vec();
    written.extend([MODES, SHAPES]);
    folder.remove_others(&written);
    let about = if equilibrium.was_balanced {
        "the scene is in equilibrium; modes are about it as it is"
    } else {
        "the scene is not in equilibrium; modes are about the one that it settles in"
    };
    work.say(about);
    work.say(&sentence(&equilibrium));
    let (given, all) = (found.frequencies.len(), found.n_all);
    work.say(&format!(
        "{given} of {}, {} growing and {} without resistance",
        count(all, "mode"),
        found.n_negative,
        found.n_zero
    ));
    let (into, files) = (folder.path.display(), written.join(", "));
    work.say(&format!("{files} written into {into}"));
    Ok(Ending::Done)
}
