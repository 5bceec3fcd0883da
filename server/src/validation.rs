//! Validation of a document without running it: all faults, or an estimate of its cost.
//!
//! Pure, so that `roost validate` without a server gives the same answer as `POST /v1/validate`.

use std::iter;

use roost_api::Fault;
use roost_api::forecast::RunRange;
use roost_api::study::Driver;
use roost_api::sweep::SCHEMA;
use roost_api::validate::ValidationReport;
use roost_solver::mesh::Meshes;
use roost_solver::{Limits, scenario};
use serde_json::{Value, json};

use crate::document::read_envelope;
use crate::forecast::cost_of_clients;
use crate::mesh;
use crate::study;
use crate::sweep::{self, SweepLimits};

/// Checks a scenario, a job envelope, a sweep or a study with its meshes, and estimates its cost. Only a study whose runs clients make has a
/// forecast already: it depends on no worker.
///
/// # Errors
/// All faults, with pointers into the document.
pub fn validate(
    document: Value,
    meshes: &Meshes,
    limits: &Limits,
    max_jobs: u64,
) -> Result<ValidationReport, Vec<Fault>> {
    if is_study(&document) {
        let (study, expansion) = study::read(document, meshes, SweepLimits { max_jobs, scenario: *limits })?;
        let max_runs = u64::from(study.spec.budget.max_runs);
        // Runs of earlier sweeps may be all that the answer needs.
        let needs_own_runs = study.spec.seeded_by.is_empty();
        let least =
            if needs_own_runs { roost_design::forecast::least_runs(&study.question) as u64 } else { 0 };
        let min_jobs = least.min(max_runs);
        let of_clients = (study.spec.driver == Driver::Client)
            .then(|| cost_of_clients(RunRange { least: min_jobs, most: max_runs }));
        // The mean of the corners of the range.
        let wall_s = expansion.wall_s / expansion.jobs() as f64 * max_runs as f64;
        return Ok(ValidationReport {
            document: "study".to_owned(),
            jobs: max_runs,
            min_jobs,
            shortage: roost_design::forecast::shortage(&study.question).filter(|_| needs_own_runs),
            wall_s: if of_clients.is_some() { 0.0 } else { wall_s },
            forecast: of_clients,
            meshes: mesh::reports(iter::once(expansion.base.clone()), meshes),
            estimate: expansion.estimate,
            scenario: json!(expansion.base),
        });
    }
    if is_sweep(&document) {
        let names_meshes = !mesh::digests_in(&document).is_empty();
        let (_, expansion) = sweep::read(document, meshes, SweepLimits { max_jobs, scenario: *limits })?;
        // Points can name other meshes than the base does.
        let points = names_meshes.then(|| expansion.points.iter()).into_iter().flatten();
        let scenarios = iter::once(expansion.base.clone()).chain(points.map(|point| point.scenario));
        return Ok(ValidationReport {
            document: "sweep".to_owned(),
            jobs: expansion.jobs(),
            min_jobs: expansion.jobs(),
            shortage: None,
            forecast: None,
            meshes: mesh::reports(scenarios, meshes),
            estimate: expansion.estimate,
            wall_s: expansion.wall_s,
            scenario: json!(expansion.base),
        });
    }
    let scenario = match document.get("scenario") {
        Some(_) => read_envelope(meshes, limits, document)?.1,
        None => scenario::from_value(&document)?,
    };
    let estimate = mesh::check(&scenario, meshes, limits)?;
    Ok(ValidationReport {
        document: "scenario".to_owned(),
        jobs: 1,
        min_jobs: 1,
        shortage: None,
        forecast: None,
        meshes: mesh::reports(iter::once(scenario.clone()), meshes),
        wall_s: estimate.wall_s,
        estimate,
        scenario: json!(scenario),
    })
}

/// Whether a document is a study: by its schema, or by a field that only studies have.
pub fn is_study(document: &Value) -> bool {
    document.get("schema").is_some_and(|schema| schema == study::SCHEMA)
        || ["goal", "budget"].iter().any(|name| document.get(name).is_some())
}

/// Whether a document holds measurements: by its schema in any version, or by a field that only they have.
pub fn is_measurements(document: &Value) -> bool {
    let schema = document.get("schema").and_then(Value::as_str).unwrap_or_default();
    schema.starts_with("roost.measurements/") || document.get("tests").is_some()
}

/// Whether a document is a sweep: by its schema, or by a field that only sweeps have.
pub fn is_sweep(document: &Value) -> bool {
    document.get("schema").is_some_and(|schema| schema == SCHEMA)
        || ["base", "factors", "design"].iter().any(|name| document.get(name).is_some())
}
