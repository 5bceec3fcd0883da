//! `roost validate`: every fault of a document, or what it would cost, without a server and without running it.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::Fault;
use roost_api::validate::{MeshReport, ValidationReport};
use roost_server::{Limits, ServerConfig};
use serde_json::json;

use crate::exit::Exit;
use crate::input;
use crate::meshes::{self, Resolved};
use crate::ui;
use crate::ui::format;

/// Check a scenario or a sweep without running it
///
/// Prints what it would cost (sub-particles, steps, memory, time) and what there is to know of its meshes, or every fault
/// with its JSON pointer, the value found and what is allowed.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A JSON file with a scenario, or a sweep (it has a `base`); `-` reads stdin
    file: PathBuf,
    /// Print JSON: the report, or `{"valid": false, "errors": […]}`
    #[arg(long)]
    json: bool,
}

pub(crate) fn execute(args: &Args) -> Result<Exit> {
    let named = meshes::resolve(&args.file, input::read(&args.file)?).without_a_server();
    let max_jobs = ServerConfig::default().max_jobs_per_sweep;
    let report = roost_server::validate(named.document.clone(), &named.meshes, &Limits::default(), max_jobs);
    let faults = named.faults_and(report.as_ref().err().cloned().unwrap_or_default());
    match report {
        Ok(report) if faults.is_empty() => tell(args, &named, &report)?,
        _ => return refuse(args, &faults),
    }
    Ok(Exit::Done)
}

fn refuse(args: &Args, faults: &[Fault]) -> Result<Exit> {
    if !args.json {
        return Err(input::faults(&args.file, faults).into());
    }
    ui::json(&json!({ "valid": false, "errors": faults }))?;
    Ok(Exit::BadInput)
}

fn tell(args: &Args, named: &Resolved, report: &ValidationReport) -> Result<()> {
    if args.json {
        let mut document = json!(report);
        document["valid"] = json!(true);
        ui::json(&document)?;
        return Ok(());
    }
    let estimate = &report.estimate;
    ui::println(format_args!("{}: a valid {}", input::name(&args.file), report.document))?;
    if report.document == "sweep" {
        let took = format::duration(report.wall_s);
        ui::println(format_args!(
            "  {} jobs, {took} on two cores, one after the other; its base scenario:",
            report.jobs
        ))?;
    }
    ui::println(format_args!(
        "  {} fillets of {} kg in all, {} sub-particles, {} bonds",
        estimate.fillets,
        format::significant(estimate.mass_kg),
        estimate.subparticles,
        estimate.bonds
    ))?;
    ui::println(format_args!(
        "  at most {} steps of {} s (stable up to {} s)",
        estimate.steps,
        format::significant(estimate.timestep_s),
        format::significant(estimate.stable_timestep_s)
    ))?;
    ui::println(format_args!(
        "  about {} of memory, {} on two cores",
        format::bytes(estimate.memory_bytes),
        format::duration(estimate.wall_s)
    ))?;
    for mesh in &report.meshes {
        ui::println(format_args!("  mesh {}: {}", named.name(&mesh.digest), describe(mesh)))?;
    }
    for warning in &estimate.warnings {
        ui::println(format_args!("  warning: {warning}"))?;
    }
    Ok(())
}

/// `4800 triangles, 0.12 × 0.06 × 0.03 m, closed`, and what is odd about it.
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
    text
}

fn counted(number: u64, what: &str) -> String {
    if number == 1 { format!("1 {what}") } else { format!("{number} {what}s") }
}
