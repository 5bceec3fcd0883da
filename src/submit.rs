//! `roost submit`: submit a scenario, a job or a sweep to the server.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::job::{FailureClass, JobState, JobView};
use roost_api::sweep::SweepView;
use roost_solver::Limits;
use roost_terminal::{BadInput, Exit, input, message, print_json, print_line, signals};
use roost_worker::client::ClientError;
use serde_json::{Value, json};

use crate::document::DocumentKind;
use crate::{meshes, target, watch};

/// Submit a scenario or a sweep to a server
///
/// The command first uploads the STL files that the server does not have.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// JSON file with a scenario, or with a sweep (which has a `base`); `-` reads stdin
    file: PathBuf,
    #[command(flatten)]
    server: target::Server,
    /// Wait until all jobs have ended, and show a progress bar
    #[arg(long)]
    wait: bool,
    /// Priority of the jobs. Workers claim jobs with a higher priority first
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    priority: Option<i32>,
    /// Maximum real time of each attempt. An attempt is one try of a worker to simulate the job
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    max_wall_s: Option<f64>,
    /// Record frames, with this simulated time between two frames. `roost results --frames` downloads the frames of a job
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    frame_interval: Option<f64>,
    /// Simulate the scenario even if the server has a result of the same scenario
    #[arg(long)]
    no_cache: bool,
    /// Use no filled states (hoppers after the fill) of other jobs, and store no filled states, so that each job fills its own hopper
    #[arg(long)]
    no_shared_fill: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The server has its own limits.
pub(crate) const NO_LIMITS: Limits = Limits { max_subparticles: u64::MAX, max_steps: u64::MAX };

/// Submissions of as many jobs take seconds and are announced.
const MANY_JOBS: u64 = 10_000;

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let resolved = meshes::resolve(&args.file, input::read_document(&args.file)?).checked(&args.file)?;
    let mut document = resolved.document.clone();
    let kind = DocumentKind::of(&document);
    let other = match kind {
        DocumentKind::Study => Some("study; `roost study submit` takes studies"),
        DocumentKind::Measurements => Some("document of measurements; `roost validate` checks measurements"),
        DocumentKind::Scenario | DocumentKind::Job | DocumentKind::Sweep => None,
    };
    if let Some(other) = other {
        let name = input::display_name(&args.file);
        return Err(BadInput(format!("{name} is a {other}")).into());
    }
    if kind == DocumentKind::Scenario {
        document = json!({ "scenario": document });
    }
    add_options(&mut document, &args);
    let client = args.server.client()?;
    // The server keeps uploaded meshes, so an invalid document must not upload any.
    if resolved.is_self_contained() {
        let report =
            roost_server::validate(resolved.document.clone(), &resolved.meshes, &NO_LIMITS, u64::MAX);
        let report = report.map_err(|faults| input::faults_error(&args.file, &faults))?;
        if report.jobs >= MANY_JOBS {
            message!("submitting {} jobs: this takes a second or more per 10,000", report.jobs);
        }
    }
    resolved.upload(&client).await?;
    let to_error = |error| submission_error(&args.file, kind, error);
    if kind == DocumentKind::Sweep {
        let mut sweep: SweepView = client.submit_document("sweeps", &document).await.map_err(to_error)?;
        let id = sweep.id;
        if !args.json || args.wait {
            message!("sweep {id}: {} jobs", sweep.counts.total());
        }
        if args.wait {
            sweep = watch::sweep(&client, id, &signals::shutdown_token()?).await?;
        }
        print_id(&args, &json!(sweep), &id.to_string())?;
        Ok(if args.wait { watch::exit_of_sweep(&client, &sweep).await? } else { Exit::Done })
    } else {
        let mut job: JobView = client.submit_document("jobs", &document).await.map_err(to_error)?;
        let id = job.id;
        if args.wait {
            message!("job {id}");
        }
        if args.wait {
            job = watch::job(&client, id, &signals::shutdown_token()?).await?;
        }
        print_id(&args, &json!(job), &id.to_string())?;
        Ok(if args.wait { exit_of_job(&job) } else { Exit::Done })
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if f64::is_finite(seconds) && seconds > 0.0 => Ok(seconds),
        _ => Err("write a number of seconds above 0".to_owned()),
    }
}

/// The exit code of a job.
fn exit_of_job(job: &JobView) -> Exit {
    match (job.state, job.failure_class) {
        (JobState::Succeeded, _) => Exit::Done,
        (_, Some(FailureClass::Unstable)) => Exit::Unstable,
        _ => {
            if let Some(message) = &job.failure_message {
                message!("{}: {message}", job.state);
            }
            Exit::Failed
        }
    }
}

/// An error with the faults from the server. Pointers lead into the file, which has no envelope around the scenario.
pub(crate) fn submission_error(file: &Path, kind: DocumentKind, error: ClientError) -> anyhow::Error {
    let ClientError::Problem(problem) = &error else { return error.into() };
    if problem.errors.is_empty() {
        return error.into();
    }
    let mut faults = problem.errors.clone();
    if kind == DocumentKind::Scenario {
        for fault in &mut faults {
            if let Some(inner) = fault.pointer.strip_prefix("/scenario") {
                fault.pointer = inner.to_owned();
            }
        }
    }
    input::faults_error(file, &faults).into()
}

fn add_options(document: &mut Value, args: &Args) {
    let Some(fields) = document.as_object_mut() else { return };
    let mut set = |name: &str, value: Value| fields.insert(name.to_owned(), value);
    if let Some(priority) = args.priority {
        set("priority", json!(priority));
    }
    if let Some(seconds) = args.max_wall_s {
        set("max_wall_s", json!(seconds));
    }
    if let Some(seconds) = args.frame_interval {
        set("frame_interval_s", json!(seconds));
    }
    if args.no_cache {
        set("cache", json!("bypass"));
    }
    if args.no_shared_fill {
        set("shared_fill", json!(false));
    }
}

/// Prints the id on stdout, for scripts, and the next commands on stderr.
fn print_id(args: &Args, view: &Value, id: &str) -> Result<()> {
    if args.json {
        print_json(view)?;
        return Ok(());
    }
    print_line(format_args!("{id}"))?;
    if !args.wait {
        message!("next: roost status {id}");
    }
    message!("      roost results {id}");
    Ok(())
}
