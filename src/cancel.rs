//! `roost cancel`: stop a sweep or a job.

use anyhow::Result;
use uuid::Uuid;

use crate::exit::Exit;
use crate::list;
use crate::target::{self, Target};
use crate::ui;

/// Cancel a sweep or a job; what runs is stopped within seconds
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep or a job
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    match target::find(&client, args.id).await? {
        Target::Sweep(sweep) => {
            ui::print(format_args!("{}", list::sweeps(&[client.cancel_sweep(sweep.id).await?])))?
        }
        Target::Job(job) => ui::print(format_args!("{}", list::jobs(&[client.cancel_job(job.id).await?])))?,
    }
    Ok(Exit::Done)
}
