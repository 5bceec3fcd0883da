//! `roost demo`: a small sweep with its table and plot, on a fresh machine.
//!
//! The demo takes no shortcut: the server has a real database, the worker claims over HTTP, and all results come through the API.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::RunResult;
use roost_api::quantity::Quantity;
use roost_api::sweep::SweepView;
use roost_api::table::SweepResults;
use roost_server::ServerConfig;
use roost_terminal::plot::{self, Curve, Panel, Style};
use roost_terminal::{Exit, Table, format, message, print_line, print_lines, signals};
use roost_worker::WorkerConfig;
use roost_worker::client::Client;
use serde_json::{Value, json};
use tokio_util::sync::CancellationToken;

use crate::farm::Farm;
use crate::{output, watch, work};

/// Gate opening × surface condition, on a slice of the paper's hopper.
const SWEEP: &str = include_str!("sweep.json");

/// Headings of the table, and their responses.
const RESPONSES: [(&str, &str); 6] = [
    ("regime", "regime"),
    ("jammed", "jammed"),
    ("filled (kg)", "filled_kg"),
    ("out at 4 s (kg)", "discharged_kg_at_4s"),
    ("95 % out after (s)", "time_to_95_percent_s"),
    ("mean rate (kg/s)", "mean_rate_kg_s"),
];

/// Run a demonstration: server, worker and a sweep of four simulations
///
/// The command starts a server and a worker in this process. It submits a sweep that varies two inputs of a hopper: the gate opening,
/// and the surface condition (dry or wet). The command shows the progress of the sweep. At the end, it prints a table of results and
/// plots the discharge curves.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Exit after the sweep. Without this option, the server continues to run
    #[arg(long)]
    exit: bool,
    /// Folder for the database, the plot and the results
    #[arg(short, long, default_value = "demo-out", value_name = "DIR")]
    output: PathBuf,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    let server = ServerConfig {
        listen: ([127, 0, 0, 1], 0).into(),
        data: args.output.join("data"),
        ..ServerConfig::default()
    };
    let state = args.output.join("worker");
    let mut farm =
        Farm::start(server, |address| WorkerConfig::new(address, work::host_name(), state)).await?;
    message!("server at {}, database in {}", farm.address, args.output.join("data").display());
    let client = Client::new(&farm.address)?;
    let outcome = tokio::select! {
        outcome = run_sweep(&client, &args.output, &shutdown) => outcome,
        error = farm.failure() => return Err(error),
    };
    if outcome.is_ok() && !args.exit {
        message!("");
        message!("The server continues at {}; Ctrl-C stops it.", farm.address);
        shutdown.cancelled().await;
    }
    farm.stop().await?;
    outcome
}

/// Submits the sweep, follows it, and prints its results.
async fn run_sweep(client: &Client, folder: &Path, shutdown: &CancellationToken) -> Result<Exit> {
    cancel_earlier_sweeps(client).await?;
    let document: Value = serde_json::from_str(SWEEP)?;
    let sweep: SweepView = client.submit_document("sweeps", &document).await?;
    message!("sweep {}: {} points of gate opening × surface condition", sweep.id, sweep.points);
    let sweep = watch::sweep(client, sweep.id, shutdown).await?;
    let results = client.sweep_results(sweep.id).await?;
    let csv = folder.join("results.csv");
    std::fs::write(&csv, client.sweep_table(sweep.id, &[("format", "csv")]).await?)?;
    let plot_file = folder.join("discharge.svg");
    let runs = run_results(client, &results).await?;
    let panel = Panel {
        x_label: "time from belt start (s)".to_owned(),
        y_label: "discharged mass (kg)".to_owned(),
        curves: curves(&results, &runs),
        ..Panel::default()
    };
    plot::write_svg(&plot_file, "Discharge by gate opening and surface condition", &[panel])?;
    print_lines(format_args!("\n{}\n", table(&results, &runs)))?;
    print_line(format_args!("plot:  {}", plot_file.display()))?;
    print_line(format_args!("table: {}", csv.display()))?;
    watch::exit_of_sweep(client, &sweep).await
}

