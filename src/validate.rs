//! `roost validate`: the faults of a document, or the cost of its simulations.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::Fault;
use roost_api::time::Timestamp;
use roost_api::validate::{MeshReport, ValidationReport};
use roost_server::{Limits, ServerConfig};
use roost_terminal::{BadInput, Exit, format, input, print_json, print_line};
use serde_json::json;

use crate::document::DocumentKind;
use crate::meshes::{self, Resolved};
use crate::submit::submission_error;
use crate::{forecast, measurements, target};

/// Check a scenario, a sweep, a study or measurements without a simulation
///
/// For a valid document, the command prints the cost of the simulation, a description of its meshes (STL files), and a forecast. The
/// cost is the number of sub-particles, the number of time steps, and the memory. The forecast has the number of runs, the hours of
/// processor time and the time of completion, each as a range. Without `--server`, the forecast is for this machine. With `--server`,
/// the forecast is for the workers of this server. For an invalid document, the command prints every fault with its JSON pointer, the
/// wrong value and the allowed values.
///
/// For measurements, the command prints no cost. It prints the tests with their measured numbers, in the units that Roost uses in its
/// results.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// JSON file with a scenario, a sweep (which has a `base`), a study (which has a `goal`) or measurements (which have `tests`); `-`
    /// reads stdin
    file: PathBuf,
    #[command(flatten)]
    server: target::OptionalServer,
    /// Print JSON: the report, or `{"valid": false, "errors": […]}`
    #[arg(long)]
    json: bool,
}

/// Checks a document; `is_study` refuses any other.
pub(crate) async fn execute(args: Args, is_study: bool) -> Result<Exit> {
    let document = input::read_document(&args.file)?;
    if is_study && DocumentKind::of(&document) != DocumentKind::Study {
        let name = input::display_name(&args.file);
        return Err(BadInput(format!("{name} is no study: a study has a `goal`")).into());
    }
    if DocumentKind::of(&document) == DocumentKind::Measurements {
        return match measurements::read(&args.file, document) {
            Ok(lab) => measurements::print(&args.file, &lab, args.json).map(|()| Exit::Done),
            Err(faults) => report_faults(&args, &faults),
        };
    }
    if let Some(client) = args.server.client()?
        && document.pointer("/posterior/study").is_some()
    {
        // Only the server has the samples.
        let report = client.validate(&document).await;
        let report =
            report.map_err(|error| submission_error(&args.file, DocumentKind::of(&document), error))?;
        print_report(&args, &meshes::resolve(&args.file, document), &report)?;
        return Ok(Exit::Done);
    }
    let resolved = meshes::resolve(&args.file, document).without_server();
    let max_jobs = ServerConfig::default().max_jobs_per_sweep;
    let report =
        roost_server::validate(resolved.document.clone(), &resolved.meshes, &Limits::default(), max_jobs);
    let faults = resolved.with_faults(report.as_ref().err().cloned().unwrap_or_default());
    match report {
        Ok(report) if faults.is_empty() => {
            let report = with_forecast(&args, &resolved, report).await?;
            print_report(&args, &resolved, &report)?;
        }
        _ => return report_faults(&args, &faults),
    }
    Ok(Exit::Done)
}

/// Adds the forecast: of the server if one is named, else of this machine. A study whose runs clients make has its own.
async fn with_forecast(
    args: &Args,
    resolved: &Resolved,
    report: ValidationReport,
) -> Result<ValidationReport> {
    let forecast = match args.server.client()? {
        _ if report.forecast.is_some() => report.forecast,
        Some(client) => client.validate(&resolved.document).await?.forecast,
        None => {
            let processors = std::thread::available_parallelism().map_or(1, usize::from);
            Some(roost_server::on_this_machine(&report, processors, Timestamp::now()))
        }
    };
    Ok(ValidationReport { forecast, ..report })
}

fn report_faults(args: &Args, faults: &[Fault]) -> Result<Exit> {
    if !args.json {
        return Err(input::faults_error(&args.file, faults).into());
    }
    print_json(&json!({ "valid": false, "errors": faults }))?;
    Ok(Exit::BadInput)
}

fn print_report(args: &Args, resolved: &Resolved, report: &ValidationReport) -> Result<()> {
    if args.json {
        let mut document = json!(report);
        document["valid"] = json!(true);
        print_json(&document)?;
        return Ok(());
    }
    let estimate = &report.estimate;
    print_line(format_args!("{}: a valid {}", input::display_name(&args.file), report.document))?;
    if report.document == "study" {
        let is_of_clients = report.forecast.as_ref().is_some_and(|forecast| forecast.processor.is_none());
        let took = match is_of_clients {
            true => "which clients make".to_owned(),
            false => format!("{} on two cores, one after the other", format::duration(report.wall_s)),
        };
        print_line(format_args!("  at most {} runs, {took}; the base scenario:", report.jobs))?;
    }
    if report.document == "sweep" {
        let took = format::duration(report.wall_s);
        print_line(format_args!(
            "  {} jobs, {took} on two cores, one after the other; the base scenario:",
            report.jobs
        ))?;
    }
    print_line(format_args!(
        "  {} fillets of {} kg in all, {} sub-particles, {} bonds",
        estimate.fillets,
        format::significant(estimate.mass_kg),
        estimate.subparticles,
        estimate.bonds
    ))?;
    print_line(format_args!(
        "  at most {} steps of {} s (stable up to {} s)",
        estimate.steps,
        format::significant(estimate.timestep_s),
        format::significant(estimate.stable_timestep_s)
    ))?;
    print_line(format_args!(
        "  about {} of memory, {} on two cores",
        format::bytes(estimate.memory_bytes),
        format::duration(estimate.wall_s)
    ))?;
    let place = if args.server.client()?.is_some() { "on the present workers" } else { "on this machine" };
    if let Some(forecast) = &report.forecast {
        for line in forecast::cost_lines(forecast, place) {
            print_line(format_args!("  forecast: {line}"))?;
        }
    }
    if let Some(shortage) = &report.shortage {
        print_line(format_args!("  warning: the budget is too small for the asked confidence: {shortage}"))?;
    }
    for mesh in &report.meshes {
        print_line(format_args!("  mesh {}: {}", resolved.name(&mesh.digest), describe(mesh)))?;
    }
    for warning in &estimate.warnings {
        print_line(format_args!("  warning: {warning}"))?;
    }
    Ok(())
}

/// A description of a mesh with its defects and its place, such as `4800 triangles, 0.12 × 0.06 × 0.03 m, closed`.
fn describe(mesh: &MeshReport) -> String {
    let size_m = mesh.size_m.map(format::significant).join(" × ");
    let mut text = format!("{}, {size_m} m, ", counted(mesh.triangles, "triangle"));
    match mesh.open_edges {
        0 => text.push_str("closed"),
        open => text.push_str(&counted(open, "open edge")),
    }
    if mesh.degenerate > 0 {
        text.push_str(&format!(", {} without area", counted(mesh.degenerate, "triangle")));
    }
    if mesh.turned_edges > 0 {
        let edges = counted(mesh.turned_edges, "edge");
        text.push_str(&format!(", {edges} between triangles that face opposite ways"));
    }
    if let Some([low, high]) =
        mesh.placed_m.map(|corners| corners.map(|corner| corner.map(format::significant)))
    {
        let range = |axis: usize| format!("{} to {}", low[axis], high[axis]);
        text.push_str(&format!("; it lies from x = {}, y = {}, z = {} m", range(0), range(1), range(2)));
    }
    text
}

fn counted(number: u64, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}
