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
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// Do it: there is no way back
    #[arg(long)]
    yes: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let deletion = args.server.client()?.delete_sweep(SweepId(args.id), !args.yes).await?;
    if args.json {
        ui::println(format_args!("{:#}", json!(deletion)))?;
        return Ok(Exit::Done);
    }
    let verb = if args.yes { "deleted" } else { "would delete" };
    ui::println(format_args!(
        "{verb} {} points, {} jobs, {} attempts, {} results",
        deletion.points, deletion.jobs, deletion.attempts, deletion.results
    ))?;
    if deletion.unended > 0 {
        eprintln!("{} jobs have not ended: `roost cancel {}` first", deletion.unended, args.id);
    } else if !args.yes {
        eprintln!("nothing is deleted yet; `roost delete {} --yes` does it", args.id);
    }
    Ok(Exit::Done)
}
