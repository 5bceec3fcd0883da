//! `roost run`: simulate one scenario without a server.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::job::AttemptOutcome;
use roost_api::printable::one_line;
use roost_api::{Phase, Progress, RunResult};
use roost_solver::result::EndReason;
use roost_solver::{Limits, scenario};
use roost_terminal::progress::Bar;
use roost_terminal::{
    BadInput, Exit, Table, format, input, message, print_json, print_line, print_lines, signals, threads,
};
use roost_worker::runner::{Extras, Resources, Run, RunEnd};
use roost_worker::stop::Stop;
use serde_json::json;
use tokio_util::sync::CancellationToken;

use crate::checkpoints::CheckpointArgs;
use crate::device::DeviceArgs;
use crate::document::DocumentKind;
use crate::frames::{FrameArgs, Frames};
use crate::{frames, meshes, output};

/// Simulate one scenario without a server
///
/// The command writes the files result.json, series.csv and curve.svg. After Ctrl-C, the command stops the simulation and writes the
/// result up to this time. If you used --checkpoint-every, repeat the same command to continue the simulation.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// JSON file with the scenario; `-` reads stdin
    scenario: PathBuf,
    /// Folder for the result
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Number of threads to use; 0 means one thread per processor
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads::value_parser())]
    threads: u16,
    #[command(flatten)]
    device: DeviceArgs,
    /// Seed that replaces the seed of the scenario
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Print a summary as JSON instead of a table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    frames: FrameArgs,
    #[command(flatten)]
    checkpoints: CheckpointArgs,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let mut document = input::read_document(&args.scenario)?;
    // Installed before any file is written: from here on a signal stops the run in good order.
    let shutdown = signals::shutdown_token()?;
    if let (Some(seed), Some(fields)) = (args.seed, document.as_object_mut()) {
        fields.insert("seed".to_owned(), json!(seed));
    }
    let other = match DocumentKind::of(&document) {
        DocumentKind::Sweep => Some("sweep; `roost run` takes one scenario, and `roost submit` takes sweeps"),
        DocumentKind::Study => {
            Some("study; `roost run` takes one scenario, and `roost study run` takes studies")
        }
        DocumentKind::Measurements => Some(
            "document of measurements; `roost run` takes one scenario, and `roost validate` checks measurements",
        ),
        DocumentKind::Scenario | DocumentKind::Job => None,
    };
    if let Some(other) = other {
        let name = input::display_name(&args.scenario);
        return Err(BadInput(format!("{name} is a {other}")).into());
    }
    let resolved = meshes::resolve(&args.scenario, document).without_server();
    let faults_error = |faults: Vec<_>| input::faults_error(&args.scenario, &resolved.with_faults(faults));
    let scenario = scenario::from_value(&resolved.document).map_err(faults_error)?;
    let checked =
        roost_solver::check(&scenario, &resolved.meshes, &Limits::default()).map_err(faults_error)?;
    let estimate = checked.estimate();
    for warning in &estimate.warnings {
        message!("warning: {warning}");
    }
    // Errors of the device and the folder come before the simulation.
    let device = args.device.open()?;
    if device.backend() == "cpu" {
        threads::warn_if_too_many(args.threads);
    }
    let resources = Resources::new(device, args.threads.into());
    output::check_writable(&args.output)?;
    message!(
        "{} fillets, {} sub-particles, at most {} steps of {} s",
        estimate.fillets,
        estimate.subparticles,
        estimate.steps,
        format::significant(estimate.timestep_s),
    );
    let mut frames = args.frames.prepare(&scenario, estimate)?;
    let pictures = frames.as_ref().map(Frames::pictures);
    let (mut checkpoints, extras) =
        args.checkpoints.prepare(&args.output, &resources.device, &checked, pictures.is_some())?;
    let run = Run::start_checked(checked, resources, Extras { frames: pictures, ..extras });
    let warning = || frames.as_mut().and_then(Frames::warning).or_else(|| checkpoints.warning());
    let end = follow(run, &shutdown, warning).await;
    checkpoints.close().await;
    let report = frames.as_mut().map(Frames::finish);
    let (result, exit) = match end {
        RunEnd::Finished(result) => (result, Exit::Done),
        RunEnd::Failed { outcome, message, result: Some(result) } => {
            message!("{outcome}: {message}");
            let exit = if outcome == AttemptOutcome::Unstable { Exit::Unstable } else { Exit::Failed };
            (result, exit)
        }
        RunEnd::Failed { outcome, message, result: None } => anyhow::bail!("{outcome}: {message}"),
        RunEnd::Abandoned => anyhow::bail!("the run was abandoned"),
    };
    let mut files = output::write(&args.output, &result)?;
    checkpoints.finish(result.end_reason != EndReason::Cancelled);
    files.extend(report.iter().flat_map(|report| report.files.iter().cloned()));
    if args.json {
        let mut summary = summary(&result, &files);
        if let Some(report) = &report {
            summary["frames"] = frames::summary(report);
        }
        print_json(&summary)?;
    } else {
        print_lines(format_args!("{}", responses_text(&result)))?;
        print_line("")?;
        print_line(files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join("  "))?;
    }
    Ok(exit)
}

