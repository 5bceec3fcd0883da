//! `roost retry`: queue again what failed or was cancelled.

use anyhow::Result;
use roost_api::job::FailureClass;
use roost_api::sweep::StateCounts;
use uuid::Uuid;

use crate::exit::Exit;
use crate::list;
use crate::target::{self, Target};
use crate::ui;

/// Queue the failed and cancelled jobs of a sweep, or one job, again
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep or a job
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// Only what failed so: invalid, unstable, worker, lost or timeout
    #[arg(long, value_name = "CLASS")]
    class: Option<FailureClass>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    match target::find(&client, args.id).await? {
        Target::Sweep(before) => {
            let after = client.retry_sweep(before.id, args.class).await?;
            let waits = |counts: &StateCounts| counts.failed + counts.cancelled;
            if waits(&after.counts) >= waits(&before.counts) {
                ui::say!("nothing to retry: no job has failed so, or was cancelled");
            }
            list::show_sweep(after, args.json)?;
        }
        Target::Job(job) => {
            list::show_job(client.retry_job(job.id, args.class).await?, args.json)?;
        }
    }
    Ok(Exit::Done)
}
