//! `roost study ask` and `roost study tell`: runs that a script makes, in place of jobs of the server.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::ask::{Asked, HandedOut};
use roost_api::ids::SweepId;
use roost_api::study::StudyState;
use roost_terminal::{BadInput, Exit, Table, input, message, print_json, print_line, print_lines};
use serde_json::{Value, json};
use uuid::Uuid;

use super::show;
use crate::document::DocumentKind;
use crate::submit::submission_error;
use crate::target;

/// Ask a study for its next runs, so that your own program can compute them
///
/// For each run, the command prints the number of the run, the values of the factors, and the seed. Give the outcomes of these runs
/// to the study with `roost study tell`. The study waits for these outcomes for at most a day.
#[derive(Debug, clap::Args)]
pub(crate) struct Ask {
    /// Id of a study
    #[arg(value_parser = target::study_id)]
    id: SweepId,
    #[command(flatten)]
    server: target::Server,
    /// Maximum number of runs, 1 to 100
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    count: u32,
    /// Print JSON, which also has the complete scenario of each run
    #[arg(long)]
    json: bool,
}

/// Tell a study the outcomes of runs that your own program has computed
///
/// The file has a list `outcomes`. Each outcome belongs to one run. For a run from `roost study ask`, the outcome has the number
/// `run`. For a run that you chose yourself, the outcome has `values` and a `seed`. Each outcome also has one of these three:
/// `responses` with the results, `"failed": true` for a run that failed, or `"given_back": true` for a run that you will not compute.
/// If you repeat the command with the same file, the study does not change.
#[derive(Debug, clap::Args)]
pub(crate) struct Tell {
    /// Id of a study
    #[arg(value_parser = target::study_id)]
    id: SweepId,
    /// JSON file such as {"outcomes": [{"run": 1, "responses": {"jammed": 0}}]}; `-` reads stdin
    file: PathBuf,
    #[command(flatten)]
    server: target::Server,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn ask(args: Ask) -> Result<Exit> {
    let request = roost_api::ask::Ask { count: Some(args.count), ..roost_api::ask::Ask::default() };
    // Two commands get different runs.
    let asked = args.server.client()?.ask_study(args.id, &request, &Uuid::new_v4().to_string()).await?;
    if args.json {
        print_json(&json!(asked))?;
    } else if asked.runs.is_empty() {
        message!("{}", why_none(&asked));
    } else {
        print_lines(table(&asked.study.factors, &asked.runs))?;
        message!("next: roost study tell {} FILE", args.id);
    }
    Ok(Exit::Done)
}

/// Why a study has no run to make, and what to do.
fn why_none(asked: &Asked) -> String {
    let (id, runs) = (asked.study.id, asked.study.runs);
    match asked.study.state {
        StudyState::Finished => format!("the study is finished: roost study show {id}"),
        _ if runs.pending > 0 => format!(
            "no run comes next before the outcomes of {} in flight are told: roost study tell {id} FILE",
            runs.pending
        ),
        _ => format!("the study has no run to make: roost study show {id}"),
    }
}

/// The runs with the values of the factors.
fn table(factors: &[String], runs: &[HandedOut]) -> Table {
    let mut table =
        Table::new(["run"].into_iter().chain(factors.iter().map(String::as_str)).chain(["seed", "expires"]));
    for run in runs {
        let value = |factor: &String| match run.values.get(factor) {
            Some(Value::String(word)) => word.clone(),
            value => json!(value).to_string(),
        };
        let values = factors.iter().map(value);
        let (first, last) = (run.run.to_string(), [run.seed.to_string(), run.expires_at.to_string()]);
        table.row([first].into_iter().chain(values).chain(last));
    }
    table
}

pub(crate) async fn tell(args: Tell) -> Result<Exit> {
    let document = read(&args.file)?;
    let told = args.server.client()?.tell_study(args.id, &document).await;
    let told = told.map_err(|error| submission_error(&args.file, DocumentKind::Study, error))?;
    if args.json {
        print_json(&json!(told))?;
        return Ok(Exit::Done);
    }
    let repeated = match told.repeated {
        0 => String::new(),
        repeated => format!(", {repeated} told before"),
    };
    print_line(format_args!("{} recorded{repeated}; {}", told.recorded, show::runs(&told.study)))?;
    message!("next: roost study ask {}", args.id);
    Ok(Exit::Done)
}

/// Reads a file with outcomes.
fn read(file: &Path) -> Result<Value> {
    let document = input::read_document(file)?;
    if document.get("outcomes").is_some() {
        return Ok(document);
    }
    let form = r#"write {"outcomes": [{"run": 1, "responses": {"jammed": 0}}]}"#;
    Err(BadInput(format!("{} has no `outcomes`: {form}", input::display_name(file))).into())
}
