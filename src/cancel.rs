//! `roost cancel`: cancel a sweep or a job.

use anyhow::Result;
use roost_terminal::{Exit, message};
use uuid::Uuid;

use crate::list;
use crate::target::{self, Target};

/// Cancel a sweep or a job; running jobs stop within seconds
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep or a job
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    match target::find(&client, args.id).await? {
        Target::Sweep(sweep) => {
            if sweep.counts.is_ended() {
                message!("nothing to cancel: every job has ended");
            }
            list::print_sweep(client.cancel_sweep(sweep.id).await?, args.json)?;
        }
        Target::Job(job) => {
            if job.state.is_ended() {
                message!("nothing to cancel: the job has ended");
            }
            list::print_job(client.cancel_job(job.id).await?, args.json)?;
        }
    }
    Ok(Exit::Done)
}