/// Cancels the unfinished sweep of an earlier demo in the same folder, which would run first.
async fn cancel_earlier_sweeps(client: &Client) -> Result<()> {
    for sweep in client.sweeps(None, 100).await?.items {
        if !sweep.counts.is_ended() {
            client.cancel_sweep(sweep.id).await?;
        }
    }
    Ok(())
}

/// The result of each trial that has one.
async fn run_results(client: &Client, results: &SweepResults) -> Result<Vec<Option<RunResult>>> {
    let mut runs = Vec::with_capacity(results.trials.len());
    for trial in &results.trials {
        runs.push(match client.job_result(trial.job_id).await {
            Ok(run) => Some(run),
            Err(error) if error.problem_status().is_some() => None,
            Err(error) => return Err(error.into()),
        });
    }
    Ok(runs)
}

fn table(results: &SweepResults, runs: &[Option<RunResult>]) -> Table {
    let factors = results.sweep.factors.iter().map(|pointer| Quantity::of_field(pointer).label());
    let names = RESPONSES.iter().map(|(name, _)| (*name).to_owned());
    let mut table = Table::new(factors.chain(names).chain(["ended".to_owned()]));
    for (trial, run) in results.trials.iter().zip(runs) {
        let levels = results.sweep.factors.iter().map(|pointer| format::cell(&trial.factors[pointer]));
        let responses = RESPONSES
            .iter()
            .map(|(_, name)| format::cell(trial.responses.get(*name).unwrap_or(&Value::Null)));
        let ended = match (run, trial.failure_class) {
            (_, Some(class)) => class.to_string(),
            (Some(run), None) => format::cell(&json!(run.end_reason)),
            (None, None) => trial.state.to_string(),
        };
        table.row(levels.chain(responses).chain([ended]).collect::<Vec<_>>());
    }
    table
}

/// One curve per trial: the first factor decides the colour, the second the dash pattern.
fn curves(results: &SweepResults, runs: &[Option<RunResult>]) -> Vec<Curve> {
    let mut levels_seen: Vec<Vec<Value>> = vec![Vec::new(); results.sweep.factors.len()];
    let mut curves = Vec::new();
    for (trial, run) in results.trials.iter().zip(runs) {
        let mut indices = results.sweep.factors.iter().zip(&mut levels_seen).map(|(pointer, seen)| {
            let level = &trial.factors[pointer];
            seen.iter().position(|other| other == level).unwrap_or_else(|| {
                seen.push(level.clone());
                seen.len() - 1
            })
        });
        let style = Style { colour: indices.next().unwrap_or(0), dash: indices.next().unwrap_or(0) };
        let levels = results.sweep.factors.iter().map(|pointer| level(pointer, &trial.factors[pointer]));
        let label = levels.collect::<Vec<_>>().join(", ");
        let points = output::points(run.as_ref().and_then(|run| run.series("discharged_mass")));
        curves.push(Curve { label, style, points, ..Curve::default() });
    }
    curves
}

/// A level in the legend: lengths in centimetres, texts unchanged.
fn level(pointer: &str, value: &Value) -> String {
    match value.as_f64() {
        Some(metres) if pointer.ends_with("_m") => format!("{} cm", format::significant(metres * 100.0)),
        _ => format::cell(value),
    }
}

#[cfg(test)]
mod tests {
    use roost_api::sweep::SweepSpec;
    use roost_solver::scenario;

    use super::*;

    #[test]
    fn demo_sweep_is_valid() {
        let sweep: SweepSpec = serde_json::from_str(SWEEP).unwrap();
        scenario::from_value(&sweep.base).unwrap();
        assert_eq!(
            sweep.factors.iter().map(|factor| factor.levels.as_ref().map_or(0, Vec::len)).product::<usize>(),
            4
        );
    }

    #[test]
    fn levels_are_readable() {
        assert_eq!(level("/equipment/gate_opening_m", &0.045.into()), "4.5 cm");
        assert_eq!(level("/contact/condition", &"wet".into()), "wet");
    }
}
