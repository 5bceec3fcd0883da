//! `roost status`: how far a sweep or a job has come.

use anyhow::Result;
use serde_json::json;
use uuid::Uuid;

use crate::exit::Exit;
use crate::target::{self, Target};
use crate::ui;
use crate::{list, run};

/// Show how far a sweep or a job has come
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
                ui::json(&json!(sweep))?;
            } else {
                ui::print(format_args!("{}\n{}\n", list::sweeps(&[sweep]), list::jobs(&page.items)))?;
                if page.next_cursor.is_some() {
                    ui::say!("the newest 100 jobs only; `roost results {}` has all", args.id);
                }
            }
        }
        Target::Job(job) => {
            if args.json {
                ui::json(&json!(job))?;
            } else {
                ui::print(format_args!("{}", list::jobs(std::slice::from_ref(&job))))?;
                if let Some(progress) = job.progress.as_ref().filter(|_| !job.state.is_ended()) {
                    ui::println(format_args!("{}", run::describe(progress)))?;
                }
                if let Some(message) = &job.failure_message {
                    ui::println(format_args!("{message}"))?;
                }
            }
        }
    }
    Ok(Exit::Done)
}
