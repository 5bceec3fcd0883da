//! `roost validate`: every fault of a document, or what it would cost, without a server and without running it.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::Fault;
use roost_api::validate::ValidationReport;
use roost_server::{Limits, ServerConfig};
use serde_json::json;

use crate::exit::Exit;
use crate::input;
use crate::ui;
use crate::ui::format;

/// Check a scenario or a sweep without running it
///
/// Prints what it would cost (sub-particles, steps, memory, time), or every fault with its JSON pointer, the value
/// found and what is allowed.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A JSON file with a scenario, or a sweep (it has a `base`); `-` reads stdin
    file: PathBuf,
    /// Print JSON: the report, or `{"valid": false, "errors": […]}`
    #[arg(long)]
    json: bool,
}

pub(crate) fn execute(args: &Args) -> Result<Exit> {
    let document = input::read(&args.file)?;
    let max_jobs = ServerConfig::default().max_jobs_per_sweep;
    match roost_server::validate(document, &Limits::default(), max_jobs) {
        Ok(report) if args.json => {
            let mut document = json!(report);
            document["valid"] = json!(true);
            ui::println(format_args!("{document:#}"))?;
        }
        Ok(report) => tell(args, &report)?,
        Err(faults) => return refuse(args, &faults),
    }
    Ok(Exit::Done)
}

fn refuse(args: &Args, faults: &[Fault]) -> Result<Exit> {
    if !args.json {
        return Err(input::faults(&args.file, faults).into());
    }
    ui::println(format_args!("{:#}", json!({ "valid": false, "errors": faults })))?;
    Ok(Exit::BadInput)
}

fn tell(args: &Args, report: &ValidationReport) -> Result<()> {
    let estimate = &report.estimate;
    ui::println(format_args!("{}: a valid {}", input::name(&args.file), report.document))?;
    if report.document == "sweep" {
        ui::println(format_args!("  {} jobs; its base scenario:", report.jobs))?;
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
    for warning in &estimate.warnings {
        ui::println(format_args!("  warning: {warning}"))?;
    }
    Ok(())
}
