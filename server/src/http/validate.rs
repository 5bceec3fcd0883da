//! Validation without running.

use axum::Json;
use axum::extract::State;
use roost_api::problem::Problem;
use roost_api::validate::ValidationReport;

use super::extract::Document;
use super::forecasts::report;
use super::problem::ApiError;
use crate::state::App;

/// Checks a scenario, a job envelope, a sweep or a study without running it, and forecasts its cost.
#[utoipa::path(post, path = "/v1/validate", tag = "documents", operation_id = "validate",
    request_body = Object,
    responses((status = 200, description = "The document is valid", body = ValidationReport),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn validate(
    State(app): State<App>,
    Document(document): Document,
) -> Result<Json<ValidationReport>, ApiError> {
    report(&app, document).await.map(Json)
}
