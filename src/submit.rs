//! `roost submit`: a scenario, a job or a sweep goes to the server.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::job::{FailureClass, JobState, JobView};
use roost_api::sweep::SweepView;
use roost_solver::Limits;
use roost_worker::client::ClientError;
use serde_json::{Value, json};

use crate::exit::Exit;
use crate::input::{self, Kind};
use crate::ui;
use crate::{meshes, signals, target, watch};

/// Submit a scenario or a sweep to a server
///
/// STL files that it names are uploaded first, unless the server has them.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A JSON file with a scenario, or a sweep (it has a `base`); `-` reads stdin
    file: PathBuf,
    #[command(flatten)]
    server: target::Server,
    /// Stay until it has ended, with a progress bar
    #[arg(long)]
    wait: bool,
    /// Higher is claimed first
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    priority: Option<i32>,
    /// Longest wall time of each run
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    max_wall_s: Option<f64>,
    /// Record frames so far apart in simulated time; `roost results --frames` fetches those of a job
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    frame_interval: Option<f64>,
    /// Run it even if the result of the same scenario is there already
    #[arg(long)]
    no_cache: bool,
    /// Print the answer as JSON
    #[arg(long)]
    json: bool,
}

/// How much is too much is the server's to say.
const NO_LIMITS: Limits = Limits { max_subparticles: u64::MAX, max_steps: u64::MAX };

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let named = meshes::resolve(&args.file, input::read(&args.file)?).checked(&args.file)?;
    let mut document = named.document.clone();
    let kind = Kind::of(&document);
    if kind == Kind::Scenario {
        document = json!({ "scenario": document });
    }
    add_options(&mut document, &args);
    let client = args.server.client()?;
    // Meshes stay on a server for good: those of a document that it would refuse anyway do not get there.
    if named.is_self_contained() {
        let report = roost_server::validate(named.document.clone(), &named.meshes, &NO_LIMITS, u64::MAX);
        report.map_err(|faults| input::faults(&args.file, &faults))?;
    }
    named.upload(&client).await?;
    let refused = |error| refusal(&args.file, kind, error);
    if kind == Kind::Sweep {
        let mut sweep: SweepView = client.submit_document("sweeps", &document).await.map_err(refused)?;
        let id = sweep.id;
        if !args.json || args.wait {
            ui::say!("sweep {id}: {} jobs", sweep.counts.total());
        }
        if args.wait {
            sweep = watch::sweep(&client, id, &signals::shutdown()?).await?;
        }
        tell(&args, &json!(sweep), &id.to_string())?;
        Ok(if args.wait { watch::exit_of_sweep(&client, &sweep).await? } else { Exit::Done })
    } else {
        let mut job: JobView = client.submit_document("jobs", &document).await.map_err(refused)?;
        let id = job.id;
        if args.wait {
            ui::say!("job {id}");
        }
        if args.wait {
            job = watch::job(&client, id, &signals::shutdown()?).await?;
        }
        tell(&args, &json!(job), &id.to_string())?;
        Ok(if args.wait { exit_of_job(&job) } else { Exit::Done })
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if f64::is_finite(seconds) && seconds > 0.0 => Ok(seconds),
        _ => Err("give a number of seconds above 0".to_owned()),
    }
}

/// How a job's end reads as an exit code.
fn exit_of_job(job: &JobView) -> Exit {
    match (job.state, job.failure_class) {
        (JobState::Succeeded, _) => Exit::Done,
        (_, Some(FailureClass::Unstable)) => Exit::Unstable,
        _ => {
            if let Some(message) = &job.failure_message {
                ui::say!("{}: {message}", job.state);
            }
            Exit::Failed
        }
    }
}

/// The faults that the server found, with pointers into the file: the envelope around a scenario is ours.
fn refusal(file: &Path, kind: Kind, error: ClientError) -> anyhow::Error {
    let ClientError::Problem(problem) = &error else { return error.into() };
    if problem.errors.is_empty() {
        return error.into();
    }
    let mut faults = problem.errors.clone();
    if kind == Kind::Scenario {
        for fault in &mut faults {
            if let Some(inner) = fault.pointer.strip_prefix("/scenario") {
                fault.pointer = inner.to_owned();
            }
        }
    }
    input::faults(file, &faults).into()
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
}

/// The id alone on stdout, so that a script can keep it; what to do next on stderr.
fn tell(args: &Args, view: &Value, id: &str) -> Result<()> {
    if args.json {
        ui::json(view)?;
        return Ok(());
    }
    ui::println(format_args!("{id}"))?;
    if !args.wait {
        ui::say!("next: roost status {id}");
    }
    ui::say!("      roost results {id}");
    Ok(())
}
