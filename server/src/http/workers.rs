//! Workers: register, list, drain.

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, Uri};
use axum::response::Response;
use roost_api::API_VERSION;
use roost_api::ids::WorkerId;
use roost_api::page::Page;
use roost_api::problem::Problem;
use roost_api::worker::{WorkerRegistration, WorkerView, WorkerWelcome};
use roost_solver::SOLVER_REVISION;
use serde::Deserialize;
use utoipa::IntoParams;

use super::extract::{Body, Params, Segments};
use super::page::{limit, limit_schema, page};
use super::problem::{ApiError, ProblemKind};
use crate::document::name_fault;
use crate::state::App;

/// Registers a worker process. Repeating it is safe.
#[utoipa::path(post, path = "/v1/workers", tag = "workers", operation_id = "register_worker",
    request_body = WorkerRegistration,
    responses((status = 200, description = "Registered", body = WorkerWelcome),
              (status = 409, description = "The API version or the solver revision differs, or the id is registered with another solver", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn register(
    State(app): State<App>,
    Body(worker): Body<WorkerRegistration>,
) -> Result<Json<WorkerWelcome>, ApiError> {
    let names = [("/name", &worker.name), ("/backend", &worker.backend), ("/device", &worker.device)];
    let faults: Vec<_> = names.iter().filter_map(|(pointer, name)| name_fault(pointer, name)).collect();
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    if worker.api_version != API_VERSION {
        let detail = format!(
            "the worker uses API {}, the server {API_VERSION}: install the same release on both",
            worker.api_version
        );
        return Err(ApiError::new(ProblemKind::WorkerRefused, detail));
    }
    if worker.solver_revision != SOLVER_REVISION {
        let detail = format!(
            "the worker has solver revision {}, the server {SOLVER_REVISION}, and their results must not be mixed: install the \
             same release on both",
            worker.solver_revision
        );
        return Err(ApiError::new(ProblemKind::WorkerRefused, detail));
    }
    let (id, name, device) = (worker.worker_id, worker.name.clone(), worker.device.clone());
    app.store.register_worker(worker, app.clock.now()).await??;
    tracing::info!(worker = %id, name, device, "worker registered");
    Ok(Json(WorkerWelcome {
        heartbeat_s: app.config.heartbeat.as_secs_f64(),
        lease_s: app.config.lease.as_secs_f64(),
    }))
}

/// Asks a worker to claim no more jobs, finish its attempts, and exit.
#[utoipa::path(post, path = "/v1/workers/{id}/drain", tag = "workers", operation_id = "drain_worker",
    params(("id" = uuid::Uuid, Path, description = "The worker")),
    responses((status = 202, description = "The worker learns it with its next heartbeat"),
              (status = 404, description = "No such worker", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn drain(
    State(app): State<App>,
    Segments(id): Segments<WorkerId>,
) -> Result<StatusCode, ApiError> {
    app.store.drain_worker(id).await??;
    Ok(StatusCode::ACCEPTED)
}

/// Query of a list of workers.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct WorkerQuery {
    /// `next_cursor` of the previous page.
    #[param(value_type = Option<String>)]
    cursor: Option<WorkerId>,
    /// Maximum of rows of the page.
    #[param(schema_with = limit_schema)]
    limit: Option<u32>,
}

/// Lists workers, newest first, with device, jobs and progress.
#[utoipa::path(get, path = "/v1/workers", tag = "workers", operation_id = "list_workers", params(WorkerQuery),
    responses((status = 200, description = "A page of workers", body = Page<WorkerView>)))]
pub(crate) async fn list(
    State(app): State<App>,
    uri: Uri,
    Params(query): Params<WorkerQuery>,
) -> Result<Response, ApiError> {
    let (mut workers, next) = app.store.workers(query.cursor, limit(query.limit)?).await?;
    workers.iter_mut().for_each(|worker| app.progress.add_to_worker(worker));
    Ok(page(&uri, workers, next))
}
