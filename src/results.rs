//! `roost results`: the table of a sweep, or the result of a job.

use anyhow::Result;
use clap::ValueEnum;
use roost_api::table::SweepResults;
use roost_worker::client::ClientError;
use serde_json::{Value, json};
use uuid::Uuid;

use crate::exit::Exit;
use crate::target::{self, Target};
use crate::ui;
use crate::ui::{format, table::Table};
use crate::{output, run};

/// Responses shown in a terminal, those that the experiment has; JSON and CSV have all.
const SHOWN: [&str; 14] = [
    "regime",
    "discharged_kg",
    "discharged_kg_at_4s",
    "time_to_95_percent_s",
    "mean_rate_kg_s",
    "settle_time_s",
    "bend_angle_deg",
    "tip_deflection_m",
    "critical_angle_deg",
    "friction_angle_deg",
    "modulus_pa",
    "modulus_lattice_pa",
    "time_to_rest_s",
    "lowest_bonds_intact_fraction",
];

/// Print the results of a sweep or a job
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep or a job
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// A short table for people; JSON or CSV with everything
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Table,
    Json,
    Csv,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let client = args.server.client()?;
    match (target::find(&client, args.id).await?, args.format) {
        (Target::Sweep(sweep), Format::Csv) => {
            ui::print(format_args!("{}", client.sweep_results_csv(sweep.id).await?))?
        }
        (Target::Sweep(sweep), Format::Json) => {
            ui::println(format_args!("{:#}", json!(client.sweep_results(sweep.id).await?)))?
        }
        (Target::Sweep(sweep), Format::Table) => {
            ui::print(format_args!("{}", trials(&client.sweep_results(sweep.id).await?)))?
        }
        (Target::Job(job), format) => {
            let result = match client.job_result(job.id).await {
                Ok(result) => result,
                // The job is there, its result is not (yet): the id was no wrong input.
                Err(ClientError::Problem(problem)) if problem.status == 404 => {
                    eprintln!("error: {}", problem.detail);
                    return Ok(Exit::Failed);
                }
                Err(error) => return Err(error.into()),
            };
            match format {
                Format::Json => ui::println(format_args!("{:#}", json!(result)))?,
                Format::Csv => output::series_csv(std::io::stdout().lock(), &result.series)?,
                Format::Table => ui::print(format_args!("{}", run::responses(&result)))?,
            }
        }
    }
    Ok(Exit::Done)
}

/// One row a trial: levels, seed, state and the chief responses.
pub(crate) fn trials(results: &SweepResults) -> Table {
    let levels =
        results.sweep.factors.iter().map(|pointer| pointer.trim_start_matches('/').replace('/', "."));
    let has = |name: &str| results.trials.iter().any(|trial| trial.responses.contains_key(name));
    let mut shown: Vec<&str> = SHOWN.into_iter().filter(|name| has(name)).collect();
    if shown.is_empty() {
        shown = SHOWN[..5].to_vec();
    }
    let names = shown.iter().map(|name| (*name).to_owned());
    let mut table = Table::new(levels.chain(["seed".to_owned(), "state".to_owned()]).chain(names));
    for trial in &results.trials {
        let levels = results.sweep.factors.iter().map(|pointer| format::cell(&trial.factors[pointer]));
        let state = match trial.failure_class {
            Some(class) => format!("{}: {class}", trial.state),
            None => trial.state.to_string(),
        };
        let responses =
            shown.iter().map(|name| format::cell(trial.responses.get(*name).unwrap_or(&Value::Null)));
        table.row(levels.chain([trial.seed.to_string(), state]).chain(responses).collect::<Vec<_>>());
    }
    table
}
