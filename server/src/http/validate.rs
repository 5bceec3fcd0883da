//! Validation without running.

use axum::Json;
use axum::extract::State;
use roost_api::problem::Problem;
use roost_api::validate::ValidationReport;

use super::blocking::run_blocking;
use super::extract::Document;
use super::problem::ApiError;
use crate::state::App;

/// Checks a scenario, a job envelope or a sweep without running it, and estimates its cost.
#[utoipa::path(post, path = "/v1/validate", tag = "documents", operation_id = "validate",
    request_body = Object,
    responses((status = 200, description = "The document is valid", body = ValidationReport),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn validate(
    State(app): State<App>,
    Document(document): Document,
) -> Result<Json<ValidationReport>, ApiError> {
    let (limits, max_jobs) = (app.config.limits, app.config.max_jobs_per_sweep);
    let meshes = app.mesh_cache.meshes_of(&document, &app.store).await?;
    run_blocking(move || crate::validation::validate(document, &meshes, &limits, max_jobs))
        .await?
        .map(Json)
        .map_err(ApiError::faults)
}
