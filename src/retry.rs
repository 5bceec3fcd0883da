//! `roost retry`: queue failed and cancelled jobs again.

use anyhow::Result;
use roost_api::job::FailureClass;
use roost_terminal::{Exit, message};
use uuid::Uuid;

use crate::list;
use crate::target::{self, Target};

/// Queue one job again, or all failed and cancelled jobs of a sweep
///
/// To continue a cancelled study, use the id of the study: the sweep of the study has the same id.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep or a job
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// Queue only jobs of this failure class: invalid, unstable, worker, lost or timeout
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
                    message!("nothing to retry: no job has failed as {}", class.as_str());
                }
                // A cancelled study goes on without such jobs.
                None if sweep.counts.failed + sweep.counts.cancelled == 0 && !sweep.is_study => {
                    message!("nothing to retry: no job has failed or was cancelled");
                }
                _ => {}
            }
            list::print_sweep(client.retry_sweep(sweep.id, args.class).await?, args.json)?;
        }
        Target::Job(job) => {
            list::print_job(client.retry_job(job.id, args.class).await?, args.json)?;
        }
    }
    Ok(Exit::Done)
}
