//! Validation without running.

use axum::Json;
use axum::extract::State;
use roost_api::problem::Problem;
use roost_api::sweep::SweepSpec;
use roost_api::validate::ValidationReport;
use roost_solver::scenario;
use serde_json::{Value, json};

use super::extract::Document;
use super::faults::read_document;
use super::jobs::read_envelope;
use super::problem::ApiError;
use super::sweeps::expanded;
use crate::app::App;

/// Checks a scenario, a job envelope or a sweep without running it, and says what it would cost.
#[utoipa::path(post, path = "/v1/validate", tag = "documents", operation_id = "validate",
    request_body = Object,
    responses((status = 200, description = "It is valid", body = ValidationReport),
              (status = 422, description = "Every fault", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn validate(
    State(app): State<App>,
    Document(document): Document,
) -> Result<Json<ValidationReport>, ApiError> {
    let limits = &app.config.limits;
    if is_sweep(&document) {
        let spec: SweepSpec = read_document(document).map_err(ApiError::faults)?;
        let expansion = expanded(&app, spec).await?;
        return Ok(Json(ValidationReport {
            document: "sweep".to_owned(),
            jobs: expansion.jobs(),
            estimate: expansion.estimate,
            scenario: json!(expansion.base),
        }));
    }
    let scenario = match document.get("scenario") {
        Some(_) => read_envelope(&app, document).map(|(_, scenario)| scenario),
        None => scenario::from_value(&document),
    };
    let scenario = scenario.map_err(ApiError::faults)?;
    let estimate = roost_solver::check(&scenario, limits).map_err(ApiError::faults)?;
    let document = "scenario".to_owned();
    Ok(Json(ValidationReport { document, jobs: 1, estimate, scenario: json!(scenario) }))
}

/// A sweep says so, or has what only a sweep has.
fn is_sweep(document: &Value) -> bool {
    document.get("schema").is_some_and(|schema| schema == roost_api::sweep::SCHEMA)
        || ["base", "factors", "design"].iter().any(|name| document.get(name).is_some())
}
