//! `roost delete`: delete a sweep with its results.

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_terminal::{Exit, message, print_json, print_line};
use serde_json::json;
use uuid::Uuid;

use crate::target;

/// Delete a sweep with all its results; without --yes, only show how many jobs and results the sweep has
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    delete: DeleteArgs,
}

/// Options of the commands that delete.
#[derive(Debug, clap::Args)]
pub(crate) struct DeleteArgs {
    #[command(flatten)]
    pub(crate) server: target::Server,
    /// Delete the data; nobody can undo this deletion
    #[arg(long)]
    pub(crate) yes: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl DeleteArgs {
    /// Start of the summary.
    pub(crate) fn verb(&self) -> &'static str {
        if self.yes { "deleted" } else { "would delete" }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let Args { id, delete } = args;
    let deletion = delete.server.client()?.delete_sweep(SweepId(id), !delete.yes).await?;
    if delete.json {
        print_json(&json!(deletion))?;
        return Ok(Exit::Done);
    }
    print_line(format_args!(
        "{} {} points, {} jobs, {} attempts, {} results",
        delete.verb(),
        deletion.points,
        deletion.jobs,
        deletion.attempts,
        deletion.results
    ))?;
    if deletion.unended > 0 {
        message!("{} jobs have not ended; run `roost cancel {}` first", deletion.unended, id);
    } else if !delete.yes {
        message!("nothing is deleted; `roost delete {} --yes` deletes", id);
    }
    Ok(Exit::Done)
}
