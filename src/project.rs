//! `roost project`: shares and budgets of projects.

use anyhow::Result;
use clap::Subcommand;
use roost_api::project::{MAX_BUDGET_CORE_HOURS, MAX_SHARE, ProjectView};
use roost_server::ProjectChange;
use roost_terminal::{Exit, Table, message, print_json, print_lines};
use serde_json::json;

use crate::database::ServerData;

/// Create, list and change projects: their shares of the workers and their budgets
///
/// Each token belongs to a project. The jobs that somebody submits with the token belong to the same project. While several projects
/// have queued jobs, the workers take jobs of each project in proportion to its share. If a project has used its whole budget, its
/// queued jobs stay in the queue, and no worker takes these jobs. The command changes the data folder of a server. A running server
/// notices the change within a second.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    data: ServerData,
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List all projects with their shares, budgets, used core-hours and jobs
    List,
    /// Create a project
    Create {
        /// Name of the project: letters, digits, `.`, `_` and `-`
        name: String,
        #[command(flatten)]
        values: Values,
    },
    /// Change the share or the budget of a project
    Set {
        /// Name from `roost project list`
        name: String,
        #[command(flatten)]
        values: Values,
    },
}

/// New values of a project.
#[derive(Clone, Copy, Debug, clap::Args)]
struct Values {
    /// Share of the project, from 1 to 1000; a new project has 1. While two projects have queued jobs of the same priority, workers
    /// take twice as many jobs of a project with a share of 2 as of a project with a share of 1
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SHARE)))]
    share: Option<u32>,
    /// Budget of the project: the total number of core-hours that it may use, or `none` for no limit. A core-hour is one thread that
    /// runs for one hour. A new project has no limit
    #[arg(long, value_name = "HOURS", value_parser = budget)]
    budget_core_hours: Option<Budget>,
}

/// A budget; none is no limit.
#[derive(Clone, Copy, Debug)]
struct Budget(Option<f64>);

fn budget(text: &str) -> Result<Budget, String> {
    if text == "none" {
        return Ok(Budget(None));
    }
    let hours = text.parse().ok().filter(|hours| (0.0..=MAX_BUDGET_CORE_HOURS).contains(hours));
    hours
        .map(|hours| Budget(Some(hours)))
        .ok_or_else(|| format!("allowed is a number from 0 to {MAX_BUDGET_CORE_HOURS:e}, or `none`"))
}

impl Values {
    fn change(self) -> ProjectChange {
        let budget_core_hours = self.budget_core_hours.map(|budget| budget.0);
        ProjectChange { share: self.share, budget_core_hours }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let may_create = matches!(args.action, Action::Create { .. });
    let mut projects = args.data.open(may_create).await?;
    match args.action {
        Action::List => {
            let all = projects.projects().await?;
            if args.json {
                print_json(&json!(all))?;
            } else {
                print_lines(format_args!("{}", table(&all)))?;
            }
        }
        Action::Create { name, values } => {
            projects.create_project(&name, values.change()).await?;
            show(projects.project(&name).await?, args.json)?;
        }
        Action::Set { name, values } => {
            if values.share.is_none() && values.budget_core_hours.is_none() {
                anyhow::bail!("nothing to change: give --share or --budget-core-hours");
            }
            projects.set_project(&name, values.change()).await?;
            show(projects.project(&name).await?, args.json)?;
            message!("changed; a running server follows within a second");
        }
    }
    projects.close().await?;
    Ok(Exit::Done)
}

/// Prints a project without the numbers of its jobs, which would have to be counted.
fn show(project: ProjectView, as_json: bool) -> Result<()> {
    if as_json {
        let ProjectView { name, share, budget_core_hours, used_core_hours, .. } = project;
        let values = json!({"name": name, "share": share, "budget_core_hours": budget_core_hours, "used_core_hours": used_core_hours});
        return Ok(print_json(&values)?);
    }
    let mut table = Table::new(["name", "share", "core-hours", "budget"]);
    table.row(values(&project));
    Ok(print_lines(format_args!("{table}"))?)
}

fn table(projects: &[ProjectView]) -> Table {
    let mut table = Table::new(["name", "share", "core-hours", "budget", "queued", "running"]);
    for project in projects {
        let [name, share, used, budget] = values(project);
        table.row([name, share, used, budget, project.queued.to_string(), project.running.to_string()]);
    }
    table
}

fn values(project: &ProjectView) -> [String; 4] {
    let budget = project.budget_core_hours.map_or_else(|| "–".to_owned(), |hours| hours.to_string());
    [project.name.clone(), project.share.to_string(), format!("{:.1}", project.used_core_hours), budget]
}
