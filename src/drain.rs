//! `roost drain`: end a worker after its running jobs.

use anyhow::Result;
use roost_api::ids::WorkerId;
use roost_terminal::{Exit, message};

use crate::target;

/// Ask a worker to finish its running jobs, claim no new jobs, and exit
///
/// `roost list --workers` shows the ids of all workers. The worker receives the request with its next heartbeat, which is a message
/// that the worker sends to the server every 2 s by default.
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
    message!("the worker finishes its running jobs and exits");
    Ok(Exit::Done)
}
