//! `roost retry`: queue again what failed or was cancelled.

use anyhow::Result;
use roost_api::job::FailureClass;
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
        Target::Sweep(mut sweep) => {
            match args.class {
                Some(class) if *sweep.failures.of(class) == 0 => {
                    ui::say!("nothing to retry: no job has failed as {}", class.as_str());
                }
                None if sweep.counts.failed + sweep.counts.cancelled == 0 => {
                    ui::say!("nothing to retry: no job has failed or was cancelled");
                }
                _ => {}
            }
            list::show_sweep(client.retry_sweep(sweep.id, args.class).await?, args.json)?;
        }
        Target::Job(job) => {
            list::show_job(client.retry_job(job.id, args.class).await?, args.json)?;
        }
    }
    Ok(Exit::Done)
}
