//! `roost pool`: workers on demand. `slurm` submits allocations of Slurm by the depth of the queue, `list` shows them.
//!
//! | file | content |
//! |---|---|
//! | `args` | options and their limits |
//! | `rule` | the decision, a pure function |
//! | `observe` | from a look at Slurm and the server to the ledger |
//! | `ledger` | the pool's memory on disk |
//! | `script` | the batch script and the arguments of `sbatch` |
//! | `slurm`, `parse` | Slurm's commands and their output |
//! | `run` | the loop |
//! | `dry_run`, `list` | the texts of `--dry-run` and `roost pool list` |

mod args;
mod dry_run;
mod ledger;
mod list;
mod observe;
mod parse;
mod rule;
mod run;
mod script;
mod slurm;

use std::path::PathBuf;

use anyhow::Result;
use clap::Subcommand;
use roost_terminal::Exit;

use crate::work;

/// Start workers on demand for queued jobs
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Slurm(Box<args::SlurmArgs>),
    List(list::ListArgs),
}

impl Args {
    /// Default filter of the log: a running pool logs what it does.
    pub(crate) fn log_filter(&self) -> &'static str {
        match &self.action {
            Action::Slurm(args) if !args.dry_run => "info",
            _ => "warn",
        }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    match args.action {
        Action::Slurm(args) if args.dry_run => dry_run::execute(*args).await,
        Action::Slurm(args) => run::execute(*args).await,
        Action::List(args) => list::execute(&args),
    }
}

/// The folder of a pool, if `--state` names none: in the state folder of `roost work`, by the same variable.
fn default_state() -> PathBuf {
    let named = std::env::var_os("ROOST_STATE").filter(|folder| !folder.is_empty());
    named.map_or_else(work::default_state, PathBuf::from).join("pool")
}