/// Follows a run to its end with a progress bar, and prints warnings above it. A signal stops the run.
async fn follow(
    mut run: Run,
    shutdown: &CancellationToken,
    mut warning: impl FnMut() -> Option<String>,
) -> RunEnd {
    let mut bar = Bar::new("simulating");
    let mut last = None;
    loop {
        tokio::select! {
            () = shutdown.cancelled(), if run.stop.get().is_none() => run.stop.set(Stop::Cancel),
            changed = run.progress.changed() => {
                if changed.is_err() {
                    break;
                }
                last = run.progress.borrow_and_update().clone();
                if let Some(progress) = &last {
                    bar.update(progress.fraction, &describe(progress));
                }
                if let Some(warning) = warning() {
                    bar.message(&warning);
                }
            }
        }
    }
    let end = run.end().await;
    match last {
        Some(progress) => {
            let fraction = if matches!(end, RunEnd::Finished(_)) { 1.0 } else { progress.fraction };
            bar.finish(fraction, &format!("{} of wall time", format::duration(progress.wall_s)));
        }
        None => bar.clear(),
    }
    end
}

/// Phase, simulated time, time left and rates as one line.
pub(crate) fn describe(progress: &Progress) -> String {
    let phase = match progress.phase {
        Phase::Fill => format!("filling and settling, {:.2} s", progress.simulated_s),
        Phase::Process if progress.discharged_kg > 0.0 => {
            format!("t = {:.2} s, {:.2} kg out", progress.time_s, progress.discharged_kg)
        }
        Phase::Process => format!("t = {:.2} s", progress.time_s),
    };
    let wall_s = progress.wall_s.max(1e-3);
    let left = format::time_left(progress.fraction, progress.wall_s);
    let left = left.map(|left| format!(" · {left}")).unwrap_or_default();
    let rate = format::significant(progress.simulated_s / wall_s);
    let work = format::count(progress.particle_steps as f64 / wall_s);
    format!("{phase}{left} · {rate} × real time · {work} particle-steps/s")
}

/// The responses and the warnings, one per line.
pub(crate) fn responses_text(result: &RunResult) -> String {
    let mut text = responses_table(result).to_string();
    for roost_solver::result::Warning { code, message } in &result.warnings {
        text.push_str(&format!("{}\n", one_line(&format!("warning [{code}]: {message}"))));
    }
    text
}

fn responses_table(result: &RunResult) -> Table {
    let mut table = Table::new(["response", "value"]);
    table.row(["end_reason".to_owned(), format::cell(&json!(result.end_reason))]);
    for (name, value) in &result.responses {
        let entries = value.as_object().into_iter().flatten();
        if value.is_object() {
            entries.for_each(|(key, value)| table.row([format!("{name}.{key}"), format::cell(value)]));
        } else {
            table.row([name.clone(), format::cell(value)]);
        }
    }
    table.row(["wall_s".to_owned(), format::significant(result.performance.wall_s)]);
    table.row([
        "ns_per_particle_step".to_owned(),
        format::significant(result.performance.ns_per_particle_step),
    ]);
    table
}

fn summary(result: &RunResult, files: &[PathBuf]) -> serde_json::Value {
    json!({
        "end_reason": result.end_reason,
        "instability": result.instability,
        "responses": result.responses,
        "warnings": result.warnings,
        "solver": result.solver,
        "performance": result.performance,
        "scenario_digest": result.scenario_digest,
        "files": files,
    })
}
