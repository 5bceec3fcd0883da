//! `roost run`: one scenario right here, without a server.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::job::AttemptOutcome;
use roost_api::{Phase, Progress, RunResult};
use roost_solver::{Limits, scenario};
use roost_worker::runner::{Resources, Run, RunEnd, Stop};
use serde_json::json;
use tokio_util::sync::CancellationToken;

use crate::device::DeviceArgs;
use crate::exit::{BadInput, Exit};
use crate::frames::{FrameArgs, Frames};
use crate::ui;
use crate::ui::meter::Meter;
use crate::ui::{format, table::Table};
use crate::work::{say_threads, threads};
use crate::{frames, input, meshes, output, signals};

/// Run one scenario here, without a server
///
/// Writes result.json, series.csv and curve.svg. Ctrl-C stops the run and keeps what it has so far.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The scenario, a JSON file; `-` reads stdin
    scenario: PathBuf,
    /// Folder for the result
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Threads to use; 0 means one per processor
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads())]
    threads: u16,
    #[command(flatten)]
    device: DeviceArgs,
    /// Use this seed instead of the scenario's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Print a summary as JSON instead of a table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    frames: FrameArgs,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let mut document = input::read(&args.scenario)?;
    // Before anything is made or runs: a signal at any time from here on keeps what there is.
    let shutdown = signals::shutdown()?;
    if let (Some(seed), Some(fields)) = (args.seed, document.as_object_mut()) {
        fields.insert("seed".to_owned(), json!(seed));
    }
    if input::Kind::of(&document) == input::Kind::Sweep {
        let name = input::name(&args.scenario);
        let text = format!("{name} is a sweep, and this runs one scenario; `roost submit` takes sweeps");
        return Err(BadInput(text).into());
    }
    let named = meshes::resolve(&args.scenario, document).without_a_server();
    let bad = |faults: Vec<_>| input::faults(&args.scenario, &named.faults_and(faults));
    let scenario = scenario::from_value(&named.document).map_err(bad)?;
    let checked = roost_solver::check(&scenario, &named.meshes, &Limits::default()).map_err(bad)?;
    let estimate = checked.estimate();
    for warning in &estimate.warnings {
        ui::say!("warning: {warning}");
    }
    // Now, not after an hour of simulation.
    let device = args.device.choose()?;
    say_threads(args.threads, &device);
    let resources = Resources::new(device, args.threads.into());
    output::prepare(&args.output)?;
    ui::say!(
        "{} fillets, {} sub-particles, {} steps of {} s at most",
        estimate.fillets,
        estimate.subparticles,
        estimate.steps,
        format::significant(estimate.timestep_s),
    );
    let mut frames = args.frames.prepare(&scenario, estimate)?;
    let pictures = frames.as_ref().map(Frames::pictures);
    let run = Run::start_checked(checked, resources, pictures);
    let end = watch(run, &shutdown, || frames.as_mut()?.warning()).await;
    let recorded = frames.as_mut().map(Frames::finish);
    let (result, exit) = match end {
        RunEnd::Finished(result) => (result, Exit::Done),
        RunEnd::Failed { outcome, message, result: Some(result) } => {
            ui::say!("{outcome}: {message}");
            let exit = if outcome == AttemptOutcome::Unstable { Exit::Unstable } else { Exit::Failed };
            (result, exit)
        }
        RunEnd::Failed { outcome, message, result: None } => anyhow::bail!("{outcome}: {message}"),
        RunEnd::Abandoned => anyhow::bail!("the run was abandoned"),
    };
    let mut files = output::write(&args.output, &result)?;
    files.extend(recorded.iter().flat_map(|recorded| recorded.files.iter().cloned()));
    if args.json {
        let mut summary = summary(&result, &files);
        if let Some(recorded) = &recorded {
            summary["frames"] = frames::summary(recorded);
        }
        ui::json(&summary)?;
    } else {
        ui::print(format_args!("{}", responses(&result)))?;
        ui::println("")?;
        ui::println(files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join("  "))?;
    }
    Ok(exit)
}

/// Follows a run to its end on a progress bar, and tells what is `news` on the way; a signal stops it.
async fn watch(
    mut run: Run,
    shutdown: &CancellationToken,
    mut news: impl FnMut() -> Option<String>,
) -> RunEnd {
    let mut meter = Meter::new("simulating");
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
                    meter.show(progress.fraction, describe(progress));
                }
                if let Some(news) = news() {
                    meter.tell(&news);
                }
            }
        }
    }
    let end = run.end().await;
    match last {
        Some(progress) => {
            let fraction = if matches!(end, RunEnd::Finished(_)) { 1.0 } else { progress.fraction };
            meter.finish(fraction, format!("{} of wall time", format::duration(progress.wall_s)));
        }
        None => meter.clear(),
    }
    end
}

/// Phase, simulated time, rates and time left in one line.
pub(crate) fn describe(progress: &Progress) -> String {
    let phase = match progress.phase {
        Phase::Fill => format!("coming to rest, {:.2} s", progress.simulated_s),
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

/// Responses, one a line.
pub(crate) fn responses(result: &RunResult) -> Table {
    let mut table = Table::new(["response", "value"]);
    table.row(["end_reason".to_owned(), format::cell(&json!(result.end_reason))]);
    for (name, value) in &result.responses {
        let inner = value.as_object().into_iter().flatten();
        if value.is_object() {
            inner.for_each(|(key, value)| table.row([format!("{name}.{key}"), format::cell(value)]));
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
        "solver": result.solver,
        "performance": result.performance,
        "scenario_digest": result.scenario_digest,
        "files": files,
    })
}
