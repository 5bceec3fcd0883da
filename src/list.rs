//! `roost list`: sweeps, jobs and workers of the server.

use anyhow::Result;
use roost_api::job::{JobState, JobView};
use roost_api::short_names::short_names;
use roost_api::sweep::SweepView;
use roost_terminal::{Exit, Table, format, message, print_json, print_lines};
use serde_json::{Value, json};

use crate::target;

/// List sweeps, jobs or workers, newest first
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    server: target::Server,
    /// List jobs
    #[arg(long)]
    jobs: bool,
    /// With --jobs, list only jobs in this state: queued, running, succeeded, failed or cancelled
    #[arg(long, requires = "jobs")]
    state: Option<JobState>,
    /// List workers
    #[arg(long, conflicts_with = "jobs")]
    workers: bool,
    /// Maximum number of entries
    #[arg(long, default_value_t = 20, value_name = "N")]
    limit: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    let (document, table) = if args.workers {
        let page = client.workers(None, args.limit).await?;
        let mut table = Table::new(["id", "name", "device", "threads", "running", "succeeded", "last seen"]);
        for worker in &page.items {
            table.row([
                worker.id.to_string(),
                worker.name.clone(),
                format!("{}: {}", worker.backend, worker.device),
                worker.threads.to_string(),
                worker.running.len().to_string(),
                worker.succeeded.to_string(),
                worker.last_seen_at.to_string(),
            ]);
        }
        (json!(page), table)
    } else if args.jobs {
        let page = client.jobs(args.state, None, args.limit).await?;
        (json!(page), jobs(&page.items))
    } else {
        let page = client.sweeps(None, args.limit).await?;
        (json!(page), sweeps(&page.items))
    };
    if args.json {
        print_json(&document)?;
    } else if table.is_empty() {
        message!("nothing to list; `roost submit` submits a scenario or a sweep");
    } else {
        print_lines(format_args!("{table}"))?;
    }
    Ok(Exit::Done)
}

/// Prints one sweep.
pub(crate) fn print_sweep(sweep: SweepView, as_json: bool) -> Result<()> {
    print(as_json, &json!(sweep), || sweeps(&[sweep]))
}

/// Prints one job.
pub(crate) fn print_job(job: JobView, as_json: bool) -> Result<()> {
    print(as_json, &json!(job), || jobs(&[job]))
}

fn print(as_json: bool, document: &Value, table: impl FnOnce() -> Table) -> Result<()> {
    if as_json {
        print_json(document)?;
    } else {
        print_lines(format_args!("{}", table()))?;
    }
    Ok(())
}

pub(crate) fn sweeps(sweeps: &[SweepView]) -> Table {
    let mut table = Table::new([
        "id",
        "name",
        "design",
        "jobs",
        "queued",
        "running",
        "paused",
        "succeeded",
        "failed",
        "cancelled",
        "%",
        "submitted",
    ]);
    for sweep in sweeps {
        table.row([
            sweep.id.to_string(),
            sweep.name.clone(),
            format!("{} × {}", sweep.design, sweep.points),
            sweep.counts.total().to_string(),
            sweep.counts.queued.to_string(),
            sweep.counts.running.to_string(),
            sweep.paused.to_string(),
            sweep.counts.succeeded.to_string(),
            sweep.counts.failed.to_string(),
            sweep.counts.cancelled.to_string(),
            format!("{:.0}", sweep.fraction * 100.0),
            sweep.submitted_at.to_string(),
        ]);
    }
    table
}

pub(crate) fn jobs(jobs: &[JobView]) -> Table {
    let mut table = Table::new(["id", "state", "levels", "seed", "attempt", "%", "submitted"]);
    for job in jobs {
        let names = short_names(&job.factors.keys().collect::<Vec<_>>());
        let levels = names.iter().zip(job.factors.values());
        let levels: Vec<_> = levels.map(|(name, value)| format!("{name}={}", format::cell(value))).collect();
        let state = match (job.cancelling, job.paused, job.failure_class) {
            (true, ..) => "cancelling".to_owned(),
            (false, true, _) if job.state == JobState::Running => "pausing".to_owned(),
            (false, true, _) => "paused".to_owned(),
            (false, false, Some(class)) => format!("{}: {class}", job.state),
            (false, false, None) => job.state.to_string(),
        };
        let done = match job.state {
            JobState::Succeeded => Some(1.0),
            state if state.is_ended() => None,
            _ => job.progress.as_ref().map(|progress| progress.fraction),
        };
        table.row([
            job.id.to_string(),
            state,
            levels.join(" "),
            job.seed.to_string(),
            job.attempt.to_string(),
            done.map_or_else(|| "–".to_owned(), |fraction| format!("{:.0}", fraction * 100.0)),
            job.submitted_at.to_string(),
        ]);
    }
    table
}
