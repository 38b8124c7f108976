//! `springs modes`: frequencies and shapes of vibrations about an equilibrium.

use super::signals::Signals;
use super::statics::{StaticsArguments, equilibrium_files, sentence};
use super::{Ending, Unwritten, say_advised};
use springs::inspect::count;
use springs::io::{MODES, ModesReport, NotFound, SHAPES, SettleReport, write_modes};
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
    let (given, all) = (found.frequencies.len(), found.n_all);
    let missing = (!found.is_complete).then(|| {
        let wanted = all.min(arguments.n as usize);
        format!("only {given} of {wanted} modes were found, and others may lie between them")
    });
    folder.report(&ModesReport {
        equilibrium: SettleReport {
            failure: missing.clone().map(|reason| NotFound { reason }),
            ..work.report_of(&equilibrium)
        },
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
    work.say(&format!(
        "{given} of {}, {} growing and {} without resistance",
        count(all, "mode"),
        found.n_negative,
        found.n_zero
    ));
    let (into, files) = (folder.path.display(), written.join(", "));
    work.say(&format!("{files} written into {into}"));
    Ok(match missing {
        None => Ending::Done,
        Some(missing) => {
            say_advised(&missing, Some("ask for fewer of them"));
            Ending::Failed
        }
    })
}
