//! `roost up`: server and worker in one process.

use anyhow::Result;
use roost_terminal::{Exit, print_line, signals};
use roost_worker::WorkerConfig;

use crate::farm::Farm;
use crate::serve::ServerArgs;
use crate::target;
use crate::work::WorkerArgs;

/// Run a server and one worker in this process
///
/// If access tokens exist in the data folder, the worker needs a token with the scope `worker`. Name the file of this token with
/// `--token-file`, or set ROOST_TOKEN.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: ServerArgs,
    #[command(flatten)]
    access: target::Access,
    #[command(flatten)]
    worker: WorkerArgs,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    let state = args.server.data.join("worker");
    let device = args.worker.device()?;
    let credentials = args.access.read()?;
    let worker = |address| WorkerConfig { credentials, ..args.worker.config(address, state, device) };
    let mut farm = Farm::start(args.server.config()?, worker).await?;
    print_line(format_args!("listening on {}", farm.address))?;
    tokio::select! {
        () = shutdown.cancelled() => farm.stop().await.map(|()| Exit::Done),
        error = farm.failure() => Err(error),
    }
}
