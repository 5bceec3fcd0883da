//! `roost pause` and `roost resume`: hold sweeps and jobs back, and let them go on.

use anyhow::Result;
use roost_terminal::{Exit, message};
use uuid::Uuid;

use crate::list;
use crate::target::{self, Target};

/// Pause sweeps or jobs: within seconds, workers store a checkpoint of each running job and hand the job back
///
/// A paused job keeps its place in the queue, but no worker claims it. `roost resume` ends the pause. The job then continues from its
/// checkpoint. If the job records frames, or if the server stores no checkpoints, the job begins at zero instead. If you add jobs to
/// a paused sweep, the new jobs are not paused.
#[derive(Debug, clap::Args)]
pub(crate) struct Pause {
    #[command(flatten)]
    targets: Targets,
}

/// Resume paused sweeps or jobs
#[derive(Debug, clap::Args)]
pub(crate) struct Resume {
    #[command(flatten)]
    targets: Targets,
}

#[derive(Debug, clap::Args)]
struct Targets {
    /// Ids of sweeps or jobs
    #[arg(value_parser = target::id, required = true, value_name = "ID")]
    ids: Vec<Uuid>,
    #[command(flatten)]
    server: target::Server,
    /// Print one JSON document for each id
    #[arg(long)]
    json: bool,
}

pub(crate) async fn pause(args: Pause) -> Result<Exit> {
    set_paused(args.targets, true).await
}

pub(crate) async fn resume(args: Resume) -> Result<Exit> {
    set_paused(args.targets, false).await
}

async fn set_paused(targets: Targets, pause: bool) -> Result<Exit> {
    let client = targets.server.client()?;
    let verb = if pause { "pause" } else { "resume" };
    for id in targets.ids {
        match target::find(&client, id).await? {
            Target::Sweep(sweep) => {
                if sweep.counts.is_ended() {
                    message!("nothing to {verb}: every job of {id} has ended");
                }
                list::print_sweep(client.pause_sweep(sweep.id, pause).await?, targets.json)?;
            }
            Target::Job(job) => {
                if job.state.is_ended() {
                    message!("nothing to {verb}: the job {id} has ended");
                }
                list::print_job(client.pause_job(job.id, pause).await?, targets.json)?;
            }
        }
    }
    Ok(Exit::Done)
}
