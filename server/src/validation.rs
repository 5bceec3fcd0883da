//! Validation without running or storing anything: every fault of a document, or what it would cost.
//!
//! Pure, so that `roost validate` says without a server what `POST /v1/validate` says with one.

use roost_api::Fault;
use roost_api::sweep::SCHEMA;
use roost_api::validate::ValidationReport;
use roost_solver::{Limits, scenario};
use serde_json::{Value, json};

use crate::document::read_envelope;
use crate::sweep::{self, SweepLimits};

/// Checks a scenario, a job envelope or a sweep, and says what it would cost.
///
/// # Errors
/// Every fault found, with pointers into the document.
pub fn validate(document: Value, limits: &Limits, max_jobs: u64) -> Result<ValidationReport, Vec<Fault>> {
    if is_sweep(&document) {
        let (_, expansion) = sweep::read(document, SweepLimits { max_jobs, scenario: *limits })?;
        return Ok(ValidationReport {
            document: "sweep".to_owned(),
            jobs: expansion.jobs(),
            estimate: expansion.estimate,
            scenario: json!(expansion.base),
        });
    }
    let scenario = match document.get("scenario") {
        Some(_) => read_envelope(limits, document)?.1,
        None => scenario::from_value(&document)?,
    };
    let estimate = roost_solver::check(&scenario, &roost_solver::mesh::Meshes::default(), limits)?;
    Ok(ValidationReport { document: "scenario".to_owned(), jobs: 1, estimate, scenario: json!(scenario) })
}

/// A sweep says so, or has what only a sweep has.
pub fn is_sweep(document: &Value) -> bool {
    document.get("schema").is_some_and(|schema| schema == SCHEMA)
        || ["base", "factors", "design"].iter().any(|name| document.get(name).is_some())
}
