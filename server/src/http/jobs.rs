//! Jobs: submit, look, cancel, retry.

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

use super::access::Caller;
use super::aside::aside;
use super::at_hand::at_hand;
use super::extract::{Document, Params, Segments};
use super::page::{cursor, label, limit, limit_schema, page};
use super::priority;
use super::problem::{ApiError, Kind};
use super::submissions::Reserved;
use crate::app::App;
use crate::document::read_envelope;
use crate::queue::Refusal;
use crate::store::{JobFilter, NewJob};

/// Submits one scenario.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs", operation_id = "submit_job",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "Sent again with the same key, it is made once")),
    request_body = JobEnvelope,
    responses((status = 202, description = "Queued, or answered from the store", body = JobView),
              (status = 422, description = "Every fault", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn submit(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<(StatusCode, [(HeaderName, String); 1], Json<JobView>), ApiError> {
    let limits = app.config.limits;
    let _open = app.mesh_gate.read().await;
    let meshes = at_hand(&app, &document).await?;
    let (envelope, scenario) =
        aside(move || read_envelope(&meshes, &limits, document)).await?.map_err(ApiError::faults)?;
    priority::allow(&caller, "/priority", envelope.priority)?;
    let id = JobId(reserved.id());
    let job = NewJob {
        id,
        token: caller.0.as_ref().to_owned(),
        scenario,
        priority: envelope.priority,
        labels: envelope.labels,
        needs: envelope.needs,
        max_wall_s: envelope.max_wall_s,
        frame_interval_s: envelope.frame_interval_s,
        cache: envelope.cache,
    };
    app.store.insert_job(job, app.clock.now()).await?;
    app.work.notify_waiters();
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, format!("/v1/jobs/{id}"))], Json(view(&app, id).await?)))
}

/// Which jobs to list.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct JobQuery {
    /// Only jobs in this state.
    state: Option<JobState>,
    /// Only jobs that failed so.
    failure: Option<FailureClass>,
    /// Only jobs of this design point; of one sweep alone.
    pub(super) point: Option<u32>,
    /// Only jobs with this label: `key` or `key=value`.
    #[serde(default, deserialize_with = "label")]
    #[param(value_type = Option<String>)]
    label: Option<(String, Option<String>)>,
    /// `next_cursor` of the page before.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Rows of the page.
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
        let detail = "point is the index of a design point of one sweep: ask /v1/sweeps/{id}/jobs";
        return Err(ApiError::new(Kind::InvalidQuery, detail));
    }
    list_filtered(&app, &uri, query.filter()?).await
}

/// Lists what the filter lets through, with the progress of what runs.
pub(super) async fn list_filtered(app: &App, uri: &Uri, filter: JobFilter) -> Result<Response, ApiError> {
    let (mut jobs, next) = app.store.jobs(filter).await?;
    jobs.iter_mut().for_each(|job| app.progress.show(job));
    Ok(page(uri, jobs, next))
}

/// One job.
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "show_job",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The job", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn show(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<JobView>, ApiError> {
    view(&app, id).await.map(Json)
}

/// The job as it is now.
pub(super) async fn view(app: &App, id: JobId) -> Result<JobView, ApiError> {
    let mut job = app.store.job(id).await?.ok_or(Refusal::NoJob)?;
    app.progress.show(&mut job);
    Ok(job)
}

/// Cancels a job: at once when it is queued, with the next heartbeat when it runs.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", tag = "jobs", operation_id = "cancel_job",
    params(("id" = uuid::Uuid, Path, description = "The job")),
    responses((status = 200, description = "The job as it is now", body = JobView),
              (status = 404, description = "No such job", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn cancel(
    State(app): State<App>,
    Segments(id): Segments<JobId>,
) -> Result<Json<JobView>, ApiError> {
    app.store.cancel_job(id, app.clock.now()).await??;
    view(&app, id).await.map(Json)
}

/// What to retry.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct RetryQuery {
    /// Only what failed so.
    pub(super) class: Option<FailureClass>,
}

/// Queues a failed or cancelled job again.
#[utoipa::path(post, path = "/v1/jobs/{id}/retry", tag = "jobs", operation_id = "retry_job",
    params(("id" = uuid::Uuid, Path, description = "The job"), RetryQuery),
    responses((status = 200, description = "The job as it is now", body = JobView),
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
