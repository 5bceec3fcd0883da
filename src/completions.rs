//! `roost completions`: scripts for the completion of commands in shells.

use anyhow::Result;
use clap::Command;
use clap_complete::Shell;
use roost_terminal::{Exit, print_lines};

/// Print a completion script for a shell
///
/// For bash, run `source <(roost completions bash)`. To have completion in every shell, add this line to ~/.bashrc.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Name of the shell
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn execute(args: &Args, mut command: Command) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "roost", &mut script);
    print_lines(String::from_utf8(script)?)?;
    Ok(Exit::Done)
}

/// All shells with a script.
#[cfg(test)]
pub(crate) fn shells() -> &'static [Shell] {
    <Shell as clap::ValueEnum>::value_variants()
}
