//! `roost status`: the progress of a sweep or a job.

use anyhow::Result;
use roost_api::forecast::Forecast;
use roost_api::job::{FilledBy, JobView};
use roost_terminal::{Exit, message, print_json, print_line, print_lines};
use serde_json::json;
use uuid::Uuid;

use crate::target::{self, Target};
use crate::{forecast, list, run};

/// Show the progress of a sweep or a job, the reason why it waits, and its expected start and end
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
            let page = client.sweep_jobs(sweep.id, None, None, 100).await?;
            if args.json {
                print_json(&json!(sweep))?;
            } else {
                let (id, is_ended) = (sweep.id, sweep.counts.is_ended());
                print_lines(format_args!("{}\n{}\n", list::sweeps(&[sweep]), list::jobs(&page.items)))?;
                if !is_ended {
                    print_forecast(&client.sweep_forecast(id).await?)?;
                }
                if page.next_cursor.is_some() {
                    message!("only the newest 100 jobs are shown; `roost results {}` has all", args.id);
                }
            }
        }
        Target::Job(job) => {
            if args.json {
                print_json(&json!(job))?;
            } else {
                print_lines(format_args!("{}", list::jobs(std::slice::from_ref(&job))))?;
                if let Some(progress) = job.progress.as_ref().filter(|_| !job.state.is_ended()) {
                    print_line(format_args!("{}", run::describe(progress)))?;
                }
                if let Some(resumed_from_s) = job.resumed_from_s {
                    let attempt = job.attempt;
                    print_line(format_args!(
                        "attempt {attempt} continues from {resumed_from_s:.3} s of simulated time"
                    ))?;
                }
                if let Some(checkpoint) = &job.checkpoint {
                    let (simulated_s, mib) =
                        (checkpoint.simulated_s, checkpoint.bytes as f64 / f64::from(1 << 20));
                    print_line(format_args!(
                        "checkpoint at {simulated_s:.3} s of simulated time, {mib:.1} MiB"
                    ))?;
                }
                if let Some(text) = fill(&job) {
                    print_line(text)?;
                }
                if let Some(message) = &job.failure_message {
                    print_line(format_args!("{message}"))?;
                }
                if !job.state.is_ended() {
                    print_forecast(&client.job_forecast(job.id).await?)?;
                }
            }
        }
    }
    Ok(Exit::Done)
}

fn print_forecast(forecast: &Forecast) -> Result<()> {
    for line in forecast::lines(forecast) {
        print_line(line)?;
    }
    Ok(())
}

/// Where the filled state of a job came from, where that is worth a line.
fn fill(job: &JobView) -> Option<&'static str> {
    match (job.filled_by, job.shared_fill) {
        (Some(FilledBy::Shared), _) => Some("started from a filled state of another run"),
        (Some(FilledBy::Attempt), true) => Some("filled by itself"),
        (_, false) => Some("shares no filled state"),
        (None, true) => None,
    }
}
