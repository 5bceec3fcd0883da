//! Jobs: submit, list, show, cancel, retry, pause, resume.

use axum::extract::State;
use axum::http::{HeaderName, StatusCode, Uri, header};
use axum::response::Response;
use axum::{Extension, Json};
use roost_api::ids::JobId;
use roost_api::job::{FailureClass, JobEnvelope, JobState, JobView};
use roost_api::page::Page;
use roost_api::problem::Problem;
use serde::Deserialize;
use utoipa::IntoParams;

use super::blocking::run_blocking;
use super::extract::{Document, Params, Segments};
use super::page::{cursor, label, limit, limit_schema, page};
use super::priority::check_priority;
use super::problem::{ApiError, ProblemKind};
use super::submissions::Reserved;
use crate::document::read_envelope;
use crate::queue::Refusal;
use crate::state::{App, Caller};
use crate::store::{JobFilter, NewJob};

/// Submits one scenario as a job.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs", operation_id = "submit_job",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "A repeat with the same key creates nothing new")),
    request_body = JobEnvelope,
    responses((status = 202, description = "The job: queued, or succeeded with a stored result", body = JobView),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn submit(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<(StatusCode, [(HeaderName, String); 1], Json<JobView>), ApiError> {
    let limits = app.config.limits;
    let _open = app.mesh_gate.read().await;
    let meshes = app.mesh_cache.meshes_of(&document, &app.store).await?;
    let (envelope, scenario) =
        run_blocking(move || read_envelope(&meshes, &limits, document)).await?.map_err(ApiError::faults)?;
    check_priority(&caller, "/priority", envelope.priority)?;
    let id = JobId(reserved.id());
    let job = NewJob {
        id,
        token: caller.token.to_string(),
        scenario,
        priority: envelope.priority,
        labels: envelope.labels,
        needs: envelope.needs,
        max_wall_s: envelope.max_wall_s,
        frame_interval_s: envelope.frame_interval_s,
        cache: envelope.cache,
        shared_fill: envelope.shared_fill,
    };
    app.store.insert_job(job, app.clock.now()).await?;
    app.work.notify_waiters();
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, format!("/v1/jobs/{id}"))], Json(view(&app, id).await?)))
}

/// Query of a list of jobs.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct JobQuery {
    /// Only jobs in this state.
    state: Option<JobState>,
    /// Only jobs of this failure class.
    failure: Option<FailureClass>,
    /// Only jobs of this design point. Allowed for the jobs of one sweep only.
    pub(super) point: Option<u32>,
    /// Only jobs with this label: `key` or `key=value`.
    #[serde(default, deserialize_with = "label")]
    #[param(value_type = Option<String>)]
    label: Option<(String, Option<String>)>,
    /// `next_cursor` of the previous page.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Maximum of rows of the page.
    #[param(schema_with = limit_schema)]
    limit: Option<u32>,
}

impl JobQuery {
    /// The filter for the store.
    pub(super) fn filter(self) -> Result<JobFilter, ApiError> {
        let limit = limit(self.limit)?;
        Ok(JobFilter {
            sweep: None,
            state: self.state,
            failure: self.failure,
            point: self.point,
            label: self.label,
            before: cursor(self.cursor)?,
            limit,
        })
    }
}

/// Lists jobs, newest first.
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs", operation_id = "list_jobs", params(JobQuery),
    responses((status = 200, description = "A page of jobs", body = Page<JobView>)))]
pub(crate) async fn list(
    State(app): State<App>,
    uri: Uri,
    Params(query): Params<JobQuery>,
) -> Result<Response, ApiError> {
    if query.point.is_some() {
        let detail = "point is allowed for the jobs of one sweep only: use /v1/sweeps/{id}/jobs";
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    list_filtered(&app, &uri, query.filter()?).await
}

/// Lists the jobs of a filter, with their progress.
pub(super) async fn list_filtered(app: &App, uri: &Uri, filter: JobFilter) -> Result<Response, ApiError> {
    let (mut jobs, next) = app.store.jobs(filter).await?;
    jobs.iter_mut().for_each(|job| app.progress.add_to_job(job));
    Ok(page(uri, jobs, next))
}

/// Shows a job. While it is queued, `waiting` says why.
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "show_job",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The job", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn show(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<JobView>, ApiError> {
    view_with_reason(&app, id).await.map(Json)
}

/// The current view of a job, with the reason why it waits.
pub(super) async fn view_with_reason(app: &App, id: JobId) -> Result<JobView, ApiError> {
    let mut job = view(app, id).await?;
    if job.state == JobState::Queued {
        job.waiting = app.waiting(id).await?;
    }
    Ok(job)
}

/// The current view of a job.
pub(super) async fn view(app: &App, id: JobId) -> Result<JobView, ApiError> {
    let mut job = app.store.job(id).await?.ok_or(Refusal::NoJob)?;
    app.progress.add_to_job(&mut job);
    Ok(job)
}

/// Cancels a job: immediately if it is queued, with the next heartbeat of its worker if it runs.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", tag = "jobs", operation_id = "cancel_job",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The job after the change", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn cancel(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<JobView>, ApiError> {
    app.store.cancel_job(id, app.clock.now()).await??;
    view(&app, id).await.map(Json)
}

/// Query of a retry.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct RetryQuery {
    /// Only jobs of this failure class.
    pub(super) class: Option<FailureClass>,
}

/// Queues a failed or cancelled job again.
#[utoipa::path(post, path = "/v1/jobs/{id}/retry", tag = "jobs", operation_id = "retry_job",
    params(("id" = uuid::Uuid, Path, description = "The job"), RetryQuery),
    responses((status = 200, description = "The job after the change", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The job is neither failed nor cancelled", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn retry(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
    Params(query): Params<RetryQuery>,
) -> Result<Json<JobView>, ApiError> {
    app.store.retry_job(id, query.class).await??;
    app.work.notify_waiters();
    view(&app, id).await.map(Json)
}

/// Pauses a job: no worker claims it, and a running one is preempted with the next heartbeat of its worker.
#[utoipa::path(post, path = "/v1/jobs/{id}/pause", tag = "jobs", operation_id = "pause_job",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The job after the change", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn pause(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<JobView>, ApiError> {
    app.store.pause_job(id, true).await??;
    view(&app, id).await.map(Json)
}

/// Resumes a paused job.
#[utoipa::path(post, path = "/v1/jobs/{id}/resume", tag = "jobs", operation_id = "resume_job",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The job after the change", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn resume(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<JobView>, ApiError> {
    app.store.pause_job(id, false).await??;
    app.work.notify_waiters();
    view(&app, id).await.map(Json)
}
