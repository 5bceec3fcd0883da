//! Validation without running.

use axum::Json;
use axum::extract::State;
use roost_api::problem::Problem;
use roost_api::validate::ValidationReport;

use super::aside::aside;
use super::at_hand::at_hand;
use super::extract::Document;
use super::problem::ApiError;
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
    let (limits, max_jobs) = (app.config.limits, app.config.max_jobs_per_sweep);
    let meshes = at_hand(&app, &document).await?;
    aside(move || crate::validation::validate(document, &meshes, &limits, max_jobs))
        .await?
        .map(Json)
        .map_err(ApiError::faults)
}
