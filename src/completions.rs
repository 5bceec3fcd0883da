//! `roost completions`: what a shell needs to complete its commands.

use anyhow::Result;
use clap::Command;
use clap_complete::Shell;

use crate::exit::Exit;
use crate::ui;

/// Print a script that completes commands and options in your shell
///
/// For bash: `source <(roost completions bash)`, in ~/.bashrc to have it always.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Your shell
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn execute(args: &Args, mut command: Command) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "roost", &mut script);
    ui::print(String::from_utf8(script)?)?;
    Ok(Exit::Done)
}

/// Every shell that there is a script for.
#[cfg(test)]
pub(crate) fn shells() -> &'static [Shell] {
    <Shell as clap::ValueEnum>::value_variants()
}
