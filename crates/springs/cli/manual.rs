//! `springs completions` and `springs man`: from the definitions of the command line.

use super::{Ending, print};
use clap_complete::Shell;

#[derive(clap::Args)]
pub(crate) struct CompletionArguments {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// A script for the shell.
pub(crate) fn completions(
    arguments: &CompletionArguments,
    mut command: clap::Command,
) -> anyhow::Result<Ending> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "springs", &mut script);
    print(&String::from_utf8(script)?)?;
    Ok(Ending::Done)
}

/// One page in roff: the command, then each of its commands.
pub(crate) fn man(mut command: clap::Command) -> anyhow::Result<Ending> {
    let mut page = Vec::new();
    command.build();
    clap_mangen::Man::new(command.clone()).render(&mut page)?;
    for sub in command
        .get_subcommands()
        .filter(|sub| sub.get_name() != "help")
    {
        let name = format!("springs {}", sub.get_name());
        let man = clap_mangen::Man::new(sub.clone().display_name(&name).bin_name(&name));
        let heading = format!(".SH \"{}\"\n", name.to_uppercase());
        page.extend(heading.bytes());
        man.render_synopsis_section(&mut page)?;
        man.render_description_section(&mut page)?;
        man.render_options_section(&mut page)?;
    }
    print(&String::from_utf8(page)?)?;
    Ok(Ending::Done)
}
