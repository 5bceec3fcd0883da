//! The server itself: health, versions, schemas.

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use roost_api::API_VERSION;
use roost_api::outputs::OutputTable;
use roost_api::parameters::ParameterLibrary;
use roost_api::problem::Problem;
use roost_api::version::VersionView;
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::json_schema;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::problem::{ApiError, ProblemKind};
use crate::state::App;
use crate::store::Store;
use crate::sweep;

/// The OpenAPI document, serialized once.
#[derive(Clone)]
pub(crate) struct Spec(axum::body::Bytes);

impl Spec {
    /// Serializes the document.
    pub(crate) fn new(spec: &utoipa::openapi::OpenApi) -> Self {
        Self(spec.to_json().expect("the specification is JSON").into())
    }
}

/// A healthy server.
#[derive(Serialize, ToSchema)]
pub(crate) struct Health {
    /// Always `ok`.
    status: &'static str,
}

/// Checks that the process is alive.
#[utoipa::path(get, path = "/healthz", tag = "server", operation_id = "healthz",
    responses((status = 200, description = "The process is alive", body = Health)))]
pub(crate) async fn healthz() -> Json<Health> {
    Json(Health { status: "ok" })
}

/// Checks that the database reads and writes, and that the server is not stopping.
#[utoipa::path(get, path = "/readyz", tag = "server", operation_id = "readyz",
    responses((status = 200, description = "The server is ready", body = Health),
              (status = 503, description = "The server is not ready", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn readyz(State(app): State<App>) -> Result<Json<Health>, ApiError> {
    if app.shutdown.is_cancelled() {
        return Err(ApiError::new(ProblemKind::Unavailable, "the server is stopping: try again later"));
    }
    app.store.ping().await.map_err(|error| {
        let detail =
            error.unavailable().map_or_else(|| error.to_string(), |reason| reason.sentence().to_owned());
        ApiError::new(ProblemKind::Unavailable, detail)
    })?;
    Ok(Json(Health { status: "ok" }))
}

/// Shows versions of server, API, solver and database.
#[utoipa::path(get, path = "/v1/version", tag = "server", operation_id = "version",
    responses((status = 200, description = "The versions", body = VersionView)))]
pub(crate) async fn version(State(app): State<App>) -> Json<VersionView> {
    Json(VersionView {
        server: env!("CARGO_PKG_VERSION").to_owned(),
        api_version: API_VERSION.to_owned(),
        solver_revision: SOLVER_REVISION,
        sqlite: Store::sqlite_version().to_owned(),
        database: app.store.version_of_database().to_owned(),
    })
}

/// Shows the JSON Schema of a scenario: every field with type, unit, default, range and source.
#[utoipa::path(get, path = "/v1/schema/scenario", tag = "documents", operation_id = "scenario_schema",
    responses((status = 200, description = "JSON Schema", body = Object)))]
pub(crate) async fn scenario_schema() -> Json<Value> {
    Json(json_schema())
}

/// Shows the responses, series and curves of the experiments, each with unit, meaning and experiments.
#[utoipa::path(get, path = "/v1/responses", tag = "documents", operation_id = "responses",
    responses((status = 200, description = "The table of results", body = OutputTable)))]
pub(crate) async fn responses() -> Json<OutputTable> {
    Json(OutputTable::of_solver())
}

/// Shows published properties of meat, poultry and fish by field of the scenario, with their sources.
#[utoipa::path(get, path = "/v1/parameters", tag = "documents", operation_id = "parameters",
    responses((status = 200, description = "The parameter library", body = ParameterLibrary)))]
pub(crate) async fn parameters() -> Json<ParameterLibrary> {
    Json(ParameterLibrary::of_this_version())
}

/// Shows the JSON Schema of a sweep, which includes that of its base.
#[utoipa::path(get, path = "/v1/schema/sweep", tag = "documents", operation_id = "sweep_schema",
    responses((status = 200, description = "JSON Schema", body = Object)))]
pub(crate) async fn sweep_schema() -> Json<Value> {
    Json(sweep::json_schema())
}

/// Shows this API as OpenAPI 3.1.
#[utoipa::path(get, path = "/openapi.json", tag = "server", operation_id = "openapi",
    responses((status = 200, description = "The OpenAPI document", body = Object)))]
pub(crate) async fn openapi(Extension(Spec(spec)): Extension<Spec>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], spec).into_response()
}
