//! Validation without running or storing anything: every fault of a document, or what it would cost.
//!
//! Pure, so that `roost validate` says without a server what `POST /v1/validate` says with one.

use roost_api::Fault;
use roost_api::sweep::SCHEMA;
use roost_api::validate::ValidationReport;
use roost_solver::mesh::Meshes;
use roost_solver::{Limits, scenario};
use serde_json::{Value, json};

use crate::document::read_envelope;
use crate::mesh;
use crate::sweep::{self, SweepLimits};

/// Checks a scenario, a job envelope or a sweep, whose meshes are at hand, and says what it would cost.
///
/// # Errors
/// Every fault found, with pointers into the document.
pub fn validate(
    document: Value,
    meshes: &Meshes,
    limits: &Limits,
    max_jobs: u64,
) -> Result<ValidationReport, Vec<Fault>> {
    if is_sweep(&document) {
        let (_, expansion) = sweep::read(document, meshes, SweepLimits { max_jobs, scenario: *limits })?;
        let scenarios = expansion.points.iter().map(|point| &point.scenario);
        return Ok(ValidationReport {
            document: "sweep".to_owned(),
            jobs: expansion.jobs(),
            meshes: mesh::reports([&expansion.base].into_iter().chain(scenarios), meshes),
            estimate: expansion.estimate,
            scenario: json!(expansion.base),
        });
    }
    let scenario = match document.get("scenario") {
        Some(_) => read_envelope(meshes, limits, document)?.1,
        None => scenario::from_value(&document)?,
    };
    Ok(ValidationReport {
        document: "scenario".to_owned(),
        jobs: 1,
        estimate: mesh::check(&scenario, meshes, limits)?,
        meshes: mesh::reports([&scenario].into_iter(), meshes),
        scenario: json!(scenario),
    })
}

/// A sweep says so, or has what only a sweep has.
pub fn is_sweep(document: &Value) -> bool {
    document.get("schema").is_some_and(|schema| schema == SCHEMA)
        || ["base", "factors", "design"].iter().any(|name| document.get(name).is_some())
}
