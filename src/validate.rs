//! `roost validate`: the faults of a document, or the cost of its simulations.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::Fault;
use roost_api::validate::{MeshReport, ValidationReport};
use roost_server::{Limits, ServerConfig};
use roost_terminal::{Exit, format, input, print_json, print_line};
use serde_json::json;

use crate::meshes::{self, Resolved};

/// Check a scenario, a sweep or a study without simulating it
///
/// Prints the cost (sub-particles, steps, memory, time) and a description of its meshes. For an invalid document, prints every
/// fault with its JSON pointer, the value and the allowed values.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// JSON file with a scenario, a sweep (which has a `base`) or a study (which has a `goal`); `-` reads stdin
    file: PathBuf,
    /// Print JSON: the report, or `{"valid": false, "errors": […]}`
    #[arg(long)]
    json: bool,
}

pub(crate) fn execute(args: &Args) -> Result<Exit> {
    let resolved = meshes::resolve(&args.file, input::read_document(&args.file)?).without_server();
    let max_jobs = ServerConfig::default().max_jobs_per_sweep;
    let report =
        roost_server::validate(resolved.document.clone(), &resolved.meshes, &Limits::default(), max_jobs);
    let faults = resolved.with_faults(report.as_ref().err().cloned().unwrap_or_default());
    match report {
        Ok(report) if faults.is_empty() => print_report(args, &resolved, &report)?,
        _ => return report_faults(args, &faults),
    }
    Ok(Exit::Done)
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
        let took = format::duration(report.wall_s);
        print_line(format_args!(
            "  at most {} runs, {took} on two cores, one after the other; the base scenario:",
            report.jobs
        ))?;
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
    for mesh in &report.meshes {
        print_line(format_args!("  mesh {}: {}", resolved.name(&mesh.digest), describe(mesh)))?;
    }
    for warning in &estimate.warnings {
        print_line(format_args!("  warning: {warning}"))?;
    }
    Ok(())
}

/// A description of a mesh with its defects, such as `4800 triangles, 0.12 × 0.06 × 0.03 m, closed`.
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

fn counted(number: u64, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}
