//! `roost delete`: take a sweep and all its results away.

use anyhow::Result;
use roost_api::ids::SweepId;
use serde_json::json;
use uuid::Uuid;

use crate::exit::Exit;
use crate::target;
use crate::ui;

/// Delete a sweep with all its results; without --yes only say what would go
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    deleting: Deleting,
}

/// What commands that delete have in common: they only do it when told so.
#[derive(Debug, clap::Args)]
pub(crate) struct Deleting {
    #[command(flatten)]
    pub(crate) server: target::Server,
    /// Do it: there is no way back
    #[arg(long)]
    pub(crate) yes: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl Deleting {
    /// How to say what goes.
    pub(crate) fn verb(&self) -> &'static str {
        if self.yes { "deleted" } else { "would delete" }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let Args { id, deleting } = args;
    let deletion = deleting.server.client()?.delete_sweep(SweepId(id), !deleting.yes).await?;
    if deleting.json {
        ui::json(&json!(deletion))?;
        return Ok(Exit::Done);
    }
    ui::println(format_args!(
        "{} {} points, {} jobs, {} attempts, {} results",
        deleting.verb(),
        deletion.points,
        deletion.jobs,
        deletion.attempts,
        deletion.results
    ))?;
    if deletion.unended > 0 {
        ui::say!("{} jobs have not ended: `roost cancel {}` first", deletion.unended, id);
    } else if !deleting.yes {
        ui::say!("nothing is deleted yet; `roost delete {} --yes` does it", id);
    }
    Ok(Exit::Done)
}
