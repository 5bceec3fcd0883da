//! `roost results`: the table of a sweep, or the result of a job.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::ValueEnum;
use roost_api::RunResult;
use roost_api::ids::SweepId;
use roost_api::short_names::short_names;
use roost_api::table::{SweepPoints, SweepResults};
use roost_solver::experiments::{is_indicator, outputs_of};
use roost_terminal::{BadInput, Exit, Table, format, message, print_content};
use roost_worker::client::{Client, ClientError};
use serde_json::{Value, json};
use uuid::Uuid;

use crate::target::{self, Target};
use crate::{output, run};

/// Print the results of a sweep or a job
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep or a job
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// Format of the results. `table` is a short table with only the main responses. All other formats have all responses; `xlsx` is
    /// an Excel workbook
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
    /// Rows of the results. A design point is one combination of the values of all factors. Its replicates are runs with different
    /// seeds. With `trial`, each replicate has a row. With `point`, each design point has a row, with means and 95 % intervals over
    /// its replicates
    #[arg(long, value_enum, default_value_t = By::Trial)]
    by: By,
    /// Names of the columns with inputs: JSON pointers such as /equipment/gate_opening_m, or short names such as gate_opening_m. A
    /// short name is the end of the pointer. If this end belongs to several pointers, the short name is longer [default: short for
    /// xlsx, pointer for all other formats]
    #[arg(long, value_enum)]
    names: Option<Names>,
    /// Add a second header line with the units; this option requires `--format csv`
    #[arg(long)]
    units: bool,
    /// Write the results to this file instead of stdout
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Download the frames of a job into this file
    #[arg(long, value_name = "FILE", conflicts_with_all = ["format", "by", "names", "units", "output"])]
    frames: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Table,
    Json,
    Csv,
    Parquet,
    Xlsx,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Names {
    Pointer,
    Short,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum By {
    Trial,
    Point,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    check(&args)?;
    let client = args.server.client()?;
    let target = target::find(&client, args.id).await?;
    if let Some(file) = &args.frames {
        return download_frames(&client, &target, file).await;
    }
    let content = match target {
        Target::Sweep(sweep) => sweep_content(&client, sweep.id, &args).await?,
        Target::Job(job) => {
            let result = match client.job_result(job.id).await {
                Ok(result) => result,
                // The job exists without a result, so the id is no bad input.
                Err(ClientError::Problem(problem)) if problem.status == 404 => {
                    message!("error: {}", problem.detail);
                    return Ok(Exit::Failed);
                }
                Err(error) => return Err(error.into()),
            };
            if result.is_of_earlier_form() {
                message!(
                    "an earlier version simulated this job: `scenario` is in the present form, `scenario_digest` of the form at that time"
                );
            }
            job_content(&result, &args)?
        }
    };
    write(args.output.as_deref(), &content)?;
    Ok(Exit::Done)
}

/// Refuses options that the format does not have.
fn check(args: &Args) -> Result<(), BadInput> {
    let is_binary = matches!(args.format, Format::Parquet | Format::Xlsx);
    let refusal = if is_binary && args.output.is_none() && std::io::stdout().is_terminal() {
        "Parquet and xlsx cannot be shown in a terminal; add -o FILE"
    } else if args.names.is_some() && matches!(args.format, Format::Table | Format::Json) {
        "--names is for --format csv, parquet and xlsx"
    } else if args.units && args.format != Format::Csv {
        "--units is for --format csv; xlsx has a sheet of units"
    } else {
        return Ok(());
    };
    Err(BadInput(refusal.to_owned()))
}

/// Downloads the frames of a job into a file.
async fn download_frames(client: &Client, target: &Target, file: &Path) -> Result<Exit> {
    let Target::Job(job) = target else {
        return Err(BadInput(
            "a sweep has no frames; give the id of one of its jobs (`roost list --jobs`)".to_owned(),
        )
        .into());
    };
    let Some(frames) = &job.frames else {
        message!(
            "error: the job is {} and has no frames; `roost submit --frame-interval` records frames",
            job.state
        );
        return Ok(Exit::Failed);
    };
    client.download_frames(job.id, file).await?;
    let stopped = frames.stopped.as_ref().map(|reason| format!("; {reason}")).unwrap_or_default();
    message!("{} frames, {:.1} MB, in {}{stopped}", frames.count, frames.bytes as f64 / 1e6, file.display());
    Ok(Exit::Done)
}

/// The word of an option's value.
fn word(value: impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

async fn sweep_content(client: &Client, id: SweepId, args: &Args) -> Result<Vec<u8>> {
    Ok(match (args.format, args.by) {
        (Format::Csv | Format::Parquet | Format::Xlsx, by) => {
            let (format, by, names) = (word(args.format), word(by), args.names.map(word));
            let mut query = vec![("format", format.as_str()), ("by", &by)];
            query.extend(names.as_deref().map(|names| ("names", names)));
            query.extend(args.units.then_some(("units", "true")));
            client.sweep_table(id, &query).await?
        }
        (Format::Json, By::Trial) => format!("{:#}\n", json!(client.sweep_results(id).await?)).into(),
        (Format::Json, By::Point) => format!("{:#}\n", json!(client.sweep_points(id).await?)).into(),
        (Format::Table, By::Trial) => {
            trials(&client.sweep_results(id).await?, &headline(client, id).await?).to_string().into()
        }
        (Format::Table, By::Point) => {
            points(&client.sweep_points(id).await?, &headline(client, id).await?).to_string().into()
        }
    })
}

fn job_content(result: &RunResult, args: &Args) -> Result<Vec<u8>> {
    if args.names.is_some() || args.units {
        let refusal = "--names and --units are for a sweep; the columns of a job's series end in their units";
        return Err(BadInput(refusal.to_owned()).into());
    }
    let mut content = Vec::new();
    match args.format {
        Format::Json => content = format!("{:#}\n", json!(result)).into(),
        Format::Csv => output::series_csv(&mut content, &result.series)?,
        Format::Table => content = run::responses_text(result).into(),
        Format::Parquet | Format::Xlsx => {
            let refusal = "the result of a job has neither Parquet nor xlsx as format; use json or csv";
            return Err(BadInput(refusal.to_owned()).into());
        }
    }
    Ok(content)
}

/// Writes to a file, or to stdout.
fn write(file: Option<&Path>, content: &[u8]) -> Result<()> {
    match file {
        None => print_content(content)?,
        Some(path) => std::fs::write(path, content)
            .map_err(|error| BadInput(format!("cannot write {}: {error}", path.display())))?,
    }
    Ok(())
}

/// The headline responses of a sweep's experiment; all other formats have all responses.
pub(crate) async fn headline(client: &Client, sweep: SweepId) -> Result<Vec<&'static str>> {
    let spec = client.sweep_spec(sweep).await?;
    let outputs = spec["base"]["experiment"].as_str().and_then(outputs_of);
    let headline = outputs.into_iter().flat_map(|outputs| outputs.responses).filter(|row| row.headline);
    Ok(headline.map(|row| row.name).collect())
}

/// One row per trial: levels, seed, state and the headline responses.
fn trials(results: &SweepResults, shown: &[&str]) -> Table {
    let factors = &results.sweep.factors;
    let names = shown.iter().map(|name| (*name).to_owned());
    let head = short_names(factors).into_iter();
    let mut table = Table::new(head.chain(["seed".to_owned(), "state".to_owned()]).chain(names));
    for trial in &results.trials {
        let levels = factors.iter().map(|name| format::cell(&trial.factors[name]));
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

/// One row per design point: levels, number of succeeded trials, and the headline responses with their intervals.
fn points(results: &SweepPoints, shown: &[&str]) -> Table {
    let factors = &results.sweep.factors;
    let names = shown.iter().map(|name| (*name).to_owned());
    let head = ["point".to_owned()].into_iter().chain(short_names(factors));
    let counts = ["done", "unstable"].map(str::to_owned);
    let mut table = Table::new(head.chain(counts).chain(names));
    for point in &results.points {
        let levels = factors.iter().map(|name| format::cell(&point.factors[name]));
        let done = format!("{} of {}", point.counts.succeeded, point.counts.total());
        let responses = shown.iter().map(|name| match point.responses.get(*name) {
            Some(summary) => format::summary(summary, is_indicator(name)),
            None => "–".to_owned(),
        });
        let cells = [point.point.to_string()].into_iter().chain(levels);
        table.row(cells.chain([done, point.unstable.to_string()]).chain(responses).collect::<Vec<_>>());
    }
    table
}
