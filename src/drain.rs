//! `roost drain`: send a worker home once it has finished.

use anyhow::Result;
use roost_api::ids::WorkerId;

use crate::exit::Exit;
use crate::target;
use crate::ui;

/// Ask a worker to claim nothing more, finish what it runs, and end
///
/// `roost list --workers` shows the ids. The worker hears of it with its next heartbeat.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of the worker
    #[arg(value_parser = target::worker_id)]
    id: WorkerId,
    #[command(flatten)]
    server: target::Server,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    args.server.client()?.drain(args.id).await?;
    ui::say!("the worker finishes what it runs, and ends");
    Ok(Exit::Done)
}
